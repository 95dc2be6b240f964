"""kashyap's filters as passes: plots and a reference become corrected plots, these a track.

Paper: kashyap, Figures 1(b) and 2, appendix.
Differs from it: the error model reads plots and reference only, never the tracker (it could not:
nothing comes back from there), so each method is a preparation of plots and a filter of the
catalogue. The reference is the truth at every scan, unless a method is given another.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np

from boresight.experiments.metrics import channels, elements
from boresight.experiments.montecarlo import filtered
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth
from boresight.filters.error_model import correct
from boresight.filters.recursion import Estimate
from boresight.models.conversions import convert
from boresight.models.coordinates import CartesianPlots
from boresight.models.error_model import ErrorModel
from boresight.models.polar import Given
from boresight.models.sensors import Sensor

Array = Any


class Ready(NamedTuple):
    """Plots made ready for a filter.

    Attributes:
        entry: the filter, by its name in the catalogue.
        sensor: what plots are now those of, R included.
        plots: corrected, converted or as they were.
        settings: of the filter.
    """

    entry: str
    sensor: Sensor
    plots: Plots
    settings: dict[str, Any]


Method = Callable[[Scenario, Truth, Plots], Ready]


def positions(truth: Truth) -> Array:
    """Where targets were, (runs, scans, d)."""
    return truth.states[..., elements(truth.names, "position")]


def polar(truth: Truth) -> Array:
    """The same in range and angles, (runs, scans, d)."""
    at = positions(truth)
    return np.stack(list(channels(at).values())[: at.shape[-1]], axis=-1)


def error_modelled(
    world: Scenario,
    truth: Truth,
    plots: Plots,
    *,
    frame: Literal["polar", "cartesian"],
    model: str | ErrorModel,
    entry: str,
    reference: Callable[[Truth], Array] = positions,
    settings: dict[str, Any] | None = None,
) -> Ready:
    """The error model's pass, then a filter: EMEKF in the polar frame, ECMKF in the Cartesian."""
    radar: Any = world.sensor
    found = correct(plots.z, reference(truth), plots.dt, radar, model=model, frame=frame)
    return Ready(entry, found.sensor, plots._replace(z=found.z), settings or {})


def emekf(model: str | ErrorModel, *, entry: str = "mekf", **rest: Any) -> Method:
    """EMEKF: (9) to (11) on plots corrected in range and angles."""
    return partial(error_modelled, frame="polar", model=model, entry=entry, **rest)


def ecmkf(model: str | ErrorModel, **rest: Any) -> Method:
    """ECMKF: (6) to (8) on plots converted by (3) and corrected there."""
    return partial(error_modelled, frame="cartesian", model=model, entry="kf", **rest)


def plain(entry: str, **settings: Any) -> Method:
    """A filter on plots as they are, told the noise that they have."""

    def ready(world: Scenario, _truth: Truth, plots: Plots) -> Ready:
        return Ready(entry, world.sensor, plots, settings)

    return ready


def cmkf_d(name: Literal["cmkf-d-t", "cmkf-d-m"]) -> Method:
    """CMKF-D: plots debiased, and R, by what the truth says (T) or the plot (M)."""

    def ready(world: Scenario, truth: Truth, plots: Plots) -> Ready:
        sigma = np.array([c.sigma for c in world.sensor.components(world.motion)])
        told = Given(np.moveaxis(polar(truth), -1, 0), np.zeros(len(sigma)))
        found = convert(name, np.moveaxis(plots.z, -1, 0), sigma, told)
        cov = np.moveaxis(found.cov, (0, 1), (-2, -1))
        points = plots._replace(z=np.moveaxis(found.mean, 0, -1))
        return Ready("kf", CartesianPlots(cov=cov), points, {})

    return ready


def track(
    method: Method,
    world: Scenario,
    truth: Truth,
    plots: Plots,
    outputs: tuple[str, ...] = ("mean",),
) -> Estimate:
    """Run a method over plots."""
    return run_ready(method(world, truth, plots), world, outputs)


def run_ready(ready: Ready, world: Scenario, outputs: tuple[str, ...] = ("mean",)) -> Estimate:
    """Run the filter that plots were made ready for."""
    return filtered(
        ready.entry,
        world.motion,
        ready.sensor,
        ready.plots,
        settings=ready.settings,
        outputs=outputs,
    )
