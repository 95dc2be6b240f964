"""Batch least squares: a weighted mean, for many batches, missing plots left out."""

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.filters.least_squares import batch_least_squares


def batches(shape, plots=12, d=3):
    rng = np.random.default_rng(4)
    A = rng.normal(size=(*shape, plots, d, d))
    return rng.normal(size=(*shape, plots, d)), A @ A.mT + 0.1 * np.eye(d)


def test_it_solves_the_stacked_regression():
    z, R = batches(())
    whitened = np.linalg.inv(np.linalg.cholesky(R))
    rows, targets = whitened.reshape(-1, 3), np.einsum("pij,pj->pi", whitened, z).ravel()
    expected = np.linalg.lstsq(rows, targets)[0]
    found = batch_least_squares(z, R)
    assert np.allclose(found.mean, expected, rtol=1e-10)
    assert np.allclose(np.linalg.inv(found.cov), rows.T @ rows, rtol=1e-10)


def test_batches_do_not_mix_and_one_covariance_serves_all():
    z, R = batches((2, 5))
    found = batch_least_squares(z, R)
    assert np.allclose(found.mean[1, 3], batch_least_squares(z[1, 3], R[1, 3]).mean, rtol=1e-12)
    alike = batch_least_squares(z, R[0, 0, 0])
    assert np.allclose(alike.mean, z.mean(-2), rtol=1e-10, atol=1e-12)
    assert np.allclose(alike.cov, R[0, 0, 0] / 12, rtol=1e-10)


def test_plots_that_are_not_complete_are_left_out():
    z, R = batches((2,))
    less = batch_least_squares(z[:, 2:], R[:, 2:])
    z[:, 0, 1], R[:, 1, 0, 0] = np.nan, np.nan
    found = batch_least_squares(z, R)
    assert np.allclose(found.mean, less.mean, rtol=1e-12)
    assert np.allclose(found.cov, less.cov, rtol=1e-12)
    z[0] = np.nan
    nothing = batch_least_squares(z, R)
    assert np.all(np.isnan(nothing.mean[0]))
    assert np.all(np.isnan(nothing.cov[0]))
    assert np.array_equal(nothing.mean[1], found.mean[1])


def test_shapes_that_do_not_fit_are_told():
    z, R = batches(())
    with pytest.raises(UsageError, match="do not fit"):
        batch_least_squares(z, R[..., :2, :2])
    with pytest.raises(UsageError, match="do not fit"):
        batch_least_squares(z[0], R[0])
