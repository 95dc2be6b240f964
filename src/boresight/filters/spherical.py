"""Cubature Kalman filter with the position in range, azimuth and elevation; the rest Cartesian.

[crouse2014] D. F. Crouse, "Basic Tracking Using Nonlinear 3D Monostatic and Bistatic Measurements",
on states in the coordinates of the measurement.

Differs from it: a radar's range and angles are linear in this state, so they are used by an exact
Kalman update, angles wrapped, and before all else; heights, range rates and coordinates follow by
cubature. Prediction takes cubature points to the motion's coordinates and back, each on the branch
(over the pole, through the sensor) that it started on, so no time changes nothing. Process noise
enters by the Jacobian of range and angles at the predicted place, which leaves a sharp range sharp.
The state is polar in the axes of the sensor, wherever it was at the last plot: a sensor may turn
and move. Velocities and further states are the motion's own. What is told is the mean and
covariance in the motion's coordinates.
"""

from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np

from boresight.filters import ekf, sigma
from boresight.filters.start import SPEED_MPS, one_plot
from boresight.filters.steps import State, Surprise, gaussian_layout
from boresight.lanes import Leaf, Matrix, Vector
from boresight.maths import (
    Gaussian,
    cholesky,
    copysign,
    jacobian,
    mirror,
    select,
    wrap,
)
from boresight.models.components import FORMULAS, Component
from boresight.models.motion import Motion
from boresight.models.sensors import Pose, Radar, Sensor

Array = Any
_POLAR = ("range_m", "azimuth_rad", "elevation_rad")
_NEAREST = 2e-3  # m: no target is nearer to its sensor, or to the vertical axis
_ANYTHING = np.pi**2 / 3.0  # rad², of an angle that is equally likely to be any


def to_position(polar: Array, pose: Pose | None) -> Array:
    """Position (d,) in the track frame of range, azimuth and, in space, elevation (d,)."""
    r, az, *el = polar
    ground = r * np.cos(el[0]) if el else r
    p = np.array([ground * np.cos(az), ground * np.sin(az), *(r * np.sin(e) for e in el)])
    d = len(p)
    return p if pose is None else pose.rotation[:d, :d].T @ p + pose.position_m[:d]


def in_axes(p: Array, pose: Pose | None) -> Array:
    """A position (d,) of the track frame, from the sensor and in its axes."""
    d = len(p)
    return p if pose is None else pose.rotation[:d, :d] @ (p - pose.position_m[:d])


def from_position(p: Array, pose: Pose | None) -> Array:
    """Range, azimuth and, in space, elevation (d,) of a position: the inverse of `to_position`.

    On the vertical axis, where angles have no slopes, a place beside it is taken.
    """
    seen = np.array(in_axes(p, pose))
    seen[0] = seen[0] + select(seen[0] * seen[0] + seen[1] * seen[1] < _NEAREST**2, _NEAREST, 0.0)
    return np.array([FORMULAS[name](seen, seen) for name in _POLAR[: len(p)]])


def _on_branch(p: Array, polar: Array, turned: Any) -> Array:
    """Polar coordinates (d,) of a place that came from `polar` while azimuths turned.

    Beyond the sensor the range stays negative, over the pole the elevation stays above 90 degrees,
    and the azimuth is the one nearest to where it was: all differences are small for small moves.
    """
    through = copysign(1.0, polar[0])
    over = copysign(1.0, np.cos(polar[2])) if len(p) == 3 else 1.0
    p = p * through
    found = [through * FORMULAS["range_m"](p, p)]
    expected = polar[1] + turned
    found.append(expected + wrap(FORMULAS["azimuth_rad"](p * over, p) - expected))
    if len(p) == 3:
        el = FORMULAS["elevation_rad"](p, p)
        el = select(over < 0.0, copysign(np.pi, el) - el, el)
        found.append(polar[2] + wrap(el - polar[2]))
    return np.array(found)


def _upright(state: Gaussian, dims: int) -> Gaussian:
    """The same state with a positive range and angles as they are commonly given.

    Azimuth is wrapped and elevation within 90 degrees. No angle is less certain than one that may
    be anything: right overhead, or at the sensor, Jacobians would say much more than that.
    """
    mean, cov = np.array(state.mean), state.cov
    sides: list[Any] = [1.0] * len(mean)
    for i in range(1, dims):
        vague = cov[i, i] > _ANYTHING
        sides[i] = select(vague, np.sqrt(_ANYTHING / select(vague, cov[i, i], _ANYTHING)), 1.0)
    if dims == 3:
        el = wrap(mean[2])
        over = np.cos(el) < 0.0
        mean[1] = mean[1] + select(over, np.pi, 0.0)
        mean[2] = select(over, copysign(np.pi, el) - el, el)
        sides[2] = sides[2] * select(over, -1.0, 1.0)
    mean[0] = select(mean[0] < _NEAREST, _NEAREST, mean[0])
    mean[1] = wrap(mean[1])
    return Gaussian(mean, cov * np.outer(np.array(sides), np.array(sides)))


@dataclass(frozen=True, kw_only=True)
class SphericalCubature:
    """State: range, azimuth and, in space, elevation of the sensor; then the motion's own states.

    `mean[0]` of what it keeps is the range, whose error is smaller than that of the distance of
    the told mean: the mean of a place that is uncertain in angle lies nearer to the sensor.
    """

    @property
    def plain(self) -> bool:
        """It tells something else than it keeps."""
        return False

    def start(
        self, z: Array, motion: Motion, sensor: Sensor, *, speed_mps: float = SPEED_MPS
    ) -> Gaussian:
        """Position by the conventional conversion, velocity unknown."""
        return one_plot(z, motion, sensor, speed_mps=speed_mps)

    def layout(self, motion: Motion, sensor: Sensor) -> dict[str, Leaf]:
        """Mean, covariance, and where the sensor was if it has a pose."""
        pose = {} if _pose(sensor) is None else {"position_m": Vector(3), "rotation": Matrix(3, 3)}
        return gaussian_layout(motion) | pose

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """By the Jacobian at the mean, from where the sensor is at the first step.

        The inverse of a start from one plot.
        """
        pose, d = _pose(sensor), motion.dims
        polar, J = jacobian(lambda p: from_position(p, pose), start.mean[:d])
        mean = np.concatenate([polar, start.mean[d:]])
        return _state(_upright(Gaussian(mean, _turned(start.cov, J)), d), pose)

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """Through the motion's coordinates by cubature; the sensor may have moved."""
        pose, before, d = _pose(sensor), _former(state), motion.dims
        L, _ = cholesky(state["cov"])

        def moved(kept: Array) -> Array:
            place = to_position(kept[:d], before)
            return motion.move(np.concatenate([place, kept[d:]]), dt)

        place = moved(state["mean"])[:d]
        now, J = jacobian(lambda p: from_position(p, pose), place)
        turned = now[1] - state["mean"][1]

        def polar(kept: Array) -> Array:
            later = moved(kept)
            found = _on_branch(in_axes(later[:d], pose), kept[:d], turned)
            return np.concatenate([found, later[d:]])

        mean, D, rest = sigma.regress(polar, np.subtract, state["mean"], L, sigma.CUBATURE)
        cov = mirror(D @ D.T + rest + _turned(motion.noise(dt), J))
        return _state(_upright(Gaussian(mean, cov), d), pose)

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """Range and angles exactly; then what is not linear in them, by cubature."""
        z, components = sensor.independent(z, motion)
        pose, d = _pose(sensor), motion.dims
        linear = [i for i, c in enumerate(components) if c.name in _POLAR[:d]]
        curved = [i for i in range(len(z)) if i not in linear]
        latest, found = Gaussian(state["mean"], state["cov"]), []
        if linear:
            found.append(ekf.update(latest, z[linear], [_element(components[i]) for i in linear]))
            latest = Gaussian(*found[-1][:2])
        if curved:
            bent = [_in_polar(components[i], d, pose) for i in curved]
            found.append(sigma.update(latest, z[curved], bent))
            latest = Gaussian(*found[-1][:2])
        order = np.argsort([*linear, *curved])
        totals = (sum(getattr(post, name) for post in found) for name in ("nis", "dof", "loglik"))
        each = (np.concatenate([p[i] for p in found])[order] for i in (5, 6))
        return _state(_upright(latest, d), pose), Surprise(*totals, *each)

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """Mean and covariance in the motion's coordinates, by points of the position.

        The rule is exact for squares of deviations, and positive; what products of two of them add
        to a covariance is left out.
        """
        pose, d = _pose(sensor), motion.dims
        second = sigma.Rule(1.0, 1.0, 2.0 - d)
        mean, cov = state["mean"], state["cov"]
        L, _ = cholesky(cov)
        place, D, rest = sigma.regress(
            lambda polar: to_position(polar, pose), np.subtract, mean[:d], L[:d, :d], second
        )
        across = D @ L[d:, :d].T
        block = np.block([[D @ D.T + rest, across], [across.T, cov[d:, d:]]])
        return Gaussian(np.concatenate([place, mean[d:]]), mirror(block))


def _pose(sensor: Sensor) -> Pose | None:
    return sensor.pose if isinstance(sensor, Radar) else None


def _former(state: State) -> Pose | None:
    """Where the sensor was."""
    if "rotation" not in state:
        return None
    return Pose(position_m=state["position_m"], rotation=state["rotation"])


def _state(kept: Gaussian, pose: Pose | None) -> State:
    state = {"mean": kept.mean, "cov": kept.cov}
    if pose is not None:
        state |= {"position_m": pose.position_m, "rotation": pose.rotation}
    return state


def _turned(cov: Array, J: Array) -> Array:
    """Covariance (n, n) with the positions turned by J (d, d)."""
    d = len(J)
    across = J @ cov[:d, d:]
    return mirror(np.block([[J @ cov[:d, :d] @ J.T, across], [across.T, cov[d:, d:]]]))


def _element(component: Component) -> Component:
    """Range or an angle as the element of the kept state that it is: an EKF is exact then."""
    element = itemgetter(_POLAR.index(component.name))
    return Component(component.name, element, component.sigma)


def _in_polar(component: Component, dims: int, pose: Pose | None) -> Component:
    """The component as a formula of the kept state."""

    def value(kept: Array) -> Any:
        return component.value(np.concatenate([to_position(kept[:dims], pose), kept[dims:]]))

    return Component(component.name, value, component.sigma)
