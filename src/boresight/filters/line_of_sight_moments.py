"""Cartesian moments of what is normal, or bent, in the frame of the line of sight: closed forms.

A complex number is a pair of real ones. With z normal and complex, t an angle of variance V and
c = cov(z, t): E[z exp(i k t)] = (z + i k c) exp(i k t - k² V / 2), and E[(d² - var d) exp(i k t)]
= (i k cov(d, t))² exp(i k t - k² V / 2). Differences are taken before they cancel, so that the
moments hold from V = 0 on.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.maths import Gaussian

Array = Any
NOTHING = 1e-300  # added to a variance that may be zero before anything is divided by it
_PAIRS = ((0, 0), (0, 1), (1, 1))  # of position and velocity
_INDEX = np.array([[0, 1, 3, 4], [1, 2, 5, 6], [3, 5, 7, 8], [4, 6, 8, 9]])  # of (4, 4) in 10


class Part(NamedTuple):
    """A bent Gaussian.

    Attributes:
        mean: (n,) range m, angles rad, velocity along range and angles m/s, and what follows.
        cov: (n, n) without what the bend adds.
        bend: (2,) of range and radial velocity, per (m/s)² of the velocity along the azimuth.
    """

    mean: Array
    cov: Array
    bend: Array


def plane_mean(part: Part, sign: float = 1.0) -> Array:
    """Mean of x, y, vx, vy.

    Args:
        part: in the plane.
        sign: 1 for the mean. -1 for the estimate that is right on average: where a truth is given
            and `part` is a normal estimate of it with this covariance, the mean of this over the
            estimates is the truth.
    """
    z, c, bend, _ = _complex(part)
    fade = 1.0 + np.expm1(-0.5 * sign * part.cov[1, 1])
    turn = fade * np.array([np.cos(part.mean[1]), np.sin(part.mean[1])])
    return np.concatenate([_times(z[a] + _i(c[a], sign) - _real(bend[a]), turn) for a in (0, 1)])


def plane(part: Part) -> Gaussian:
    """Mean (4,) and covariance (4, 4) of x, y, vx, vy."""
    cos, sin = np.cos(part.mean[1]), np.sin(part.mean[1])
    twice = np.array([cos * cos - sin * sin, 2.0 * sin * cos])
    found = []
    for a, b in _PAIRS:
        product, length = _second_moments(part, a, b)
        A = _times(product, twice)
        xx, yy = 0.5 * (length[0] + A[0]), 0.5 * (length[0] - A[0])
        xy, yx = 0.5 * (A[1] - length[1]), 0.5 * (A[1] + length[1])
        found.append([xx, xy, yy] if a == b else [xx, xy, yx, yy])
    first, cross, last = found
    # x, y of position; each of them with vx, vy; vx, vy
    upper = [*first, *cross, *last]
    return Gaussian(plane_mean(part), np.array(upper)[_INDEX])


def _second_moments(part: Part, a: int, b: int) -> tuple[Array, Array]:
    """cov(w_a, w_b) and cov(w_a, conj w_b), turned back by the mean angle; w = z exp(i t)."""
    P = part.cov
    z, c, k, bend = _complex(part)
    cross, var = 4.0 * P[1, 3], P[3, 3]
    half = np.expm1(-0.5 * P[1, 1])  # which the mean needs too
    f = half * (2.0 + half)
    e = 1.0 + f
    plus = [_real(P[0, 0]), P[0, 2:], np.array([P[2, 2] - P[3, 3], 2.0 * P[2, 3]])][a + b]
    minus = [_real(P[0, 0]), P[0, 2:] * [1.0, -1.0], _real(P[2, 2] + P[3, 3])][a + b]
    bent = bend[a] * bend[b] * 2.0 * var * var
    slopes = _i(bend[a] * _with_transverse(P, b) + bend[b] * _with_transverse(P, a))
    once = [z[j] + _i(c[j]) - _real(k[j]) for j in (a, b)]
    more = [_i(c[j]) - 3.0 * _real(k[j]) for j in (a, b)]
    full = [x + y for x, y in zip(once, more, strict=True)]
    extra = plus + cross * slopes + _real(bent - bend[a] * bend[b] * cross * cross * var)
    product = f * _times(full[0], full[1]) + e * extra + _times(more[0], more[1])
    product = e * (product + _times(once[0], more[1]) + _times(more[0], once[1]))
    moved = [x - z[j] for x, j in zip(once, (a, b), strict=True)]
    shrunk = _times(once[0], _conj(moved[1])) + _times(moved[0], _conj(z[b]))
    length = minus + _real(bent) - f * _times(z[a], _conj(z[b])) - e * shrunk
    return product, length


def _complex(part: Part) -> tuple[list[Array], list[Array], Array, Array]:
    """Range and velocity, their covariance with the angle, what the bend takes off, the bend."""
    (r, _, vr, vt), P, bend = part
    z = [_real(r), np.array([vr, vt])]
    c = [_real(P[0, 1]), P[1, 2:]]
    return z, c, bend * (P[1, 3] * P[1, 3]), bend


def _with_transverse(P: Array, a: int) -> Array:
    """Covariance of range, or of velocity, with the transverse velocity."""
    return _real(P[0, 3]) if a == 0 else P[3, 2:]


def _real(x: Any) -> Array:
    return np.array([x, x * 0.0])


def _times(a: Array, b: Array) -> Array:
    return np.array([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])


def _i(a: Array, sign: float = 1.0) -> Array:
    """Times i, or minus i."""
    return np.array([-sign * a[1], sign * a[0]])


def _conj(a: Array) -> Array:
    return np.array([a[0], -a[1]])
