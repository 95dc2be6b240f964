"""The systematic errors drawn: each with its interval on one scale, and how they go together."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.calibration_scale import Typical
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import Panel
from boresight.interfaces.report.words import decimals, interval, with_unit
from boresight.models.systematic import TERMS

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration, TermFound

NOISE = "rgba(91,102,117,0.10)"
SIGNS = [[0, "#0072B2"], [0.5, "#ffffff"], [1, "#D55E00"]]
STRONG = 0.6  # of a correlation: white figures are read better on it


def panels(calibration: "Calibration", typical: Typical) -> list[Panel]:
    """Draw the terms with their intervals and, of several, their correlations."""
    drawn = [_terms(calibration, typical)] if calibration.terms else []
    return drawn + ([_correlation(calibration)] if len(calibration.errors.terms) > 1 else [])


def _terms(calibration: "Calibration", typical: Typical) -> Panel:
    seen = {name: each for name, each in calibration.terms.items() if each.observable}
    names = list(calibration.terms)
    scale = {name: typical.metres(name) for name in names}
    place = {name: float(index) for index, name in enumerate(names)}
    proven = {name: each for name, each in seen.items() if _is_proven(each)}
    rest = {name: each for name, each in seen.items() if name not in proven}
    data = [
        _naive(seen, scale, place),
        _dots("error", proven, scale, place, charts.ORANGE),
        _dots("none shows itself", rest, scale, place, charts.BLUE),
    ]
    hidden = [name for name in names if name not in seen]
    x = charts.axis(f"moves the plot of a target at {typical.words()} by, m", zeroline=True)
    x |= {"zerolinecolor": charts.INK, "zerolinewidth": 1.4}
    y = charts.axis("", tickvals=list(place.values()), showgrid=False)
    y |= {"ticktext": [TERMS[name].words for name in names], "range": [len(names) - 0.4, -0.6]}
    layout = charts.layout(xaxis=x, yaxis=y, showlegend=True)
    layout["annotations"] = [_hidden(place[name]) for name in hidden]
    layout["shapes"] = _noise_band(typical.noise_m(calibration.noise))
    alt = "each systematic error with its 95 % interval, as metres at a typical target"
    return Panel("bias-terms", {"data": data, "layout": layout}, alt)


def _is_proven(term: "TermFound") -> bool:
    return term.ci95[0] > 0 or term.ci95[1] < 0


def _dots(
    words: str,
    terms: "Mapping[str, TermFound]",
    scale: Mapping[str, float],
    place: Mapping[str, float],
    color: str,
) -> Chart:
    """Draw the estimates with their clustered intervals; the number itself is in the hover."""
    unit = np.array([scale[name] for name in terms])
    ends = np.array([each.ci95 for each in terms.values()]).reshape(-1, 2)
    middle = np.array([each.estimate for each in terms.values()])
    low, high = (np.where(np.isfinite(end), end, middle) for end in ends.T)
    return {
        "type": "scatter",
        "mode": "markers",
        "name": words,
        "x": charts.short(middle * unit, 22),
        "y": charts.typed([place[name] for name in terms]),
        "error_x": {
            "symmetric": False,
            "array": charts.short((high - middle) * unit, 22),
            "arrayminus": charts.short((middle - low) * unit, 22),
            "color": color,
            "thickness": 1.8,
            "width": 5,
        },
        "marker": {"size": 10, "color": color},
        "hovertext": [_said(name, each) for name, each in terms.items()],
        "hovertemplate": "%{hovertext}<br>%{x:.3~g} m<extra></extra>",
    }


def _said(name: str, term: "TermFound") -> str:
    kind, places = TERMS[name], decimals(term.sd)
    ends = interval(term.ci95, places, kind.unit)
    return f"{kind.words} {with_unit(term.estimate, places, kind.unit)} ({ends})"


def _naive(
    terms: "Mapping[str, TermFound]", scale: Mapping[str, float], place: Mapping[str, float]
) -> Chart:
    """Draw, thick and pale, how narrow the intervals would be if all pairs were independent."""
    half = np.array([1.96 * each.independent_sd * scale[name] for name, each in terms.items()])
    middle = np.array([each.estimate * scale[name] for name, each in terms.items()])
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "if all pairs were independent",
        "x": charts.short(middle, 22),
        "y": charts.typed([place[name] for name in terms]),
        "error_x": {
            "array": charts.short(np.nan_to_num(half), 22),
            "color": "rgba(91,102,117,0.35)",
            "thickness": 9,
            "width": 0,
        },
        "marker": {"size": 1, "color": charts.MUTED},
        "hoverinfo": "skip",
    }


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
    words = [TERMS[name].words for name in calibration.errors.terms]
    square = charts.axis("", showgrid=False, ticks="")
    place = list(range(len(words)))
    x = square | {"tickvals": place, "ticktext": words, "tickangle": -35}
    y = square | {"tickvals": place, "ticktext": words, "autorange": "reversed"}
    heat = {
        "type": "heatmap",
        "z": charts.short(found),
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


def proven(terms: "Mapping[str, TermFound]") -> Sequence[str]:
    """Name the terms that are observable and whose interval leaves zero out."""
    return [name for name, each in terms.items() if each.observable and _is_proven(each)]
