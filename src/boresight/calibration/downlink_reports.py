"""Plots of aircraft that give their address and height, with what they downlink of their motion."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.formats.usable import column, unusable
from boresight.maths.frames import Site, enu_at_height
from boresight.models.atmosphere import Atmosphere

if TYPE_CHECKING:
    import polars as pl

Array = Any
NEAREST_M = 10_000.0  # nearer, 100 m of range or height can turn a direction by 0.3 degrees
USUAL_SCAN_S, SHORTEST_SCAN_S = 4.0, 0.5
DUPLICATE_SCANS = 0.125  # two plots of one aircraft closer than this are one reply seen twice

MEANINGS = {  # of these plots and, further down, of the stretches of `calibration.stretches`
    "no address": "no 24-bit address: nothing says which aircraft's track was downlinked",
    "no height": "no valid flight level",
    "too near": f"nearer than {NEAREST_M / 1e3:g} km, where errors of range turn a direction",
    "duplicate": "a second reply of one aircraft in a scan",
    "turn": "in a turn: the downlinked roll says so",
    "short": "in a stretch between gaps or turns that is too short",
    "slow": "of an aircraft too slow to have a course",
    "few tracks": "in a stretch with too few downlinked tracks",
    "wrong tracks": "in a stretch whose downlinked speeds are not those of the plots",
    "changing course": "in a stretch along which the downlinked track changes",
}


@dataclass(frozen=True, eq=False)
class Reports:
    """Usable plots, sorted by aircraft and time.

    Attributes:
        row: (m,) in the table.
        time_s: (m,).
        target: (m,) number of the aircraft.
        names: address of each aircraft.
        enu: (m, 3) place in the radar's frame, m.
        height_m: (m,) pressure altitude, taken for the height above the ellipsoid.
        track: (m,) downlinked true track, rad; NaN where none came.
        speed_mps: (m,) downlinked ground speed; NaN where none came.
        roll_deg: (m,) downlinked roll; NaN where none came.
        scan_s: median time between plots of one aircraft; 4 s if none came twice.
    """

    row: Array
    time_s: Array
    target: Array
    names: tuple[str, ...]
    enu: Array
    height_m: Array
    track: Array
    speed_mps: Array
    roll_deg: Array
    scan_s: float

    def turned(self, degrees: float) -> "Reports":
        """The same with every azimuth greater by an angle."""
        sin, cos = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
        east, north, up = self.enu.T
        enu = np.stack([cos * east + sin * north, cos * north - sin * east, up], axis=-1)
        return replace(self, enu=enu)


def usable(
    plots: "pl.DataFrame", site: Site, atmosphere: Atmosphere | None
) -> tuple[Reports, dict[str, int]]:
    """Plots that can be followed and placed, and how many others there are, by reason.

    Args:
        plots: of one sensor.
        site: of the radar.
        atmosphere: whose delay is taken out of the ranges; None for none.
    """
    enu = _places(plots, site, atmosphere)
    reason = _reasons(plots, enu).astype(object)
    time = column(plots, "time_s", np.nan)
    rows = np.flatnonzero(reason == "")
    names, target = np.unique(column(plots, "address", "").astype(str)[rows], return_inverse=True)
    order = np.lexsort((time[rows], target))
    rows, target = rows[order], target[order]
    again, scan = _again(time[rows], target)
    reason[rows[again]] = "duplicate"
    rows, target = rows[~again], target[~again]
    reports = Reports(
        row=rows,
        time_s=time[rows],
        target=target,
        names=tuple(names.tolist()),
        enu=enu[rows],
        height_m=_floats(plots, "pressure_altitude_m")[rows],
        track=np.radians(_floats(plots, "true_track_deg")[rows]),
        speed_mps=_floats(plots, "ground_speed_mps")[rows],
        roll_deg=_floats(plots, "roll_deg")[rows],
        scan_s=scan,
    )
    found, counts = np.unique(reason[reason != ""], return_counts=True)
    return reports, dict(zip(found.tolist(), counts.tolist(), strict=True))


def _again(time: Array, target: Array) -> tuple[Array, float]:
    """Which plots come a second time in one scan (split, reflected), and how long a scan is."""
    step = np.diff(time, prepend=-np.inf)
    step[1:][np.diff(target) != 0] = np.inf
    steps = step[np.isfinite(step) & (step > SHORTEST_SCAN_S)]
    scan = float(np.median(steps)) if len(steps) else USUAL_SCAN_S
    return step < DUPLICATE_SCANS * scan, scan


def _floats(plots: "pl.DataFrame", name: str) -> Array:
    return column(plots, name, np.nan).astype(float)


def _places(plots: "pl.DataFrame", site: Site, atmosphere: Atmosphere | None) -> Array:
    """(n, 3) in the radar's frame; NaN without range, azimuth or height."""
    distance, height = _floats(plots, "range_m"), _floats(plots, "pressure_altitude_m")
    if atmosphere is not None:
        distance = distance - atmosphere.excess_range(distance, height, site.height_m)
    return enu_at_height(distance, np.radians(_floats(plots, "azimuth_deg")), height, site)


def _reasons(plots: "pl.DataFrame", enu: Array) -> Array:
    """Why a plot is of no use, empty where it is; the first that holds."""
    valid = column(plots, "altitude_valid", default=True)
    further = {
        "fixed transponder": column(plots, "fixed_transponder", default=False),
        "no address": column(plots, "address", "") == "",
        "no height": ~(valid & np.isfinite(_floats(plots, "pressure_altitude_m"))),
        "too near": ~(np.hypot(enu[:, 0], enu[:, 1]) >= NEAREST_M),
    }
    held = [holds.astype(bool) for holds in further.values()]
    first = unusable(plots)
    return np.where(first == "", np.select(held, list(further), default=""), first)
