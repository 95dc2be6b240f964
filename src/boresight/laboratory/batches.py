"""Runs as lanes: a chunk cut into batches, and a batch's sums as nodes of the tree over runs.

A block of 8 lanes is 8 aligned runs, so what a kernel sums over a block is a node. A smaller node,
at a ragged end of a chunk, has a block of its own, in which only its runs count.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.laboratory.scores import Node
from boresight.laboratory.sums import Place, cover
from boresight.lanes import BLOCK, Leaf, paired

Array = Any


@dataclass(frozen=True, eq=False)
class Batch:
    """Lanes that are done at once.

    Attributes:
        places: nodes of the tree over runs, in order.
        runs: (lanes,) the run of each lane.
        counts: (lanes,) whether it counts, or only fills its block.
    """

    places: list[Place]
    runs: Array
    counts: Array

    def totals(self, sums: Array) -> Array:
        """Sums over blocks (blocks, scans, size) as sums over nodes (nodes, scans, size)."""
        ends = np.cumsum([_blocks(place) for place in self.places])[:-1]
        return np.stack([paired(part, 1)[0] for part in np.split(sums, ends)])

    def nodes(self, totals: Array, columns: dict[str, Leaf]) -> Iterator[Node]:
        """The nodes, of sums (nodes, scans, size) that hold column beside column."""
        ends = np.cumsum([leaf.size for leaf in columns.values()])[:-1]
        for place, total in zip(self.places, totals, strict=True):
            named = zip(columns.items(), np.split(total, ends, axis=1), strict=True)
            yield Node(*place, {name: leaf.unpack(part) for (name, leaf), part in named})


def batches(first: int, count: int, lanes: int) -> Iterator[Batch]:
    """Runs [first, first + count) in batches of at most so many lanes, a power of two."""
    waiting: list[Place] = []
    for place in cover(first, count, highest=lanes.bit_length() - 1):
        if sum(map(_blocks, waiting)) + _blocks(place) > lanes // BLOCK:
            yield _batch(waiting)
            waiting = []
        waiting.append(place)
    yield _batch(waiting)


def _batch(places: list[Place]) -> Batch:
    runs, counts = [], []
    for place in places:
        level, index = place
        begin, end = index << level, index + 1 << level
        block = begin // BLOCK * BLOCK + np.arange(BLOCK * _blocks(place))
        runs.append(block)
        counts.append((block >= begin) & (block < end))
    return Batch(places, np.concatenate(runs), np.concatenate(counts))


def _blocks(place: Place) -> int:
    """How many blocks of lanes a node takes."""
    return max(1, (1 << place[0]) // BLOCK)
