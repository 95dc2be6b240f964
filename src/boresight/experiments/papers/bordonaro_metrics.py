"""bordonaro's settings and metrics: what was run, and whether we measure right."""

from dataclasses import replace
from typing import Any

import numpy as np

from boresight.experiments.consistency import bias, conversion_nes
from boresight.experiments.metrics import anees_per_scan, chi_square_bounds
from boresight.experiments.papers import bordonaro_doppler as doppler
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.papers.bordonaro_tracks import filtered
from boresight.experiments.papers.bordonaro_words import agree, at_scans, reasons, row
from boresight.experiments.scenario import FOOT_M
from boresight.experiments.simulate import simulate
from boresight.experiments.verdicts import (
    Claim,
    part,
    said,
    share_interval,
    together,
)
from boresight.filters import kalman
from boresight.filters.steps import Updating
from boresight.maths.seeds import Stream, normals
from boresight.models.coordinates import PositionSensor

_SETS, _OF = 400, 500


def settings(study: Study) -> list[Claim]:
    """BO-S01 to BO-S08: what is printed, what we ran, and what had to be assumed."""
    return [_setting(study, name) for name in study.table["settings"]]


def _setting(study: Study, name: str) -> Claim:
    printed = dict(study.printed(name))
    where, left = printed.pop("where"), printed.pop("open")
    ours = printed | {name: study.assumed[name] for name in left}
    if study.asked:
        ours |= {key: study.asked for key in ("runs", "samples") if key in printed}
    open_or_less = left or ours != printed
    asked = "printed in full, and run so but for the number of runs, which was asked for"
    return Claim(
        id=name,
        where=where,
        published=printed,
        ours=ours,
        verdict="cannot be checked" if open_or_less else "reproduces",
        assumption=reasons(study, *left) or (asked if open_or_less else "printed in full, run so"),
    )


def metrics(study: Study) -> list[Claim]:
    """BO-X1 to BO-X4: our metrics measured on what is known to be right."""
    return [_nes(study), _anees(study), _bias_and_mse(study), _significance(study)]


def _nes(study: Study) -> Claim:
    """Normal errors of a known covariance leave the bounds as often as they should."""
    probability = study.printed("BO-S03")["probability"]
    cov, place = np.array([[4.0, 3.0], [3.0, 9.0]]), np.array([3.0, 4.0])
    noise = normals(study.seed, "bordonaro NES", Stream.NOISE, (_OF, 2), runs=_SETS)
    sets = noise @ np.linalg.cholesky(cov).T
    each = [conversion_nes(e, cov, place, false_alarm=1.0 - probability).total for e in sets]
    inside = sum(one.low <= one.value <= one.high for one in each)
    low, high = share_interval(inside, _SETS, 0.001)
    return row(
        study,
        "metrics",
        "BO-X1",
        ours={"share of sets of normal errors inside the bounds": inside / _SETS},
        band={"share of sets of normal errors inside the bounds": (low, high)},
        verdict=said(low <= probability <= high),
        assumption=f"{_SETS} sets of {_OF}; band: 99.9 % confidence",
    )


def _anees(study: Study) -> Claim:
    """The Kalman filter of a linear world, which is consistent."""
    world, runs = study.worlds["bordonaro-static"], study.runs("BO-S05")
    place: Any = replace(world, sensor=PositionSensor(x_m=30.0, y_m=500.0), begin="given")
    truth, plots = simulate(place, runs=runs, seed=study.seed)
    told_by = filtered(Updating(formula=kalman.update_plot), place.motion, place, plots)
    found = anees_per_scan(told_by, truth)
    low, high = chi_square_bounds(2 * runs, 0.001)
    return row(
        study,
        "metrics",
        "BO-X2",
        ours=at_scans(found),
        band=(low, high),
        verdict=said(low <= found[0] <= high and low <= found[-1] <= high),
        assumption=f"linear measurements of a target at rest, {runs} runs; judged at the first and "
        "last scan, each inside by a probability of 99.9 %",
    )


def _bias_and_mse(study: Study) -> Claim:
    """At the first scan both have closed forms: (22) with erratum B2, and the factor of MUCM."""
    printed = study.printed("BO-S05")
    sr, s2 = printed["sigma_range_ft"], np.radians(max(study.rest)) ** 2
    r = printed["position_ft"][0]
    ucm, mucm = study.large["UCM"], study.large["MUCM"]
    mse, shift = bias(ucm.square[:, 0]), bias(mucm.along[:, 0])
    expected = float(np.exp(s2) * (r**2 + sr**2) - r**2), float(r * np.expm1(-s2))
    return row(
        study,
        "metrics",
        "BO-X3",
        ours={
            "MSE of UCM, scan 1, ft²": float(mse.value),
            "in closed form": expected[0],
            "bias of MUCM, scan 1, ft": float(shift.value),
            "its closed form": expected[1],
        },
        verdict=together([said(agree(mse, expected[0])), said(agree(shift, expected[1]))]),
        assumption="where they are known, at the first scan; to within three standard errors",
    )


def _significance(study: Study) -> Claim:
    """Bias over standard deviation by draws; printed, over the variance squared, it has a unit."""
    printed = study.printed("BO-S08") | {"bearings_deg": [0.0, 0.0]}
    seen = doppler.echo(printed, study.assumed, printed["sigma_bearing_deg"][0])
    heard = doppler.pings(printed, study.assumed, seen, study.runs("BO-S08"), study.seed)
    shift = bias(np.ravel(doppler.nullified(heard, seen)) - printed["closing_ftps"])
    formula = float(doppler.significance(seen, 0.0))
    literal = {"in feet": float(shift.value / shift.sd**4)}
    literal["in metres"] = literal["in feet"] / FOOT_M**3
    return row(
        study,
        "metrics",
        "BO-X4",
        ours={"bias over standard deviation": float(shift.significance), "by (34), (35)": formula},
        verdict=said(agree(shift, formula * float(shift.sd))),
        assumption="over the root of the variance (erratum B8); Figure 14's sonar at bearing 0",
        parts=(
            part(
                "BO-X4",
                "as printed",
                "bias divided by the square of the variance",
                literal,
                said(np.isclose(literal["in feet"], literal["in metres"])),
                "depends on the unit, so it is no measure (erratum B8)",
            ),
        ),
    )
