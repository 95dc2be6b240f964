"""Azimuth bias without any reference but the recording: what Mode S aircraft say of their motion.

Register BDS 5,0 holds an aircraft's true track. A radar that is turned by some angle sees every
straight flight turned by that angle, so the direction fitted to its plots minus the downlinked
track is the azimuth bias. Nothing else that is constant turns a straight flight: a range gain and a
wrong place of the antenna leave its direction, a time bias moves it along itself. A range bias b
turns it by b sin(2c) / (2 range), c being course minus azimuth, which traffic on both sides of the
radar averages out; an eccentricity of the encoder adds about its mean over the traffic's azimuths.
How far that holds is worked out for each recording (`settings["moved_by"]`).

What no statistics can see is how aircraft make the angle: rounded to the nearest step it is right
in the mean, cut to the step below it reads half a step low, and the bias seems half a step greater.
(Cut towards zero, it would differ between eastbound and westbound flight, which is looked at.)

The direction of one stretch errs by the rounding of the downlinked angle, by the noise of its
plots, and by how far the aircraft wanders about its line. Stretches are weighted for all three;
errors of one aircraft are taken as alike, and the interval is clustered by aircraft.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration import stretches
from boresight.calibration.downlink_reports import NEAREST_M, Reports, usable
from boresight.calibration.pooled import Pooled, pool
from boresight.calibration.result import Calibration, NoiseFound
from boresight.calibration.stretches import STEP_DEG, Stretches, straight
from boresight.errors import DataError
from boresight.formats.usable import column
from boresight.maths.frames import Site
from boresight.models.atmosphere import Atmosphere, spelled
from boresight.models.systematic import SystematicErrors

if TYPE_CHECKING:
    import polars as pl

Array = Any
_TERM = "azimuth_bias_deg"
FEWEST_AIRCRAFT = 3
_OUTLIER = 3.29  # standard deviations: one in a thousand of a normal law lies beyond
_MAD_TO_SD = 1.4826


def from_downlink(
    plots: "pl.DataFrame", site: Site, *, atmosphere: Atmosphere | None = None
) -> Calibration:
    """Azimuth bias and noise of a radar from its own downlinked tracks.

    Args:
        plots: of one sensor, as `formats` reads them.
        site: of the radar.
        atmosphere: whose delay is taken out of the ranges; None for none. It hardly matters here.

    Returns:
        One term, `azimuth_bias_deg`. Its `residuals` have one row for each stretch of straight
        flight, not for each plot: row (of the plot in its middle), time_s, target (its address),
        range_m, azimuth_deg and height_m (of its middle, the bias taken out), azimuth_before_deg
        and azimuth_after_deg (fitted minus downlinked direction, and that minus the bias), sd_deg
        (of a stretch), plots, tracks (how many). `dropped` counts plots; with those used they make
        up the table.

    Raises:
        DataError: no downlinked tracks, or too little straight flight with them.
    """
    if not np.isfinite(column(plots, "true_track_deg", np.nan).astype(float)).any():
        raise DataError(
            "no plot carries a downlinked true track",
            why="a Mode S radar writes it in item 250 (BDS 5,0) when it asks aircraft for it",
            next_step="calibrate against another reference: adsb, or a file of positions",
        )
    reports, dropped = usable(plots, site, atmosphere)
    rough, _, _ = _turned(reports, site, dropped)
    # North at a target depends on where it is: all are placed anew with the bias taken out.
    reports = reports.turned(-rough.value)
    rest, found, lost = _turned(reports, site, dropped)
    pooled = rest.beyond(rough.value)
    good = np.flatnonzero(found.reason == "")
    settings = _settings(reports, found, good, pooled, lost)
    lost_plots = {name: plots for name, (_, plots) in lost.items()}
    return Calibration(
        errors=_to_carry(pooled),
        terms={_TERM: pooled.term()},
        directions=(),
        noise=_noise(found, pooled),
        pairs=len(good),
        targets=len(np.unique(found.target[good])),
        dropped=dropped | lost_plots,
        reference="downlink",
        sensor=_sensor(plots),
        site=site,
        atmosphere=spelled(atmosphere),
        air_gain_m_per_km=float("nan"),
        residuals=_residuals(reports, found, good, pooled),
        settings=settings,
        remarks=_remarks(settings),
    )


def _to_carry(pooled: Pooled) -> SystematicErrors:
    """The bias as a tracker must take it: unsure also of how aircraft round their track.

    The cut is between nothing and half a step; what a tracker carries is its mean square.
    """
    cut = (STEP_DEG / 2) ** 2 / 3
    cov = np.array([[pooled.sd**2 + cut]])
    return SystematicErrors(terms=(_TERM,), estimate=np.array([pooled.value]), cov=cov)


def _turned(
    reports: Reports, site: Site, dropped: dict[str, int]
) -> tuple[Pooled, Stretches, dict[str, tuple[int, int]]]:
    """By how much the radar turns straight flight, the stretches that say so, and what was lost."""
    found, lost = straight(reports, site)
    good = np.flatnonzero(found.reason == "")
    if len(np.unique(found.target[good])) < FEWEST_AIRCRAFT:
        raise _too_little(dropped, lost)
    return _pool(found, good), found, lost


def _pool(found: Stretches, some: Array) -> Pooled:
    return pool(found.turned[some], found.sd[some], found.target[some], STEP_DEG)


def _too_little(dropped: dict[str, int], lost: dict[str, tuple[int, int]]) -> DataError:
    plots = [f"{count} plots: {name}" for name, count in dropped.items()]
    parts = [f"{count} stretches: {name}" for name, (count, _) in lost.items()]
    return DataError(
        f"fewer than {FEWEST_AIRCRAFT} aircraft fly straight for {stretches.LEAST_S:g} s with "
        f"{stretches.FEWEST_TRACKS} downlinked tracks",
        why="; ".join([*plots, *parts]),
        next_step="take a longer recording, or calibrate against another reference",
    )


def _sensor(plots: "pl.DataFrame") -> str:
    names = {*plots["sensor"].drop_nulls()} if "sensor" in plots.columns else set()
    return str(names.pop()) if len(names) == 1 else ""


def _noise(found: Stretches, pooled: Pooled) -> NoiseFound:
    range_m, azimuth = _MAD_TO_SD * np.median(np.abs(found.noise), axis=0)
    return NoiseFound(
        range_m=float(range_m),
        azimuth_deg=float(np.degrees(azimuth)),
        elevation_deg=None,
        target_range_m=float("nan"),
        outlier_share=float(np.mean(np.abs(pooled.left) > _OUTLIER * pooled.spread)),
    )


def _residuals(reports: Reports, found: Stretches, good: Array, pooled: Pooled) -> "pl.DataFrame":
    import polars as pl

    report, centre = found.report[good], found.centre[good]
    return pl.DataFrame(
        {
            "row": reports.row[report],
            "time_s": reports.time_s[report],
            "target": pl.Series(list(reports.names), dtype=pl.String).gather(found.target[good]),
            "range_m": np.linalg.norm(centre, axis=-1),
            "azimuth_deg": np.degrees(np.arctan2(centre[:, 0], centre[:, 1])) % 360.0,
            "height_m": reports.height_m[report],
            "azimuth_before_deg": pooled.value + pooled.left,
            "azimuth_after_deg": pooled.left,
            "sd_deg": pooled.spread,
            "plots": found.plots[good],
            "tracks": found.tracks[good],
        }
    )


def _settings(
    reports: Reports,
    found: Stretches,
    good: Array,
    pooled: Pooled,
    lost: dict[str, tuple[int, int]],
) -> dict[str, Any]:
    """Every choice, and what it led to."""
    return {
        "a_residual_is_of": "a stretch of straight flight",
        "azimuth_systematic_deg": STEP_DEG / 2,
        "moved_by": _moved_by(found, good, pooled.weight),
        "east_minus_west_deg": _east_minus_west(found, good),
        "stretch_least_s": stretches.LEAST_S,
        "stretch_fewest_plots": stretches.FEWEST_PLOTS,
        "stretch_fewest_tracks": stretches.FEWEST_TRACKS,
        "longest_gap_s": stretches.GAP_SCANS * reports.scan_s,
        "greatest_roll_deg": stretches.ROLL_DEG,
        "greatest_spread_deg": stretches.SPREAD_DEG,
        "nearest_m": NEAREST_M,
        "slowest_mps": stretches.SLOWEST_MPS,
        "ground_speed_gate": [stretches.SPEED_SHARE, stretches.SPEED_MPS],
        "height": "pressure altitude, taken for the height above the ellipsoid",
        "scan_s": reports.scan_s,
        "stretches_failed": {name: count for name, (count, _) in lost.items()},
        "tracks": int(found.tracks[good].sum()),
        "tracks_of_another_speed": int(found.wrong.sum()),
        "ground_speed_difference_mps": float(np.median(found.speed_difference_mps[good])),
        "wander": pooled.wander,
        "stretch_sd_deg": float(_MAD_TO_SD * np.median(np.abs(pooled.left))),
    }


def _moved_by(found: Stretches, good: Array, weight: Array) -> dict[str, float]:
    """Degrees by which one unit of each error that is not estimated moves the answer."""
    (east, north, up), (east_mps, north_mps, _) = found.centre[good].T, found.velocity[good].T
    azimuth = np.arctan2(east, north)
    half = 0.5 * np.sin(2.0 * (np.arctan2(east_mps, north_mps) - azimuth))
    slant = np.sqrt(east**2 + north**2 + up**2)
    return {
        "range_bias_m": float(np.degrees(weight @ (half * slant / (east**2 + north**2)))),
        "azimuth_cos_deg": float(weight @ (np.cos(azimuth) - np.sin(azimuth) * half)),
        "azimuth_sin_deg": float(weight @ (np.sin(azimuth) + np.cos(azimuth) * half)),
    }


def _east_minus_west(found: Stretches, good: Array) -> dict[str, float] | None:
    """Answer of eastbound flight minus that of westbound, whose downlinked tracks are negative."""
    east = found.velocity[good, 0] > 0.0
    sides = good[east], good[~east]
    if min(len(np.unique(found.target[side])) for side in sides) < FEWEST_AIRCRAFT:
        return None
    one, other = (_pool(found, side) for side in sides)
    sd = float(np.hypot(one.sd, other.sd))
    return {"estimate": float(one.value - other.value), "sd": sd}


def _remarks(settings: dict[str, Any]) -> list[str]:
    moved = settings["moved_by"]
    around = np.hypot(moved["azimuth_cos_deg"], moved["azimuth_sin_deg"])
    unseen = (
        f"The downlinked track comes in steps of {STEP_DEG:.3f} degrees. Aircraft that round it do "
        "no harm; where they cut it to the step below, the azimuth bias is up to "
        f"{STEP_DEG / 2:.3f} degrees less than the estimate. That cannot be told from a bias, and "
        "is no part of the interval, which is statistical; it is in the covariance that a tracker "
        "carries."
    )
    others = (
        "Only the azimuth bias can be found in this way: a time bias, a range gain and a wrong "
        "site turn no straight flight. In this traffic 100 m of range bias would move it by "
        f"{100 * moved['range_bias_m']:+.4f} degrees, an eccentricity of the encoder of 0.1 "
        f"degrees by at most {0.1 * around:.3f}."
    )
    rows = (
        "Each residual is of a stretch of straight flight, good to "
        f"{settings['stretch_sd_deg']:.3f} degrees; the noise is that of single plots, and of it "
        "only what changes from plot to plot."
    )
    return [unseen, *_cut_to_zero(settings["east_minus_west_deg"]), others, rows]


def _cut_to_zero(sides: dict[str, float] | None) -> list[str]:
    if sides is None:
        return []
    found = (
        f"Eastbound flight gives {sides['estimate']:+.3f} degrees more than westbound (standard "
        f"deviation {sides['sd']:.3f}): if all aircraft cut the angle towards zero it would be "
        f"{STEP_DEG:.3f}."
    )
    return [found]
