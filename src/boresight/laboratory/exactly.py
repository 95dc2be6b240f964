"""The exact posterior of a world, by importance sampling, where `experiments.posterior` has it."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from boresight.experiments.posterior import Flight, exact_posterior
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import simulate
from boresight.laboratory.intervals import ratio_interval
from boresight.laboratory.scores import Gathered
from boresight.laboratory.study import Study
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar

Array = Any
_RUNS = 100
_SEEN = ("range_m", "azimuth_rad")


class Exactly(NamedTuple):
    """How well the exact posterior mean does at the last scan.

    Attributes:
        squares: (runs,) squared position error of the first runs; None where there is none.
        remark: what it is, or why there is none.
    """

    squares: Array | None
    remark: str


UNASKED = Exactly(None, "")


def exact_of(study: Study, scenario: Scenario) -> Exactly:
    """The exact posterior of the first 100 runs at their last scan.

    It is that of a target that flies straight on, its velocity N(0, speed_mps² I) before its first
    plot and its position anywhere: what every start from one plot assumes.
    """
    reason = _unfit(scenario)
    if reason:
        return Exactly(None, f"No exact posterior of {scenario.name}: {reason}.")
    runs = min(study.runs, _RUNS)
    truth, plots = simulate(
        _with_first_plot(scenario),
        runs=runs,
        seed=study.seed,
        truth_run=0 if study.truth == "one" else None,
        noise_run=0 if study.noise == "one" else None,
    )
    flight = Flight(
        sensor=scenario.sensor,  # type: ignore[arg-type]  # `_unfit` has seen that it is a Radar
        range_m=float(plots.z[0, 0, 0]),
        speed_mps=scenario.speed_mps,
        dt_s=scenario.dt_s,
        scans=scenario.scans,
    )
    last = scenario.scans - 1
    found = exact_posterior(flight, plots.z, at=[last], seed=study.seed % 2**32)
    error = (found.mean[:, 0] - truth.states[:, last])[:, :2]
    remark = (
        f"The exact posterior of {scenario.name} is that of the first {runs} runs at the last scan "
        f"(least effective sample size {np.min(found.ess):,.0f}), for velocities of "
        f"N(0, {scenario.speed_mps:g}²) m/s before the first plot."
    )
    return Exactly(np.sum(np.square(error), axis=1), remark)


def _unfit(scenario: Scenario) -> str:
    """Why there is no exact posterior; empty where there is."""
    motion, sensor = scenario.motion, scenario.sensor
    is_straight = isinstance(motion, ConstantVelocity) and motion.accel_mps2 == 0.0
    if not is_straight or motion.dims != 2 or scenario.path is not None:
        return "its target must fly straight in the plane, without process noise"
    if not isinstance(sensor, Radar) or sensor.names != _SEEN or sensor.pose is not None:
        return "its sensor must be a radar at the origin that measures range and azimuth"
    if np.ndim(sensor.range_m) or np.ndim(sensor.azimuth_deg) or scenario.bias:
        return "its sensor's errors must be the same at every scan, and have no bias"
    if scenario.begin != "one plot" or scenario.detection < 1.0 or scenario.false_plots:
        return "filters must begin at one plot, and every scan have one plot, the target's"
    return ""


def _with_first_plot(scenario: Scenario) -> Scenario:
    """The same world, whose plots are all told: none is used up by a start."""
    return replace(scenario, begin="given")


def beside_exact(exactly: Exactly, gathered: Gathered, false_alarm: float) -> dict[str, Any]:
    """What `Cell.extra` holds: its RMSE, the contender's on the same runs, and their ratio."""
    if exactly.squares is None:
        return {}
    ours = np.square(gathered.runs["final_m"][: len(exactly.squares)])
    return {
        "exact_final_m": float(np.sqrt(np.mean(exactly.squares))),
        "final_rmse_m": float(np.sqrt(np.mean(ours))),
        "ratio_to_exact": ratio_interval(ours, exactly.squares, false_alarm),
    }
