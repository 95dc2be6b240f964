"""Mean and spread of range, bearing, course and speed under a mixture, and under each of its cells.

By Gauss and Hermite's rule over each cell. Angles are wrapped about the direction of the whole
mixture, so their means are right on either side of north. Polar columns: range (m), bearing, course
(degrees true), speed (m/s).
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from boresight.maths import wrap
from boresight.target_motion.planar import Axes, own_axes, quadrature, spots

Array = Any


def polar_moments(
    weights: Array, means: Array, covs: Array, position: Array
) -> tuple[Array, Array]:
    """Mean and standard deviation of range, bearing, course and speed under a mixture.

    Args:
        weights: (..., cells), summing to one; a cell without weight may hold anything.
        means: (..., cells, n), North, East (m), their rates (m/s), and whatever follows.
        covs: (..., cells, n, n).
        position: (..., 2), own ship's North and East, m.

    Returns:
        Two of (..., 4) polar columns. Angles' means are circular, from 0 to 360, their spreads are
        of what is left, wrapped.
    """
    weights = np.asarray(weights, dtype=float)
    return mixture_moments(weights, cell_moments(weights, means, covs, position))


class Cells(NamedTuple):
    """Mean and variance of radius and angle, of position and velocity; each (..., cells, 2).

    Angles are what is left of them, wrapped, after `centre` (..., 2), their mixture's direction.
    """

    radius: Array
    radius_var: Array
    off: Array
    off_var: Array
    centre: Array


def cell_moments(weights: Array, means: Array, covs: Array, position: Array) -> Cells:
    """Moments of each cell by itself; zeros for cells without weight."""
    alive = weights > 0.0
    here = np.broadcast_to(np.asarray(position)[..., None, :], (*alive.shape, 2))[alive]
    axes = planes(np.asarray(means)[alive], np.asarray(covs)[alive], here)
    points, share = quadrature()
    x, y = spots(axes, points)
    radius = np.hypot(x, y)
    unit = (each / np.maximum(radius, 1e-12) @ share for each in (x, y))
    centre = _direction(weights, alive, axes.turn, unit)
    about = np.broadcast_to(centre[..., None, :], (*alive.shape, 2))[alive]
    off = wrap((axes.turn - about)[..., None] + np.arctan2(y, x))
    parts = [_spread_out(part, alive) for each in (radius, off) for part in _averaged(each, share)]
    return Cells(parts[0], parts[1], parts[2], parts[3], centre)


def mixture_moments(weights: Array, cells: Cells) -> tuple[Array, Array]:
    """Mean and standard deviation of mixtures, polar columns (..., 4); as in `polar_moments`."""
    w = weights[..., None]
    middle, spread = mixed(w, cells.radius, cells.radius_var)
    off, width = mixed(w, cells.off, cells.off_var)
    angle = np.degrees(cells.centre + off) % 360.0
    return _columns(middle, angle), _columns(spread, np.degrees(width))


def mixed(w: Array, means: Array, variances: Array) -> tuple[Array, Array]:
    """Mean and standard deviation of mixtures over the axis before the last."""
    mean = np.sum(w * means, axis=-2)
    apart = means - mean[..., None, :]
    return mean, np.sqrt(np.sum(w * (variances + apart * apart), axis=-2))


def planes(means: Array, covs: Array, position: Array) -> Axes:
    """Own axes, each (N, 2), of the position relative to own ship and of the velocity."""
    pairs = np.stack([means[:, :2] - position, means[:, 2:4]], axis=1)
    blocks = np.stack([covs[:, :2, :2], covs[:, 2:4, 2:4]], axis=1)
    return own_axes(pairs, blocks)


def _direction(weights: Array, alive: Array, turn: Array, vectors: Iterable[Array]) -> Array:
    """(..., 2) direction of mixtures, from each cell's mean of unit vectors, along its own axes."""
    ahead, aside = vectors
    cos, sin = np.cos(turn), np.sin(turn)
    north, east = (
        np.sum(weights[..., None] * _spread_out(each, alive), axis=-2)
        for each in (ahead * cos - aside * sin, ahead * sin + aside * cos)
    )
    return np.arctan2(east, north)


def _averaged(values: Array, share: Array) -> tuple[Array, Array]:
    """Mean and variance over the points of a rule, the last axis."""
    mean = values @ share
    return mean, (values - mean[..., None]) ** 2 @ share


def _spread_out(values: Array, alive: Array) -> Array:
    """What (alive cells, 2) are, where those stand among all, (..., cells, 2)."""
    full = np.zeros((*alive.shape, 2))
    full[alive] = values
    return full


def _columns(radius: Array, angle: Array) -> Array:
    """Polar columns of (..., 2) radii and angles of position and velocity."""
    return np.stack([radius[..., 0], angle[..., 0], angle[..., 1], radius[..., 1]], axis=-1)
