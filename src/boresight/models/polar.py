"""Places known in polar coordinates: what is expected of their Cartesian counterparts.

A place is a normal range and normal angles, all independent. Everything is component first and
runs on floats, arrays (d, lanes) and symbols.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.maths import select

Array = Any
_FLOOR = 1e-6  # m², the square of 1 mm: nearer the sensor, or its vertical axis, nothing is divided


class Given(NamedTuple):
    """Where the target is thought to be, in the sensor's polar frame.

    The previous plot, as a condition, is `Given(z, sigma * sigma)`.

    Attributes:
        mean: (d,) range m, azimuth rad, in space elevation rad.
        variances: (d,) of each; 0 for a truth.
        direction: (2,) or (4,) cosine and sine of the azimuth, and of the elevation, if they are
            known without the angles; None to take them from `mean`.
    """

    mean: Array
    variances: Array
    direction: Array = None


class Angle(NamedTuple):
    """Averages over a normal angle a: of cos a, sin a, cos² a, sin² a and sin a cos a."""

    cos: Any
    sin: Any
    cos2: Any
    sin2: Any
    product: Any


class Place(NamedTuple):
    """Averages over where the target is: of the range, of its square, and of both angles."""

    range: Any
    square: Any
    azimuth: Angle
    elevation: Angle
    dims: int


class Noise(NamedTuple):
    """What noise of variance v does to an angle.

    Attributes:
        shrink: e^{-v/2}, by which its cosine and sine are shorter on average.
        loss: 1 - e^{-v/2}.
        lift: cosh v - 1.
        sinh: sinh v.
        growth: e^v - 1.
    """

    shrink: Any
    loss: Any
    lift: Any
    sinh: Any
    growth: Any


LEVEL = Angle(1.0, 0.0, 1.0, 0.0, 0.0)  # the elevation of what lives in the plane
EXACT = Noise(1.0, 0.0, 0.0, 0.0, 0.0)  # and its noise


def average_angle(cos: Any, sin: Any, variance: Any) -> Angle:
    """Averages over a normal angle, given the cosine and sine of its mean, and its variance."""
    fade = np.expm1(-0.5 * variance)
    kept = 1.0 + fade
    blur = -0.5 * fade * (1.0 + kept) * (1.0 + kept * kept)  # (1 - e^{-2v}) / 2
    sharp = 1.0 - 2.0 * blur
    squares = sharp * cos * cos + blur, sharp * sin * sin + blur
    return Angle(kept * cos, kept * sin, *squares, sharp * sin * cos)


def place(given: Given) -> Place:
    """Averages over a place that is known as a normal range and normal angles."""
    distance, *angles = given.mean
    spread, *variances = given.variances
    trig = given.direction
    if trig is None:
        trig = [f(angle) for angle in angles for f in (np.cos, np.sin)]
    averages = [average_angle(trig[2 * i], trig[2 * i + 1], v) for i, v in enumerate(variances)]
    azimuth, elevation = [*averages, LEVEL][:2]
    return Place(distance, distance * distance + spread, azimuth, elevation, 1 + len(angles))


def mean_direction(where: Place) -> Array:
    """Average (d,) of the unit vector that points at the target."""
    azimuth, (low, high) = where.azimuth, where.elevation[:2]
    return np.array([low * azimuth.cos, low * azimuth.sin, high][: where.dims])


def mean_point(where: Place) -> Array:
    """Average Cartesian position (d,)."""
    return np.array([where.range * u for u in mean_direction(where)])


def angle_noise(variance: Any) -> Noise:
    """What normal noise of an angle does."""
    growth = np.expm1(variance)
    inverse = 1.0 / (1.0 + growth)
    shrink = np.sqrt(inverse)
    lift = 0.5 * growth * growth * inverse
    return Noise(shrink, growth * inverse / (1.0 + shrink), lift, growth - lift, growth)


def _quadratic(P: Array, v: list[Any]) -> Any:
    """The form v' P v of a symmetric P, component first."""
    squares = sum(a * a * P[i][i] for i, a in enumerate(v))
    return squares + 2.0 * sum(v[i] * v[j] * P[i][j] for i in range(len(v)) for j in range(i))


def polar_moments(position: Array, cov: Array) -> Given:
    """Range and angles of a Cartesian position, with variances, to first order.

    Bordonaro (29) and (30) with erratum B5, and their form in space. A target nearer than 1 mm to
    the sensor, or to its vertical axis, is moved 1 mm off: all stays finite, and the azimuth is
    anywhere.

    Args:
        position: (d,) in the sensor's frame (erratum B10).
        cov: (d, d).
    """
    x, y, *rest = position
    on_axis = x * x + y * y < _FLOOR
    x, y = select(on_axis, 1e-3, x), select(on_axis, 0.0, y)
    ground = np.sqrt(x * x + y * y)
    inverse = 1.0 / ground
    cos, sin = x * inverse, y * inverse
    azimuth = np.arctan2(y, x)
    turned = _quadratic(cov, [-sin, cos]) * inverse * inverse
    if not rest:
        away = _quadratic(cov, [cos, sin])
        return Given(np.array([ground, azimuth]), np.array([away, turned]), np.array([cos, sin]))
    z = rest[0]
    r = np.sqrt(ground * ground + z * z)
    inverse = 1.0 / r
    low, high = ground * inverse, z * inverse
    away = _quadratic(cov, [cos * low, sin * low, high])
    raised = _quadratic(cov, [-cos * high, -sin * high, low]) * inverse * inverse
    mean = np.array([r, azimuth, np.arctan2(z, ground)])
    return Given(mean, np.array([away, turned, raised]), np.array([cos, sin, low, high]))
