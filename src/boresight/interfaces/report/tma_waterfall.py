"""Bearings against time as sonar operators have them: time downwards, bearing across."""

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import Floats, Panel
from boresight.interfaces.report.tma_picture import sides_heard
from boresight.interfaces.report.tma_view import (
    View,
    dots,
    floats,
    line,
    text,
    thinned,
    time_axis,
    unwrapped,
)

CAPTION = (
    "Time runs down, bearing across. Dots: bearings as heard, with one sd; line: as estimated; "
    "grey and dashed: own ship's heading."
)
CAPTION_MANY = (
    "Time runs down, bearing across. Dots: bearings as heard; lines: as estimated; grey and "
    "dashed: own ship's heading. Names are those of the contacts with most bearings."
)
CONE = (
    " A cone is heard on either side of the array's axis, dotted ahead and astern: pale and hollow "
    "is the less likely side."
)
MOST_DOTS = 12_000  # of all contacts together
NAMED = 12  # more names than these hide the picture
STANDING_MPS = 0.05  # slower, own ship has no heading that its velocity tells
STEPS_DEG = (1, 2, 5, 10, 15, 30, 45, 90)
COLORS = (charts.BLUE, charts.ORANGE, charts.GREEN, charts.PURPLE, "#b58900", "#56B4E9", "#3b4a5c")


def panel(views: Sequence[View], name: str = "waterfall-chart") -> Panel:
    """Draw the waterfall of one contact or of all."""
    cut, is_alone = _cut(views), len(views) == 1
    time, heading, axis = _own_ship(views)
    strip = _strip(heading, time) if is_alone and not np.isfinite(axis).any() else None
    data = (
        strip.data
        if strip
        else [_line(heading, time, cut, charts.MUTED, "own ship's heading", "dash")]
    )
    if np.isfinite(axis).any():
        data.append(_line(axis, time, cut, charts.MUTED, "array's axis", "dot"))
        data.append(_line(axis + 180.0, time, cut, charts.MUTED, "array's axis, astern", "dot"))
    step = -(-sum(len(view.kept) for view in views) // MOST_DOTS) or 1
    for view, color in zip(views, _colors(len(views)), strict=True):
        data += _alone(view, cut, color) if is_alone else _among(view, cut, color, step)
    every = [*([] if strip else [heading]), *(view["bearing_deg"] for view in views)]
    every += [sides_heard(view).ravel() for view in views]
    x = charts.axis("bearing, °", side="top", **_ticks(_placed(np.concatenate(every), cut)))
    layout = charts.layout(xaxis=x, yaxis=time_axis(autorange="reversed"), showlegend=is_alone)
    if strip:
        layout["xaxis"]["domain"], layout["xaxis2"] = [0.0, 0.76], strip.axis
    layout["legend"] = layout["legend"] | {"y": -0.02, "yanchor": "top"}
    layout["annotations"] = [] if is_alone else _names(views, cut)
    who = f"contact {views[0].title}" if is_alone else f"{len(views)} contacts"
    return Panel(name, {"data": data, "layout": layout}, f"bearings of {who} over time")


class _Strip(NamedTuple):
    """A narrow chart beside the bearings, on their axis of time."""

    data: list[Chart]
    axis: Chart


def _strip(heading: Floats, time: Floats) -> _Strip:
    """Draw own ship's heading beside true bearings, which need all the width for themselves."""
    turned = unwrapped(heading)
    style = {"color": charts.MUTED, "width": 1.4, "dash": "dash"}
    drawn = line(turned, time, charts.MUTED, name="own ship's heading", line=style, xaxis="x2")
    axis = charts.axis("heading, °", side="top", domain=[0.82, 0.97], **_ticks(turned, 3))
    return _Strip([drawn | {"hoverinfo": "skip"}], axis)


def caption(views: Sequence[View]) -> str:
    """Say what the waterfall shows."""
    said = CAPTION if len(views) == 1 else CAPTION_MANY
    return said + (CONE if any(view.motion.contact.is_conical for view in views) else "")


def _colors(count: int) -> list[str]:
    return [COLORS[index % len(COLORS)] for index in range(count)]


def _cut(views: Sequence[View]) -> float:
    """Return where to cut the circle open, degrees: in the widest sector without a bearing."""
    heard = np.concatenate([sides_heard(view).ravel() for view in views])
    heard = np.sort(heard[np.isfinite(heard)] % 360)
    if not len(heard):
        return 0.0
    ends = np.append(heard, heard[0] + 360)
    widest = int(np.argmax(np.diff(ends)))
    return float((ends[widest] + ends[widest + 1]) / 2 % 360)


def _placed(deg: Floats, cut: float) -> Floats:
    return cut + (deg - cut) % 360


def _line(deg: Floats, time: Floats, cut: float, color: str, name: str, dash: str) -> Chart:
    """Draw a line, broken where it leaves on one side and comes back on the other."""
    x = _placed(deg, cut)
    jump = np.flatnonzero(np.abs(np.diff(x)) > 180) + 1
    x, y = np.insert(x, jump, np.nan), np.insert(time, jump, np.nan)
    style = {"color": color, "width": 1.4, "dash": dash}
    return line(x, y, color, name=name, line=style, hoverinfo="skip")


def _own_ship(views: Sequence[View]) -> tuple[Floats, Floats, Floats]:
    """Return times, own ship's course (NaN where it stood), and the axis of what hears cones."""
    contacts = [view.motion.contact for view in views]
    time, first = np.unique(np.concatenate([each.time_s for each in contacts]), return_index=True)
    kept = thinned(len(time))
    north, east = np.concatenate([each.velocity_mps for each in contacts])[first][kept].T
    course = np.where(np.hypot(north, east) > STANDING_MPS, np.arctan2(east, north), np.nan)
    axis = np.concatenate(
        [np.where(np.isfinite(each.cone_rad), each.axis_rad, np.nan) for each in contacts]
    )
    return time[kept], np.degrees(course), np.degrees(axis[first][kept])


def _alone(view: View, cut: float, color: str) -> Iterator[Chart]:
    """Draw one contact: dots with their sd, and the estimate."""
    sd = charts.short(np.degrees(view.motion.contact.sigma_rad)[view.kept])
    bars = {"error_x": {"array": sd, "color": color, "thickness": 0.6, "width": 0}}
    yield from (trace | bars for trace in _heard(view, cut, color, 4.0, 1))
    yield _line(view["bearing_deg"], view.time, cut, charts.INK, "estimate", "solid")


def _among(view: View, cut: float, color: str, step: int) -> Iterator[Chart]:
    """Draw one contact of many."""
    yield from _heard(view, cut, color, 2.5, step)
    yield _line(view["bearing_deg"], view.time, cut, color, "estimate", "solid")


def _heard(view: View, cut: float, color: str, size: float, step: int) -> Iterator[Chart]:
    """Draw what was heard; of a cone both sides, the less likely one pale."""
    name = escape(view.title)
    hover = f"{name}: %{{x:.1f}}° at %{{y:,.7~g}} s<extra></extra>"
    pale = {"symbol": "circle-open", "opacity": 0.45}
    for side, deg in enumerate(sides_heard(view)):
        style = {"opacity": 0.7} if side == _likely(view) else pale
        x = _placed(deg[::step], cut)
        trace = dots(x, view.time[::step], color, size=size, **style)
        yield trace | {"name": name, "hovertemplate": hover}


def _likely(view: View) -> int:
    """Return which side of a cone is the likelier: 0 starboard, as of true bearings, or 1 port."""
    return int(bool(view.motion.sides) and view.motion.sides[0].name == "port")


def _names(views: Sequence[View], cut: float) -> list[Chart]:
    """Name the contacts with most bearings, where each was first heard."""
    found = []
    for view, color in zip(views[:NAMED], _colors(NAMED), strict=False):
        heard = sides_heard(view)
        deg = heard[min(_likely(view), len(heard) - 1)]
        for first in np.flatnonzero(np.isfinite(deg))[:1]:
            x, y = float(_placed(deg[first], cut)), float(view.time[first])
            style = {"xanchor": "left", "yanchor": "bottom", "font": {"size": 11, "color": color}}
            found.append(text(x, y, escape(view.title), **style))
    return found


def _ticks(every: Floats, most: int = 9) -> Chart:
    """Return range and ticks of the axis of bearings, read 0 to 360."""
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 360.0)
    margin = 0.03 * (high - low) + 1.0
    low, high = low - margin, high + margin
    step = next((each for each in STEPS_DEG if (high - low) / each <= most), STEPS_DEG[-1])
    ticks = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    words = [f"{each % 360:03.0f}" for each in ticks]
    return {"range": [low, high], "tickvals": floats(ticks), "ticktext": words}
