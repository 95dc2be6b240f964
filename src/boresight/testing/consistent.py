"""Whether a filter knows its errors, as an assertion with a stated rate of false alarms.

[barshalom2001] section 5.4; the bands are those of the laboratory's verdicts.
"""

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.metrics import ALL, Consistency, anis, nees
from boresight.experiments.simulate import Truth
from boresight.filters.recursion import Estimate
from boresight.laboratory.intervals import anees_band
from boresight.testing.comparing import BrokenLawError

FEWEST_RUNS = 10  # below, the spread between runs is not known well enough for a band


def assert_consistent(
    estimate: Estimate,
    truth: Truth | None = None,
    *,
    scans: slice = ALL,
    false_alarm: float = 0.01,
) -> dict[str, Consistency]:
    """Raise AssertionError where a filter's covariances do not match its errors.

    Two tests share the false alarm: the NEES against the truth, if there is one, and the NIS, if
    the estimate has `nis` and `dof`.

    Args:
        estimate: of `run`, with at least 10 runs.
        truth: what was estimated.
        scans: which scans; the first ones still show the start.
        false_alarm: probability with which a filter that is consistent is called otherwise.

    Returns:
        `anees` and `anis`, as far as they were tested: value and band.

    Raises:
        BrokenLawError: an AssertionError; too sure of itself, or too modest.
        UsageError: nothing that could be tested, or fewer than 10 runs.
    """
    has_nis = all(name in estimate.others for name in ("nis", "dof"))
    tests = (truth is not None) + has_nis
    if not tests:
        raise UsageError(
            "there is nothing to test the estimate by",
            next_step='give the truth, or run with outputs=("mean", "cov", "nis", "dof")',
        )
    found = {}
    if truth is not None:
        found["anees"] = _nees_over_runs(estimate, truth, scans, false_alarm / tests)
    if has_nis:
        found["anis"] = anis(estimate, scans=scans, false_alarm=false_alarm / tests)
    for name, each in found.items():
        if not each.low <= each.value <= each.high:
            raise BrokenLawError(_sentence(name, each, false_alarm))
    return found


def _nees_over_runs(
    estimate: Estimate, truth: Truth, scans: slice, false_alarm: float
) -> Consistency:
    """Average NEES per state, and its band."""
    states = truth.states.shape[2]
    runs = np.mean(nees(estimate, truth)[:, scans], axis=1) / states
    if len(runs) < FEWEST_RUNS:
        raise UsageError(
            f"{len(runs)} runs tell too little of a filter's errors",
            next_step=f"simulate {FEWEST_RUNS} runs or more",
        )
    with np.errstate(invalid="ignore"):  # of runs that are not numbers
        spread = float(np.std(runs, ddof=1) / np.sqrt(len(runs)))
    return Consistency(float(np.mean(runs)), *anees_band(runs, states, false_alarm), spread)


def _sentence(name: str, found: Consistency, false_alarm: float) -> str:
    how = "too sure of itself" if found.value > found.high else "too modest"
    return (
        f"the filter is {how}: {name.upper()} {found.value:.3g}, and a consistent one lies within "
        f"{found.low:.3g} to {found.high:.3g} (false alarm {100 * false_alarm:g} %)"
    )
