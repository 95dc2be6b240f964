"""The bounds of a setting, from the first of its trajectories."""

from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.bounds import bound_averaged, bound_per_trajectory
from boresight.experiments.metrics import elements
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.laboratory.study import Study

Array = Any
_TRAJECTORIES = 1000
_STEPS = 1_000_000  # of all trajectories together
_BATCH = 100_000  # steps at a time: what is stored of them stays below 100 MB


class Bound(NamedTuple):
    """What no unbiased filter does better than, on average.

    Attributes:
        position_m: root of the mean position variance over trajectories and scored scans.
        standard_error_m: of that, from how much trajectories differ; NaN of a single one.
        information_m: the same of the bound averaged in information; NaN where there is none.
        per_scan_m2: (scans,) mean position variance.
        trajectories: how many.
        remarks: what was assumed.
    """

    position_m: float
    standard_error_m: float
    information_m: float
    per_scan_m2: Array
    trajectories: int
    remarks: tuple[str, ...]


def nothing(scenario: Scenario, *remarks: str) -> Bound:
    """No bound."""
    return Bound(np.nan, np.nan, np.nan, np.full(scenario.scans, np.nan), 0, remarks)


def bound_of(study: Study, scenario: Scenario) -> Bound:
    """Both bounds of a scenario; its own motion and sensor are known to whoever attains them."""
    try:
        return _bound(study, scenario)
    except (UsageError, np.linalg.LinAlgError) as error:
        singular = isinstance(error, np.linalg.LinAlgError)
        why = "its information cannot be inverted in double precision" if singular else str(error)
        return nothing(scenario, f"No Cramér-Rao bound of {scenario.name}: {why}.")


def _bound(study: Study, scenario: Scenario) -> Bound:
    runs, batch = _trajectories(study, scenario), max(1, _BATCH // scenario.scans)
    scored, variances = slice(study.first_scan, None), []
    for first in range(0, runs, batch):
        truth, plots = _flown(study, scenario, first, min(batch, runs - first))
        at = elements(truth.names, "position")
        each = bound_per_trajectory(truth, plots, scenario.motion, scenario.sensor)
        variances.append(scenario.metre**2 * np.sum(each[:, :, at, at], axis=-1))
    variance = np.concatenate(variances)
    of_runs = np.mean(variance[:, scored], axis=1)
    position = float(np.sqrt(np.mean(of_runs)))
    spread = float(np.std(of_runs, ddof=1) / np.sqrt(runs)) if runs > 1 else np.nan
    information, remark = _information(study, scenario, min(batch, runs))
    return Bound(
        position,
        spread / (2 * position) if position else np.nan,
        information,
        np.mean(variance, axis=0),
        runs,
        (_told(scenario, runs), remark),
    )


def _trajectories(study: Study, scenario: Scenario) -> int:
    """How many are looked at: one, where nothing that a bound depends on differs between runs."""
    is_one_truth = study.truth == "one" or scenario.path is not None
    if is_one_truth and scenario.detection == 1.0 and not scenario.spent:
        return 1
    return min(study.runs, _TRAJECTORIES, max(1, _STEPS // scenario.scans))


def _flown(study: Study, scenario: Scenario, first: int, runs: int) -> tuple[Truth, Plots]:
    return simulate(
        scenario,
        runs=runs,
        seed=study.seed,
        first=first,
        truth_run=0 if study.truth == "one" else None,
        noise_run=0 if study.noise == "one" else None,
    )


def _information(study: Study, scenario: Scenario, runs: int) -> tuple[float, str]:
    """The bound averaged in information over the first batch; or NaN, and why."""
    truth, plots = _flown(study, scenario, 0, runs)
    at, models = elements(truth.names, "position"), (scenario.motion, scenario.sensor)
    detection = scenario.detection * (np.arange(scenario.scans) >= scenario.spent)
    try:
        found = bound_averaged(truth, plots.prior, *models, dt=plots.dt, detection=detection)
    except UsageError as error:
        return np.nan, f"{scenario.name}: {error}."
    traces = np.sum(found[study.first_scan :, at, at], axis=-1)
    return float(scenario.metre * np.sqrt(np.mean(traces))), ""


def _told(scenario: Scenario, runs: int) -> str:
    """On what the bound rests."""
    first = "trajectory" if runs == 1 else f"{runs:,} trajectories"
    words = f"The Cramér-Rao bound of {scenario.name} is that of the first {first}"
    if scenario.path is not None:
        words += "; the path is given and not drawn, and the bound assumes the process noise of "
        words += f"{scenario.motion!r}: of a smoother path, errors may lie below it"
    if scenario.begin == "given":
        words += "; filters start at the given state and not at a draw around it, so that at first "
        words += "errors may lie below it"
    if scenario.false_plots:
        words += "; false plots are not in it, so it is lower than it needs to be"
    return f"{words}."
