"""`boresight demo`: the recording that comes with the package, calibrated, tracked, held to truth.

The sky is invented and its truth known, and so are the radar's errors. Its ADS-B reports find them
(`calibration`). Each filter then tracks without a calibration, held against the truth and against
the truth as this radar, with its errors of range, azimuth and time, would see it without noise; and
the last one tracks again with the calibration, held against the truth alone.
"""

import io
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from typing import Any

from boresight.calibration import references
from boresight.calibration.calibrate import calibrate
from boresight.calibration.result import Calibration
from boresight.catalogue import lookup
from boresight.experiments.against_truth import (
    ELSEWHERE_M,
    Held,
    PlotError,
    false_tracks,
    hold,
    plot_error,
)
from boresight.experiments.truth import Truth
from boresight.formats.recording import Recording, read_recording
from boresight.maths.frames import Site
from boresight.models.atmosphere import ExponentialAtmosphere
from boresight.tracking.noise import Noise
from boresight.tracking.result import Comparison, TrackingResult
from boresight.tracking.tracker import track

FILTERS = ("ekf", "mekf")
CALIBRATED = f"{FILTERS[-1]}, calibrated"
AIR = ExponentialAtmosphere()  # the demo's radar looks through air, as every radar does
Progress = Callable[[str], None]
_FOLDER = files("boresight") / "demo"


@dataclass(frozen=True, kw_only=True)
class DemoResult:
    """What the demo found.

    Attributes:
        facts: what was planted, and counts, as shipped.
        recording: what was read out of the bytes.
        calibration: what the recording's own ADS-B says of the radar.
        results: filter's name to its tracks; the last with the calibration (`CALIBRATED`).
        comparisons: each of them against the truth.
        as_seen: each filter without it, against the truth as the biased radar would see it without
            noise.
        straight: the same in straight flight only (downlinked roll below 2 degrees), the flight
            that a constant-velocity filter describes.
        plot_error: the same for plots before filtering.
        false_tracks: numbers of tracks with a flight's identity and not where it was, such as a
            reflection's; the figures above leave them out.
        remarks: sentences for the reader.
    """

    facts: dict[str, Any]
    recording: Recording
    calibration: Calibration
    results: dict[str, TrackingResult]
    comparisons: list[Comparison]
    as_seen: list[Comparison]
    straight: list[Comparison]
    plot_error: PlotError
    false_tracks: list[int]
    remarks: list[str]


def run_demo(progress: Progress | None = None) -> DemoResult:
    """Decode the shipped recording, calibrate, track with each filter, hold that to the truth.

    Args:
        progress: called with a few words before each stage.
    """
    say = progress or (lambda _: None)
    say("decoding the recording")
    facts, truth = shipped()
    with as_file(_FOLDER / "recording.ast") as path:
        recording = read_recording(path)
    site = Site(**facts["site"])
    say("calibrating against the recording's ADS-B")
    adsb = references.from_recording(recording, "adsb")
    calibration = calibrate(recording.plots, adsb, site, atmosphere=AIR)
    results, held = {}, []
    for name in FILTERS:
        say(f"tracking with {name}")
        results[name], ns = _tracked(recording, name, site=site)
        held.append(hold(results[name], truth, facts, ns))
    say(f"tracking with {CALIBRATED}")
    using = _using(calibration)
    results[CALIBRATED], ns = _tracked(recording, FILTERS[-1], site=site, **using)
    corrected = hold(results[CALIBRATED], truth, facts, ns).true
    false = false_tracks(results[FILTERS[-1]], truth, facts)
    error = plot_error(results[FILTERS[-1]], truth, facts, false)
    true, seen, straight = (list(one) for one in zip(*held, strict=True))
    corrected = replace(corrected, filter=CALIBRATED)
    return DemoResult(
        facts=facts,
        recording=recording,
        calibration=calibration,
        results=results,
        comparisons=[*true, corrected],
        as_seen=seen,
        straight=straight,
        plot_error=error,
        false_tracks=false,
        remarks=_remarks(facts, held, corrected, error, len(false)),
    )


def _using(calibration: Calibration) -> dict[str, Any]:
    """What the tracker takes of a calibration."""
    noise = calibration.noise
    return {
        "atmosphere": AIR,
        "errors": calibration.errors,
        "sensor_noise": (noise.range_m, noise.azimuth_deg),
        "delay_m": noise.target_range_m,
    }


def _tracked(recording: Recording, name: str, **given: Any) -> tuple[TrackingResult, float]:
    """Tracks, and the processor time per update (ns) of tracking once more with the noise known."""
    chosen = lookup(name)
    result = track(recording.plots, filter=chosen, **given)
    noise, start = Noise(**result.settings["noise"]), time.process_time_ns()
    track(recording.plots, filter=chosen, noise=noise, **given)
    return result, (time.process_time_ns() - start) / max(result.used, 1)


def shipped() -> tuple[dict[str, Any], Truth]:
    """Return what was planted and the truth, as they come with the package."""
    import polars as pl

    facts = json.loads((_FOLDER / "facts.json").read_text(encoding="utf-8"))
    return facts, Truth(pl.read_parquet(io.BytesIO((_FOLDER / "truth.parquet").read_bytes())))


def _remarks(
    facts: dict[str, Any],
    held: list[Held],
    corrected: Comparison,
    error: PlotError,
    false: int,
) -> list[str]:
    """Say what the figures mean."""
    radar = facts["radar"]
    biased = (
        f"The radar's planted errors are {radar['range_bias_m']:+g} m in range, "
        f"{radar['azimuth_bias_deg']:+g} degrees in azimuth and {radar['time_bias_s']:+g} s in "
        f"time. {FILTERS[0]} and {FILTERS[-1]} track without a calibration; {CALIBRATED}, with "
        f"what the recording's ADS-B says of them, is {corrected.position_rmse_m:.0f} m off the "
        "truth."
    )
    plots = (
        f"Before any filter the plots are {error.as_measured:.0f} m off horizontally (root mean "
        f"square); {100 * error.share_of_bias:.0f} % of its square is bias, the noise alone "
        f"{error.unbiased:.0f} m."
    )
    left_out = (
        f"Tracks left out of these figures, since they bear a flight's identity more than "
        f"{ELSEWHERE_M / 1e3:g} km from it (reflections): {false}."
    )
    return [biased, plots, *map(_difference, held), *([left_out] if false else [])]


def _difference(held: Held) -> str:
    true, seen, straight = held
    return (
        f"{true.filter}: {true.position_rmse_m:.0f} m and {true.velocity_rmse_mps:.1f} m/s off the "
        f"truth, {seen.position_rmse_m:.0f} m and {seen.velocity_rmse_mps:.1f} m/s off what this "
        "radar would see without noise; the difference is bias, which tracking alone cannot "
        f"remove. In straight flight the latter is {straight.position_rmse_m:.0f} m and "
        f"{straight.velocity_rmse_mps:.1f} m/s, its ANEES {straight.anees:.2f}; a filter of "
        f"constant velocity cannot be consistent in turns ({seen.anees:.1f} over all flight)."
    )
