"""Textbook filters for one target, written from the books and not from the code they judge.

Explicit inverses, explicit matrices, `numpy.linalg`, no symbols: slow, plain, and independent.
Kalman's update: Bar-Shalom, Li & Kirubarajan (2001), table 5.2.4-1. EKF: the same, table 10.3.3-1.
"""

import numpy as np

from boresight.testing import textbook

discrete_velocity, predict = textbook.discrete_velocity, textbook.predict
joint_update = textbook.joint_update


def polar(position):
    """Range, azimuth from x towards y, and (in space) elevation."""
    ground = np.hypot(position[0], position[1])
    azimuth = np.arctan2(position[1], position[0])
    if len(position) == 2:
        return np.array([ground, azimuth])
    return np.array([np.hypot(ground, position[2]), azimuth, np.arctan2(position[2], ground)])


def polar_matrix(position, n):
    """Derivatives of `polar` by a state of n numbers whose first are the position."""
    x, y = position[:2]
    ground2 = x * x + y * y
    H = np.zeros((len(position), n))
    if len(position) == 2:
        H[0, :2] = [x, y] / np.sqrt(ground2)
        H[1, :2] = [-y / ground2, x / ground2]
        return H
    z, ground = position[2], np.sqrt(ground2)
    r = np.sqrt(ground2 + z * z)
    H[0, :3] = [x / r, y / r, z / r]
    H[1, :3] = [-y / ground2, x / ground2, 0]
    H[2, :3] = [-x * z / (r * r * ground), -y * z / (r * r * ground), ground / (r * r)]
    return H


def polar_innovation(z, predicted):
    """Measured minus predicted; angles brought into half a turn either way by arctan2."""
    nu = z - predicted
    nu[1:] = np.arctan2(np.sin(nu[1:]), np.cos(nu[1:]))
    return nu


def ekf(mean, cov, z, R, dims):
    """Extended Kalman update with range and angles, all at once."""
    H = polar_matrix(mean[:dims], len(mean))
    nu = polar_innovation(z, polar(mean[:dims]))
    return joint_update(mean, cov, nu + H @ mean, H, R)


def iekf(mean, cov, z, R, dims, iterations):
    """Iterated EKF as Gauss-Newton on the posterior density, by the information form.

    Each round minimises |x - mean|² in cov plus |z - h(x)|² in R, linearised at the last x.
    """
    x, prior = mean, np.linalg.inv(cov)
    for _ in range(iterations):
        H = polar_matrix(x[:dims], len(x))
        information = prior + H.T @ np.linalg.inv(R) @ H
        slope = prior @ (mean - x) + H.T @ np.linalg.inv(R) @ polar_innovation(z, polar(x[:dims]))
        x = x + np.linalg.solve(information, slope)
    return x, np.linalg.inv(information)


def mekf_block(mean, cov, z, R, dims):
    """Modified EKF: range corrected for curvature (errata K2, K3, A4), all at once.

    mu = r/2 [cos²e (da² - sa²) + (de² - se²)]; R11 += r²/2 (sa⁴ cos⁴e + se⁴).
    """
    at = polar(mean[:dims])
    H, nu, R = polar_matrix(mean[:dims], len(mean)), polar_innovation(z, at), R.copy()
    factors = [np.cos(at[2]) ** 2, 1.0] if dims == 3 else [1.0]
    spread = [R[i + 1, i + 1] for i in range(dims - 1)]
    mu = at[0] / 2 * sum(f * (d * d - s) for f, d, s in zip(factors, nu[1:], spread, strict=True))
    R[0, 0] += at[0] ** 2 / 2 * sum(f * f * s * s for f, s in zip(factors, spread, strict=True))
    nu[0] -= mu
    return joint_update(mean, cov, nu + H @ mean, H, R)


def sequential(mean, cov, z, R, dims, order, reading="none", *, added_variance=True):
    """One measured number after the other, each linearised where the last one left the state.

    `order` holds row numbers of (range, azimuth, elevation). `reading` is how the range is
    corrected for curvature: none, printed, predicted or second order (erratum K4).
    """
    first, nis, loglik = mean, 0.0, 0.0
    for row in order:
        at = first if row == 0 and reading == "predicted" else mean
        p = polar(at[:dims])
        h = polar_matrix(at[:dims], len(at))[[row]]
        nu, r = polar_innovation(z, p)[row], R[row, row]
        if row == 0 and reading != "none":
            mu, extra = curvature(at, cov, z, R, dims, reading)
            nu = nu - mu - (h @ (mean - first))[0] * (reading == "predicted")
            r = r + extra * added_variance
        measured = np.array([nu]) + h @ mean
        mean, cov, one, log = joint_update(mean, cov, measured, h, np.array([[r]]))
        nis, loglik = nis + one, loglik + log
    return mean, cov, nis, loglik


def curvature(at, cov, z, R, dims, reading):
    """Mean and variance of the range that its linearisation at `at` leaves out (K3, K4)."""
    p = polar(at[:dims])
    cos2 = np.cos(p[2]) ** 2 if dims == 3 else 1.0
    sa2, se2 = R[1, 1], R[2, 2] if dims == 3 else 0.0
    nu = polar_innovation(z, p)
    da2, de2 = nu[1] ** 2, nu[2] ** 2 if dims == 3 else 0.0
    if reading == "second order":
        H = polar_matrix(at[:dims], len(at))
        P = H @ cov @ H.T
        Paa, Pee, Pae = P[1, 1], P[2, 2] if dims == 3 else 0.0, P[1, 2] if dims == 3 else 0.0
        mu = p[0] / 2 * (cos2 * Paa + Pee)
        return mu, p[0] ** 2 / 2 * (cos2**2 * Paa**2 + Pee**2 + 2 * cos2 * Pae**2)
    mu = p[0] / 2 * (cos2 * (da2 - sa2) + de2 - se2)
    return mu, p[0] ** 2 / 2 * (cos2**2 * sa2**2 + se2**2)
