"""The demo's radar: one plot a scan of whatever the beam crosses, with errors that are known.

A secondary radar with Mode S and a primary beside it turns once in four seconds. Truth is asked at
the instant at which the beam really points at the aircraft; what is reported is later by the
clock's error, off by the encoder's, and longer by the range bias, the transponder's own delay, the
air's group delay and noise.
"""

from dataclasses import asdict, dataclass

import numpy as np
import polars as pl

from boresight.maths import frames
from boresight.models.atmosphere import EffectiveEarth, ExponentialAtmosphere
from demo_flight import (
    DURATION_S,
    FOOT,
    SITE,
    Array,
    Path,
    ellipsoid_height,
    pressure_altitude_m,
)
from demo_traffic import CODE_CHANGE_S

NM = 1852.0
AIR = ExponentialAtmosphere()


@dataclass(frozen=True, kw_only=True)
class Radar:
    """What is planted. Errors are measured minus true; noises are standard deviations."""

    scan_s: float = 4.0
    sectors: int = 32
    range_bias_m: float = 85.0
    azimuth_bias_deg: float = 0.12
    time_bias_s: float = 0.08
    range_noise_m: float = 30.0
    azimuth_noise_deg: float = 0.08
    transponder_delay_sd_m: float = 8.0  # from aircraft to aircraft
    detection: float = 0.97
    range_half_m: float = 167_000.0  # where half of that is left, and how softly it goes
    range_soft_m: float = 5_000.0
    elevation_half_deg: float = 0.35
    elevation_soft_deg: float = 0.08
    elevation_limit_deg: float = 45.0  # the cone above the radar is silent
    primary_detection: float = 0.8
    primary_range_m: float = 60 * NM
    clutter_per_scan: float = 6.0
    coasted_share: float = 0.25  # of the scans missed in good cover a prediction is sent instead
    garbled_codes: int = 14
    garbled_levels: int = 9
    silent_level_jumps: int = 4
    split_plots: int = 15
    reflections: int = 11


RADAR = Radar()
SCANS = int(DURATION_S / RADAR.scan_s)
MONITOR = {"address": "F000FF", "mode_a": "7777", "height_m": 205.0}
MONITOR_RANGE_M, MONITOR_AZIMUTH_DEG = 4 * NM, 203.0
MONITOR_ENU = frames.enu_at_height(MONITOR_RANGE_M, np.radians(MONITOR_AZIMUTH_DEG), 205.0, SITE)
REFLECTOR_AZIMUTH_DEG, REFLECTED_FLIGHT = 310.0, 42  # one of those that hold


def observe(paths: list[Path], seed: int) -> pl.DataFrame:
    """Every report the radar sends, by true time; `kind` and `flight` say what it really is."""
    rng = np.random.Generator(np.random.Philox(key=[seed, 2]))
    delays = transponder_delays_m(len(paths), seed)
    hits = pl.concat([_hits(i, path, float(delays[i]), rng) for i, path in enumerate(paths)])
    seen = _spoiled(hits.filter("detected"), rng)
    false = [_clutter(rng), _split(seen, rng), _reflected(seen, rng), _coasted(hits, rng)]
    everything = pl.concat([seen, _monitor(rng), *false], how="diagonal").drop("detected", "chance")
    inside = pl.col("true_s").is_between(0, DURATION_S, closed="left")
    return everything.filter(inside).sort("true_s")


def transponder_delays_m(count: int, seed: int) -> Array:
    """What each aircraft's own transponder adds to its range, in the order of the flights."""
    rng = np.random.Generator(np.random.Philox(key=[seed, 3]))
    return rng.normal(0.0, RADAR.transponder_delay_sd_m, count)


def facts() -> dict[str, object]:
    """What is planted, by name, for whoever wants to find it again."""
    return {
        **asdict(RADAR),
        "scans": SCANS,
        "atmosphere": {"kind": "exponential", **asdict(AIR)},
        "monitor": {**MONITOR, "range_m": MONITOR_RANGE_M, "azimuth_deg": MONITOR_AZIMUTH_DEG},
    }


def _hits(index: int, path: Path, delay_m: float, rng: np.random.Generator) -> pl.DataFrame:
    """Every time the beam passes a flight: what would be measured, and whether it is."""
    time = _crossings(path)
    enu, identity = path.enu(time), path.flight.identity
    chance = _chance(enu)
    columns = {
        "kind": "aircraft",
        "flight": index,
        "true_s": time,
        **_measure(enu, delay_m, rng),
        **_replies(path, time),
        "report_type": _report_type(identity["address"], enu, rng),
        "chance": chance,
        "detected": rng.uniform(size=len(time)) < chance,
    }
    return pl.DataFrame(columns)


def _crossings(path: Path) -> Array:
    """Times at which the beam points at the flight: where beam and flight are whole turns apart."""
    grid = np.arange(path.first_s, path.last_s, 0.25)
    winding = np.unwrap(frames.polar_from_enu(path.enu(grid)).azimuth)

    def lead(time: Array) -> Array:
        """Turns that the beam is ahead of the flight, counted on over North."""
        azimuth = frames.polar_from_enu(path.enu(time)).azimuth
        whole = np.round((np.interp(time, grid, winding) - azimuth) / (2 * np.pi))
        return time / RADAR.scan_s - whole - azimuth / (2 * np.pi) - RADAR.azimuth_bias_deg / 360

    ahead = np.maximum.accumulate(lead(grid))  # overhead a flight can outrun the beam
    turns = np.arange(np.ceil(ahead[0]), ahead[-1])
    time = np.interp(turns, ahead, grid)
    for _ in range(5):
        time = np.clip(time + RADAR.scan_s * (turns - lead(time)), grid[0], grid[-1])
    return time


def _chance(enu: Array) -> Array:
    """Probability of detection: falls off with range, at the horizon, and in the cone above."""
    polar, site_height = frames.polar_from_enu(enu), SITE.height_m
    bent = EffectiveEarth().bending(polar.range_m, ellipsoid_height(enu), site_height)
    elevation = np.degrees(polar.elevation + bent)
    near = _softly((RADAR.range_half_m - polar.range_m) / RADAR.range_soft_m)
    high = _softly((elevation - RADAR.elevation_half_deg) / RADAR.elevation_soft_deg)
    return RADAR.detection * near * high * (elevation < RADAR.elevation_limit_deg)


def _softly(x: Array) -> Array:
    return (1 + np.tanh(x / 2)) / 2


def _measure(enu: Array, delay_m: float, rng: np.random.Generator) -> dict[str, Array]:
    """Slant range and azimuth as the radar reports them."""
    polar = frames.polar_from_enu(enu)
    air = AIR.excess_range(polar.range_m, ellipsoid_height(enu), SITE.height_m)
    late = rng.normal(RADAR.range_bias_m + delay_m, RADAR.range_noise_m, len(enu))
    off = rng.normal(RADAR.azimuth_bias_deg, RADAR.azimuth_noise_deg, len(enu))
    return {
        "range_m": polar.range_m + air + late,
        "azimuth_deg": (np.degrees(polar.azimuth) + off) % 360,
    }


def _replies(path: Path, time: Array) -> dict[str, object]:
    """What the transponder says, and the register that the radar asks for."""
    identity, onboard = path.flight.identity, path.onboard(time)
    later = identity.get("later_mode_a", identity["mode_a"])
    step = (100 if path.flight.kind == "light" else 25) * FOOT  # old encoders speak in hundreds
    return {
        "mode_a": np.where(time < CODE_CHANGE_S, identity["mode_a"], later),
        "pressure_altitude_m": np.round(pressure_altitude_m(path.enu(time)) / step) * step,
        "address": identity["address"],
        "callsign": identity["callsign"] if identity["address"] else "",
        "ground_speed_mps": onboard[:, 0],
        "true_track_deg": np.degrees(onboard[:, 1]) % 360,
        "climb_mps": onboard[:, 2],
        "roll_deg": np.degrees(onboard[:, 3]),
    }


def _report_type(address: str, enu: Array, rng: np.random.Generator) -> Array:
    """I048/020 TYP: 5 (Mode S) or 2 (without), 7 or 3 where the primary has an echo too."""
    alone, both = (5, 7) if address else (2, 3)
    near = np.linalg.norm(enu, axis=-1) < RADAR.primary_range_m
    return np.where(near & (rng.uniform(size=len(enu)) < RADAR.primary_detection), both, alone)


def _spoiled(seen: pl.DataFrame, rng: np.random.Generator) -> pl.DataFrame:
    """Garble some codes and levels and say so; let a few levels jump and say nothing."""
    sizes = (RADAR.garbled_codes, RADAR.garbled_levels, RADAR.silent_level_jumps)
    rows = rng.choice(len(seen), sum(sizes), replace=False)
    codes, levels, jumps = np.split(rows, np.cumsum(sizes)[:-1])
    mode_a, level = seen["mode_a"].to_list(), seen["pressure_altitude_m"].to_numpy().copy()
    for row in codes:
        mode_a[row] = f"{int(mode_a[row], 8) & 0o7070:04o}"
    wrong = np.concatenate([levels, jumps])
    level[wrong] += (
        rng.integers(12, 60, len(wrong)) * np.where(level[wrong] < 6e3, 100, -100) * FOOT
    )
    return seen.with_columns(
        mode_a=pl.Series(mode_a),
        pressure_altitude_m=level,
        mode_a_garbled=np.isin(np.arange(len(seen)), codes),
        level_garbled=np.isin(np.arange(len(seen)), levels),
        level_wrong=np.isin(np.arange(len(seen)), wrong),
    )


def _clutter(rng: np.random.Generator) -> pl.DataFrame:
    """Primary echoes of nothing, crowded near the radar."""
    count = rng.poisson(RADAR.clutter_per_scan * SCANS)
    time = rng.uniform(0, DURATION_S, count)
    return pl.DataFrame(
        {
            "kind": "clutter",
            "true_s": time,
            "range_m": 1.5 * NM + np.minimum(rng.exponential(16 * NM, count), 58 * NM),
            "azimuth_deg": time / RADAR.scan_s % 1 * 360,
            "report_type": np.full(count, 1),
        }
    )


def _monitor(rng: np.random.Generator) -> pl.DataFrame:
    """The fixed transponder, every scan."""
    enu = np.tile(MONITOR_ENU, (SCANS, 1))
    phase = (MONITOR_AZIMUTH_DEG + RADAR.azimuth_bias_deg) / 360
    return pl.DataFrame(
        {
            "kind": "monitor",
            "true_s": (np.arange(SCANS) + phase) * RADAR.scan_s,
            **_measure(enu, 0.0, rng),
            "mode_a": MONITOR["mode_a"],
            "pressure_altitude_m": np.round(pressure_altitude_m(enu) / (25 * FOOT)) * 25 * FOOT,
            "address": MONITOR["address"],
            "callsign": "",
            "report_type": np.full(SCANS, 5),
        }
    )


def _split(seen: pl.DataFrame, rng: np.random.Generator) -> pl.DataFrame:
    """Some plots twice in a scan: the second a little later, off by some beam widths' share."""
    later = rng.uniform(0.25, 0.6, RADAR.split_plots)
    again = seen[np.sort(rng.choice(len(seen), RADAR.split_plots, replace=False))]
    return again.with_columns(
        kind=pl.lit("split"),
        true_s=pl.col("true_s") + later / 360 * RADAR.scan_s,
        azimuth_deg=(pl.col("azimuth_deg") + later) % 360,
        range_m=pl.col("range_m") + rng.normal(0, 60, RADAR.split_plots),
    )


def _reflected(seen: pl.DataFrame, rng: np.random.Generator) -> pl.DataFrame:
    """One flight also seen by way of a hangar, too far away and at the hangar's azimuth."""
    ghost = seen.filter(flight=REFLECTED_FLIGHT).slice(60, RADAR.reflections)
    scan = np.floor(ghost["true_s"].to_numpy() / RADAR.scan_s)
    azimuth = rng.normal(REFLECTOR_AZIMUTH_DEG, RADAR.azimuth_noise_deg, len(ghost))
    return ghost.with_columns(
        kind=pl.lit("reflection"),
        true_s=(scan + azimuth / 360) * RADAR.scan_s,
        azimuth_deg=azimuth,
        range_m=pl.col("range_m") + 2_600.0,
        report_type=pl.lit(5, pl.Int64),
    )


def _coasted(hits: pl.DataFrame, rng: np.random.Generator) -> pl.DataFrame:
    """A prediction sent in place of a missed plot: on along the line of the two plots before."""
    angle = np.radians(hits["azimuth_deg"].to_numpy())
    place = hits["range_m"].to_numpy() * np.exp(1j * angle)
    ahead = np.zeros_like(place)
    ahead[2:] = 2 * place[1:-1] - place[:-2]
    before = [pl.col(name).shift(k) for name in ("detected", "flight") for k in (1, 2)]
    missed = ~pl.col("detected") & (pl.col("chance") > 0.9) & before[0] & before[1]
    missed &= (before[2] == pl.col("flight")) & (before[3] == pl.col("flight"))
    predicted = hits.with_columns(
        kind=pl.lit("coasted"),
        range_m=np.abs(ahead),
        azimuth_deg=np.degrees(np.angle(ahead)) % 360,
        report_type=pl.lit(0, pl.Int64),
    ).filter(missed)
    return predicted.filter(rng.uniform(size=len(predicted)) < RADAR.coasted_share)
