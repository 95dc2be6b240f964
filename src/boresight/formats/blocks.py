"""From octets to ASTERIX blocks: follow the headers, and find the thread again after damage."""

from typing import NamedTuple

import numpy as np

from boresight.formats.specs import categories
from boresight.formats.wire import Integers, Octets

HEADER = 3
LARGEST = 65_535
# Categories of which a definition is or was published; only a header of one of them is followed.
ASSIGNED = frozenset(
    [1, 2, 3, 4, 7, 8, 9, 10, 11, 15, 16, 17, 18, 19, 20, 21, 23, 25, 30, 31, 32, 34, 48]  # noqa: RUF005  (two lines)
    + [61, 62, 63, 64, 65, 128, 129, 150, 204, 205, 238, 239, 240, 247, 252]
)
_IN_A_ROW = 3  # headers that must follow one another before the thread counts as found


class Region(NamedTuple):
    """Octets that no block accounts for, and why."""

    start: int
    end: int
    reason: str


class Found(NamedTuple):
    """Blocks between `starts` and `ends`, what lies between them, and where reading stopped."""

    starts: list[int]
    ends: list[int]
    gaps: list[Region]
    stop: int


def follow(data: bytes, at: int, end: int) -> Found:
    """Follow headers from `at` until `end` or the first one that cannot be a header."""
    starts: list[int] = []
    keep = starts.append
    last = end - HEADER
    category = -1
    while at < last:
        # Neighbours are mostly of one category, and comparing is quicker than looking up.
        if data[at] != category:
            if data[at] not in ASSIGNED:
                break
            category = data[at]
        length = data[at + 1] << 8 | data[at + 2]
        if length <= HEADER or at + length > end:
            break
        keep(at)
        at += length
    return Found(starts, [*starts[1:], at] if starts else [], [], at)


def split(data: bytes, at: int, end: int, *, more: bool) -> Found:
    """Split octets that hold nothing but blocks, skipping what is damaged.

    Args:
        data: the octets.
        at: where to begin.
        end: where to stop.
        more: the octets go on after `end`, so the last block may be incomplete; `stop` is then
            where to go on, else it is `end`.
    """
    starts: list[int] = []
    ends: list[int] = []
    gaps: list[Region] = []
    while at < end:
        found = follow(data, at, end)
        starts += found.starts
        ends += found.ends
        at = found.stop
        if at == end or (more and _may_go_on(data, at, end)):
            break
        after = resync(data, at + 1, end, more=more)
        gaps.append(Region(at, after, why_not(data, at, end)))
        at = after
    return Found(starts, ends, gaps, at)


def _may_go_on(data: bytes, at: int, end: int) -> bool:
    """Tell whether the header at `at` may be a good one that is merely cut by the buffer's end."""
    if at + HEADER > end:
        return True
    length = data[at + 1] << 8 | data[at + 2]
    return data[at] in ASSIGNED and length > HEADER and at + length > end


def resync(data: bytes, at: int, end: int, *, more: bool) -> int:
    """Return where headers follow one another again, at or after `at`; `end` if nowhere.

    With `more` octets to come, the last ones are left for them.
    """
    octets = np.frombuffer(data, np.uint8, end)[at:]
    known = np.zeros(256, bool)
    known[list(categories())] = True
    for candidate in (np.flatnonzero(known[octets]) + at).tolist():
        if _leads_on(data, candidate, end, more=more):
            return int(candidate)
    return max(at, end - LARGEST) if more else end


def _leads_on(data: bytes, at: int, end: int, *, more: bool) -> bool:
    for _ in range(_IN_A_ROW):
        if at + HEADER >= end:
            return more
        if data[at] not in ASSIGNED:
            return False
        length = data[at + 1] << 8 | data[at + 2]
        if length <= HEADER:
            return False
        at += length
        if at >= end:
            return at == end or more
    return True


def why_not(data: bytes, at: int, end: int) -> str:
    """Say what is wrong with the header at `at`."""
    if at + HEADER > end:
        return f"{end - at} octets are left, fewer than a block's header"
    length = data[at + 1] << 8 | data[at + 2]
    if data[at] not in ASSIGNED:
        return f"category {data[at]} is not assigned"
    if length <= HEADER:
        return f"a block of category {data[at]} says it is {length} octets long"
    return (
        f"a block of category {data[at]} says it is {length} octets long, and {end - at} are left"
    )


def candidates(octets: Octets, regions: list[Region], category: int) -> tuple[Integers, Integers]:
    """Return starts and ends of everything in regions (in order) that might be a block."""
    first = np.array([region.start for region in regions], np.int64)
    last = np.array([region.end for region in regions], np.int64)
    at = np.flatnonzero(octets[:-HEADER] == category)
    index = np.searchsorted(first, at, side="right") - 1
    after = at + (octets[at + 1].astype(np.int64) << 8 | octets[at + 2])
    fits = (index >= 0) & (after > at + HEADER) & (after <= last[index])
    return at[fits], after[fits]


def last_of_overlapping(starts: Integers, ends: Integers) -> list[int]:
    """Return the indices of blocks, last first, each ending before the one kept before it."""
    kept, reached = [], np.iinfo(np.int64).max
    for index in np.argsort(-starts, kind="stable").tolist():
        if ends[index] <= reached:
            kept.append(index)
            reached = starts[index]
    return kept
