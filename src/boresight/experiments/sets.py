"""Distances between sets of targets: OSPA and GOSPA, with their parts.

[schuhmacher2008] D. Schuhmacher, B.-T. Vo and B.-N. Vo, "A Consistent Metric for Performance
Evaluation of Multi-Object Filters"; [rahmathullah2017] A. S. Rahmathullah, A. F. Garcia-Fernandez
and L. Svensson, "Generalized optimal sub-pattern assignment metric".
Differs from them: sets of a sequence are rows of one array, in which NaN fills up the smaller ones;
every part is a length, so what adds up are their powers.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError

Array = Any


class Ospa(NamedTuple):
    """Per-target distance between two sets: distance^p = localisation^p + cardinality^p.

    Attributes:
        distance: (...) m, at most the cutoff.
        localisation: of what was paired.
        cardinality: of targets too many or too few.
    """

    distance: Array
    localisation: Array
    cardinality: Array


class Gospa(NamedTuple):
    """Distance between two sets: distance^p = localisation^p + missed^p + false^p.

    Attributes:
        distance: (...) m.
        localisation: of what was paired.
        missed: of targets without an estimate.
        false: of estimates without a target.
        pairs, missed_count, false_count: how many of each.
    """

    distance: Array
    localisation: Array
    missed: Array
    false: Array
    pairs: Array
    missed_count: Array
    false_count: Array


def ospa(truth: Any, estimates: Any, *, cutoff_m: float, order: float = 2.0) -> Ospa:
    """Optimal subpattern assignment distance of sets of points, or of sequences of sets.

    Args:
        truth: (..., n, d) points, m; one with a coordinate that is not finite is not there. A list
            of sets of different sizes will do.
        estimates: (..., m, d) likewise; its leading axes are broadcast against those of `truth`.
        cutoff_m: c, what a target too many or too few costs at most.
        order: p, at least 1.

    Returns:
        Numbers, or arrays over the leading axes; two empty sets are 0 apart.

    Raises:
        UsageError: shapes that do not fit, a cutoff or order out of range.
    """
    _check(cutoff_m, order)
    shape, sets = _pairs(truth, estimates)
    rows = []
    for true, found in sets:
        paired = np.sum(_assigned(true, found, cutoff_m, order) ** order)
        surplus = abs(len(true) - len(found)) * cutoff_m**order
        size = max(len(true), len(found), 1)
        rows.append(np.array([paired + surplus, paired, surplus]) / size)
    parts = np.reshape(rows, (*shape, 3)) ** (1 / order)
    return Ospa(*(parts[..., i][()] for i in range(3)))


def gospa(
    truth: Any, estimates: Any, *, cutoff_m: float, order: float = 2.0, alpha: float = 2.0
) -> Gospa:
    """Generalised optimal subpattern assignment distance of sets, or of sequences of sets.

    Args:
        truth: (..., n, d), as in `ospa`.
        estimates: (..., m, d) likewise.
        cutoff_m: c; a target missed or an estimate too many costs c^p / alpha.
        order: p, at least 1.
        alpha: above 0, at most 2. With 2, a pair beyond the cutoff is one target missed and one
            false estimate; with less it stays a pair, since two of them would cost more.

    Returns:
        Numbers, or arrays over the leading axes; two empty sets are 0 apart.

    Raises:
        UsageError: shapes that do not fit, a number out of range.
    """
    _check(cutoff_m, order)
    if not 0.0 < alpha <= 2.0:
        raise UsageError(f"{alpha=} is not above 0 and at most 2", next_step="use alpha=2")
    shape, sets = _pairs(truth, estimates)
    each, counts = cutoff_m**order / alpha, []
    costs = []
    for true, found in sets:
        paired = _assigned(true, found, cutoff_m, order)
        if alpha == 2.0:
            paired = paired[paired < cutoff_m]
        missed, false = len(true) - len(paired), len(found) - len(paired)
        counts.append([len(paired), missed, false])
        costs.append([np.sum(paired**order), missed * each, false * each])
    powers = np.reshape(costs, (*shape, 3)).astype(float)
    numbers = np.reshape(counts, (*shape, 3)).astype(int)
    lengths = (powers[..., i][()] ** (1 / order) for i in range(3))
    total = np.sum(powers, axis=-1) ** (1 / order)
    return Gospa(total[()], *lengths, *(numbers[..., i][()] for i in range(3)))


def _assigned(true: Array, found: Array, cutoff: float, order: float) -> Array:
    """(min(n, m),) distances of the pairing with the least sum of powers, none above the cutoff."""
    from scipy.optimize import linear_sum_assignment

    apart = np.linalg.norm(true[:, None] - found[None], axis=-1)
    apart = np.minimum(apart, cutoff)
    return apart[linear_sum_assignment(apart**order)]


def _check(cutoff_m: float, order: float) -> None:
    if not 0.0 < cutoff_m < np.inf:
        raise UsageError(f"{cutoff_m=} is not a positive length", next_step="use cutoff_m=1000")
    if not 1.0 <= order < np.inf:
        raise UsageError(f"{order=} is not a finite number from 1 on", next_step="use order=2")


def _pairs(truth: Any, estimates: Any) -> tuple[tuple[int, ...], Iterator[tuple[Array, Array]]]:
    """Leading axes, and the two sets at each place, without points that are not there."""
    true, found = _padded("truth", truth), _padded("estimates", estimates)
    if 0 in (true.size, found.size):  # of an empty list nobody knows how many coordinates
        d = max(true.shape[-1], found.shape[-1])
        true, found = (a if a.size else np.empty((*a.shape[:-1], d)) for a in (true, found))
    try:
        shape = np.broadcast_shapes(true.shape[:-2], found.shape[:-2])
    except ValueError:
        shape = None
    if shape is None or true.shape[-1] != found.shape[-1]:
        raise UsageError(
            f"sets of shapes {true.shape} and {found.shape} cannot be compared",
            why="leading axes and numbers of coordinates must agree",
        )
    both = [np.broadcast_to(a, (*shape, *a.shape[-2:])) for a in (true, found)]
    places = np.ndindex(*shape)
    return shape, (tuple(_present(a[i]) for a in both) for i in places)


def _present(points: Array) -> Array:
    return points[np.isfinite(points).all(axis=-1)]


def _padded(name: str, sets: Any) -> Array:
    """(..., n, d); a list of sets of different sizes filled up with NaN."""
    try:
        found = np.asarray(sets, dtype=float)
    except ValueError:
        found = _filled(name, sets)
    if found.shape == (0,):
        found = found.reshape(0, 0)
    if found.ndim < 2:
        raise UsageError(
            f"{name} of shape {found.shape} is not a set of points",
            next_step="give (n, d): one row a point",
        )
    return found


def _filled(name: str, sets: Sequence[Any]) -> Array:
    arrays = [np.asarray(each, dtype=float) for each in sets]
    widths = {a.shape[-1] for a in arrays if a.size}
    if len(widths) != 1 or any(a.ndim != 2 for a in arrays if a.size):
        raise UsageError(
            f"{name} is not a list of sets", why="each set is (n, d), with the same d in all"
        )
    filled = np.full((len(arrays), max(map(len, arrays)), widths.pop()), np.nan)
    for row, array in zip(filled, arrays, strict=True):
        row[: len(array)] = array.reshape(-1, filled.shape[-1])
    return filled
