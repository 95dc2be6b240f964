"""pradeep's settings and tables: what was run, and printed numbers beside single runs of ours."""

from typing import Any

import numpy as np

from boresight.experiments.papers.pradeep_study import Study
from boresight.experiments.papers.pradeep_tracked import own_ship
from boresight.experiments.papers.pradeep_words import by_time, number, reasons, rms, row
from boresight.experiments.scenario import SPEEDS_MPS, along
from boresight.experiments.verdicts import (
    Claim,
    band_of,
    of_number,
    of_share,
    of_table,
    part,
    said,
    share_interval,
    together,
    worst,
)

Array = Any
_LAST_DIGIT = 0.005  # tables print two decimals


def settings(study: Study) -> list[Claim]:
    """PR-S01 to PR-S03."""
    return [_scenario(study), _straight(study), _anywhere(study)]


def tables(study: Study) -> list[Claim]:
    """PR-T1 to PR-T4."""
    return [_converged(study), _smallest(study), _course_and_speed(study), _printed_scenario(study)]


def _open(study: Study, name: str) -> list[str]:
    return study.table["settings"][name]["open"]  # type: ignore[no-any-return]


def _scenario(study: Study) -> Claim:
    far = np.linalg.norm(study.simulated[0].states[0, :, :2] - own_ship(study.world), axis=-1)
    return row(
        study,
        "settings",
        "PR-S01",
        ours={"bearings": study.world.scans, "runs": study.runs}
        | {"true range, m": by_time(study, far)}
        | {name: study.assumed[name] for name in _open(study, "PR-S01")},
        verdict="cannot be checked",
        assumption=reasons(study, *_open(study, "PR-S01")),
    )


def _straight(study: Study) -> Claim:
    """No run converges, and the range stays as uncertain as it was believed to be."""
    one = study.straight
    share, claimed = float(np.mean(np.isfinite(one.times[1]))), one.claimed_range_sd
    return row(
        study,
        "settings",
        "PR-S02",
        ours={
            "share that converges": share,
            "standard deviation of the range that the bank claims, m": by_time(study, claimed),
            "RMS error of the range, m": by_time(study, rms(one.error[..., 0])),
        },
        band={"share that converges": share_interval(round(share * study.runs), study.runs)},
        verdict=of_share(1.0 - share, study.runs),
        assumption=f"{study.runs} runs in which own ship never turns: what is claimed of the range "
        "is what the starts of cells and velocities say; "
        + reasons(study, *_open(study, "PR-S02")),
    )


def _anywhere(study: Study) -> Claim:
    ours = {
        label: {
            "truths": len(one.finite),
            "not finite": int(np.sum(~one.finite)),
            "lost": int(np.sum(one.lost[:, -1])),
            "median NEES": number(np.median(one.nees[:, -1])),
        }
        for label, one in study.truths.items()
    }
    return row(
        study,
        "settings",
        "PR-S03",
        ours=ours,
        verdict="cannot be checked",
        assumption="the paper shows one case; here ranges, bearings and velocities are drawn from "
        "what the bank believes at its start, and PR-C3 judges; lost: beyond five times the bound "
        "at the end; the median is that of the NEES at the end, 0.84 where consistent; "
        + reasons(study, *_open(study, "PR-S03")),
    )


def _converged(study: Study) -> Claim:
    """Table 5.1: the truth to its digits, and one run's errors among ours."""
    stated, k = study.table["tables"]["PR-T1"], study.at(study.converge_s)
    one = study.tracked["RP"]
    true_range, true_bearing = one.polar[1][0, k, :2]
    truth = {
        "true range, m": (stated["true_range_m"], float(true_range)),
        "true bearing, °": (stated["true_bearing_deg"], float(true_bearing)),
    }
    exact = tuple(
        part("PR-T1", name, printed, ours, said(abs(ours - printed) <= _LAST_DIGIT))
        for name, (printed, ours) in truth.items()
    )
    printed = {
        "convergence, s": study.converge_s,
        "error of the range, m": stated["range_m"] - stated["true_range_m"],
        "error of the bearing, °": stated["bearing_deg"] - stated["true_bearing_deg"],
    }
    ours = {"convergence, s": one.converged}
    ours |= dict(zip(list(printed)[1:], one.error[:, k, :2].T, strict=True))
    found = _single_runs(study, "PR-T1", printed, ours)
    return row(
        study,
        "tables",
        "PR-T1",
        **found | {"parts": exact + found["parts"]},
        verdict=worst([*(p.verdict for p in exact), of_table(printed, ours)[1]]),
        assumption=f"{of_table(printed, ours)[0]}. The truth has no noise: it is judged to its "
        "last digit, with speeds in m/s (erratum P1)",
    )


def _course_and_speed(study: Study) -> Claim:
    stated, k = study.table["tables"]["PR-T3"], study.at(study.converge_s)
    printed = {
        "error of the course, °": stated["course_deg"] - stated["true_course_deg"],
        "error of the speed": stated["speed"] - study.table["printed"]["target_speed"],
    }
    ours = dict(zip(printed, study.tracked["RP"].error[:, k, 2:].T, strict=True))
    words, verdict = of_table(printed, ours)
    return row(
        study,
        "tables",
        "PR-T3",
        **_single_runs(study, "PR-T3", printed, ours),
        verdict=verdict,
        assumption=f"{words}; taken at the {study.converge_s:g} s of Table 5.1; the true speed is "
        f"printed as {stated['true_speed']:g} here and as "
        f"{study.table['printed']['target_speed']:g} in the scenario, which is used",
    )


def _single_runs(
    study: Study, name: str, printed: dict[str, float], ours: dict[str, Array]
) -> dict[str, Any]:
    """Printed numbers beside medians and bands of ours."""
    bands = {key: band_of(values) for key, values in ours.items()}
    middle = {key: float(np.median(values)) for key, values in ours.items()}
    parts = tuple(
        part(
            name,
            key,
            value,
            middle[key],
            of_number(value, ours[key], fitted=key.startswith("error")),
            f"single runs of {study.runs}",
            bands[key],
        )
        for key, value in printed.items()
    )
    return {"published": printed, "ours": middle, "band": bands, "parts": parts}


def _smallest(study: Study) -> Claim:
    """Table 5.2, erratum P9."""
    stated, error = study.table["tables"]["PR-T2"], study.tracked["RP"].error
    names = ("range, m", "bearing, °", "course, °", "speed, knots")
    printed = [value for name, value in stated.items() if name != "where"]
    least = np.min(np.abs(error), axis=1) / [1.0, 1.0, 1.0, SPEEDS_MPS["knots"]]
    crossings = np.sum(np.diff(np.sign(error), axis=1) != 0.0, axis=1)
    ours = {
        "median of single runs": np.median(least, axis=0),
        f"smallest of {study.runs} runs": np.min(least, axis=0),
        "changes of the error's sign, median": np.median(crossings, axis=0),
    }
    return row(
        study,
        "tables",
        "PR-T2",
        published=dict(zip(names, printed, strict=True)),
        ours={
            kind: dict(zip(names, map(float, values), strict=True)) for kind, values in ours.items()
        },
        band={name: band_of(each) for name, each in zip(names, least.T, strict=True)},
        verdict="cannot be checked",
        assumption="the smallest value of an error that goes through zero is no accuracy (erratum "
        "P9): it falls with every further bearing and run, and how many there were is not printed",
    )


def _printed_scenario(study: Study) -> Claim:
    """What was drawn, and the printed unit of speeds held against Table 5.1."""
    printed, one = study.table["printed"], study.tracked["RP"]
    start = one.polar[1][0, 0]
    true_bearing = np.radians(one.polar[1][..., 1])
    noise = np.degrees(np.sin(study.simulated[1].z[..., 0] - true_bearing))[:, 1:]
    own = np.linalg.norm(np.diff(own_ship(study.world), axis=0), axis=-1) / study.world.dt_s
    ours = {
        "range_m": start[0],
        "bearing_deg": start[1],
        "course_deg": start[2],
        "sigma_bearing_deg": np.std(noise),
        "target_speed": start[3],
        "own_speed": own.mean(),
        "seconds": study.time_s[-1],
    }
    allowed = 5.0 / np.sqrt(2.0 * noise.size)  # five standard errors of a measured sd
    same = np.allclose(list(ours.values()), [printed[name] for name in ours], rtol=allowed)
    units = tuple(_unit(study, name, factor) for name, factor in SPEEDS_MPS.items())
    return row(
        study,
        "tables",
        "PR-T4",
        published={name: printed[name] for name in ours},
        ours={name: float(value) for name, value in ours.items()},
        verdict=together([said(same), units[1].verdict]),
        assumption="what was drawn, the noise measured to within five standard errors; numbers are "
        "as printed, their unit of speed cannot be (erratum P1)",
        parts=units,
    )


def _unit(study: Study, name: str, factor: float) -> Claim:
    """How far own ship must have come by the time of Table 5.1, and how far it can."""
    printed, table = study.table["printed"], study.table["tables"]["PR-T1"]
    seconds, speeds = (
        study.converge_s,
        factor * np.array([printed["target_speed"], printed["own_speed"]]),
    )
    north_east = [
        along(printed["range_m"], printed["bearing_deg"]),
        along(speeds[0] * seconds, printed["course_deg"]),
        -along(table["true_range_m"], table["true_bearing_deg"]),
    ]
    needed, can = float(np.linalg.norm(np.sum(north_east, axis=0))), float(speeds[1] * seconds)
    return part(
        "PR-T4",
        f"speeds in {name}",
        "Table 5.1's truth",
        {"own ship must have come, m": needed, "and can, m": can},
        said(needed <= can),
        "from the printed start, course and speeds, whatever own ship's path",
    )
