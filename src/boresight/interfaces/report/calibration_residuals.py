"""Residuals of a calibration against range, azimuth, time and height, before and after.

Before is measured minus reference; after, the systematic errors are taken out. Both are drawn to
one scale unless the errors dwarf the noise, so that a reader sees what the errors were.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import (
    AGAINST,
    FEWEST,
    MARGIN_SDS,
    NORMAL_95,
    Against,
    Centre,
    Floats,
    Panel,
    across,
    cells,
    centres,
    column,
    density,
    edges,
    median_line,
    robust_sd,
)

if TYPE_CHECKING:
    import polars as pl

SEEN_AGAINST = (AGAINST[1], AGAINST[2], AGAINST[0], Against("height_m", "height, km", 40, 1e-3))
BOTTOM_LEAST, GAP = 0.27, 0.05  # of the chart's height: the lower drawing, and between the two
EXTREME = 0.003
PAIRS_A_CELL, FEWEST_CELLS = 60, 12  # few pairs make few cells, whose medians say something
ROUND = (36, 24, 18, 12)  # cells of a circle
FEWEST_TARGETS = 3  # the interval of two is six times that of many


class Channel(NamedTuple):
    """A channel of the pairs: its stem, words and unit, and its unit as column names spell it."""

    stem: str
    words: str
    unit: str
    suffix: str

    @property
    def columns(self) -> tuple[str, str]:
        """The columns of its residuals, before and after."""
        return f"{self.stem}_before_{self.suffix}", f"{self.stem}_after_{self.suffix}"

    @property
    def name(self) -> str:
        """As the noise and its laws name it."""
        return f"{self.stem}_{self.suffix}"


CHANNELS = (
    Channel("range", "range", "m", "m"),
    Channel("azimuth", "azimuth", "°", "deg"),
    Channel("elevation", "elevation", "°", "deg"),
)


def measured(residuals: "pl.DataFrame") -> list[Channel]:
    """The channels that these pairs compare."""
    return [each for each in CHANNELS if _is_there(residuals, each)]


def _is_there(residuals: "pl.DataFrame", channel: Channel) -> bool:
    if not set(channel.columns) <= set(residuals.columns):
        return False
    return int(np.isfinite(column(residuals, channel.columns[1])).sum()) >= FEWEST


def inliers(residuals: "pl.DataFrame") -> "pl.DataFrame":
    """Return the pairs that are a measurement of their target, as likely as not."""
    if "outlier" not in residuals.columns:
        return residuals
    return residuals.filter(residuals["outlier"].fill_null(0.0) <= 0.5)


def panels(residuals: "pl.DataFrame") -> list[Panel]:
    """Draw each channel against range, azimuth, time and height; outliers left out."""
    if residuals.is_empty():  # of a calibration that was read from its file
        return []
    kept = inliers(residuals)
    against = [each for each in SEEN_AGAINST if each.column in kept.columns]
    target = kept["target"].rank("dense").to_numpy().astype(int) - 1
    return [
        _panel(kept, target, channel, each)
        for channel in measured(kept)
        for each in against
        if np.isfinite(column(kept, each.column)).sum() >= FEWEST
    ]


def _panel(
    kept: "pl.DataFrame", target: NDArray[np.intp], channel: Channel, against: Against
) -> Panel:
    before, after = (column(kept, name) for name in channel.columns)
    x = column(kept, against.column) * against.scale
    known = np.isfinite(x) & np.isfinite(before) & np.isfinite(after)
    x, before, after, target = x[known], before[known], after[known], target[known]
    bounds, reach = edges(x, _coarser(against, len(x))), _reach(before, after)
    cell = cells(x, bounds)
    data = []
    for place, values, ends in zip(("y", "y2"), (before, after), reach, strict=True):
        found = clustered(cell, target, values, len(bounds) - 1)
        drawn = (density(cell, values, bounds, ends), _line(bounds, found, channel))
        data += [trace | {"yaxis": place} for trace in drawn]
    layout = _layout(channel, against, bounds, reach)
    alt = f"{channel.words} residual against {against.words}, before and after the calibration"
    name = f"before-after-{channel.stem}-{against.column.split('_')[0]}"
    return Panel(name, {"data": data, "layout": layout}, alt)


def _coarser(against: Against, pairs: int) -> Against:
    most = min(max(pairs // PAIRS_A_CELL, FEWEST_CELLS), against.cells)
    if against.column == "azimuth_deg":
        most = next(each for each in ROUND if each <= most)
    return against._replace(cells=most)


def _reach(before: Floats, after: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ends of both axes: zero and nearly every residual are inside."""
    sd = robust_sd(after) or 1e-9
    margin = MARGIN_SDS * sd
    low, high = np.quantile(before, (EXTREME, 1 - EXTREME))
    ends = min(float(low) - sd, -margin), max(float(high) + sd, margin)
    return ends, (-margin, margin)


def _line(bounds: Floats, found: Centre, channel: Channel) -> Chart:
    return median_line((bounds[1:] + bounds[:-1]) / 2, found, channel.unit)


def clustered(
    cell: NDArray[np.intp], target: NDArray[np.intp], values: Floats, count: int
) -> Centre:
    """Return the cells' medians, the residuals of one target taken as alike.

    The variance of a median is that of the signs about it: summed by target, they need no
    independence within one. A cell of fewer than three targets has no interval.
    """
    from scipy.special import stdtrit

    found = centres(cell, values, count)
    sign = np.nan_to_num(np.sign(values - found.median[cell]))
    shape = (count, int(target.max(initial=0)) + 1)
    flat = cell * shape[1] + target
    sums = np.bincount(flat, sign, shape[0] * shape[1]).reshape(shape)
    held = np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape)
    clusters = np.count_nonzero(held, axis=1).astype(float)
    dof = np.where(clusters >= FEWEST_TARGETS, clusters - 1, np.nan)
    inflation = (sums**2).sum(axis=1) / np.maximum(found.number, 1) * clusters / dof
    return found._replace(error=found.error * np.sqrt(inflation) * stdtrit(dof, 0.975) / NORMAL_95)


def _layout(
    channel: Channel,
    against: Against,
    bounds: Floats,
    reach: tuple[tuple[float, float], tuple[float, float]],
) -> Chart:
    spans = [high - low for low, high in reach]
    bottom = max(spans[1] / sum(spans) * (1 - GAP), BOTTOM_LEAST)
    domains = ([bottom + GAP, 1.0], [0.0, bottom])
    layout = charts.layout(xaxis=across(against, bounds) | {"anchor": "y2"}, dragmode="zoom")
    for mark, words, ends, domain in zip(
        ("yaxis", "yaxis2"), ("before", "after"), reach, domains, strict=True
    ):
        title = f"{channel.words}, {channel.unit}" if words == "before" else ""
        layout[mark] = charts.axis(title, range=list(ends), domain=domain, nticks=6)
        layout[mark] |= {"zeroline": True, "zerolinecolor": charts.INK, "zerolinewidth": 1}
    layout["annotations"] = [
        _label(words, domain[1]) for words, domain in zip(("before", "after"), domains, strict=True)
    ]
    return layout


def _label(words: str, top: float) -> Chart:
    place = {"x": 0.01, "y": top - 0.01, "xref": "paper", "yref": "paper"}
    anchor = {"xanchor": "left", "yanchor": "top", "showarrow": False}
    return {"text": f"<b>{words}</b>", "bgcolor": "rgba(255,255,255,0.8)"} | place | anchor
