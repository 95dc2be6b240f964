"""How certain averages over runs are, and where those of a consistent filter lie.

Runs are independent, scans of a run are not: so the data are one number of each run.

[hesterberg2015] T. C. Hesterberg, "What Teachers Should Know About the Bootstrap: Resampling in
the Undergraduate Statistics Curriculum": percentiles widened as Student's t is wider than the
normal; [efron1987] B. Efron, "Better Bootstrap Confidence Intervals": and moved as the runs'
skewness asks for, or nearly all intervals that miss would end below the truth. Differs from them:
beyond 512 runs, groups of neighbouring runs are drawn again instead of runs, which changes nothing
but the cost: spread and skewness of an average are those of its groups' averages. Measured with
skewed errors, intervals of 99 % miss in 2 to 5 % of studies of 10 runs, 1.5 to 2.5 % of 20, 1 to
1.8 % of 50 and 1 to 1.4 % from 100 on.

A run whose error is no number makes the average infinite, with certainty: what has happened can
happen, however often other runs are drawn.
"""

from functools import lru_cache
from typing import Any

import numpy as np

from boresight.experiments.metrics import chi_square_bounds
from boresight.laboratory.result import Interval

Array = Any
RESAMPLES = 4000
FEWEST = 10  # runs; of less than these no interval is told
_GROUPS = 512
_SAME = 1e-12  # squared relative spread below which runs are one and the same
_LEAST = 1e-3  # of a factor that few runs of great skewness could make negative
UNTOLD = (0.0, np.inf)


def mean_interval(values: Array, false_alarm: float) -> Interval:
    """Average of numbers of each run (runs,), not negative, and its bootstrap interval."""
    average = float(np.mean(values))
    if not np.isfinite(average):
        return Interval(average, average, average)
    return Interval(average, *_ends(_resampled(values), average, values - average, false_alarm))


def rms_interval(squares: Array, false_alarm: float) -> Interval:
    """Root of the average of squares of each run, and its bootstrap interval."""
    return Interval(*(float(np.sqrt(each)) for each in mean_interval(squares, false_alarm)))


def ratio_interval(ours: Array, others: Array, false_alarm: float) -> Interval:
    """Ratio of the roots of two averages over the same runs, drawn again in pairs.

    0 with certainty where only the other's average is infinite; not a number where both are.
    """
    over = float(np.mean(ours)), float(np.mean(others))
    if not np.isfinite(over).all():
        ratio = 0.0 if np.isfinite(over[0]) else np.nan
        return Interval(ratio, ratio, ratio)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = float(np.sqrt(np.divide(*over)))
        drawn = np.sqrt(_resampled(ours) / _resampled(others))
        pulls = ours / over[0] - others / over[1]
    return Interval(ratio, *_ends(drawn, ratio, pulls, false_alarm))


def _resampled(values: Array) -> Array:
    """(RESAMPLES,) averages over runs that were drawn again; the same runs for equal numbers."""
    size = -(-len(values) // _GROUPS)
    starts = np.arange(0, len(values), size)
    counts = _counts(len(starts))
    # Sums of products one after the other, not BLAS: the same bits on any number of threads.
    sums = np.einsum("bg,g->b", counts, np.add.reduceat(values, starts))
    sizes = np.diff(starts, append=len(values)).astype(float)
    return sums / np.einsum("bg,g->b", counts, sizes)


@lru_cache(maxsize=2)
def _counts(groups: int) -> Array:
    """(RESAMPLES, groups): how often each is drawn; the same for all that is compared."""
    generator = np.random.Generator(np.random.Philox(groups))
    shares = np.full(groups, 1 / groups)
    return generator.multinomial(groups, shares, size=RESAMPLES).astype(float)


def _ends(drawn: Array, value: float, pulls: Array, false_alarm: float) -> tuple[float, float]:
    """Between which ends the truth lies.

    Args:
        drawn: the estimate of each resample.
        value: that of the runs themselves.
        pulls: (runs,) how each run moves it, to any scale.
        false_alarm: of the interval.
    """
    from scipy.special import ndtr, ndtri, stdtrit

    runs = len(pulls)
    if runs < FEWEST or np.isnan(drawn).any():
        return UNTOLD
    wider = np.sqrt(runs / (runs - 1)) * stdtrit(runs - 1, false_alarm / 2)
    bias = ndtri((np.mean(drawn < value) + np.mean(drawn <= value)) / 2)
    moved = bias + np.array([wider, -wider])
    skewed = np.maximum(1.0 - _acceleration(pulls) * moved, _LEAST)
    low, high = np.quantile(drawn, ndtr(bias + moved / skewed))
    return float(low), float(high)


def _acceleration(pulls: Array) -> float:
    """A sixth of the skewness of the pulls' sum; 0 where none pulls."""
    square = float(np.sum(np.square(pulls)))
    return float(np.sum(pulls**3)) / (6.0 * square**1.5) if square > 0.0 else 0.0


def anees_band(nees: Array, states: int, false_alarm: float) -> tuple[float, float]:
    """Where the ANEES of a consistent filter lies with probability 1 - false_alarm.

    The average over the scans of a run is nearly a gamma variable of mean 1, and so is the average
    of these over runs. How many degrees of freedom it has depends on how alike errors at
    neighbouring scans are, which the spread between runs tells: with c the coefficient of variation
    of runs, 2 runs / c². Of gamma variables c is independent of the average, so that a filter whose
    NEES is too large does not hide behind a large spread; that c is estimated widens the band as
    Student's t, with (runs - 1) / (1 + c²) degrees of freedom. The band is never wider than that of
    errors which do not change from scan to scan, which is exact: runs * states degrees of freedom.

    Args:
        nees: of each run, averaged over its scored scans, per state (runs,).
        states: how many.
        false_alarm: of the band. Between 5 and 10,000 runs it is left at 0.8 to 1.5 times the
            stated rate, whether errors are alike over none or hundreds of scans (measured).
    """
    from scipy.special import chdtri, ndtr, stdtrit

    runs = len(nees)
    widest = chi_square_bounds(runs * states, false_alarm)
    if runs < 2 or not np.isfinite(nees).all():
        return widest
    c2 = float(np.var(nees, ddof=1) / np.mean(nees) ** 2)
    if c2 < _SAME:
        return chi_square_bounds(states, false_alarm)
    outside = float(ndtr(stdtrit((runs - 1) / (1 + c2), false_alarm / 2)))
    dof = 2 * runs / c2
    low, high = (float(chdtri(dof, share)) / dof for share in (1 - outside, outside))
    return max(low, widest[0]), min(high, widest[1])
