"""The textbook's linear filter for one target: explicit matrices and inverses, `numpy.linalg`.

Written from the book, shares nothing with the filters it judges: Y. Bar-Shalom, X. R. Li and
T. Kirubarajan, "Estimation with Applications to Tracking and Navigation" (2001), table 5.2.4-1.
"""

from typing import Any

import numpy as np

Array = Any


def discrete_velocity(dt: float, accel: float, dims: int) -> tuple[Array, Array]:
    """F and Q of constant velocity with one random acceleration a step; [positions, velocities]."""
    eye = np.eye(dims)
    F = np.block([[eye, dt * eye], [np.zeros((dims, dims)), eye]])
    G = np.vstack([0.5 * dt**2 * eye, dt * eye])
    return F, accel**2 * G @ G.T


def predict(mean: Array, cov: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """Mean and covariance one step later."""
    return F @ mean, F @ cov @ F.T + Q


def joint_update(
    mean: Array, cov: Array, z: Array, H: Array, R: Array
) -> tuple[Array, Array, float, float]:
    """All measured components at once; NaN ones are cut out of z, H and R.

    Returns:
        Mean, covariance, NIS and log-likelihood.
    """
    there = ~np.isnan(z)
    z, H, R = z[there], H[there], R[np.ix_(there, there)]
    S = H @ cov @ H.T + R
    nu = z - H @ mean
    W = cov @ H.T @ np.linalg.inv(S)
    nis = nu @ np.linalg.inv(S) @ nu
    loglik = -0.5 * (nis + np.log(np.linalg.det(2 * np.pi * S))) if there.any() else 0.0
    return mean + W @ nu, cov - W @ S @ W.T, nis, loglik
