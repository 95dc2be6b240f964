"""What is left of the bearings when the best straight track is taken off, and what it tells."""

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.calibration_laws import quantile_band
from boresight.interfaces.report.residuals import Floats, Panel
from boresight.interfaces.report.tma_view import View, band, dots, line, thinned, time_axis
from boresight.interfaces.report.words import Cell, figure, table, text_cell

if TYPE_CHECKING:
    from boresight.target_motion.result import Test

MOST_DOTS = 4_000
WORDS = (
    "<p>The best straight track taken off the bearings. A good recording leaves noise of the "
    "stated size and nothing else; it fails one of these tests with {percent:.2g} %.</p>"
)
TIME_CAPTION = "Residuals over time. Shaded: two sd as stated for the sensor."
LAW_CAPTION = (
    "Residuals over their stated sd, against a normal law. Shaded: 95 % of each if they are normal "
    "and the sd is true; the line is where they would lie."
)


def panels(view: View) -> list[Panel]:
    """Draw the residuals over time, and their quantiles over those of a normal law."""
    found = view.motion.residuals
    if found is None or np.isfinite(found.deg).sum() < 2:
        return []
    deg = np.asarray(found.deg, dtype=float)
    sd = np.degrees(view.motion.contact.sigma_rad)
    known = np.isfinite(deg)
    alt = f"of the bearing residuals of contact {view.title}"
    return [
        Panel(f"{view.stem}residuals-time", _over_time(view, deg, sd), f"course over time {alt}"),
        Panel(f"{view.stem}residuals-law", _quantiles(deg[known] / sd[known]), f"quantiles {alt}"),
    ]


def captions() -> tuple[str, str]:
    """Say what the two charts show."""
    return TIME_CAPTION, LAW_CAPTION


def _over_time(view: View, deg: Floats, sd: Floats) -> charts.Chart:
    time = np.asarray(view.motion.contact.time_s, dtype=float)
    at = thinned(len(deg), MOST_DOTS)
    time, deg, sd = time[at], deg[at], sd[at]
    trace = dots(time, deg, charts.BLUE, size=3.5, opacity=0.7)
    hover = {"hovertemplate": "%{y:.3f}° at %{x:,.7~g} s<extra></extra>"}
    reach = 1.1 * max(float(np.nanmax(np.abs(deg))), 2.2 * float(np.median(sd)))
    y = charts.axis("residual, °", range=[-reach, reach], zeroline=True, zerolinecolor="#aab4c0")
    x = time_axis(showgrid=False, range=[float(time[0]), float(time[-1])])
    data = [*band(time, -2 * sd, 2 * sd, "two sd"), trace | hover]
    return {"data": data, "layout": charts.layout(xaxis=x, yaxis=y)}


def _quantiles(values: Floats) -> charts.Chart:
    from scipy.special import ndtri

    order = np.sort(values)
    share = (np.arange(len(order)) + 0.5) / len(order)
    at = thinned(len(order), 300)
    at = np.unique(np.concatenate([at, np.arange(min(20, len(order)))]))
    at = np.unique(np.concatenate([at, len(order) - 1 - np.arange(min(20, len(order)))]))
    x, y = ndtri(share[at]), order[at]
    low, high = (ndtri(each) for each in quantile_band(share[at], float(len(order))))
    data = [
        *band(x, low, high, "95 %"),
        line(x, x, charts.ORANGE, hoverinfo="skip"),
        dots(x, y, charts.BLUE, size=4) | {"hovertemplate": "%{y:.2f} for %{x:.2f}<extra></extra>"},
    ]
    axes = {"xaxis": charts.axis("quantile of the normal law")}
    axes |= {"yaxis": charts.axis("residual over its sd")}
    return {"data": data, "layout": charts.layout(**axes)}


def words(view: View) -> str:
    """Return the tests as a table."""
    found = view.motion.residuals
    if found is None:
        return "<p>There are no residuals: no straight track was fitted to the bearings.</p>"
    said = WORDS.format(percent=100 * found.false_alarm)
    heads = ["question", "statistic", "p value", "finding", "in words"]
    rows = [
        [
            text_cell(test.name),
            Cell(figure(test.statistic, 3) if test.asked else "–", is_figure=True),
            Cell(_chance(test), is_figure=True),
            Cell(_finding(test)),
            text_cell(test.words),
        ]
        for test in found.tests
    ]
    return said + (
        table(f"Tests of the residuals of {escape(view.title)}", heads, rows) if rows else ""
    )


def _finding(test: "Test") -> str:
    if not test.asked:
        return "not asked"
    if test.passed:
        return "passed"
    return f"failed, as {test.follows} would explain" if test.follows else "<b>failed</b>"


def _chance(test: "Test") -> str:
    if not test.asked:
        return "–"
    if test.p_value < 1e-4:
        return "&lt; 0.0001"
    return f"{test.p_value:.2f}" if test.p_value >= 0.1 else f"{test.p_value:.1g}"
