"""The scores of a cell, put together as chunks of its runs come, in any order."""

from collections.abc import Iterator
from itertools import chain, pairwise
from typing import Any

import numpy as np

from boresight.laboratory.scores import Gathered, Scores
from boresight.laboratory.sums import Tree

Array = Any


class Tally:
    """What is known so far of one cell; it holds numbers of each run, and sums merged at once."""

    def __init__(self, runs: int) -> None:
        self._is_done = np.zeros(runs, dtype=bool)
        self._runs: dict[str, Array] = {}
        self._tree = Tree()
        self._seconds = 0.0

    def add(self, scores: Scores) -> bool:
        """Take a chunk of runs; what sticks out of the study, or is known, is not taken."""
        part = slice(scores.first, scores.first + scores.count)
        if part.stop > len(self._is_done) or self._is_done[part].any():
            return False
        for name, values in scores.runs.items():
            self._runs.setdefault(name, np.empty(len(self._is_done)))[part] = values
        self._tree.add(scores.nodes)
        self._seconds += scores.seconds
        self._is_done[part] = True
        return True

    @property
    def count(self) -> int:
        """Number of runs that are done."""
        return int(np.count_nonzero(self._is_done))

    def missing(self, chunk: int) -> Iterator[tuple[int, int]]:
        """First run and number of runs of chunks that are still to do, `chunk` at most."""
        edges = np.flatnonzero(np.diff(self._is_done, prepend=True, append=True))
        for first, end in edges.reshape(-1, 2).tolist():
            inner = range((first // chunk + 1) * chunk, end, chunk)
            for start, stop in pairwise(chain((first,), inner, (end,))):
                yield start, stop - start

    def gathered(self) -> Gathered:
        """All runs, once all are done."""
        count = len(self._is_done)
        return Gathered(count, self._runs, self._tree.total, self._seconds)
