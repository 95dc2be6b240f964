"""ADS-B (CAT021) as the table `reference`.

time_s, time_kind (applicability, reception, transmission, report), sensor, address, mode_a,
aircraft_id, latitude_deg, longitude_deg, height_m (geometric), pressure_altitude_m,
accuracy_m (horizontal, 95 %; null where the quality does not tell), quality, quality_kind
(nacp, nucp, pa), age_s (reception minus applicability), on_ground, simulated, test,
ground_speed_mps, true_track_deg
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boresight.formats import columns as c
from boresight.formats.asterix import Records
from boresight.formats.clock import DAY_S
from boresight.formats.columns import Columns, Floats, Stamp
from boresight.formats.wire import Integers

if TYPE_CHECKING:
    import polars as pl

# Radius that holds the position with 95 % probability, by code (m; code 0 is unknown): NACp of
# RTCA DO-260B table 2-70, NUCp of DO-260 table 2-11.
_NACP_M = (np.nan, 18_520, 7_408, 3_704, 1_852, 926, 555.6, 185.2, 92.6, 30, 10, 3, *[np.nan] * 4)
_NUCP_M = (np.nan, 18_520, 9_260, 1_852, 926, 463, 185.2, 92.6, 10, 3, *[np.nan] * 6)
_HEIGHT_IS_OVER = 0x7FFF
_FRACTION_DAYS = (0, 1, -1, 0)  # FSI: the fraction belongs to this whole second, the next, the last


# A position is compared with the median of this many around it, and may be so far from that.
_AROUND = 11
_ENOUGH = 5
_FASTEST_MPS, _ROOM_M, _DEGREE_M = 500.0, 5_000.0, 111_195.0


class _Quality(NamedTuple):
    code: Integers  # -1 where unknown
    kind: str
    radius_m: tuple[float, ...] | None


def reference(records: Records, when: Stamp) -> "pl.DataFrame":
    """Return one row per ADS-B report, in the order of the file."""
    kind, exact = _times(records)
    # `when` unwraps to whole steps of the time item; the exact time lies within half a day of it.
    days = np.rint((when.time_s - exact) / DAY_S)
    return c.frame(
        {
            "time_s": exact + DAY_S * days,
            "time_kind": kind,
            "sensor": c.sensors(when.sensor),
            "address": c.addresses(records, "080"),
            "mode_a": c.octal(records, "070/MODE3A"),
            "aircraft_id": c.text(records, "170"),
            **_position(records),
            **_accuracy(records),
            "age_s": _age(records),
            "on_ground": records.flag("040/GBS"),
            "simulated": records.flag("040/SIM"),
            "test": records.flag("040/TST"),
            "ground_speed_mps": records.value("160/GS") * c.NAUTICAL_MILE_M,
            "true_track_deg": records.value("160/TA"),
        }
    )


def _times(records: Records) -> tuple["pl.Series", Floats]:
    """Return which time the position has, and that time of day."""
    kinds = {
        "applicability": records.value("071"),
        "reception": _reception(records),
        "transmission": records.value("077"),
        "report": records.value("030"),
    }
    names: list[str | None] = list(kinds)
    times = np.stack(list(kinds.values()))
    first = np.argmax(~np.isnan(times), axis=0)
    exact = times[first, np.arange(len(records))]
    return c.labels(first, ~np.isnan(exact), lambda n: [names[i] for i in n.tolist()]), exact


def _reception(records: Records) -> Floats:
    """Return the reception time, with its fraction of a second from item 074 where there is one."""
    coarse = records.value("073")
    fraction = records.value("074/TOMRP")
    shift = np.array(_FRACTION_DAYS)[records.raw("074/FSI")]
    return np.where(np.isnan(fraction), coarse, np.floor(coarse) + shift + fraction)


def _age(records: Records) -> Floats:
    age = _reception(records) - records.value("071")
    return (age + DAY_S / 2) % DAY_S - DAY_S / 2


def _position(records: Records) -> Columns:
    """Return the position, of high resolution where there is one, and both heights."""
    fine = {axis: records.value(f"131/{axis}") for axis in ("LAT", "LON")}
    height = records.value("140") * c.FOOT_M
    return {
        "latitude_deg": np.where(np.isnan(fine["LAT"]), records.value("130/LAT"), fine["LAT"]),
        "longitude_deg": np.where(np.isnan(fine["LON"]), records.value("130/LON"), fine["LON"]),
        "height_m": np.where(records.raw("140") == _HEIGHT_IS_OVER, np.nan, height),
        "pressure_altitude_m": records.value("145") * c.FLIGHT_LEVEL_M,
    }


def _accuracy(records: Records) -> Columns:
    """Return the best statement of horizontal accuracy that a report makes."""
    stated = np.full(len(records), -1)
    kind = np.full(len(records), -1)
    radius = np.full(len(records), np.nan)
    qualities = _qualities(records)
    for index, (code, _, radius_m) in enumerate(qualities):
        new = (stated < 0) & (code >= 0)
        stated[new], kind[new] = code[new], index
        if radius_m is not None:
            radius[new] = np.array(radius_m)[code[new]]
    names: list[str | None] = [quality.kind for quality in qualities]
    return {
        "accuracy_m": radius,
        "quality": c.whole(stated, stated >= 0),
        "quality_kind": c.labels(kind, kind >= 0, lambda n: [names[i] for i in n.tolist()]),
    }


def _qualities(records: Records) -> list[_Quality]:
    """Return what says how good a position is, best first.

    The position accuracy of editions 0.2x has no scale of its own in the specification.
    """
    is_first_version = records.raw("210/VN", absent=0) == 0
    nucp = np.where(is_first_version, records.raw("090/NUCPNIC", absent=-1), -1)
    return [
        _Quality(records.raw("090/NACP", absent=-1), "nacp", _NACP_M),
        _Quality(nucp, "nucp", _NUCP_M),
        _Quality(np.where(records.has("090/PA"), records.raw("090/PA", absent=-1), -1), "pa", None),
    ]


def with_jumps(table: "pl.DataFrame") -> "pl.DataFrame":
    """Add `position_jumps` to a reference sorted by time; positions stay as they are.

    Only reports where it is false are fit to hold a radar against.
    """
    import polars as pl

    latitude, longitude, time = pl.col("latitude_deg"), pl.col("longitude_deg"), pl.col("time_s")
    # Counted from the aircraft's first longitude, so that 180 degrees are no jump.
    east = (longitude - longitude.first() + 540) % 360 - 180
    half = _AROUND // 2
    span = pl.max_horizontal(
        (time.shift(-half) - time).fill_null(time.max() - time),
        (time - time.shift(half)).fill_null(time - time.min()),
    )
    north_m, east_m = (
        (axis - axis.rolling_median(_AROUND, center=True, min_samples=1)) * _DEGREE_M
        for axis in (latitude, east)
    )
    distance = (north_m**2 + (east_m * latitude.radians().cos()) ** 2).sqrt()
    is_far = (distance > _ROOM_M + _FASTEST_MPS * span).over("address")
    is_known = distance.is_not_null().sum().over("address") >= _ENOUGH
    return table.with_columns(position_jumps=pl.when(is_known).then(is_far))
