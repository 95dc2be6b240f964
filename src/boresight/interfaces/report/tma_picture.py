"""The geographic picture of one contact: North up, equal scales, own ship and what it heard."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

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
CELLS = " Rings on the first bearing: where the cells that are left began, larger for more weight."
LINES, ARROWS, ELLIPSES = 14, 9, 6
TWO_SD = 2.0
WIDTHS = {"99": 4, "90": 9, "50": 15}
FADE = {"99": 0.45, "90": 0.45, "50": 0.6}
SIDE_RGB = {"starboard": "213,94,0", "port": "138,79,125"}
WEIGHTLESS = 1e-3  # a cell that holds less is left out


def panel(view: View) -> Panel:
    """Draw the picture of one contact."""
    data = [*_bearings(view), *_cells(view), *_batch(view), *_target(view), *_regions(view)]
    data += _own_ship(view)
    axes = {"xaxis": charts.axis("East, km")}
    axes |= {"yaxis": charts.axis("North, km", scaleanchor="x")}
    layout = charts.layout(**axes, showlegend=True, dragmode="pan")
    alt = f"map of own ship, bearings and estimated track of contact {view.title}"
    return Panel(f"{view.stem}picture-chart", {"data": data, "layout": layout}, alt)


def caption(view: View) -> str:
    """Say what the picture shows of this contact."""
    motion = view.motion
    said = [CAPTION, TOLD if _known(view).any() else ""]
    said += [BATCH if _has_batch(view) else "", SIDES if view.open_sides else ""]
    return "".join([*said, CELLS if len(motion.cells.range_m) > 1 else ""])


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
    """Draw some of the bearings as heard, as far as the range may be; a cone has two."""
    heard = sides_heard(view)
    known = np.flatnonzero(np.isfinite(heard).any(axis=0))
    if not len(known):
        return
    at = known[thinned(len(known), LINES)]
    reach = _reach(view) / 1e3
    angle = np.radians(heard[:, at].ravel())
    east, north = (np.tile(each[at], len(heard)) for each in _own(view))
    gap = np.full_like(angle, np.nan)
    x = np.stack([east, east + reach * np.sin(angle), gap], 1).ravel()
    y = np.stack([north, north + reach * np.cos(angle), gap], 1).ravel()
    style = {"line": {"color": "rgba(91,102,117,0.38)", "width": 1}, "hoverinfo": "skip"}
    yield line(x, y, charts.GRID, name="bearings") | style


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


def _cells(view: View) -> Iterator[Chart]:
    """Mark where the bank's cells began, on the first bearing, by what they weigh now."""
    cells, heard = view.motion.cells, sides_heard(view)
    first = np.flatnonzero(np.isfinite(heard[0]))
    if len(cells.range_m) < 2 or not len(first):
        return
    weight = np.asarray(cells.weights)[-1]
    weight = np.where(weight > WEIGHTLESS, weight, np.nan)
    side = np.where(np.asarray(cells.side) < 0, len(heard) - 1, 0)
    angle = np.radians(heard[side, first[0]])
    east, north = (each[first[0]] for each in _own(view))
    away = np.where(np.isfinite(weight), cells.range_m, np.nan) / 1e3
    x, y = east + away * np.sin(angle), north + away * np.cos(angle)
    size = 4 + 14 * np.sqrt(np.clip(weight, 0, 1))
    style = {"symbol": "circle-open", "line": {"width": 1.4}}
    trace = dots(x, y, charts.MUTED, size=floats(np.nan_to_num(size)), opacity=0.8, **style)
    hover = "cell at %{customdata[0]:.2f} km, weight %{customdata[1]:.2g}<extra></extra>"
    rows = list(zip(floats(away), floats(weight), strict=True))
    yield trace | {"customdata": rows, "hovertemplate": hover, "name": "cells' first ranges"}


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
    batch = view.motion.batch
    assert batch is not None  # noqa: S101 - asked a line above
    back = view.time[-1] - view.time
    north, east = (batch.mean[i] / 1e3 - back * batch.mean[i + 2] / 1e3 for i in (0, 1))
    style = {"color": charts.GREEN, "width": 1.6, "dash": "dash"}
    yield line(east, north, charts.GREEN, name="batch estimate", line=style, hoverinfo="skip")


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
