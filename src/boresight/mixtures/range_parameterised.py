"""Range-parameterised bank: one filter for each cell of the range, weighted by what they foresee.

[pradeep] section 2.2. After N. Peach, "Bearings-Only Tracking Using a Set of Range-Parameterised
Extended Kalman Filters", 1995.
Differs from it, by errata P6 and P8: gain function and likelihood. What it leaves open are settings
here: how many cells, between which ranges, with what spread (that of a uniform range in the cell),
when a cell goes, and what is told. Cells grow geometrically, so that all have the same relative
spread of range. Sensors that hear a cone have the cells twice, once on each side of their axis.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.filters import ekf, mgekf, sigma
from boresight.filters.modified_polar import ModifiedPolar
from boresight.filters.start import CONTACT_MPS, on_bearing
from boresight.filters.steps import Method, State, Surprise, Updating
from boresight.lanes import Leaf, Vector
from boresight.maths import Gaussian, mirror, missing, select
from boresight.maths.mixing import greatest, matched, moments, weigh
from boresight.mixtures.weights import reweigh
from boresight.models.motion import Motion
from boresight.models.sensors import Radar, Sensor

Array = Any
Told = Literal["moments", "best cell"]
SPEED_MPS = CONTACT_MPS
MOST_CELLS = 200
FUSED_ON_CONES = 3  # modified polar cells a side: more are more operations than a program has

_MEMBERS: Mapping[str, Any] = {
    "ekf": lambda: Updating(formula=ekf.update),
    "iekf": lambda: Updating(formula=ekf.update_iterated),
    "mgekf": lambda: Updating(formula=mgekf.update),
    "ukf": sigma.unscented,
    "ckf": sigma.cubature,
    "modified-polar": ModifiedPolar,
}


def range_cells(nearest_m: float, farthest_m: float, cells: int) -> tuple[Array, Array]:
    """Middle and spread of each cell's range, m, each (cells,): limits grow geometrically."""
    edges = np.geomspace(nearest_m, farthest_m, cells + 1)
    return (edges[:-1] + edges[1:]) / 2.0, np.diff(edges) / np.sqrt(12.0)


@dataclass(frozen=True, kw_only=True)
class RangeParameterised:
    """The bank; its settings.

    Attributes:
        member: the filter of a cell: ekf, iekf, mgekf, ukf, ckf or modified-polar.
        cells: how many.
        nearest_m, farthest_m: between which ranges, m.
        overlap: spread of a cell's range over that of a uniform range in it. At 1
            the mixture dips by half between its cells; at 1.5 it is nearly flat.
        prune: a cell whose share is below this goes; the greatest never does.
        told: `moments` of the mixture, or the `best cell` alone.
    """

    member: str = "ekf"
    cells: int = 6
    nearest_m: float = 1_000.0
    farthest_m: float = 20_000.0
    overlap: float = 1.0
    prune: float = 1e-3
    told: Told = "moments"

    def __post_init__(self) -> None:
        """Settings are checked."""
        if self.member not in _MEMBERS:
            raise unknown("member", self.member, _MEMBERS)
        if self.told not in get_args(Told):
            raise UsageError(f"told={self.told!r} is unknown", next_step=f"use {get_args(Told)}")
        if not (isinstance(self.cells, int) and 1 <= self.cells <= MOST_CELLS):
            raise UsageError(
                f"cells={self.cells!r} is not a whole number from 1 to {MOST_CELLS}",
                next_step="a dozen with overlap=1.5 leave no gaps",
            )
        if not 0.0 < self.nearest_m < self.farthest_m < np.inf:
            raise UsageError(
                f"range cells from {self.nearest_m:g} to {self.farthest_m:g} m",
                why="the nearest range must be above zero and below the farthest",
            )
        if not 0.0 < self.overlap < np.inf:
            raise UsageError(f"overlap={self.overlap!r} is not above zero and finite")
        if not 0.0 <= self.prune < 1.0:
            raise UsageError(f"prune={self.prune!r} is not a share, from 0 to below 1")

    @cached_property
    def filter(self) -> Method:
        """What filters one cell."""
        return _MEMBERS[self.member]()  # type: ignore[no-any-return]

    @property
    def plain(self) -> bool:
        """It keeps several Gaussians."""
        return False

    @property
    def ranges(self) -> tuple[Array, Array]:
        """Middle and spread of each cell's range, m."""
        middles, spreads = range_cells(self.nearest_m, self.farthest_m, self.cells)
        return middles, self.overlap * spreads

    def start(
        self, z: Array, motion: Motion, sensor: Sensor, *, speed_mps: float = SPEED_MPS
    ) -> Gaussian:
        """On the first bearing, at all ranges at once; `begin` parts them.

        Args:
            z: (lanes, k) first plots; of a cone, the side towards positive y of its sensor.
            motion: state layout, in the plane.
            sensor: bearings, or a cone.
            speed_mps: spread of each velocity.
        """
        _check(motion, sensor)
        middles, spreads = self.ranges
        middle = middles.mean()
        spread = float(np.sqrt(np.mean(spreads**2 + (middles - middle) ** 2)))
        assert isinstance(sensor, Radar)  # noqa: S101 - only radars have these components
        return on_bearing(z, motion, sensor, float(middle), spread, speed_mps=speed_mps)

    def layout(self, motion: Motion, sensor: Sensor) -> dict[str, Leaf]:
        """What each cell keeps, by name and number, and the weights."""
        _check(motion, sensor)
        if self.member == "modified-polar" and _is_cone(sensor) and self.cells > FUSED_ON_CONES:
            raise UsageError(
                f"{self.cells} cells in modified polar coordinates, on both sides of a cone",
                why="one compiled step holds no more than three such cells a side",
                next_step="use cells=3, or rp-ekf; tma runs cells one by one and takes any number",
            )
        own, count = self.filter.layout(motion, sensor), self._count(sensor)
        kept = {f"{name}_{i}": leaf for i in range(count) for name, leaf in own.items()}
        return kept | {"log_weights": Vector(count)}

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """Cells along the direction in which the start lies; its own range is not used.

        The angle's uncertainty, the velocity, and further states are the start's; their
        correlations with the position are not.
        """
        cells, _ = starts(self, start, motion, sensor)
        states = [self.filter.begin(cell, motion, sensor) for cell in cells]
        return self._keep(states, np.zeros(len(cells)))

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """Every cell on its own."""
        moved = [
            self.filter.predict(each, motion, sensor, dt) for each in self._states(state, sensor)
        ]
        return self._keep(moved, state["log_weights"])

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """Every cell on its own, then their weights: pradeep (xi), (xii)."""
        before = list(state["log_weights"])
        pairs = [
            self.filter.update(each, z, motion, sensor) for each in self._states(state, sensor)
        ]
        likelihoods = [surprise.loglik for _, surprise in pairs]
        logs = reweigh(before, likelihoods, self.prune)
        surprise = _surprise(before, [surprise for _, surprise in pairs])
        return self._keep([kept for kept, _ in pairs], np.array(logs)), surprise

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """Moments of the mixture, or the best cell."""
        parts = [self.filter.output(s, motion, sensor) for s in self._states(state, sensor)]
        logs = list(state["log_weights"])
        if self.told == "best cell":
            best = parts[0]
            for log, part in zip(logs[1:], parts[1:], strict=True):
                ahead = log >= 0.0
                best = Gaussian(*(select(ahead, new, old) for new, old in zip(part, best)))  # noqa: B905
            return best
        return moments(weigh(logs), parts)

    def _count(self, sensor: Sensor) -> int:
        return self.cells * (1 + _is_cone(sensor))

    def _keep(self, states: list[State], logs: Array) -> State:
        kept = {f"{name}_{i}": leaf for i, one in enumerate(states) for name, leaf in one.items()}
        return kept | {"log_weights": logs}

    def _states(self, state: State, sensor: Sensor) -> list[State]:
        """What each cell keeps."""
        found: list[dict[str, Any]] = [{} for _ in range(self._count(sensor))]
        for name, leaf in state.items():
            stem, _, number = name.rpartition("_")
            if number.isdigit():
                found[int(number)][stem] = leaf
        return list(found)


def starts(
    bank: RangeParameterised, start: Gaussian, motion: Motion, sensor: Sensor
) -> tuple[list[Gaussian], Array]:
    """Where each cell begins, and its side: -1 left of the axis, 1 right of it, 0 without sides."""
    _check(motion, sensor)
    sides = [start, _mirrored(start, motion, sensor)][: 1 + _is_cone(sensor)]
    spots = zip(*bank.ranges, strict=True)
    cells = [
        _at_range(each, float(r), float(sd), motion, sensor) for r, sd in spots for each in sides
    ]
    # Both sides have the same range, so cells come in pairs, the start's own side first.
    own = np.array([1.0, -1.0]) if len(sides) > 1 else np.zeros(1)
    return cells, np.tile(own, bank.cells)


def _is_cone(sensor: Sensor) -> bool:
    """Whether the sensor cannot tell one side of its axis from the other."""
    return "cone_rad" in sensor.names


def _check(motion: Motion, sensor: Sensor) -> None:
    """The bank begins on an angle in the plane, at ranges that nothing measures."""
    if "range_m" in sensor.names or not {"azimuth_rad", "cone_rad"} & set(sensor.names):
        raise UsageError(
            f"a range-parameterised bank has no use for {', '.join(sensor.names)}",
            why="it begins on a bearing, at every range that may be",
            next_step="use bs.Bearings(azimuth_deg=...) or bs.ConicalBearings(...), or mekf",
        )
    if motion.dims != 2:
        raise UsageError(
            f"a range-parameterised bank cannot follow {motion.dims} dimensions",
            why="a bearing is an angle in the plane",
            next_step="use a motion with dims=2",
        )


def _origin(motion: Motion, sensor: Sensor) -> tuple[Array, Array]:
    """Position (d,) and axes (d, d) of the sensor in the track frame, at the first step."""
    pose, d = getattr(sensor, "pose", None), motion.dims
    if pose is None:
        return np.zeros(d), np.eye(d)
    return pose.position_m.reshape(-1, 3)[0, :d], pose.rotation.reshape(-1, 3, 3)[0, :d, :d]


def _at_range(
    start: Gaussian, middle: float, spread: float, motion: Motion, sensor: Sensor
) -> Gaussian:
    """The start moved along its line of sight, its covariance stretched and turned with it."""
    d, (origin, _) = motion.dims, _origin(motion, sensor)
    away = start.mean[:d] - origin
    length = np.sqrt(away @ away)
    along = away / length
    # Across the line of sight the angle's spread is what it was: lengths grow with the range.
    across = (np.eye(d) - np.outer(along, along)) * (middle / length)
    mean, cov = np.array(start.mean), np.array(start.cov)
    mean[:d] = origin + middle * along
    cov[:d, d:], cov[d:, :d] = 0.0 * cov[:d, d:], 0.0 * cov[d:, :d]
    cov[:d, :d] = spread * spread * np.outer(along, along) + across @ start.cov[:d, :d] @ across.T
    return Gaussian(mean, mirror(cov))


def _mirrored(start: Gaussian, motion: Motion, sensor: Sensor) -> Gaussian:
    """The start on the other side of the sensor's axis; a velocity stays what it is."""
    d, (origin, axes) = motion.dims, _origin(motion, sensor)
    flip = axes.T @ np.diag([1.0, *[-1.0] * (d - 1)]) @ axes
    mean, cov = np.array(start.mean), np.array(start.cov)
    mean[:d] = origin + flip @ (start.mean[:d] - origin)
    cov[:d, :d] = flip @ start.cov[:d, :d] @ flip.T
    return Gaussian(mean, cov)


def _surprise(logs: list[Any], parts: list[Surprise]) -> Surprise:
    """How surprising a plot was for the bank, by the moments of its forecast.

    Members that are gone, or whose forecast is not finite, have no say.
    """
    fit = [abs(part.loglik) < np.inf for part in parts]
    prior = [select(good, log, -1e9) for good, log in zip(fit, logs, strict=True)]
    top = greatest(prior)
    prior = [log - top for log in prior]
    heard = [select(good, part.loglik, -1e9) for good, part in zip(fit, parts, strict=True)]
    joint = [log + each for log, each in zip(prior, heard, strict=True)]
    best = greatest(joint)
    scale = np.log(sum(np.exp(log) for log in prior))
    loglik = best + np.log(sum(np.exp(log - best) for log in joint)) - scale
    pairs = [_forecast(prior, fit, parts, i) for i in range(len(parts[0].innovation))]
    nu, variance = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
    seen = [select(missing(v), 0.0, 1.0) for v in variance]
    squares = [there * n * n / select(there > 0.5, v, 1.0)
               for there, n, v in zip(seen, nu, variance, strict=True)]  # fmt: skip
    return Surprise(sum(squares), parts[0].dof, loglik, nu, variance)


def _forecast(logs: list[Any], fit: list[Any], parts: list[Surprise], i: int) -> tuple[Any, Any]:
    """Innovation of one component and its variance, over the cells."""
    nus = [select(good, part.innovation[i], 0.0) for good, part in zip(fit, parts, strict=True)]
    variances = [select(good, part.variance[i], 0.0) for good, part in zip(fit, parts, strict=True)]
    return matched(logs, nus, variances)
