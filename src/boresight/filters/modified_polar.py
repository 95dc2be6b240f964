"""Extended Kalman filter in modified polar coordinates, for bearings from own ship.

[aidala1983] V. J. Aidala and S. E. Hammel, "Utilization of Modified Polar Coordinates for
Bearings-Only Tracking".
The state is relative to own ship: rate of bearing, rate of range over range, bearing, and one over
range. While own ship sails straight on, the first three follow without the fourth: what bearings
tell before a manoeuvre stays apart from what they cannot tell.

Differs from it: own ship's velocity is its displacement over the interval, since positions are what
is known; further states of the motion are kept as they are; range and its inverse have the moments
of lognormal numbers, where a wide start is begun and where it is told.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters import ekf
from boresight.filters.start import CONTACT_MPS, on_bearing
from boresight.filters.steps import State, Surprise, gaussian_layout
from boresight.lanes import Leaf, Vector
from boresight.maths import Gaussian, jacobian, mirror, select, wrap
from boresight.models.components import FORMULAS, Component
from boresight.models.motion import Motion
from boresight.models.sensors import Radar, Sensor

Array = Any
_ANYWHERE = 1_000.0  # m: angles look alike from every range
_WIDEST = 1.0  # of the squared relative spread of a range


@dataclass(frozen=True, kw_only=True)
class ModifiedPolar:
    """The filter; its settings.

    Attributes:
        range_m, range_sd_m: of the range where it begins on a first bearing, m: those of a uniform
            range from 1 to 20 km.
        nearest_m, farthest_m: an estimate beyond is put there, so that it stays finite and ahead:
            a target that passes close, or an inverse range that noise has driven below zero.
    """

    range_m: float = 10_500.0
    range_sd_m: float = 5_485.0
    nearest_m: float = 10.0
    farthest_m: float = 1e6
    told: str = "lognormal"
    begun: str = "lognormal"

    def __post_init__(self) -> None:
        """Settings are checked."""
        if not 0.0 < self.nearest_m < self.range_m < self.farthest_m < np.inf:
            raise UsageError(
                f"a range of {self.range_m:g} m between {self.nearest_m:g} and "
                f"{self.farthest_m:g} m",
                why="it must lie between the nearest and the farthest, and those above zero",
            )
        if not 0.0 < self.range_sd_m < np.inf:
            raise UsageError(f"range_sd_m={self.range_sd_m!r} is not above zero")

    @property
    def plain(self) -> bool:
        """It tells something else than it keeps."""
        return False

    def start(
        self, z: Array, motion: Motion, sensor: Sensor, *, speed_mps: float = CONTACT_MPS
    ) -> Gaussian:
        """On the first bearing, at the range of the settings.

        Args:
            z: (lanes, k) first plots.
            motion: state layout, in the plane.
            sensor: bearings, or a cone (then the side towards positive y of its pose).
            speed_mps: spread of each velocity.
        """
        if not (isinstance(sensor, Radar) and {"azimuth_rad", "cone_rad"} & set(sensor.names)):
            raise UsageError(
                f"no start on a bearing from {', '.join(sensor.names)}",
                next_step="give the start: start=Gaussian(mean, cov)",
            )
        return on_bearing(z, motion, sensor, self.range_m, self.range_sd_m, speed_mps=speed_mps)

    def layout(self, motion: Motion, sensor: Sensor) -> dict[str, Leaf]:
        """Mean, covariance, and own ship's position and velocity at the last step."""
        del sensor
        if motion.dims != 2 or len(motion.names) < 4:
            raise UsageError(
                f"modified polar coordinates of a {type(motion).__name__} in {motion.dims} "
                "dimensions",
                why="they are those of positions and velocities in a plane",
                next_step="use ConstantVelocity(..., dims=2)",
            )
        return gaussian_layout(motion) | {"position": Vector(2), "velocity": Vector(2)}

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """Velocities along and across the line of sight, then over the range."""
        del motion
        position = _position(sensor)
        pose = getattr(sensor, "pose", None)
        velocity = np.zeros(2) if pose is None else pose.velocity_mps[:2]
        if self.begun == "first":
            own = np.concatenate([position, velocity])
            mean, J = jacobian(lambda plane: self._polar(plane, own), start.mean)
            return self._keep(Gaussian(mean, mirror(J @ start.cov @ J.T)), position, velocity)
        mean, J = jacobian(lambda s: _sighted(_less(s, position, velocity)), start.mean)
        kept = _over(Gaussian(mean, J @ start.cov @ J.T))
        return self._keep(kept, position, velocity)

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """Through the plane, exactly; own ship has moved to where it is now."""
        before, now = state["position"], _position(sensor)
        still = dt <= 0.0
        velocity = select(still, state["velocity"], (now - before) / select(still, 1.0, dt))
        own, later = np.concatenate([before, state["velocity"]]), np.concatenate([now, velocity])

        def moved(kept: Array) -> Array:
            return motion.move(self._plane(kept, own), dt)

        mean, J = jacobian(lambda kept: self._polar(moved(kept), later), state["mean"])
        _, G = jacobian(lambda plane: self._polar(plane, later), moved(state["mean"]))
        cov = J @ state["cov"] @ J.T + G @ motion.noise(dt) @ G.T
        return self._keep(Gaussian(mean, mirror(cov)), now, velocity)

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """By an extended Kalman filter, in which a bearing is linear."""
        own = np.concatenate([state["position"], state["velocity"]])
        z, components = sensor.independent(z, motion)
        seen = [self._seen(component, own) for component in components]
        post = ekf.update(Gaussian(state["mean"], state["cov"]), z, seen)
        kept = self._keep(Gaussian(post.mean, post.cov), state["position"], state["velocity"])
        return kept, Surprise(*post[2:])

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """Moments of position and velocity."""
        del motion, sensor
        own = np.concatenate([state["position"], state["velocity"]])
        if self.told == "first":
            mean, J = jacobian(lambda kept: self._plane(kept, own), state["mean"])
            return Gaussian(mean, mirror(J @ state["cov"] @ J.T))
        told = _over(Gaussian(state["mean"], state["cov"]))
        mean, J = jacobian(lambda s: _shown(s, own), told.mean)
        return Gaussian(mean, mirror(J @ told.cov @ J.T))

    def _plane(self, kept: Array, own: Array) -> Array:
        """Position and velocity in the plane, and what follows."""
        turn, rate, bearing, inverse = kept[:4]
        r = 1.0 / self._within(inverse)
        return _shown(np.array([turn * r, rate * r, bearing, r, *kept[4:]]), own)

    def _polar(self, plane: Array, own: Array) -> Array:
        """The inverse of `_plane`."""
        across, along, bearing, r = (s := _sighted(_less(plane, own[:2], own[2:])))[:4]
        inverse = self._within(1.0 / r)
        return np.array([across * inverse, along * inverse, bearing, inverse, *s[4:]])

    def _within(self, inverse: Any) -> Any:
        """One over a range that is neither too near nor too far."""
        far, near = 1.0 / self.farthest_m, 1.0 / self.nearest_m
        return select(inverse > far, select(inverse < near, inverse, near), far)

    def _keep(self, kept: Gaussian, position: Array, velocity: Array) -> State:
        mean = np.array(kept.mean)
        mean[2], mean[3] = wrap(mean[2]), self._within(mean[3])
        return {"mean": mean, "cov": kept.cov, "position": position, "velocity": velocity}

    def _seen(self, component: Component, own: Array) -> Component:
        """The component as a formula of the kept state; an angle has no share of the range."""

        def value(kept: Array) -> Any:
            if component.is_angle:
                kept = np.array([*kept[:3], 1.0 / _ANYWHERE, *kept[4:]])
            return component.value(self._plane(kept, own))

        return Component(component.name, value, component.sigma)


def _position(sensor: Sensor) -> Array:
    """Own ship's position (2,)."""
    pose = getattr(sensor, "pose", None)
    return np.zeros(2) if pose is None else pose.position_m[:2]


def _less(state: Array, position: Array, velocity: Array) -> Array:
    """A state relative to own ship."""
    return np.concatenate([state[:2] - position, state[2:4] - velocity, state[4:]])


def _sighted(relative: Array) -> Array:
    """Velocities across and along the line of sight, bearing, range, and what follows."""
    p, v = relative[:2], relative[2:4]
    r, bearing = FORMULAS["range_m"](p, v), FORMULAS["azimuth_rad"](p, v)
    c, s = np.cos(bearing), np.sin(bearing)
    return np.array([c * v[1] - s * v[0], c * v[0] + s * v[1], bearing, r, *relative[4:]])


def _shown(sighted: Array, own: Array) -> Array:
    """The inverse of `_sighted`, with own ship added."""
    across, along, bearing, r = sighted[:4]
    c, s = np.cos(bearing), np.sin(bearing)
    relative = [c * r, s * r, c * along - s * across, s * along + c * across]
    return np.concatenate([np.array(relative) + own, sighted[4:]])


def _over(state: Gaussian) -> Gaussian:
    """Moments of (a/x, b/x, c, 1/x, ...) from those of (a, b, c, x, ...): x is lognormal.

    The others are Gaussian beside its logarithm; under weights 1/x their means shift by minus their
    covariance with it.
    """
    x, q = state.mean[3], state.cov[3, 3] / (state.mean[3] * state.mean[3])
    q = select(q < _WIDEST, q, _WIDEST)
    n = len(state.mean)
    over = np.array([1.0, 1.0, 0.0, 1.0] + [0.0] * (n - 4))
    mean, cov = np.array(state.mean), np.array(state.cov)
    # With the logarithm; as correlated as with x, where a lognormal can be.
    k = cov[3] / (x * np.sqrt(1.0 + 0.5 * q))
    mean[3], k[3] = 1.0, 0.0 * x
    cov[3, :], cov[:, 3] = 0.0 * k, 0.0 * k
    y = (1.0 + q) / x
    a, out = mean - 2.0 * k, np.array(cov)
    tilted = (1.0 + q) * cov + q * np.outer(a, a) - np.outer(a, k) - np.outer(k, a) - np.outer(k, k)
    half = cov - np.outer(mean - k, k)
    for i in range(n):
        for j in range(n):
            if over[i] and over[j]:
                out[i, j] = y * y * tilted[i, j]
            elif over[i]:
                out[i, j] = y * half[i, j]
            elif over[j]:
                out[i, j] = y * half[j, i]
    told = np.array([y * (m - s) if o else m for m, s, o in zip(mean, k, over, strict=True)])
    return Gaussian(told, mirror(out))
