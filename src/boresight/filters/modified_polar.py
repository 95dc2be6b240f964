"""Kalman filter in modified polar coordinates: bearings alone, range apart from what they tell.

[aidala1983] V. J. Aidala and S. E. Hammel, "Utilization of Modified Polar Coordinates for
Bearings-Only Tracking".
The state is relative to own ship: rate of bearing, rate of range over range, bearing, and one over
range. While own ship sails straight on, the first three follow without the fourth, so what bearings
cannot tell yet does not disturb what they can.

Differs from it: the prediction is taken at cubature points, since first order, its own, grows too
sure of itself (a setting; 3,000 runs of pradeep's scenario: normalised squared errors of 1.25 per
state at 800 s, against 1.07); own ship's velocity is its displacement over the interval, since
positions are what is known; a wide start has the moments of one over a uniform range, since to
first order it would lie too far away and too sure of it. Noise may drive one over the range below
zero for a while: only its product with own ship's manoeuvre counts, which is regular there. To
hold it above loses tracks for good; it is held where a range is told.
"""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from boresight.errors import UsageError
from boresight.filters import ekf, sigma
from boresight.filters.start import CONTACT_MPS, on_bearing
from boresight.filters.steps import State, Surprise, gaussian_layout
from boresight.lanes import Leaf, Vector
from boresight.maths import Gaussian, cholesky, jacobian, mirror, select, wrap
from boresight.models.components import FORMULAS, Component
from boresight.models.motion import ConstantVelocity, Motion
from boresight.models.sensors import Radar, Sensor

Array = Any
Predicted = Literal["points", "first order"]
_ANYWHERE = 1_000.0  # m: angles look alike from every range
_NEAR = 1e-12  # least square of what a step leaves of a range
_NARROW, _WIDEST = 1e-3, 0.95  # of half a uniform range's width over its middle


@dataclass(frozen=True, kw_only=True)
class ModifiedPolar:
    """The filter; its settings.

    Attributes:
        range_m, range_sd_m: of the range where it begins on a first bearing, m: those of a uniform
            range from 1 to 20 km.
        nearest_m, farthest_m: a range beyond is told as this one: of a target that passes close, or
            while one over the range is near zero or below; its spread is told as no more than
            the farthest.
        predicted: by cubature `points`, or to `first order`, which is the extended Kalman filter.
    """

    range_m: float = 10_500.0
    range_sd_m: float = 5_485.0
    nearest_m: float = 10.0
    farthest_m: float = 200_000.0
    predicted: Predicted = "points"

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
        if self.predicted not in get_args(Predicted):
            raise UsageError(
                f"predicted={self.predicted!r} is unknown", next_step=f"use {get_args(Predicted)}"
            )

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
        if not (isinstance(motion, ConstantVelocity) and motion.dims == 2):
            raise UsageError(
                f"modified polar coordinates of a {type(motion).__name__}, dims={motion.dims}",
                why="they are those of straight motion in a plane",
                next_step="use ConstantVelocity(..., dims=2), or another filter",
            )
        return gaussian_layout(motion) | {"position": Vector(2), "velocity": Vector(2)}

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """Velocities along and across the line of sight, and the range, then all over the range."""
        del motion
        own = _position(sensor), _velocity(sensor)
        there, J = jacobian(lambda state: _sighted(state - np.concatenate(own)), start.mean)
        return _keep(_over(Gaussian(there, J @ start.cov @ J.T)), *own)

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """Exactly; what own ship did beside sailing on is divided by the range."""
        before, now = state["position"], _position(sensor)
        still = dt <= 0.0
        velocity = select(still, state["velocity"], (now - before) / select(still, 1.0, dt))
        swerve = before + state["velocity"] * dt - now, state["velocity"] - velocity

        def moved(kept: Array) -> Array:
            """The kept state dt later, seen from where own ship then is."""
            turn, rate, bearing, inverse = kept
            p, v = (inverse * each for each in _ahead(swerve, bearing))
            q = np.array([1.0 + rate * dt, turn * dt]) + p
            return _renewed(q, np.array([rate, turn]) + v, bearing, inverse)

        if self.predicted == "points":
            L, _ = cholesky(state["cov"])
            mean, D, rest = sigma.regress(moved, np.subtract, state["mean"], L, sigma.CUBATURE)
            cov = D @ D.T + rest
        else:
            mean, J = jacobian(moved, state["mean"])
            cov = J @ state["cov"] @ J.T
        G = _pushed(mean)
        return _keep(Gaussian(mean, mirror(cov + G @ motion.noise(dt) @ G.T)), now, velocity)

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """By an extended Kalman filter, in which a bearing is linear."""
        own = state["position"], state["velocity"]
        z, components = sensor.independent(z, motion)
        seen = [self._seen(component, np.concatenate(own)) for component in components]
        post = ekf.update(Gaussian(state["mean"], state["cov"]), z, seen)
        return _keep(Gaussian(post.mean, post.cov), *own), Surprise(*post[2:])

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """To first order, at a range that is neither too near nor too far, nor spread beyond that.

        Its spread would else reach 1e10 m where a close pass leaves one over the range near zero:
        beside it, in double precision, nothing is left of what is known across it.
        """
        del motion, sensor
        own = np.concatenate([state["position"], state["velocity"]])
        mean = np.array(state["mean"])
        mean[3] = self._within(mean[3])
        variance, most = state["cov"][3, 3], (self.farthest_m * mean[3] ** 2) ** 2
        mean, J = jacobian(lambda kept: _plane(kept, own), mean)
        J[:, 3] = J[:, 3] * np.sqrt(most / select(variance > most, variance, most))
        return Gaussian(mean, mirror(J @ state["cov"] @ J.T))

    def _within(self, inverse: Any) -> Any:
        """One over a range that is neither too near nor too far."""
        far, near = 1.0 / self.farthest_m, 1.0 / self.nearest_m
        return select(inverse > far, select(inverse < near, inverse, near), far)

    def _seen(self, component: Component, own: Array) -> Component:
        """The component as a formula of the kept state; an angle has no share of the range."""

        def value(kept: Array) -> Any:
            inverse = 1.0 / _ANYWHERE if component.is_angle else self._within(kept[3])
            return component.value(_plane(np.array([*kept[:3], inverse]), own))

        return Component(component.name, value, component.sigma)


def _keep(kept: Gaussian, position: Array, velocity: Array) -> State:
    mean = np.array(kept.mean)
    mean[2] = wrap(mean[2])
    return {"mean": mean, "cov": kept.cov, "position": position, "velocity": velocity}


def _plane(kept: Array, own: Array) -> Array:
    """Position and velocity in the plane."""
    turn, rate, bearing, inverse = kept
    r = 1.0 / inverse
    return _shown(np.array([turn * r, rate * r, bearing, r])) + own


def _position(sensor: Sensor) -> Array:
    """Own ship's position (2,)."""
    pose = getattr(sensor, "pose", None)
    return np.zeros(2) if pose is None else pose.position_m[:2]


def _velocity(sensor: Sensor) -> Array:
    """What own ship's velocity (2,) is said to be."""
    pose = getattr(sensor, "pose", None)
    return np.zeros(2) if pose is None else pose.velocity_mps[:2]


def _ahead(vectors: tuple[Array, ...], bearing: Any) -> list[Array]:
    """Vectors (2,) along and across the line of sight."""
    c, s = np.cos(bearing), np.sin(bearing)
    return [np.array([c * x + s * y, c * y - s * x]) for x, y in vectors]


def _renewed(q: Array, w: Array, bearing: Any, inverse: Any) -> Array:
    """The state of a target at q that moves with w, along and across a bearing, over a range."""
    square = q @ q
    square = select(square < _NEAR, _NEAR, square)
    turn, rate = (q[0] * w[1] - q[1] * w[0]) / square, (q @ w) / square
    return np.array([turn, rate, bearing + np.arctan2(q[1], q[0]), inverse / np.sqrt(square)])


def _pushed(kept: Array) -> Array:
    """Jacobian (4, 4) by a push along and across the line of sight, position and velocity."""
    turn, rate, _, inverse = kept
    rows = [[-turn, -rate, 0.0, 1.0], [-rate, turn, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0]]
    return np.array([*rows, [-inverse, 0.0, 0.0, 0.0]]) * inverse


def _sighted(relative: Array) -> Array:
    """Velocities across and along the line of sight, bearing and range."""
    p, v = relative[:2], relative[2:]
    r, bearing = FORMULAS["range_m"](p, v), FORMULAS["azimuth_rad"](p, v)
    ((along, across),) = _ahead((v,), bearing)
    return np.array([across, along, bearing, r])


def _shown(sighted: Array) -> Array:
    """The inverse of `_sighted`."""
    across, along, bearing, r = sighted
    c, s = np.cos(bearing), np.sin(bearing)
    return np.array([c * r, s * r, c * along - s * across, s * along + c * across])


def _over(state: Gaussian) -> Gaussian:
    """Moments of (a/x, b/x, c, 1/x) from those of (a, b, c, x), where x is uniform.

    Exact where x is independent of the others. Else they are Gaussian beside the logarithm of a
    lognormal of the same relative spread, as correlated as they are with x, where a lognormal can
    be: weights 1/x then shift their means by minus their covariance with it.
    """
    x, t = state.mean[3], np.sqrt(3.0 * state.cov[3, 3]) / state.mean[3]
    t = select(t < _WIDEST, t, _WIDEST)
    wide = select(t > _NARROW, t, _NARROW)
    mid = np.log((1.0 + wide) / (1.0 - wide)) / (2.0 * wide)
    q = 1.0 / ((1.0 - t * t) * mid * mid) - 1.0  # squared relative spread of 1/x
    # Below, the difference from 1 has few digits left: both are taken to the second order.
    mid = select(t > _NARROW, mid, 1.0 + t * t / 3.0)
    q = select(t > _NARROW, q, t * t / 3.0)
    y = mid / x
    sd = np.sqrt(select(state.cov[3, 3] > 0.0, state.cov[3, 3], 1.0))
    k = state.cov[3] * (np.sqrt(q / (1.0 + 0.5 * q)) / sd)
    mean, cov = np.array(state.mean), np.array(state.cov)
    # x over x is 1, and certain.
    mean[3], k[3], cov[3, :], cov[:, 3] = 1.0, 0.0, 0.0, 0.0
    by, a, b = np.array([y, y, 1.0, y]), mean - k, mean - 2.0 * k
    # Of a pair of which both are divided; then of the bearing, which is not.
    out = (1.0 + q) * cov + q * np.outer(b, b) - np.outer(b, k) - np.outer(k, b) - np.outer(k, k)
    out[2, :] = out[:, 2] = cov[2] - a * k[2]
    out[2, 2] = cov[2, 2]
    told = by * np.array([a[0], a[1], mean[2], 1.0])
    return Gaussian(told, mirror(out * np.outer(by, by)))
