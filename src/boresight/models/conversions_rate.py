"""Position and range rate converted together, their noises correlated.

Paper: bordonaro section 5, future work; derived here ("Beyond the papers").
Differs from it: the paper stops at position.

With c the covariance of the noises of range r and range rate d, xi = r_m d_m - c has mean r d, the
inner product of position and velocity: quadratic in the state, and free of angles. The covariance
is the true one averaged over a prediction, as that of DUCM.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.maths import Gaussian
from boresight.models.conversions import Plot, bias_given_plot, conditioned, stretched, understand
from boresight.models.polar import Given, Place, mean_direction, mean_point, place, polar_moments

Array = Any


class GivenRate(NamedTuple):
    """Where the target is thought to be, and how fast it is thought to recede.

    Attributes:
        place: range and angles.
        rate: range rate, m/s, positive when opening.
        variance: of the range rate.
        covariance: of range and range rate.
    """

    place: Given
    rate: Any
    variance: Any
    covariance: Any


class RateNoise(NamedTuple):
    """Variances of range and range rate, and their covariance c."""

    range: Any
    rate: Any
    both: Any


def rate_moments(position: Array, velocity: Array, cov: Array) -> GivenRate:
    """Range, angles and range rate of a Cartesian state, with variances, to first order.

    Args:
        position: (d,) relative to the sensor, in its frame.
        velocity: (d,) likewise.
        cov: (2d, 2d) of position and velocity.
    """
    d = len(position)
    found = polar_moments(position, cov[:d][:, :d])
    cos, sin, low, high = [*found.direction, 1.0, 0.0][:4]
    u = [cos * low, sin * low, high][:d]
    rate = sum(a * v for a, v in zip(u, velocity, strict=True))
    slope = [(v - rate * a) / found.mean[0] for a, v in zip(u, velocity, strict=True)] + u
    pushed = [sum(cov[i][j] * s for j, s in enumerate(slope)) for i in range(2 * d)]
    variance = sum(s * p for s, p in zip(slope, pushed, strict=True))
    covariance = sum(a * p for a, p in zip(u, pushed, strict=False))
    return GivenRate(found, rate, variance, covariance)


def convert_with_rate(
    z: Array, sigma: Array, correlation: Any, given: GivenRate | None = None
) -> Gaussian:
    """A plot with range rate as unbiased position and xi = r_m d_m - c, with their covariance.

    Args:
        z: (d + 1,) range m, azimuth rad, in space elevation rad, range rate m/s (opening).
        sigma: (d + 1,) standard deviations.
        correlation: of the noises of range and range rate, -1 to 1.
        given: what was predicted; None for a first scan: then conditioned on the plot (B9).

    Returns:
        mean (d + 1,): x, y, in space z, and xi, m²/s; cov (d + 1, d + 1).
    """
    plot = understand(z[:-1], sigma[:-1])
    noise = RateNoise(plot.variances[0], sigma[-1] * sigma[-1], correlation * sigma[0] * sigma[-1])
    where = plot.at if given is None else place(given.place)
    rate, spread, shared = (z[-1], 0.0, 0.0) if given is None else given[1:]
    cross = where.range * rate + shared
    variance = _product_variance(where.square, rate * rate + spread, cross, noise)
    pulls = _pulls(where, rate, noise)
    if given is None:
        variance, pulls = _about_the_plot(plot, variance, pulls, noise)
    position = conditioned("ducm", plot, None if given is None else given.place)
    xi = z[0] * z[-1] - noise.both
    return Gaussian(np.array([*position.mean, xi]), _bordered(position.cov, pulls, variance))


def _product_variance(range2: Any, rate2: Any, cross: Any, noise: RateNoise) -> Any:
    """Variance of xi, from the averages of r², d² and r d."""
    both = noise.range * noise.rate + noise.both * noise.both
    return range2 * noise.rate + rate2 * noise.range + 2.0 * cross * noise.both + both


def _pulls(where: Place, rate: Any, noise: RateNoise) -> Array:
    """Covariance (d,) of the unbiased position with xi."""
    pull = rate * noise.range + where.range * noise.both
    return np.array([pull * u for u in mean_direction(where)])


def _about_the_plot(plot: Plot, variance: Any, pulls: Array, noise: RateNoise) -> tuple[Any, Array]:
    """The same of the errors given the plot, whose means are b and -2 c: moments about zero."""
    bias = stretched(mean_point(plot.at), *bias_given_plot(plot))
    shrunk = stretched(pulls, *plot.shrink)
    lag = -2.0 * noise.both
    moved = [p + lag * b for p, b in zip(shrunk, bias, strict=True)]
    return variance + lag * lag, np.array(moved)


def _bordered(cov: Array, pulls: Array, variance: Any) -> Array:
    rows = [[*row, pull] for row, pull in zip(cov, pulls, strict=True)]
    return np.array([*rows, [*pulls, variance]])
