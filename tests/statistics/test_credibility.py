"""The noncredibility index against its definition, and what chance alone makes of it."""

import numpy as np
import pytest
from scipy import special

from boresight.errors import UsageError
from boresight.experiments.credibility import Credibility, credibility, mean_square_error


def drawn(seed, runs, n=4, scans=3):
    """Covariances that differ from scan to scan, and errors that have them."""
    generator = np.random.default_rng(seed)
    A = generator.standard_normal((scans, n, n))
    cov = A @ np.swapaxes(A, 1, 2) + 0.5 * np.eye(n)
    errors = np.einsum(
        "sij,rsj->rsi", np.linalg.cholesky(cov), generator.normal(size=(runs, scans, n))
    )
    return errors, np.broadcast_to(cov, (runs, *cov.shape)), cov


def test_by_hand():
    errors = np.array([[1.0, 0.0], [0.0, 2.0]])
    covs = np.array([np.eye(2), 4.0 * np.eye(2)])
    mse = np.diag([10.0, 40.0])
    found = credibility(errors, covs, mse)  # 1 over 0.1; 1 over 0.1
    assert found == pytest.approx((10.0, 10.0))
    assert credibility(errors, 100.0 * covs, mse) == pytest.approx((10.0, -10.0))
    assert credibility(np.zeros((2, 2)), covs, mse) == (0.0, 0.0)
    assert mean_square_error(errors) == pytest.approx(np.diag([0.5, 2.0]))


@pytest.mark.parametrize("factor", [1.3, 0.5])
def test_a_wrong_variance_shows_in_decibels(factor):
    errors, covs, cov = drawn(1, 500)
    index, inclination = credibility(errors, covs * factor, cov)
    assert inclination == pytest.approx(-10 * np.log10(factor))
    assert index == pytest.approx(abs(10 * np.log10(factor)))


def credible(runs):
    """Both indices of ratios that are chi-square variables over their degrees of freedom."""
    middle = (np.arange(4096) + 0.5) / 4096
    level = 10.0 * np.log10(special.chdtri(runs, middle) / runs)
    return Credibility(np.mean(np.abs(level)), np.mean(level))


@pytest.mark.parametrize("runs", [20, 200, 2000])
def test_what_a_credible_estimator_shows(runs):
    """Exact claims, the mean square error from the same runs: the average over many repetitions.

    Four standard errors: 1 in 16,000 by chance.
    """
    repetitions = 4000 // int(runs**0.5)
    errors, covs, _ = drawn(2, runs, scans=repetitions)
    found, expected = credibility(errors, covs), credible(runs)
    for ours, value in zip(found, expected, strict=True):
        error = np.std(ours, ddof=1) / np.sqrt(repetitions)
        assert abs(np.mean(ours) - value) < 4 * error
    exact = 10 / np.log(10) * (special.digamma(runs / 2) - np.log(runs / 2))
    assert expected.inclination_db == pytest.approx(exact, rel=0.02)
    assert expected.index_db == pytest.approx(4.9 / np.sqrt(runs), rel=0.05)


def test_what_is_no_number_is_infinite():
    errors, covs, cov = drawn(3, 50)
    broken = errors.copy()
    broken[7, 1] = np.inf
    index, inclination = credibility(broken, covs)
    assert np.isinf(index).tolist() == np.isinf(inclination).tolist() == [False, True, False]
    claims = covs.copy()
    claims[3, 2] *= -1.0
    assert np.isinf(credibility(errors, claims, cov).index_db).tolist() == [False, False, True]


def test_too_few_runs_are_refused():
    errors, covs, _ = drawn(4, 4)
    with pytest.raises(UsageError, match="4 runs"):
        credibility(errors, covs)
