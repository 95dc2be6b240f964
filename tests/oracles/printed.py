"""kashyap's and aditya's formulas as they are printed, for the tests that show them to be wrong.

Written from the papers' text, in NumPy over runs (leading axis); nothing of the package is used.
"""

import numpy as np


def elevation_row(position):
    """kashyap (9), H_{k,1}: position part of the elevation's gradient (erratum K1)."""
    x, y, z = position
    r, azimuth = np.linalg.norm(position), np.arctan2(y, x)
    elevation = np.arctan2(z, np.hypot(x, y))
    return np.array(
        [
            -np.cos(azimuth) * np.sin(elevation) / r,
            -np.sin(azimuth) * np.sin(elevation) / r,
            np.cos(azimuth) / r,
        ]
    )


def range_correction(r, azimuth_difference, elevation_difference, sa, se):
    """kashyap (11), mu (errata K3, K10)."""
    return r * (azimuth_difference**2 + elevation_difference**2 - sa**2 - se**2) / 2


def range_variance(r, sr, sa, se):
    """kashyap (11) and aditya (16), variance of the range (erratum K3)."""
    return sr**2 + r**2 * (sa**4 + se**4) / 2


def kashyap_sequence(
    mean, cov, z, sigmas, *, wrapped=True, printed_residual=False, printed_weights=True
):
    """kashyap (9) to (11), one scan: elevation, azimuth, range.

    Everything is as printed but for K1, whose slip would hide the others, and for what a switch
    corrects: `wrapped` K10, `printed_residual` K2, `printed_weights` K3.

    Args:
        mean, cov: (runs, n), (runs, n, n), predicted.
        z: (runs, 3): range, azimuth, elevation.
        sigmas: of these.

    Returns:
        mean, cov, and the range residual.
    """
    sr, sa, se = sigmas

    def angles(x):
        ground = np.hypot(x[:, 0], x[:, 1])
        r = np.hypot(ground, x[:, 2])
        return r, ground, np.arctan2(x[:, 1], x[:, 0]), np.arctan2(x[:, 2], ground)

    def difference(a, b):
        d = a - b
        return d - 2 * np.pi * np.round(d / (2 * np.pi)) if wrapped else d

    def rows(x):
        r, ground, az, el = angles(x)
        zero = np.zeros_like(r)
        along = [np.cos(az) * np.cos(el), np.sin(az) * np.cos(el), np.sin(el)]
        around = [-np.sin(az) / ground, np.cos(az) / ground, zero]
        up = [-np.cos(az) * np.sin(el) / r, -np.sin(az) * np.sin(el) / r, np.cos(el) / r]
        return [_padded(row, x) for row in (along, around, up)]

    mean, cov = _scalar_update(
        mean, cov, rows(mean)[2], difference(z[:, 2], angles(mean)[3]), se**2
    )
    mean, cov = _scalar_update(
        mean, cov, rows(mean)[1], difference(z[:, 1], angles(mean)[2]), sa**2
    )
    r, _, az, el = angles(mean)
    weight = 1.0 if printed_weights else np.cos(el) ** 2
    mu = range_correction(
        r,
        np.sqrt(weight) * difference(z[:, 1], az),
        difference(z[:, 2], el),
        np.sqrt(weight) * sa,
        se,
    )
    residual = z[:, 0] - r * mu if printed_residual else z[:, 0] - r - mu
    variance = range_variance(r, sr, np.sqrt(weight) * sa, se)
    mean, cov = _scalar_update(mean, cov, rows(mean)[0], residual, variance)
    return mean, cov, residual


def _padded(row, x):
    padded = np.zeros_like(x)
    padded[:, :3] = np.stack(row, axis=-1)
    return padded


def _scalar_update(mean, cov, h, residual, variance):
    cross = np.einsum("rij,rj->ri", cov, h)
    s = np.einsum("ri,ri->r", h, cross) + variance
    gain = cross / s[:, None]
    return mean + gain * residual[:, None], cov - gain[:, :, None] * cross[:, None, :]


def kashyap_filter(mean, cov, z, sigmas, dt, accel_variance, **switches):
    """`kashyap_sequence` over all scans, z (runs, scans, 3); the first scan is at the start."""
    n = mean.shape[1]
    d = n // 2
    F, Q = np.eye(n), np.zeros((n, n))
    F[:d, d:] = dt * np.eye(d)
    G = np.vstack([dt**2 / 2 * np.eye(d), dt * np.eye(d)])
    Q = accel_variance * G @ G.T
    means = []
    for k in range(z.shape[1]):
        if k:
            mean, cov = mean @ F.T, F @ cov @ F.T + Q
        mean, cov, _ = kashyap_sequence(mean, cov, z[:, k], sigmas, **switches)
        means.append(mean)
    return np.stack(means, axis=1)


def aditya_map(state):
    """aditya (10) to (15): the right-hand sides, all of them as printed (errata A2, A3)."""
    x, y, z = state[:3]
    r, ground = np.sqrt(x**2 + y**2 + z**2), np.sqrt(x**2 + y**2)
    return np.array(
        [
            x / r - y - x * z / ground,
            y / r + x - y * z / ground,
            z / r + ground,
            -2 * y / r - 2 * x * z / (r * ground) - 2 * x + 2 * y * z / ground,
            2 * x / r - 2 * y * z / (r * ground) - 2 * y + 2 * x * z / ground,
            2 * ground / r - z,
        ]
    )


def aditya_y_rate(position, range_rate, azimuth_rate, elevation_rate):
    """aditya (8), as printed (erratum A1)."""
    x, y, z = position
    r, az, el = np.linalg.norm(position), np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    return (
        np.sin(az) * np.cos(az) * range_rate
        + r * np.cos(az) * np.cos(el) * azimuth_rate
        - r * np.sin(az) * np.sin(el) * elevation_rate
    )


def aditya_mu(r, azimuth, elevation, sa, se):
    """aditya (17); the angles are the measured ones as printed, innovations if so read (A4)."""
    return r * (azimuth**2 + elevation**2 - sa**2 - se**2)


def aditya_predict(A, P, Q):
    """aditya, Table 1, error covariance of the prediction (erratum A5)."""
    return A @ P + P @ A.T + Q
