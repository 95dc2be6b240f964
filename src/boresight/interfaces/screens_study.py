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
)
from boresight.interfaces.report.words import figure
from boresight.interfaces.screens import table, text, written

if TYPE_CHECKING:
    from rich.console import RenderableType

    from boresight.laboratory.result import Cell, StudyResult

WIDE = 110
STYLES = {"consistent": "green", "too sure": "red", "too modest": "yellow", "no number": "red"}
DETAILED = 4  # settings whose doubts are printed; the report has them all


def studied(result: "StudyResult", outputs: Sequence[str], width: int) -> "list[RenderableType]":
    """The screen of `boresight compare`."""
    study = result.study
    head = f"{study.name}: {len(result.cells)} cells of {study.runs:,} runs, seed {study.seed}"
    parts: list[RenderableType] = [text(head, "bold"), text("")]
    settings = range(len(study.settings))
    for setting in settings:
        parts.append(_ranking(result, setting, width))
        if len(settings) <= DETAILED:
            parts += _verdicts(result, setting)
    return [*parts, text(f"SHA-256 of the numbers: {result.digest}", "dim"), *written(outputs)]


def _ranking(result: "StudyResult", setting: int, width: int) -> "RenderableType":
    cells = cells_of(result, setting)
    percent = f"{100 * (1 - result.study.false_alarm):g} %"
    wide = width >= WIDE
    before = ["position", "interval", "median"] if wide else ["position", "median"]
    heads = ["filter", *before, "× bound", *(["velocity"] if wide else []), "ANEES"]
    grid = table(setting_name(cells[0].values), *heads, f"{percent} band", "", "lost", "ns")
    grid.title = grid.title or None
    grid.columns[0].no_wrap = False  # a long label takes two lines, not the figures' place
    grid.columns[0].overflow = "fold"
    for cell in cells:
        low, high = cell.anees_bounds
        words = consistency(cell)
        position = [rmse(cell.position_rmse_m, "m"), figure(cell.median_rmse_m, 3)]
        grid.add_row(
            cell.label,
            *([position[0], ends(cell.position_rmse_m), position[1]] if wide else position),
            figure(cell.ratio_to_bound, 3),
            *([rmse(cell.velocity_rmse_mps, "m/s")] if wide else []),
            figure(cell.anees.value, 3),
            f"{low:.3f}–{high:.3f}",
            text(words, STYLES[words]),
            _share(cell),
            figure(cell.ns_per_step, 3),
        )
    return grid


def _share(cell: "Cell") -> str:
    return f"{100 * cell.diverged.value:.2g} %" if cell.diverged.value else "0"


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
