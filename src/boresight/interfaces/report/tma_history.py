"""Range, bearing, course and speed against time: what was known of each, and the best there was.

Left the estimates with two sd either side, right the sd themselves against the Cramér-Rao bound
and against the sd that the criteria allow.
"""

from collections.abc import Callable
from dataclasses import asdict
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import Floats, Panel
from boresight.interfaces.report.tma_view import (
    SHADE,
    View,
    band,
    floats,
    line,
    stretches,
    text,
    time_axis,
    unwrapped,
)
from boresight.interfaces.report.tma_words import KINDS, RANGE, Kind, seconds

GAP = 0.05
UNTOLD = "range not told by the bearings"
ESTIMATES = (
    "Estimates with two sd either side; dashed, two sd of the Cramér-Rao bound with the same "
    "prior. Shaded: the bearings alone do not tell the range, and no estimate of range, course or "
    "speed is drawn, only what was believed.{lines}"
)
LINES = " Upright lines: when the answer was good enough, and dotted when the bound permits it."
ONE_SIDE = " All of it as if the contact is to {side}."
SPREADS = (
    "Standard deviations (logarithmic) against the Cramér-Rao bound, dashed, and against what the "
    "criteria allow, dotted: below it a normal error is small enough with {percent:.3g} %."
)
WIDEST_DEG = 180.0
SHORT = 1.7  # decades
MARGIN = {"l": 8, "r": 8, "t": 38, "b": 8}  # two lines of words above need room
TALL = {"layer": "below", "yref": "paper", "y0": 0, "y1": 1}
Rows: TypeAlias = Callable[[View, Kind], tuple[list[Chart], Chart]]


def panels(view: View) -> list[Panel]:
    """Draw estimates, and beside them standard deviations."""
    name, title = f"{view.stem}history", view.title
    return [
        Panel(f"{name}-estimates", _stacked(view, _estimates), f"estimates of {title} over time"),
        Panel(f"{name}-spreads", _stacked(view, _spreads), f"standard deviations of {title}"),
    ]


def captions(view: View) -> tuple[str, str]:
    """Say what the two charts show."""
    one = ONE_SIDE.format(side=view.motion.sides[0].name) if view.motion.sides else ""
    lines = LINES if any(asdict(view.motion.convergence).values()) else ""
    return ESTIMATES.format(lines=lines) + one, SPREADS.format(
        percent=100 * view.motion.criteria.confidence
    )


def allowed(view: View, kind: Kind) -> Floats:
    """(kept,) the sd of a normal error that meets a quantity's criterion, in its column's unit."""
    from scipy.special import ndtri

    asked = view.motion.criteria
    limit = {
        "range": asked.range_percent / 100 * view["range_m"],
        "bearing": asked.bearing_deg + 0.0 * view.time,
        "course": asked.course_deg + 0.0 * view.time,
        "speed": asked.speed_mps + 0.0 * view.time,
    }[kind.stem]
    return np.asarray(limit / ndtri(0.5 + asked.confidence / 2.0))


def _stacked(view: View, drawn: Rows) -> Chart:
    """Stack one chart for each quantity over one axis of time."""
    layout = charts.layout(hovermode="x", margin=MARGIN)
    data: list[Chart] = []
    step = 1.0 / len(KINDS)
    for row, kind in enumerate(KINDS):
        mark = str(row + 1) if row else ""
        traces, axis = drawn(view, kind)
        low = 1.0 - (row + 1) * step + (GAP if row < len(KINDS) - 1 else 0.0)
        layout[f"yaxis{mark}"] = axis | {"domain": [max(low, 0.0), 1.0 - row * step]}
        data += [trace | {"yaxis": f"y{mark}"} for trace in traces]
    ends = [float(view.time[0]), float(view.time[-1])]
    x = time_axis(showgrid=False, anchor=f"y{len(KINDS)}")
    layout["xaxis"] = x | ({"range": ends} if ends[1] > ends[0] else {})
    layout["shapes"], layout["annotations"] = marks(view)
    return {"data": data, "layout": layout}


def marks(view: View) -> tuple[list[Chart], list[Chart]]:
    """Shade when the range is not told, and mark when the answer became good enough."""
    shapes, words = [], []
    time = view.time
    for first, last in stretches(~view.told):
        x = {"x0": float(time[first]), "x1": float(time[min(last + 1, len(time) - 1)])}
        shapes.append({"type": "rect", "fillcolor": SHADE, "line": {"width": 0}} | x | TALL)
    if shapes:
        at = {"xanchor": "left", "yanchor": "bottom", "yref": "paper"}
        words.append(text(shapes[0]["x0"], 1.0, UNTOLD, **at))
    found, when = view.motion.convergence, []
    if found.permitted_s is not None:
        when.append((found.permitted_s, "dot", charts.MUTED, ""))
    if found.sustained_s is not None:
        said = f"good enough since {seconds(found.sustained_s)}"
        when.append((found.sustained_s, "solid", charts.GREEN, said))
    elif found.first_s is not None:
        when.append((found.first_s, "dash", charts.ORANGE, f"good at {seconds(found.first_s)}"))
    for time_s, dash, color, said in when:
        style = {"color": color, "width": 1.4, "dash": dash}
        shapes.append({"type": "line", "line": style, "x0": time_s, "x1": time_s} | TALL)
        if said:
            at = {"xanchor": "left", "yanchor": "bottom", "yref": "paper"}
            font = {"size": 11, "color": color}
            words.append(text(time_s, 1.0, said, **at, font=font, yshift=14))
    return shapes, words


def _estimates(view: View, kind: Kind) -> tuple[list[Chart], Chart]:
    middle, spread, bound = (view[name] * kind.scale for name in (kind.name, kind.sd, kind.bound))
    if kind.is_angle:
        middle = unwrapped(middle)
    shown = _point(view, kind)
    low, high = middle - 2 * spread, middle + 2 * spread
    if kind is RANGE:  # before the bearings tell it, its law is far from normal
        low, high = (
            np.where(shown, end, view[f"range_{name}_m"] * kind.scale)
            for end, name in ((low, "low"), (high, "high"))
        )
        low = np.maximum(low, 0.0)
    point = np.where(shown, middle, np.nan)
    told = [f"{kind.stem} %{{y:.5~g}} {kind.unit}", "%{x:,.7~g} s<extra></extra>"]
    drawn = line(view.time, point, charts.BLUE)
    ends = [point - 2 * bound, point + 2 * bound]
    return [
        *band(view.time, low, high, "two sd"),
        *(_dashed(view.time, each) for each in ends),
        drawn | {"hovertemplate": "<br>".join(told)},
    ], _value_axis(kind, low, high, point)


def _point(view: View, kind: Kind) -> NDArray[np.bool_]:
    """(kept,) whether there is an estimate to be drawn as one."""
    told = view.told | (kind.stem == "bearing")
    return np.asarray(told & (not (view.open_sides and kind.stem == "course")))


def _dashed(x: Floats, y: Floats) -> Chart:
    style = {"color": charts.ORANGE, "width": 1.2, "dash": "dash"}
    return line(x, y, charts.ORANGE, hoverinfo="skip", line=style)


def _value_axis(kind: Kind, low: Floats, high: Floats, point: Floats) -> Chart:
    """Return an axis that shows the estimates whole, and of wide beliefs what has room."""
    axis = charts.axis(f"{kind.stem}, {kind.unit}", nticks=6)
    ends = _ends(low, high, point)
    if ends is None:
        return axis
    bottom, top = ends
    if kind.is_angle:
        middle, half = (bottom + top) / 2, (top - bottom) / 2
        half = min(half, WIDEST_DEG)
        bottom, top = middle - half, middle + half
        return axis | {"range": [bottom, top], **_turned(bottom, top)}
    margin = 0.04 * (top - bottom) + 1e-6
    bottom = 0.0 if bottom < top / 2.0 else bottom  # a distance is judged from nothing
    return axis | {"range": [max(bottom - margin, 0.0), top + margin]}


def _ends(low: Floats, high: Floats, point: Floats) -> tuple[float, float] | None:
    known = np.isfinite(point)
    if known.sum() > 1:
        spread = np.quantile((high - low)[known & np.isfinite(high)], 0.9)
        return float(point[known].min() - spread), float(point[known].max() + spread)
    known = np.isfinite(low) & np.isfinite(high)
    if not known.any():
        return None
    return float(low[known].min()), float(np.quantile(high[known], 0.9))


def _turned(bottom: float, top: float) -> Chart:
    """Return ticks of an angle's axis that read 0 to 360."""
    step = next(
        (each for each in (0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30) if (top - bottom) / each <= 6), 90
    )
    ticks = np.arange(np.ceil(bottom / step), np.floor(top / step) + 1) * step
    form = "03.0f" if step >= 1 else "05.1f"
    return {
        "tickvals": floats(ticks),
        "ticktext": [f"{each % 360:{form}}" for each in np.round(ticks, 6)],
    }


def _spreads(view: View, kind: Kind) -> tuple[list[Chart], Chart]:
    own, bound = (view[name] * kind.scale for name in (kind.sd, kind.bound))
    limit = allowed(view, kind) * kind.scale
    own, bound, limit = (np.where(each > 0, each, np.nan) for each in (own, bound, limit))
    hover = {"hovertemplate": f"sd %{{y:.3~g}} {kind.unit}<br>%{{x:,.7~g}} s<extra></extra>"}
    dotted = {"color": charts.GREEN, "width": 1.8, "dash": "dot"}
    traces = [
        line(view.time, own, charts.BLUE) | hover,
        _dashed(view.time, bound),
        line(view.time, limit, charts.GREEN, hoverinfo="skip", line=dotted),
    ]
    return traces, charts.axis(f"{kind.stem} sd, {kind.unit}", type="log") | _decades(own, limit)


def _decades(*values: Floats) -> Chart:
    """Return range and ticks of a logarithmic axis: decades, or 1, 2 and 5 where it is short."""
    every = np.concatenate(values)
    every = every[np.isfinite(every)]
    if not len(every):
        return {}
    low, high = np.log10(every.min()) - 0.12, np.log10(every.max()) + 0.12
    steps = np.log10([1, 2, 5] if high - low < SHORT else [1])
    ticks = np.add.outer(np.arange(np.floor(low), np.ceil(high)), steps).ravel()
    ticks = 10 ** ticks[(ticks >= low) & (ticks <= high)]
    labels = [f"{each:.6g}" for each in ticks]
    return {"range": [float(low), float(high)], "tickvals": floats(ticks), "ticktext": labels}
