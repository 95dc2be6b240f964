"""What a person sees of a study in the terminal: a ranking for each setting, then the verdicts."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from boresight.interfaces.report.study_words import (
    CONSISTENT,
    against,
    beside,
    cells_of,
    consistency,
    ends,
    rmse,
    setting_name,
    share,
)
from boresight.interfaces.report.words import count, figure
from boresight.interfaces.screens import table, text, written

if TYPE_CHECKING:
    from rich.console import RenderableType

    from boresight.laboratory.result import Cell, StudyResult

WIDE, MIDDLE = 110, 80
LEAST = {"interval": WIDE, "velocity": WIDE, "median": MIDDLE, "band": MIDDLE, "ns": MIDDLE}
LABEL = 6  # characters that a name has at least
STYLES = {"consistent": "green", "too sure": "red", "too modest": "yellow", "no number": "red"}
DETAILED = 4  # settings whose doubts are printed; the report has them all


def studied(result: "StudyResult", outputs: Sequence[str], width: int) -> "list[RenderableType]":
    """The screen of `boresight compare`."""
    study = result.study
    cells, runs = count(len(result.cells), "cell"), count(study.runs, "run")
    head = f"{study.name}: {cells} of {runs}, seed {study.seed}"
    parts: list[RenderableType] = [text(head, "bold"), text("")]
    settings = range(len(study.settings))
    for setting in settings:
        parts.append(_ranking(result, setting, width))
        if len(settings) <= DETAILED:
            parts += _verdicts(result, setting)
    return [*parts, text(f"SHA-256 of the numbers: {result.digest}", "dim"), *written(outputs)]


def _ranking(result: "StudyResult", setting: int, width: int) -> "RenderableType":
    cells = cells_of(result, setting)
    rows = [_row(cell) for cell in cells]
    shown = [head for head in rows[0] if width >= LEAST.get(head, 0)]
    band = f"{100 * (1 - result.study.false_alarm):g} % band"
    heads = [band if head == "band" else head for head in shown]
    grid = table(setting_name(cells[0].values), *heads)
    grid.title = grid.title or None
    label = grid.columns[0]  # a long one takes more lines, not the figures' place
    label.no_wrap, label.overflow, label.min_width = False, "fold", LABEL
    for row in rows:
        grid.add_row(*(row[head] for head in shown))
    return grid


def _row(cell: "Cell") -> "dict[str, RenderableType]":
    """What is told of a filter, by the heads of columns."""
    low, high = cell.anees_bounds
    words = consistency(cell)
    return {
        "filter": cell.label,
        "position": rmse(cell.position_rmse_m, "m"),
        "interval": ends(cell.position_rmse_m),
        "median": figure(cell.median_rmse_m, 3),
        "× bound": figure(cell.ratio_to_bound, 3),
        "velocity": rmse(cell.velocity_rmse_mps, "m/s"),
        "ANEES": figure(cell.anees.value, 3),
        "band": f"{low:.3f}–{high:.3f}",
        "": text(words, STYLES[words]),
        "lost": share(cell.diverged.value),
        "ns": _whole(cell.ns_per_step),
    }


def _whole(ns: float) -> str:
    """Nanoseconds in at most five characters: `95`, `1,042`, `51k`."""
    return f"{ns:,.0f}" if ns < 9999.5 else f"{ns / 1000:,.0f}k"


def _verdicts(result: "StudyResult", setting: int) -> "list[RenderableType]":
    """Who is ahead of whom, then what is to be said of each filter."""
    cells = cells_of(result, setting)
    said = beside(result, setting, cells[0].label)
    lines = [text(f"{cells[0].label} is {said}.")] if said else []
    doubts = [
        text(f"{cell.label} {'; it '.join(against(cell))}.", "yellow")
        for cell in cells
        if cell.doubts
    ]
    return [*lines, *(doubts or [text(CONSISTENT, "green")]), text("")]
