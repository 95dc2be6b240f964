"""One part of a line-of-sight filter in the plane: normal, but for a bend.

Its state is (range, angle, radial velocity, transverse velocity). Straight flight is linear along
and across the line of sight; what bends is the way back to a range and an angle, which is expanded
to second order. Of the second-order terms those in the transverse velocity last: with a target that
may have moved to either side, range and radial velocity are a parabola of that velocity, and not of
the estimate that it had at the time. So a part keeps the parabola:

    range = mean + slope d + bend (d² - var),  d = transverse velocity - its mean

and shifts mean and slope along it whenever the transverse velocity becomes better known.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.filters.line_of_sight_moments import NOTHING, Part, plane, plane_mean
from boresight.maths import Gaussian, jacobian, mirror, select

Array = Any
NEAR_M2 = 1e-6  # the square of 1 mm: nothing is divided by less
_MOST = 0.5  # of a variance that one plot's second-order information may add or take
_T = 3  # index of the transverse velocity
_TURNED = np.array([1.0, -1.0, 1.0, -1.0])


class Shift(NamedTuple):
    """What a platform did otherwise than moving on, in the sensor's frame after the step.

    Attributes:
        turn: (d, d) from the sensor's frame before to the one after.
        away: (2 d,) added to position and velocity relative to the sensor.
    """

    turn: Array
    away: Array


class _Facing(NamedTuple):
    """Where a step ends, seen from there: the radial and transverse velocity and 1 / range."""

    radial: Any
    transverse: Any
    lever: Any

    def first_order(self) -> Array:
        """(4, 5) from changes of (angle before; along, across, and their rates) to the state."""
        swing = self.transverse * self.lever, -self.radial * self.lever
        return np.array(
            [
                [0.0, 1.0, 0.0, 0.0, 0.0],
                [1.0, 0.0, self.lever, 0.0, 0.0],
                [0.0, 0.0, swing[0], 1.0, 0.0],
                [0.0, 0.0, swing[1], 0.0, 1.0],
            ]
        )

    def second_order(self, A: Array, inverse: Any) -> Array:
        """(4,) what second moments A (4, 4) of along, across and their rates add to the mean.

        Args:
            A: second moments.
            inverse: 1 / range squared, not more than the moments that bound a close pass allow.
        """
        slip = -A[0, 1] * inverse
        half = 0.5 * A[1, 1] * self.lever * self.lever
        a, b = self.radial, self.transverse
        return np.array(
            [
                0.5 * A[1, 1] * self.lever,
                slip,
                b * slip + A[1, 3] * self.lever - a * half,
                -a * slip - A[1, 2] * self.lever - b * half,
            ]
        )


def enter(state: Array) -> Array:
    """(range, angle, radial, transverse velocity) of x, y, vx, vy relative to the sensor."""
    x, y, vx, vy = state
    here = x * x + y * y < NEAR_M2
    x, y = select(here, 1e-3, x), select(here, 0.0, y)
    r = np.sqrt(x * x + y * y)
    c, s = x / r, y / r
    return np.array([r, np.arctan2(y, x), c * vx + s * vy, c * vy - s * vx])


def see(relative: Gaussian) -> Gaussian:
    """A Cartesian Gaussian in this frame, to first order."""
    mean, J = jacobian(enter, relative.mean)
    return Gaussian(mean, mirror(J @ relative.cov @ J.T))


def leave(state: Array) -> Array:
    """x, y, vx, vy of (range, angle, radial, transverse velocity)."""
    r, angle, vr, vt = state
    c, s = np.cos(angle), np.sin(angle)
    return np.array([r * c, r * s, vr * c - vt * s, vr * s + vt * c])


def move(part: Part, dt: Any, noise: Array, shift: Shift | None = None) -> Part:
    """The part dt seconds later, to second order.

    A close pass stays finite: the range that is divided by is never less than what is unsure of the
    way across.

    Args:
        part: what is known.
        dt: s; 0 leaves it as it is.
        noise: (4, 4) covariance of positions and velocities, the same along each axis.
        shift: what the platform did, if it did anything.
    """
    P = part.cov
    u, G, angle = _advance(part, dt, shift)
    square = u[0] * u[0] + u[1] * u[1]
    near = square < NEAR_M2
    square = select(near, NEAR_M2, square)
    distance = np.sqrt(square)
    inverse = 1.0 / distance
    c, s = select(near, 1.0, u[0] * inverse), select(near, 0.0, u[1] * inverse)
    turn = _turned(c, s)
    G = turn @ G
    mixed = G @ P
    A = mirror(mixed @ G.T + noise)
    bounded = square + A[1, 1]
    _, _, radial, transverse = turn @ u
    facing = _Facing(radial, transverse, 1.0 / np.sqrt(bounded))
    B = facing.first_order()
    beside = mixed[:, 1:2]
    joint = np.block([[P[1:2, 1:2], beside.T], [beside, A]])
    cov = mirror(B @ joint @ B.T)
    start = np.array([distance, angle + np.arctan2(s, c), facing.radial, facing.transverse])
    mean = start + facing.second_order(A, 1.0 / (bounded + A[0, 0]))
    line = np.concatenate([P[1:2, _T], mixed[:, _T]])  # covariance with the velocity before
    sure = 1.0 / (cov[_T, _T] + NOTHING)
    kept = (B @ line)[_T] * sure  # of a change of it in the one after
    along = mixed[:, _T] * (kept / (P[_T, _T] + NOTHING))
    curve = B[:, 1:] @ (G @ spread(part.bend, 4)) * (kept * kept)
    curve = curve + facing.second_order(np.outer(along, along), facing.lever * facing.lever)
    curve = curve - cov[:, _T] * (curve[_T] * sure)
    return Part(mean, cov, curve[[0, 2]])


def _advance(part: Part, dt: Any, shift: Shift | None) -> tuple[Array, Array, Any]:
    """Along, across and their rates in the frame before, their slopes, and that frame's angle."""
    (r, angle, vr, vt), P, _ = part
    u = np.array([r + dt * vr, dt * vt, vr, vt])
    G = np.array([[1.0, 0.0, dt, 0.0], [0.0, 0.0, 0.0, dt], [0.0, 0, 1.0, 0], [0.0, 0, 0, 1.0]])
    if shift is None:
        return u, G, angle
    angle = angle + np.arctan2(shift.turn[1, 0], shift.turn[0, 0])
    added = _turned(np.cos(angle), np.sin(angle)) @ shift.away
    slopes = list(G.T)
    slopes[1] = added[[1, 0, 3, 2]] * _TURNED
    return u + added * (1.0 - 0.5 * P[1, 1]), np.array(slopes).T, angle


def _turned(c: Any, s: Any) -> Array:
    """Turns two vectors by minus an angle, given its cosine and sine."""
    return np.array([[c, s, 0.0, 0.0], [-s, c, 0.0, 0.0], [0.0, 0.0, c, s], [0.0, 0.0, -s, c]])


def spread(bend: Array, n: int) -> Array:
    """The bend of all n states."""
    d = 2 if n == 4 else 3
    return np.array([bend[0], *[0.0] * (d - 1), bend[1], *[0.0] * (n - d - 1)])


def condition(part: Part, h: Array, nu: Any, noise: Any, there: Any) -> tuple[Part, Any]:
    """One scalar update.

    Given the transverse velocity all is linear, so the parabola is updated as it stands; then it is
    expanded about the new mean. The square of the transverse velocity is seen through the bend,
    which makes it more or less certain than the linear update says.

    Args:
        part: what is known.
        h: (n,) gradient of the measurement.
        nu: innovation.
        noise: variance of the measurement.
        there: 1 if measured, 0 if missing: then nothing changes.

    Returns:
        The part, and the variance of the innovation.
    """
    mean, P, _ = part
    bend = spread(part.bend, len(mean))
    d = 2 if len(mean) == 4 else 3
    t = d + 1  # the transverse velocity, in space the level one
    cross, seen = P @ h, h @ bend
    s = h @ cross + noise + 2.0 * (seen * P[t, t]) * (seen * P[t, t])
    share = there * (1.0 / s)
    gain = cross * share
    cov = mirror(P - np.outer(gain, cross))
    across = cross - P[:, t] * (cross[t] / (P[t, t] + NOTHING))
    bend = bend - across * (seen * there / (h @ across + noise))
    surprise = 2.0 * cov[t, t] * seen * nu * share
    surprise = select(surprise > _MOST, _MOST, select(surprise < -_MOST, -_MOST, surprise))
    more = surprise * (1.0 + 0.5 * surprise)
    line = cov[:, t]
    cov = cov + np.outer(line, line) * (more / (line[t] + NOTHING))
    line = line * (1.0 + more)
    step = gain[t] * nu
    moved = 2.0 * step * bend  # of the slope
    mean = mean + gain * nu + bend * (step * step + line[t] - P[t, t])
    cov = cov + np.outer(moved, line) + np.outer(line + moved * line[t], moved)
    return Part(mean, mirror(cov), np.array([bend[0], bend[d]])), s


def tell(part: Part) -> Gaussian:
    """Mean and covariance of x, y, vx, vy relative to the sensor."""
    return plane(part)


def unbiased(part: Part) -> Array:
    """The estimate of x, y, vx, vy that is right on average over the plots of a target."""
    return plane_mean(part, -1.0)
