"""The same sky as its aircraft report it: ADS-B with GPS noise, latency and a few poor positions.

Most aircraft's reports carry the time to which the position applies (I021/071). `LATE` ones do
not: only the time of reception (I021/073) is known, and the position is older than that by what
the aircraft did not compensate. Some are without ADS-B, and two navigate badly and admit it.
"""

import numpy as np
import polars as pl

from boresight.maths import frames
from boresight.models.atmosphere import EffectiveEarth
from demo_flight import (
    DURATION_S,
    SITE,
    Array,
    Path,
    ellipsoid_height,
    pressure_altitude_m,
)

PERIOD_S, JITTER_S = 2.0, 0.1
RECEIVED = 0.96
REACH_M, HORIZON_DEG = 230e3, 0.05
WANDER_M, WANDER_UP_M, WANDER_S = 3.0, 5.0, 120.0  # GPS: a slow walk, standard deviation and time
WHITE_M = 0.7
LATENCY_S = (0.1, 0.3)
WITHOUT, LATE, POOR = (8, 22, 34, 46, 48), (5, 13, 21, 29, 37, 45), (10, 27)
POOR_OFFSET_M = 380.0
NACP_GOOD, NACP_POOR = 9, 5  # within 30 m, within half a nautical mile, 95 % of the time


def broadcast(paths: list[Path], seed: int) -> pl.DataFrame:
    """Every report that reaches the ground, by time of reception."""
    rng = np.random.Generator(np.random.Philox(key=[seed, 4]))
    reports = [_reports(i, path, rng) for i, path in enumerate(paths) if i not in WITHOUT]
    return pl.concat(reports).sort("received_s")


def facts(paths: list[Path]) -> dict[str, object]:
    """What is planted in the reports."""

    def names(which: tuple[int, ...]) -> list[str]:
        return [paths[i].flight.identity["callsign"] for i in which]

    return {
        "period_s": PERIOD_S,
        "received": RECEIVED,
        "wander_m": WANDER_M,
        "wander_up_m": WANDER_UP_M,
        "wander_s": WANDER_S,
        "white_m": WHITE_M,
        "without": names(WITHOUT),
        "late": names(LATE),
        "latency_s": LATENCY_S,
        "poor": names(POOR),
        "poor_offset_m": POOR_OFFSET_M,
    }


def _reports(index: int, path: Path, rng: np.random.Generator) -> pl.DataFrame:
    identity = path.flight.identity
    received = _times(path, rng)
    applies = received - (rng.uniform(*LATENCY_S, len(received)) if index in LATE else 0.0)
    enu, onboard = path.enu(applies), path.onboard(applies)
    place = frames.geodetic_from_enu(enu + _error(received, index, rng), SITE)
    columns = {
        "flight": index,
        "received_s": received,
        "applies_s": [None] * len(received) if index in LATE else received,
        "latitude_deg": place.latitude_deg,
        "longitude_deg": place.longitude_deg,
        "height_m": place.height_m,
        "pressure_altitude_m": pressure_altitude_m(enu),
        "ground_speed_mps": onboard[:, 0] + rng.normal(0, 0.3, len(received)),
        "true_track_deg": np.degrees(onboard[:, 1]) % 360,
        "address": identity["address"],
        "callsign": identity["callsign"],
        "nacp": NACP_POOR if index in POOR else NACP_GOOD,
    }
    return pl.DataFrame(columns, schema_overrides={"applies_s": pl.Float64})


def _times(path: Path, rng: np.random.Generator) -> Array:
    """When reports reach the ground: every period, give or take, if above the horizon."""
    time = np.arange(rng.uniform(0, PERIOD_S), DURATION_S, PERIOD_S)
    time = time + rng.uniform(-JITTER_S, JITTER_S, len(time))
    time = time[(time >= max(0, path.first_s + 1)) & (time < min(DURATION_S, path.last_s))]
    enu = path.enu(time)
    polar = frames.polar_from_enu(enu)
    bent = EffectiveEarth().bending(polar.range_m, ellipsoid_height(enu), SITE.height_m)
    visible = np.degrees(polar.elevation + bent) > HORIZON_DEG
    visible &= polar.range_m < REACH_M
    return time[visible & (rng.uniform(size=len(time)) < RECEIVED)]


def _error(time: Array, index: int, rng: np.random.Generator) -> Array:
    """Position error (times, 3): a first-order walk, white noise, and an offset if it is poor."""
    sd = np.array([WANDER_M, WANDER_M, WANDER_UP_M])
    walk = rng.normal(size=(len(time), 3))
    kept = np.exp(-np.diff(time, prepend=time[:1]) / WANDER_S)[:, None]
    for i in range(1, len(time)):
        walk[i] = kept[i] * walk[i - 1] + np.sqrt(1 - kept[i] ** 2) * walk[i]
    bearing = rng.uniform(0, 2 * np.pi)
    offset = POOR_OFFSET_M * np.array([np.sin(bearing), np.cos(bearing), 0.0])
    white = rng.normal(0, WHITE_M, size=(len(time), 3))
    return sd * walk + white + (offset if index in POOR else 0.0)
