"""Line-of-sight filter: Gaussians, slightly bent, in the frame that turns with the target.

[lineofsight] The boresight authors, "A filter in the frame of the line of sight".
Differs from it: nothing; it is described here and in docs/decisions/0005-line-of-sight.md.

The state is range, angles, radial and transverse velocity relative to the sensor. There the plot is
linear, an unknown velocity and white acceleration look the same from every side, and what is not
linear is one term: a target that flies straight on at right angles seems to accelerate outwards, by
its transverse velocity squared over the range. In the plane the prior of that velocity is split
into several Gaussians, each of which keeps the parabola that the term makes of it. In space one
Gaussian is predicted to second order. What is told are the moments in the track frame, in the plane
in closed form.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Literal, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters import line_of_sight_plane, line_of_sight_space
from boresight.filters.line_of_sight_mixture import split
from boresight.filters.line_of_sight_moments import Part
from boresight.filters.line_of_sight_plane import Shift, condition
from boresight.filters.posterior import LOG_TWO_PI, innovation
from boresight.filters.start import SPEED_MPS, one_plot
from boresight.filters.steps import State, Surprise
from boresight.lanes import Leaf, Matrix, Vector
from boresight.maths import Gaussian, gradient, jacobian, mirror, missing, select
from boresight.maths.mixing import greatest, matched, mix, weigh
from boresight.models.components import Component
from boresight.models.motion import ConstantVelocity, Motion, WithHeightOffset
from boresight.models.sensors import Sensor

Array = Any


@dataclass(frozen=True, kw_only=True)
class LineOfSight:
    """The filter; its settings.

    Attributes:
        components: how many Gaussians the prior of the transverse velocity is split into: 1, 3 or
            5; None for 5 in the plane and 1 in space, where it must be 1.
        told: `mean` is right on average over all targets that may have made these plots, and
            of least mean square error; `unbiased` is right on average over the plots that a target
            may make, further out by the variance of the angle.
    """

    components: int | None = None
    told: Literal["mean", "unbiased"] = "mean"

    def __post_init__(self) -> None:
        """Settings are checked."""
        if self.components not in (None, 1, 3, 5):
            raise UsageError(f"components={self.components!r} is not 1, 3 or 5")
        if self.told not in ("mean", "unbiased"):
            raise UsageError(f"told={self.told!r} is unknown", next_step="use mean or unbiased")

    @property
    def plain(self) -> bool:
        """It keeps other things than it tells."""
        return False

    def start(
        self, z: Array, motion: Motion, sensor: Sensor, *, speed_mps: float = SPEED_MPS
    ) -> Gaussian:
        """The conventional conversion, which `begin` takes back exactly."""
        return one_plot(z, motion, sensor, speed_mps=speed_mps)

    def layout(self, motion: Motion, sensor: Sensor) -> dict[str, Leaf]:
        """Means, covariances and bends of the parts, their weights, and the platform's pose."""
        parts, n, d = self._count(motion), len(motion.names), motion.dims
        kept = {"means": Matrix(parts, n), "covs": Matrix(parts, n * (n + 1) // 2)}
        kept["bends"] = Matrix(parts, 2)
        kept["log_weights"] = Vector(parts)
        if _platform(sensor, d):
            kept |= {"position": Vector(d), "rotation": Matrix(d, d), "velocity": Vector(d)}
        return kept

    def _count(self, motion: Motion) -> int:
        """Number of parts; UsageError for what the filter cannot follow."""
        inner = motion.inner if isinstance(motion, WithHeightOffset) else motion
        if not isinstance(inner, ConstantVelocity):
            raise UsageError(
                f"the line-of-sight filter cannot follow a {type(inner).__name__}",
                why="it knows straight flight disturbed by white acceleration",
                next_step="use ConstantVelocity, or another filter",
            )
        if motion.dims == 3 and self.components not in (None, 1):
            raise UsageError(
                f"components={self.components} in three dimensions",
                why="the transverse velocity has two directions there, and one part does",
                next_step="leave components out",
            )
        return self.components or (5 if motion.dims == 2 else 1)

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """Seen from the sensor, to first order; then the transverse velocity is split."""
        frame, platform = _frame(motion), _platform(sensor, motion.dims)
        mean, J = jacobian(lambda state: _see(state, platform), start.mean)
        whole = frame.see(Gaussian(mean, J @ start.cov @ J.T))
        means, cov, weights = split(whole, motion.dims + 1, self._count(motion))
        logs = np.log(weights / np.max(weights))
        straight = start.mean[:2] * 0.0
        return _keep([Part(mean, cov, straight) for mean in means], logs, platform)

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """Every part moves; a platform's turn and acceleration are a known shift."""
        frame, platform = _frame(motion), _platform(sensor, motion.dims)
        before = _kept(state)
        shift = _shift(before, platform, dt) if before and platform else None
        noise = motion.noise(dt)
        moved = [frame.move(part, dt, noise, shift) for part in _parts(state)]
        return _keep(moved, state["log_weights"], platform)

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """Component by component, what is linear first; the plot's likelihood weighs the parts."""
        parts, logs, platform = _parts(state), list(state["log_weights"]), _kept(state)
        spreads: list[Any] = [1.0] * len(parts)  # products of variances: one logarithm a part
        z, components = sensor.independent(z, motion)
        seen: list[Any] = []
        squares: list[Any] = []
        nus: list[Any] = [None] * len(components)
        variances: list[Any] = [None] * len(components)
        views = [View(each, motion, sensor, platform) for each in components]
        for i in sorted(range(len(z)), key=lambda i: views[i].turn):
            there = select(missing(z[i]), 0.0, 1.0)
            told = [views[i].condition(part, z[i], there) for part in parts]
            parts = [part for part, _, _ in told]
            nus[i], s = matched(_weighed(logs, spreads), *list(zip(*told, strict=True))[1:])
            variances[i] = select(there < 0.5, np.nan, s)
            seen.append(there)
            squares.append(nus[i] * nus[i] / s)
            logs = [
                log - 0.5 * there * (nu * nu * (1.0 / s))
                for log, (_, nu, s) in zip(logs, told, strict=True)
            ]
            spreads = [
                spread * select(there < 0.5, 1.0, s)
                for spread, (_, _, s) in zip(spreads, told, strict=True)
            ]
        logs = _weighed(logs, spreads)
        top = greatest(logs)
        kept = _keep(parts, np.array([log - top for log in logs]), platform)
        share = sum(np.exp(kept["log_weights"])) / sum(np.exp(state["log_weights"]))
        loglik = top + np.log(share) - 0.5 * LOG_TWO_PI * sum(seen)
        return kept, Surprise(sum(squares), sum(seen), loglik, np.array(nus), np.array(variances))

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """The moments of all parts together, in the track frame."""
        del sensor
        frame, parts, weights = _frame(motion), _parts(state), weigh(state["log_weights"])
        each = [frame.tell(part) for part in parts]
        means = [g.mean for g in each]
        if self.told == "unbiased":
            means = [frame.unbiased(part) for part in parts]
        mean = mix(weights, means)
        off = [g.mean - mean for g in each]
        cov = mix(weights, [g.cov + np.outer(d, d) for g, d in zip(each, off, strict=True)])
        if platform := _kept(state):
            mean, J = jacobian(lambda relative: _show(relative, platform), mean)
            cov = J @ cov @ J.T
        return Gaussian(mean, mirror(cov))


def _weighed(logs: Sequence[Any], spreads: Sequence[Any]) -> list[Any]:
    """Logarithms of weights: exponents, and the roots of the products of variances."""
    return [log - 0.5 * np.log(s) for log, s in zip(logs, spreads, strict=True)]


class Platform(NamedTuple):
    """A sensor's position (d,), axes (d, d) and velocity (d,) at the time of a step."""

    position: Array
    rotation: Array
    velocity: Array


@dataclass(frozen=True)
class View:
    """One component of a plot as the parts see it."""

    component: Component
    motion: Motion
    sensor: Sensor
    platform: Platform | None

    @property
    def index(self) -> int | None:
        """Which state is measured, if it is one."""
        states = ["range_m", "azimuth_rad", "elevation_rad"][: self.motion.dims]
        if getattr(self.sensor, "range_rate_correlation", None) is None:
            states.append("range_rate_mps")  # else it has a share of the range in it
        name = self.component.name
        return states.index(name) if name in states else None

    @property
    def turn(self) -> int:
        """When it is used: angles first, for what they tell of the way across unbends the range."""
        return 2 if self.index is None else int(not self.component.is_angle)

    def condition(self, part: Any, measured: Any, there: Any) -> tuple[Any, Any, Any]:
        """The part, its innovation, and the variance of that."""
        value, h = self._linear(part.mean)
        nu = innovation(self.component, measured, value)[1]
        noise = self.component.sigma * self.component.sigma
        post, s = condition(part, h, nu, noise, there)
        return post, nu, s

    def _linear(self, mean: Array) -> tuple[Any, Array]:
        """What is expected, and its gradient: a unit vector for what the state contains."""
        index = self.index
        if index is None:
            return gradient(self._value, mean)
        return mean[index], np.eye(len(mean))[index]

    def _value(self, state: Array) -> Any:
        return self.component.value(_show(_frame(self.motion).leave(state), self.platform))


def _frame(motion: Motion) -> ModuleType:
    return line_of_sight_plane if motion.dims == 2 else line_of_sight_space


def _platform(sensor: Sensor, dims: int) -> Platform | None:
    """Where the sensor is, if it is anywhere but at the origin."""
    pose = getattr(sensor, "pose", None)
    if pose is None:
        return None
    return Platform(pose.position_m[:dims], pose.rotation[:dims, :dims], pose.velocity_mps[:dims])


def _shift(before: Platform, after: Platform, dt: Any) -> Shift:
    drift = before.position + dt * before.velocity - after.position
    change = before.velocity - after.velocity
    away = np.concatenate([after.rotation @ drift, after.rotation @ change])
    return Shift(after.rotation @ before.rotation.T, away)


def _see(state: Array, platform: Platform | None) -> Array:
    """A state of the track frame relative to the sensor, in the sensor's frame."""
    if platform is None:
        return state
    (d, turn, v), n = platform, len(platform.position)
    return np.concatenate([turn @ (state[:n] - d), turn @ (state[n : 2 * n] - v), state[2 * n :]])


def _show(relative: Array, platform: Platform | None) -> Array:
    """The inverse of `_see`."""
    if platform is None:
        return relative
    (d, turn, v), n = platform, len(platform.position)
    p, u, rest = relative[:n], relative[n : 2 * n], relative[2 * n :]
    return np.concatenate([turn.T @ p + d, turn.T @ u + v, rest])


def _keep(parts: Sequence[Any], logs: Array, platform: Platform | None) -> dict[str, Array]:
    """What is kept of one target; covariances as upper triangles."""
    upper = np.triu_indices(len(parts[0].mean))
    kept = {"means": np.array([part.mean for part in parts])}
    kept["covs"] = np.array([part.cov[upper] for part in parts])
    kept["bends"] = np.array([part.bend for part in parts])
    return kept | {"log_weights": logs} | (platform._asdict() if platform else {})


def _parts(state: State) -> list[Part]:
    n = state["means"].shape[1]
    rows, columns = np.triu_indices(n)
    index = np.zeros((n, n), dtype=int)
    index[rows, columns] = index[columns, rows] = np.arange(len(rows))
    covs = state["covs"][:, index]
    return [Part(*each) for each in zip(state["means"], covs, state["bends"], strict=True)]


def _kept(state: State) -> Platform | None:
    """The platform's pose at the step before."""
    return Platform(*(state[f] for f in Platform._fields)) if "position" in state else None
