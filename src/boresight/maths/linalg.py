"""Small linear algebra that runs on floats and on symbols: no pivots, no branches.

A matrix that is not positive definite gives NaN factors in its own lane, never an exception;
whoever reads the lane turns that into a status.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

Array = Any


def mirror(A: Array) -> Array:
    """The symmetric matrix with A's upper triangle: declares symmetry, halves the work.

    Args:
        A: (n, n), symmetric but for rounding.
    """
    n = len(A)
    index = np.arange(n)
    return A[np.minimum.outer(index, index), np.maximum.outer(index, index)]


def cholesky(A: Array) -> tuple[Array, Array]:
    """Lower factor L with A = L L', and the reciprocals of its diagonal.

    Args:
        A: (n, n) symmetric positive definite; only the lower triangle is read.

    Returns:
        L (n, n), and 1 / diag(L) (n,). NaN where A is not positive definite.
    """
    n = len(A)
    zero = A[0, 0] * 0.0
    L = [[zero] * n for _ in range(n)]
    inverse = []
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(n):
            pivot = np.sqrt(A[j, j] - sum(L[j][k] * L[j][k] for k in range(j)))
            L[j][j] = pivot
            inverse.append(1.0 / pivot)
            for i in range(j + 1, n):
                rest = A[i, j] - sum(L[i][k] * L[j][k] for k in range(j))
                L[i][j] = rest * inverse[j]
    return np.array(L), np.array(inverse)


def elimination(A: Array) -> list[Any]:
    """Pivots of Gauss's elimination, all positive just where A is positive definite.

    Args:
        A: (n, n) symmetric; only the upper triangle is read. No square root is taken, so nothing
            here is NaN before the first pivot that is zero.
    """
    n = len(A)
    rows = [[A[i, j] for j in range(n)] for i in range(n)]
    with np.errstate(invalid="ignore", divide="ignore"):
        for k in range(n - 1):
            inverse = 1.0 / rows[k][k]
            for i in range(k + 1, n):
                factor = rows[k][i] * inverse
                for j in range(i, n):
                    rows[i][j] = rows[i][j] - factor * rows[k][j]
    return [rows[k][k] for k in range(n)]


def lower_solve(L: Array, inverse: Array, b: Array) -> Array:
    """Solve L x = b for b (n,) or (n, m), given 1 / diag(L)."""
    x: list[Any] = []
    for i in range(len(L)):
        x.append((b[i] - sum(L[i, k] * x[k] for k in range(i))) * inverse[i])
    return np.array(x)


def upper_solve(L: Array, inverse: Array, b: Array) -> Array:
    """Solve L' x = b for b (n,) or (n, m), given the lower factor and 1 / its diagonal."""
    n = len(L)
    x: dict[int, Any] = {}
    for i in reversed(range(n)):
        x[i] = (b[i] - sum(L[k, i] * x[k] for k in range(i + 1, n))) * inverse[i]
    return np.array([x[i] for i in range(n)])


def solve(A: Array, b: Array) -> Array:
    """Solve A x = b for symmetric positive definite A, b (n,) or (n, m)."""
    L, inverse = cholesky(A)
    return upper_solve(L, inverse, lower_solve(L, inverse, b))


def joseph(P: Array, K: Array, H: Array, R: Array) -> Array:
    """(I - K H) P (I - K H)' + K R K': positive for any gain, in Joseph's form.

    Args:
        P: (n, n) prior covariance.
        K: (n, k) gain.
        H: (k, n) measurement matrix.
        R: (k, k) measurement covariance.
    """
    A = np.eye(len(P)) - K @ H
    return mirror(A @ P @ A.T + K @ R @ K.T)


def over_lanes(formula: Callable[..., Any], *arrays: Array) -> Array:
    """Apply a one-target formula to every lane of NumPy arrays, one by one (slow, for tests)."""
    return np.stack([formula(*lane) for lane in zip(*arrays, strict=True)])
