"""The law of the residuals that are left: histogram beside the fitted law, and quantiles."""

from typing import TYPE_CHECKING

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.calibration_residuals import Channel, inliers, measured
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import Floats, Panel, column, robust_sd

if TYPE_CHECKING:
    import polars as pl

    from boresight.calibration.result import Calibration, Law

BINS, WIDEST_SDS = 81, 12.0
POINTS = 240  # of a quantile plot; half of them in the outer tenths
GRID_SDS, GRID = 12.0, 8001


def panels(calibration: "Calibration") -> list[Panel]:
    """Draw two charts for each channel that has a fitted law."""
    kept, laws = inliers(calibration.residuals), calibration.noise.laws
    drawn = []
    for channel in measured(kept):
        law = laws.get(channel.name)
        if law is not None and law.sd > 0:
            values = np.sort(left(kept, channel))
            drawn += [_histogram(channel, values, law), _quantiles(channel, values, law)]
    return drawn


def left(kept: "pl.DataFrame", channel: Channel) -> Floats:
    """Return the noise of single plots: residuals without what one target's plots share."""
    values = column(kept, channel.columns[1])
    if channel.stem == "range" and "delay_m" in kept.columns:
        values = values - np.nan_to_num(column(kept, "delay_m"))
    return values[np.isfinite(values)]


def _histogram(channel: Channel, values: Floats, law: "Law") -> Panel:
    sd = robust_sd(values) or law.sd
    reach = min(max(5 * sd, float(np.quantile(np.abs(values), 0.9995))), WIDEST_SDS * sd)
    bounds = np.linspace(-reach, reach, BINS + 1)
    counts, _ = np.histogram(values, bounds)
    centre, width = (bounds[1:] + bounds[:-1]) / 2, 2 * reach / BINS
    bars = {
        "type": "bar",
        "x": charts.typed(centre),
        "y": charts.typed(np.where(counts > 0, counts, np.nan)),
        "width": width,
        "marker": {"color": "#9cc4e2", "line": {"width": 0}},
        "hovertemplate": "%{y:,.0f} pairs at %{x:.3~g}<extra></extra>",
    }
    number = len(values) * width
    parts = [(1 - law.tail_share, law.sd), (law.tail_share, law.tail_sd)]
    curves = [number * share * _pdf(centre, one) for share, one in parts]
    data = [bars, _curve(centre, curves[0] + curves[1], charts.ORANGE, "solid")]
    if law.tail_share > 0:
        data += [_curve(centre, each, charts.PURPLE, "dash") for each in curves]
    top = np.log10(max(counts.max(), 2) * 2.0)
    y = charts.axis("pairs", type="log", range=[np.log10(0.6), top], dtick=1)
    x = charts.axis(f"{channel.words} residual after, {channel.unit}", range=[-reach, reach])
    layout = charts.layout(xaxis=x, yaxis=y, bargap=0)
    alt = f"histogram of {channel.words} residuals with the fitted law"
    return Panel(f"noise-law-{channel.stem}", {"data": data, "layout": layout}, alt)


def _curve(x: Floats, y: Floats, color: str, dash: str) -> Chart:
    style = {"color": color, "width": 2 if dash == "solid" else 1.3, "dash": dash}
    return charts.line(charts.typed(x), charts.short(y), color, hoverinfo="skip") | {"line": style}


def _pdf(x: Floats, sd: float) -> Floats:
    return np.exp(-0.5 * (x / sd) ** 2) / (sd * np.sqrt(2 * np.pi)) if sd > 0 else 0.0 * x


def _quantiles(channel: Channel, values: Floats, law: "Law") -> Panel:
    """Draw measured quantiles over the law's; the band holds 95 % of each if the law is true."""
    from scipy.special import betaincinv, ndtri

    number = len(values)
    rank = _ranks(number)
    share = (rank + 0.5) / number
    x = _law_quantile(law, share)
    low, high = (
        _law_quantile(law, np.asarray(betaincinv(rank + 1.0, number - rank, end), dtype=float))
        for end in (0.025, 0.975)
    )
    packed = charts.short(x, 16)
    normal = charts.line(
        packed,
        charts.short(robust_sd(values) * ndtri(share)),
        charts.MUTED,
        hoverinfo="skip",
    ) | {"line": {"color": charts.MUTED, "width": 1.3, "dash": "dot"}}
    dots = {
        "type": "scatter",
        "mode": "markers",
        "x": packed,
        "y": charts.short(values[rank], 16),
        "marker": {"size": 4.5, "color": charts.BLUE},
        "customdata": charts.typed(100 * share),
        "hovertemplate": "%{customdata:.2~f} % lie below %{y:.3~g}<extra></extra>",
    }
    same = charts.line(packed, packed, charts.ORANGE, hoverinfo="skip")
    data = [*charts.band(packed, charts.short(low, 16), charts.short(high, 16), "95 % band")]
    data += [normal, same, dots]
    unit = channel.unit
    ends = [1.05 * float(x[0]), 1.05 * float(x[-1])]
    tall = [min(ends[0], 1.05 * float(values[0])), max(ends[1], 1.05 * float(values[-1]))]
    layout = charts.layout(
        xaxis=charts.axis(f"quantile of the fitted law, {unit}", range=ends),
        yaxis=charts.axis(f"{channel.words} residual after, {unit}", range=tall),
    )
    alt = f"quantiles of {channel.words} residuals over those of the fitted law"
    return Panel(f"noise-qq-{channel.stem}", {"data": data, "layout": layout}, alt)


def _ranks(number: int) -> np.ndarray:
    """Return the ranks to draw: evenly over the normal law's own axis, so tails get theirs."""
    from scipy.special import ndtr

    most = 3.9  # beyond it lie 5 in 100,000
    share = ndtr(np.linspace(-most, most, POINTS))
    edge = np.array([0, number - 1])
    return np.unique(np.concatenate([edge, np.minimum((share * number).astype(int), number - 1)]))


def _law_quantile(law: "Law", share: Floats) -> Floats:
    """Invert the distribution of the two-normal law, on a grid dense in its middle."""
    from scipy.special import ndtr

    widest = max(law.sd, law.tail_sd if law.tail_share > 0 else 0.0)
    grid = GRID_SDS * widest * np.linspace(-1.0, 1.0, GRID) ** 3
    below = (1 - law.tail_share) * ndtr(grid / law.sd)
    if law.tail_share > 0:
        below = below + law.tail_share * ndtr(grid / law.tail_sd)
    return np.interp(share, below, grid)
