"""One filter over many runs of pradeep's scenario: its errors, its weights, and when it converges.

Errors are those of the paper's figures: range, bearing, course and speed.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from boresight.experiments.bounds import bound_per_trajectory
from boresight.experiments.metrics import nees, squared_error
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth
from boresight.filters.fisher import polar_sd
from boresight.filters.recursion import Estimate
from boresight.filters.start import on_bearing
from boresight.maths import Gaussian
from boresight.mixtures.weights import GONE
from boresight.models.sensors import Radar
from boresight.target_motion.convergence import errors_inside, first_and_sustained
from boresight.target_motion.result import Criteria

Array = Any
QUANTITIES = {"range": "m", "bearing": "°", "course": "°", "speed": "m/s"}


@dataclass(frozen=True, eq=False)
class Tracked:
    """What a filter made of many runs.

    Attributes:
        truth: what there was.
        own: (scans, 2) own ship's positions.
        estimate: mean, cov, and a bank's weights.
        criteria: limits of what is good enough.
    """

    truth: Truth
    own: Array
    estimate: Estimate
    criteria: Criteria

    @cached_property
    def polar(self) -> tuple[Array, Array]:
        """Estimated and true range (m), bearing, course (°) and speed (m/s), (runs, scans, 4)."""
        return polar(self.estimate.mean, self.own), polar(self.truth.states, self.own)

    @cached_property
    def error(self) -> Array:
        """(runs, scans, 4): of these, angles wrapped; infinite where they are no numbers."""
        off = np.subtract(*self.polar)
        off[..., 1:3] = (off[..., 1:3] + 180.0) % 360.0 - 180.0
        return np.where(np.isfinite(off), off, np.inf)

    @cached_property
    def square(self) -> Array:
        """(runs, scans): squared error of the position, m²."""
        return squared_error(self.estimate, self.truth)

    @cached_property
    def nees(self) -> Array:
        """(runs, scans): normalised error squared, over the four states."""
        return nees(self.estimate, self.truth) / self.truth.states.shape[-1]

    @cached_property
    def inside(self) -> Array:
        """(runs, scans): whether all four errors are tolerated at once."""
        return errors_inside(*self.polar, self.criteria)

    @cached_property
    def times(self) -> tuple[Array, Array]:
        """(runs,) since when they are: for the first time, and for good, s; NaN for never."""
        return first_and_sustained(self.inside, self.truth.time_s)

    @property
    def converged(self) -> Array:
        """(runs,): since when for good, s, never counting as the end of the run."""
        return np.nan_to_num(self.times[1], nan=float(self.truth.time_s[-1]))

    @cached_property
    def claimed_range_sd(self) -> Array:
        """(scans,): root mean square of what the filter claims for the range, m."""
        sd = polar_sd(self.estimate.cov, self.estimate.mean, self.own)[..., 0]
        return np.sqrt(np.mean(sd**2, axis=0))

    @cached_property
    def weights(self) -> Array:
        """(runs, scans, cells) of a bank; exactly zero where a cell is gone."""
        logs = self.estimate.kept_log_weights
        weights = np.where(logs > GONE, np.exp(logs), 0.0)
        return weights / np.sum(weights, axis=-1, keepdims=True)

    @property
    def alive(self) -> Array:
        """(runs, scans): how many cells are still processed."""
        return np.sum(self.weights > 0.0, axis=-1)


def polar(states: Array, own: Array) -> Array:
    """Range (m), bearing, course (°), speed (m/s): (..., scans, 4) of states and own ship's."""
    x, y = np.moveaxis(states[..., :2] - own, -1, 0)
    vx, vy = np.moveaxis(states[..., 2:4], -1, 0)
    angles = (np.degrees(np.arctan2(y, x)), np.degrees(np.arctan2(vy, vx)))
    return np.stack([np.hypot(x, y), *angles, np.hypot(vx, vy)], axis=-1)


def own_ship(world: Scenario) -> Array:
    """(scans, 2): own ship's positions."""
    return world.sensor.pose.position_m[0, :, :2]  # type: ignore[attr-defined]


def bounds(world: Scenario, truth: Truth, plots: Plots) -> Array:
    """(runs, scans, 4, 4): Cramér-Rao bounds, with the start's spread laid at each truth.

    A filter's own start is spread across its bearing as far as it believes the target to be.
    """
    away = truth.start[:, :2] - own_ship(world)[0]
    prior = _started(world, away, np.hypot(*away.T), world.range_sd_m)
    return bound_per_trajectory(truth, plots._replace(prior=prior), world.motion, world.sensor)


def with_range(plots: Plots, world: Scenario, mean: float, sd: float) -> Plots:
    """The same plots, for a filter that starts at another range on the same bearing."""
    away = plots.prior.mean[:, :2] - own_ship(world)[0]
    return plots._replace(prior=_started(world, away, mean, sd))


def _started(world: Scenario, away: Array, mean: Any, sd: float) -> Gaussian:
    """A start on the bearing of positions (runs, 2) seen from own ship."""
    assert isinstance(world.sensor, Radar)  # noqa: S101 - bearings are a radar's
    bearing = np.arctan2(away[:, 1], away[:, 0])[:, None]
    return on_bearing(bearing, world.motion, world.sensor, mean, sd, speed_mps=world.speed_mps)
