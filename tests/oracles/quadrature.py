"""Expectations over normal noise by Gauss-Hermite quadrature, from the definitions alone.

No closed form of a moment is used. Points are (d, n): range, azimuth and, in space, elevation; sums
run in long double, so that what cancels here does not hide what cancels in the code under test.

Conditioned on the truth x: the noise of the plot is averaged. On the plot: the truth is the plot
minus its noise, wherever the target may have been before. On a prediction: the noise is averaged
for every truth, then the truths.
"""

from math import lgamma, log

import numpy as np

SMALL = -60.0  # log of 1e-26, small beside the square of 1e-6 that is the least variance


def enough(sigma):
    """Nodes with which n-point quadrature of cos 2a and sin 2a is exact enough.

    The rule errs by f^(2n) n! / (2n)!; the (2n)-th derivative of cos(2 sigma x) is (2 sigma)^(2n).
    """
    n = 3
    while sigma and 2 * n * log(2 * sigma) + lgamma(n + 1) - lgamma(2 * n + 1) > SMALL:
        n += 1
    return n


def normal(mean, sigma, counts=None):
    """Points (d, n), weights (n,) of independent normals; of the range no more than squares."""
    counts = counts or [2, *[enough(s) for s in sigma[1:]]]
    axes, weights = [], np.ones(1, dtype=np.longdouble)
    for m, s, n in zip(mean, sigma, counts, strict=True):
        x, w = np.polynomial.hermite_e.hermegauss(n if s else 1)
        axes.append(np.longdouble(m) + np.longdouble(s) * x)
        w = w.astype(np.longdouble)
        weights = np.multiply.outer(weights, w / w.sum()).ravel()
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")]), weights


def cartesian(polar):
    """(d, ...) Cartesian of (d, ...) polar."""
    r, azimuth, *rest = polar
    cos, sin = (np.cos(rest[0]), np.sin(rest[0])) if rest else (1.0, 0.0)
    return np.stack([r * np.cos(azimuth) * cos, r * np.sin(azimuth) * cos, r * sin])[: len(polar)]


def second(errors, weights):
    """Weighted mean of e e' for errors (d, n)."""
    return np.einsum("in,jn,n->ij", errors, errors, weights)


def shortening(sigma):
    """Diagonal (d,) of D in E[u | x] = D x, by averaging the cosines of the angles' noise."""
    kept = [w @ np.cos(x[1]) for x, w in (normal([0, 0], [0, s]) for s in sigma[1:])]
    k = np.prod(kept)
    return np.array([k, k, kept[-1]])[: len(sigma)]


class Predicted:
    """Plots of truths that are spread about a place: truths (d, m, 1), noisy plots (d, m, n)."""

    def __init__(self, mean, spread, sigma):
        truths, self.outer = normal(mean, spread)
        noise, self.inner = normal(np.zeros(len(mean)), sigma)
        self.truth = cartesian(truths[:, :, None])
        self.plain = cartesian(truths[:, :, None] + noise[:, None, :])
        self.sigma = sigma

    def average(self, errors):
        """Mean of e e' over noise and truths, errors (d, m, n)."""
        weights = np.multiply.outer(self.outer, self.inner).ravel()
        return second(errors.reshape(len(errors), -1), weights)

    def unbiased(self):
        """Covariance of the point that is right on average: bordonaro (8) to (10), averaged."""
        return self.average(self.plain / shortening(self.sigma)[:, None, None] - self.truth)

    def debiased(self):
        """Mean of u - x, and covariance of u about its own mean, each averaged over the truths."""
        means = (self.plain @ self.inner)[:, :, None]
        return (means - self.truth)[:, :, 0] @ self.outer, self.average(self.plain - means)

    def least_square(self):
        """The factor eta of u with the least E |eta u - x|², and E (eta u - x)(eta u - x)'."""
        inner = [np.trace(self.mixed(self.plain, each)) for each in (self.truth, self.plain)]
        eta = inner[0] / inner[1]
        return eta, self.average(eta * self.plain - self.truth)

    def mixed(self, a, b):
        """Mean of a b'."""
        a, b = np.broadcast_arrays(a, b)
        return np.einsum("imn,jmn,m,n->ij", a, b, self.outer, self.inner)


class Measured:
    """Truths (d, n) that a plot leaves possible."""

    def __init__(self, z, sigma):
        noise, self.weights = normal(np.zeros(len(z)), sigma)
        self.truth = cartesian(np.asarray(z, dtype=np.longdouble)[:, None] - noise)
        self.plain = cartesian(np.asarray(z, dtype=np.longdouble)[:, None])
        self.sigma = sigma

    def posterior(self):
        """Mean and covariance of the truth."""
        mean = self.truth @ self.weights
        return mean, second(self.truth - mean[:, None], self.weights)

    def unbiased(self):
        """Unbiased point, and mean of (point - x)(point - x)': bordonaro (11) to (13)."""
        point = self.plain / shortening(self.sigma)[:, None]
        return point[:, 0], second(point - self.truth, self.weights)


def linear(z, sigma):
    """J R J' with the Jacobian of the textbook: kashyap (3)."""
    r, azimuth, elevation = np.array([*z, 0.0][:3], dtype=np.longdouble)
    (ca, sa), (ce, se) = ((np.cos(x), np.sin(x)) for x in (azimuth, elevation))
    J = np.array(
        [
            [ca * ce, -r * sa * ce, -r * ca * se],
            [sa * ce, r * ca * ce, -r * sa * se],
            [se, 0.0, r * ce],
        ]
    )[: len(z), : len(z)]
    return J @ np.diag(np.asarray(sigma, dtype=np.longdouble) ** 2) @ J.T
