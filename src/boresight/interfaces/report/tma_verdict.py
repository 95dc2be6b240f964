"""What is known of a contact and what is not, in plain words, with what would decide it."""

import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING

from boresight.interfaces.report.residuals import column
from boresight.interfaces.report.tma_tables import failures
from boresight.interfaces.report.tma_words import (
    BEARING,
    COURSE,
    KNOT_MPS,
    RANGE,
    SPEED,
    estimate,
    hull,
    knots,
    seconds,
)
from boresight.interfaces.report.verdict import Sentence
from boresight.interfaces.report.words import figure
from boresight.target_motion.doubts import is_too_sure, of_residuals

if TYPE_CHECKING:
    from boresight.target_motion.result import Criteria, TargetMotion, TmaResult

FEW = 10  # bearings
DOUBT = (
    "What is said of range, course and speed holds for a steady target on a straight track and for "
    "the stated noise. These residuals speak against that: take it, and its sd, with reserve."
)
APART = 2.0  # sd between the filter's range and the batch estimate's: worth a warning


def sentences(motion: "TargetMotion", stem: str = "") -> list[Sentence]:
    """Return the verdict of one contact, most important first.

    Args:
        motion: the contact's answer.
        stem: what the names of its panels begin with.
    """
    parts = (
        _range(motion),
        _doubts(motion),
        _sides(motion),
        _motion(motion),
        _converged(motion),
        _batch(motion),
        _residuals(motion),
        _few(motion),
    )
    return [each._replace(link=stem + each.link) for part in parts for each in part]


def _range(motion: "TargetMotion") -> Iterator[Sentence]:
    within = hull(RANGE, motion.range_m)
    if motion.observable:
        since = seconds(motion.observability.since_s)
        yield Sentence(
            "good" if motion.converged_s is not None else "note",
            f"<b>Range {estimate(RANGE, motion.range_m)}</b> at the last bearing; with 90 % it "
            f"lies within {within}. The bearings alone tell it since {since}.",
            "picture",
        )
        return
    believed = f" With what was believed before, it lies within {within} with 90 %."
    if not within or _too_sure(motion):
        believed = ""
    text = f"<b>The range cannot be told yet:</b> {_why(motion)}{believed}"
    yield Sentence("attention", text, "picture")


def _why(motion: "TargetMotion") -> str:
    seen = motion.observability
    if not seen.manoeuvred:
        return (
            "own ship has not manoeuvred. On a straight own course every range fits the bearings "
            "equally well. A turn of own ship would decide it."
        )
    sd = "" if math.isinf(seen.range_sd_m) else f"{figure(seen.range_sd_m / 1e3, 2)} km"
    left = f"bearings alone leave it an sd of {sd}. " if sd else "bearings alone leave it open. "
    best = (
        f"Own ship's course could have told it to {figure(seen.at_best_percent, 2)} % at best. "
        if math.isfinite(seen.at_best_percent)
        else ""
    )
    return (
        f"own ship has manoeuvred, but {left}{best}A longer leg across the line of sight, or a "
        "further turn, would decide it."
    )


def _doubts(motion: "TargetMotion") -> Iterator[Sentence]:
    """Say what speaks against the answer."""
    of_bearings = of_residuals(motion.residuals, motion.bearings)
    for words in motion.remarks:
        link = "residuals" if words in of_bearings else "history"
        yield Sentence("attention", escape(words), link)
    tests = motion.residuals.tests if motion.residuals else ()
    if not all(test.passed for test in tests):
        yield Sentence("attention", DOUBT, "residuals")


def _too_sure(motion: "TargetMotion") -> bool:
    sd, bound = (column(motion.history, name)[-1] for name in (RANGE.sd, RANGE.bound))
    return is_too_sure(float(sd), float(bound))


def _sides(motion: "TargetMotion") -> Iterator[Sentence]:
    if not motion.sides:
        return
    first, *others = motion.sides
    if motion.decided:
        text = (
            f"<b>The contact is to {first.name}</b> (probability {_share(first.probability)}): "
            "own ship's turn has decided between the two sides of the array."
        )
        yield Sentence("good", text, "cells")
        return
    each = ", ".join(
        f"{side.name} with {_share(side.probability)}"
        + (f" (bearing {estimate(BEARING, side.bearing_deg)})" if side.bearing_deg.sd else "")
        for side in (first, *others)
    )
    text = (
        f"<b>Both sides of the array are possible:</b> {each}. The array hears a cone, the same on "
        "either side; a turn of own ship would decide."
    )
    yield Sentence("attention", text, "cells")


def _share(probability: float) -> str:
    return f"{100 * probability:.1f} %"


def _motion(motion: "TargetMotion") -> Iterator[Sentence]:
    said = []
    if motion.bearing_deg.sd is not None:
        said.append(f"Bearing {estimate(BEARING, motion.bearing_deg)} at the last bearing.")
    course, speed = motion.course_deg, motion.speed_mps
    if speed.estimate is not None and speed.sd is not None:
        said.append(
            f"<b>Course {estimate(COURSE, course)}</b>, <b>speed {estimate(SPEED, speed)}</b> "
            f"({knots(speed.estimate, speed.sd)})."
        )
    elif course.regions and not _too_sure(motion):
        said.append(
            "Course and speed go with the range and are no better known: with 90 % "
            f"{hull(COURSE, course)}, and {hull(SPEED, speed)}."
        )
    if said:
        yield Sentence("note", " ".join(said), "history")


def _converged(motion: "TargetMotion") -> Iterator[Sentence]:
    when, limits = motion.convergence, criteria(motion.criteria)
    bound = (
        f"The Cramér-Rao bound permits it from {seconds(when.permitted_s)} on."
        if when.permitted_s is not None
        else "The Cramér-Rao bound does not permit it on these bearings."
    )
    if (when.permitted_s or 0.0) > (when.sustained_s or math.inf):
        bound += " Until then the filter was surer than can be counted on."
    if when.sustained_s is not None:
        first = "" if when.first_s in (None, when.sustained_s) else _first(when.first_s)
        text = f"<b>Good enough since {seconds(when.sustained_s)}</b>{first}: {limits}. {bound}"
        yield Sentence("good", text, "history")
    elif when.first_s is not None:
        text = (
            f"Good enough for the first time at {seconds(when.first_s)}, but <b>not to the end</b>"
        )
        yield Sentence("attention", f"{text}: {limits}. {bound}", "history")
    else:
        yield Sentence("note", f"<b>Never good enough</b>: {limits}. {bound}", "history")


def _first(time_s: float | None) -> str:
    return f", for the first time at {seconds(time_s)}"


def criteria(asked: "Criteria") -> str:
    """Say when an answer is good enough."""
    return (
        f"range within {asked.range_percent:g} %, bearing {asked.bearing_deg:g}°, course "
        f"{asked.course_deg:g}° and speed {asked.speed_mps:.2f} m/s "
        f"({asked.speed_mps / KNOT_MPS:.2g} kn), each with {100 * asked.confidence:g} %"
    )


def _batch(motion: "TargetMotion") -> Iterator[Sentence]:
    if motion.batch is None and motion.observable:
        text = "The batch estimate, the filter's reference, did not settle: there is none."
        yield Sentence("attention", text, "quantities")
    if motion.batch is None:
        return
    here, there = motion.range_m, motion.batch.range_m
    if here.estimate is None or there.estimate is None or not here.sd:
        return
    apart = abs(here.estimate - there.estimate) / here.sd
    text = (
        f"The batch estimate, the straight track that fits all bearings best, has the range at "
        f"{estimate(RANGE, there)}: {apart:.1f} sd from the filter's."
    )
    yield Sentence("good" if apart < APART else "attention", text, "quantities")


def _residuals(motion: "TargetMotion") -> Iterator[Sentence]:
    if motion.residuals is None:
        return
    asked = [test for test in motion.residuals.tests if test.asked]
    if asked and all(test.passed for test in asked):
        text = f"The residuals of a straight track pass all {len(asked)} tests that can be asked."
        yield Sentence("good", text, "residuals")


def _few(motion: "TargetMotion") -> Iterator[Sentence]:
    if motion.bearings < FEW:
        text = f"Only {motion.bearings} bearings were heard: little can be known from so few."
        yield Sentence("attention", text, "picture")


def summary(result: "TmaResult") -> list[Sentence]:
    """Return the verdict of a file of several contacts."""
    every = result.contacts
    return [
        each for part in (_told(every), _good(every), _open(every), _odd(every)) for each in part
    ]


def _told(every: "Sequence[TargetMotion]") -> Iterator[Sentence]:
    told = sum(each.observable for each in every)
    still = sum(not each.observability.manoeuvred for each in every)
    whom = "any" if still == len(every) else f"{still}"
    why = (
        f" Own ship did not manoeuvre while it heard {whom} of them: no method could tell their "
        "range from bearings alone."
    )
    text = f"<b>The range of {told or 'none'} of the {len(every)} contacts can be told.</b>"
    mark = "good" if told == len(every) else "attention"
    yield Sentence(mark, text + (why if still else ""), "contacts")


def _good(every: "Sequence[TargetMotion]") -> Iterator[Sentence]:
    good = sum(each.converged_s is not None for each in every)
    count = f"{good} of {len(every)} are" if good else "None is"
    text = f"{count} good enough to the end: {criteria(every[0].criteria)}."
    yield Sentence("good" if good == len(every) else "note", text, "contacts")


def _open(every: "Sequence[TargetMotion]") -> Iterator[Sentence]:
    count = sum(bool(each.sides) and not each.decided for each in every)
    if count:
        whom = f"all {count}" if count == len(every) else f"{count}"
        text = f"For <b>{whom} contacts both sides of the array are still possible.</b>"
        yield Sentence("attention", text, "contacts")


def _odd(every: "Sequence[TargetMotion]") -> Iterator[Sentence]:
    """Count the contacts whose residuals speak against a straight track, by what fails."""
    failed = [name for each in every for name in failures(each)]
    if failed:
        kinds = ", ".join(f"{name} {failed.count(name)}" for name in dict.fromkeys(failed))
        odd = sum(bool(failures(each)) for each in every)
        text = (
            f"The residuals of {odd} contacts speak against a steady target heard with the stated "
            f"noise, by what fails: {escape(kinds)}."
        )
        yield Sentence("attention", text, "contacts")
