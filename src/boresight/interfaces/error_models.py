"""The verb `error_model`: plots beside a reference, and plots without what the sensor adds."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters.error_model import correct
from boresight.interfaces import given
from boresight.models.checks import as_number
from boresight.models.coordinates import CartesianPlots
from boresight.models.error_model import ErrorModel, lookup
from boresight.models.sensors import Radar

Array = Any


class CorrectedPlots(NamedTuple):
    """What `error_model` gives: `bs.run("mekf", motion, found.sensor, found.plots)`.

    Attributes:
        plots: what was given, with corrected `z`; (runs, scans, k), or (runs, scans, d) in the
            Cartesian frame.
        sensor: the radar, or Cartesian plots for the filter `kf`, with the noise of every plot.
        error: (runs, scans, c) what was added, reference minus plot: range and angles in m and
            rad, or coordinates of the track frame in m.
        error_cov: (runs, scans, c, c) of the error about that.
        noise_cov: (runs, scans, c, c) of the plots' noise.
        probability: (runs, scans, c) of there being a bias; 1 where that is not asked.
    """

    plots: Any
    sensor: Radar | CartesianPlots
    error: Array
    error_cov: Array
    noise_cov: Array
    probability: Array


def error_model(
    plots: Any,
    reference: Any,
    radar: Radar,
    *,
    model: str | ErrorModel = "random walk",
    dt: Any = None,
    threads: int = 1,
    **settings: Any,
) -> CorrectedPlots:
    """Estimate a radar's errors against a reference, and take them out of its plots.

    Args:
        plots: what `simulate` gives, or an array (runs, scans, k) in SI units and radians with
            NaN where nothing was measured.
        reference: (runs or 1, scans, 2 or 3) positions in the track frame, NaN where there is
            none; or the truth that `simulate` gives.
        radar: what measured the plots.
        model: "random walk", "random walk, always" or "kashyap"; or an `ErrorModel`.
        dt: seconds before each scan, as in `run`. Left out: what `plots` carries.
        threads: threads that share the runs; the result does not depend on it.
        settings: fields of `ErrorModel` to change, such as `frame="cartesian"`.

    Raises:
        UsageError: an unknown model or setting, arrays that do not fit, an infinite plot.
    """
    if not isinstance(radar, Radar):
        raise UsageError(
            f"the radar is a {type(radar).__name__}",
            next_step="pass error_model(plots, reference, radar), with radar=bs.Radar(...)",
        )
    chosen = _model(model, settings)
    z = given.plots(getattr(plots, "z", plots), radar)
    steps = given.steps(getattr(plots, "dt", None) if dt is None else dt, *z.shape[:2])
    clear = replace(radar, atmosphere=None)
    found = correct(
        radar.without_air(z), _positions(reference), steps, clear, model=chosen, threads=threads
    )
    changed = plots._replace(z=found.z) if hasattr(plots, "_replace") else found.z
    return CorrectedPlots(changed, *found[1:])


def _model(model: Any, settings: dict[str, Any]) -> ErrorModel:
    """The model by name or as it is, with settings changed; UsageError where one is unknown."""
    chosen = lookup(model) if isinstance(model, str) else model
    if not isinstance(chosen, ErrorModel):
        raise UsageError(
            f"the model is a {type(model).__name__}",
            next_step='pass model="random walk", "kashyap" or a bs.ErrorModel(...)',
        )
    known = ErrorModel.__dataclass_fields__
    for name in settings:
        if name not in known:
            raise UsageError(
                f"an error model has no setting {name!r}", next_step=f"use {', '.join(known)}"
            )
    return replace(chosen, **settings)


def _positions(reference: Any) -> Array:
    """Positions of a truth, or those that were given."""
    if not hasattr(reference, "states"):
        array = np.asarray(as_number("reference", reference))
        if np.isinf(array).any():
            raise UsageError(
                "the reference holds an infinite position", next_step="give NaN where unknown"
            )
        return array
    axes = [name in ("x_m", "y_m", "z_m") for name in reference.names]
    return reference.states[..., axes]
