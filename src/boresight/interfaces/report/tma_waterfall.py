"""Bearings against time as sonar operators have them: time downwards, bearing across."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import Floats, Panel
from boresight.interfaces.report.tma_picture import sides_heard
from boresight.interfaces.report.tma_view import View, dots, floats, line, time_axis

CAPTION = (
    "Time runs down, bearing across. Dots: bearings as heard, with one sd; line: as estimated; "
    "grey and dashed: own ship's heading."
)
CONE = " A cone is heard on either side of the array: pale and hollow is the less likely one."
MOST_DOTS = 12_000  # of all contacts together
COLORS = (charts.BLUE, charts.ORANGE, charts.GREEN, charts.PURPLE, "#b58900", "#56B4E9", "#3b4a5c")


def panel(views: Sequence[View], name: str = "waterfall-chart") -> Panel:
    """Draw the waterfall of one contact or of all."""
    cut = _cut(views)
    data = [*_heading(views[0], cut)]
    step = -(-sum(len(view.kept) for view in views) // MOST_DOTS) or 1
    for index, view in enumerate(views):
        data += _contact(view, cut, COLORS[index % len(COLORS)], step, is_alone=len(views) == 1)
    x = charts.axis("bearing, °", side="top", **_ticks(data))
    y = time_axis(autorange="reversed")
    layout = charts.layout(xaxis=x, yaxis=y, showlegend=len(views) == 1)
    layout["legend"] = layout["legend"] | {"y": -0.02, "yanchor": "top"}
    for trace in data:
        trace.pop("across")
    who = f"contact {views[0].title}" if len(views) == 1 else f"{len(views)} contacts"
    return Panel(name, {"data": data, "layout": layout}, f"bearings of {who} over time")


def caption(views: Sequence[View]) -> str:
    """Say what the waterfall shows."""
    return CAPTION + (CONE if any(view.motion.contact.is_conical for view in views) else "")


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


def _broken(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Break a line where it leaves on one side and comes back on the other."""
    jump = np.flatnonzero(np.abs(np.diff(x)) > 180) + 1
    return np.insert(x, jump, np.nan), np.insert(y, jump, np.nan)


def _line(deg: Floats, time: Floats, cut: float, color: str, **style: Any) -> Chart:
    x, y = _broken(_placed(deg, cut), time)
    trace = line(x, y, color, showlegend=False)
    return trace | {"line": {"color": color, "width": 1.5} | style, "across": x}


def _heading(view: View, cut: float) -> Iterator[Chart]:
    velocity = np.asarray(view.motion.contact.velocity_mps)[view.kept]
    moving = np.hypot(*velocity.T) > 0.05
    course = np.where(moving, np.degrees(np.arctan2(velocity[:, 1], velocity[:, 0])), np.nan)
    if np.isfinite(course).any():
        drawn = _line(course, view.time, cut, charts.MUTED, dash="dash", width=1.2)
        yield drawn | {"name": "own ship's heading", "showlegend": True, "hoverinfo": "skip"}


def _contact(view: View, cut: float, color: str, step: int, *, is_alone: bool) -> Iterator[Chart]:
    heard, sd = sides_heard(view), np.degrees(view.motion.contact.sigma_rad)[view.kept]
    time, name = view.time[::step], view.title
    mirror = _mirror(view)
    for side, deg in enumerate(heard):
        known = np.isfinite(deg[::step])
        x = _placed(deg[::step][known], cut)
        hollow = len(heard) > 1 and side == mirror
        marks = {"symbol": "circle-open"} if hollow else {}
        size = 4 if is_alone else 2.5
        trace = dots(x, time[known], color, size=size, opacity=0.45 if hollow else 0.7, **marks)
        trace |= {
            "name": name,
            "hovertemplate": f"{name}: %{{x:.1f}}° at %{{y:,.7~g}} s<extra></extra>",
        }
        if is_alone:
            spread = charts.short(sd[::step][known])
            trace["error_x"] = {"array": spread, "color": color, "thickness": 0.6, "width": 0}
        yield trace | {"across": x}
    estimate = view["bearing_deg"]
    if np.isfinite(estimate).any():
        ink = charts.INK if is_alone else color
        drawn = _line(estimate, view.time, cut, ink)
        yield drawn | {"name": "estimate", "showlegend": is_alone, "hoverinfo": "skip"}


def _mirror(view: View) -> int:
    """Return which side of a cone is the less likely: 0 starboard, 1 port."""
    first = view.motion.sides[0].name if view.motion.sides else "starboard"
    return 1 if first == "starboard" else 0


def _ticks(data: Sequence[Chart]) -> Chart:
    """Return range and ticks of the axis of bearings, read 0 to 360."""
    every = np.concatenate([trace["across"] for trace in data]) if data else np.zeros(0)
    every = every[np.isfinite(every)]
    low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 360.0)
    margin = 0.03 * (high - low) + 1.0
    low, high = low - margin, high + margin
    step = next((each for each in (1, 2, 5, 10, 15, 30) if (high - low) / each <= 9), 45)
    ticks = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    words = [f"{each % 360:03.0f}" for each in ticks]
    return {"range": [low, high], "tickvals": floats(ticks), "ticktext": words}
