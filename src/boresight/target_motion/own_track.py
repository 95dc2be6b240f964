"""Own ship's track as a curve: where it was, or the array it tows, at any time it was logged.

Positions become a plane with x = North and y = East: metres as they are, latitude and longitude
through the Earth's centre to the plane that touches the Earth at own ship's first place. 50 km
from there distances are right to 0.6 m. North there is not the plane's: meridians converge, by
0.8 degrees at 50 km in latitude 60; directions are turned by that.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from boresight.errors import DataError
from boresight.maths.frames import Site, ecef_from_geodetic, enu_axes, enu_from_geodetic

if TYPE_CHECKING:
    import polars as pl

Array = Any
_GAP_STEPS, _GAP_S = 5.0, 10.0  # a gap is longer than so many usual steps, and than this
_UNSURE_M = 10.0  # what own ship may have strayed in a gap whose bearings are kept
_CHORD_M = 15.0  # the path's direction is that of a chord this far either way
_MANY = 200_000


class Place(NamedTuple):
    """Own ship, or its array, at some times: North and East (m), velocity, axis (rad)."""

    position_m: Array
    velocity_mps: Array
    axis_rad: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class OwnTrack:
    """Own ship's track; angles are from the plane's North.

    Attributes:
        time_s: (n,), increasing.
        position_m: (n, 2), North and East.
        velocity_mps: (n, 2), as logged; None where the log has none, or one that cannot be.
        site: place of the plane's origin; None where positions were given in metres.
        north_rad: (n,), direction of true North on the plane.
        angles: `heading` and `axis` (n,), as logged, from the plane's North; without jumps of a
            turn.
    """

    time_s: Array
    position_m: Array
    velocity_mps: Array | None
    site: Site | None
    north_rad: Array
    angles: dict[str, Array]

    @cached_property
    def path(self) -> "_Path":
        """The curve by its length."""
        return _path(self.curve, self.time_s)

    @cached_property
    def curve(self) -> Any:
        """Position over time: cubic, through the logged velocities or else shape-preserving."""
        from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

        if self.velocity_mps is None:
            return PchipInterpolator(self.time_s, self.position_m, axis=0)
        return CubicHermiteSpline(self.time_s, self.position_m, self.velocity_mps, axis=0)

    def at(self, time_s: Array, tow_m: float = 0.0) -> Place:
        """Own ship at times (m,); or what it tows that far astern along its own path.

        The axis is the logged one, else the heading, else the path's direction (NaN where own
        ship lies still). A towed array lies where the ship was, along the path there.
        """
        position, velocity = self.curve(time_s), self.curve.derivative()(time_s)
        there, along = self.path.astern(time_s, tow_m)
        if tow_m:
            speed = np.hypot(*velocity.T)[:, None]
            way = np.stack([np.cos(along), np.sin(along)], axis=-1)
            position, velocity = there, speed * np.nan_to_num(way)
        for name in ("axis",) if tow_m else ("axis", "heading"):
            if name in self.angles:
                return Place(position, velocity, self.direction(name, time_s))
        return Place(position, velocity, along)

    def direction(self, name: str, time_s: Array) -> Array:
        """(m,) a logged angle, between its two neighbours."""
        return np.interp(time_s, self.time_s, self.angles[name])

    def north(self, time_s: Array) -> Array:
        """(m,) direction of true North on the plane where own ship was."""
        return np.interp(time_s, self.time_s, self.north_rad)

    def unsure(self, time_s: Array) -> Array:
        """(m,) whether own ship may have strayed where a time falls into a gap of its log."""
        step = np.diff(self.time_s)
        is_gap = step > max(_GAP_STEPS * float(np.median(step)), _GAP_S)
        bad = np.zeros(len(step), bool)
        for i in np.flatnonzero(is_gap):
            bad[i] = self._stray(int(i)) > _UNSURE_M
        index = np.searchsorted(self.time_s, time_s, side="right") - 1
        logged = np.isin(time_s, self.time_s)
        return bad[np.clip(index, 0, len(step) - 1)] & ~logged

    def _stray(self, i: int) -> float:
        """How far off a straight line may be in gap i, by the velocities on either side."""
        t, p = self.time_s, self.position_m
        across = (p[i + 1] - p[i]) / (t[i + 1] - t[i])
        before, after = max(i - 10, 0), min(i + 11, len(t) - 1)
        sides = []
        if self.velocity_mps is not None:
            sides = [self.velocity_mps[i], self.velocity_mps[i + 1]]
        else:
            pairs = [(a, b) for a, b in ((before, i), (i + 1, after)) if b > a]
            sides = [(p[b] - p[a]) / (t[b] - t[a]) for a, b in pairs]
        worst = max((float(np.hypot(*(across - side))) for side in sides), default=np.inf)
        return worst * float(t[i + 1] - t[i]) / 4


class _Path(NamedTuple):
    """A path by its length: times, places and metres sailed, closely spaced."""

    time_s: Array
    position_m: Array
    sailed_m: Array

    def astern(self, time_s: Array, tow_m: float) -> tuple[Array, Array]:
        """Place (m, 2) and direction (m,) of the path, so many metres before those of the times."""
        sailed = np.interp(time_s, self.time_s, self.sailed_m) - tow_m
        half = max(_CHORD_M, 0.1 * tow_m)
        ahead = np.minimum(sailed + half, self.sailed_m[-1])
        chord = self._point(ahead) - self._point(ahead - 2 * half)
        still = np.hypot(*chord.T) < 1e-6
        along = np.where(still, np.nan, np.arctan2(chord[:, 1], chord[:, 0]))
        return self._point(sailed), along

    def _point(self, sailed_m: Array) -> Array:
        """(m, 2) the path's points; before its start, straight on astern."""
        inside = np.maximum(sailed_m, 0.0)
        point = np.stack([np.interp(inside, self.sailed_m, x) for x in self.position_m.T], axis=-1)
        first = int(np.searchsorted(self.sailed_m, min(_CHORD_M, self.sailed_m[-1])))
        start = self.position_m[first] - self.position_m[0]
        length = float(np.hypot(*start))
        way = start / length if length > 0 else start
        return point + np.minimum(sailed_m, 0.0)[:, None] * way


def _path(curve: Any, time_s: Array) -> _Path:
    """The path at its knots and, between them, at every second at least."""
    step = np.diff(time_s)
    parts = np.minimum(np.ceil(step), _MANY // len(time_s) + 1).astype(int)
    knot = np.repeat(np.arange(len(step)), parts)
    part = np.arange(len(knot)) - np.repeat(np.cumsum(parts) - parts, parts)
    dense = np.append(time_s[knot] + step[knot] * part / parts[knot], time_s[-1])
    position = curve(dense)
    steps = np.hypot(*np.diff(position, axis=0).T)
    return _Path(dense, position, np.concatenate([[0.0], np.cumsum(steps)]))


def own_track(table: "pl.DataFrame", clock_s: float, remarks: list[str]) -> OwnTrack:
    """The track of a checked table of own ship.

    Args:
        table: see `boresight.formats.own_ship`.
        clock_s: added to its times.
        remarks: gets what a reader should know.
    """
    time_s = table["time_s"].to_numpy() + clock_s
    position, north, site = _plane(table)
    turned = np.degrees(np.abs(np.unwrap(north) - north[0]).max())
    if turned > 0.05:
        remarks.append(
            f"Meridians converge by {turned:.2f} degrees along own ship's track; bearings are "
            "turned to North at its first place."
        )
    logged = {
        name: _between(time_s, np.radians(table[f"{name}_deg"].cast(float).to_numpy())) + north
        for name in ("heading", "axis")
        if f"{name}_deg" in table.columns and table[f"{name}_deg"].count()
    }
    velocity = _velocity(table, time_s, position, north, remarks)
    _tell_holes(table, time_s, remarks)
    return OwnTrack(
        time_s=time_s,
        position_m=position,
        velocity_mps=velocity,
        site=site,
        north_rad=north,
        angles=logged,
    )


def _between(time_s: Array, angle: Array) -> Array:
    """Angles (n,) without a turn between neighbours, holes (NaN) filled from both sides."""
    known = np.isfinite(angle)
    return np.interp(time_s, time_s[known], np.unwrap(angle[known]))


def _tell_holes(table: "pl.DataFrame", time_s: Array, remarks: list[str]) -> None:
    """Say where an angle of own ship's is missing for long: it is taken from its neighbours."""
    for name in ("heading", "axis"):
        if f"{name}_deg" not in table.columns:
            continue
        known = np.isfinite(table[f"{name}_deg"].cast(float).fill_null(np.nan).to_numpy())
        if not known.any():
            continue
        away = np.diff(np.concatenate([time_s[:1], time_s[known], time_s[-1:]])).max()
        if away > max(_GAP_STEPS * float(np.median(np.diff(time_s))), _GAP_S):
            remarks.append(
                f"Own ship's {name} is missing for up to {away:.0f} s: there it is taken from the "
                "rows before and after, which is wrong if own ship turned."
            )


def _plane(table: "pl.DataFrame") -> tuple[Array, Array, Site | None]:
    """Positions (n, 2), the direction of true North there (n,), and the origin."""
    if "north_m" in table.columns:
        return table.select("north_m", "east_m").to_numpy(), np.zeros(table.height), None
    latitude, longitude = (table[f"{n}_deg"].to_numpy() for n in ("latitude", "longitude"))
    site = Site(latitude_deg=float(latitude[0]), longitude_deg=float(longitude[0]), height_m=0.0)
    east, north, _ = enu_from_geodetic(latitude, longitude, 0.0, site).T
    ahead = ecef_from_geodetic(latitude, longitude, 0.0)
    up = ecef_from_geodetic(latitude, longitude, 1.0) - ahead
    pole = np.array([0.0, 0.0, 1.0]) - up * up[:, 2:]
    to_east, to_north, _ = (pole @ enu_axes(site).T).T
    return np.stack([north, east], axis=-1), np.arctan2(to_east, to_north), site


def _velocity(
    table: "pl.DataFrame", time_s: Array, position: Array, north: Array, remarks: list[str]
) -> Array | None:
    """(n, 2) velocity as logged, if it is complete and agrees with the positions."""
    names = ("course_deg", "speed_mps")
    if not all(n in table.columns and table[n].null_count() == 0 for n in names):
        return None
    course = np.radians(table["course_deg"].to_numpy()) + north
    velocity = table["speed_mps"].to_numpy()[:, None] * np.stack([np.cos(course), np.sin(course)]).T
    mean = (velocity[1:] + velocity[:-1]) / 2
    told = np.cumsum(np.vstack([np.zeros(2), mean * np.diff(time_s)[:, None]]), axis=0)
    usual = float(np.median(np.hypot(*np.diff(position, axis=0).T)))
    stride = int(np.clip(np.ceil(100.0 / max(usual, 1e-3)), 1, max(len(time_s) // 2, 1)))
    moved = position[stride:] - position[:-stride]
    off = np.median(np.hypot(*(moved - told[stride:] + told[:-stride]).T))
    if off > 10.0 + 0.2 * float(np.median(np.hypot(*moved.T))):
        remarks.append(
            "Own ship's course and speed do not agree with its positions (they part by "
            f"{off:.0f} m in {np.median(time_s[stride:] - time_s[:-stride]):.0f} s): positions "
            "alone are used. Look at their units, and at which axis is North."
        )
        return None
    return velocity


def need_axis(place: Place) -> None:
    """Raise where the array's axis is not known.

    Raises:
        DataError: own ship lies still and its log has neither axis nor heading.
    """
    if not np.isfinite(place.axis_rad).all():
        raise DataError(
            "the array's axis is not known",
            why="own ship does not move, and its log has neither axis_deg nor heading_deg",
            next_step="give axis_deg or heading_deg in own ship's log",
        )
