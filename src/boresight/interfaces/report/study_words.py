"""What the pages and screens of a study say: who is ahead, who knows its errors, in what unit."""

import math
from collections.abc import Iterator, Sequence
from html import escape

from boresight.interfaces.report.verdict import Sentence
from boresight.interfaces.report.words import figure
from boresight.laboratory.comparing import ranking
from boresight.laboratory.result import Cell, Comparison, Interval, StudyResult

CONSISTENT = "Every filter knows its own errors: ANEES and NIS are in their bands, no run diverged."


def setting_name(values: Sequence[tuple[str, str]]) -> str:
    """What is swept: `sensor.azimuth.sigma 0.5 deg`; empty where nothing is."""
    return ", ".join(f"{name} {value}" for name, value in values)


def cells_of(result: StudyResult, setting: int) -> list[Cell]:
    """The contenders of a setting in the order of their ranking."""
    mine = {cell.label: cell for cell in result.cells if cell.setting == setting}
    return [mine[rank.label] for rank in ranking(result, setting)]


def rmse(value: Interval, unit: str, digits: int = 3) -> str:
    """Render `41.2 m`; an error that is no number is infinite."""
    return f"{figure(value.value, digits)} {unit}" if math.isfinite(value.value) else "infinite"


def ends(value: Interval, digits: int = 3) -> str:
    """Render an interval: `40.8 to 41.6`; a dash where it has no ends."""
    if not (math.isfinite(value.low) and math.isfinite(value.high)):
        return "–"
    return f"{figure(value.low, digits)} to {figure(value.high, digits)}"


def share(value: float) -> str:
    """Render a share of runs: `0.4 %`, `100 %`; of none `0`."""
    return f"{float(f'{100 * value:.2g}'):g} %" if value else "0"


def consistency(cell: Cell) -> str:
    """What the ANEES says, in two words at most."""
    low, high = cell.anees_bounds
    if not math.isfinite(cell.anees.value):
        return "no number"
    if cell.anees.value > high:
        return "too sure"
    return "too modest" if cell.anees.value < low else "consistent"


def wins(result: StudyResult, setting: int, label: str) -> list[Comparison]:
    """The comparisons that a contender wins."""
    return [
        c for c in result.comparisons if (c.setting, c.better, c.is_win) == (setting, label, True)
    ]


def beside(result: StudyResult, setting: int, label: str) -> str:
    """Whom a contender is better than, and from whom it cannot be told."""
    won = wins(result, setting, label)
    open_ = [
        each.other if each.better == label else each.better
        for each in result.comparisons
        if each.setting == setting and not each.is_win and label in (each.better, each.other)
    ]
    parts = [f"better than {_and([each.other for each in won])} ({_by(won)})"] if won else []
    parts += [f"not told apart from {_and(open_)}"] if open_ else []
    return "; ".join(parts)


def _by(won: Sequence[Comparison]) -> str:
    """By how much the errors are smaller: `by 0.02 to 3 %`."""
    shares = sorted(1.0 - each.ratio.value for each in won)
    low, high = (share(each) for each in (shares[0], shares[-1]))
    return f"by {high}" if low == high else f"by {low.removesuffix(' %')} to {high}"


def _and(names: Sequence[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def sentences(result: StudyResult) -> list[Sentence]:
    """The verdict: for each setting who is ahead, then what is to be said of each contender."""
    return [each for i in range(len(result.study.settings)) for each in _of_setting(result, i)]


def _of_setting(result: StudyResult, setting: int) -> Iterator[Sentence]:
    first, *others = cells_of(result, setting)
    where = setting_name(first.values)
    head = f"<b>{escape(where)}</b>: " if where else ""
    bound = (
        f", {figure(first.ratio_to_bound, 3)} times the Cramér-Rao bound"
        if math.isfinite(first.ratio_to_bound)
        else ""
    )
    said = beside(result, setting, first.label)
    words = "has the smallest position error" if others else "has a position error of"
    text = f"{head}<b>{escape(first.label)}</b> {words}{': ' if others else ' '}"
    text += f"{rmse(first.position_rmse_m, 'm')}{bound}"
    told = f"; it is {escape(said)}" if said else ""
    yield Sentence("good" if math.isfinite(first.position_rmse_m.value) else "attention",
                   f"{text}{told}.", "ranking")  # fmt: skip
    doubtful = [cell for cell in (first, *others) if cell.doubts]
    for cell in doubtful:
        said = f"<b>{escape(cell.label)}</b> {'; it '.join(against(cell))}."
        yield Sentence("attention", f"{head}{said}", "consistency")
    if not doubtful:
        yield Sentence("good", f"{head}{CONSISTENT}", "consistency")


def against(cell: Cell) -> list[str]:
    """In a few words each, what a cell's doubts say: `diverged in 2 of 1,000 runs`."""
    words, extra, (low, high) = consistency(cell), cell.extra, cell.anis_bounds
    said = []
    if words != "consistent":
        factor = math.sqrt(max(cell.anees.value, 0.0))
        said.append(
            f"is {words}: its errors are {figure(factor, 3)} times its claims (ANEES "
            f"{figure(cell.anees.value, 3)})"
            if math.isfinite(factor)
            else "does not know its errors: a covariance or an estimate is no number"
        )
    elif math.isfinite(cell.anis) and not low <= cell.anis <= high:
        more = "more" if cell.anis > high else "less"
        said.append(f"is surprised {more} than it expects: NIS {figure(cell.anis, 4)}")
    if cell.diverged.value:
        said.append(f"diverged in {round(cell.diverged.value * cell.runs):,} of {cell.runs:,} runs")
    if extra.get("bias_limit", math.inf) < extra.get("bias_standard_errors", 0.0) < math.inf:
        said.append(f"is biased: by {figure(extra['bias_m'], 3)} m at scan {extra['bias_scan']}")
    return said or list(cell.doubts)
