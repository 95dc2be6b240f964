"""Sums over runs that do not depend, to the last bit, on how the runs were cut into chunks.

Node (level, index) of one binary tree is the sum over runs [index 2^level, (index + 1) 2^level),
and always its two halves' sum. Whatever chunks come in whatever order, each joins its neighbours as
soon as both halves of a node are there, so the same additions are done in the end.
"""

from collections.abc import Iterable, Mapping

from boresight.laboratory.scores import Array, Node

Place = tuple[int, int]  # level and index


def cover(first: int, count: int, *, highest: int = 64) -> list[Place]:
    """The fewest nodes that hold runs [first, first + count), in order, none above `highest`."""
    places, last = [], first + count
    while first < last:
        level = min((last - first).bit_length() - 1, highest)
        if first:
            level = min(level, (first & -first).bit_length() - 1)
        places.append((level, first >> level))
        first += 1 << level
    return places


class Tree:
    """The nodes of runs that are done, joined as far as they go; for one thread at a time."""

    def __init__(self, nodes: Iterable[Node] = ()) -> None:
        self._known: dict[Place, Mapping[str, Array]] = {}
        self.add(nodes)

    def add(self, nodes: Iterable[Node]) -> None:
        """More of them, in any order; no run twice."""
        for node in nodes:
            level, index, sums = node.level, node.index, node.sums
            while (other := self._known.pop((level, index ^ 1), None)) is not None:
                sums = _sum(sums, other)
                level, index = level + 1, index // 2
            self._known[level, index] = sums

    @property
    def nodes(self) -> tuple[Node, ...]:
        """What is there, in the order of the runs."""
        places = sorted(self._known, key=lambda place: place[1] << place[0])
        return tuple(Node(*place, self._known[place]) for place in places)

    @property
    def total(self) -> Mapping[str, Array]:
        """The sum over all runs: of its nodes, the last ones first, as they are the smallest."""
        *rest, total = (node.sums for node in self.nodes)
        for sums in reversed(rest):
            total = _sum(sums, total)
        return total


def _sum(one: Mapping[str, Array], other: Mapping[str, Array]) -> dict[str, Array]:
    return {name: one[name] + other[name] for name in one}
