"""bordonaro's and kashyap's conversions as they are printed, for the tests that show them wrong.

Written from the papers' text; angles in radians, all arguments broadcast.
"""

import numpy as np


def bias_size(r, sa):
    """bordonaro, text under (5) (erratum B1)."""
    return r * (np.exp(sa**2 / 2) - 1)


def mean_square_error(eta, r, sr, sa):
    """bordonaro (22) (erratum B2)."""
    return eta**2 * (r + sr**2) - 2 * eta * r**2 * np.exp(-(sa**2) / 2) + r**2


def ducm(r_first, r_second, track, sr, sa, *, fade=None):
    """bordonaro (26) to (28): (..., 2, 2).

    As printed, `r_first` and `r_second` are the measured range and `fade` is sa (errata B3, B4).

    Args:
        r_first: range in the first parenthesis.
        r_second: range in the second.
        track: bearing, and standard deviations of range and of bearing.
        sr, sa: standard deviations of the plot.
        fade: angle whose square fades the second bracket; sa if left out.
    """
    bearing, sr_track, sa_track = track
    fade = sa if fade is None else fade
    first = (r_first**2 + sr**2 + sr_track**2) / 2 * np.exp(sa**2)
    second = (r_second**2 + sr_track**2) / 2
    faded = np.exp(-2 * sa**2 - 2 * sa_track**2), np.exp(-2 * fade**2)
    cos, sin = np.cos(2 * bearing), np.sin(2 * bearing)
    xx = first * (1 + cos * faded[0]) - second * (1 + cos * faded[1])
    yy = first * (1 - cos * faded[0]) - second * (1 - cos * faded[1])
    xy = first * sin * faded[0] - second * sin * faded[1]
    return np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -1)


def range_variance(position, P):
    """bordonaro (30) (erratum B5)."""
    x, y = position
    return (P[0, 0] * x**2 - 2 * P[0, 1] + P[1, 1] * y**2) / (x**2 + y**2)


def nullified(closing, bearing, speed, sa):
    """bordonaro (37) (erratum B6)."""
    return closing - speed * np.cos(bearing) * np.exp(-(sa**2) / 2)


def standard_variance(closing_sigma, bearing, speed):
    """bordonaro (38) (erratum B7)."""
    return closing_sigma**2 + speed**2 * np.sin(bearing) ** 2


def debiased_by_plot(r, azimuth, sr, sa, *, factor=1.0):
    """kashyap's appendix, R_xx of CMKF-D-M; the part of sr² with e^{-factor sa²} (erratum K5)."""
    v = sa**2
    cos2, sin2 = np.cos(azimuth) ** 2, np.sin(azimuth) ** 2
    of_range = cos2 * (np.cosh(2 * v) - np.cosh(v)) + sin2 * (np.sinh(2 * v) - np.sinh(v))
    of_noise = cos2 * (2 * np.cosh(2 * v) - np.cosh(v)) + sin2 * (2 * np.sinh(2 * v) - np.sinh(v))
    return r**2 * np.exp(-2 * v) * of_range + sr**2 * np.exp(-factor * v) * of_noise
