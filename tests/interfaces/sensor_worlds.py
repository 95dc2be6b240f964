"""A made-up calibration that keeps the contract of `Calibration`: no estimator has run."""

import numpy as np
import polars as pl

from boresight.calibration.result import Calibration, Direction, Law, NoiseFound, TermFound
from boresight.maths.frames import Site
from boresight.models.systematic import SystematicErrors

PLANTED = {
    "range_bias_m": (172.0, 9.0),
    "range_gain_m_per_km": (0.21, 0.14),
    "azimuth_bias_deg": (0.535, 0.008),
    "azimuth_cos_deg": (-0.043, 0.009),
    "azimuth_sin_deg": (0.0021, 0.008),
    "time_bias_s": (0.021, 0.05),
}
RANGE_SD_M, AZIMUTH_SD_DEG, TAIL_SHARE, TAIL_SD_DEG, DELAY_SD_M = 60.0, 0.05, 0.12, 0.16, 25.0
OUTLIERS = 0.01


def residuals(pairs=12_000, targets=40, seed=1):
    """Residuals of straight flights past a radar with the planted errors."""
    rng = np.random.default_rng(seed)
    target = np.sort(rng.integers(0, targets, pairs))
    start, course = rng.uniform(-70e3, 70e3, (targets, 2)), rng.uniform(0, 2 * np.pi, targets)
    time = rng.uniform(0, 600, pairs)
    along = 210.0 * time
    east = start[target, 0] + along * np.sin(course[target])
    north = start[target, 1] + along * np.cos(course[target])
    height = rng.uniform(900, 11_000, targets)[target]
    azimuth = np.rad2deg(np.arctan2(east, north)) % 360
    slant = np.sqrt(east**2 + north**2 + height**2)
    wide = rng.uniform(size=pairs) < TAIL_SHARE
    delay = rng.normal(0, DELAY_SD_M, targets)[target]
    range_after = rng.normal(0, RANGE_SD_M, pairs) + delay
    azimuth_after = rng.normal(0, np.where(wide, TAIL_SD_DEG, AZIMUTH_SD_DEG))
    outlier = rng.uniform(size=pairs) < OUTLIERS
    range_after = range_after + np.where(outlier, rng.normal(0, 1500, pairs), 0.0)
    value = {name: each[0] for name, each in PLANTED.items()}
    range_error = value["range_bias_m"] + value["range_gain_m_per_km"] * slant / 1000
    azimuth_error = value["azimuth_bias_deg"] + value["azimuth_cos_deg"] * north / np.hypot(
        east, north
    )
    return pl.DataFrame(
        {
            "row": np.arange(pairs),
            "time_s": 30_000.0 + rng.uniform(0, 1500, targets)[target] + time,
            "target": [f"4CA{each:03X}" for each in target],
            "range_m": slant,
            "azimuth_deg": azimuth,
            "height_m": height,
            "range_before_m": range_after + range_error,
            "range_after_m": range_after,
            "azimuth_before_deg": azimuth_after + azimuth_error,
            "azimuth_after_deg": azimuth_after,
            "outlier": np.where(outlier, 1.0 - 1e-9, 0.001),
            "delay_m": delay,
        }
    )


def term(estimate, sd, *, observable=True, independent=0.2):
    """A term with a normal interval."""
    ends = (estimate - 1.96 * sd, estimate + 1.96 * sd)
    return TermFound(
        estimate=estimate,
        sd=sd,
        ci95=ends,
        observable=observable,
        independent_sd=independent * sd,
    )


def calibration(frame=None, **changes):
    """A whole calibration; `changes` replace its fields."""
    frame = residuals() if frame is None else frame
    names = tuple(PLANTED)
    estimate, sd = np.array(list(PLANTED.values())).T
    correlation = np.eye(len(names))
    correlation[0, 1] = correlation[1, 0] = -0.93
    correlation[2, 3] = correlation[3, 2] = 0.66
    words = "range bias and range gain are hardly told apart: at 54 km they add up to +183 ± 4 m"
    fields = {
        "errors": SystematicErrors(
            terms=names, estimate=estimate, cov=correlation * np.outer(sd, sd)
        ),
        "terms": {name: term(*PLANTED[name]) for name in names},
        "directions": (
            Direction(
                weights={"range_bias_m": 60.0, "range_gain_m_per_km": -1.1},
                observable=True,
                correlation=-0.93,
                words=words,
            ),
        ),
        "noise": NoiseFound(
            range_m=RANGE_SD_M,
            azimuth_deg=0.062,
            elevation_deg=None,
            target_range_m=DELAY_SD_M,
            outlier_share=OUTLIERS,
            laws={
                "range_m": Law(RANGE_SD_M, 0.0, RANGE_SD_M),
                "azimuth_deg": Law(AZIMUTH_SD_DEG, TAIL_SHARE, TAIL_SD_DEG),
            },
        ),
        "pairs": len(frame),
        "targets": frame["target"].n_unique(),
        "dropped": {"no_reference": 2310, "reference_too_old": 144, "ambiguous": 12, "late": 0},
        "reference": "adsb",
        "sensor": "008/201",
        "site": Site(latitude_deg=51.1, longitude_deg=1.2, height_m=45.0),
        "atmosphere": "none",
        "air_gain_m_per_km": 0.18,
        "residuals": frame,
        "tables": tables(),
        "settings": {"gate_m": 1500.0, "robust": True},
        "remarks": ["12 reports of <b>one</b> aircraft came twice and were taken once."],
    }
    return Calibration(**fields | changes)


def tables():
    """Tables of noise, stability and detection, binned plainly."""
    rng = np.random.default_rng(2)
    edge, sector = np.arange(0, 200e3, 10e3), np.arange(0, 360, 10.0)
    time = np.linspace(30_000, 32_100, 13)
    probability = 0.995 - 0.2 * (edge / 200e3) ** 3

    def stable(name, unit, edges, count):
        return pl.DataFrame(
            {
                f"{name}_from_{unit}": edges[:count],
                f"{name}_to_{unit}": edges[:count] + (edges[1] - edges[0]),
                "pairs": np.full(count, 300),
                "targets": np.full(count, 9),
                "range_m": rng.normal(0, 12, count),
                "range_sd_m": np.full(count, 12.0),
                "range_ci95_m": np.full(count, 27.0),
                "azimuth_deg": rng.normal(0, 0.011, count),
                "azimuth_sd_deg": np.full(count, 0.011),
                "azimuth_ci95_deg": np.full(count, 0.025),
            }
        )

    def noise(name, unit, edges):
        count = len(edges)
        return pl.DataFrame(
            {
                f"{name}_from_{unit}": edges,
                f"{name}_to_{unit}": edges + (edges[1] - edges[0]),
                "pairs": np.full(count, 300),
                "range_sd_m": 55 + 0.2e-3 * np.linspace(0, 200e3, count),
                "azimuth_sd_deg": np.full(count, 0.06),
            }
        )

    def seen(name, unit, edges):
        count = len(edges)
        share = np.resize(probability, count)
        return pl.DataFrame(
            {
                f"{name}_from_{unit}": edges,
                f"{name}_to_{unit}": edges + (edges[1] - edges[0]),
                "due": np.full(count, 900),
                "seen": np.round(900 * share).astype(int),
                "probability": share,
                "low": share - 0.02,
                "high": np.minimum(share + 0.02, 1.0),
            }
        )

    def unexplained(name, unit, edges):
        frame = seen(name, unit, edges).select(f"{name}_from_{unit}", f"{name}_to_{unit}")
        plots = rng.integers(1, 60, len(edges))
        return frame.with_columns(
            paired=np.full(len(edges), 600), unidentified=plots, unidentified_per_scan=plots / 180
        )

    return {
        "noise_by_range": noise("range", "m", edge),
        "noise_by_azimuth": noise("azimuth", "deg", sector),
        "sectors": stable("azimuth", "deg", sector, 36),
        "over_time": stable("time", "s", time, 12),
        "drift": pl.DataFrame(
            {
                "channel": ["range_m", "azimuth_deg"],
                "per_hour": [3.0, 0.041],
                "sd": [8.0, 0.011],
                "low": [-13.2, 0.019],
                "high": [19.2, 0.063],
            }
        ),
        "detection_by_range": seen("range", "m", edge),
        "detection_by_azimuth": seen("azimuth", "deg", sector),
        "false_by_range": unexplained("range", "m", edge),
        "false_by_azimuth": unexplained("azimuth", "deg", sector),
    }
