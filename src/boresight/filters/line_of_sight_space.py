"""Space seen along the line of sight: one Gaussian, predicted to second order.

The state is (range, azimuth, elevation; velocity along them), and what a motion adds.
The frame's axes are the directions in which range, azimuth and elevation grow.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.filters import ekf
from boresight.filters.line_of_sight_moments import NOTHING
from boresight.filters.line_of_sight_plane import NEAR_M2, Shift
from boresight.maths import Gaussian, jacobian, mirror, select

Array = Any


def begin(mean: Array, cov: Array) -> Gaussian:
    """The one part."""
    return Gaussian(mean, cov)


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


def move(part: Gaussian, dt: Any, noise: Array, shift: Shift | None = None) -> Gaussian:
    """The part dt seconds later, to second order.

    Args:
        part: mean (n,), cov (n, n).
        dt: s; 0 leaves it as it is.
        noise: (n, n) covariance of positions, velocities and the rest, the same along each axis.
        shift: what the platform did, if it did anything.
    """
    mean, P = part
    still = mean * 0.0
    unsure = dt * dt * P[4, 4] + mean[0] * mean[0] * P[2, 2] + noise[0, 0]

    def fly(state: Array) -> Array:
        return _fly(state, dt, still, unsure)

    _, J = jacobian(fly, mean)
    _, E = jacobian(lambda disturbance: _fly(mean, dt, disturbance, unsure), still)
    mean = _fly(mean, dt, still, still[0]) + _second_order(fly, part)
    moved = Gaussian(mean, mirror(J @ P @ J.T + E @ noise @ E.T))
    if shift is None:
        return moved

    def elsewhere(state: Array) -> Array:
        p, v, rest = np.split(leave(state), [3, 6])
        p, v = shift.turn @ p + shift.away[:3], shift.turn @ v + shift.away[3:]
        return enter(np.concatenate([p, v, rest]))

    mean, J = jacobian(elsewhere, moved.mean)
    mean = mean + _second_order(elsewhere, moved)
    return Gaussian(mean, mirror(J @ moved.cov @ J.T))


def _fly(state: Array, dt: Any, disturbance: Array, unsure: Any) -> Array:
    """Straight flight from one line of sight to the next; at dt = 0 nothing is rounded.

    Args:
        state: (n,).
        dt: s.
        disturbance: (n,) of place and velocity, along the axes of the frame before, and the rest.
        unsure: square of the least distance from the vertical axis: for gradients, which grow
            without bound beside it.
    """
    r, az, el, vr, va, ve = state[:6]
    ce, se = np.cos(el), np.sin(el)
    velocity = np.array([vr, va, ve]) + disturbance[3:6]
    X, Y, Z = np.array([r + dt * vr, dt * va, dt * ve]) + disturbance[:3]
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
    distance = np.sqrt(X * X + Y * Y + Z * Z)
    distance = select(distance < 1e-3, 1e-3, distance)
    radial = np.array([X, Y, Z]) / distance
    c, s = ahead / ground, side / ground
    sideways = np.array([-s * ce, c, s * se])
    upwards = np.array(
        [
            radial[1] * sideways[2] - radial[2] * sideways[1],
            radial[2] * sideways[0] - radial[0] * sideways[2],
            radial[0] * sideways[1] - radial[1] * sideways[0],
        ]
    )
    angles = [az + np.arctan2(s, c), el + np.arctan2(Z - se * excess, X + ce * excess)]
    seen = [axis @ velocity for axis in (radial, sideways, upwards)]
    return np.array([distance, *angles, *seen, *(state[6:] + disturbance[6:])])


def _second_order(f: Callable[[Array], Array], at: Gaussian) -> Array:
    """What the curvature of f adds to its mean: half the trace of its Hessians times cov."""
    m, n = len(f(at.mean)), len(at.mean)
    _, H = jacobian(lambda x: jacobian(f, x)[1].reshape(-1), at.mean)
    H = H.reshape(m, n, n)
    total = [at.mean[0] * 0.0] * m
    for k in range(m):
        for i in range(n):
            total[k] = total[k] + 0.5 * H[k, i, i] * at.cov[i, i]
            for j in range(i):
                total[k] = total[k] + H[k, i, j] * at.cov[i, j]
    return np.array(total)


def condition(part: Gaussian, h: Array, nu: Any, noise: Any, there: Any) -> tuple[Gaussian, Any]:
    """One scalar update, as in `ekf.condition`."""
    return ekf.condition(part, h, nu, noise, there)


def tell(part: Gaussian) -> Gaussian:
    """Mean and covariance of x, y, z, vx, vy, vz and the rest, relative to the sensor.

    Given the angles all is linear; over the two of them a Gauss-Hermite rule of three points each
    is exact to fifth order.
    """
    (first, second), rest = _angles_first(part.cov)
    rule = ((2.0 / 3.0, 0.0), (1.0 / 6.0, np.sqrt(3.0)), (1.0 / 6.0, -np.sqrt(3.0)))
    seen = [
        (w * v, *jacobian(leave, part.mean + x * first + y * second))
        for w, x in rule
        for v, y in rule
    ]
    mean = sum(weight * place for weight, place, _ in seen)
    cov = 0.0
    for weight, place, J in seen:
        cov = cov + weight * (np.outer(place - mean, place - mean) + J @ rest @ J.T)
    return Gaussian(mean, mirror(cov))


def unbiased(part: Gaussian) -> Array:
    """The estimate that is right on average over the plots of a target: beyond by the shrinkage."""
    return 2.0 * leave(part.mean) - tell(part).mean


def _angles_first(P: Array) -> tuple[list[Array], Array]:
    """Columns (n,) of a root of what varies with the angles, and what is left without them."""
    columns = []
    for i in (1, 2):
        column = P[:, i] / np.sqrt(P[i, i] + NOTHING)
        columns.append(column)
        P = mirror(P - np.outer(column, column))
    clear = np.eye(len(P))
    clear[1, 1] = clear[2, 2] = 0.0
    return columns, clear @ P @ clear
