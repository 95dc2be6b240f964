"""Stretches of straight flight: the direction that a radar sees, and the one aircraft downlink.

A stretch is one straight line in space through the plots of one aircraft over a minute or two. A
downlinked track counts from the meridian at its own place, which is not the radar's North because
meridians meet. It is made a direction in space there, and compared with the line's in the level
plane at the middle of the stretch; so a great circle counts as straight, and a climb turns nothing.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.downlink_reports import Reports
from boresight.maths import wrap
from boresight.maths.frames import Site, ecef_from_enu, enu_axes, geodetic_from_ecef

Array = Any
STEP_DEG = 90 / 512  # of the downlinked true track: ICAO Doc 9871, table A-2-80
LEAST_S, FEWEST_PLOTS, FEWEST_TRACKS = 64.0, 8, 3  # of a stretch
GAP_SCANS = 3.5  # two replies in a row may be missing
ROLL_DEG = 1.5  # beyond: a turn, in which the downlinked track is most of a second old
SPREAD_DEG = 2.5 * STEP_DEG  # between tracks of one stretch: rounding alone makes one step
SLOWEST_MPS = 50.0  # what taxies or hovers has no course to speak of
_STILL_MPS = 1e-9  # what does not move at all is divided by this
SPEED_SHARE, SPEED_MPS = 0.05, 5.0  # by which a downlinked speed may miss the fitted one
_CUBIC = np.arange(4.0)


@dataclass(frozen=True, eq=False)
class Stretches:
    """Straight flight, one element each (s,).

    Attributes:
        report: of the reports, the one in the middle.
        target: number of the aircraft.
        centre: (s, 3) mean place in the radar's frame, m.
        velocity: (s, 3) in the radar's frame, m/s.
        turned: direction fitted to the plots minus the downlinked one, rad.
        sd: of the fitted direction, rad, if distances from the line are independent.
        plots, tracks: how many of each.
        wrong: downlinked tracks left out because the ground speed with them is not that of the
            plots: another register, or another aircraft's.
        spread: between the greatest and the least downlinked track, rad.
        speed_difference_mps: downlinked minus fitted ground speed, mean.
        noise: (m, 2) of range (m) and azimuth (rad), over all stretches: third differences of the
            distances from a cubic, as large as the white noise of single plots.
        reason: why a stretch is not fit for use, empty if it is.
    """

    report: Array
    target: Array
    centre: Array
    velocity: Array
    turned: Array
    sd: Array
    plots: Array
    tracks: Array
    wrong: Array
    spread: Array
    speed_difference_mps: Array
    noise: Array
    reason: Array


class _Groups(NamedTuple):
    """Some of the reports, in groups of neighbours.

    Attributes:
        row: (m,) of the reports.
        first: (s,) first of each group in `row`.
        of: (m,) group of each.
    """

    row: Array
    first: Array
    of: Array

    def sum(self, values: Array) -> Array:
        """(s, ...) sum of each group."""
        return np.add.reduceat(values, self.first, axis=0)

    def mean(self, values: Array) -> Array:
        """(s, ...) mean of each group."""
        count = np.bincount(self.of).reshape(-1, *[1] * (values.ndim - 1))
        return self.sum(values) / count


def straight(reports: Reports, site: Site) -> tuple[Stretches, dict[str, tuple[int, int]]]:
    """Stretches of straight flight.

    Args:
        reports: sorted by aircraft and time.
        site: of the radar.

    Returns:
        All stretches that do not turn and are long enough, fit for use or not; and what was lost:
        by reason, how many stretches and how many plots.
    """
    first, count, reason = _cut(reports)
    kept = reason == ""
    inside = np.cumsum(count[kept]) - count[kept]
    row = np.repeat(first[kept] - inside, count[kept]) + np.arange(count[kept].sum())
    groups = _Groups(row, inside, np.repeat(np.arange(len(inside)), count[kept]))
    found = _fit(reports, groups, site)
    reason[kept] = found.reason
    lost = {
        str(name): (int((reason == name).sum()), int(count[reason == name].sum()))
        for name in np.unique(reason[reason != ""])
    }
    return found, lost


def _cut(reports: Reports) -> tuple[Array, Array, Array]:
    """First report and number of reports of every stretch, and why it is none (or "").

    A flight is cut where replies are missing and where a turn begins or ends; what lies between is
    divided into equal parts that are as short as a stretch may be.
    """
    turning = np.abs(np.nan_to_num(reports.roll_deg)) > ROLL_DEG
    new = np.ones(len(turning), dtype=bool)
    late = np.diff(reports.time_s) > GAP_SCANS * reports.scan_s
    new[1:] = (np.diff(reports.target) != 0) | late | (turning[1:] != turning[:-1])
    first = np.flatnonzero(new)
    length = np.diff(first, append=len(new))
    whole = max(FEWEST_PLOTS, int(np.ceil(LEAST_S / reports.scan_s)))
    parts = np.maximum(length // whole, 1)
    piece = np.repeat(np.arange(len(first)), parts)
    part = np.arange(len(piece)) - np.repeat(np.cumsum(parts) - parts, parts)
    start = first[piece] + part * length[piece] // parts[piece]
    count = np.diff(start, append=len(new))
    reason = np.where(turning[start], "turn", np.where(count < whole, "short", ""))
    return start, count, reason.astype(object)


def _fit(reports: Reports, groups: _Groups, site: Site) -> Stretches:
    """A line through each group, the downlinked tracks beside it, and why it may be of no use."""
    time, enu = reports.time_s[groups.row], reports.enu[groups.row]
    centre = groups.mean(enu)
    place = enu - centre[groups.of]
    t = time - groups.mean(time)[groups.of]
    reach2 = groups.sum(t * t)
    velocity = groups.sum(t[:, None] * place) / reach2[:, None]
    ahead, aside = _axes(centre, velocity, site)
    speed = _dot(velocity, ahead)
    across = _dot(place, aside[groups.of])  # the line itself has no component there
    count = np.bincount(groups.of)
    sd = np.sqrt(groups.sum(across**2) / (count - 2) / reach2) / np.maximum(speed, _STILL_MPS)
    left, rate = _cubic(t, place, groups)
    heard = _heard(reports, groups, site, (ahead, aside), rate)
    reasons = {
        "slow": ~(speed >= SLOWEST_MPS),
        "few tracks": heard["tracks"] + heard["wrong"] < FEWEST_TRACKS,
        "wrong tracks": heard["tracks"] < FEWEST_TRACKS,
        "changing course": heard["spread"] > np.radians(SPREAD_DEG),
    }
    return Stretches(
        report=groups.row[groups.first + count // 2],
        target=reports.target[groups.row[groups.first]],
        centre=centre,
        velocity=velocity,
        sd=sd,
        plots=count,
        noise=_noise(_polar(left, enu), groups),
        reason=np.select(list(reasons.values()), list(reasons), default="").astype(object),
        **heard,
    )


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("mi,mi->m", a, b)


def _axes(centre: Array, velocity: Array, site: Site) -> tuple[Array, Array]:
    """Unit vectors (s, 3) ahead and to the right of a motion, level where it is."""
    up = np.cross(*_compass(centre, site))
    aside = np.cross(velocity, up)
    aside = aside / np.maximum(np.linalg.norm(aside, axis=-1, keepdims=True), _STILL_MPS)
    return np.cross(up, aside), aside


def _compass(enu: Array, site: Site) -> tuple[Array, Array]:
    """East and North (m, 3) at each place itself, in the radar's frame."""
    place = geodetic_from_ecef(ecef_from_enu(enu, site))
    latitude, longitude = np.radians(place.latitude_deg), np.radians(place.longitude_deg)
    cos, sin = np.cos(longitude), np.sin(longitude)
    down, zero = -np.sin(latitude), np.zeros(len(enu))
    axes = enu_axes(site).T
    east = np.stack([-sin, cos, zero], axis=-1) @ axes
    return east, np.stack([down * cos, down * sin, np.cos(latitude)], axis=-1) @ axes


def _cubic(t: Array, place: Array, groups: _Groups) -> tuple[Array, Array]:
    """Distances (m, 3) from a cubic through each group, and its velocity (m, 3)."""
    half = np.maximum.reduceat(np.abs(t), groups.first)[groups.of]
    powers = (t / half)[:, None] ** _CUBIC
    normal = groups.sum(powers[:, :, None] * powers[:, None, :])
    fitted = np.linalg.solve(normal, groups.sum(powers[:, :, None] * place[:, None, :]))[groups.of]
    left = place - np.einsum("mk,mki->mi", powers, fitted)
    rate = np.einsum("mk,mki->mi", powers[:, :-1] * _CUBIC[1:], fitted[:, 1:]) / half[:, None]
    return left, rate


def _polar(left: Array, enu: Array) -> Array:
    """Range (m) and azimuth (rad) of small distances (m, 3) from places (m, 3)."""
    ground2 = enu[:, 0] ** 2 + enu[:, 1] ** 2
    aside = left[:, 0] * enu[:, 1] - left[:, 1] * enu[:, 0]
    return np.stack([_dot(left, enu) / np.sqrt(_dot(enu, enu)), aside / ground2], axis=-1)


def _noise(left: Array, groups: _Groups) -> Array:
    """Third differences, which what wanders from plot to plot hardly enters, scaled to one plot."""
    third = np.diff(left, 3, axis=0)[groups.of[3:] == groups.of[:-3]]
    return third / np.sqrt(1 + 9 + 9 + 1)


def _heard(
    reports: Reports, groups: _Groups, site: Site, axes: tuple[Array, Array], rate: Array
) -> dict[str, Array]:
    """What the aircraft say of each group's motion, as columns of `Stretches`."""
    some = np.flatnonzero(np.isfinite(reports.track[groups.row]))
    row, of, count = groups.row[some], groups.of[some], len(groups.first)
    ahead, aside = axes[0][of], axes[1][of]
    turned = -_to_the_right(reports.track[row], _compass(reports.enu[row], site), ahead, aside)
    fitted = np.hypot(_dot(rate[some], ahead), _dot(rate[some], aside))
    difference = reports.speed_mps[row] - fitted
    right = ~(np.abs(difference) > SPEED_SHARE * fitted + SPEED_MPS)  # no speed tells nothing

    def total(values: Array) -> Array:
        return np.bincount(of, np.where(right, values, 0.0), count)

    mean = np.arctan2(total(np.sin(turned)), total(np.cos(turned)))
    apart = np.where(right, wrap(turned - mean[of]), 0.0)
    low, high = np.zeros(count), np.zeros(count)
    np.minimum.at(low, of, apart)
    np.maximum.at(high, of, apart)
    known = np.isfinite(difference)
    return {
        "turned": mean,
        "tracks": total(np.ones(len(of))).astype(int),
        "wrong": np.bincount(of[~right], minlength=count),
        "spread": high - low,
        "speed_difference_mps": total(np.where(known, difference, 0.0))
        / np.maximum(total(known), 1.0),
    }


def _to_the_right(track: Array, compass: tuple[Array, Array], ahead: Array, aside: Array) -> Array:
    """Angle of a track (rad from North) from the direction ahead, rad."""
    way = np.sin(track)[:, None] * compass[0] + np.cos(track)[:, None] * compass[1]
    return np.arctan2(_dot(way, aside), _dot(way, ahead))
