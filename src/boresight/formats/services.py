"""Radar service messages (CAT034) as `sectors`, tracks of a centre (CAT062) as `system_tracks`.

sectors:        time_s, sensor, message (north, sector, geographic, jamming, solar, ssr-jamming,
                mode-s-jamming, other), azimuth_deg (where the sector begins), scan_s (as stated),
                no_go (the system must not be used), overload, range_bias_m, azimuth_bias_deg (as
                stated), latitude_deg, longitude_deg, height_m (of the radar)
system_tracks:  time_s, sensor, system_track, address, mode_a, aircraft_id, latitude_deg,
                longitude_deg, height_m (geometric), pressure_altitude_m, east_mps, north_mps,
                accuracy_m, age_s (of the newest radar plot in it), coasted, simulated, sole_source
"""

from typing import TYPE_CHECKING

import numpy as np

from boresight.formats import columns as c
from boresight.formats.asterix import Records
from boresight.formats.columns import Floats, Stamp

if TYPE_CHECKING:
    import polars as pl

_MESSAGES = {
    1: "north",
    2: "sector",
    3: "geographic",
    4: "jamming",
    5: "solar",
    6: "ssr-jamming",
    7: "mode-s-jamming",
}


def sectors(records: Records, when: Stamp) -> "pl.DataFrame":
    """Return one row per service message of a radar."""
    is_north = records.raw("000") == 1
    return c.frame(
        {
            "time_s": when.time_s,
            "sensor": c.sensors(when.sensor),
            "message": c.labels(
                records.raw("000"),
                records.has("000"),
                lambda codes: [_MESSAGES.get(code, "other") for code in codes.tolist()],
            ),
            "azimuth_deg": np.where(is_north, 0.0, records.value("020")),
            "scan_s": records.value("041"),
            "no_go": c.flags(records.flag("050/COM/NOGO"), records.has("050/COM")),
            "overload": c.flags(_overload(records), records.has("050/COM")),
            "range_bias_m": records.value("090/RNG") * c.NAUTICAL_MILE_M,
            "azimuth_bias_deg": records.value("090/AZM"),
            "latitude_deg": records.value("120/LAT"),
            "longitude_deg": records.value("120/LON"),
            "height_m": records.value("120/HGT"),
        }
    )


def _overload(records: Records) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    return records.flag("050/COM/OVLRDP") | records.flag("050/COM/OVLXMT")


def system_tracks(records: Records, when: Stamp) -> "pl.DataFrame":
    """Return one row per report of a system track."""
    import polars as pl

    name = pl.DataFrame([c.text(records, "380/ID"), c.text(records, "245/CHR").alias("other")])
    return c.frame(
        {
            "time_s": when.time_s,
            "sensor": c.sensors(when.sensor),
            "system_track": c.whole(records.raw("040"), records.has("040")),
            "address": c.addresses(records, "380/ADR"),
            "mode_a": c.octal(records, "060/MODE3A"),
            "aircraft_id": name.select(pl.coalesce(pl.all())).to_series(),
            "latitude_deg": records.value("105/LAT"),
            "longitude_deg": records.value("105/LON"),
            "height_m": records.value("130") * c.FOOT_M,
            "pressure_altitude_m": records.value("136") * c.FLIGHT_LEVEL_M,
            "east_mps": records.value("185/VX"),
            "north_mps": records.value("185/VY"),
            "accuracy_m": np.hypot(records.value("500/APC/X"), records.value("500/APC/Y")),
            "age_s": _newest_age(records),
            "coasted": records.flag("080/CST"),
            "simulated": records.flag("080/SIM"),
            "sole_source": records.flag("080/MON"),
        }
    )


def _newest_age(records: Records) -> Floats:
    ages = [records.value(f"290/{kind}") for kind in ("PSR", "SSR", "MDS")]
    found: Floats = np.fmin.reduce(ages)
    return found
