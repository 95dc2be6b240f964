"""Nearest-neighbour extended Kalman filter, as a plain loop over scans and plots."""

import numpy as np

from oracles.textbook import kalman_update, polar, polar_jacobian, residual


def nearest_neighbour(start, candidates, dt, F_and_Q, R, limit):
    """Means and covariances after each scan, and which plot was taken (-1: none).

    Args:
        start: mean and cov.
        candidates: (scans, m, 3) plots of range, azimuth, elevation, NaN where there is none.
        dt: (scans,) s before each scan.
        F_and_Q: of dt.
        R: (3, 3).
        limit: largest squared distance.
    """
    (mean, cov), told = start, []
    for plots, step in zip(candidates, dt, strict=True):
        F, Q = F_and_Q(step)
        mean, cov = F @ mean, F @ cov @ F.T + Q
        H = polar_jacobian(mean)
        S = H @ cov @ H.T + R
        distances = []
        for z in plots:
            measured = ~np.isnan(z)
            nu = residual(z, polar(mean))[measured]
            some = S[np.ix_(measured, measured)]
            distances.append(nu @ np.linalg.solve(some, nu) if measured.any() else np.inf)
        best = int(np.argmin(distances))
        taken = best if np.isfinite(distances[best]) and distances[best] <= limit else -1
        if taken >= 0:
            measured = ~np.isnan(plots[taken])
            nu = residual(plots[taken], polar(mean))[measured]
            noise = R[np.ix_(measured, measured)]
            mean, cov = kalman_update(mean, cov, nu, H[measured], noise)
        told.append((mean, cov, taken))
    return [np.array(column) for column in zip(*told, strict=True)]
