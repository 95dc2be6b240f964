"""Metrics against sums by hand, SciPy's distributions and plain NumPy."""

import numpy as np
import pytest
from scipy import stats

from boresight.errors import UsageError
from boresight.experiments import metrics
from boresight.experiments.bounds import average_in_covariance
from boresight.experiments.simulate import Truth
from boresight.filters.recursion import Estimate

NAMES = ("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps")


def made(mean, cov=None, **others):
    """An estimate of these numbers."""
    outputs = {"mean": np.asarray(mean, dtype=float)} | others
    if cov is not None:
        outputs["cov"] = np.asarray(cov, dtype=float)
    return Estimate(outputs, None)


def truth_of(states, names=NAMES):
    states = np.asarray(states, dtype=float)
    return Truth(np.arange(states.shape[1], dtype=float), states, names, states[:, 0])


def random_covariances(generator, *shape, n=6):
    A = generator.standard_normal((*shape, n, n))
    return A @ np.swapaxes(A, -1, -2) + 0.5 * np.eye(n)


def test_rmse_by_hand():
    states = np.zeros((2, 2, 6))
    mean = states.copy()
    mean[0, 0, :3] = 3.0, 4.0, 0.0  # 5 m
    mean[1, 1, :3] = 0.0, 0.0, 1.0  # 1 m
    mean[0, 1, 3:] = 2.0, 0.0, 0.0
    found, truth = made(mean), truth_of(states)
    assert metrics.rmse(found, truth) == pytest.approx(np.sqrt(26 / 4))
    assert metrics.rmse(found, truth, of="velocity") == pytest.approx(1.0)
    assert metrics.rmse(found, truth, of="y_m") == pytest.approx(2.0)
    assert metrics.rmse(found, truth, scans=slice(1, None)) == pytest.approx(np.sqrt(1 / 2))
    assert metrics.rmse_per_scan(found, truth) == pytest.approx([np.sqrt(25 / 2), np.sqrt(1 / 2)])
    assert metrics.rmse_per_run(found, truth) == pytest.approx([np.sqrt(25 / 2), np.sqrt(1 / 2)])


def test_an_unknown_quantity_is_refused():
    with pytest.raises(UsageError, match="altitude"):
        metrics.rmse(made(np.zeros((1, 1, 6))), truth_of(np.zeros((1, 1, 6))), of="altitude")


def test_an_estimate_without_what_is_needed_is_refused():
    found, truth = made(np.zeros((1, 2, 6))), truth_of(np.zeros((1, 2, 6)))
    for metric in (lambda: metrics.anees(found, truth), lambda: metrics.anis(found)):
        with pytest.raises(UsageError, match="in outputs"):
            metric()
    with pytest.raises(UsageError, match=r"\(1, 2, 6\).*\(1, 3, 6\)"):
        metrics.rmse(found, truth_of(np.zeros((1, 3, 6))))


def test_a_lost_run_counts():
    mean = np.ones((10, 3, 6))
    mean[4, 2] = np.nan
    cov = np.broadcast_to(np.eye(6), (10, 3, 6, 6)).copy()
    cov[4, 2] = np.nan
    found, truth = made(mean, cov), truth_of(np.zeros((10, 3, 6)))
    assert metrics.rmse(found, truth) == np.inf
    assert metrics.anees(found, truth).value == np.inf
    assert np.isfinite(metrics.rmse(found, truth, scans=slice(0, 2)))
    assert metrics.diverged(found, truth) == pytest.approx(0.1)
    assert metrics.percent_fit_error(found, truth_of(np.ones((10, 3, 6))))["x"][4] == np.inf


def test_nees_is_the_quadratic_form():
    generator = np.random.default_rng(1)
    cov = random_covariances(generator, 5, 7)
    error = generator.standard_normal((5, 7, 6))
    expected = np.einsum("rsi,rsi->rs", error, np.linalg.solve(cov, error[..., None])[..., 0])
    found = metrics.nees(made(error, cov), truth_of(np.zeros((5, 7, 6))))
    assert np.allclose(found, expected, rtol=1e-9)


def test_a_covariance_that_is_none_makes_the_nees_infinite():
    cov = np.broadcast_to(np.diag([1.0, 1, 1, 1, 1, -1]), (1, 1, 6, 6))
    assert metrics.nees(made(np.ones((1, 1, 6)), cov), truth_of(np.zeros((1, 1, 6)))) == np.inf


@pytest.mark.parametrize("dof", [1, 6, 1200])
@pytest.mark.parametrize("false_alarm", [0.05, 0.001])
def test_bounds_are_those_of_chi_square(dof, false_alarm):
    low, high = metrics.chi_square_bounds(dof, false_alarm)
    expected = stats.chi2.ppf([false_alarm / 2, 1 - false_alarm / 2], dof) / dof
    assert [low, high] == pytest.approx(expected, rel=1e-9)


def test_a_consistent_filter_leaves_the_bounds_as_often_as_stated():
    """4,000 independent scans of 20 runs; 5 % of them outside, standard error 0.34 %."""
    generator = np.random.default_rng(2)
    cov = random_covariances(generator)
    error = generator.standard_normal((20, 4000, 6)) @ np.linalg.cholesky(cov).T
    found = made(error, np.broadcast_to(cov, (20, 4000, 6, 6)))
    truth = truth_of(np.zeros((20, 4000, 6)))
    total = metrics.anees(found, truth)
    per_scan = metrics.anees_per_scan(found, truth)
    outside = np.mean((per_scan < total.low) | (per_scan > total.high))
    assert outside == pytest.approx(0.05, abs=4 * 0.0034)
    assert total.value == pytest.approx(1.0, abs=4 * total.standard_error)
    assert total.standard_error == pytest.approx(np.sqrt(2 / (6 * 20 * 4000)), rel=0.6)


def test_overconfidence_shows():
    generator = np.random.default_rng(3)
    error = 2.0 * generator.standard_normal((50, 100, 6))
    cov = np.broadcast_to(np.eye(6), (50, 100, 6, 6))
    total = metrics.anees(made(error, cov), truth_of(np.zeros_like(error)))
    assert total.value == pytest.approx(4.0, rel=0.05)
    assert total.value > total.high
    for factor, share in ((4.0, 0.0), (6.0, 1.0)):  # NEES of 64 and of 144 a state
        assert metrics.diverged(made(factor * error, cov), truth_of(np.zeros_like(error))) == share


def test_anis_counts_what_was_measured():
    generator = np.random.default_rng(4)
    nis = generator.chisquare(3, (40, 50))
    dof = np.full((40, 50), 3.0)
    nis[:, ::2], dof[:, ::2] = 0.0, 0.0  # every other scan had no plot
    total = metrics.anis(made(np.zeros((40, 50, 6)), nis=nis, dof=dof))
    assert total.value == pytest.approx(np.sum(nis) / 3000)
    assert [total.low, total.high] == pytest.approx(stats.chi2.ppf([0.025, 0.975], 3000) / 3000)
    assert abs(total.value - 1.0) < 4 * total.standard_error
    assert total.standard_error == pytest.approx(np.sqrt(2 / 3000), rel=0.4)


def test_percent_fit_error_by_hand_and_wrapped():
    true = np.zeros((1, 2, 6))
    true[0, :, :3] = [[-100.0, 1.0, 10.0], [-100.0, 1.0, 10.0]]
    mean = true.copy()
    mean[0, :, 1] = -1.0  # the other side of south: 1.1 degrees away, not 358.9
    pfe = metrics.percent_fit_error(made(mean), truth_of(true))
    assert set(pfe) == {"range", "azimuth", "elevation", "x", "y", "z"}
    assert pfe["y"] == pytest.approx([200.0])
    assert pfe["x"] == pytest.approx([0.0])
    away = 2 * np.arctan(0.01)
    assert pfe["azimuth"] == pytest.approx([100 * away / (np.pi - away / 2)])
    planar = truth_of(true[..., [0, 1, 3, 4]], ("x_m", "y_m", "vx_mps", "vy_mps"))
    flat = metrics.percent_fit_error(made(mean[..., [0, 1, 3, 4]]), planar)
    assert set(flat) == {"range", "azimuth", "x", "y"}


def test_bounds_are_averaged_in_covariance():
    bound = np.zeros((2, 2, 6, 6))
    bound[0, :, range(3), range(3)] = 1.0
    bound[1, :, range(3), range(3)] = 9.0
    assert average_in_covariance(bound, NAMES) == pytest.approx(np.sqrt(15.0))
    assert average_in_covariance(bound, NAMES, of="velocity") == 0.0
