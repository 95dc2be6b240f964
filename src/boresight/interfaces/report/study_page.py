"""What a study puts on the page: the ranking, the evidence for each verdict, and what it cost."""

from collections.abc import Sequence
from html import escape
from typing import Any

from boresight.interfaces.report import study_charts, study_tables
from boresight.interfaces.report.residuals import Panel
from boresight.interfaces.report.sections import Block, Part, Tile
from boresight.interfaces.report.study_words import (
    cells_of,
    consistency,
    ends,
    rmse,
    sentences,
    setting_name,
    share,
)
from boresight.interfaces.report.words import figure, panel
from boresight.laboratory.frames import row_of
from boresight.laboratory.result import StudyResult

CAPTIONS = {
    "rmse": "Position RMSE over all runs at each scan (logarithmic). No unbiased filter is below "
    "the dashed bound on average.",
    "nees": "NEES per state, averaged over runs. Above the band the filter claims less error than "
    "it makes, below it more. One scan in {alarm} leaves the band by chance.",
    "nis": "NIS per measured component: the same test on innovations, which needs no truth.",
    "bias": "Length of the mean position error. The dotted line is what so many runs of the first "
    "filter leave by chance.",
    "claims": "Position standard deviation that the filter claims over the error it makes: below 1 "
    "it is too sure.",
    "runs": "How runs differ: share of runs whose own RMSE is below a value. A long right end is "
    "divergence.",
    "cost": "Error over the bound against processor time, both logarithmic: left and low is best.",
    "sweep-rmse": "Position RMSE against what is swept, with the bound.",
    "sweep-anees": "ANEES against what is swept: 1 is consistent.",
}
TALL_PX = 380


def part(result: StudyResult) -> Part:
    """Return the part of the page about a study."""
    several = len(result.study.settings) > 1
    each = [study_charts.of_setting(result, i) for i in range(len(result.study.settings))]
    sweeps, cost = study_charts.sweeps(result), study_charts.cost(result)
    alarm = f"{1 / result.study.false_alarm:.0f}"
    evidence = [_evidence(result, i, drawn, alarm, several=several) for i, drawn in enumerate(each)]
    blocks = (
        Block("ranking", "Ranking", study_tables.ranking(result)),
        Block("sweep", "Against what is swept", _pair(sweeps, alarm)),
        Block("consistency", "Errors, bound and consistency", "".join(evidence)),
        Block("comparisons", "Two by two", study_tables.comparisons(result)),
        Block("cost-section", "What it costs", _pair(cost, alarm)),
        Block("further", "Further metrics", study_tables.further(result)),
    )
    drawn = [panel for panels in (*each, sweeps, cost) for panel in panels]
    return Part(
        kind="study",
        title=result.study.name,
        subject="The study",
        tiles=_tiles(result),
        sentences=sentences(result),
        remarks=result.remarks,
        blocks=blocks,
        settings=("How the study was made", _settings(result)),
        charts={panel.name: panel.chart for panel in drawn},
        series=None,
        facts={
            "cells": [row_of(result, cell) for cell in result.cells],
            "seed": result.study.seed,
            "digest": result.digest,
        },
    )


def _evidence(
    result: StudyResult, setting: int, drawn: Sequence[Panel], alarm: str, *, several: bool
) -> str:
    """The charts of one setting; folded, all but the first, where there are several."""
    inside = _pair(drawn, alarm) + study_tables.verdicts(result, setting)
    if not several:
        return inside
    name = escape(setting_name(result.study.settings[setting].values) or f"setting {setting + 1}")
    state = " open" if setting == 0 else ""
    return f"<details{state}><summary><b>{name}</b></summary>{inside}</details>"


def _pair(drawn: Sequence[Panel], alarm: str) -> str:
    figures = "".join(
        panel(each.name, _caption(each.name, alarm), alt=each.alt, height_px=TALL_PX)
        for each in drawn
    )
    return f'<div class="halves">{figures}</div>' if figures else ""


def _caption(name: str, alarm: str) -> str:
    short = name.split("-", 1)[1] if name[0] == "s" and name[1].isdigit() else name
    return CAPTIONS[short].format(alarm=alarm)


def _tiles(result: StudyResult) -> tuple[Tile, ...]:
    best = cells_of(result, 0)[0]
    known = sum(consistency(cell) == "consistent" for cell in result.cells)
    worst = max(cell.diverged.value for cell in result.cells)
    interval = ends(best.position_rmse_m)
    first = setting_name(best.values)
    return (
        Tile(
            "smallest error", rmse(best.position_rmse_m, "m"), escape(f"{best.label}; {interval} m")
        ),
        Tile(
            "over the bound",
            figure(best.ratio_to_bound, 3),
            escape(first or "averaged in covariance"),
        ),
        Tile("consistent", f"{known} of {len(result.cells)}", "by their ANEES"),
        Tile(
            "runs",
            figure(result.study.runs),
            f"at most {share(worst)} diverged" if worst else "none diverged",
        ),
    )


def _settings(result: StudyResult) -> dict[str, Any]:
    study = result.study
    told: dict[str, Any] = {"study": study.name, "runs": study.runs, "seed": study.seed}
    told |= {"truth": f"{study.truth} run", "noise": f"{study.noise} run"}
    told |= {"metrics": study.metrics, "first scored scan": study.first_scan}
    told |= {"false alarm": study.false_alarm, "SHA-256 of the numbers": result.digest}
    first = study.settings[0].scenario
    told |= {"scenario": first.name, "scans": first.scans, "time between scans": f"{first.dt_s} s"}
    for contender in study.settings[0].contenders:
        told[f"filter {contender.label}"] = repr(contender.filter.name)
    return told
