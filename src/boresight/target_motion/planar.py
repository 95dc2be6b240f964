"""A Gaussian in the plane, read in polar coordinates: how its radius and its angle spread.

The angle's density is the angular Gaussian of [mardia2000] K. V. Mardia and P. E. Jupp,
"Directional Statistics", written so that nothing cancels far from the origin. The radius has no
closed form: its distribution is integrated over the shorter axis. Both hold for any Gaussian, thin
or wide, far off or at the origin.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np

Array = Any
_REACH = 6.0  # standard deviations that count
_TINY = 1e-12  # variance (m² or m²/s²) below which nothing is told apart


class Axes(NamedTuple):
    """A Gaussian in the plane along its own axes; each (...).

    Attributes:
        along, across: its mean, along the longer and the shorter axis.
        long, short: standard deviations.
        turn: angle from x to the longer axis, rad.
    """

    along: Array
    across: Array
    long: Array
    short: Array
    turn: Array


def own_axes(mean: Array, cov: Array) -> Axes:
    """Turn Gaussians, mean (..., 2) and cov (..., 2, 2), into their own axes."""
    a, b, c = cov[..., 0, 0], cov[..., 0, 1], cov[..., 1, 1]
    longer = np.maximum((a + c) / 2.0 + np.hypot((a - c) / 2.0, b), _TINY)
    shorter = np.maximum((a * c - b * b) / longer, _TINY)
    turn = np.arctan2(2.0 * b, a - c) / 2.0
    x, y, cos, sin = mean[..., 0], mean[..., 1], np.cos(turn), np.sin(turn)
    return Axes(x * cos + y * sin, y * cos - x * sin, np.sqrt(longer), np.sqrt(shorter), turn)


def spots(axes: Axes, points: Array) -> tuple[Array, Array]:
    """Points of each Gaussian along its own axes, x and y, each (..., points).

    Args:
        axes: each (...).
        points: (points, 2), in standard deviations along and across.
    """
    x = axes.along[..., None] + axes.long[..., None] * points[:, 0]
    y = axes.across[..., None] + axes.short[..., None] * points[:, 1]
    return x, y


@cache
def quadrature(along: int = 12, across: int = 4) -> tuple[Array, Array]:
    """Points (points, 2) and weights of Gauss and Hermite's product rule for a standard normal.

    More along the longer axis: of a Gaussian at the origin the radius has a kink there. Its mean
    is then right to 4 % and its spread to 11 %; of one well away from it, to 1e-3.
    """
    (t, w), (u, v) = (np.polynomial.hermite_e.hermegauss(n) for n in (along, across))
    points = np.stack(np.meshgrid(t, u, indexing="ij"), axis=-1).reshape(-1, 2)
    shares = np.outer(w, v).ravel()
    return points, shares / shares.sum()


@cache
def scattered(count: int) -> Array:
    """Points (count, 2) that fill the square that counts; either coordinate alone is even too."""
    plastic = 1.32471795724474602596  # its powers make a lattice without gaps
    steps = np.arange(1, count + 1)[:, None] * np.array([1.0 / plastic, 1.0 / plastic**2])
    return _REACH * (2.0 * (steps % 1.0) - 1.0)


def angle_density(angle: Array, axes: Axes) -> Array:
    """Density per radian of each Gaussian's angle.

    Args:
        angle: (g,) rad.
        axes: each (cells,).

    Returns:
        (cells, g).
    """
    from scipy.special import ndtr

    along, across, a, b, turn = (each[:, None] for each in axes)
    cos, sin = np.cos(angle - turn), np.sin(angle - turn)
    scale = np.hypot(cos / a, sin / b)
    ahead = (along * cos / a**2 + across * sin / b**2) / scale
    aside = (along * sin - across * cos) / (a * b * scale)
    away = np.hypot(along / a, across / b)
    beam = np.sqrt(2.0 * np.pi) * ahead * np.exp(-0.5 * aside**2) * ndtr(ahead)
    return (np.exp(-0.5 * away**2) + beam) / (2.0 * np.pi * a * b * scale**2)


def radius_probability(radius: Array, axes: Axes, nodes: int = 32) -> Array:
    """Probability of each Gaussian within a radius of the origin.

    Args:
        radius: (g,), not negative.
        axes: each (cells,).
        nodes: of Gauss and Legendre's rule; 32 are right to 1e-6.

    Returns:
        (cells, g). The integral over one coordinate, y = r sin u: what lies along the other one
        between the circle's two sides is a difference of two normal distributions.
    """
    from scipy.special import ndtr

    t, w = _legendre(nodes)
    ahead, aside, slope, depth, width = (each[:, None, None] for each in _in_slices(axes))
    r = np.maximum(radius, 1e-9)[:, None]
    first = np.arcsin(np.clip((aside - _REACH * width) / r, -1.0, 1.0))
    last = np.arcsin(np.clip((aside + _REACH * width) / r, -1.0, 1.0))
    half = (last - first) / 2.0
    u = (first + last) / 2.0 + half * t
    x, y = r * np.cos(u), r * np.sin(u)
    middle, off = ahead + slope * (y - aside), (y - aside) / width
    chord = ndtr((x - middle) / depth) - ndtr((-x - middle) / depth)
    density = np.exp(-0.5 * off * off) / (np.sqrt(2.0 * np.pi) * width)
    return np.sum(w * density * x * chord, axis=-1) * half[..., 0]


@cache
def _legendre(nodes: int) -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(nodes)


def _in_slices(axes: Axes) -> tuple[Array, Array, Array, Array, Array]:
    """A Gaussian as slices across one of its coordinates: y normal, and x normal given y.

    Slices lie along the longer axis, unless circles about the origin cut them so steeply that a
    rule over y would miss the edge; then they lie along the line of sight.

    Returns:
        Means of x and y, slope of x over y, spread of x given y, spread of y; each (cells,).
    """
    along, across, a, b, _ = axes
    away = np.hypot(along, across)
    steep = a * (np.abs(along) + a) < b * away
    turn = np.where(steep, np.arctan2(across, along), 0.0)
    cos, sin = np.cos(turn), np.sin(turn)
    width = np.hypot(a * sin, b * cos)
    slope = (b - a) * (b + a) * cos * sin / width**2
    return along * cos + across * sin, across * cos - along * sin, slope, a * b / width, width
