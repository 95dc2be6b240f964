"""A single component is taken in by a shorter formula: the same, and positive for longer."""

import numpy as np
import pytest

from boresight.filters import kalman
from boresight.maths import Gaussian, elimination

EPS = 2.0**-52


def drawn(generator, sharpness):
    """A prior of kilometres and metres a second, a row (4,), and a noise so many times smaller."""
    Q = np.linalg.qr(generator.standard_normal((4, 4)))[0]
    sd = np.array([3e3, 3e3, 11.0, 11.0])
    P = (Q * generator.uniform(0.1, 1.0, 4)) @ Q.T * np.outer(sd, sd)
    turn = generator.uniform(0.0, 2.0 * np.pi)
    h = np.array([-np.sin(turn), np.cos(turn), 0.0, 0.0])
    return Gaussian(generator.standard_normal(4) * sd, (P + P.T) / 2.0), h, h @ P @ h / sharpness


def taken(prior, h, r, nu=1.0):
    seen = 0.0 if np.isnan(nu) else 1.0
    rows, noise = (h * seen)[None], np.array([[r if seen else 1.0]])
    return kalman.condition(prior, np.array([np.nan_to_num(nu)]), rows, noise, np.array([seen]))


@pytest.mark.parametrize("seed", range(20))
def test_it_is_joseph_s_form_with_the_best_gain(seed):
    prior, h, r = drawn(np.random.default_rng(seed), 1e3)
    found, (mean, cov) = taken(prior, h, r, nu=2.0), prior
    s = h @ cov @ h + r
    K = cov @ h / s
    A = np.eye(4) - np.outer(K, h)
    expected = A @ cov @ A.T + r * np.outer(K, K)
    scale = np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    np.testing.assert_allclose(found.cov / scale, expected / scale, atol=1e-13)
    np.testing.assert_allclose(found.mean, mean + 2.0 * K, rtol=1e-12)
    np.testing.assert_allclose(found.nis, 4.0 / s, rtol=1e-12)
    np.testing.assert_allclose(found.loglik, -0.5 * (4.0 / s + np.log(2.0 * np.pi * s)), rtol=1e-12)
    np.testing.assert_allclose(found.variance, [s], rtol=1e-12)


@pytest.mark.parametrize("sharpness", [1e6, 1e12, 1e15, 1e18, 1e20])
def test_a_plot_however_sharp_leaves_a_positive_covariance(sharpness):
    """No false alarm is possible: seeds are fixed."""
    generator = np.random.default_rng(7)
    for _ in range(2_000):
        assert min(elimination(taken(*drawn(generator, sharpness)).cov)) > 0.0


def test_what_is_left_for_positivity_is_a_few_roundings():
    P = np.diag([1e8, 1.0])
    left = taken(Gaussian(np.zeros(2), P), np.array([1.0, 0.0]), 1.0).cov
    assert left[1, 1] == 1.0
    assert abs(left[0, 0] - 1.0) < 8 * EPS * 1e8


def test_a_missing_component_changes_nothing():
    prior, h, r = drawn(np.random.default_rng(3), 1e3)
    found = taken(prior, h, r, nu=np.nan)
    assert np.array_equal(found.mean, prior.mean)
    assert np.array_equal(found.cov, prior.cov)
    assert (found.nis, found.dof, found.loglik) == (0.0, 0.0, 0.0)
    assert np.isnan(found.variance[0])


def test_a_covariance_that_is_none_does_not_come_back_as_one():
    h = np.array([1.0, 0.0])
    found = taken(Gaussian(np.zeros(2), np.diag([-5.0, 1.0])), h, 1.0)
    assert np.isnan(found.cov[0, 0])
    assert np.isnan(found.loglik)
