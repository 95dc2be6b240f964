"""Ranges, sectors and spells of time in which pairs are counted, joined where they hold too few."""

from typing import Any, NamedTuple

import numpy as np

Array = Any


class Bins(NamedTuple):
    """Neighbouring intervals of one quantity.

    Attributes:
        low, high: (b,) ends of each; empty stretches between two intervals belong to none.
        index: (m,) which interval each row lies in; -1 if in none.
    """

    low: Array
    high: Array
    index: Array

    def __len__(self) -> int:
        """Number of intervals."""
        return len(self.low)


def round_edges(values: Array, most: int) -> Array:
    """Edges of at most `most` equal intervals that hold all values, at 1, 2 or 5 times 10 to k."""
    low, high = float(np.min(values)), float(np.max(values))
    least = max((high - low) / most, 1e-9)
    power = 10.0 ** np.floor(np.log10(least))
    width = next(step * power for step in (1, 2, 5, 10, 20) if step * power >= least)
    first = int(np.floor(low / width))
    count = int(np.floor(high / width)) - first + 1
    return width * np.arange(first, first + count + 1)


def joined(values: Array, edges: Array, target: Array, *, rows: int, targets: int) -> Bins:
    """Sort rows into intervals, each joined with the next until it holds enough.

    Args:
        values: (m,) quantity.
        edges: (e,) ascending; rows outside lie in no interval.
        target: (m,) number of the target of each row, from 0.
        rows: an interval holds at least so many,
        targets: of at least so many targets; what is left at the end joins the interval before.
    """
    fine: Array = np.searchsorted(edges, values, side="right") - 1
    fine = np.where((fine < len(edges) - 1) & np.isfinite(values), fine, -1)
    groups = _groups(fine, len(edges) - 1, target, rows, targets)
    group = np.full(len(edges), -1)  # of each fine interval; the last place serves index -1
    for number, members in enumerate(groups):
        group[members] = number
    low = np.array([edges[members[0]] for members in groups])
    high = np.array([edges[members[-1] + 1] for members in groups])
    return Bins(low, high, group[fine])


def _groups(fine: Array, count: int, target: Array, rows: int, targets: int) -> list[list[int]]:
    """Which fine intervals make one: those with rows, in order."""
    width = int(target.max(initial=0)) + 1
    cells = np.bincount((fine[fine >= 0] * width + target[fine >= 0]), minlength=count * width)
    cells = cells.reshape(count, width)
    groups: list[list[int]] = []
    members: list[int] = []
    for i in np.flatnonzero(cells.any(axis=1)):
        members.append(int(i))
        held = cells[members].sum(axis=0)
        if held.sum() >= rows and np.count_nonzero(held) >= targets:
            groups.append(members)
            members = []
    if members and groups:
        groups[-1].extend(members)
    elif members:
        groups.append(members)
    return groups
