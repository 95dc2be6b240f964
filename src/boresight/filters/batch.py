"""Batch maximum a posteriori: the one track without noise that fits all plots best.

[marquardt1963] D. W. Marquardt, "An Algorithm for Least-Squares Estimation of Nonlinear
Parameters"; [nardone1984] has the maximum likelihood estimator for bearings.
Differs from them: a prior in information form, which may be silent on range; angles wrapped;
several starts, of which the lowest cost wins. All lanes and starts take their steps together.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters.batch_problem import Normal, Prior, Problem
from boresight.filters.fisher import bound
from boresight.filters.reversible import check_reversible
from boresight.lanes import Rate
from boresight.maths import Gaussian
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of
from boresight.models.sensors import Sensor

Array = Any
__all__ = [
    "BatchEstimate",
    "Prior",
    "batch_map",
    "gaussian_prior",
    "range_prior",
    "velocity_prior",
]
ITERATIONS = 60
SETTLED = 1e-7  # of a standard deviation: a step so short is the last
_ROUNDING = 1e-13  # of a cost: what a sum over plots leaves undecided
_FIRST_DAMPING, _LEAST_DAMPING = 1e-3, 1e-12


def velocity_prior(motion: Motion, speed_mps: float) -> Prior:
    """Each velocity around zero with this spread; nothing about the position.

    Args:
        motion: state layout.
        speed_mps: standard deviation of each velocity.
    """
    n, d = len(motion.names), motion.dims
    weights = np.zeros(n)
    weights[d : 2 * d] = 1.0 / speed_mps**2
    return Prior(np.zeros(n), np.diag(weights))


def range_prior(motion: Motion, speed_mps: float, nearest_m: float, farthest_m: float) -> Prior:
    """As `velocity_prior`, with a range: the mean and spread of one uniform between limits.

    Without it, a target that no manoeuvre has told the range of settles on own ship itself.

    Args:
        motion: state layout.
        speed_mps: standard deviation of each velocity.
        nearest_m: lower limit of the distance at the first plot, m.
        farthest_m: upper limit, m.
    """
    middle, spread = (nearest_m + farthest_m) / 2.0, (farthest_m - nearest_m) / np.sqrt(12.0)
    return velocity_prior(motion, speed_mps)._replace(range_m=middle, range_sd_m=float(spread))


def gaussian_prior(start: Gaussian) -> Prior:
    """The prior that a filter starts from: mean (..., n), cov (..., n, n)."""
    return Prior(np.asarray(start.mean), np.linalg.inv(start.cov))


@dataclass(frozen=True, eq=False)
class BatchEstimate:
    """The best track of every lane.

    Attributes:
        mean: (lanes, n), at the last plot.
        cov: (lanes, n, n), inverse of the information; infinite where that is singular.
        information: (lanes, n, n) at the last plot: Fisher's along the best track, and the prior's.
        cost: (lanes,) half the sum of squares of all residuals and of the prior's.
        converged: (lanes,) whether the last step was short.
        residual: (lanes, steps, k) measured minus predicted, angles wrapped; NaN where missing.
        start: (lanes,) which start led there.
        first: (lanes, n) the track at the first plot.
        costs: (lanes, starts) what every start came to.
    """

    mean: Array
    cov: Array
    information: Array
    cost: Array
    converged: Array
    residual: Array
    start: Array
    first: Array
    costs: Array


def batch_map(
    z: Array,
    motion: Motion,
    sensor: Sensor,
    dt: Array,
    *,
    prior: Prior | None,
    starts: Array,
    iterations: int = ITERATIONS,
) -> BatchEstimate:
    """Fit the best track without noise to all plots of every lane.

    Args:
        z: (lanes, steps, k) plots, SI units and radians, NaN where missing.
        motion: how targets move; without noise.
        sensor: what is measured; its numbers fixed, or by step.
        dt: (1, steps), s before each plot; what comes before the first one does not matter.
        prior: at the first plot; None for maximum likelihood.
        starts: (lanes, starts, n), states at the last plot, such as the means of a bank's cells.
        iterations: at most so many steps.

    Raises:
        UsageError: the motion has noise, or shapes do not fit.
    """
    z, starts = np.asarray(z, dtype=float), np.asarray(starts, dtype=float)
    _check(z, sensor, starts)
    check_reversible(motion, float(np.max(dt)))
    lanes, count, n = starts.shape
    problem = Problem(z, motion, sensor, np.concatenate([[0.0], np.ravel(dt)[1:]]), prior)
    tracks = problem.back(starts.reshape(-1, n))
    ends, cost, settled = _descend(problem, tracks, np.repeat(np.arange(lanes), count), iterations)
    costs = np.where(np.isfinite(cost), cost, np.inf).reshape(lanes, count)
    best = np.argmin(costs, axis=1)
    rows = np.arange(lanes) * count + best
    mean, information, residual = problem.told(ends[rows])
    return BatchEstimate(
        mean=mean,
        cov=bound(information),
        information=information,
        cost=cost[rows],
        converged=settled[rows],
        residual=residual,
        start=best,
        first=ends[rows],
        costs=costs,
    )


def _descend(
    problem: Problem, tracks: Array, lane: Array, iterations: int
) -> tuple[Array, Array, Array]:
    """Where each track (m, n) ends, its cost, and whether it settled."""
    tracks, damping = tracks.copy(), np.full(len(tracks), _FIRST_DAMPING)
    settled = np.zeros(len(tracks), dtype=bool)
    at = problem.normal(tracks, lane)
    going = np.isfinite(at.cost)
    for _ in range(iterations):
        todo = np.flatnonzero(going)
        if not len(todo):
            break
        step, length = _step(Normal(*(part[todo] for part in at)), damping[todo])
        tried = tracks[todo] + step
        new = problem.normal(tried, lane[todo])
        better = new.cost <= at.cost[todo] * (1.0 + _ROUNDING)
        took = todo[better]
        tracks[took] = tried[better]
        for old, part in zip(at, new, strict=True):
            old[took] = part[better]
        factor = np.where(better, 0.1, 10.0)
        settled[took] = (length[better] < SETTLED) & (damping[took] <= _FIRST_DAMPING)
        damping[todo] = np.maximum(damping[todo] * factor, _LEAST_DAMPING)
        going[settled] = False
    return tracks, at.cost, settled


def _step(at: Normal, damping: Array) -> tuple[Array, Array]:
    """The damped step of Gauss and Newton, and its length in standard deviations."""
    diagonal = np.einsum("mii->mi", at.information)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = at.information * scale[:, :, None] * scale[:, None, :]
    pull = at.gradient * scale
    damped = scaled + damping[:, None, None] * np.eye(pull.shape[1])
    step = np.linalg.solve(damped, pull[..., None])[..., 0]
    return step * scale, np.sqrt(np.abs(np.sum(step * pull, axis=-1)))


def _check(z: Array, sensor: Sensor, starts: Array) -> None:
    """Shapes fit, and no number of the sensor belongs to one lane only."""
    if z.ndim != 3 or starts.ndim != 3 or len(z) != len(starts) or z.shape[2] != len(sensor.names):
        raise UsageError(
            f"plots {z.shape} and starts {starts.shape} do not fit",
            why=f"plots are (lanes, steps, {len(sensor.names)}), starts (lanes, starts, n)",
        )
    for name, (value, leaf) in numbers(sensor, "sensor").items():
        if rate_of(name, value, leaf)[0] & Rate.LANE:
            raise UsageError(f"{name} differs from lane to lane; a batch needs one for all")
