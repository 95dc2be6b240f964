"""Space seen along the line of sight: one bent Gaussian, predicted to second order.

The state is (range, azimuth, elevation; velocity along them), and what a motion adds.
The frame's axes are the directions in which range, azimuth and elevation grow. The bend is that of
the velocity along the azimuth, as in `line_of_sight_plane`; what is told leaves it out.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.filters.line_of_sight_moments import NOTHING, Part
from boresight.filters.line_of_sight_plane import NEAR_M2, Shift, spread
from boresight.maths import Gaussian, jacobian, mirror, select

Array = Any
_T = 4  # index of the velocity along the azimuth


def enter(state: Array) -> Array:
    """(range, azimuth, elevation, velocity along them, ...) of (x, y, z, vx, vy, vz, ...)."""
    x, y, z, vx, vy, vz = state[:6]
    over = x * x + y * y < NEAR_M2
    x, y = select(over, 1e-3, x), select(over, 0.0, y)
    ground = np.sqrt(x * x + y * y)
    r = np.sqrt(ground * ground + z * z)
    ca, sa, ce, se = x / ground, y / ground, ground / r, z / r
    level = ca * vx + sa * vy
    along = [ce * level + se * vz, ca * vy - sa * vx, ce * vz - se * level]
    return np.array([r, np.arctan2(y, x), np.arctan2(z, ground), *along, *state[6:]])


def leave(state: Array) -> Array:
    """(x, y, z, vx, vy, vz, ...) of (range, azimuth, elevation, velocity along them, ...)."""
    r, az, el, vr, va, ve = state[:6]
    ca, sa, ce, se = np.cos(az), np.sin(az), np.cos(el), np.sin(el)
    ground, level = r * ce, vr * ce - ve * se
    velocity = [level * ca - va * sa, level * sa + va * ca, vr * se + ve * ce]
    return np.array([ground * ca, ground * sa, r * se, *velocity, *state[6:]])


def see(relative: Gaussian) -> Gaussian:
    """A Cartesian Gaussian in this frame, to first order.

    Above the sensor the azimuth is anywhere: gradients are those of a place as far off the vertical
    axis as the target is unsure.
    """
    x, y = relative.mean[:2]
    square = x * x + y * y
    unsure = relative.cov[0, 0] + relative.cov[1, 1]
    over = square < NEAR_M2
    safe = np.sqrt(select(over, NEAR_M2, square))
    push = select(square < unsure, np.sqrt(unsure) / safe, 0.0)
    pushed = [x + select(over, 1e-3, x) * push, y + y * push, *relative.mean[2:]]
    _, J = jacobian(enter, np.array(pushed))
    return Gaussian(enter(relative.mean), mirror(J @ relative.cov @ J.T))


def move(part: Part, dt: Any, noise: Array, shift: Shift | None = None) -> Part:
    """The part dt seconds later, to second order.

    Args:
        part: what is known.
        dt: s; 0 leaves it as it is.
        noise: (n, n) covariance of positions, velocities and the rest, the same along each axis.
        shift: what the platform did, if it did anything.
    """
    mean, P, _ = part
    still = mean * 0.0
    unsure = dt * dt * P[4, 4] + mean[0] * mean[0] * P[2, 2] + noise[0, 0]
    _, J = jacobian(lambda state: _fly(state, dt, still, unsure), mean)
    _, E = jacobian(lambda disturbance: _fly(mean, dt, disturbance, unsure), still)
    moved = _fly(mean, dt, still, still[0]) + _outwards(mean, P, dt)
    cov = mirror(J @ P @ J.T + E @ noise @ E.T)
    line = P[:, _T]
    kept = (J @ line)[_T] / (cov[_T, _T] + NOTHING)  # as in the plane
    along = line * (kept / (line[_T] + NOTHING))
    curve = J @ spread(part.bend, len(mean)) * (kept * kept)
    curve = curve + _outwards(mean, np.outer(along, along), dt)
    curve = curve - cov[:, _T] * (curve[_T] / (cov[_T, _T] + NOTHING))
    after = Part(moved, cov, curve[[0, 3]])
    return after if shift is None else _reframe(after, shift)


def _reframe(part: Part, shift: Shift) -> Part:
    """Seen from a platform that is elsewhere, to first order."""

    def elsewhere(state: Array) -> Array:
        p, v, rest = np.split(leave(state), [3, 6])
        p, v = shift.turn @ p + shift.away[:3], shift.turn @ v + shift.away[3:]
        return enter(np.concatenate([p, v, rest]))

    mean, J = jacobian(elsewhere, part.mean)
    return Part(mean, mirror(J @ part.cov @ J.T), part.bend)


class _Course(NamedTuple):
    """Where straight flight leads: range, changes of both angles, axes (3, 3) in the old ones."""

    distance: Any
    azimuth: Any
    elevation: Any
    axes: Array


def _course(state: Array, dt: Any, disturbance: Array, unsure: Any) -> _Course:
    """From one line of sight to the next; at dt = 0 nothing is rounded.

    Args:
        state: (n,).
        dt: s.
        disturbance: (3, ...) of the place, along the axes of the frame before.
        unsure: square of the least distance from the vertical axis: for gradients, which grow
            without bound beside it.
    """
    r, _, el, *velocity = state[:6]
    ce, se = np.cos(el), np.sin(el)
    X, Y, Z = np.array([r, 0.0, 0.0]) + dt * np.array(velocity) + disturbance[:3]
    ahead, side = X * ce - Z * se, Y  # on the ground: towards the azimuth before, and beside it
    square = ahead * ahead + side * side
    over = square < NEAR_M2
    ahead, side = select(over, 1e-3, ahead), select(over, 0.0, side)
    push = select(square < unsure, np.sqrt(unsure), 0.0)
    ahead = ahead + select(ahead < 0.0, -push, push)
    ground = np.sqrt(ahead * ahead + side * side)
    # ground - ahead, which must not cancel
    behind = ahead < 0.0
    excess = select(behind, ground - ahead, side * side / select(behind, 1.0, ground + ahead))
    square = X * X + Y * Y + Z * Z
    distance = np.sqrt(select(square < NEAR_M2, NEAR_M2, square))
    (x, y, z), c, s = np.array([X, Y, Z]) / distance, ahead / ground, side / ground
    sideways = [-s * ce, c, s * se]
    upwards = [y * s * se - z * c, -z * s * ce - x * s * se, x * c + y * s * ce]
    axes = np.array([[x, y, z], sideways, upwards])
    raised = np.arctan2(Z - se * excess, X + ce * excess)
    return _Course(distance, np.arctan2(s, c), raised, axes)


def _fly(state: Array, dt: Any, disturbance: Array, unsure: Any) -> Array:
    """The state (n,) dt seconds later; as `_course`, `disturbance` (n,) of all."""
    course = _course(state, dt, disturbance, unsure)
    seen = course.axes @ (state[3:6] + disturbance[3:6])
    place = [course.distance, state[1] + course.azimuth, state[2] + course.elevation]
    return np.array([*place, *seen, *(state[6:] + disturbance[6:])])


def _outwards(mean: Array, P: Array, dt: Any) -> Array:
    """What second order adds to the mean of range and velocities (n,): the centripetal term.

    That of the angles is left out: it is about their variance times their standard deviation.
    """
    course = _course(mean, dt, mean * 0.0, mean[0] * 0.0)
    axes, zero = course.axes, np.zeros((3, len(mean) - 6))
    rates = np.hstack([np.zeros((3, 3)), axes, zero])  # of (x, y, z) of the frame after, (3, n)
    places = np.hstack([axes[:, :1], np.zeros((3, 2)), dt * axes, zero])
    _, y, z = places @ P @ places.T
    cross = places[1:] @ P @ rates.T
    spread = y[1] + z[2]
    square = course.distance * course.distance + spread
    lever = 1.0 / np.sqrt(square)
    a, b, c = axes @ mean[3:6]
    side, up = -y[0] / (square + y[1]), -z[0] / (square + z[2])
    half = 0.5 / square
    along = (cross[0, 1] + cross[1, 2]) * lever + b * side + c * up - a * spread * half
    across = -cross[0, 0] * lever - a * side - (b * y[1] + c * y[2]) * half
    upward = -cross[1, 0] * lever - a * up - (c * z[2] + b * y[2]) * half
    return np.array([0.5 * spread * lever, 0.0, 0.0, along, across, upward, *zero[0]])


def tell(part: Part) -> Gaussian:
    """Mean and covariance of x, y, z, vx, vy, vz and the rest, relative to the sensor.

    Given the angles all is linear; over the two of them a Gauss-Hermite rule of three points each
    is exact to fifth order. What varies without the angles needs fewer: its mean square over them
    is taken at the middle and the ends of the axes.
    """
    (first, second), rest = _angles_first(part.cov)
    ends = (0.0, np.sqrt(3.0), -np.sqrt(3.0))
    nodes = [(x, y) for x in ends for y in ends]
    weights = [(1.0 if x else 4.0) * (1.0 if y else 4.0) / 36.0 for x, y in nodes]
    seen = [jacobian(leave, part.mean + x * first + y * second) for x, y in nodes]
    mean = sum(w * place for w, (place, _) in zip(weights, seen, strict=True))
    cov = sum(
        w * np.outer(place - mean, place - mean)
        for w, (place, _) in zip(weights, seen, strict=True)
    )
    for (x, y), (_, J) in zip(nodes, seen, strict=True):
        if x * y == 0.0:
            cov = cov + (1.0 / 6.0 if x or y else 1.0 / 3.0) * (J @ rest @ J.T)
    return Gaussian(mean, mirror(cov))


def unbiased(part: Part) -> Array:
    """The estimate that is right on average over the plots of a target: beyond by the shrinkage."""
    return 2.0 * leave(part.mean) - tell(part).mean


def _angles_first(P: Array) -> tuple[list[Array], Array]:
    """Columns (n,) of a root of what varies with the angles, and what is left without them."""
    columns = []
    for i in (2, 1):
        column = P[:, i] / np.sqrt(P[i, i] + NOTHING)
        columns.append(column)
        P = mirror(P - np.outer(column, column))
    clear = np.eye(len(P))
    clear[1, 1] = clear[2, 2] = 0.0
    return columns, clear @ P @ clear
