"""Textbook forms of what the package does otherwise: plain NumPy, one target, written on its own.

Gradients are numeric, information is inverted, and the iterated filter minimises its cost function.
"""

import numpy as np


def polar(x):
    """Range, azimuth, elevation of a state."""
    ground = np.hypot(x[0], x[1])
    return np.array([np.hypot(ground, x[2]), np.arctan2(x[1], x[0]), np.arctan2(x[2], ground)])


def residual(z, predicted):
    """Measured minus predicted, angles within half a turn."""
    d = z - predicted
    d[1:] = np.arctan2(np.sin(d[1:]), np.cos(d[1:]))
    return d


def polar_jacobian(x, step=1e-4):
    """Central differences of `polar`, (3, n)."""
    columns = []
    for i in range(len(x)):
        e = np.zeros(len(x))
        e[i] = step
        columns.append(residual(polar(x + e), polar(x - e)) / (2 * step))
    return np.stack(columns, axis=1)


def white_acceleration(dims, dt, accel_variance):
    """F and Q of a target pushed by one random acceleration a step."""
    F = np.eye(2 * dims)
    F[:dims, dims:] = dt * np.eye(dims)
    G = np.vstack([dt**2 / 2 * np.eye(dims), dt * np.eye(dims)])
    return F, accel_variance * G @ G.T


def kalman_update(mean, cov, nu, H, R):
    """The joint update, P - K S K'."""
    S = H @ cov @ H.T + R
    K = cov @ H.T @ np.linalg.inv(S)
    return mean + K @ nu, cov - K @ S @ K.T


def extended_update(mean, cov, z, R):
    """Block extended Kalman update by range, azimuth, elevation."""
    return kalman_update(mean, cov, residual(z, polar(mean)), polar_jacobian(mean), R)


def cost(x, mean, cov, z, R):
    """Minus the logarithm of the posterior density, up to a constant."""
    e, nu = x - mean, residual(z, polar(x))
    return 0.5 * (e @ np.linalg.solve(cov, e) + nu @ np.linalg.solve(R, nu))


def gauss_newton(mean, cov, z, R, iterations, *, damped=False):
    """Minimise `cost` by Gauss-Newton; `damped` halves each step until the cost falls."""
    x, H = np.array(mean), polar_jacobian(mean)
    for _ in range(iterations):
        H = polar_jacobian(x)
        information = np.linalg.inv(cov) + H.T @ np.linalg.solve(R, H)
        slope = np.linalg.solve(cov, x - mean) - H.T @ np.linalg.solve(R, residual(z, polar(x)))
        step, share = -np.linalg.solve(information, slope), 1.0
        here = cost(x, mean, cov, z, R)
        while damped and share > 1e-6 and cost(x + share * step, mean, cov, z, R) > here:
            share /= 2
        x = x + share * step
    H = polar_jacobian(x) if damped else H
    return x, np.linalg.inv(np.linalg.inv(cov) + H.T @ np.linalg.solve(R, H))


def information_bound(states, prior_cov, F, Q, R, jacobian=polar_jacobian):
    """Cramer-Rao bound along one trajectory, in information form; Q must have an inverse.

    Tichavsky, Muravchik and Nehorai (1998), (21) with the expectation taken at the trajectory:
    J' = D22 - D21 (J + D11)^-1 D12. The first scan is at the start.
    """
    J, bounds = np.linalg.inv(prior_cov), []
    W = np.linalg.inv(Q)
    for k, x in enumerate(states):
        if k:
            J = W - W @ F @ np.linalg.inv(J + F.T @ W @ F) @ F.T @ W
        H = jacobian(x)
        J = J + H.T @ np.linalg.solve(R, H)
        bounds.append(np.linalg.inv(J))
    return np.stack(bounds)
