"""The law of the residuals that are left: histogram beside the fitted law, and quantiles.

Each pair counts by how likely it is a measurement of its target at all: of such the law speaks.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.calibration_residuals import Channel, measured
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import Floats, Panel, column

if TYPE_CHECKING:
    import polars as pl

    from boresight.calibration.result import Calibration, Law

BINS, WIDEST_SDS = 81, 12.0
SHOWN_TAIL = 0.005  # a wide part that holds less is not drawn apart
POINTS, FARTHEST = 240, 3.9  # of a quantile plot; beyond so many sd lie 5 in 100,000
GRID_SDS, GRID = 12.0, 8001


class Left(NamedTuple):
    """What is left, ascending (n,), and which share of the pairs lies below the middle of each."""

    values: Floats
    weights: Floats
    share: Floats

    def sd(self) -> float:
        """Half the width of the middle 68.3 %."""
        low, high = np.interp([0.158655, 0.841345], self.share, self.values)
        return float(high - low) / 2


def panels(calibration: "Calibration") -> list[Panel]:
    """Draw two charts for each channel that has a fitted law."""
    frame, laws = calibration.residuals, calibration.noise.laws
    drawn = []
    for channel in measured(frame):
        law = laws.get(channel.name)
        if law is not None and law.sd > 0:
            rest = left(frame, channel)
            drawn += [_histogram(channel, rest, law), _quantiles(channel, rest, law)]
    return drawn


def left(frame: "pl.DataFrame", channel: Channel) -> Left:
    """Return the noise of single plots: residuals without what one target's plots share."""
    values = column(frame, channel.columns[1])
    if channel.stem == "range" and "delay_m" in frame.columns:
        values = values - np.nan_to_num(column(frame, "delay_m"))
    weights = np.ones(len(values))
    if "outlier" in frame.columns:
        weights = 1.0 - np.nan_to_num(column(frame, "outlier"))
    order = np.argsort(values)
    order = order[np.isfinite(values[order]) & (weights[order] > 0)]
    values, weights = values[order], weights[order]
    return Left(values, weights, (np.cumsum(weights) - weights / 2) / max(weights.sum(), 1e-9))


def _histogram(channel: Channel, rest: Left, law: "Law") -> Panel:
    sd = rest.sd() or law.sd
    ends = np.abs(np.interp([0.00025, 0.99975], rest.share, rest.values))
    reach = min(max(5 * sd, float(ends.max())), WIDEST_SDS * sd)
    bounds = np.linspace(-reach, reach, BINS + 1)
    counts, _ = np.histogram(rest.values, bounds, weights=rest.weights)
    centre, width = (bounds[1:] + bounds[:-1]) / 2, 2 * reach / BINS
    bars = {
        "type": "bar",
        "x": charts.typed(centre),
        "y": charts.typed(np.where(counts > 0, counts, np.nan)),
        "width": width,
        "marker": {"color": "#9cc4e2", "line": {"width": 0}},
        "hovertemplate": "%{y:,.0f} pairs at %{x:.3~g}<extra></extra>",
    }
    number = float(rest.weights.sum()) * width
    parts = [(1 - law.tail_share, law.sd), (law.tail_share, law.tail_sd)]
    curves = [number * share * _pdf(centre, one) for share, one in parts]
    data = [bars, _curve(centre, curves[0] + curves[1], charts.ORANGE, "solid")]
    if law.tail_share >= SHOWN_TAIL:
        data += [_curve(centre, each, charts.PURPLE, "dash") for each in curves]
    top = np.log10(max(counts.max(), 2) * 2.0)
    y = charts.axis("pairs", type="log", range=[np.log10(0.6), top], dtick=1)
    x = charts.axis(f"{channel.words} residual after, {channel.unit}", range=[-reach, reach])
    layout = charts.layout(xaxis=x, yaxis=y, bargap=0)
    alt = f"histogram of {channel.words} residuals with the fitted law"
    return Panel(f"noise-law-{channel.stem}", {"data": data, "layout": layout}, alt)


def _curve(x: Floats, y: Floats, color: str, dash: str) -> Chart:
    style = {"line": {"color": color, "width": 2 if dash == "solid" else 1.3, "dash": dash}}
    return charts.line(charts.typed(x), charts.short(y), color, hoverinfo="skip") | style


def _pdf(x: Floats, sd: float) -> Floats:
    return np.exp(-0.5 * (x / sd) ** 2) / (sd * np.sqrt(2 * np.pi)) if sd > 0 else 0.0 * x


def _quantiles(channel: Channel, rest: Left, law: "Law") -> Panel:
    """Draw measured quantiles over the law's; the band holds 95 % of each if the law is true."""
    from scipy.special import ndtri

    share, y = _chosen(rest)
    x = _law_quantile(law, share)
    low, high = (
        _law_quantile(law, each) for each in quantile_band(share, float(rest.weights.sum()))
    )
    packed = charts.short(x, 16)
    normal = charts.line(
        packed, charts.short(rest.sd() * ndtri(share)), charts.INK, hoverinfo="skip"
    ) | {"line": {"color": charts.INK, "width": 1.3, "dash": "dot"}}
    dots = {
        "type": "scatter",
        "mode": "markers",
        "x": packed,
        "y": charts.short(y, 16),
        "marker": {"size": 4.5, "color": charts.BLUE},
        "customdata": charts.typed(100 * share),
        "hovertemplate": "%{customdata:.2~f} % lie below %{y:.3~g}<extra></extra>",
    }
    same = charts.line(packed, packed, charts.ORANGE, hoverinfo="skip")
    data = [*charts.band(packed, charts.short(low, 16), charts.short(high, 16), "95 % band")]
    data += [normal, same, dots]
    ends = [1.05 * float(x[0]), 1.05 * float(x[-1])]
    tall = [float(np.clip(1.05 * y[0], 2 * ends[0], ends[0]))]
    tall += [float(np.clip(1.05 * y[-1], ends[1], 2 * ends[1]))]
    layout = charts.layout(
        xaxis=charts.axis(f"quantile of the fitted law, {channel.unit}", range=ends),
        yaxis=charts.axis(f"{channel.words} residual after, {channel.unit}", range=tall),
    )
    alt = f"quantiles of {channel.words} residuals over those of the fitted law"
    return Panel(f"noise-qq-{channel.stem}", {"data": data, "layout": layout}, alt)


def _chosen(rest: Left) -> tuple[Floats, Floats]:
    """Return shares and quantiles to draw: even on the normal law's axis, so tails get theirs."""
    from scipy.special import ndtr

    wanted = ndtr(np.linspace(-FARTHEST, FARTHEST, POINTS))
    last = len(rest.values) - 1
    chosen = np.unique(np.clip(np.searchsorted(rest.share, wanted), 0, last))
    chosen = np.unique(np.concatenate([[0], chosen, [last]]))
    least = 0.4 / rest.weights.sum()  # what lies farther out is less than half a measurement
    chosen = chosen[np.abs(rest.share[chosen] - 0.5) <= 0.5 - least]
    return rest.share[chosen], rest.values[chosen]


def quantile_band(share: Floats, number: float) -> list[Floats]:
    """Return between which shares of the law 95 % of such quantiles lie: a beta distribution."""
    from scipy.special import betaincinv

    below, above = number * share + 0.5, number * (1 - share) + 0.5
    return [np.asarray(betaincinv(below, above, end), dtype=float) for end in (0.025, 0.975)]


def _law_quantile(law: "Law", share: Floats) -> Floats:
    """Invert the distribution of the two-normal law, on a grid dense in its middle."""
    from scipy.special import ndtr

    widest = max(law.sd, law.tail_sd if law.tail_share > 0 else 0.0)
    grid = GRID_SDS * widest * np.linspace(-1.0, 1.0, GRID) ** 3
    below = (1 - law.tail_share) * ndtr(grid / law.sd)
    if law.tail_share > 0:
        below = below + law.tail_share * ndtr(grid / law.tail_sd)
    return np.interp(share, below, grid)
