"""A contact's history as its charts draw it: columns as floats, thinned, times on one axis."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from boresight.interfaces.report import charts
from boresight.interfaces.report.residuals import Floats, column

if TYPE_CHECKING:
    from boresight.target_motion.result import TargetMotion

MOST_STEPS = 900  # of one contact that are drawn; a screen has hardly more columns
SHADE = "rgba(213,94,0,0.07)"


@dataclass(frozen=True, eq=False)
class View:
    """One contact, ready to be drawn.

    Attributes:
        motion: the contact's answer.
        stem: what the names of its panels begin with.
    """

    motion: "TargetMotion"
    stem: str = ""

    @cached_property
    def kept(self) -> NDArray[np.intp]:
        """(kept,) the steps that are drawn: every n-th, and the last."""
        return thinned(self.motion.history.height)

    def __getitem__(self, name: str) -> Floats:
        """(kept,) a column of the history."""
        return column(self.motion.history, name)[self.kept]

    @cached_property
    def time(self) -> Floats:
        """(kept,) s of the file's clock."""
        return self["time_s"]

    @cached_property
    def told(self) -> NDArray[np.bool_]:
        """(kept,) whether bearings alone tell the range."""
        return np.asarray(self["observable"] == 1.0)

    @property
    def open_sides(self) -> bool:
        """Whether either side of the array is still possible."""
        return bool(self.motion.sides) and not self.motion.decided

    @property
    def title(self) -> str:
        """Name of the contact."""
        return self.motion.contact.name


def thinned(count: int, most: int = MOST_STEPS) -> NDArray[np.intp]:
    """Return at most about `most` of `count` places, evenly, the last among them."""
    step = -(-count // most) or 1
    return np.unique(np.append(np.arange(0, count, step), max(count - 1, 0)))[:count]


def stretches(is_so: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last index of each stretch of true values."""
    change = np.diff(np.concatenate([[0], is_so.astype(int), [0]]))
    return list(zip(np.flatnonzero(change == 1), np.flatnonzero(change == -1) - 1, strict=True))


def unwrapped(deg: Floats) -> Floats:
    """Return angles that run on past 360 degrees; gaps are stepped over."""
    out, known = deg.copy(), np.isfinite(deg)
    out[known] = np.unwrap(deg[known], period=360.0)
    return out


def line(x: Floats, y: Floats, color: str, **options: Any) -> charts.Chart:
    """A trace through points, broken at gaps; a position within 300 km keeps 2 m."""
    packed = charts.short(x, 16), charts.short(y, 16)
    return charts.line(*packed, color, connectgaps=False) | options


def band(x: Floats, low: Floats, high: Floats, name: str) -> list[charts.Chart]:
    """Shade between `low` and `high`, stretch by stretch: where one is unknown is no band."""
    found = []
    for first, last in stretches(np.isfinite(low) & np.isfinite(high)):
        along, below, above = (charts.short(each[first : last + 1], 16) for each in (x, low, high))
        found += charts.band(along, below, above, name)
    return found


def floats(values: Floats) -> list[float | None]:
    """Return numbers as JSON holds them; styles and hover texts take no typed arrays."""
    return [float(f"{each:.6g}") if np.isfinite(each) else None for each in values]


def dots(x: Floats, y: Floats, color: str, *, opacity: float = 1.0, **marker: Any) -> charts.Chart:
    """A trace of markers."""
    style = {"marker": {"color": color, **marker}, "opacity": opacity, "showlegend": False}
    return line(x, y, color, mode="markers") | style


def time_axis(**options: Any) -> charts.Chart:
    """The axis of time: seconds of the file's clock, written out."""
    return charts.axis("time, s", tickformat=",.7~g") | options


def text(x: Any, y: Any, words: str, **options: Any) -> dict[str, Any]:
    """A small note in a chart."""
    style = {"font": {"size": 11, "color": charts.MUTED}, "showarrow": False}
    return {"x": x, "y": y, "text": words, "bgcolor": "rgba(255,255,255,0.75)"} | style | options
