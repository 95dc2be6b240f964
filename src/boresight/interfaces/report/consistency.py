"""Is the filter's own uncertainty true? NIS over time, range, azimuth, targets and as a law."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.plan import CLASSES, classes, describe
from boresight.interfaces.report.residuals import (
    AGAINST,
    FEWEST,
    Against,
    Floats,
    Panel,
    across,
    cells,
    column,
    edges,
)

if TYPE_CHECKING:
    import polars as pl

LEAST = 0.1  # targets below it are drawn at it; their own figure shows where one points


def panels(residuals: "pl.DataFrame", targets: "pl.DataFrame") -> list[Panel]:
    """Draw the normalised innovation squared of the plots used, with its chi-square bounds."""
    used = residuals.filter(residuals["used"] & residuals["nis"].is_finite())
    if used.is_empty():
        return []
    return [*_against(used), law("nis-law", _groups(used), used), _targets(targets)]


def bounds_of_mean(dof: Floats) -> tuple[Floats, Floats]:
    """Return the 95 % chi-square band of a NIS per degree of freedom over `dof` in all."""
    from scipy.special import chdtri

    safe = np.maximum(dof, 1.0)
    return chdtri(safe, 0.975) / safe, chdtri(safe, 0.025) / safe


def chi_square_median(nis: dict[str, float]) -> float:
    """Return the median NIS per degree of freedom of a consistent filter with as many."""
    from scipy.special import chdtri

    if not nis.get("scans"):
        return float("nan")
    dof = nis["dof"] / nis["scans"]
    return float(chdtri(dof, 0.5)) / dof


def _groups(used: "pl.DataFrame") -> list[tuple[str, str, "pl.DataFrame"]]:
    groups = [("all scans", charts.BLUE, used)]
    if used["straight"].count() > 0:
        straight = used.filter(used["straight"].fill_null(value=False))
        groups.append(("straight flight", charts.GREEN, straight))
    return groups


def _against(used: "pl.DataFrame") -> list[Panel]:
    """Draw NIS per degree of freedom against time, range and azimuth, on one scale."""
    drawn = [_binned(used, against) for against in AGAINST]
    seen = np.concatenate([values for _, values in drawn])
    seen = np.append(seen[np.isfinite(seen) & (seen > 0)], 1.0)
    scale = _log_scale(seen.min() * 0.9, seen.max() * 1.1)
    for panel, _ in drawn:
        panel.chart["layout"]["yaxis"] |= scale
    return [panel for panel, _ in drawn]


def _binned(used: "pl.DataFrame", against: Against) -> tuple[Panel, Floats]:
    """Return the chart and every mean in it."""
    bounds = edges(column(used, against.column) * against.scale, against)
    centre = charts.typed((bounds[1:] + bounds[:-1]) / 2, "f8")
    groups = _groups(used)
    means = [_mean_per_dof(frame, against, bounds) for _, _, frame in groups]
    dof = means[-1][1]
    low, high = (charts.short(np.where(dof > 0, end, np.nan)) for end in bounds_of_mean(dof))
    data = charts.band(centre, low, high, f"95 % band, {groups[-1][0]}")
    for (name, color, _), (mean, _dof, number) in zip(groups, means, strict=True):
        data.append(_mean_line(centre, mean, number, name, color))
    layout = charts.layout(
        xaxis=across(against, bounds), yaxis=charts.axis("NIS / dof"), shapes=[_ideal()]
    )
    alt = f"NIS per degree of freedom against {against.words}, with its 95 % chi-square band"
    panel = Panel(f"nis-{against.column.split('_')[0]}", {"data": data, "layout": layout}, alt)
    return panel, np.concatenate([mean for mean, _, _ in means])


def _mean_per_dof(
    frame: "pl.DataFrame", against: Against, bounds: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return for each cell NIS per degree of freedom, degrees of freedom, plots."""
    cell = cells(column(frame, against.column) * against.scale, bounds)
    count = len(bounds) - 1
    dof = np.bincount(cell, column(frame, "dof"), count).astype(float)
    nis = np.bincount(cell, column(frame, "nis"), count)
    number = np.bincount(cell, minlength=count).astype(float)
    return np.where(number >= FEWEST, nis / np.maximum(dof, 1), np.nan), dof, number


def _mean_line(x: Chart, mean: Floats, number: Floats, name: str, color: str) -> Chart:
    return charts.line(
        x,
        charts.short(mean),
        color,
        name=name,
        mode="lines+markers",
        marker={"size": 4, "color": color, "symbol": "circle"},
        customdata=charts.typed(number),
        hovertemplate=f"{name}: %{{y:.2f}}<br>%{{customdata:,.0f}} plots<extra></extra>",
    )


def _log_scale(low: float, high: float) -> Chart:
    """Return a logarithmic axis with as many ticks as it has room for."""
    steps = (0.5, 0.7, 1, 1.5, 2, 3, 5, 7) if high / low < 20 else (0.1, 0.2, 0.5, 1, 2, 5)
    decades = (1,) if high / low < 20 else (1, 10, 100, 1000)
    ticks = sorted({round(step * decade, 1) for step in steps for decade in decades})
    ends = [float(np.log10(low)), float(np.log10(high))]
    return {"type": "log", "tickvals": ticks, "range": ends}


def _ideal() -> Chart:
    edge = {"color": charts.INK, "width": 1, "dash": "dot"}
    ends = {"x0": 0, "x1": 1, "y0": 1, "y1": 1}
    return {"type": "line", "xref": "paper", "line": edge} | ends


def law(
    name: str, groups: "Sequence[tuple[str, str, pl.DataFrame]]", used: "pl.DataFrame"
) -> Panel:
    """Draw the share of NIS above each value, against the chi-square law of the same plots.

    Args:
        name: of the panel.
        groups: name, colour and plots (`nis`) of each line.
        used: the plots whose degrees of freedom (`dof`) make the law.
    """
    from scipy.special import chdtrc

    x = np.linspace(0.0, 30.0, 121)
    packed = charts.short(x, 16)
    data = [
        charts.line(packed, charts.short(_share_above(frame, x)), color, name=words)
        | {"hovertemplate": f"{words}: %{{y:.2%}} above %{{x:.1f}}<extra></extra>"}
        for words, color, frame in groups
    ]
    dof, number = np.unique(column(used, "dof"), return_counts=True)
    known = dof > 0
    share = chdtrc(dof[known], x[:, None]) @ (number[known] / number[known].sum())
    ideal = {"line": {"color": charts.INK, "width": 1.4, "dash": "dot"}}
    data.append(charts.line(packed, charts.short(share), charts.INK, name="chi-square") | ideal)
    floor = np.log10(0.5 / len(used))
    y = charts.axis("share above", type="log", range=[floor, 0.05], tickformat="~%", dtick=1)
    layout = charts.layout(xaxis=charts.axis("NIS of one plot"), yaxis=y, showlegend=True)
    alt = "share of plots whose NIS exceeds a value, measured and by the chi-square law"
    return Panel(name, {"data": data, "layout": layout}, alt)


def _share_above(frame: "pl.DataFrame", x: Floats) -> NDArray[np.float64]:
    nis = np.sort(column(frame, "nis"))
    share = 1.0 - np.searchsorted(nis, x, side="right") / max(len(nis), 1)
    return np.where(share > 0, share, np.nan)


def _targets(targets: "pl.DataFrame") -> Panel:
    """Draw each target's NIS per degree of freedom beside its own band, worst first."""
    rank = np.arange(1, len(targets) + 1)
    nis, low, high = (column(targets, name) for name in ("nis_per_dof", "nis_low", "nis_high"))
    top = float(np.nanmax(np.append(nis, 2.0)))
    bars = np.stack([low, high, np.full(len(rank), np.nan)], -1).ravel()
    band = {"line": {"color": "#b9c2cd", "width": 3}, "hoverinfo": "skip", "name": "95 % band"}
    data = [charts.line(charts.typed(np.repeat(rank, 3)), charts.short(bars), charts.MUTED) | band]
    rows, kinds = targets.to_dicts(), classes(targets)
    for index, (name, color, symbol) in enumerate(CLASSES):
        mine = np.flatnonzero(kinds == index)
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": f"{name} ({len(mine)})",
                "x": charts.typed(rank[mine]),
                "y": charts.short(np.maximum(nis[mine], 1.1 * LEAST)),
                "customdata": [rows[each]["track"] for each in mine],
                "hovertext": [describe(rows[each]) for each in mine],
                "hovertemplate": "%{hovertext}<extra></extra>",
                "marker": {"size": 7, "color": color, "symbol": symbol},
                "meta": "track",
            }
        )
    x = charts.axis("target, worst first", showgrid=False, rangemode="tozero")
    y = charts.axis("NIS per degree of freedom", **_log_scale(LEAST, 1.3 * top))
    layout = charts.layout(xaxis=x, yaxis=y, shapes=[_ideal()], showlegend=True)
    alt = "NIS per degree of freedom of each target beside its own 95 % chi-square band"
    return Panel("nis-targets", {"data": data, "layout": layout}, alt)
