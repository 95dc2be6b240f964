"""The geographic picture of one contact: North up, equal scales, own ship and what it heard."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import Floats, Panel
from boresight.interfaces.report.tma_view import View, dots, floats, line, thinned

if TYPE_CHECKING:
    from boresight.target_motion.result import Quantity

CAPTION = (
    "North up, equal scales. Own ship's track with its direction, and some of the bearings as "
    "heard, thin. Along the last bearing, thick to thin: where the range lies with 50, 90 and 99 %."
)
TOLD = " Blue: the track since the bearings tell the range, with ellipses of two sd."
BATCH = " Dashed: the straight track that fits all bearings best."
SIDES = " Both sides of the array are drawn: it hears a cone."
CELLS = (
    " Thin, ending in a ring: tracks that fit the bearings, one of each cell that is left, with a "
    "larger ring for more weight."
)
FITTING = "tracks that fit"
LINES, ARROWS, ELLIPSES = 14, 9, 6
TWO_SD = 2.0
WIDTHS = {"99": 4, "90": 9, "50": 15}
FADE = {"99": 0.45, "90": 0.45, "50": 0.6}
SIDE_RGB = {"starboard": "213,94,0", "port": "138,79,125"}
CELL_RGB = {0: "0,114,178", 1: "213,94,0", -1: "138,79,125"}
WEIGHTLESS = 1e-2  # a cell that holds less is left out
TICKS = 9  # at most, along the longer axis


def panel(view: View) -> Panel:
    """Draw the picture of one contact."""
    data = [*_bearings(view), *_cells(view), *_batch(view), *_target(view), *_regions(view)]
    data += _own_ship(view)
    step = _step(view)
    axes = {"xaxis": charts.axis("East, km", dtick=step)}
    axes |= {"yaxis": charts.axis("North, km", scaleanchor="x", dtick=step)}
    layout = charts.layout(**axes, showlegend=True, dragmode="pan")
    alt = f"map of own ship, bearings and estimated track of contact {view.title}"
    return Panel(f"{view.stem}picture-chart", {"data": data, "layout": layout}, alt)


def caption(view: View) -> str:
    """Say what the picture shows of this contact."""
    said = [CAPTION, TOLD if _known(view).any() else ""]
    said += [BATCH if _has_batch(view) else "", SIDES if view.open_sides else ""]
    return "".join([*said, CELLS if len(_left(view)) else ""])


def _known(view: View) -> NDArray[np.bool_]:
    """(kept,) whether the target's place can be drawn as a point."""
    return np.asarray(view.told & np.isfinite(view["north_m"]) & (not view.open_sides))


def _own(view: View) -> tuple[Floats, Floats]:
    return view["own_east_m"] / 1e3, view["own_north_m"] / 1e3


def _own_ship(view: View) -> list[Chart]:
    east, north = _own(view)
    track = line(east, north, charts.INK, name="own ship", hoverinfo="skip")
    velocity = np.asarray(view.motion.contact.velocity_mps)[view.kept]
    at = thinned(len(east), ARROWS)
    at = at[np.hypot(*velocity[at].T) > 0.0]
    heading = np.degrees(np.arctan2(velocity[at, 1], velocity[at, 0])) % 360
    arrows = dots(east[at], north[at], charts.INK, symbol="arrow", size=11, angle=floats(heading))
    time = floats(view.time[at])
    hover = "own ship at %{customdata:,.7~g} s, course %{text}°<extra></extra>"
    arrows |= {"customdata": time, "text": [f"{each:03.0f}" for each in heading]}
    return [track, arrows | {"hovertemplate": hover}]


def _bearings(view: View) -> Iterator[Chart]:
    """Draw some of the bearings as heard, to the track or as far as the range may be."""
    (east, north), (far_east, far_north) = _own(view), _far(view)
    known = np.flatnonzero(np.isfinite(far_east).any(axis=0))
    if not len(known):
        return
    at = known[thinned(len(known), LINES)]
    far_east, far_north = far_east[:, at], far_north[:, at]
    gap = np.full_like(far_east, np.nan)
    near_east, near_north = (np.broadcast_to(each[at], gap.shape) for each in (east, north))
    x = np.stack([near_east, far_east, gap], -1).ravel()
    y = np.stack([near_north, far_north, gap], -1).ravel()
    style = {"line": {"color": "rgba(91,102,117,0.38)", "width": 1}, "hoverinfo": "skip"}
    yield line(x, y, charts.GRID, name="bearings") | style


def _far(view: View) -> tuple[Floats, Floats]:
    """(1 or 2, kept) where bearings are drawn to, km: a cone has two until a side is decided."""
    heard = sides_heard(view)
    if view.motion.sides and view.motion.decided:
        heard = heard[[int(view.motion.sides[0].name == "port")]]
    (east, north), angle = _own(view), np.radians(heard)
    away = np.full(len(east), _reach(view) / 1e3)
    if _has_batch(view):
        track = _batch_track(view)
        away = 1.04 * np.hypot(track[0] - east, track[1] - north)
    return east + away * np.sin(angle), north + away * np.cos(angle)


def _step(view: View) -> float:
    """Distance between the lines of the grid, km: the same on both axes, 1, 2 or 5 of a power."""
    drawn = zip(_own(view), _far(view), strict=True)
    spans = [np.ptp(each[np.isfinite(each)]) for each in (np.append(*both) for both in drawn)]
    rough = max(*spans, 1e-3) / TICKS
    power = 10.0 ** np.floor(np.log10(rough))
    return float(power * next(each for each in (1, 2, 5, 10) if each * power >= rough))


def sides_heard(view: View) -> Floats:
    """(1 or 2, kept) true bearings that were heard, degrees; a cone's to starboard and to port."""
    contact = view.motion.contact
    true: Floats = np.asarray(contact.bearing_rad)[view.kept]
    if not contact.is_conical:
        return np.asarray(np.degrees(true)[None])
    axis, cone = (np.asarray(each)[view.kept] for each in (contact.axis_rad, contact.cone_rad))
    both = [np.where(np.isfinite(true), true, axis + sign * cone) for sign in (1, -1)]
    return np.asarray(np.degrees(np.stack(both)))


def _reach(view: View) -> float:
    """How far out bearings are drawn, m: to the far end of the 90 % region."""
    quantities = [view.motion.range_m, *(side.range_m for side in view.motion.sides)]
    ends = [high for each in quantities for _, high in each.regions.get("90", ())]
    ends += [each.estimate + 2 * (each.sd or 0.0) for each in quantities if each.estimate]
    told = view["range_m"][_known(view)]
    ends += [float(np.nanmax(told))] if len(told) else []
    ends = ends or [float(np.max(view.motion.cells.range_m))]
    return 1.04 * max((end for end in ends if np.isfinite(end)), default=10e3)


def _left(view: View) -> NDArray[np.intp]:
    """Return the cells that are still possible, while the bearings do not tell which is right."""
    cells, motion = view.motion.cells, view.motion
    if len(cells.range_m) < 2 or (motion.observable and not view.open_sides):
        return np.empty(0, dtype=np.intp)
    heavy = np.asarray(cells.weights)[-1] > WEIGHTLESS
    return np.flatnonzero(heavy & np.isfinite(cells.mean).all(axis=-1))


def _cells(view: View) -> Iterator[Chart]:
    """Draw the straight track of each cell that is left: all of them fit what was heard."""
    left, side = _left(view), np.asarray(view.motion.cells.side)
    for place, each in enumerate(np.unique(side[left])):
        tracks, rings = _tracks(view, left[side[left] == each], CELL_RGB[int(each)])
        yield tracks | {"showlegend": place == 0}
        yield rings


def _tracks(view: View, at: NDArray[np.intp], rgb: str) -> tuple[Chart, Chart]:
    """Draw tracks back to the first bearing, and rings where they end."""
    cells, back = view.motion.cells, float(view.time[-1] - view.time[0])
    mean, weight = np.asarray(cells.mean)[at] / 1e3, np.asarray(cells.weights)[-1, at]
    now, then = mean[:, :2], mean[:, :2] - back * mean[:, 2:]
    north, east = np.stack([then, now, np.nan * now], axis=1).reshape(-1, 2).T
    style = {"line": {"color": f"rgba({rgb},0.5)", "width": 1}, "hoverinfo": "skip"}
    tracks = line(east, north, charts.BLUE, name=FITTING) | style
    size = floats(4.0 + 14.0 * np.sqrt(weight))
    hollow: dict[str, Any] = {"symbol": "circle-open", "line": {"width": 1.4}}
    rings = dots(now[:, 1], now[:, 0], f"rgb({rgb})", size=size, **hollow)
    rows = list(zip(floats(np.asarray(cells.range_m)[at] / 1e3), floats(weight), strict=True))
    hover = "began at %{customdata[0]:.3g} km, weight %{customdata[1]:.2g}<extra></extra>"
    return tracks, rings | {"customdata": rows, "hovertemplate": hover}


def _regions(view: View) -> Iterator[Chart]:
    """Draw the regions of range along the last bearing; of each side while both are possible."""
    motion = view.motion
    if view.open_sides:
        for side in motion.sides:
            name = f"{side.name}, {100 * side.probability:.0f} %"
            yield from _region(view, side.bearing_deg, side.range_m, SIDE_RGB[side.name], name)
        return
    name = "where it may be now"
    yield from _region(view, motion.bearing_deg, motion.range_m, SIDE_RGB["starboard"], name)


def _region(
    view: View, bearing: "Quantity", away: "Quantity", rgb: str, name: str
) -> Iterator[Chart]:
    if bearing.estimate is None:
        return
    angle = np.radians(bearing.estimate)
    east, north = (each[-1] for each in _own(view))
    for level, width in WIDTHS.items():
        ends = np.array(
            [each for low, high in away.regions.get(level, ()) for each in (low, high, np.nan)]
        )
        if not len(ends):
            continue
        style = {"color": f"rgba({rgb},{FADE[level]})", "width": width}
        ends = ends / 1e3
        x, y = east + ends * np.sin(angle), north + ends * np.cos(angle)
        trace = line(x, y, charts.ORANGE, name=name, showlegend=level == "90")
        hover = f"{name}: {level} % region<extra></extra>"
        yield trace | {"line": style, "hovertemplate": hover, "legendgroup": name}


def _has_batch(view: View) -> bool:
    return view.motion.batch is not None and view.motion.observable and not view.open_sides


def _batch(view: View) -> Iterator[Chart]:
    if not _has_batch(view):
        return
    style = {"color": charts.GREEN, "width": 1.6, "dash": "dash"}
    east, north = _batch_track(view)
    yield line(east, north, charts.GREEN, name="batch estimate", line=style, hoverinfo="skip")


def _batch_track(view: View) -> tuple[Floats, Floats]:
    """(kept,) East and North of the batch estimate, km."""
    batch = view.motion.batch
    assert batch is not None  # noqa: S101 - `_has_batch` was asked
    back = view.time[-1] - view.time
    north, east = ((batch.mean[i] - back * batch.mean[i + 2]) / 1e3 for i in (0, 1))
    return east, north


def _target(view: View) -> Iterator[Chart]:
    known = _known(view)
    if not known.any():
        return
    east, north = (np.where(known, view[f"{each}_m"], np.nan) / 1e3 for each in ("east", "north"))
    hover = "%{customdata:,.7~g} s: %{x:.2f} km E, %{y:.2f} km N<extra></extra>"
    trace = line(east, north, charts.BLUE, name="target")
    yield trace | {"customdata": floats(view.time), "hovertemplate": hover}
    yield _ellipses(view, known)


def _ellipses(view: View, known: NDArray[np.bool_]) -> Chart:
    """Draw ellipses of two sd: at the end the whole covariance's, before it along and across."""
    at = np.flatnonzero(known)
    at = at[thinned(len(at), ELLIPSES)]
    turn = np.linspace(0.0, 2 * np.pi, 41)
    circle = np.append(np.stack([np.cos(turn), np.sin(turn)]), np.full((2, 1), np.nan), axis=1)
    root = [_root(view, step) for step in at]
    centre = np.stack([view["north_m"][at], view["east_m"][at]], 1)
    north, east = np.moveaxis(TWO_SD * np.stack(root) @ circle + centre[:, :, None], 1, 0) / 1e3
    style = {"color": charts.BLUE, "width": 1}
    fill = {"fill": "toself", "fillcolor": "rgba(0,114,178,0.12)", "hoverinfo": "skip"}
    trace = line(east.ravel(), north.ravel(), charts.BLUE, name="two sd", line=style)
    return trace | fill


def _root(view: View, step: np.intp) -> Floats:
    """(2, 2) a square root of the position's covariance, m: North and East."""
    if step == len(view.kept) - 1:
        values, vectors = np.linalg.eigh(np.asarray(view.motion.cov, dtype=float)[:2, :2])
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
    angle, away = np.radians(view["bearing_deg"][step]), view["range_m"][step]
    along, across = view["range_sd_m"][step], away * np.radians(view["bearing_sd_deg"][step])
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c * along, -s * across], [s * along, c * across]])
