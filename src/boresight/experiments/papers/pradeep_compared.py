"""pradeep's claims that compare filters: PR-C1, PR-C2 and PR-C6."""

from typing import Any

import numpy as np

from boresight.experiments.consistency import bias, nearer
from boresight.experiments.papers.pradeep_study import NEAR, Study
from boresight.experiments.papers.pradeep_words import (
    by_time,
    median,
    number,
    over_bound,
    reasons,
    references,
    rms,
    row,
)
from boresight.experiments.verdicts import Claim, less, of_differences, part, together

Array = Any


def _rivals(study: Study) -> dict[str, str]:
    """How the single filter starts, and its name."""
    return {"wide start": "MGEKF", f"start at {_near(study)}": NEAR}


def _near(study: Study) -> str:
    return f"{study.assumed['near_start_m']:g} ± {study.assumed['near_start_sd_m']:g} m"


def faster(study: Study) -> Claim:
    """PR-C1, from the wide start and from one that knows the range roughly."""
    one, times = study.tracked["RP"], {}
    for start, rival in _rivals(study).items():
        other = study.tracked[rival]
        gap = bias(other.converged - one.converged)
        times[start] = part(
            "PR-C1",
            start,
            "RP sooner",
            {
                f"{rival}, s": median(other.converged),
                "share in which RP is not later": float(np.mean(one.converged <= other.converged)),
                "share in which RP is sooner": float(np.mean(one.converged < other.converged)),
                "mean gain, s": number(gap.value),
                "its standard error, s": number(gap.standard_error),
            },
            of_differences(-gap.value, gap.standard_error),
        )
    return row(
        study,
        "claims",
        "PR-C1",
        ours={f"{name}, s": median(each.converged) for name, each in study.tracked.items()},
        verdict=together([each.verdict for each in times.values()]),
        assumption=f"since when all four errors are tolerated for good; {study.runs} paired runs, "
        f"medians with their 95 % interval, never counting as the end. {_knowing(study, times)}; "
        + reasons(study, "member", "cells", "nearest_m", "farthest_m", "near_start_m"),
        parts=tuple(times.values()),
    )


def lower_range_error(study: Study) -> Claim:
    """PR-C2, from when the paper's run has converged, bearing by bearing."""
    one, errors = study.tracked["RP"], {}
    after = slice(study.at(study.converge_s), None)
    for start, rival in _rivals(study).items():
        other = study.tracked[rival]
        gap = bias(one.error[:, after, 0] ** 2 - other.error[:, after, 0] ** 2)
        share = np.mean(less(gap.value, gap.standard_error))
        errors[start] = part(
            "PR-C2",
            start,
            "RP smaller",
            {"share of bearings at which RP's is smaller": float(share)},
            of_differences(gap.value, gap.standard_error),
        )
    return row(
        study,
        "claims",
        "PR-C2",
        ours={
            f"{name}, RMS error of the range, m": by_time(study, rms(each.error[..., 0]))
            for name, each in study.tracked.items()
        }
        | over_bound(study, "RP")
        | references(study),
        verdict=together([each.verdict for each in errors.values()]),
        assumption=f"squared errors of the same {study.runs} runs at each bearing from "
        f"{study.converge_s:g} s on. {_knowing(study, errors)}",
        parts=tuple(errors.values()),
    )


def _knowing(study: Study, parts: dict[str, Claim]) -> str:
    """How an MGEKF does that knows the range roughly, in one sentence or two."""
    near, bank = study.tracked[NEAR], study.tracked["RP"]
    worse = parts[f"start at {_near(study)}"].verdict == "reproduces"
    ends = [np.sqrt(np.mean(each.square[:, -1])) for each in (near, bank)]
    told = "does worse" if worse else "does as well: what the bank gains is not to need that range"
    return (
        f"An MGEKF started at {_near(study)} {told} (median {np.median(near.converged):.0f} s "
        f"against {np.median(bank.converged):.0f} s, position RMSE at the end {ends[0]:.0f} m "
        f"against {ends[1]:.0f} m)"
    )


def against_ekf(study: Study) -> Claim:
    """PR-C6: MGEKF against EKF, from the same wide start and over truths anywhere."""
    both = {name: study.tracked[name] for name in ("MGEKF", "EKF")}
    lost = {name: study.truths[name].lost[:, -1].astype(float) for name in both}
    parts = (
        _paired("sooner", {n: one.converged for n, one in both.items()}, median),
        _paired("fewer truths lost", lost, _average),
        _paired(
            "smaller error at the end, m²", {n: o.square[:, -1] for n, o in both.items()}, _average
        ),
        _consistent({n: one.nees[:, -1] for n, one in both.items()}),
    )
    return row(
        study,
        "claims",
        "PR-C6",
        ours=over_bound(study, "MGEKF")
        | over_bound(study, "EKF")
        | {
            f"{name}, ANEES": by_time(study, np.mean(one.nees, axis=0))
            for name, one in both.items()
        },
        verdict=together([each.verdict for each in parts]),
        assumption="one filter on the whole range, paired runs. The gain function stands in the "
        "covariance only: it keeps the MGEKF from being too sure, and leaves it modest",
        parts=parts,
    )


def _paired(name: str, found: dict[str, Array], told: Any) -> Claim:
    """Whether the MGEKF's numbers are the smaller ones."""
    gap = bias(found["MGEKF"] - found["EKF"])
    ours = {label: told(values) for label, values in found.items()}
    verdict = of_differences(gap.value, gap.standard_error)
    return part("PR-C6", name, "MGEKF better", ours, verdict)


def _consistent(found: dict[str, Array]) -> Claim:
    one, other = (bias(found[name]) for name in ("MGEKF", "EKF"))
    ours = {name: float(np.mean(values)) for name, values in found.items()}
    verdict = of_differences(*nearer(one, [other], 1.0))
    return part("PR-C6", "ANEES at the end nearer to one", "MGEKF better", ours, verdict)


def _average(values: Array) -> float | None:
    return number(np.mean(values))
