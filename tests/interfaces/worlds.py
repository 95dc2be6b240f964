"""A made-up tracking result that keeps the contract of `TrackingResult`: no filter has run."""

import numpy as np
import polars as pl
from scipy import special

from boresight.tracking.result import Comparison, FilterRow, Gain, TrackingResult

SITE = (48.95, 2.45, 130.0)
RANGE_SD_M, AZIMUTH_SD_DEG, HEIGHT_SD_M = 30.0, 0.08, 15.0


def _one_target(rng, track, scans):
    """Residuals and track rows of one aircraft that flies straight, then turns, then straight."""
    start = rng.uniform(0, 1200)
    time = start + 4.0 * np.arange(scans) + rng.normal(0, 0.01, scans)
    turn = np.where((np.arange(scans) // 60) % 3 == 1, rng.uniform(-0.6, 0.6), 0.0)
    course = np.deg2rad(rng.uniform(0, 360) + np.cumsum(turn * 4.0))
    speed = rng.uniform(90, 230)
    origin = rng.uniform(-70e3, 70e3, 2)
    east = origin[0] + np.cumsum(speed * np.sin(course) * 4.0)
    north = origin[1] + np.cumsum(speed * np.cos(course) * 4.0)
    up = np.linspace(*rng.uniform(900, 11000, 2), scans)
    slant = np.sqrt(east**2 + north**2 + up**2)
    azimuth = np.rad2deg(np.arctan2(east, north)) % 360
    straight = turn == 0
    stretch = np.where(straight, 1.0, 1.8) * rng.uniform(0.85, 1.2)
    normal = rng.normal(0, 1, (3, scans)) * stretch
    nis = np.sum(normal**2, axis=0)
    used = nis < 20
    status = np.where(used, "updated", "rejected")
    common = {"track": np.full(scans, track), "time_s": time, "nis": nis, "dof": np.full(scans, 3)}
    residuals = pl.DataFrame(
        common
        | {
            "sensor": np.full(scans, "20/129"),
            "range_m": slant,
            "azimuth_deg": azimuth,
            "range_residual_m": normal[0] * RANGE_SD_M,
            "range_sd_m": np.full(scans, RANGE_SD_M),
            "azimuth_residual_deg": normal[1] * AZIMUTH_SD_DEG,
            "azimuth_sd_deg": np.full(scans, AZIMUTH_SD_DEG),
            "height_residual_m": normal[2] * HEIGHT_SD_M,
            "height_sd_m": np.full(scans, HEIGHT_SD_M),
            "straight": straight,
            "used": used,
        }
    )
    states = {"east_m": east, "north_m": north, "up_m": up}
    states |= {"east_mps": speed * np.sin(course), "north_mps": speed * np.cos(course)}
    cov = {f"cov_{i}_{j}": np.zeros(scans) for i in range(6) for j in range(i, 6)}
    across = slant * np.deg2rad(AZIMUTH_SD_DEG) * 0.6
    along = RANGE_SD_M * 0.6
    bearing = np.deg2rad(azimuth)
    cov["cov_0_0"] = (along * np.sin(bearing)) ** 2 + (across * np.cos(bearing)) ** 2
    cov["cov_1_1"] = (along * np.cos(bearing)) ** 2 + (across * np.sin(bearing)) ** 2
    cov["cov_0_1"] = (along**2 - across**2) * np.sin(bearing) * np.cos(bearing)
    cov["cov_2_2"] = np.full(scans, 100.0)
    for i in range(3, 6):
        cov[f"cov_{i}_{i}"] = np.full(scans, 4.0)
    tracks = pl.DataFrame(
        common
        | states
        | {"up_mps": np.zeros(scans), "height_m": up + 130.0}
        | {"latitude_deg": SITE[0] + north / 111e3, "longitude_deg": SITE[1] + east / 73e3}
        | cov
        | {
            "status": status,
            "address": np.full(scans, f"F{track:05X}"),
            "mode_a": np.full(scans, f"{track % 4096:04o}"),
            "aircraft_id": np.full(scans, f"BOR{track:03d}"),
            "sensor": np.full(scans, "20/129"),
        }
    )
    return tracks, residuals


def _targets(tracks, residuals):
    used = residuals.filter(pl.col("used"))
    rows = []
    for track in tracks["track"].unique(maintain_order=True):
        mine = residuals.filter(pl.col("track") == track)
        mine_used = used.filter(pl.col("track") == track)
        dof = mine_used["dof"].sum()
        mean = mine_used["nis"].sum() / dof
        low, high = (special.chdtri(dof, tail) / dof for tail in (0.975, 0.025))
        verdict = "too confident" if mean > high else "too cautious" if mean < low else "consistent"
        fixed = track == 1
        rows.append(
            {
                "track": track,
                "address": f"F{track:05X}",
                "mode_a": f"{track % 4096:04o}",
                "aircraft_id": None if fixed else f"BOR{track:03d}",
                "first_s": mine["time_s"].min(),
                "last_s": mine["time_s"].max(),
                "plots": len(mine),
                "used": len(mine_used),
                "rejected": len(mine) - len(mine_used),
                "restarts": int(track % 17 == 0),
                "nis_per_dof": mean,
                "nis_low": low,
                "nis_high": high,
                "verdict": verdict,
                "fixed": fixed,
                "range_sd_m": 0.86 if fixed else None,
                "azimuth_sd_deg": 0.0116 if fixed else None,
            }
        )
    return pl.DataFrame(rows).sort("nis_per_dof", descending=True)


def _nis(used):
    per_dof = used["nis"] / used["dof"]
    return {
        "mean": float(used["nis"].sum() / used["dof"].sum()),
        "median": float(per_dof.median()),
        "dof": float(used["dof"].sum()),
        "scans": float(len(used)),
    }


def result(targets=51, scans=220, seed=5):
    """A made-up result of `targets` aircraft seen `scans` times each."""
    rng = np.random.default_rng(seed)
    pairs = [_one_target(rng, track, scans) for track in range(1, targets + 1)]
    tracks, residuals = (pl.concat(frames) for frames in zip(*pairs, strict=True))
    used = residuals.filter(pl.col("used"))
    straight = used.filter(pl.col("straight"))
    half = straight.filter(pl.col("time_s") > residuals["time_s"].median())
    rejected = len(residuals) - len(used)
    skipped = pl.DataFrame(
        {
            "reason": ["coasted", "duplicate"],
            "count": [172, 9],
            "meaning": ["predicted by the radar, not measured", "same target and same scan twice"],
        }
    )
    return TrackingResult(
        tracks=tracks,
        residuals=residuals,
        targets=_targets(tracks, residuals),
        skipped=skipped,
        plots=len(residuals) + 181,
        used=len(used),
        rejected=rejected,
        filter="ekf",
        nis={"all": _nis(used), "straight": _nis(straight), "straight_second_half": _nis(half)},
        settings={
            "site": {"latitude_deg": SITE[0], "longitude_deg": SITE[1], "height_m": SITE[2]},
            "sensor": "20/129",
            "atmosphere": "effective earth radius 4/3",
            "range_sd_m": RANGE_SD_M,
            "azimuth_sd_deg": AZIMUTH_SD_DEG,
            "accel_mps2": 0.8,
        },
        filters=filters(),
        scores=_scores(residuals, rng),
        remarks=["Made up for a test: no filter has run."],
    )


def _scores(residuals, rng):
    """Scores of three made-up filters: the second better by 0.02 a plot, the third worse."""
    loglik = rng.normal(-9.0, 1.0, len(residuals))
    base = residuals.select("track", "time_s", "nis", "dof", "straight")
    return pl.concat(
        base.with_columns(
            filter=pl.lit(name), loglik=loglik + gain, gain=pl.Series(np.full(len(base), gain))
        )
        for name, gain in (("ekf", 0.0), ("mekf", 0.02), ("iekf", -0.05))
    )


def filters():
    """Three made-up filters side by side; the last failed once."""
    none = Gain(mean=float("nan"), ci95=(float("nan"), float("nan")), plots=0, tracks=0)
    gains = {"ekf": none, "mekf": _gain(0.02, 0.01), "iekf": _gain(-0.05, 0.03)}
    return [
        FilterRow(
            filter=name,
            updates=11_220,
            rejected=12,
            restarts=3,
            failed_share=1e-4 if name == "iekf" else 0.0,
            scored=5_600,
            nis_per_dof=1.05,
            nis_median=0.7,
            loglik=-9.0,
            gain=gain,
            gain_straight=gain,
            range_sd_m=31.0,
            azimuth_sd_deg=0.081,
            speed_error_median_mps=0.7,
            speed_error_95_mps=3.1,
            speeds=4_000,
            ns_per_update=58.3,
            remark="its state was not finite after 1 of 11,220 plots" if name == "iekf" else "",
        )
        for name, gain in gains.items()
    ]


def _gain(mean, half):
    return Gain(mean=mean, ci95=(mean - half, mean + half), plots=5_600, tracks=51)


def comparisons():
    """Two made-up filters against a made-up truth."""
    return [
        Comparison(
            filter=name,
            position_rmse_m=rmse,
            velocity_rmse_mps=velocity,
            anees=anees,
            anees_bounds=(0.97, 1.03),
            nis_per_dof=nis,
            updates=11220,
            ns_per_update=cost,
        )
        for name, rmse, velocity, anees, nis, cost in (
            ("ekf", 61.2, 5.1, 1.42, 1.18, 24.0),
            ("mekf", 58.7, 5.0, 1.01, 1.02, 27.0),
        )
    ]


def inspection():
    """What `inspect` says of a made-up recording."""
    return {
        "format": "ASTERIX",
        "framing": "none",
        "bytes": 2_728_240,
        "skipped_bytes": 0,
        "categories": [
            {
                "category": 48,
                "edition": "1.31",
                "records": 44_085,
                "sensor": "20/129",
                "first_s": 28800.2,
                "last_s": 32399.8,
                "scan_s": 4.0,
            }
        ],
        "addresses": 177,
        "sha256": "9f" * 32,
    }
