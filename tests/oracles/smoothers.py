"""Smoothing without recursion, and the textbook's recursions: plain NumPy, one target.

Särkkä, "Bayesian Filtering and Smoothing" (2013), algorithms 8.1 (RTS), 9.1 and 10.2 (by cubature).
"""

import numpy as np


def trajectory(mean, cov, Fs, Qs):
    """Mean (steps n,) and covariance of all states together; Fs, Qs lead up to each step."""
    n, steps = len(mean), len(Fs)
    means, full = [], np.zeros((steps * n, steps * n))
    for i, (F, Q) in enumerate(zip(Fs, Qs, strict=True)):
        mean, cov = F @ mean, F @ cov @ F.T + Q
        means.append(mean)
        column, rows = cov, slice(i * n, (i + 1) * n)
        full[rows, rows] = cov
        for j in range(i + 1, steps):
            column = Fs[j] @ column
            full[j * n : (j + 1) * n, rows] = column
            full[rows, j * n : (j + 1) * n] = column.T
    return np.concatenate(means), full


def joint_posterior(mean, cov, Fs, Qs, plots, H, R):
    """Every step given every plot (steps, k), conditioned on once: means (steps, n), covs."""
    n, steps = len(mean), len(Fs)
    mean, full = trajectory(mean, cov, Fs, Qs)
    there = ~np.isnan(plots.ravel())
    A = np.kron(np.eye(steps), H)[there]
    S = A @ full @ A.T + np.kron(np.eye(steps), R)[np.ix_(there, there)]
    K = np.linalg.solve(S, A @ full).T
    mean = mean + K @ (plots.ravel()[there] - A @ mean)
    full = full - K @ S @ K.T
    blocks = full.reshape(steps, n, steps, n)
    return mean.reshape(steps, n), np.stack([blocks[i, :, i] for i in range(steps)])


def tangent(mean, cov, move):
    """Predicted mean, its covariance without noise, and its covariance with the state before."""
    sides = np.diag(1e-3 * np.sqrt(np.diag(cov)))
    F = np.stack([(move(mean + e) - move(mean - e)) / (2 * e.sum()) for e in sides], axis=1)
    return move(mean), F @ cov @ F.T, cov @ F.T


def cubature(mean, cov, move):
    """The same by 2n points of equal weight, as sums of outer products."""
    n = len(mean)
    sides = np.sqrt(n) * np.linalg.cholesky(cov).T
    points = [mean + e for e in sides] + [mean - e for e in sides]
    moved = [move(p) for p in points]
    centre = np.mean(moved, axis=0)
    spread = np.mean([np.outer(y - centre, y - centre) for y in moved], axis=0)
    both = zip(points, moved, strict=True)
    cross = np.mean([np.outer(p - mean, y - centre) for p, y in both], axis=0)
    return centre, spread, cross


def smooth(means, covs, dts, motion, moments):
    """The backward recursion as printed; dts lead up to each step."""
    means, covs = means.copy(), covs.copy()
    for k in reversed(range(len(means) - 1)):
        dt = dts[k + 1]
        moved, spread, cross = moments(means[k], covs[k], lambda x, dt=dt: motion.move(x, dt))
        predicted = spread + motion.noise(dt)
        G = np.linalg.solve(predicted, cross.T).T
        means[k] = means[k] + G @ (means[k + 1] - moved)
        covs[k] = covs[k] + G @ (covs[k + 1] - predicted) @ G.T
    return means, covs
