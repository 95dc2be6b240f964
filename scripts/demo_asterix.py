"""The demo's reports as ASTERIX: columns in the specification's units, then blocks as sent.

Each sector begins with its CAT034 message, followed by one CAT048 block of the plots of the sector
that just ended and one CAT021 block of what the ADS-B station heard meanwhile.
"""

from collections.abc import Iterator

import numpy as np
import polars as pl

from boresight.formats.encode import encode_block, encode_records
from demo_flight import FOOT, SITE, Array
from demo_radar import RADAR, SCANS

EPOCH_S = 43_200.0  # noon: when the recording begins
EDITIONS = {34: "1.29", 48: "1.30", 21: "2.4"}
RADAR_ID = {"010/SAC": 0, "010/SIC": 101}  # code 0 belongs to no country
STATION_ID = {"010/SAC": 0, "010/SIC": 202}
NM, KNOT = 1852.0, 1852.0 / 3600
SECTOR_S = RADAR.scan_s / RADAR.sectors
NORTH_MARKER, SECTOR_CROSSING = 1, 2


def recording(reports: pl.DataFrame, broadcasts: pl.DataFrame) -> tuple[bytes, dict[str, int]]:
    """The whole file, and how many records of each category it holds."""
    sectors = np.arange(SCANS * RADAR.sectors)
    service = encode_records(34, EDITIONS[34], service_columns(sectors))
    plots = encode_records(48, EDITIONS[48], plot_columns(reports))
    heard = encode_records(21, EDITIONS[21], adsb_columns(broadcasts))
    groups = [
        (34, service, sectors),
        (48, plots, _sector(reports["true_s"].to_numpy()) + 1),
        (21, heard, _sector(broadcasts["received_s"].to_numpy()) + 1),
    ]
    counts = {f"cat{category:03d}": len(records) for category, records, _ in groups}
    return b"".join(_in_order(groups, len(sectors) + 1)), counts


def service_columns(sectors: Array) -> dict[str, object]:
    """CAT034: a north marker with the radar's state and place, and thirty-one sector crossings."""
    within = sectors % RADAR.sectors
    is_north = within == 0

    def at_north(value: float) -> Array:
        return np.where(is_north, value, np.nan)

    return {
        **RADAR_ID,
        "000": np.where(is_north, NORTH_MARKER, SECTOR_CROSSING),
        "030": _radar_clock(sectors * SECTOR_S),
        "020": within * 360 / RADAR.sectors,
        "041": at_north(RADAR.scan_s),
        "050/COM/MSC": at_north(0),
        "050/PSR/ANT": at_north(0),
        "050/SSR/ANT": at_north(0),
        "050/MDS/ANT": at_north(0),
        "120/HGT": at_north(SITE.height_m),
        "120/LAT": at_north(SITE.latitude_deg),
        "120/LON": at_north(SITE.longitude_deg),
    }


def plot_columns(reports: pl.DataFrame) -> dict[str, object]:
    """CAT048: what every plot says of itself, and what its transponder says."""
    has_code = reports["mode_a"].is_not_null().to_numpy()
    level = reports["pressure_altitude_m"].to_numpy() / FOOT / 100
    secondary = (reports["report_type"] != 1).to_numpy()
    return {
        **RADAR_ID,
        "140": _radar_clock(reports["true_s"].to_numpy()),
        "020/TYP": reports["report_type"].to_numpy(),
        "020/RAB": (reports["kind"] == "monitor").to_numpy().astype(int),
        "040/RHO": reports["range_m"].to_numpy() / NM,
        "040/THETA": _whole_turn(reports["azimuth_deg"].to_numpy()),
        "070/G": np.where(has_code, reports["mode_a_garbled"].fill_null(value=False), np.nan),
        "070/MODE3A": _whole_number(reports["mode_a"], base=8),
        "090/G": np.where(
            has_code & ~np.isnan(level), reports["level_garbled"].fill_null(value=False), np.nan
        ),
        "090/FL": np.where(secondary, level, np.nan),
        **_mode_s(reports),
    }


def adsb_columns(broadcasts: pl.DataFrame) -> dict[str, object]:
    """CAT021: position and geometric height, their quality, and who it is."""
    named = np.arange(len(broadcasts)) % 4 == 0  # the callsign comes now and then
    callsign = broadcasts["callsign"].to_numpy().astype(str)
    return {
        **STATION_ID,
        "040/ATP": 0,
        "020": 0,
        "071": _clock(broadcasts["applies_s"].to_numpy()),
        "073": _clock(broadcasts["received_s"].to_numpy()),
        "131/LAT": broadcasts["latitude_deg"].to_numpy(),
        "131/LON": broadcasts["longitude_deg"].to_numpy(),
        "080": _whole_number(broadcasts["address"], base=16),
        "140": broadcasts["height_m"].to_numpy() / FOOT,
        "090/NUCPNIC": np.where(broadcasts["nacp"].to_numpy() >= 8, 8, 5),
        "090/NACP": broadcasts["nacp"].to_numpy(),
        "210/VN": 2,
        "145": broadcasts["pressure_altitude_m"].to_numpy() / FOOT / 100,
        "160/GS": broadcasts["ground_speed_mps"].to_numpy() / NM,
        "160/TA": _whole_turn(broadcasts["true_track_deg"].to_numpy()),
        "170": np.where(named, callsign, ""),
    }


def _mode_s(reports: pl.DataFrame) -> dict[str, object]:
    """Address, callsign and register 5,0 or 6,0; a reply's registers come every other scan."""
    address = _whole_number(reports["address"], base=16)
    is_predicted = (reports["report_type"] == 0).to_numpy()
    turn = np.floor(reports["true_s"].to_numpy() / RADAR.scan_s) + np.nan_to_num(address)
    asked = ~np.isnan(address) & ~is_predicted & reports["roll_deg"].is_not_null().to_numpy()
    track, turning = asked & (turn % 2 == 0), asked & (turn % 8 == 1)
    register = np.where(track, track_and_turn(reports), heading_and_speed(reports))
    code = np.where(track, 5.0, np.where(turning, 6.0, np.nan))
    return {
        "220": address,
        "240": reports["callsign"].fill_null("").to_numpy().astype(str),
        "250/MBDATA": np.ma.masked_array(register, np.isnan(code)),
        "250/BDS1": code,
    }


def track_and_turn(reports: pl.DataFrame) -> Array:
    """Comm-B register 5,0 (Doc 9871, table A-2-80): roll, true track, ground and true airspeed."""
    speed = reports["ground_speed_mps"].fill_null(0).to_numpy()
    roll = reports["roll_deg"].fill_null(0).to_numpy()
    rate = np.degrees(9.80665 * np.tan(np.radians(roll)) / np.maximum(speed, 1.0))
    return _register(
        (roll, 45 / 256, 10, True),
        (_half_turn(reports["true_track_deg"].fill_null(0).to_numpy()), 90 / 512, 11, True),
        (speed / KNOT, 2.0, 10, False),
        (rate, 8 / 256, 10, True),
        (speed / KNOT, 2.0, 10, False),
    )


def heading_and_speed(reports: pl.DataFrame) -> Array:
    """Comm-B register 6,0 (table A-2-96): heading and climb; airspeed and Mach are not there.

    The demo has no wind, and its magnetic North is one degree west of the true one.
    """
    heading = _half_turn(reports["true_track_deg"].fill_null(0).to_numpy() + 1.0)
    climb = reports["climb_mps"].fill_null(0).to_numpy() / FOOT * 60
    return _register(
        (heading, 90 / 512, 11, True),
        (None, 1.0, 10, False),
        (None, 1.0, 10, False),
        (climb, 32.0, 10, True),
        (climb, 32.0, 10, True),
    )


def _register(*fields: tuple[Array | None, float, int, bool]) -> Array:
    """Pack (value, step, bits, signed) into 56 bits, each after its status bit; None: no status."""
    word = np.zeros((), np.int64)
    for value, step, bits, signed in fields:
        given = value is not None
        quanta = np.rint((0 if value is None else value) / step).astype(np.int64)
        top = (1 << (bits - signed)) - 1
        quanta = np.clip(quanta, -top if signed else 0, top) & ((1 << bits) - 1)
        word = word << (bits + 1) | int(given) << bits | quanta
    return word


def _in_order(groups: list[tuple[int, list[bytes], Array]], slots: int) -> Iterator[bytes]:
    """Blocks slot by slot, in each slot the categories in the order given."""
    edges = [np.searchsorted(slot, np.arange(slots + 1)).tolist() for _, _, slot in groups]
    for slot in range(slots):
        for (category, records, _), edge in zip(groups, edges, strict=True):
            if edge[slot] < edge[slot + 1]:
                yield encode_block(category, records[edge[slot] : edge[slot + 1]])


def _sector(true_s: Array) -> Array:
    return np.floor(true_s / SECTOR_S).astype(np.int64)


def _clock(true_s: Array) -> Array:
    return EPOCH_S + true_s


def _radar_clock(true_s: Array) -> Array:
    return _clock(true_s) + RADAR.time_bias_s


def _whole_turn(angle_deg: Array) -> Array:
    """Into the field's range: what would round up to a whole turn is North."""
    step = 360 / 65_536
    return np.rint(angle_deg / step) % 65_536 * step


def _half_turn(angle_deg: Array) -> Array:
    return (angle_deg + 180) % 360 - 180


def _whole_number(text: pl.Series, base: int) -> Array:
    """Codes as numbers, NaN where there is none."""
    known = text.replace("", None)
    return known.str.to_integer(base=base, strict=False).cast(pl.Float64).to_numpy()
