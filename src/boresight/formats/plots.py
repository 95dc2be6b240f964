"""Target reports of radars and multilateration (CAT048, CAT010) as the table `plots`.

time_s, sensor, range_m (slant), azimuth_deg (clockwise from North), elevation_deg,
range_rate_mps (opening is positive), x_m, y_m (multilateration, from its own origin),
pressure_altitude_m, altitude_valid, radar_height_m (measured by a 3-D radar), address,
mode_a, mode_a_valid, aircraft_id, report_type (none psr ssr ssr+psr mode-s psr+mode-s; none
is a prediction without a detection), simulated, test, fixed_transponder, radar_track,
ground_speed_mps, true_track_deg, roll_deg (downlinked, BDS 5,0), radar_speed_mps,
radar_heading_deg (the radar's own tracker)
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from boresight.formats import columns as c
from boresight.formats.asterix import Records
from boresight.formats.columns import Columns, Floats, Stamp
from boresight.formats.wire import Flags, Integers

if TYPE_CHECKING:
    import polars as pl

_TYPES_48 = ("none", "psr", "ssr", "ssr+psr", "mode-s", "mode-s", "psr+mode-s", "psr+mode-s")
_TYPES_10 = {0: "ssr", 1: "mode-s", 3: "psr"}
_TARGET_REPORT = 1
# BDS 5,0 (ICAO Doc 9871, table A-2-80): status bit, first bit after it, width, step.
_ROLL = (1, 10, 45 / 256)
_TRACK = (12, 11, 90 / 512)
_SPEED = (24, 10, 2.0)
_MB_BITS = 56


def plots(records: Records, when: Stamp) -> "pl.DataFrame":
    """Return one row per target report of CAT048 or CAT010, in the order of the file."""
    if records.edition.category == 48:
        return c.frame(_common(when) | _radar(records))
    is_target = records.raw("000", absent=_TARGET_REPORT) == _TARGET_REPORT
    records = records.take(is_target)
    when = Stamp(*(column[is_target] for column in when))
    return c.frame(_common(when) | _surface(records))


def _common(when: Stamp) -> Columns:
    return {"time_s": when.time_s, "sensor": c.sensors(when.sensor)}


def _radar(records: Records) -> Columns:
    speed, track, roll = _bds50(records)
    none = np.full(len(records), np.nan)
    return {
        "range_m": records.value("040/RHO") * c.NAUTICAL_MILE_M,
        "azimuth_deg": records.value("040/THETA"),
        "elevation_deg": none,
        "range_rate_mps": _doppler(records),
        "x_m": none,
        "y_m": none,
        **_identity(records, mode_a="070", address="220", name="240"),
        "radar_height_m": records.value("110/3DH") * c.FOOT_M,
        "report_type": _report_type_48(records),
        **_conditions(records),
        "radar_track": c.whole(records.raw("161/TRN"), records.has("161")),
        "ground_speed_mps": speed,
        "true_track_deg": track,
        "roll_deg": roll,
        "radar_speed_mps": records.value("200/GSP") * c.NAUTICAL_MILE_M,
        "radar_heading_deg": records.value("200/HDG"),
    }


def _surface(records: Records) -> Columns:
    none = np.full(len(records), np.nan)
    return {
        "range_m": records.value("040/RHO"),
        "azimuth_deg": records.value("040/TH"),
        "elevation_deg": none,
        "range_rate_mps": none,
        "x_m": records.value("042/X"),
        "y_m": records.value("042/Y"),
        **_identity(records, mode_a="060", address="220", name="245/CHR"),
        "radar_height_m": records.value("091") * c.FOOT_M,
        "report_type": _report_type_10(records),
        **_conditions(records),
        "radar_track": c.whole(records.raw("161/TRK"), records.has("161")),
        "ground_speed_mps": none,
        "true_track_deg": none,
        "roll_deg": none,
        "radar_speed_mps": records.value("200/GSP") * c.NAUTICAL_MILE_M,
        "radar_heading_deg": records.value("200/TRA"),
    }


def _identity(records: Records, *, mode_a: str, address: str, name: str) -> Columns:
    """Return altitude and identity; valid means validated and not garbled."""
    return {
        "pressure_altitude_m": records.value("090/FL") * c.FLIGHT_LEVEL_M,
        "altitude_valid": _valid(records, "090"),
        "address": c.addresses(records, address),
        "mode_a": c.octal(records, f"{mode_a}/MODE3A"),
        "mode_a_valid": _valid(records, mode_a),
        "aircraft_id": c.text(records, name),
    }


def _valid(records: Records, item: str) -> "pl.Series":
    is_valid = ~(records.flag(f"{item}/V") | records.flag(f"{item}/G"))
    return c.flags(is_valid, records.has(item))


def _conditions(records: Records) -> Columns:
    return {
        "simulated": records.flag("020/SIM"),
        "test": records.flag("020/TST"),
        "fixed_transponder": records.flag("020/RAB"),
    }


def _report_type_48(records: Records) -> "pl.Series":
    return c.labels(
        records.raw("020/TYP"),
        records.has("020"),
        lambda codes: [_TYPES_48[code] for code in codes.tolist()],
    )


def _report_type_10(records: Records) -> "pl.Series":
    """Return the kind of sensor, `none` where the track is coasting (extrapolated)."""
    codes = np.where(records.flag("170/CST"), -1, records.raw("020/TYP"))
    kinds: dict[int, str | None] = {-1: "none", **_TYPES_10}
    return c.labels(
        codes, records.has("020"), lambda found: [kinds.get(code) for code in found.tolist()]
    )


def _doppler(records: Records) -> Floats:
    """Return the calculated Doppler speed, without those marked doubtful."""
    speed = records.value("120/CAL/CAL")
    return np.where(records.flag("120/CAL/D"), np.nan, speed)


def _bds50(records: Records) -> tuple[Floats, Floats, Floats]:
    """Return downlinked ground speed (m/s), true track and roll (degrees), NaN where not valid."""
    rows, data = _register(records, 5, 0)
    out = [np.full(len(records), np.nan) for _ in range(3)]
    # The first report of a record counts, so later ones are written before it.
    rows, data = rows[::-1], data[::-1]
    out[0][rows] = _part(data, *_SPEED, signed=False) * c.KNOT_MPS
    out[1][rows] = _part(data, *_TRACK, signed=True) % 360
    out[2][rows] = _part(data, *_ROLL, signed=True)
    return out[0], out[1], out[2]


def _register(records: Records, bds1: int, bds2: int) -> tuple[Integers, Integers]:
    """Return rows and 56 bits of data of one register of item 250."""
    data, first, second = (records.cells(f"250/{name}") for name in ("MBDATA", "BDS1", "BDS2"))
    if data is None or first is None or second is None:
        empty = np.empty(0, np.int64)
        return empty, empty
    wanted: Flags = (first.raw == bds1) & (second.raw == bds2)
    return data.record[wanted], data.raw[wanted]


def _part(data: Integers, status: int, width: int, step: float, *, signed: bool) -> Floats:
    """Return one number of a register, NaN where its status bit is zero; bits count from 1."""
    is_valid = (data >> (_MB_BITS - status)) & 1
    value: NDArray[np.int64] = (data >> (_MB_BITS - status - width)) & ((1 << width) - 1)
    if signed:
        value = value - ((value >> (width - 1)) << width)
    return np.where(is_valid == 1, value * step, np.nan)
