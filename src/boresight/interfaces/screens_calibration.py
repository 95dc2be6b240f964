"""What a person sees of a calibration in the terminal."""

from collections.abc import Mapping, Sequence
from math import isfinite, isnan
from typing import TYPE_CHECKING, Any

from boresight.interfaces.report.calibration_words import NAMES, meaning, unit
from boresight.interfaces.report.words import figure
from boresight.interfaces.screens import table, text, written
from boresight.maths.digits import decimals, with_unit
from boresight.models.systematic import TERMS

if TYPE_CHECKING:
    from rich.console import RenderableType

    from boresight.calibration.result import Calibration, Law, TermFound

CHANNELS = {"range_m": ("range", "m"), "azimuth_deg": ("azimuth", "°")}
CHANNELS |= {"elevation_deg": ("elevation", "°"), "target_range_m": ("transponder delay", "m")}


def calibrated(found: "Calibration", outputs: Sequence[str], width: int) -> "list[RenderableType]":
    """The screen of `boresight calibrate`."""
    del width
    targets = f"{figure(found.targets)} target{'s' * (found.targets != 1)}"
    used = f"{figure(found.pairs)} {unit(found)} of {targets}"
    sensor = f"Radar {found.sensor}" if found.sensor else "The radar"
    parts = [
        text(f"{sensor} against {NAMES.get(found.reference, found.reference)}: {used}", "bold"),
        text(""),
    ]
    parts += [_terms(found), *(text(f"! {each.words}", "yellow") for each in found.directions)]
    parts += [_noise(found)]
    if any(found.dropped.values()):
        parts.append(_dropped(found))
    return [*parts, *written(outputs)]


def _terms(found: "Calibration") -> "RenderableType":
    grid = table("Systematic errors, measured minus true", "", "estimate", "sd", "95 % interval")
    for name, term in found.terms.items():
        grid.add_row(TERMS[name].words, *_figures(name, term))
    if isfinite(found.air_gain_m_per_km):
        gain = f"{found.air_gain_m_per_km:+.3f} m/km"
        grid.add_row("gain that air alone would make", gain, "", "", style="dim")
    return grid


def planted(found: "Calibration", radar: Mapping[str, Any]) -> "RenderableType":
    """What was found beside what was planted; terms that were not planted are zero."""
    heading = "The calibration, against the errors that were planted"
    grid = table(heading, "", "planted", "estimate", "sd", "95 % interval")
    for name, term in found.terms.items():
        digits = decimals(term.sd)
        grid.add_row(
            TERMS[name].words, f"{radar.get(name, 0.0):+.{digits}f}", *_figures(name, term)
        )
    return grid


def _figures(name: str, term: "TermFound") -> "tuple[RenderableType, ...]":
    of, (low, high) = TERMS[name].unit, term.ci95
    if not term.observable:
        return text("not observable", "yellow"), text("–"), text("–")
    if not (isfinite(low) and isfinite(high)):  # too few targets: `sd` is what was believed before
        digits = decimals(term.independent_sd)
        return text(with_unit(term.estimate, digits, of)), text("–"), text("too few targets")
    digits = decimals(term.sd)
    proven = low > 0 or high < 0
    estimate = text(with_unit(term.estimate, digits, of), "bold" if proven else "")
    interval = text(f"{low:+z,.{digits}f} to {high:+z,.{digits}f}")
    return estimate, text(f"{term.sd:,.{digits}f}"), interval


def _noise(found: "Calibration") -> "RenderableType":
    grid = table("What is left: noise of single plots", "", "sd", "wide part", "its sd")
    for name, (words, of) in CHANNELS.items():
        sd = getattr(found.noise, name)
        if sd is None or isnan(sd):
            continue
        law = found.noise.laws.get(name)
        wide = _wide(law, of) if law else ()
        grid.add_row(words, f"{figure(sd, 2)} {of}", *(wide or ("", "")))
    grid.add_row(
        "pairs that are no measurement", f"{100 * found.noise.outlier_share:.1f} %", "", ""
    )
    return grid


def _wide(law: "Law", unit: str) -> tuple[str, str]:
    """Share and sd of a law's wide part; what rounds to no share has no sd to speak of."""
    if round(100 * law.tail_share) < 1:
        return "none", ""
    return f"{100 * law.tail_share:.0f} %", f"{figure(law.tail_sd, 2)} {unit}"


def _dropped(found: "Calibration") -> "RenderableType":
    grid = table("Plots that were not used", "reason", "meaning", "plots", left=2)
    grid.columns[1].no_wrap = False
    for reason, number in sorted(found.dropped.items(), key=lambda each: -each[1]):
        if number:
            grid.add_row(reason, meaning(found, reason), figure(number))
    return grid
