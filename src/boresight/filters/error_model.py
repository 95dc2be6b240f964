"""Error model: a sensor's errors from a reference, and plots without them (EMKF).

Paper: kashyap section 2, (4) and (5), Figures 1 and 2. This pass before the linear filter is ECMKF
(Cartesian channels); before the MEKF it is EMEKF (range, azimuth, elevation).
Differs from it: dZ is reference minus plot, wrapped in angles (errata K6, K10), so a corrected plot
is the plot plus the estimated error; channels are independent of each other; where a reference or a
component is missing, time passes and nothing else; all that the paper leaves open is a field of
`models.error_model.ErrorModel`.

The pass never reads a tracker's state. It is one formula for one target, run over all lanes.
"""

from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, Literal, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters import error_step
from boresight.filters.error_beside import Case
from boresight.lanes import Kernel, Rate, Scalar, Vector, make_kernel, pack_states, trace
from boresight.models.coordinates import CartesianPlots
from boresight.models.error_model import MODELS, ErrorModel, lookup
from boresight.models.parameters import numbers, rate_of, structure, with_numbers
from boresight.models.sensors import Radar

__all__ = ["MODELS", "Corrected", "ErrorModel", "correct"]
Array = Any


class Corrected(NamedTuple):
    """Plots without their estimated error, and what is known of it.

    Attributes:
        z: (runs, scans, k) of polar plots, (runs, scans, d) of Cartesian ones; NaN where missing.
        sensor: a radar, or Cartesian plots, with the noise of every plot: what a filter takes.
        error: (runs, scans, c), reference minus plot, as it was added to the plots.
        error_cov: (runs, scans, c, c) of the error about that.
        noise_cov: (runs, scans, c, c) of the plots' noise.
        probability: (runs, scans, c) of there being a bias; 1 where that is not asked.
    """

    z: Array
    sensor: Radar | CartesianPlots
    error: Array
    error_cov: Array
    noise_cov: Array
    probability: Array


def correct(
    plots_z: Array,
    reference: Array,
    dt: Any,
    sensor: Radar,
    *,
    model: str | ErrorModel = "random walk",
    frame: Literal["polar", "cartesian"] | None = None,
    threads: int = 1,
) -> Corrected:
    """Estimate the errors of plots against a reference, and take them out.

    Args:
        plots_z: (runs, scans, k), SI units and radians, NaN where missing.
        reference: (runs or 1, scans, d), d = 2 or 3: positions in the track frame, NaN where
            there is none.
        dt: seconds before each scan: a number, (1, scans), (runs, 1) or (runs, scans).
        sensor: the radar that measured the plots; its standard deviations are the nominal noise.
        model: an `ErrorModel`, or the name of one in `MODELS`.
        frame: of the channels, if not the model's own.
        threads: threads that share the runs; the result does not depend on it.

    Returns:
        The plots and the sensor for `mekf` (polar) or `kf` (Cartesian), and what was estimated.

    Raises:
        UsageError: an unknown model, a sensor without the channels, arrays that do not fit, a
            window whose differences make no covariance.
    """
    chosen = lookup(model) if isinstance(model, str) else model
    chosen = chosen if frame is None else replace(chosen, frame=frame)
    z, known = _fitting(plots_z, reference, sensor)
    case = Case(chosen, sensor, known.shape[-1])
    given = numbers(chosen, "model") | numbers(sensor, "sensor") | {"dt": (dt, Scalar())}
    rated = {name: rate_of(name, *pair) for name, pair in given.items()}
    rates = tuple(sorted((name, rate) for name, (rate, _) in rated.items()))
    values = {name: value for name, (_, value) in rated.items()} | {"z": z, "reference": known}
    empty = {
        name: np.zeros((len(z), *leaf.shape)) for name, leaf in error_step.layout(case).items()
    }
    kernel = _kernel(_Key(case), rates)
    start = pack_states(kernel.program.state, empty)
    told = kernel.run(start, values, z.shape[1], threads=threads)[1]
    return Corrected(sensor=_seen_by(case, told["noise_cov"]), **told)


def _fitting(z: Array, reference: Array, sensor: Radar) -> tuple[Array, Array]:
    """Plots and references of as many runs and scans; UsageError where they do not fit."""
    z, known = np.asarray(z, dtype=float), np.asarray(reference, dtype=float)
    if z.ndim != 3 or z.shape[-1] != len(sensor.names):
        raise UsageError(
            f"plots have shape {z.shape}; (runs, scans, {len(sensor.names)}) is needed",
            why=f"the sensor measures {', '.join(sensor.names)}",
        )
    fits = known.ndim == 3 and known.shape[0] in {1, len(z)} and known.shape[1] == z.shape[1]
    if not fits or known.shape[-1] not in {2, 3}:
        raise UsageError(
            f"the reference has shape {known.shape}, and the plots have {z.shape}",
            next_step="give a position, 2 or 3 numbers, for every run and scan; NaN where unknown",
        )
    return z, np.broadcast_to(known, (*z.shape[:2], known.shape[-1]))


def _seen_by(case: Case, noise_cov: Array) -> Radar | CartesianPlots:
    """The sensor of the corrected plots: with the window's noise, where there is a window."""
    if case.polar and not case.model.window:
        return case.sensor
    try:
        if case.polar:
            return _noisy(case.sensor, case.measured, noise_cov)
        return CartesianPlots(cov=noise_cov)
    except UsageError as error:
        if not case.model.window:
            raise
        raise UsageError(
            f"differences in a window of {case.model.window} make no covariance",
            why="they do not differ, or they are too few for channels that vary together",
            next_step="pass floor=0.01, or a longer window and warm_up",
        ) from error


def _noisy(sensor: Radar, measured: tuple[str, ...], noise_cov: Array) -> Radar:
    """The radar with the standard deviations of every plot."""
    sigma = np.moveaxis(np.sqrt(np.diagonal(noise_cov, 0, -2, -1)), -1, 0)
    fields = {
        name.replace("_rad", "_deg"): np.degrees(s) if name.endswith("_rad") else s
        for name, s in zip(measured, sigma, strict=True)
    }
    return replace(sensor, **fields)


class _Key:
    """Compares cases by what their formula depends on."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.identity = (structure(case.model), structure(case.sensor), case.dims)

    def __hash__(self) -> int:
        return hash(self.identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self.identity == other.identity


@lru_cache(maxsize=64)
def _kernel(key: _Key, rates: tuple[tuple[str, Rate], ...]) -> Kernel:
    case = key.case
    shapes = numbers(case.model, "model") | numbers(case.sensor, "sensor")
    leaves = {name: leaf for name, (_, leaf) in shapes.items()} | {"dt": Scalar()}
    inputs = {name: (leaves[name], rate) for name, rate in rates}
    inputs |= {"z": (Vector(len(case.sensor.names)), Rate.EACH)}
    inputs |= {"reference": (Vector(case.dims), Rate.EACH)}
    return make_kernel(
        trace(
            partial(_recorded, case),
            state=error_step.layout(case),
            inputs=inputs,
            outputs={name: (leaf, Rate.EACH) for name, leaf in error_step.told(case).items()},
        )
    )


def _recorded(case: Case, state: dict[str, Any], inputs: dict[str, Any]) -> tuple[Any, Any]:
    model = with_numbers(case.model, "model", inputs)
    sensor = with_numbers(case.sensor, "sensor", inputs)
    return error_step.step(replace(case, model=model, sensor=sensor), state, inputs)
