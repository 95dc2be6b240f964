"""Credible regions of a mixture in the plane: the shortest sets that hold so much, in pieces.

Densities are exact (`planar`); only the grid on which they are taken follows the mixture: it lies
where points of each cell lie, so that a thin cell far away is seen as well as a wide one at home.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from boresight.tma.planar import Axes, angle_density, radius_probability, scattered, spots
from boresight.tma.result import LEVELS, Region

Array = Any
_POINTS = 96  # of each cell, for the grid
_FINEST = 1e-7  # of the grid's width
_ROUNDS = 40  # of halving, for a density that parts what is in from what is out


def radius_regions(weights: Array, axes: Axes, levels: Sequence[int] = LEVELS) -> dict[str, Region]:
    """Regions of a mixture's distance from the origin.

    Args:
        weights: (cells,), above zero.
        axes: of each cell, (cells,).
        levels: per cent.
    """
    edges = _grid(spots(axes, scattered(_POINTS))[0])
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
    angles = np.append(spots(axes, scattered(_POINTS))[1].ravel(), np.linspace(0.0, turn, 180))
    grid = _grid(angles % turn)
    density = weights @ angle_density(grid, axes)
    # The circle is cut where least is, and the cut's ends are one point.
    cut = int(np.argmin(density))
    grid = np.concatenate([grid[cut:], grid[: cut + 1] + turn])
    density = np.concatenate([density[cut:], density[: cut + 1]])
    found = highest_density(grid, density, levels)
    return _named(levels, [_joined(np.degrees(each)) for each in found])


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


def _floors(grid: Array, density: Array, shares: Array) -> Array:
    """(levels,) the density above which each share lies."""
    low, high = np.zeros_like(shares), np.full_like(shares, density.max())
    total = np.sum(np.diff(grid) * (density[:-1] + density[1:])) / 2.0
    lesser = np.minimum(density[:-1], density[1:])
    greater = np.maximum(density[:-1], density[1:])
    slope = np.maximum(greater - lesser, 1e-300)
    for _ in range(_ROUNDS):
        middle = (low + high) / 2.0
        floor = middle[:, None]
        part = np.clip((greater - floor) / slope, 0.0, 1.0)
        held = part * (greater + np.maximum(lesser, floor)) / 2.0 @ np.diff(grid)
        enough = held >= shares * total
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
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


def _crossing(grid: Array, density: Array, floor: float, at: Array, side: int) -> Array:
    """Where the density falls to the floor next to some points; at the grid's end, there."""
    beyond = np.clip(at + side, 0, len(grid) - 1)
    fall = density[at] - density[beyond]
    share = np.where(fall > 0.0, (density[at] - floor) / np.where(fall > 0.0, fall, 1.0), 0.0)
    return grid[at] + share * (grid[beyond] - grid[at])


def _grid(points: Array) -> Array:
    """Points in order, those that lie too close to each other once."""
    low, high = points.min(), points.max()
    step = max((high - low) * _FINEST, abs(high) * 1e-12, 1e-12)
    return low + step * np.unique(np.rint((points - low) / step))


def _joined(pieces: Array) -> Array:
    """Pieces on a circle that was cut, degrees: those that meet at the cut are one; from 0 on."""
    if len(pieces) > 1 and pieces[-1, 1] - pieces[0, 0] >= 360.0 - 1e-9:
        pieces[0, 0], pieces = pieces[-1, 0] - 360.0, pieces[:-1]
    pieces = pieces - 360.0 * np.floor(pieces[:, :1] / 360.0)
    return pieces[np.argsort(pieces[:, 0])]


def _named(levels: Sequence[int], found: Sequence[Array]) -> dict[str, Region]:
    regions = [tuple((float(low), float(high)) for low, high in each) for each in found]
    return {f"{level}": region for level, region in zip(levels, regions, strict=True)}
