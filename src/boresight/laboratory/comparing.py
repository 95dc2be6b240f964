"""Contenders of a setting against each other, on the same runs, and their ranking with its cost."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from boresight.laboratory.intervals import ratio_interval
from boresight.laboratory.result import Cell, Comparison, StudyResult

_LESS = 1.0 - 1e-9  # a ratio that is less than 1 by more than rounding


def compared(cells: Sequence[Cell], false_alarm: float) -> Iterator[Comparison]:
    """Every two contenders of one setting.

    A win needs an interval that excludes 1 by more than rounding, which is all that two forms of
    one filter differ by; so a filter never wins against itself. Against one whose error is no
    number every filter wins whose error is one.

    Args:
        cells: of one setting.
        false_alarm: of each comparison; with many of them, some are wins by chance.
    """
    for one, two in combinations(cells, 2):
        first, second = sorted((one, two), key=_error)  # stable: of equals the first stays so
        ours, others = (cell.per_run["position_sq_m2"] for cell in (first, second))
        ratio = ratio_interval(ours, others, false_alarm)
        yield Comparison(first.setting, first.label, second.label, ratio, ratio.high < _LESS)


def _error(cell: Cell) -> float:
    value = cell.position_rmse_m.value
    return np.inf if np.isnan(value) else value


class Rank(NamedTuple):
    """A contender's place in a setting.

    Attributes:
        place: 1 and the number of contenders that win against it; those that cannot be told apart
            share one.
        label: of the contender.
        position_rmse_m: its error.
        ns_per_step: its cost.
        is_efficient: whether none with a smaller error costs less.
    """

    place: int
    label: str
    position_rmse_m: float
    ns_per_step: float
    is_efficient: bool


def ranking(result: StudyResult, setting: int) -> list[Rank]:
    """Contenders of a setting, the smallest error first."""
    cells = sorted((cell for cell in result.cells if cell.setting == setting), key=_error)
    lost = [c.other for c in result.comparisons if c.setting == setting and c.is_win]
    cheapest, ranks = np.inf, []
    for cell in cells:
        place, cost = 1 + lost.count(cell.label), cell.ns_per_step
        ranks.append(Rank(place, cell.label, cell.position_rmse_m.value, cost, cost < cheapest))
        cheapest = min(cheapest, cost)
    return ranks
