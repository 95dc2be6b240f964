"""Numbers of the metrics that a study asks for beyond errors and consistency."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from boresight.experiments.metrics import channels, elements
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import simulate
from boresight.experiments.verdicts import share_interval
from boresight.laboratory.intervals import mean_interval
from boresight.laboratory.result import Interval
from boresight.laboratory.scores import Gathered
from boresight.laboratory.study import Contender, Study
from boresight.maths import wrap

Array = Any
Numbers = Iterator[tuple[str, Any]]


def further(
    study: Study, scenario: Scenario, contender: Contender, gathered: Gathered
) -> dict[str, Any]:
    """What `Cell.extra` holds of bias, fit error, RSSPE, convergence, OSPA and GOSPA."""
    found = dict(_sets(study, gathered))
    if "bias" in study.metrics and gathered.count > 1:
        found |= dict(_bias(study, scenario, contender, gathered))
    if "rsspe" in study.metrics:
        distance = gathered.sums["distance_m"] / gathered.count
        found["rsspe_m"] = float(np.mean(distance[study.first_scan :]))
    if "convergence" in study.metrics:
        found |= dict(_convergence(study, scenario, gathered))
    if "percent fit error" in study.metrics:
        found |= dict(_fit(study, scenario, contender, gathered))
    return found


def scored_names(scenario: Scenario, contender: Contender) -> tuple[str, ...]:
    """States that truth and estimate share."""
    return tuple(name for name in scenario.motion.names if name in contender.motion.names)


def _bias(study: Study, scenario: Scenario, contender: Contender, gathered: Gathered) -> Numbers:
    """Bias of each state, and whether the position's is more than chance.

    The length of the mean position error over its standard error, sqrt(trace / runs), strays
    farthest from zero if all errors lie in one direction; then it is Student's t. Its largest value
    over scans is held against the limit for so many scans (Bonferroni): without bias at most
    `false_alarm` of studies exceed it.
    """
    from scipy.special import stdtrit

    runs, scored = gathered.count, slice(study.first_scan, None)
    mean = gathered.sums["error"][scored] / runs
    names = scored_names(scenario, contender)
    yield from (
        (f"bias_{name}", float(x)) for name, x in zip(names, mean.mean(axis=0), strict=True)
    )
    off = scenario.metre * mean[:, elements(names, "position")]
    square = np.sum(np.square(off), axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        noise = (gathered.sums["position_sq_m2"][scored] / runs - square) / (runs - 1)
        away = np.where(np.isfinite(square), np.sqrt(square / noise), np.inf)
    clearest = int(np.argmax(away))
    yield "bias_scan", study.first_scan + clearest
    yield "bias_m", float(np.sqrt(square[clearest]))
    yield "bias_standard_errors", float(away[clearest])
    share = study.false_alarm / (2 * len(square))
    yield "bias_limit", float(-stdtrit(runs - 1, share))


def _convergence(study: Study, scenario: Scenario, gathered: Gathered) -> Numbers:
    """Share of runs that converged, and when the median run did; infinite if it did not."""
    scan = gathered.runs["converged_scan"].astype(int)
    times = np.append(scenario.time_s, np.inf)[scan]
    true = int(np.sum(np.isfinite(times)))
    ends = share_interval(true, gathered.count, study.false_alarm)
    yield "converged", Interval(true / gathered.count, *ends)
    yield "convergence_s", float(np.quantile(times, 0.5, method="inverted_cdf"))


def _fit(study: Study, scenario: Scenario, contender: Contender, gathered: Gathered) -> Numbers:
    """Percent fit error averaged over runs and, where all share one truth, that of their average.

    Paper: kashyap, tables 2 to 6, erratum K13 (it does not say which of the two is printed).
    """
    prefix = "fit_error_"
    for name, values in gathered.runs.items():
        if name.startswith(prefix):
            interval = mean_interval(values, study.false_alarm)
            yield f"percent_fit_error_{name.removeprefix(prefix)}", interval
    if study.truth == "one" or scenario.path is not None:
        yield from _fit_of_average(study, scenario, contender, gathered)


def _fit_of_average(
    study: Study, scenario: Scenario, contender: Contender, gathered: Gathered
) -> Numbers:
    truth, _ = simulate(scenario, runs=1, seed=study.seed)
    names, scored = scored_names(scenario, contender), slice(study.first_scan, None)
    true = truth.states[0, scored][:, elements(truth.names, "position")]
    error = gathered.sums["error"][scored] / gathered.count
    found = channels(true + error[:, elements(names, "position")])
    for name, channel in channels(true).items():
        off = found[name] - channel
        off = wrap(off) if name in ("azimuth", "elevation") else off
        share = float(np.linalg.norm(off) / np.linalg.norm(channel))
        yield f"percent_fit_error_of_average_{name}", 100 * share if np.isfinite(share) else np.inf


def _sets(study: Study, gathered: Gathered) -> Numbers:
    """OSPA and GOSPA averaged over runs and scans; parts are root mean powers, which add up."""
    runs, c, p = gathered.runs, study.limits.cutoff_m, study.limits.order
    for name in ("ospa_m", "gospa_m"):
        if name in runs:
            yield name, mean_interval(runs[name], study.false_alarm)
    if "gospa_m" in runs:
        means = {part: float(np.mean(runs[f"gospa_{part}"])) for part in _PARTS}
        yield from ((f"gospa_{part}_m", mean ** (1 / p)) for part, mean in means.items())
        yield from ((part, means[part] / (c**p / 2)) for part in ("missed", "false"))


_PARTS = ("localisation", "missed", "false")
