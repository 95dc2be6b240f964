"""Plots and targets that are near each other at the plot's time, found without trying them all.

The ground is divided into square cells. A target visits a cell as long as it may come within the
gate of anything in it; only plots of that cell and time are looked at.
"""

from typing import Any

import numpy as np

from boresight.calibration.interpolation import Paths

Array = Any
_CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))


def near(time: Array, place: Array, paths: Paths, where: Array, gate_m: float) -> tuple[Array, ...]:
    """Every plot with every target within the gate.

    Args:
        time: (m,) of the plots, s.
        place: (m,) complex, north + i east, m.
        paths: of the reference.
        where: (n,) complex, place of each report, straight lines between them.
        gate_m: greatest distance.

    Returns:
        Plots, rows of the reports before, and distances, each (pairs,).
    """
    grid = _Grid(time, place, where, paths, gate_m)
    target, first, end = grid.visits()
    plot, visit = _spread(first, end)
    plot = grid.order[plot]
    row = paths.before(target[visit], time[plot])
    plot, row = plot[row >= 0], row[row >= 0]
    distance = np.abs(place[plot] - paths.linear(where, row, time[plot]))
    close = distance < gate_m
    return plot[close], row[close], distance[close]


class _Grid:
    """Plots sorted by cell and time.

    Attributes:
        order: (m,) plots by cell and time.
    """

    def __init__(
        self, time: Array, place: Array, where: Array, paths: Paths, gate_m: float
    ) -> None:
        joined = paths.joined(np.arange(len(where)))
        chord = np.where(joined, np.abs(np.diff(where, append=where[-1:])), 0.0)
        # A point of a straight line is no further from the nearer end than half the line.
        self._reach = gate_m + max(chord.max(initial=0.0), 1.0) / 2
        self._side = 2 * self._reach  # so that its corners reach all cells that a square touches
        self._low = np.array([where.real.min(), where.imag.min()]) - self._reach
        self._rows = int((where.imag.max() - self._low[1] + self._reach) // self._side) + 1
        self._paths, self._where, self._joined = paths, where, joined
        self._instants = np.unique(time)
        cell = self._cell(place.real, place.imag)
        key = self._key(cell, time, "right")
        self.order = np.argsort(key, kind="stable")
        self._keys = key[self.order]

    def _cell(self, north: Array, east: Array) -> Array:
        """Number of the cell; none of the targets' where it lies beyond them."""
        column = np.floor((north - self._low[0]) / self._side).astype(np.int64)
        row = np.floor((east - self._low[1]) / self._side).astype(np.int64)
        return np.where((row >= 0) & (row < self._rows), column * self._rows + row, -1)

    def _key(self, cell: Array, time: Array, side: Any) -> Array:
        rank = np.searchsorted(self._instants, time, side=side)
        return cell * (len(self._instants) + 1) + rank

    def _spans(self) -> tuple[Array, Array]:
        """From when until when each report is the nearest one on its path."""
        time, joined = self._paths.time, self._joined[:-1]
        middle, after = (time[:-1] + time[1:]) / 2, np.nextafter(time, np.inf)
        since = np.append(time[:1], np.where(joined, middle, time[1:]))
        return since, np.append(np.where(joined, middle, after[:-1]), after[-1:])

    def visits(self) -> tuple[Array, Array, Array]:
        """Target of each visit, and its first plot and the one after its last in `order`."""
        count = len(self._where)
        row = np.tile(np.arange(count), len(_CORNERS))
        corner = [self._where + self._reach * (north + 1j * east) for north, east in _CORNERS]
        cell = np.concatenate([self._cell(each.real, each.imag) for each in corner])
        order = np.lexsort((row, cell))
        cell, row = cell[order], row[order]
        new = np.append(True, (np.diff(cell) != 0) | (np.diff(row) != 0))
        cell, row = cell[new], row[new]
        since, until = self._spans()
        on = (np.diff(cell) == 0) & (np.diff(row) == 1) & self._joined[row[:-1]]
        start, stop = np.append(True, ~on), np.append(~on, True)
        first = np.searchsorted(self._keys, self._key(cell[start], since[row[start]], "left") + 1)
        end = np.searchsorted(self._keys, self._key(cell[start], until[row[stop]], "left") + 1)
        return self._paths.target[row[start]], first, end


def _spread(first: Array, end: Array) -> tuple[Array, Array]:
    """All members of the ranges, and which range each is of."""
    number = np.maximum(end - first, 0)
    which = np.repeat(np.arange(len(first)), number)
    index = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    return first[which] + index, which
