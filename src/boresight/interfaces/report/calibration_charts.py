"""The systematic errors drawn: each with its interval on one scale, and how they go together."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.calibration_findings import (
    Finding,
    findings,
    has_interval,
    shown_sd,
    systematic,
)
from boresight.interfaces.report.calibration_scale import Typical
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import NORMAL_95, Panel
from boresight.interfaces.report.words import interval
from boresight.maths.digits import decimals, with_unit
from boresight.models.systematic import TERMS

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration

PALE = "rgba(91,102,117,0.35)"
NOISE = "rgba(91,102,117,0.10)"
SIGNS = [[0, "#0072B2"], [0.5, "#ffffff"], [1, "#D55E00"]]
COLORS = {
    Finding.ERROR: charts.ORANGE,
    Finding.NONE: charts.BLUE,
    Finding.SHARED: charts.GREEN,
    Finding.WITHIN: charts.PURPLE,
    Finding.ENDLESS: charts.MUTED,
}
STRONG = 0.8  # of a correlation: white figures are read better on it


def panels(calibration: "Calibration", typical: Typical) -> list[Panel]:
    """Draw the terms with their intervals and, of several, their correlations."""
    drawn = [_terms(calibration, typical)] if calibration.terms else []
    known = any(has_interval(term) for term in calibration.terms.values())
    several = known and len(calibration.errors.terms) > 1
    return drawn + ([_correlation(calibration)] if several else [])


def _terms(calibration: "Calibration", typical: Typical) -> Panel:
    found, names = findings(calibration), list(calibration.terms)
    rows = [_row(n, calibration, typical.metres(n), float(i)) for i, n in enumerate(names)]
    kinds = {kind: [row for row in rows if found[row.name] == kind] for kind in Finding}
    bounded = [row for row in rows if found[row.name] not in (Finding.ENDLESS, Finding.UNSEEN)]
    data = [
        _bars([row for row in bounded if row.beyond], "with the systematic part", 3, _systematic),
        _bars(bounded, "if all pairs were independent", 16, _naive),
        *(_dots(kinds[kind], kind, color) for kind, color in COLORS.items() if kinds[kind]),
    ]
    x = charts.axis(f"moves the plot of a target at {typical.words(*names)} by, m", zeroline=True)
    x |= {"zerolinecolor": charts.INK, "zerolinewidth": 1.4}
    y = charts.axis("", tickvals=[row.place for row in rows], showgrid=False)
    y |= {"ticktext": [row.label for row in rows], "range": [len(names) - 0.4, -0.6]}
    layout = charts.layout(xaxis=x, yaxis=y, showlegend=True)
    layout["annotations"] = [_hidden(row.place) for row in kinds[Finding.UNSEEN]]
    layout["shapes"] = _noise_band(typical.noise_m(calibration.noise))
    alt = "each systematic error with its 95 % interval, as metres at a typical target"
    drawn = [trace for trace in data if trace]
    return Panel("bias-terms", {"data": drawn, "layout": layout}, alt)


class _Row(NamedTuple):
    """One term as the chart needs it: figures in metres at a typical target, and words."""

    name: str
    place: float
    middle: float
    low: float
    high: float
    naive: float
    beyond: float
    label: str
    said: str


def _row(name: str, calibration: "Calibration", scale: float, place: float) -> _Row:
    term, kind = calibration.terms[name], TERMS[name]
    places = decimals(shown_sd(term))
    estimate = with_unit(term.estimate, places, kind.unit)
    low, high = (end * scale for end in term.ci95)
    return _Row(
        name=name,
        place=place,
        middle=term.estimate * scale,
        low=low,
        high=high,
        naive=NORMAL_95 * term.independent_sd * scale,
        beyond=systematic(name, calibration) * scale,
        label=f"{kind.words}  <b>{estimate}</b>" if term.observable else kind.words,
        said=f"{kind.words} {estimate} ({interval(term.ci95, places, kind.unit)})",
    )


def _dots(rows: "Sequence[_Row]", kind: Finding, color: str) -> Chart:
    """Draw the estimates with their clustered intervals; the hover says the numbers."""
    middle = np.array([row.middle for row in rows])
    low, high = (np.array([getattr(row, end) for row in rows]) for end in ("low", "high"))
    return {
        "type": "scatter",
        "mode": "markers",
        "name": str(kind),
        "x": charts.short(middle, 22),
        "y": charts.typed([row.place for row in rows]),
        "error_x": {
            "symmetric": False,
            "array": charts.short(np.where(np.isfinite(high), high - middle, np.nan), 22),
            "arrayminus": charts.short(np.where(np.isfinite(low), middle - low, np.nan), 22),
            "color": color,
            "thickness": 1.8,
            "width": 5,
        },
        "marker": {"size": 8, "color": color},
        "hovertext": [row.said for row in rows],
        "hovertemplate": "%{hovertext}<br>%{x:.3~g} m<extra></extra>",
    }


def _naive(row: _Row) -> tuple[float, float]:
    return row.middle - row.naive, row.middle + row.naive


def _systematic(row: _Row) -> tuple[float, float]:
    return row.low - row.beyond, row.high + row.beyond


def _bars(
    rows: "Sequence[_Row]", words: str, width: int, ends: "Callable[[_Row], tuple[float, float]]"
) -> Chart:
    """Draw, pale, from one end to the other; nothing if there are no rows."""
    if not rows:
        return {}
    x = np.array([(*ends(row), np.nan) for row in rows]).ravel()
    y = charts.typed(np.repeat([row.place for row in rows], 3))
    style = {"line": {"color": PALE, "width": width}, "name": words}
    return charts.line(charts.short(x, 22), y, PALE, hoverinfo="skip") | style


def _hidden(y: float) -> Chart:
    place = {"x": 0.5, "xref": "paper", "y": y, "showarrow": False}
    return {"text": "<i>not observable: no number to use</i>"} | place


def _noise_band(noise_m: float) -> list[Chart]:
    if not np.isfinite(noise_m):
        return []
    ends = {"x0": -noise_m, "x1": noise_m, "y0": 0, "y1": 1, "yref": "paper"}
    return [{"type": "rect", "fillcolor": NOISE, "line": {"width": 0}, "layer": "below"} | ends]


def _correlation(calibration: "Calibration") -> Panel:
    found = correlation(calibration)
    blank = np.where(np.eye(len(found), dtype=bool), np.nan, found)
    words = [TERMS[name].words for name in calibration.errors.terms]
    square = charts.axis("", showgrid=False, ticks="")
    place = list(range(len(words)))
    x = square | {"tickvals": place, "ticktext": words, "tickangle": -35}
    y = square | {"tickvals": place, "ticktext": words, "autorange": "reversed"}
    heat = {
        "type": "heatmap",
        "z": charts.short(blank),
        "zmin": -1,
        "zmax": 1,
        "colorscale": SIGNS,
        "showscale": False,
        "hoverinfo": "skip",
        "xgap": 2,
        "ygap": 2,
    }
    layout = charts.layout(xaxis=x, yaxis=y)
    layout["annotations"] = [_figure(i, j, found[i, j]) for i in place for j in place if i != j]
    alt = "correlation of each pair of systematic errors"
    return Panel("bias-correlation", {"data": [heat], "layout": layout}, alt)


def correlation(calibration: "Calibration") -> np.ndarray:
    """Correlation matrix of the terms, (n, n); zero where a variance is."""
    cov = calibration.errors.cov
    sd = np.sqrt(np.maximum(np.diag(cov), 0.0))
    scale = np.outer(sd, sd)
    found: np.ndarray = np.divide(cov, scale, out=np.zeros_like(cov), where=scale > 0)
    return found


def _figure(row: int, where: int, value: float) -> Chart:
    color = "#ffffff" if abs(value) > STRONG else charts.INK
    font = {"color": color, "size": 12}
    return {"text": f"{value:+.2f}", "x": where, "y": row, "showarrow": False, "font": font}
