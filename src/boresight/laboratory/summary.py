"""From the scores of all runs to a study's result: averages, intervals, bands, comparisons.

Averages are over runs and scored scans. No run is ever left out: where an error is no number, the
average is infinite, and the median of runs stands beside it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from boresight.experiments.metrics import DIVERGED, chi_square_bounds
from boresight.experiments.verdicts import share_interval
from boresight.laboratory.bounding import Bound, bound_of, nothing
from boresight.laboratory.comparing import compared
from boresight.laboratory.credible import credibility_of
from boresight.laboratory.exactly import UNASKED, Exactly, beside_exact, exact_of
from boresight.laboratory.further import further
from boresight.laboratory.intervals import (
    FEWEST,
    anees_band,
    mean_interval,
    rms_interval,
)
from boresight.laboratory.result import Cell, Comparison, Interval, StudyResult
from boresight.laboratory.scores import Gathered
from boresight.laboratory.sentences import doubts, verdicts
from boresight.laboratory.study import Study, first_known

Array = Any


def summarise(study: Study, gathered: Sequence[Gathered]) -> StudyResult:
    """What a study found.

    Args:
        study: what was asked.
        gathered: all runs of each of its cells, in their order.

    Returns:
        The result, but for its digest.
    """
    scores = dict(zip(study.cells, gathered, strict=True))
    bests = list(_bests(study))
    cells = tuple(
        _cell(study, place, of_cell, bests[place[0]]) for place, of_cell in scores.items()
    )
    comparisons: list[Comparison] = []
    for setting in range(len(study.settings)):
        mine = [cell for cell in cells if cell.setting == setting]
        comparisons += compared(mine, study.false_alarm)
    told = [words for best in bests for words in (*best.bound.remarks, best.exactly.remark)]
    remarks = tuple(dict.fromkeys(words for words in (*told, *_remarks(study)) if words))
    return StudyResult(
        study=study, cells=cells, comparisons=tuple(comparisons), digest="", remarks=remarks
    )


class _Best(NamedTuple):
    """What the best filter could do in a world."""

    bound: Bound
    exactly: Exactly


def _bests(study: Study) -> Iterator[_Best]:
    """One for each setting; those of one scenario share it."""
    known: dict[int, _Best] = {}
    for scenario in (setting.scenario for setting in study.settings):
        if id(scenario) not in known:
            known[id(scenario)] = _Best(
                bound_of(study, scenario) if "bound" in study.metrics else nothing(scenario),
                exact_of(study, scenario) if "exact posterior" in study.metrics else UNASKED,
            )
        yield known[id(scenario)]


def _cell(study: Study, place: tuple[int, int], gathered: Gathered, best: _Best) -> Cell:
    setting, bound = study.settings[place[0]], best.bound
    contender, scenario = setting.contenders[place[1]], setting.scenario
    runs, alarm = gathered.runs, study.false_alarm
    position = rms_interval(runs["position_sq_m2"], alarm)
    states = gathered.sums["error"].shape[1]
    extra = further(study, scenario, contender, gathered)
    extra |= beside_exact(best.exactly, gathered, alarm)
    if "noncredibility" in study.metrics:
        extra |= credibility_of(study, setting, contender, gathered)
    if np.isfinite(bound.position_m):
        extra["pcrlb_standard_error_m"] = bound.standard_error_m
    cell = Cell(
        setting=place[0],
        contender=place[1],
        label=contender.label,
        values=setting.values,
        runs=gathered.count,
        position_rmse_m=position,
        velocity_rmse_mps=rms_interval(runs["velocity_sq_m2ps2"], alarm),
        median_rmse_m=float(np.median(np.sqrt(runs["position_sq_m2"]))),
        anees=mean_interval(runs["nees"], alarm),
        anees_bounds=anees_band(runs["nees"], states, alarm),
        **_innovations(runs, alarm),
        pcrlb_m=bound.position_m,
        pcrlb_information_m=bound.information_m,
        ratio_to_bound=position.value / bound.position_m if bound.position_m else np.nan,
        diverged=diverged(runs["nees"], alarm),
        ns_per_step=gathered.seconds * 1e9 / (gathered.count * scenario.scans),
        extra=extra,
        per_scan=_per_scan(gathered, bound, first_known(scenario)),
        per_run=gathered.runs,
        verdicts=(),
    )
    return replace(cell, verdicts=verdicts(study, cell), doubts=doubts(study, cell))


def _innovations(runs: Mapping[str, Array], false_alarm: float) -> dict[str, Any]:
    """Average NIS per measured number, and its exact band: innovations are independent."""
    dof = float(np.sum(runs["dof"]))
    if not dof > 0.0:
        return {"anis": np.nan, "anis_bounds": (np.nan, np.nan)}
    value = float(np.sum(runs["nis"])) / dof
    return {"anis": value, "anis_bounds": chi_square_bounds(dof, false_alarm)}


def diverged(nees: Array, false_alarm: float) -> Interval:
    """Share of runs whose errors are ten times what the filter claims, or not numbers."""
    true, runs = int(np.sum(~(nees < DIVERGED))), len(nees)
    return Interval(true / runs, *share_interval(true, runs, false_alarm))


def _per_scan(gathered: Gathered, bound: Bound, known: int) -> dict[str, Array]:
    """Means of each scan; no numbers before the one at which tracks start."""
    found = {
        name: total / gathered.count
        for name, total in gathered.sums.items()
        if name != "error_outer"
    }
    if bound.trajectories:
        found["bound_m2"] = np.array(bound.per_scan_m2)
    for name in found.keys() - {"nis", "dof"}:  # of which there are none before, rightly
        found[name][:known] = np.nan
    return found


def _remarks(study: Study) -> Iterator[str]:
    """What keeps a number from meaning what it usually does."""
    if study.runs < FEWEST:
        few = "1 run is" if study.runs == 1 else f"{study.runs} runs are"
        yield f"{few} too few for intervals: {FEWEST} or more are needed."
    if study.truth == study.noise == "one":
        yield "All runs share one truth and one noise: they are one run, and no interval holds."
    elif "one" in (study.truth, study.noise):
        which = "truth" if study.truth == "one" else "noise"
        yield (
            f"All runs share one {which}: averages are those of that {which}, and even a "
            "consistent filter may leave its bands."
        )
    gated = [c.label for s in study.settings for c in s.contenders if c.gate is not None]
    if gated:
        names = ", ".join(dict.fromkeys(gated))
        yield f"Bands of NIS do not hold behind a gate, which cuts off large ones: {names}."
