"""The plan view: plots, tracks and their covariance ellipses around the site."""

from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart

if TYPE_CHECKING:
    import polars as pl

    from boresight.tracking.result import TrackingResult

Floats: TypeAlias = NDArray[np.float64]

NAUTICAL_MILE_KM = 1.852
RING_STEPS_NM = (0.5, 1, 2, 5, 10, 20, 25, 50, 100)
MOST_POINTS = 40_000  # plots, and track points, that a browser still moves at once
HUGE = 0.06  # an ellipse with a longer half axis than this share of the view is left out
APART = 0.12  # of the view's half width: nearer names would lie on one another
LABELLED = 12  # more names than these hide the picture
CLASSES = (
    ("consistent", charts.BLUE, "circle"),
    ("too confident", charts.ORANGE, "triangle-up"),
    ("too cautious", charts.PURPLE, "triangle-down"),
)


class Plan(NamedTuple):
    """A chart and what its caption must admit."""

    chart: Chart
    caption: str


def classes(targets: "pl.DataFrame") -> NDArray[np.intp]:
    """Return (targets,) 0 in its 95 % band, 1 above it (too confident), 2 below it."""
    nis, low, high = (_floats(targets, name) for name in ("nis_per_dof", "nis_low", "nis_high"))
    return np.where(nis > high, 1, np.where(nis < low, 2, 0))


def plan(result: "TrackingResult") -> Plan:
    """Draw the plan view of a result, thinned to what a browser still moves at once."""
    tracks = result.tracks.sort("track", "time_s", maintain_order=True)
    if tracks.is_empty():
        return Plan({"data": [], "layout": charts.layout()}, "No track was formed.")
    east, north = _floats(tracks, "east_m") / 1e3, _floats(tracks, "north_m") / 1e3
    plots = _plot_positions(result.residuals, tracks)
    plot_step = _step(len(plots[0]))
    heads = tracks.group_by("track", maintain_order=True).last()
    extent = float(np.nanmax(np.hypot(east, north)))
    scale = _exaggeration(heads, extent)
    ellipses, left_out = _ellipses(heads, scale, extent)
    data = [
        _dots(plots[0][::plot_step], plots[1][::plot_step]),
        *_lines(tracks, result.targets),
        _rejected(plots, result.residuals),
        ellipses,
        *_heads(heads, result.targets),
        charts.line([], [], charts.INK, name="selected", showlegend=False, hoverinfo="skip")
        | {"line": {"color": charts.INK, "width": 3.5}},
    ]
    return Plan(
        {"data": data, "layout": _layout(east, north)}, _caption(scale, plot_step, tracks, left_out)
    )


def _floats(frame: "pl.DataFrame", name: str) -> Floats:
    return frame[name].cast(float).fill_null(float("nan")).to_numpy()


def _step(count: int) -> int:
    return -(-count // MOST_POINTS) or 1


def _plot_positions(residuals: "pl.DataFrame", tracks: "pl.DataFrame") -> tuple[Floats, Floats]:
    """Return east and north, km, of each plot; its track's height turns slant into ground range."""
    ups = tracks.select("track", "time_s", "up_m").unique(["track", "time_s"], keep="first")
    joined = residuals.join(ups, on=["track", "time_s"], how="left", maintain_order="left")
    slant, up = _floats(joined, "range_m"), np.nan_to_num(_floats(joined, "up_m"))
    ground = np.sqrt(np.maximum(slant**2 - up**2, 0.0)) / 1e3
    azimuth = np.deg2rad(_floats(joined, "azimuth_deg"))
    return ground * np.sin(azimuth), ground * np.cos(azimuth)


def _dots(east: Floats, north: Floats) -> Chart:
    return {
        "type": "scattergl",
        "mode": "markers",
        "name": "plots",
        "x": charts.short(east, 16),
        "y": charts.short(north, 16),
        "marker": {"size": 3, "color": "#8d9aab", "opacity": 0.55},
        "hoverinfo": "skip",
    }


def _lines(tracks: "pl.DataFrame", targets: "pl.DataFrame") -> list[Chart]:
    """One trace for each class of track, its tracks parted by gaps."""
    kinds = dict(zip(targets["track"].to_list(), classes(targets).tolist(), strict=True))
    step = _step(len(tracks))
    return [
        _line_group([track for track, kind in kinds.items() if kind == index], tracks, step)
        | {"name": name, "line": {"color": color, "width": 1.4}}
        for index, (name, color, _symbol) in enumerate(CLASSES)
    ]


def _line_group(wanted: list[int], tracks: "pl.DataFrame", step: int) -> Chart:
    import polars as pl

    mine = tracks.filter(pl.col("track").is_in(wanted))
    number = mine["track"].to_numpy()
    last = np.append(number[1:] != number[:-1], True)[: len(number)]
    keep = (np.arange(len(number)) % step == 0) | last
    at = np.flatnonzero(last[keep]) + 1
    east, north = (_floats(mine, name)[keep] / 1e3 for name in ("east_m", "north_m"))
    return {
        "type": "scattergl",
        "mode": "lines",
        "connectgaps": False,
        "x": charts.short(np.insert(east, at, np.nan), 16),
        "y": charts.short(np.insert(north, at, np.nan), 16),
        "customdata": charts.typed(np.insert(number[keep], at, 0), "i4"),
        "hovertemplate": "track %{customdata}<br>%{x:.1f} km E, %{y:.1f} km N<extra></extra>",
        "meta": "track",
    }


def _rejected(plots: tuple[Floats, Floats], residuals: "pl.DataFrame") -> Chart:
    outside = ~residuals["used"].to_numpy()
    return {
        "type": "scattergl",
        "mode": "markers",
        "name": f"outside the gate ({int(outside.sum()):,})",
        "x": charts.short(plots[0][outside], 16),
        "y": charts.short(plots[1][outside], 16),
        "customdata": charts.typed(residuals["track"].to_numpy()[outside], "i4"),
        "hovertemplate": "plot outside the gate of track %{customdata}<extra></extra>",
        "marker": {"size": 5, "color": charts.INK, "symbol": "x-thin-open", "line": {"width": 1}},
        "meta": "track",
    }


def _covariance(heads: "pl.DataFrame") -> Floats:
    """Return (tracks, 2, 2) the horizontal position covariance, km²."""
    a, b, c = (_floats(heads, f"cov_{name}") for name in ("0_0", "0_1", "1_1"))
    return np.stack([np.stack([a, b], -1), np.stack([b, c], -1)], -2) / 1e6


def _exaggeration(heads: "pl.DataFrame", extent_km: float) -> int:
    """Return the factor that makes the median 95 % ellipse about 1.5 % of the view."""
    major = 2.448 * np.sqrt(np.nanmedian(np.trace(_covariance(heads), axis1=1, axis2=2)))
    wanted = 0.015 * extent_km / major if major > 0 else 1.0
    return max((step for step in (1, 2, 5, 10, 20, 50) if step <= wanted), default=1)


def _ellipses(heads: "pl.DataFrame", scale: int, extent_km: float) -> tuple[Chart, int]:
    """Draw 95 % ellipses (2.448 sd in two dimensions) at the last point of each track.

    Those of tracks that have only just begun would cover the view: they are counted instead.
    """
    angle = np.linspace(0, 2 * np.pi, 33)
    circle = np.append(np.stack([np.cos(angle), np.sin(angle)]), np.full((2, 1), np.nan), axis=1)
    values, vectors = np.linalg.eigh(np.nan_to_num(_covariance(heads)))
    axes = vectors * (2.448 * scale * np.sqrt(np.maximum(values, 0.0)))[:, None, :]
    is_huge = np.max(np.abs(axes), axis=(1, 2)) > HUGE * extent_km
    axes[is_huge] = np.nan
    centre = np.stack([_floats(heads, "east_m"), _floats(heads, "north_m")], -1) / 1e3
    x, y = np.moveaxis(axes @ circle + centre[:, :, None], 1, 0)
    name = "95 % ellipse" + (f" × {scale}" if scale > 1 else "")
    style = {"line": {"color": charts.INK, "width": 1}, "type": "scattergl", "hoverinfo": "skip"}
    packed = charts.short(x.ravel(), 16), charts.short(y.ravel(), 16)
    trace = charts.line(*packed, charts.INK, name=name, connectgaps=False) | style
    return trace, int(is_huge.sum())


def _heads(heads: "pl.DataFrame", targets: "pl.DataFrame") -> list[Chart]:
    """Mark where each track was last, in its class's colour and shape; name the worst."""
    order = {track: index for index, track in enumerate(heads["track"].to_list())}
    named = _named(heads, [order.get(track) for track in targets["track"].to_list()])
    kinds, charts_out = classes(targets), []
    rows = targets.to_dicts()
    for index, (name, color, symbol) in enumerate(CLASSES):
        mine = [rank for rank in np.flatnonzero(kinds == index) if rows[rank]["track"] in order]
        at = [order[rows[rank]["track"]] for rank in mine]
        names = [escape(title(rows[rank])) if rank in named else "" for rank in mine]
        trace = {
            "type": "scatter",
            "mode": "markers+text",
            "name": name,
            "showlegend": False,
            "x": charts.short(_floats(heads, "east_m")[at] / 1e3, 16),
            "y": charts.short(_floats(heads, "north_m")[at] / 1e3, 16),
            "text": names,
            "textposition": "top center",
            "textfont": {"size": 10.5, "color": charts.INK},
            "customdata": [rows[rank]["track"] for rank in mine],
            "hovertext": [escape(describe(rows[rank])) for rank in mine],
            "hovertemplate": "%{hovertext}<extra></extra>",
            "marker": {"size": 6, "color": color, "symbol": symbol, "line": {"width": 0}},
            "meta": "track",
        }
        charts_out.append(trace)
    return charts_out


def _named(heads: "pl.DataFrame", order: list[int | None]) -> set[int]:
    """Return the ranks of the worst targets whose names do not lie on one another."""
    places = np.stack([_floats(heads, "east_m"), _floats(heads, "north_m")], -1)
    apart = APART * float(np.nanmax(np.abs(places), initial=1.0))
    taken: dict[int, Floats] = {}
    for rank, index in enumerate(order):
        if index is None or len(taken) == LABELLED:
            continue
        here = places[index]
        if all(np.hypot(*(here - there)) > apart for there in taken.values()):
            taken[rank] = here
    return set(taken)


def title(row: dict[str, Any]) -> str:
    """Name a target by the best name it has."""
    return row["aircraft_id"] or row["address"] or row["mode_a"] or f"track {row['track']}"


def describe(row: dict[str, Any]) -> str:
    """Say in a line what a target is and how it fits."""
    return (
        f"{title(row)} (track {row['track']}): NIS {row['nis_per_dof'] or float('nan'):.2f}"
        f" per degree of freedom, {row['used']:,} of {row['plots']:,} plots"
    )


def _layout(east: Floats, north: Floats) -> Chart:
    reach = 1.06 * float(np.nanmax(np.abs(np.concatenate([east, north, [0.1]]))))
    furthest = float(np.nanmax(np.hypot(east, north))) / NAUTICAL_MILE_KM
    step = next((step for step in RING_STEPS_NM if furthest / step <= 5), 100)
    radii = np.arange(1, furthest / step + 1) * step
    across = {"range": [-reach, reach], "constrain": "domain", "showgrid": False}
    return charts.layout(
        xaxis=charts.axis("east of the site, km", **across),
        yaxis=charts.axis("north of the site, km", scaleanchor="x", **across),
        shapes=[_ring(radius) for radius in radii] + _site(reach),
        annotations=[_ring_name(radius) for radius in radii],
        showlegend=True,
        dragmode="pan",
    )


def _ring(radius_nm: float) -> Chart:
    km = radius_nm * NAUTICAL_MILE_KM
    edge = {"color": "#c6ced8", "width": 1}
    box = {"x0": -km, "x1": km, "y0": -km, "y1": km}
    return {"type": "circle", "layer": "below", "line": edge} | box


def _site(reach: float) -> list[Chart]:
    """Draw spokes at every 30 degrees and a cross at the site."""
    edge = {"color": "#e3e7ec", "width": 1}
    spokes = []
    for angle in np.deg2rad(np.arange(0, 180, 30)):
        x, y = 1.5 * reach * np.sin(angle), 1.5 * reach * np.cos(angle)
        ends = {"x0": -x, "y0": -y, "x1": x, "y1": y}
        spokes.append({"type": "line", "layer": "below", "line": edge} | ends)
    return spokes


def _ring_name(radius_nm: float) -> Chart:
    km = radius_nm * NAUTICAL_MILE_KM * np.sqrt(0.5)
    return {
        "x": km,
        "y": -km,
        "text": f"{radius_nm:g} NM",
        "showarrow": False,
        "font": {"size": 10, "color": charts.MUTED},
        "bgcolor": "rgba(255,255,255,0.8)",
    }


def _caption(scale: int, plot_step: int, tracks: "pl.DataFrame", left_out: int) -> str:
    said = ["Plots, tracks and, at the end of each track, the 95 % ellipse of its position"]
    said.append(f" drawn {scale} times its size." if scale > 1 else " at its true size.")
    if left_out:
        said.append(f" {left_out} that would cover the view are left out.")
    if plot_step > 1:
        said.append(f" One plot in {plot_step} is drawn.")
    if (step := _step(len(tracks))) > 1:
        said.append(f" Tracks are drawn through one point in {step}.")
    said.append(
        " Rings are ground range in nautical miles. Names mark the worst targets, where there is"
        " room. Choose a track to see its residuals."
    )
    return "".join(said)
