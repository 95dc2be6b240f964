"""pradeep's claim PR-C7: what own ship's last turn does to the bias of the range.

The same target and the same noise, heard by the MGEKF the paper speaks of from own ships that part
at their last turn. Beside its bias stands what Fisher information says of each manoeuvre.
"""

from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.consistency import Bias, bias
from boresight.experiments.papers.pradeep_study import Study
from boresight.experiments.papers.pradeep_tracked import bounds, own_ship
from boresight.experiments.papers.pradeep_words import number, reasons, row
from boresight.experiments.scenario import build
from boresight.experiments.simulate import simulate
from boresight.experiments.verdicts import Claim, Verdict, less, of_differences, part, together
from boresight.filters.fisher import polar_sd

Array = Any
_FILTER, _COURSE = "MGEKF", "last course "


class _Heard(NamedTuple):
    """At the last bearing: errors of the range, m, squared ones of the position, m²; the bound."""

    range_error: Array
    square: Array
    bound_m: float


def other_manoeuvres(study: Study) -> Claim:
    """PR-C7: bias, error and bound of the range at the end, by own ship's last course."""
    found = {course: _heard(study, table) for course, table in _tables(study).items()}
    shift = {course: bias(one.range_error) for course, one in found.items()}
    informed = min(found, key=lambda course: found[course].bound_m)
    parts = (_altered(study, found), _best(found, shift))
    return row(
        study,
        "claims",
        "PR-C7",
        ours={course: _told(one, shift[course]) for course, one in found.items()},
        verdict=together([each.verdict for each in parts]),
        assumption=f"{_FILTER}, {study.runs} runs, the same noise for each last course of own "
        f"ship, at {study.time_s[-1]:g} s: mean error of the range and its standard error, RMS "
        "error of the position, Cramér-Rao bound of the range. By Fisher information "
        f"{informed} is the best of them; " + reasons(study, "last_turn_rates_degps", "altered_m"),
        parts=parts,
    )


def _tables(study: Study) -> dict[str, dict[str, Any]]:
    """The paper's table with other rates of the last turn, by the course after it."""
    assumed, found = study.assumed, {}
    lasts, usual = assumed["turn_lasts_s"], assumed["turn_rates_degps"]
    for rate in assumed["last_turn_rates_degps"]:
        rates = [*usual[:-1], rate] if usual else []
        course = assumed["own_course_deg"] + np.dot(rates, lasts)
        changed = {"assumed": assumed | {"turn_rates_degps": rates}}
        found[f"{_COURSE}{course % 360.0:03.0f}°"] = study.table | changed
    if len(found) < 2:
        raise UsageError(
            f"last_turn_rates_degps={assumed['last_turn_rates_degps']} gives fewer than two courses"
        )
    return found


def _heard(study: Study, table: dict[str, Any]) -> _Heard:
    world = build("pradeep", table)["pradeep"]
    truth, plots = simulate(world, runs=study.runs, seed=study.seed)
    one = study.track(_FILTER, world, truth, plots)
    first = truth._replace(states=truth.states[:1], start=truth.start[:1])
    cov = bounds(world, first, plots._replace(z=plots.z[:1]))[0]
    bound = polar_sd(cov, truth.states[0], own_ship(world))[-1, 0]
    return _Heard(one.error[:, -1, 0], one.square[:, -1], float(bound))


def _told(one: _Heard, shift: Bias) -> dict[str, float | None]:
    return {
        "bias, m": number(shift.value),
        "±, m": number(shift.standard_error),
        "RMSE, m": number(np.sqrt(np.mean(one.square))),
        "bound, m": one.bound_m,
    }


def _altered(study: Study, found: dict[str, _Heard]) -> Claim:
    """Two manoeuvres of which the biases differ are enough."""
    gaps = {
        f"{a} less {b.removeprefix(_COURSE)}": bias(found[a].range_error - found[b].range_error)
        for a, b in combinations(found, 2)
    }
    size, error = (np.array([np.abs(gap[i]) for gap in gaps.values()]) for i in (0, 1))
    verdict: Verdict = "in band"
    if np.any(less(-size, error)):
        verdict = "reproduces"
    elif np.all(less(size - study.assumed["altered_m"], error)):
        verdict = "does not reproduce"
    ours = {name: _with_error(gap) for name, gap in gaps.items()}
    why = "differences of the mean error of the range, m, paired; altered by three standard errors"
    return part("PR-C7", "altered", "the bias is altered", ours, verdict, why)


def _with_error(found: Bias) -> dict[str, float | None]:
    return {"mean": number(found.value), "standard error": number(found.standard_error)}


def _best(found: dict[str, _Heard], shift: dict[str, Bias]) -> Claim:
    """Whether the manoeuvre of the least bias has the least error, paired."""
    best = min(found, key=lambda course: abs(float(shift[course].value)))
    gaps = {
        course: bias(found[best].square - one.square)
        for course, one in found.items()
        if course != best
    }
    value, error = (np.array([gap[i] for gap in gaps.values()]) for i in (0, 1))
    ours = {
        f"less {course.removeprefix(_COURSE)}": _with_error(gap) for course, gap in gaps.items()
    }
    return part(
        "PR-C7",
        "best",
        "the manoeuvre of the least bias has the least error",
        ours,
        of_differences(value, error),
        f"the least bias is that of {best}; differences of its squared error of the position, m²",
    )
