"""Filters side by side: which predicted the plots best, and which stated its errors true."""

from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.consistency import law
from boresight.interfaces.report.residuals import Panel, column
from boresight.interfaces.report.words import (
    Cell,
    figure,
    gain,
    number_cell,
    panel,
    table,
    text_cell,
)

if TYPE_CHECKING:
    import polars as pl

    from boresight.tracking.result import FilterRow, Gain, TrackingResult

CAPTION = "Filters on the same plots"
KEY = (
    "<p>NIS is that of straight flight. Failed are states that are not finite or not positive "
    "definite. Range and azimuth: scatter about the prediction, half the width of the middle 68 %. "
    "Speed: difference from the downlinked ground speed, median and 95 % quantile. Nanoseconds are "
    "processor time of one prediction, gate and update.</p>"
)
WORDS = (
    "<p>Every filter ran over the same plots and tracks, with the same gate and the same noise; "
    "noise found by likelihood was found with <b>{main}</b>, which favours that filter if any. "
    "Scored is the second half, on which no noise was chosen. The log-likelihood is what a filter "
    "gave the next plot before it saw it: without truth the fair judge, since to overstate or "
    "understate its errors gains a filter nothing. Differences from {main} are paired plot by "
    "plot, and in their 95 % intervals the plots of one track count as one cluster. A plot that "
    "either filter turned away is in no difference.</p>"
)
GAIN_CAPTION = (
    "Log-likelihood per plot minus that of {main}: to the right, the filter predicts better. Bars "
    "are 95 % intervals, grey dots single tracks; what lies beyond the axis is in the table."
)
LAW_CAPTION = (
    "Share of plots whose NIS lies above a value, {where}. Above the dotted line: larger errors "
    "than the filter states."
)
COLORS = (charts.BLUE, charts.ORANGE, charts.GREEN, charts.PURPLE, "#b58900", "#56B4E9", "#5b6675")
DASHES = ("solid", "dash", "dot", "dashdot")
BEYOND = 8.0  # times the middle filter's: one that fails must not squeeze the others to a line


class Group(NamedTuple):
    """One of the two gains of a row: its words, its field, its colour and its place."""

    words: str
    field: str
    color: str
    offset: float


GROUPS = (
    Group("all flight", "gain", charts.BLUE, -0.14),
    Group("straight flight", "gain_straight", charts.GREEN, 0.14),
)


def panels(result: "TrackingResult") -> list[Panel]:
    """Draw the gain of each filter over the first, and the law of its NIS."""
    if result.scores is None or result.scores.is_empty():
        return []
    return [_gains(result.filters, result.scores), _law(result.filters, result.scores)]


def section(result: "TrackingResult", drawn: Sequence[Panel]) -> str:
    """The section's HTML; empty where there is one filter."""
    if len(result.filters) < 2:
        return ""
    main = escape(result.filters[0].filter)
    where = "straight flight" if _has_straight(result.scores) else "all flight"
    captions = (GAIN_CAPTION.format(main=main), LAW_CAPTION.format(where=where))
    mine = [each for each in drawn if each.name.startswith("beside-")]
    two = "".join(
        panel(each.name, words, alt=each.alt) for each, words in zip(mine, captions, strict=False)
    )
    return f'{WORDS.format(main=main)}<div class="halves">{two}</div>{_table(result.filters)}{KEY}'


def _table(rows: "Sequence[FilterRow]") -> str:
    heads = ["filter", "log-lik.", "all flight", "straight", "NIS/dof", "median"]
    heads += ["updates", "rejected", "restarts", "failed", "range, m", "azimuth, °"]
    heads += ["speed, m/s", "95 %", "ns"]
    return table(CAPTION, heads, map(_row, rows), name="filter-table")


def _row(each: "FilterRow") -> list[Cell]:
    cells = [text_cell(each.filter), Cell(f"{each.loglik:.3f}", is_figure=True)]
    cells += [Cell(gain(one), is_figure=True) for one in (each.gain, each.gain_straight)]
    cells += [number_cell(each.nis_per_dof, 3), number_cell(each.nis_median, 3)]
    cells += [number_cell(n) for n in (each.updates, each.rejected, each.restarts)]
    cells += [Cell(f"{figure(100 * each.failed_share, 2)} %", is_figure=True)]
    cells += [number_cell(each.range_sd_m, 3), number_cell(each.azimuth_sd_deg, 3)]
    cells += [number_cell(each.speed_error_median_mps, 2), number_cell(each.speed_error_95_mps, 2)]
    return [*cells, number_cell(each.ns_per_update, 2)]


def _gains(rows: "Sequence[FilterRow]", scores: "pl.DataFrame") -> Panel:
    others = rows[1:]
    place = np.arange(len(others), dtype=float)
    data = [_tracks(others, scores), *(_intervals(others, place, group) for group in GROUPS)]
    reach = _reach([getattr(each, group.field) for each in others for group in GROUPS])
    x = charts.axis("log-likelihood per plot, difference", range=[-reach, reach], zeroline=True)
    x |= {"zerolinecolor": charts.INK}
    y = charts.axis("", tickvals=place.tolist(), ticktext=[each.filter for each in others])
    y |= {"range": [len(others) - 0.4, -0.6], "showgrid": False}
    alt = "difference of log-likelihood per plot from the first filter, with 95 % intervals"
    layout = charts.layout(xaxis=x, yaxis=y, showlegend=True)
    return Panel("beside-gain", {"data": data, "layout": layout}, alt)


def _reach(gains: "Sequence[Gain]") -> float:
    """Return half the axis: every interval but one that dwarfs the middle one."""
    ends = np.array([np.max(np.abs([*each.ci95, each.mean])) for each in gains])
    ends = ends[np.isfinite(ends) & (ends > 0)]
    return 1.15 * float(min(ends.max(), BEYOND * np.median(ends))) if len(ends) else 1.0


def _tracks(others: "Sequence[FilterRow]", scores: "pl.DataFrame") -> Chart:
    """Draw the mean difference of every track."""
    import polars as pl

    order = {each.filter: float(i) for i, each in enumerate(others)}
    means = (
        scores.filter(pl.col("filter").is_in(list(order)) & pl.col("gain").is_not_null())
        .group_by("filter", "track", maintain_order=True)
        .agg(pl.col("gain").mean())
    )
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "single tracks",
        "x": charts.short(column(means, "gain")),
        "y": charts.typed([order[name] for name in means["filter"].to_list()]),
        "marker": {"size": 4, "color": charts.MUTED, "opacity": 0.3},
        "hoverinfo": "skip",
    }


def _intervals(others: "Sequence[FilterRow]", place: np.ndarray, group: Group) -> Chart:
    gains = [getattr(each, group.field) for each in others]
    means = np.array([each.mean for each in gains])
    ends = np.array([each.ci95[1] for each in gains])
    hover = [f"{each.plots:,} plots of {each.tracks:,} tracks" for each in gains]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": group.words,
        "x": charts.short(means, 22),
        "y": charts.typed(place + group.offset),
        "error_x": {"array": charts.short(ends - means, 22), "color": group.color, "width": 3},
        "marker": {"size": 8, "color": group.color},
        "hovertext": hover,
        "hovertemplate": f"{group.words}: %{{x:.4g}}<br>%{{hovertext}}<extra></extra>",
    }


def _has_straight(scores: "pl.DataFrame | None") -> bool:
    return scores is not None and bool(scores["straight"].any())


def _law(rows: "Sequence[FilterRow]", scores: "pl.DataFrame") -> Panel:
    judged = scores.filter(scores["straight"]) if _has_straight(scores) else scores
    drawn = law("beside-law", list(_groups(rows, judged)), judged)
    for trace, index in zip(drawn.chart["data"], range(len(rows)), strict=False):
        trace["line"] = trace["line"] | {"dash": DASHES[index // len(COLORS) % len(DASHES)]}
    return drawn


def _groups(
    rows: "Sequence[FilterRow]", judged: "pl.DataFrame"
) -> Iterator[tuple[str, str, "pl.DataFrame"]]:
    for index, each in enumerate(rows):
        mine = judged.filter(judged["filter"] == each.filter)
        yield each.filter, COLORS[index % len(COLORS)], mine


def sentence(result: "TrackingResult") -> str:
    """Say in the verdict which filters predict the plots better, and which worse."""
    main, *others = result.filters
    better = [each.filter for each in others if each.gain.ci95[0] > 0]
    worse = [each.filter for each in others if each.gain.ci95[1] < 0]
    said = [
        f"{words} than {main.filter}: {', '.join(names)}"
        for words, names in (("better", better), ("worse", worse))
        if names
    ]
    found = "; ".join(said) or f"none shows itself better or worse than {main.filter}"
    return escape(
        f"Of {len(result.filters)} filters, judged by the log-likelihood of the same plots (95 % "
        f"intervals, clustered by track), {found}."
    )
