"""Filters held against the exact posterior: how far from the best that any could do.

Every filter sees the plots that the exact answer saw, so each ratio compares errors of the same
runs, and its interval resamples them in pairs. What the exact moments allow besides is an
expectation over all truths that could have made the plots, instead of the one drawn:

    E |error|² = trace(P) + |m - mean|²,  E NEES = trace(cov⁻¹ P) + (m - mean)' cov⁻¹ (m - mean)

with the exact mean m and covariance P. These have no noise of the truth's, and the second one's
terms tell a covariance that is wrong from a mean that is.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.experiments import metrics
from boresight.experiments.posterior import Exact, Flight, draw, exact_posterior
from boresight.experiments.simulate import Truth
from boresight.filters.method import Filter
from boresight.filters.recursion import run_recursion
from boresight.models.motion import ConstantVelocity

if TYPE_CHECKING:
    import polars as pl

Array = Any
EXACT = "exact posterior"
_PARTS = {"position": slice(0, 2), "velocity": slice(2, 4)}
_RESAMPLES = 2000


def against_posterior(
    flight: Flight,
    filters: Mapping[str, Filter],
    *,
    at: Sequence[int],
    runs: int,
    seed: int,
    points: int = 4096,
    false_alarm: float = 0.01,
) -> "pl.DataFrame":
    """Draw truths and plots, filter them, and hold all against the exact posterior.

    Args:
        flight: what is drawn, and the prior of all.
        filters: what to compare, by the name to show.
        at: numbers of the scans, from 0.
        runs: number of runs.
        seed: of truths, plots and points.
        points: of the exact posterior, for each run and scan.
        false_alarm: of every interval and band.

    Returns:
        A row for the exact posterior and each filter at each scan: `rmse`, `ratio` to the exact
        posterior's, its paired interval `low` to `high`, and `expected` (the ratio over all truths
        that the plots allow), each of position and of velocity; `anees` with the band of a
        consistent filter, and `expected_nees` with the part that the covariance has in it;
        `least_ess`, the smallest effective sample size of the exact posterior.
    """
    import polars as pl

    truth, z = draw(flight, runs=runs, seed=seed)
    exact = exact_posterior(flight, z, at=at, points=points, seed=seed)
    estimates: dict[str, Any] = {EXACT: exact}
    estimates |= {name: _run(each, flight, z, at) for name, each in filters.items()}
    then = Truth(truth.time_s[list(at)], truth.states[:, list(at)], truth.names, truth.start)
    band = metrics.chi_square_bounds(runs * len(truth.names), false_alarm)
    rows = []
    for name, estimate in estimates.items():
        columns = _errors(estimate, exact, then, false_alarm) | _consistency(estimate, exact, then)
        rows += [
            {"filter": name, "scan": scan + 1}
            | {column: values[j] for column, values in columns.items()}
            | {"band_low": band[0], "band_high": band[1], "least_ess": np.min(exact.ess[:, j])}
            for j, scan in enumerate(at)
        ]
    return pl.DataFrame(rows)


def _run(each: Filter, flight: Flight, z: Array, at: Sequence[int]) -> Exact:
    """The filter's moments at the scans, started from the first plot as the filter itself would."""
    motion = ConstantVelocity(accel_mps2=0.0, dims=2)
    recursion = each.recursion(motion, flight.sensor)
    start = recursion.method.start(z[:, 0], motion, flight.sensor, speed_mps=flight.speed_mps)
    later, dt = z.copy(), np.full((1, flight.scans), flight.dt_s)
    later[:, 0], dt[0, 0] = np.nan, 0.0  # spent on the start
    told = run_recursion(recursion, later, dt, start, outputs=("mean", "cov"))
    return Exact(told.mean[:, list(at)], told.cov[:, list(at)], np.nan)


def _errors(estimate: Any, exact: Any, truth: Truth, false_alarm: float) -> dict[str, Array]:
    """RMSE and its ratios to the exact posterior's, (scans,) each."""
    columns: dict[str, Array] = {}
    for of, part in _PARTS.items():
        ours = metrics.squared_error(estimate, truth, of)
        best = metrics.squared_error(exact, truth, of)
        spread = np.einsum("rsii->rs", exact.cov[..., part, part])
        off = np.sum(np.square(estimate.mean - exact.mean)[..., part], axis=-1)
        low, high = _paired_interval(ours, best, false_alarm)
        columns |= {
            f"{of}_rmse": np.sqrt(np.mean(ours, axis=0)),
            f"{of}_ratio": np.sqrt(np.mean(ours, axis=0) / np.mean(best, axis=0)),
            f"{of}_low": low,
            f"{of}_high": high,
            f"{of}_expected": np.sqrt(1 + np.mean(off, axis=0) / np.mean(spread, axis=0)),
        }
    return columns


def _paired_interval(ours: Array, best: Array, false_alarm: float) -> Array:
    """(2, scans): bootstrap interval of the ratio of RMSE, runs drawn again in pairs."""
    runs = len(ours)
    generator = np.random.Generator(np.random.Philox(runs))  # the same runs, the same interval
    counts = generator.multinomial(runs, np.full(runs, 1 / runs), size=_RESAMPLES)
    ratios = np.sqrt((counts @ ours) / (counts @ best))
    return np.quantile(ratios, [false_alarm / 2, 1 - false_alarm / 2], axis=0)


def _consistency(estimate: Any, exact: Any, truth: Truth) -> dict[str, Array]:
    """ANEES, drawn and expected, (scans,) each; all per state."""
    n = len(truth.names)
    wide = np.einsum("rsij,rsji->rs", np.linalg.inv(estimate.cov), exact.cov)
    off = metrics.nees(estimate, truth._replace(states=exact.mean))
    return {
        "anees": metrics.anees_per_scan(estimate, truth),
        "expected_nees": np.mean(wide + off, axis=0) / n,
        "of_covariance": np.mean(wide, axis=0) / n,
    }
