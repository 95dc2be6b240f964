"""Credible regions of a mixture in the plane: the shortest sets that hold so much, in pieces.

Densities are exact (`planar`); only the grid on which they are taken follows the mixture: it lies
where points of each cell lie, so that a thin cell far away is seen as well as a wide one at home.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from boresight.target_motion.planar import Axes, angle_density, radius_probability, scattered, spots
from boresight.target_motion.result import LEVELS, Region

Array = Any
_POINTS = 224  # of a cell with all the weight, for the grid
_FEWEST = 24  # of any cell
_EVEN = 120  # beside them, over all
_ALONG = np.linspace(-5.0, 5.0, 31)  # standard deviations, of a normal distribution's grid
_FINEST = 1e-7  # of the grid's width
_ROUNDS = 30  # of halving, for a density that parts what is in from what is out


def radius_regions(weights: Array, axes: Axes, levels: Sequence[int] = LEVELS) -> dict[str, Region]:
    """Regions of a mixture's distance from the origin.

    Args:
        weights: (cells,), above zero.
        axes: of each cell, (cells,).
        levels: per cent.
    """
    radii, _ = _points(weights, axes)
    edges = _grid(np.append(radii, np.linspace(0.0, radii.max(), _EVEN)))
    inside = weights @ radius_probability(edges, axes)
    density = np.maximum(np.diff(inside), 0.0) / np.diff(edges)
    middles = (edges[:-1] + edges[1:]) / 2.0
    return _named(levels, highest_density(middles, density, levels))


def angle_regions(weights: Array, axes: Axes, levels: Sequence[int] = LEVELS) -> dict[str, Region]:
    """Regions, degrees, of a mixture's direction as seen from the origin.

    Args:
        weights: (cells,), above zero.
        axes: of each cell, (cells,).
        levels: per cent.
    """
    turn = 2.0 * np.pi
    _, angles = _points(weights, axes)
    grid = _grid(np.append(angles % turn, np.linspace(0.0, turn, _EVEN)))
    density = weights @ angle_density(grid, axes)
    # The circle is cut where least is, so that no piece lies on both sides of the cut.
    cut = int(np.argmin(density))
    grid = np.concatenate([grid[cut:], grid[1 : cut + 1] + turn])
    density = np.concatenate([density[cut:], density[1 : cut + 1]])
    found = highest_density(grid, density, levels)
    return _named(levels, [_from_north(np.degrees(each)) for each in found])


def normal_ends(weights: Array, means: Array, sds: Array, level: int) -> tuple[Array, Array]:
    """Where the shortest set of each mixture of normal distributions begins and ends.

    Args:
        weights: (steps, cells); a cell without weight may hold anything.
        means: (steps, cells).
        sds: (steps, cells).
        level: per cent.

    Returns:
        Two of (steps,).
    """
    best = np.argmax(weights, axis=-1)[:, None]
    means, sds = (  # cells that are gone lie where the best one does
        np.where(weights > 0.0, each, np.take_along_axis(each, best, axis=-1))
        for each in (means, sds)
    )
    grid = (means[..., None] + sds[..., None] * _ALONG).reshape(len(weights), -1)
    grid.sort(axis=-1)
    density = np.zeros_like(grid)
    for w, mean, sd in zip(weights.T, means.T, sds.T, strict=True):
        density += (w / sd)[:, None] * np.exp(-0.5 * ((grid - mean[:, None]) / sd[:, None]) ** 2)
    return outer_ends(grid, density, level)


def highest_density(grid: Array, density: Array, levels: Sequence[int]) -> list[Array]:
    """The shortest sets of intervals that hold so much of a density, linear between its points.

    Args:
        grid: (g,), increasing.
        density: (g,), of any scale.
        levels: per cent.

    Returns:
        For each level (pieces, 2).
    """
    floors = _floors(grid, density, np.asarray(levels, dtype=float) / 100.0)
    return [_above(grid, density, floor) for floor in floors]


def outer_ends(grid: Array, density: Array, level: int) -> tuple[Array, Array]:
    """Where the shortest set begins and ends, for many densities at once.

    Args:
        grid: (..., g), not decreasing.
        density: (..., g).
        level: per cent.

    Returns:
        Two of (...).
    """
    floor = _floors(grid, density, np.array([level / 100.0]))
    over = density > floor
    first = np.argmax(over, axis=-1)
    last = over.shape[-1] - 1 - np.argmax(over[..., ::-1], axis=-1)
    low = _crossing(grid, density, floor, first[..., None], -1)
    high = _crossing(grid, density, floor, last[..., None], 1)
    return low[..., 0], high[..., 0]


def _floors(grid: Array, density: Array, shares: Array) -> Array:
    """(..., levels) the density above which each share lies."""
    high = np.repeat(density.max(axis=-1, keepdims=True), len(shares), axis=-1)
    low = np.zeros_like(high)
    width = np.diff(grid)[..., None, :]
    lesser = np.minimum(density[..., :-1], density[..., 1:])[..., None, :]
    greater = np.maximum(density[..., :-1], density[..., 1:])[..., None, :]
    total = np.sum(width * (lesser + greater), axis=-1) / 2.0
    fall = np.maximum(greater - lesser, 1e-300)
    for _ in range(_ROUNDS):
        floor = (low + high) / 2.0
        level = floor[..., None]
        part = np.clip((greater - level) / fall, 0.0, 1.0)
        held = np.sum(width * part * (greater + np.maximum(lesser, level)), axis=-1) / 2.0
        enough = held >= shares * total
        low, high = np.where(enough, floor, low), np.where(enough, high, floor)
    return low


def _above(grid: Array, density: Array, floor: float) -> Array:
    """(pieces, 2) where a density is above a floor."""
    over = density > floor
    starts = np.flatnonzero(over & ~np.append(False, over[:-1]))
    ends = np.flatnonzero(over & ~np.append(over[1:], False))
    return np.stack(
        [_crossing(grid, density, floor, starts, -1), _crossing(grid, density, floor, ends, 1)],
        axis=-1,
    )


def _crossing(grid: Array, density: Array, floor: Any, at: Array, side: int) -> Array:
    """Where densities fall to the floor next to some points; at the grid's end, there."""
    beyond = np.clip(at + side, 0, grid.shape[-1] - 1)
    here, there = (np.take_along_axis(density, i, axis=-1) for i in (at, beyond))
    start, end = (np.take_along_axis(grid, i, axis=-1) for i in (at, beyond))
    fall = here - there
    share = np.where(fall > 0.0, (here - floor) / np.where(fall > 0.0, fall, 1.0), 0.0)
    return start + share * (end - start)


def _points(weights: Array, axes: Axes) -> tuple[Array, Array]:
    """Radii and angles of points of all cells: of each as many as it has weight, and some more."""
    x, y = spots(axes, scattered(_POINTS))
    used = np.arange(_POINTS) < _FEWEST + (_POINTS - _FEWEST) * weights[:, None]
    return np.hypot(x, y)[used], (axes.turn[:, None] + np.arctan2(y, x))[used]


def _grid(points: Array) -> Array:
    """Points in order, those that lie too close to each other once."""
    low, high = points.min(), points.max()
    step = max((high - low) * _FINEST, abs(high) * 1e-12, 1e-12)
    return low + step * np.unique(np.rint((points - low) / step))


def _from_north(pieces: Array) -> Array:
    """Pieces on a circle, degrees, that begin from 0 to 360, in order."""
    pieces = pieces - 360.0 * np.floor(pieces[:, :1] / 360.0)
    return pieces[np.argsort(pieces[:, 0])]


def _named(levels: Sequence[int], found: Sequence[Array]) -> dict[str, Region]:
    regions = [tuple((float(low), float(high)) for low, high in each) for each in found]
    return {f"{level}": region for level, region in zip(levels, regions, strict=True)}
