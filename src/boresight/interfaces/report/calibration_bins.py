"""Noise, stability, detection and false plots by range, azimuth and time: with intervals."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.calibration_residuals import CHANNELS, Channel
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import AGAINST, Against, Panel, across, column

if TYPE_CHECKING:
    from collections.abc import Mapping

    import polars as pl

TIME, RANGE, AZIMUTH = AGAINST


class View(NamedTuple):
    """One chart of a table.

    Attributes:
        name: of the panel.
        table: that it is drawn from.
        against: what its rows part.
        ends: columns of where a row begins and ends.
        value: column that is drawn.
        error: column of half its 95 % interval, or columns of both ends; none if not known.
        words: what it is, for a reader.
    """

    name: str
    table: str
    against: Against
    ends: tuple[str, str]
    value: str
    error: tuple[str, ...]
    words: str


_BY = {
    "range": (RANGE, ("range_from_m", "range_to_m")),
    "azimuth": (AZIMUTH, ("azimuth_from_deg", "azimuth_to_deg")),
    "time": (TIME, ("time_from_s", "time_to_s")),
}


def _of_channel(name: str, table: str, by: str, channel: Channel, what: str) -> View:
    """Return the view of a channel's noise (`what` is "sd") or of its mean with interval."""
    error: tuple[str, ...] = ()
    if what == "sd":
        value = f"{channel.stem}_sd_{channel.suffix}"
    else:
        value, error = channel.name, (f"{channel.stem}_ci95_{channel.suffix}",)
    words = f"{channel.words} {what}, {channel.unit}"
    return View(f"{name}-{channel.stem}-{by}", table, *_BY[by], value, error, words)


_NOISE = (("noise_by_range", "range"), ("noise_by_azimuth", "azimuth"))
_STABLE = (("sectors", "azimuth"), ("over_time", "time"))
_COUNTS = (
    ("detection", "probability", ("low", "high"), "detection probability"),
    ("false", "unidentified_per_scan", (), "unidentified plots per scan"),
)
VIEWS = (
    *(_of_channel("spread", table, by, each, "sd") for each in CHANNELS for table, by in _NOISE),
    *(
        _of_channel("left", table, by, each, "residual")
        for each in CHANNELS
        for table, by in _STABLE
    ),
    *(
        View(f"{name}-{by}", f"{name}_by_{by}", *_BY[by], value, error, words)
        for name, value, error, words in _COUNTS
        for by in ("range", "azimuth")
    ),
)


def panels(tables: "Mapping[str, pl.DataFrame]") -> list[Panel]:
    """Draw every view whose table is there and holds a number."""
    return [_panel(tables[view.table], view) for view in VIEWS if _is_there(tables, view)]


def _is_there(tables: "Mapping[str, pl.DataFrame]", view: View) -> bool:
    frame = tables.get(view.table)
    if frame is None or not {view.value, *view.ends, *view.error} <= set(frame.columns):
        return False
    return bool(np.isfinite(column(frame, view.value)).any())


def _panel(frame: "pl.DataFrame", view: View) -> Panel:
    start, end = (column(frame, name) * view.against.scale for name in view.ends)
    value = column(frame, view.value)
    below, above = _errors(frame, view, value)
    bars = {"color": charts.BLUE, "thickness": 1.4, "width": 0}
    marks = {
        "type": "scatter",
        "mode": "markers",
        "x": charts.typed((start + end) / 2, "f8"),
        "y": charts.short(value, 16),
        "error_y": bars
        | {
            "symmetric": False,
            "array": charts.short(above, 16),
            "arrayminus": charts.short(below, 16),
        },
        "marker": {"size": 6, "color": charts.BLUE},
        "customdata": charts.short(np.stack([value - below, value + above], -1), 16),
        "hovertemplate": "%{y:.3~g} (%{customdata[0]:.3~g} to %{customdata[1]:.3~g})"
        "<extra></extra>",
    }
    bounds = np.array(
        [0.0, 360.0] if view.against is AZIMUTH else [np.nanmin(start), np.nanmax(end)]
    )
    layout = charts.layout(xaxis=across(view.against, bounds), yaxis=_upwards(view))
    data = [_widths(start, end, value), marks]
    alt = f"{view.words} against {view.against.words}, with 95 % intervals where known"
    return Panel(view.name, {"data": data, "layout": layout}, alt)


def _errors(frame: "pl.DataFrame", view: View, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far the 95 % interval reaches below and above the value."""
    if len(view.error) == 2:
        low, high = (column(frame, name) for name in view.error)
        return value - low, high - value
    half = column(frame, view.error[0]) if view.error else np.full(len(value), np.nan)
    return half, half


def _widths(start: np.ndarray, end: np.ndarray, value: np.ndarray) -> Chart:
    """Draw over which stretch each value holds."""
    x = np.stack([start, end, np.full(len(start), np.nan)], -1).ravel()
    style = {"line": {"color": charts.BLUE, "width": 1.4}, "hoverinfo": "skip"}
    return (
        charts.line(charts.typed(x, "f8"), charts.short(np.repeat(value, 3)), charts.BLUE) | style
    )


def _upwards(view: View) -> Chart:
    if view.value == "probability":
        return charts.axis(view.words, range=[0.0, 1.02], tickformat=".0%")
    if view.table in {"sectors", "over_time"}:
        return charts.axis(view.words, zeroline=True, zerolinecolor=charts.INK, nticks=6)
    return charts.axis(view.words, rangemode="tozero", nticks=6)
