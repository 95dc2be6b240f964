"""Small linear algebra against NumPy's own, and where a matrix is not positive definite."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.maths import cholesky, elimination, joseph, lower_solve, mirror, solve, upper_solve

seeds = st.integers(0, 2**32)
sizes = st.integers(1, 9)


def positive(seed, n):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n)) + 2 * np.eye(n)
    scale = 10.0 ** rng.uniform(-3, 3, n)
    return scale[:, None] * (root @ root.T + 0.1 * np.eye(n)) * scale


@given(seed=seeds, n=sizes)
def test_cholesky_and_its_solves(seed, n):
    A = positive(seed, n)
    L, inverse = cholesky(A)
    np.testing.assert_allclose(L, np.linalg.cholesky(A), rtol=1e-9, atol=1e-9 * np.max(L))
    np.testing.assert_allclose(inverse * np.diag(L), 1.0, rtol=1e-14)
    b = np.random.default_rng((seed, 1)).normal(size=(n, 2))
    np.testing.assert_allclose(L @ lower_solve(L, inverse, b), b, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(L.T @ upper_solve(L, inverse, b), b, rtol=1e-8, atol=1e-8)
    d = np.sqrt(np.diag(A))
    np.testing.assert_allclose((A @ solve(A, b[:, 0])) / d, b[:, 0] / d, rtol=1e-6, atol=1e-6)


@given(seed=seeds, n=sizes)
def test_pivots_are_positive_just_where_the_matrix_is(seed, n):
    A = positive(seed, n)
    pivots = elimination(A)
    assert all(p > 0 for p in pivots)
    np.testing.assert_allclose(
        np.sum(np.log(pivots)), np.linalg.slogdet(A)[1], rtol=1e-9, atol=1e-9
    )
    values, vectors = np.linalg.eigh(A / np.outer(*2 * [np.sqrt(np.diag(A))]))
    values[0] = -values[0]
    assert not all(p > 0 for p in elimination((vectors * values) @ vectors.T))


@given(seed=seeds, n=st.integers(2, 6))
def test_a_matrix_that_is_not_positive_gives_nan_and_no_exception(seed, n):
    A = positive(seed, n)
    A[1, 1] = -A[1, 1]
    L, inverse = cholesky(A)
    assert np.isnan(L[1, 1])
    assert np.isnan(inverse[1])


@given(seed=seeds, n=sizes)
def test_mirror_takes_the_upper_triangle(seed, n):
    A = np.random.default_rng(seed).normal(size=(n, n))
    np.testing.assert_array_equal(mirror(A), np.triu(A) + np.triu(A, 1).T)


@given(seed=seeds)
def test_joseph_holds_for_any_gain(seed):
    rng = np.random.default_rng(seed)
    P, R = positive(seed, 4), positive(seed + 1, 2)
    K, H = rng.normal(size=(4, 2)), rng.normal(size=(2, 4))
    A = np.eye(4) - K @ H
    expected = np.linalg.multi_dot([A, P, A.T]) + np.linalg.multi_dot([K, R, K.T])
    np.testing.assert_allclose(joseph(P, K, H, R), expected, atol=1e-12 * np.max(expected))


@pytest.mark.parametrize("bad", [np.nan, np.inf, 0.0])
def test_pivots_of_what_is_no_covariance_are_not_all_positive(bad):
    A = np.diag([1.0, bad, 2.0])
    A[0, 1] = A[1, 0] = 0.5
    assert not all(0 < p < np.inf for p in elimination(A))
