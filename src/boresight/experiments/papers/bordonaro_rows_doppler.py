"""bordonaro's figures of own Doppler: Figures 13 and 14, each with a verdict on what it shows."""

import numpy as np

from boresight.experiments.consistency import bias, nearer
from boresight.experiments.papers.bordonaro_doppler import STANDARD, RangeRates
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.papers.bordonaro_words import reasons, row
from boresight.experiments.verdicts import (
    Claim,
    Verdict,
    of_differences,
    part,
    said,
    together,
)


def figure_13(study: Study) -> Claim:
    """Bias significance: which way it goes with what."""
    curves = {kind: np.array(list(lines.values())) for kind, lines in study.significances.items()}
    way = {"bearing": -1.0, "platform velocity": 1.0, "frequency accuracy": -1.0}
    right = [bool(np.all(sign * np.diff(curves[kind], axis=0) > 0)) for kind, sign in way.items()]
    right += [bool(np.all(np.diff(lines, axis=1) > 0)) for lines in curves.values()]
    sigmas = study.assumed["significance_sigma_deg"]
    return row(
        study,
        "figures",
        "BO-F13",
        ours={
            f"{kind} {name}, {sigmas[-1]:g}°": float(line[-1])
            for kind, lines in study.significances.items()
            for name, line in lines.items()
        },
        verdict=together([said(each) for each in right]),
        assumption="closed forms (34) and (35), as bias over standard deviation (erratum B8); far "
        "out it tends to 1/sqrt(2), that of a squared normal; "
        + reasons(study, *study.printed("BO-S07")["open"]),
    )


def figure_14(study: Study) -> Claim:
    """The range-rate estimator."""
    found = study.range_rates
    verdicts = superior(found, "DUCM", STANDARD)
    return row(
        study,
        "figures",
        "BO-F14",
        ours=told(found),
        verdict=together(list(verdicts.values())),
        assumption=f"closing speed, ft/s, at the last scan of {study.assumed['doppler_scans']}, "
        f"{study.runs('BO-S08')} runs; judged from the second scan on, no bearing being tracked at "
        "the first; with errata B6 and B7; "
        + reasons(study, "propagation_mps", "doppler_scans", "doppler_runs", "doppler_bearing"),
        parts=tuple(
            part("BO-F14", name, "better than standard", None, verdict)
            for name, verdict in verdicts.items()
        ),
    )


def told(found: dict[str, RangeRates]) -> dict[str, dict[str, float]]:
    """Bias, RMSE and ANEES at the last scan."""
    return {
        name: {
            "bias": float(np.mean(one.error[:, -1])),
            "RMSE": float(np.sqrt(np.mean(one.error[:, -1] ** 2))),
            "ANEES": float(np.mean(one.nees[:, -1])),
        }
        for name, one in found.items()
    }


def superior(found: dict[str, RangeRates], name: str, other: str) -> dict[str, Verdict]:
    """Whether a conversion has the smaller bias and MSE and the better ANEES, after scan 1."""
    one, base = (RangeRates(*(x[:, 1:] for x in found[n])) for n in (name, other))
    gap = bias(one.error**2 - base.error**2)
    return {
        "bias": of_differences(*nearer(bias(one.error), [bias(base.error)], 0.0)),
        "MSE": of_differences(gap.value, gap.standard_error),
        "ANEES": of_differences(*nearer(bias(one.nees), [bias(base.nees)], 1.0)),
    }
