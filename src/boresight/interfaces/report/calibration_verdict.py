"""A calibration's verdict: what is wrong with the sensor, how sure, and what is not told."""

import math
from collections.abc import Iterator
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.interfaces.report.calibration_findings import (
    Finding,
    findings,
    has_interval,
    shown_sd,
    systematic,
)
from boresight.interfaces.report.calibration_residuals import inliers, measured
from boresight.interfaces.report.calibration_scale import Typical
from boresight.interfaces.report.calibration_words import MEANING, REFERENCES, unit
from boresight.interfaces.report.residuals import column
from boresight.interfaces.report.verdict import Sentence, damage
from boresight.interfaces.report.words import figure, interval
from boresight.maths.digits import decimals, with_unit
from boresight.models.systematic import TERMS

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration, TermFound

FEW_TARGETS = 20  # fewer, and intervals clustered by target are themselves rough
UNALIKE = 1.5  # times the naive interval: worth a sentence
ECCENTRICITY = ("azimuth_cos_deg", "azimuth_sin_deg")


def sentences(
    calibration: "Calibration", typical: Typical, inspection: dict[str, Any]
) -> list[Sentence]:
    """Return the verdict of a calibration, most important first."""
    parts = (
        _errors(calibration, typical),
        _eccentricity(calibration, typical),
        _said(calibration, Finding.WITHIN),
        _none(calibration, typical),
        *(_said(calibration, kind) for kind in (Finding.SHARED, Finding.ENDLESS, Finding.UNSEEN)),
        _directions(calibration),
        _systematic(calibration),
        _air(calibration),
        _what_is_left(calibration),
        _outliers(calibration),
        _sureness(calibration),
        _reference(calibration),
        damage(inspection),
    )
    return [sentence for part in parts for sentence in part]


def _errors(calibration: "Calibration", typical: Typical) -> Iterator[Sentence]:
    shown = [name for name in _of(calibration, Finding.ERROR) if name not in ECCENTRICITY]
    moves = {n: abs(calibration.terms[n].estimate) * typical.metres(n) for n in shown}
    for name, moved in sorted(moves.items(), key=lambda item: -item[1]):
        term, kind = calibration.terms[name], TERMS[name]
        meaning = MEANING[name][term.estimate < 0]
        yield Sentence(
            "attention",
            f"<b>{kind.words.capitalize()} {_estimate(name, term)}</b> (95 % interval "
            f"{_interval(name, term)}): {meaning}. That is {figure(moved, 2)} m for a target at "
            f"{typical.words(name)}.",
            "bias",
        )


def _estimate(name: str, term: "TermFound") -> str:
    return with_unit(term.estimate, decimals(shown_sd(term)), TERMS[name].unit)


def _interval(name: str, term: "TermFound") -> str:
    return interval(term.ci95, decimals(shown_sd(term)), TERMS[name].unit)


def _eccentricity(calibration: "Calibration", typical: Typical) -> Iterator[Sentence]:
    """Say cosine and sine together, as what they are: a swing around the circle."""
    shown = [name for name in _of(calibration, Finding.ERROR) if name in ECCENTRICITY]
    if not shown:
        return
    cosine, sine = (calibration.errors.value(name) for name in ECCENTRICITY)
    swing, where = math.hypot(cosine, sine), math.degrees(math.atan2(sine, cosine)) % 360
    said = " and ".join(
        f"{TERMS[name].words.split(', ')[1]} {_estimate(name, calibration.terms[name])}"
        for name in shown
    )
    yield Sentence(
        "attention",
        f"<b>Azimuth errors swing by ±{figure(swing, 2)}°</b> around the circle and are most "
        f"positive towards {where:.0f}°, as those of an encoder that is off its centre "
        f"({said}, interval without zero). That is up to "
        f"{figure(swing * typical.metres(ECCENTRICITY[0]), 2)} m at {typical.words()}.",
        "bias",
    )


def _none(calibration: "Calibration", typical: Typical) -> Iterator[Sentence]:
    """Name the terms whose interval holds zero, and say how large they may still be."""
    rest = _of(calibration, Finding.NONE)
    if not rest:
        return
    noise = typical.noise_m(calibration.noise)
    largest = max(max(map(abs, t.ci95)) * typical.metres(n) for n, t in rest.items())
    is_tight = largest <= noise
    hidden = f"up to {figure(largest, 2)} m at {typical.words(*rest)}"
    if is_tight:
        hidden += ", less than the noise of one plot"
    yield Sentence(
        "good" if is_tight else "note",
        f"No error shows itself in {_listed(rest)}: each interval holds zero. They may still hide "
        f"{hidden}.",
        "bias",
    )


# What is said of all terms of one finding together.
SAID = {
    Finding.WITHIN: Sentence(
        "note",
        "{Figures}: not zero, but no more than the systematic part beside the interval, so it is "
        "not shown to be the radar's.",
        "bias",
    ),
    Finding.SHARED: Sentence(
        "note",
        "Hardly told apart from others, so that zero for one means more of another: {figures}. "
        "Use them together, as this calibration does.",
        "separable",
    ),
    Finding.ENDLESS: Sentence(
        "attention",
        "<b>No interval can be given for {names}</b>: it takes several targets to see how far "
        "their errors differ. How far off the estimates are is not known.",
        "bias",
    ),
    Finding.UNSEEN: Sentence(
        "attention",
        "<b>Not observable here: {names}.</b> Where these targets flew, the geometry does not tell "
        "it. There is no number to use, and a correction by this calibration holds only for "
        "targets seen in the same way.",
        "separable",
    ),
}


def _said(calibration: "Calibration", kind: Finding) -> Iterator[Sentence]:
    terms = _of(calibration, kind)
    if terms:
        said, figures = SAID[kind], _listed(terms)
        told = {"figures": figures, "Figures": figures.capitalize(), "names": _words(terms)}
        yield said._replace(html=said.html.format(**told))


def _listed(terms: "dict[str, TermFound]") -> str:
    return "; ".join(
        f"{TERMS[name].words} {_estimate(name, term)} ({_interval(name, term)})"
        for name, term in terms.items()
    )


def _of(calibration: "Calibration", kind: Finding) -> "dict[str, TermFound]":
    found = findings(calibration)
    return {name: each for name, each in calibration.terms.items() if found[name] is kind}


def _words(terms: "dict[str, TermFound]") -> str:
    return "; ".join(TERMS[name].words for name in terms)


def _directions(calibration: "Calibration") -> Iterator[Sentence]:
    for each in calibration.directions:
        words = escape(each.words[:1].upper() + each.words[1:])
        yield Sentence("note" if each.observable else "attention", words, "separable")


def _systematic(calibration: "Calibration") -> Iterator[Sentence]:
    beyond = systematic("azimuth_bias_deg", calibration)
    if beyond:
        yield Sentence(
            "attention",
            f"Beside the interval there is a systematic part of up to {figure(beyond, 2)}° that no "
            "amount of data takes away: whether an aircraft rounds or truncates the angle it sends "
            "cannot be told from an azimuth bias.",
            "bias",
        )


def _air(calibration: "Calibration") -> Iterator[Sentence]:
    term, air = calibration.terms.get("range_gain_m_per_km"), calibration.air_gain_m_per_km
    if term is None or not math.isfinite(air):
        return
    places = decimals(shown_sd(term))
    said = f"{with_unit(air, max(places, 2), 'm/km')}"
    if calibration.atmosphere != "none":
        text = (
            f"The delay of the air was taken out before ({escape(calibration.atmosphere)}). It "
            f"would have looked like a range gain of {said} over these pairs."
        )
    elif not (term.observable and has_interval(term)):
        text = f"The delay of a standard atmosphere alone looks like a range gain of {said} here."
    else:
        low, high = term.ci95
        verdict = (
            "no more than the air explains" if low <= air <= high else "not what the air explains"
        )
        text = (
            f"The range gain is {_estimate('range_gain_m_per_km', term)}; the delay of a standard "
            f"atmosphere, which was not taken out, would look like {said} over these pairs: "
            f"{verdict}, within the 95 % interval."
        )
    yield Sentence("note", text, "bias")


def _what_is_left(calibration: "Calibration") -> Iterator[Sentence]:
    """Say what correcting is worth: root mean square residuals before and after."""
    kept = inliers(calibration.residuals)
    parts, worth = [], []
    for channel in measured(kept):
        squares = (np.square(column(kept, name)) for name in channel.columns)
        before, after = (float(np.sqrt(np.nanmean(each))) for each in squares)
        sign = channel.unit if channel.unit == "°" else f" {channel.unit}"
        parts.append(f"{channel.words} {figure(before, 3)} to {figure(after, 3)}{sign}")
        worth.append(after / before if before else 1.0)
    if parts:
        yield Sentence(
            "good" if min(worth) < 0.95 else "note",
            f"Taking these errors out lowers the root mean square residual: {'; '.join(parts)}. "
            f"The noise of one plot is {_noise(calibration)}.",
            "before-after",
        )


def _noise(calibration: "Calibration") -> str:
    noise, said = calibration.noise, []
    for words, value, sign, name in (
        ("range", noise.range_m, " m", "range_m"),
        ("azimuth", noise.azimuth_deg, "°", "azimuth_deg"),
        ("elevation", noise.elevation_deg, "°", "elevation_deg"),
    ):
        if value is None or not math.isfinite(value):
            continue
        law = noise.laws.get(name)
        tail = (
            f" ({100 * law.tail_share:.2g} % from a wider law of {figure(law.tail_sd, 2)}{sign})"
            if law and law.tail_share >= 0.005
            else ""
        )
        said.append(f"{words} {figure(value, 2)}{sign}{tail}")
    return ", ".join(said)


def _outliers(calibration: "Calibration") -> Iterator[Sentence]:
    share, delay = calibration.noise.outlier_share, calibration.noise.target_range_m
    if share > 0.0005:
        yield Sentence(
            "note" if share < 0.02 else "attention",
            f"{100 * share:.2g} % of the {unit(calibration)} are no measurement of their target: "
            "a wrong identity, place or time. They carry no weight.",
            "noise",
        )
    if math.isfinite(delay) and delay > 0:
        yield Sentence(
            "note",
            f"Range errors differ from target to target with an sd of {figure(delay, 2)} m, as "
            "the delays of transponders do; the radar cannot be blamed for it.",
            "noise",
        )


def _sureness(calibration: "Calibration") -> Iterator[Sentence]:
    terms = [each for each in calibration.terms.values() if each.observable and has_interval(each)]
    if not terms:
        return
    ratios = [t.sd / t.independent_sd for t in terms if t.independent_sd > 0]
    text = (
        f"The intervals take the errors of one target as alike: {figure(calibration.pairs)} "
        f"{unit(calibration)} count as {figure(calibration.targets)} targets."
    )
    if ratios and max(ratios) > UNALIKE:
        text += (
            f" Were all taken as independent, they would be up to {figure(max(ratios), 2)} "
            "times narrower, and wrong."
        )
    is_few = calibration.targets < FEW_TARGETS
    if is_few:
        text += " So few make the intervals themselves rough."
    yield Sentence("attention" if is_few else "good", text, "bias")


def _reference(calibration: "Calibration") -> Iterator[Sentence]:
    name = calibration.reference
    text = REFERENCES.get(name, f"The reference is {escape(name)}.")
    yield Sentence("attention" if name == "system tracks" else "note", text, "pairs")
