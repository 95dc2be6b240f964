"""pradeep's claims PR-C1 to PR-C7: what the range-parameterised bank is said to do."""

from typing import Any

import numpy as np

from boresight.experiments.consistency import Bias, bias
from boresight.experiments.papers.pradeep_compared import against_ekf, faster, lower_range_error
from boresight.experiments.papers.pradeep_manoeuvres import other_manoeuvres
from boresight.experiments.papers.pradeep_study import Study
from boresight.experiments.papers.pradeep_words import (
    by_time,
    number,
    over_bound,
    reasons,
    rms,
    row,
)
from boresight.experiments.verdicts import (
    Claim,
    less,
    of_points,
    of_share,
    part,
    said,
    share_interval,
    together,
)

Array = Any


def claims(study: Study) -> list[Claim]:
    """PR-C1 to PR-C7."""
    return [
        faster(study),
        lower_range_error(study),
        _sound(study),
        _before_the_manoeuvre(study),
        _one_filter(study),
        against_ekf(study),
        other_manoeuvres(study),
    ]


def _sound(study: Study) -> Claim:
    """PR-C3: stable, consistent and unbiased, over truths anywhere."""
    parts, one = (_stable(study), _consistent(study), _unbiased(study)), study.tracked["RP"]
    return row(
        study,
        "claims",
        "PR-C3",
        ours={
            "share of truths lost": {
                name: float(np.mean(each.lost[:, -1])) for name, each in study.truths.items()
            },
        }
        | over_bound(study, "RP")
        | {"RP, ANEES": by_time(study, np.mean(one.nees, axis=0))},
        verdict=together([each.verdict for each in parts]),
        assumption="over truths drawn from what the bank believes at its start; "
        + reasons(study, "truths", "stable", "consistent"),
        parts=parts,
    )


def _stable(study: Study) -> Claim:
    one = study.truths["RP"]
    lost = one.lost[:, -1]
    return part(
        "PR-C3",
        "stable",
        "in all cases",
        {
            "beyond five times the bound at the end": float(np.mean(lost)),
            "how near own ship these come, m": sorted(map(float, one.closest_m[lost])),
            "not finite": int(np.sum(~one.finite)),
        },
        said(one.finite.all() and np.mean(lost) <= study.assumed["stable"]),
        f"share of {len(lost)} truths",
        share_interval(int(np.sum(lost)), len(lost)),
    )


def _consistent(study: Study) -> Claim:
    """The mean of all is that of a few lost runs, so these are set apart."""
    one = study.truths["RP"]
    kept = bias(one.nees[~one.lost.any(axis=1)])
    off = study.assumed["consistent"] - np.abs(kept.value - 1.0)
    fails = less(off, kept.standard_error)
    return part(
        "PR-C3",
        "consistent",
        1.0,
        _at_shown(study, kept) | {"with all": _at_shown(study, bias(one.nees))},
        of_points(~fails, fails),
        "average NEES over runs that are nowhere beyond five times their bound, and over all",
    )


def _unbiased(study: Study) -> Claim:
    shift = bias(study.truths["RP"].range_error)
    fails = less(-np.abs(shift.value), shift.standard_error)
    why = "mean error of the range, m"
    return part("PR-C3", "unbiased", 0.0, _at_shown(study, shift), of_points(~fails, fails), why)


def _at_shown(study: Study, found: Bias) -> dict[str, dict[str, float | None]]:
    """Averages at the times that are shown, with their standard errors."""
    pairs = zip(study.shown_s, found.value, found.standard_error, strict=True)
    return {f"{t:g} s": {"mean": number(v), "standard error": number(e)} for t, v, e in pairs}


def _before_the_manoeuvre(study: Study) -> Claim:
    """PR-C4: what weights before the manoeuvre come from, and what happens without one."""
    parts = (_by_speed(study), _without(study))
    return row(
        study,
        "claims",
        "PR-C4",
        ours={
            "RMS error of the range, m": by_time(study, rms(study.tracked["RP"].error[..., 0])),
            "bound, m": by_time(study, study.bound_sd[:, 0]),
            "without a manoeuvre, m": by_time(study, rms(study.straight.error[..., 0])),
        }
        | _shown_weights(study),
        verdict=together([each.verdict for each in parts]),
        assumption="before own ship turns, bearings tell three numbers of four: each range goes "
        "with a velocity, so weights of ranges are those of velocities, and these are assumed; "
        + reasons(study, "speed_sd_mps", "speed_sds_mps"),
        parts=parts,
    )


def _shown_weights(study: Study) -> dict[str, dict[str, float]]:
    """Mean weights of the cells, by the spread of velocity at the start and without a manoeuvre."""
    straight, k = study.straight.weights.mean(axis=0), study.at(study.before)
    shown = {
        f"weights at {study.before:g} s, ± {sd:g} m/s": found[k]
        for sd, found in study.by_speed_sd.items()
    }
    shown[f"without a manoeuvre, {study.before:g} s"] = straight[k]
    shown["without a manoeuvre, at the end"] = straight[-1]
    return {
        name: {f"cell {i}": float(weight) for i, weight in enumerate(weights, start=1)}
        for name, weights in shown.items()
    }


def _by_speed(study: Study) -> Claim:
    """The same bearings, another spread of velocity, another cell."""
    k, true = study.at(study.before), study.true_cell + 1
    weights = {f"{sd:g} m/s": found[k] for sd, found in study.by_speed_sd.items()}
    best = {name: int(np.argmax(found)) + 1 for name, found in weights.items()}
    return part(
        "PR-C4",
        "weights before the manoeuvre",
        f"cell {true} of {study.assumed['cells']}, where the target is",
        {
            f"started with {name}": {"best cell": best[name], "mean weights": found.tolist()}
            for name, found in weights.items()
        },
        said(set(best.values()) == {true}),
        f"at {study.before:g} s, by the spread of velocity that the bank starts with",
    )


def _without(study: Study) -> Claim:
    """Bearings go on, weights stay."""
    one = study.straight
    share, weights = float(np.mean(np.isfinite(one.times[1]))), one.weights.mean(axis=0)
    now, end = weights[study.at(study.before)], weights[-1]
    return part(
        "PR-C4",
        "no manoeuvre",
        "converges",
        {
            "share that converges": share,
            f"mean weights at {study.before:g} s": now.tolist(),
            "mean weights at the end": end.tolist(),
        },
        of_share(share, study.runs),
        "own ship keeps its course to the end",
        share_interval(round(share * study.runs), study.runs),
    )


def _one_filter(study: Study) -> Claim:
    """PR-C5: how many cells are processed, and whether the right one dominates."""
    one, k = study.tracked["RP"], study.at(study.converge_s)
    found = {
        "some cells go": one.alive[:, -1] < study.assumed["cells"],
        "the right cell dominates": np.argmax(one.weights[:, k], axis=1) == study.true_cell,
        "one filter only": one.alive[:, -1] == 1,
    }
    shares = {name: float(np.mean(true)) for name, true in found.items()}
    parts = tuple(
        part(
            "PR-C5",
            name,
            "in a run",
            share,
            of_share(share, study.runs),
            f"at {study.converge_s:g} s" if "right" in name else "by the end",
            share_interval(int(np.sum(found[name])), study.runs),
        )
        for name, share in shares.items()
    )
    return row(
        study,
        "claims",
        "PR-C5",
        ours={
            "cells processed": by_time(study, np.mean(one.alive, axis=0)),
            "share with one": by_time(study, np.mean(one.alive == 1, axis=0)),
            "mean weight of the target's cell": by_time(
                study, np.mean(one.weights[..., study.true_cell], axis=0)
            ),
        },
        verdict=together([each.verdict for each in parts]),
        assumption="cells go quickly, but seldom all but one: two that lie beside each other end "
        "on the same track, and then neither has a reason to go; "
        + reasons(study, "prune", "cells"),
        parts=parts,
    )
