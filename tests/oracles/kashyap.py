"""kashyap's two filters as the paper tells them, in plain NumPy, one run, written on their own.

The error model is the reading that its tables fit: error and rate in every channel, Q = 0.25 in the
channel's own units, the error of the same scan added, R from the last ten differences. Errata K1 to
K3, K6 and K10; mu at the point that the angles have updated, as printed.
"""

import numpy as np

from oracles.textbook import kalman_update, polar, polar_jacobian, white_acceleration

Q, WINDOW = 0.25, 10
P0 = np.diag([900.0] * 3 + [25.0] * 3)


def wrapped(angle):
    return np.arctan2(np.sin(angle), np.cos(angle))


def spread(z, sigma):
    """Variances of the Cartesian point of a plot, the diagonal of J R J'."""
    r, a, e = z
    ca, sa, ce, se = np.cos(a), np.sin(a), np.cos(e), np.sin(e)
    J = np.array(
        [
            [ca * ce, -r * sa * ce, -r * ca * se],
            [sa * ce, r * ca * ce, -r * sa * se],
            [se, 0, r * ce],
        ]
    )
    return np.diag(J @ np.diag(sigma**2) @ J.T)


def errors(difference, variance, dt):
    """One channel: error and R at every scan, from differences and nominal variances (n,)."""
    F, G = np.array([[1.0, dt], [0.0, 1.0]]), np.array([dt**2 / 2, dt])
    mean, P = np.zeros(2), np.diag([variance[0], 0.01 * variance[0]])
    found, R = [], []
    for k, (d, nominal) in enumerate(zip(difference, variance, strict=True)):
        if k:
            mean, P = F @ mean, F @ P @ F.T + Q * np.outer(G, G)
        H = np.array([[1.0, 0.0]])
        mean, P = kalman_update(mean, P, np.array([d - mean[0]]), H, np.array([[nominal]]))
        found.append(mean[0])
        last = difference[k - WINDOW + 1 : k + 1]
        R.append(np.var(last, ddof=1) if k >= WINDOW - 1 else nominal)
    return np.array(found), np.array(R)


def run(plots, R, start, dt, update):
    """Estimated positions, from plots and variances (scans, 3)."""
    F, noise = white_acceleration(3, dt, Q)
    mean, P, path = np.array(start), P0, []
    for k, (z, variances) in enumerate(zip(plots, R, strict=True)):
        if k:
            mean, P = F @ mean, F @ P @ F.T + noise
        mean, P = update(mean, P, z, variances)
        path.append(mean[:3])
    return np.array(path)


def linear(mean, P, z, variances):
    """(8)."""
    H = np.eye(3, 6)
    return kalman_update(mean, P, z - H @ mean, H, np.diag(variances))


def sequential(mean, P, z, variances):
    """(9) to (11): elevation, azimuth, range."""
    for i in (2, 1):
        h = polar_jacobian(mean)[[i]]
        nu = np.array([wrapped(z[i] - polar(mean)[i])])
        mean, P = kalman_update(mean, P, nu, h, variances[[i], None])
    (r, a, e), c2 = polar(mean), np.cos(polar(mean)[2]) ** 2
    mu = r / 2 * (c2 * (wrapped(z[1] - a) ** 2 - variances[1]) + (z[2] - e) ** 2 - variances[2])
    added = r**2 / 2 * (variances[1] ** 2 * c2**2 + variances[2] ** 2)
    h = polar_jacobian(mean)[[0]]
    return kalman_update(mean, P, np.array([z[0] - r - mu]), h, np.array([[variances[0] + added]]))


def ecmkf(truth, z, sigma, start, dt):
    """Positions (scans, 3) of ECMKF, from true positions and plots (scans, 3)."""
    r, a, e = z.T
    point = np.stack([r * np.cos(e) * np.cos(a), r * np.cos(e) * np.sin(a), r * np.sin(e)], axis=1)
    nominal = np.array([spread(one, sigma) for one in z])
    found = [errors(truth[:, i] - point[:, i], nominal[:, i], dt) for i in range(3)]
    error, R = (np.stack(each, axis=1) for each in zip(*found, strict=True))
    return run(point + error, R, start, dt, linear)


def emekf(truth, z, sigma, start, dt):
    """Positions (scans, 3) of EMEKF."""
    difference = np.array([polar(one) for one in truth]) - z
    difference[:, 1:] = wrapped(difference[:, 1:])
    found = [errors(difference[:, i], np.full(len(z), sigma[i] ** 2), dt) for i in range(3)]
    error, R = (np.stack(each, axis=1) for each in zip(*found, strict=True))
    return run(z + error, R, start, dt, sequential)
