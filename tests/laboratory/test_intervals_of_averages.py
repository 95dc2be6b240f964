"""Bootstrap intervals of averages and of their ratios, against Student's t and SciPy's own."""

import numpy as np
import pytest
from scipy import stats

from boresight.laboratory.intervals import mean_interval, ratio_interval


def test_intervals_are_as_wide_as_student_s():
    """Of few runs too: for each number of them the resamples are others, so on average."""
    generator, shares, ratios = np.random.default_rng(8), [], []
    for runs in range(10, 40):
        half = stats.t.ppf(0.9, runs - 1) / np.sqrt(runs)
        values = 100.0 + generator.standard_normal(runs)
        _, low, high = mean_interval(values, 0.2)
        shares.append((high - low) / (2 * half * values.std(ddof=1)))
        other = 100.0 + generator.standard_normal(runs)
        _, low, high = ratio_interval(values, other, 0.2)
        pull = values / values.mean() - other / other.mean()
        ratios.append((high - low) / (half * np.std(pull, ddof=1)))
    assert np.mean(shares) == pytest.approx(1.0, abs=0.012)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.02)


def _ratio(ours, others, axis=-1):
    return np.sqrt(np.mean(ours, axis=axis) / np.mean(others, axis=axis))


def efron(statistic, *samples, error):
    """SciPy's interval of the same kind, at the level to which Student's t widens it."""
    runs = len(samples[0])
    error = 2 * stats.norm.cdf(np.sqrt(runs / (runs - 1)) * stats.t.ppf(error / 2, runs - 1))
    found = stats.bootstrap(
        samples,
        statistic,
        paired=True,
        vectorized=True,
        n_resamples=4000,
        confidence_level=1 - error,
        method="BCa",
        random_state=np.random.default_rng(runs),
    )
    return np.array(found.confidence_interval)


def gap(found, statistic, *samples):
    """How far both ends are from SciPy's, in standard errors."""
    return (
        (np.array(found[1:]) - efron(statistic, *samples, error=0.01))
        * 5.2
        / (found.high - found.low)
    )


def test_intervals_lean_as_skewness_asks_for():
    """On average over data sets; those that lean on nothing are 0.3 standard errors off."""
    generator, gaps = np.random.default_rng(4), []
    for runs in range(90, 110):
        values = generator.gamma(0.5, 2.0, runs)
        ours = 1.0 + 0.02 * generator.standard_normal(runs)
        gaps.append(
            [
                gap(mean_interval(values, 0.01), np.mean, values),
                gap(ratio_interval(ours, values, 0.01), _ratio, ours, values),
            ]
        )
    assert np.max(np.abs(np.mean(gaps, axis=0))) < 0.2
