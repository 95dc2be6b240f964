"""What is kept of a chunk of runs: numbers of each run, and sums over runs for each scan.

Sums must not depend on how runs were cut into chunks, to the last bit, or two engines would give
two answers. They are therefore kept as the nodes of one binary tree over run numbers: node
(level, index) is the sum over runs [index 2^level, (index + 1) 2^level), always its two halves'
sum. A chunk gives the fewest nodes that cover it, and nodes of neighbouring chunks join.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

Array = Any


@dataclass(frozen=True, eq=False)
class Node:
    """A sum over an aligned power of two of runs.

    Attributes:
        level, index: runs [index 2^level, (index + 1) 2^level).
        sums: by name, (scans,) or (scans, k).
    """

    level: int
    index: int
    sums: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Scores:
    """A chunk of runs of one cell.

    Always there, of each run: `position_sq_m2`, `velocity_sq_m2ps2` (means over the scored scans of
    squared errors), `final_m` (distance at the last scan), `nees` (mean over the scored scans, per
    state), `nis`, `dof` (sums over them); where an estimate is no number they are infinite.
    Always there, of each scan: `error` (scans, n), `position_sq_m2`, `distance_m`,
    `velocity_sq_m2ps2`, `nees` (per state), `nis`, `dof`, `claimed_m2` (the position variance that
    the filter claims). Metrics add to the runs `fit_error_<channel>` (%) and `converged_scan` (the
    first from which the error stays small; the number of scans where there is none); to the scans
    `error_outer` (scans, n, n); to both `ospa_m`, `gospa_m`, and its parts `gospa_localisation`,
    `gospa_missed` and `gospa_false`, as powers, which add up to that of `gospa_m`.

    Attributes:
        first, count: runs [first, first + count).
        runs: numbers of each run, (count,) by name.
        nodes: sums over runs, by run number.
        seconds: processor time of this thread, s; the one number that differs between repetitions.
    """

    first: int
    count: int
    runs: Mapping[str, Array]
    nodes: tuple[Node, ...]
    seconds: float


@dataclass(frozen=True, eq=False)
class Gathered:
    """All runs of one cell: what its summary is made from.

    Attributes:
        count: number of runs, from run 0.
        runs: numbers of each run in their order, (count,) by name.
        sums: sums over all runs, the tree's total: (scans,) or (scans, k) by name.
        seconds: processor time of all chunks together, s.
    """

    count: int
    runs: Mapping[str, Array]
    sums: Mapping[str, Array]
    seconds: float
