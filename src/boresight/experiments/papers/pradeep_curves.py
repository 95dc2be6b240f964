"""pradeep's Figures 1 to 6 and its limits: whether curves do what is said of them."""

from dataclasses import replace
from typing import Any

import numpy as np

from boresight.experiments.papers.pradeep_study import Study
from boresight.experiments.papers.pradeep_tracked import QUANTITIES, Tracked
from boresight.experiments.papers.pradeep_words import (
    by_time,
    median,
    number,
    reasons,
    rms,
    row,
)
from boresight.experiments.scenario import SPEEDS_MPS
from boresight.experiments.verdicts import Claim, of_share, part, said, share_interval, together
from boresight.target_motion.convergence import errors_inside, first_and_sustained, permitted

Array = Any
_DRAWN = ("RP", "MGEKF")


def figures(study: Study) -> list[Claim]:
    """PR-F1 to PR-F6."""
    tracks = [_track(study, f"PR-F{i}", label) for i, label in enumerate(_DRAWN, start=1)]
    return tracks + [_error(study, f"PR-F{i}", name) for i, name in enumerate(QUANTITIES, start=3)]


def _track(study: Study, name: str, label: str) -> Claim:
    """Whether the estimate ends on the target, in a run."""
    one = study.tracked[label]
    share = float(np.mean(one.inside[:, -1]))
    return row(
        study,
        "figures",
        name,
        ours={"share on the target at the end": share}
        | {
            "RMS error of the position, m": by_time(study, rms(np.sqrt(one.square))),
            "its bound, m": by_time(study, study.bound_m),
            "ANEES": by_time(study, np.mean(one.nees, axis=0)),
        },
        band={
            "share on the target at the end": share_interval(round(share * study.runs), study.runs)
        },
        verdict=of_share(share, study.runs),
        assumption="on the target: all four errors tolerated; the curves are not given as numbers; "
        "drawn: the run that converges at the median time",
    )


def _error(study: Study, name: str, quantity: str) -> Claim:
    """Whether errors fall from before the turn to the end, do not rise between, and end small."""
    i, unit = list(QUANTITIES).index(quantity), QUANTITIES[quantity]
    curves, shares = {}, {}
    for label in _DRAWN:
        one = study.tracked[label]
        curves[f"{label}, RMS, {unit}"] = rms(one.error[..., i])
        shares[f"{label}, share tolerated at the end"] = float(np.mean(_tolerated(study, one, i)))
    before = study.at(study.before)
    falls = all(curve[-1] < curve[before] for curve in curves.values())
    rise = {key: float(curve[before:].max() / curve[before]) for key, curve in curves.items()}
    told = (
        part(name, "reduced", "at the end", "", said(falls)),
        part(name, "gradually", "no rise", rise, said(max(rise.values()) <= study.assumed["rise"])),
        part(
            name, "then converged", "in a run", shares, of_share(min(shares.values()), study.runs)
        ),
    )
    shown = curves | {f"bound, {unit}": study.bound_sd[:, i]}
    return row(
        study,
        "figures",
        name,
        ours={key: by_time(study, curve) for key, curve in shown.items()} | shares,
        verdict=together([each.verdict for each in told]),
        assumption=f"error of the {quantity}: reduced from {study.before:g} s to the end in the "
        f"mean square of {study.runs} runs, without a rise while own ship turns, and in so many "
        "runs within its limit at the end; the curves are not given as numbers. The bound has the "
        "filters' spread at the start; before the turn an estimate leans on what was believed, and "
        "may be below it at this one target; " + reasons(study, "rise"),
        parts=told,
    )


def _tolerated(study: Study, one: Tracked, i: int) -> Array:
    """(runs,): whether one error ends within its limit, whatever the others."""
    estimate, truth = (each[:, -1] for each in one.polar)
    alone = np.array(truth)
    alone[..., i] = estimate[..., i]
    return errors_inside(alone, truth, study.criteria)


def limits(study: Study) -> list[Claim]:
    """PR-X1: the limits, when they are met, and when the bound permits it."""
    stated, table = study.table["metrics"]["PR-X1"], study.table["tables"]
    names = ("range_percent", "bearing_deg", "course_deg", "speed")
    published = {name: stated[name] for name in names}
    printed = table["PR-T1"] | table["PR-T3"]
    off = {
        "range_percent": 100.0 * (printed["range_m"] / printed["true_range_m"] - 1.0),
        "bearing_deg": printed["bearing_deg"] - printed["true_bearing_deg"],
        "course_deg": printed["course_deg"] - printed["true_course_deg"],
        "speed": printed["speed"] - study.table["printed"]["target_speed"],
    }
    allowed = published | {"speed": stated["speed"] * SPEEDS_MPS[study.assumed["speed_limit_unit"]]}
    return [
        row(
            study,
            "metrics",
            "PR-X1",
            published=published,
            ours={"errors of Table 5.1 and below": {n: float(value) for n, value in off.items()}}
            | {
                f"{label}, {kind}": told
                for label in _DRAWN
                for kind, told in _times(study, study.tracked[label]).items()
            }
            | {"permitted by the bound, s": _permitted(study)},
            verdict=said(all(abs(value) <= allowed[n] for n, value in off.items())),
            assumption="the paper's own errors are within its limits when it says so; whether that "
            "is for the first time or for good it does not say. Speeds are as printed. "
            "Permitted: from when on the bound lets each error be within its limit with such a "
            "probability; " + reasons(study, "speed_limit_unit"),
        )
    ]


def _times(study: Study, one: Tracked) -> dict[str, Any]:
    """Convergence by each reading, s."""
    end = float(one.truth.time_s[-1])
    other = replace(study.criteria, speed_mps=study.table["metrics"]["PR-X1"]["speed"])
    loose = first_and_sustained(errors_inside(*one.polar, other), one.truth.time_s)[1]
    first, good = one.times
    return {
        "for the first time, s": median(np.nan_to_num(first, nan=end)),
        "for good, s": median(one.converged),
        "for good, with 2 m/s, s": median(np.nan_to_num(loose, nan=end)),
        "runs that never do": int(np.sum(np.isnan(good))),
    }


def _permitted(study: Study) -> dict[str, float | None]:
    """The earliest time at which the bound is sure enough for good, by how sure that is."""
    range_m = study.tracked["RP"].polar[1][0, :, 0]
    return {
        f"{share:.0%} sure of each": number(
            permitted(
                study.bound_sd, range_m, replace(study.criteria, confidence=share), study.time_s
            )
        )
        for share in (0.5, study.criteria.confidence)
    }
