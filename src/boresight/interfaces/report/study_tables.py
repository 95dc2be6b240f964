"""The tables of a study: the ranking with its costs, and every two contenders beside each other."""

import math
from collections.abc import Mapping
from html import escape
from typing import Any

from boresight.interfaces.report.study_words import (
    cells_of,
    consistency,
    ends,
    setting_name,
    share,
)
from boresight.interfaces.report.words import Cell as TableCell
from boresight.interfaces.report.words import count, figure, label, number_cell, table, text_cell
from boresight.laboratory import comparing as order
from boresight.laboratory.result import Cell, Interval, StudyResult

MARKS = {
    "consistent": ("●", "#00785a"),
    "too sure": ("▲", "#b34700"),
    "too modest": ("▼", "#b34700"),
}
WORDS = (
    "<p>A place is shared where a filter loses to no more of the others. Root mean square errors "
    "over all runs and scored scans, divergent runs included, with "
    "{percent} bootstrap intervals over runs; beside it the median run, which a few divergent runs "
    "cannot move. The bound is the Cramér-Rao bound along each trajectory, averaged in "
    "covariance. ANEES is 1 for a filter that knows its own errors; its band is where such a "
    "filter lies in {percent} of studies. Cost is processor time of one run and scan with "
    "everything that belongs to it: random numbers, truth, plots, filter, scores.</p>"
)


def ranking(result: StudyResult) -> str:
    """A table for each setting, best first."""
    percent = f"{100 * (1 - result.study.false_alarm):g} %"
    every = range(len(result.study.settings))
    return WORDS.format(percent=percent) + "".join(_ranking(result, i) for i in every)


def _ranking(result: StudyResult, setting: int) -> str:
    cells = cells_of(result, setting)
    name = setting_name(cells[0].values) or count(cells[0].runs, "run")
    heads = ["", "filter", "position, m", "interval", "median run", "× bound", "velocity, m/s"]
    heads += ["ANEES", "band", "verdict", "NIS", "diverged", "ns a step"]
    places = [rank.place for rank in order.ranking(result, setting)]
    return table(name, heads, map(_row, places, cells), sortable=True)


def _row(place: int, cell: Cell) -> list[TableCell]:
    row = [number_cell(place), text_cell(cell.label), _number(cell.position_rmse_m.value)]
    row += [TableCell(ends(cell.position_rmse_m), is_figure=True)]
    row += [_number(cell.median_rmse_m), number_cell(cell.ratio_to_bound, 4)]
    row += [_number(cell.velocity_rmse_mps.value), _number(cell.anees.value)]
    low, high = cell.anees_bounds
    row += [TableCell(f"{figure(low, 3)} – {figure(high, 3)}", is_figure=True), _verdict(cell)]
    row += [number_cell(cell.anis, 4), _share(cell.diverged)]
    return [*row, number_cell(cell.ns_per_step, 3)]


def _number(value: float) -> TableCell:
    if math.isinf(value):
        return TableCell("infinite", "1e308", is_figure=True)
    return number_cell(value, 4)


def _share(value: Interval) -> TableCell:
    """The share of runs, and what it is below: `0.1 % (< 0.74 %)`."""
    words = f"{share(value.value)} (&lt; {share(value.high)})"
    return TableCell(words, f"{value.value:.9g}", is_figure=True)


def _verdict(cell: Cell) -> TableCell:
    words = consistency(cell)
    glyph, color = MARKS.get(words, ("▲", "#b34700"))
    mark = f'<span style="color:{color}" aria-hidden="true">{glyph}</span>'
    return TableCell(f"{mark} {words}", words)


def verdicts(result: StudyResult, setting: int) -> str:
    """Every sentence on the contenders of a setting, as a list."""
    said = [escape(words) for cell in cells_of(result, setting) for words in cell.verdicts]
    if not said:
        return ""
    items = "".join(f"<li>{words}</li>" for words in said)
    return f"<details><summary>Every sentence on every filter</summary><ul>{items}</ul></details>"


def comparisons(result: StudyResult) -> str:
    """Every two contenders on the same runs; empty where there is one."""
    if not result.comparisons:
        return ""
    heads = ["setting", "better", "other", "ratio of RMSE", "interval", "verdict"]
    rows = [
        [
            text_cell(setting_name(result.study.settings[each.setting].values)),
            text_cell(each.better),
            text_cell(each.other),
            number_cell(each.ratio.value, 4),
            TableCell(ends(each.ratio, 4), is_figure=True),
            text_cell("a win" if each.is_win else "not told apart"),
        ]
        for each in result.comparisons
    ]
    if not any(result.study.settings[each.setting].values for each in result.comparisons):
        heads, rows = heads[1:], [row[1:] for row in rows]
    caption = f"{count(len(rows), 'comparison')} on the same runs and random numbers"
    return table(caption, heads, rows, sortable=True)


def further(result: StudyResult) -> str:
    """Metrics beyond the usual ones; empty where none was asked for."""
    names = list(dict.fromkeys(name for cell in result.cells for name in cell.extra))
    shown = [
        name for name in names if any(_is_number(cell.extra.get(name)) for cell in result.cells)
    ]
    if not shown:
        return ""
    heads = ["setting", "filter", *(", ".join(filter(None, label(name))) for name in shown)]
    rows = [
        [
            text_cell(setting_name(cell.values)),
            text_cell(cell.label),
            *(_extra(cell.extra, n) for n in shown),
        ]
        for cell in result.cells
    ]
    if not any(cell.values for cell in result.cells):
        heads, rows = heads[1:], [row[1:] for row in rows]
    return table("Further metrics", heads, rows, sortable=True)


def _is_number(value: Any) -> bool:
    return isinstance(value, Interval | float | int) and not isinstance(value, bool)


def _extra(extra: Mapping[str, Any], name: str) -> TableCell:
    value = extra.get(name)
    return number_cell(value.value if isinstance(value, Interval) else value, 4)
