"""The bank's weights over time: which range, and which side, the bearings came to prefer."""

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.residuals import Panel
from boresight.interfaces.report.tma_history import TALL
from boresight.interfaces.report.tma_view import View, line, stretches, time_axis

CAPTION = (
    "How the weight of one is shared among the bank's cells, by the range from which each began"
    "{side}. A cell's own estimate moves on from there."
)
# Light for near, dark for far; a side of the array has its own hue.
SCALES = {0: ("#d7e8f4", "#08406e"), 1: ("#fbdcc5", "#a04000"), -1: ("#e7d6e3", "#5b2a4f")}
SIDES = {0: "", 1: " starboard", -1: " port"}


def panels(view: View) -> list[Panel]:
    """Draw the weights, if there are several."""
    cells = view.motion.cells
    if len(cells.range_m) < 2:
        return []
    weights = np.asarray(cells.weights)[view.kept]
    order = sorted(range(len(cells.range_m)), key=lambda i: (cells.side[i], cells.range_m[i]))
    data = [_area(view, cell, weights[:, cell]) for cell in order]
    x = time_axis(showgrid=False)
    y = charts.axis("weight", range=[0, 1], showgrid=False)
    layout = charts.layout(xaxis=x, yaxis=y, showlegend=True, hovermode="x unified")
    layout["legend"] = {"traceorder": "reversed", "x": 1.01, "y": 1, "font": {"size": 11}}
    layout["shapes"] = _told(view)
    alt = f"weights of the bank's cells over time for contact {view.title}"
    return [Panel(f"{view.stem}cells-chart", {"data": data, "layout": layout}, alt)]


def caption(view: View) -> str:
    """Say what the chart shows."""
    sides = " and the side of the array on which it is" if np.any(view.motion.cells.side) else ""
    return CAPTION.format(side=sides)


def _area(view: View, cell: int, weight: np.ndarray) -> charts.Chart:
    cells = view.motion.cells
    side = int(cells.side[cell])
    color = _shade(side, _rank(np.asarray(cells.range_m), cell))
    name = f"{cells.range_m[cell] / 1e3:.3g} km{SIDES[side]}"
    trace = line(view.time, np.nan_to_num(weight), color, name=name, stackgroup="cells")
    style = {"line": {"width": 0.4, "color": "#ffffff"}, "fillcolor": color}
    return trace | style | {"hovertemplate": "%{y:.1%}"}


def _rank(ranges: np.ndarray, cell: int) -> float:
    """Return where a cell's range lies among all, 0 nearest to 1."""
    every = np.unique(ranges)
    return float(np.searchsorted(every, ranges[cell])) / max(len(every) - 1, 1)


def _shade(side: int, share: float) -> str:
    ends = [[int(each[i : i + 2], 16) for i in (1, 3, 5)] for each in SCALES[side]]
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in zip(*ends, strict=True))


def _told(view: View) -> list[charts.Chart]:
    """Mark when the bearings began to tell the range."""
    starts = [float(view.time[first]) for first, _ in stretches(view.told)]
    style = {"color": charts.INK, "width": 1.2, "dash": "dot"}
    return [{"type": "line", "line": style, "x0": each, "x1": each} | TALL for each in starts]
