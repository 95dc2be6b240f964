"""bordonaro's target at rest and its targets under way, tracked by every filter on the same plots.

Paper: bordonaro sections 2.3, 2.4 and 3; Figures 6 to 12.
Differs from it: what it leaves open is assumed as its table says; every filter starts from its own
conversion of the first plot (erratum B9).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from boresight.experiments.consistency import line_of_sight_axes
from boresight.experiments.metrics import errors, nees
from boresight.experiments.papers.bordonaro_printed import PRINTED_DUCM
from boresight.experiments.scenario import FOOT_M, Scenario
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.filters.converted import Converted
from boresight.filters.recursion import Estimate, Recursion, run_recursion
from boresight.filters.steps import Method
from boresight.models.motion import ConstantVelocity, Motion
from boresight.models.sensors import Radar

Array = Any
OTHERS = ("UCM", "MUCM")
COMPARED = (*OTHERS, "DUCM")
PRINTED = "DUCM as printed"
METHODS: dict[str, Method] = {name: Converted(conversion=name.lower()) for name in COMPARED}
METHODS[PRINTED] = PRINTED_DUCM


class Tracked(NamedTuple):
    """Errors of one filter, feet and feet a second, (runs, scans) each.

    Attributes:
        along: of the position, along the line of sight, positive away from the sensor.
        square: of the position, squared; of DUCM after (31).
        velocity_along, velocity_square: of the velocity; zeros for a target at rest.
        nees: e' P^-1 e per state, without (31).
    """

    along: Array
    square: Array
    velocity_along: Array
    velocity_square: Array
    nees: Array


def at_rest(world: Scenario, sigma_deg: float, runs: int, seed: int) -> dict[str, Tracked]:
    """Every filter on a target at rest, bearing noise `sigma_deg`."""
    radar = Radar(range_m=world.sensor.range_m, azimuth_deg=sigma_deg)  # type: ignore[attr-defined]
    return tracked(replace(world, sensor=radar), world.motion, METHODS, runs, seed)


def nearly_constant(accel_ftps2: float) -> ConstantVelocity:
    """What filters take straight flight for."""
    return ConstantVelocity(accel_mps2=FOOT_M * accel_ftps2, dims=2)


def tracked(
    world: Scenario, motion: Motion, methods: Mapping[str, Method], runs: int, seed: int
) -> dict[str, Tracked]:
    """Filters on the same plots; `motion` is what they believe."""
    truth, plots = simulate(replace(world, begin="given"), runs=runs, seed=seed)
    axes = line_of_sight_axes(truth.states[..., : motion.dims])[..., 0, :]
    found = {}
    for name, method in methods.items():
        estimate = scaled = filtered(method, motion, world, plots)
        if name == "DUCM":
            scaled = filtered(Converted(scale_output=True), motion, world, plots)
        found[name] = _errors(estimate, scaled, truth, axes)
    return found


def filtered(method: Method, motion: Motion, world: Scenario, plots: Plots) -> Estimate:
    """A filter over all plots, the first of which makes its start."""
    start = method.start(plots.z[:, 0], motion, world.sensor, speed_mps=world.speed_mps)
    rest = plots.z.copy()
    rest[:, 0] = np.nan
    recursion = Recursion(method, motion, world.sensor)
    return run_recursion(recursion, rest, plots.dt, start, outputs=("mean", "cov"), threads=2)


def _errors(estimate: Estimate, scaled: Estimate, truth: Truth, axes: Array) -> Tracked:
    error, d = errors(estimate, truth) / FOOT_M, axes.shape[-1]
    position, velocity = error[..., :d], error[..., d:]
    if not velocity.shape[-1]:
        velocity = np.zeros_like(position)
    return Tracked(
        along=np.sum(position * axes, axis=-1),
        square=np.sum((errors(scaled, truth)[..., :d] / FOOT_M) ** 2, axis=-1),
        velocity_along=np.sum(velocity * axes, axis=-1),
        velocity_square=np.sum(velocity**2, axis=-1),
        nees=nees(estimate, truth) / error.shape[-1],
    )
