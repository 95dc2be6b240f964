"""Which plots belong together: by 24-bit address, else by Mode A code with continuity.

Identity is evidence, not proof: a code is shared, changed and garbled, some reports are the radar's
own predictions. Plots that cannot be used are counted with the reason, never dropped in silence.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.formats import usable

if TYPE_CHECKING:
    import polars as pl

Array = Any
FASTEST_MPS = 600.0  # of anything with a transponder: continuity of a shared code
SLACK_M = 2_000.0  # plus what noise may add
SHORTEST_GAP_S = 60.0  # a silence this long, or of this many scans, ends a track
GAP_SCANS = 8
FEWEST = 3  # plots that make a second aircraft of the same identity
DUPLICATE_SCANS = 0.125  # two plots of one identity closer than this are one reply seen twice

MEANINGS = usable.MEANINGS | {
    "jump": "too far from the other plots of its identity for anything that flies",
    "duplicate": "a second plot of the same identity in the same instant (split or reflected)",
}


@dataclass(frozen=True, eq=False)
class Sorted:
    """Plots of a recording sorted into identities.

    Attributes:
        row: (m,) row of each used plot in the table, ordered by track and time.
        track: (m,) number of its track, from 0, in order of first appearance.
        skipped: (n,) reason per row of the table, empty where the plot is used.
        scan_s: median time between plots of one identity.
    """

    row: Array
    track: Array
    skipped: Array
    scan_s: float


def sort_by_identity(plots: "pl.DataFrame") -> Sorted:
    """Sort the plots of one sensor into tracks, and say why the others are not used."""
    time = plots["time_s"].to_numpy()
    skipped = usable.unusable(plots)
    keys = _keys(plots, skipped)
    rows = np.flatnonzero(skipped == "")
    rows = rows[np.lexsort((time[rows], keys[rows]))]
    scan = _scan(time[rows], keys[rows])
    position = _positions(plots)
    rows = _without_duplicates(rows, time, keys, position, scan, skipped)
    thread = _threads(rows, time, keys, position)
    rows, thread = _without_jumps(rows, thread, keys, skipped)
    order = np.lexsort((time[rows], thread, keys[rows]))
    rows, thread = rows[order], thread[order]
    track = _by_first_appearance(_cut(time[rows], keys[rows], thread, scan), time[rows])
    order = np.lexsort((time[rows], track))
    return Sorted(rows[order], track[order], skipped, scan)


def _keys(plots: "pl.DataFrame", skipped: Array) -> Array:
    """A number per identity: addresses and codes do not share numbers."""
    address, code = usable.column(plots, "address", ""), usable.column(plots, "mode_a", "")
    names = np.where(address != "", np.char.add("#", address.astype(str)), code.astype(str))
    keys = np.unique(names, return_inverse=True)[1]
    return np.where(skipped == "", keys, -1)


def _scan(time: Array, keys: Array) -> float:
    """Median time between plots of one identity; 4 s if nothing repeats."""
    steps = np.diff(time)[np.diff(keys) == 0]
    steps = steps[steps > 0.5]
    return float(np.median(steps)) if len(steps) else 4.0


def _positions(plots: "pl.DataFrame") -> Array:
    """Slant range and azimuth as a point in the plane, complex, m: enough to tell near from far."""
    azimuth = np.radians(usable.column(plots, "azimuth_deg", np.nan).astype(float))
    return usable.column(plots, "range_m", np.nan).astype(float) * np.exp(1j * azimuth)


def _without_duplicates(
    rows: Array, time: Array, keys: Array, position: Array, scan: float, skipped: Array
) -> Array:
    again = np.zeros(len(rows), dtype=bool)
    again[1:] = (
        (np.diff(keys[rows]) == 0)
        & (np.diff(time[rows]) < DUPLICATE_SCANS * scan)
        & (np.abs(np.diff(position[rows])) < SLACK_M)
    )
    skipped[rows[again]] = "duplicate"
    return rows[~again]


def _threads(rows: Array, time: Array, keys: Array, position: Array) -> Array:
    """Which of several aircraft that share an identity a plot belongs to; 0 for the first."""
    thread = np.zeros(len(rows), dtype=int)
    for start, stop in _runs(keys[rows]):
        part = rows[start:stop]
        reach = FASTEST_MPS * np.diff(time[part]) + SLACK_M
        if np.any(np.abs(np.diff(position[part])) > reach):
            thread[start:stop] = _follow(position[part], time[part])
    return thread


def _without_jumps(rows: Array, thread: Array, keys: Array, skipped: Array) -> tuple[Array, Array]:
    """A thread of one or two plots beside a longer one is no aircraft."""
    pair = keys[rows] * (thread.max(initial=0) + 1) + thread
    _, which, count = np.unique(pair, return_inverse=True, return_counts=True)
    shared = np.zeros(keys.max(initial=0) + 1, dtype=bool)
    shared[keys[rows[thread > 0]]] = True
    jump = shared[keys[rows]] & (count[which] < FEWEST)
    skipped[rows[jump]] = "jump"
    return rows[~jump], thread[~jump]


def _runs(keys: Array) -> list[tuple[int, int]]:
    cuts = np.flatnonzero(np.diff(keys)) + 1
    edges = [0, *cuts.tolist(), len(keys)]
    return [(a, b) for a, b in pairwise(edges) if b > a]


def _follow(position: Array, time: Array) -> Array:
    """Give each plot to the nearest thread that it can have come from, else to a new one."""
    ends: list[tuple[complex, float]] = []
    thread = np.zeros(len(position), dtype=int)
    for i, (p, t) in enumerate(zip(position.tolist(), time.tolist(), strict=True)):
        misses = [abs(p - q) - FASTEST_MPS * (t - s) - SLACK_M for q, s in ends]
        near = [(abs(p - ends[j][0]), j) for j, miss in enumerate(misses) if miss <= 0]
        if near:
            thread[i] = min(near)[1]
            ends[thread[i]] = (p, t)
        else:
            thread[i] = len(ends)
            ends.append((p, t))
    return thread


def _cut(time: Array, keys: Array, thread: Array, scan: float) -> Array:
    """Cut at long silences; a number per piece."""
    longest = max(SHORTEST_GAP_S, GAP_SCANS * scan)
    new = np.ones(len(time), dtype=bool)
    new[1:] = (np.diff(keys) != 0) | (np.diff(thread) != 0) | (np.diff(time) > longest)
    return np.cumsum(new) - 1


def _by_first_appearance(track: Array, time: Array) -> Array:
    first = np.full(track.max() + 1 if len(track) else 0, np.inf)
    np.minimum.at(first, track, time)
    rank = np.empty(len(first), dtype=int)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first))
    return rank[track]
