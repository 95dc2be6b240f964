"""Plots of one radar held against the paths of a reference, plot by plot."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration.interpolation import Paths
from boresight.calibration.matching import Matched, by_identity, by_position, scan
from boresight.calibration.references import Reference
from boresight.formats.usable import ANONYMOUS, column, unusable
from boresight.maths.frames import Site

if TYPE_CHECKING:
    import polars as pl

Array = Any
HEIGHTS = (
    "the reference's geometric height",
    "the plot's pressure altitude",
    "the reference's pressure altitude",
    "the height of the site, being on the ground",
)
_HIGHEST_M, _LOWEST_M = 30_000.0, -1_500.0  # pressure altitudes outside are garbled
_LOW = 0.26  # ground range over slant range, 75 degrees up: above it azimuth means little


@dataclass(frozen=True, kw_only=True, eq=False)
class Setting:
    """How plots are compared.

    Attributes:
        site: of the radar.
        how: "identity" or "position".
        gate_m: greatest distance of plot and target where matched by position.
    """

    site: Site
    how: str
    gate_m: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Compared:
    """Plots with their targets' places.

    Attributes:
        paths: of the reference.
        reason: (n,) why a plot is not compared, empty where it is.
        scan_s: of the radar.
        plot: (m,) rows of plots, ascending.
        row: (m,) report before each.
        time: (m,) of the plots.
        position, velocity: (m, 3) of the target, north, east, up at the radar.
        height: (m,) above the ellipsoid, m.
        source: (m,) which of `HEIGHTS` told it.
    """

    paths: Paths
    reason: Array
    scan_s: float
    plot: Array
    row: Array
    time: Array
    position: Array
    velocity: Array
    height: Array
    source: Array

    def take(self, which: Array) -> "Compared":
        """Some of the plots."""
        names = ("plot", "row", "time", "position", "velocity", "height", "source")
        return replace(self, **{name: getattr(self, name)[which] for name in names})


def compare(plots: "pl.DataFrame", reference: Reference, setting: Setting) -> Compared:
    """Match plots to targets and say where those were; what is not compared has its reason."""
    paths, reason = Paths.of(reference, setting.site), fit(plots)
    if setting.how == "position":
        reason[np.isin(reason, ANONYMOUS)] = ""
    scan_s = scan(plots, reason)
    if setting.how == "identity":
        matched = by_identity(plots, reference.table, paths, reason, scan_s)
    else:
        where = _as_seen(paths, setting.site)
        matched = by_position(plots, paths, where, reason, scan_s=scan_s, gate_m=setting.gate_m)
    time = column(plots, "time_s", np.nan)[matched.plot]
    height, source = _heights(plots, paths, matched, time, setting.site)
    position, velocity = paths.at(matched.row, time, height)
    reason[matched.plot[source < 0]] = "no height"
    slant, ground = np.linalg.norm(position, axis=1), np.hypot(position[:, 0], position[:, 1])
    overhead = (source >= 0) & (ground <= _LOW * slant)
    reason[matched.plot[overhead]] = "overhead"
    found = Compared(
        paths=paths,
        reason=reason,
        scan_s=scan_s,
        plot=matched.plot,
        row=matched.row,
        time=time,
        position=position,
        velocity=velocity,
        height=height,
        source=source,
    )
    return found.take((source >= 0) & ~overhead)


def fit(plots: "pl.DataFrame") -> Array:
    """(n,) first reason why each plot cannot be compared by identity; empty where it can."""
    import polars as pl

    reason = unusable(plots).astype(object)
    reason[~np.isfinite(column(plots, "time_s", np.nan))] = "no time"
    reason[(reason != "no position") & (column(plots, "range_m", np.nan) <= 0)] = "zero range"
    who = [n for n in ("address", "mode_a", "radar_track") if n in plots.columns]
    same = pl.struct("time_s", "range_m", "azimuth_deg", *who)
    again = ~plots.select(same.is_first_distinct()).to_series().to_numpy()
    reason[np.isin(reason, ("", *ANONYMOUS)) & again] = "repeated"
    return reason


def has_identity(plots: "pl.DataFrame", reference: Reference) -> bool:
    """Whether plots and reference both tell addresses, or both Mode A codes."""

    def told(name: str) -> bool:
        return name in plots.columns and bool(plots[name].count())

    return any(told(name) and reference.table[name].count() for name in ("address", "mode_a"))


def _as_seen(paths: Paths, site: Site) -> Array:
    """(n,) complex: slant range of each report at its azimuth, north + i east, m."""
    level: Array = np.where(np.isnan(paths.height), paths.pressure, paths.height)
    level = np.where(np.isnan(level), site.height_m, level)
    place = paths.ground + level[:, None] * paths.upward
    flat: Array = place[:, 0] + 1j * place[:, 1]
    return flat * (np.linalg.norm(place, axis=1) / np.maximum(np.abs(flat), 1e-3))


def _heights(
    plots: "pl.DataFrame", paths: Paths, matched: Matched, time: Array, site: Site
) -> tuple[Array, Array]:
    """Height of each target and which of `HEIGHTS` told it, the first that does; -1 if none."""
    altitude = column(plots, "pressure_altitude_m", np.nan)[matched.plot]
    valid = column(plots, "altitude_valid", True).astype(bool)[matched.plot]
    valid &= (altitude > _LOWEST_M) & (altitude < _HIGHEST_M)
    told = (
        paths.linear(paths.height, matched.row, time),
        np.where(valid, altitude, np.nan),
        paths.linear(paths.pressure, matched.row, time),
        np.where(paths.on_ground[matched.row], site.height_m, np.nan),
    )
    levels = np.stack(told)
    known = ~np.isnan(levels)
    source = np.where(known.any(axis=0), known.argmax(axis=0), -1)
    return np.choose(np.maximum(source, 0), levels), source
