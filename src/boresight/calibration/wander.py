"""Errors of one target that are alike from scan to scan, and what its plots are worth then.

A height that is read in steps, a tracker that smooths, a reference that lags: their errors wander
slowly while the target flies. In each channel they are taken as an Ornstein-Uhlenbeck process along
the target, at the true times of its plots, beside the noise of single plots. The inverse covariance
of the process is tridiagonal, so that of both together costs a few operations for each pair.

It serves to tell what an outlier is (one about where the process has wandered), and to lower a
target's weights until they tell of a level what they can. The terms are not found by the whole
inverse covariance: that would be a fourth better if the law were exactly this one, but it lives on
quick changes, whose noise looks smallest where a model fits worst. On a recording of an airport's
surface it moved the range bias by three of its standard deviations.

    [rue2005] Håvard Rue and Leonhard Held, "Gaussian Markov Random Fields: Theory and Applications"
    [patterson1971] H. D. Patterson and R. Thompson, "Recovery of inter-block information when
        block sizes are unequal"
"""

from itertools import product
from typing import Any, NamedTuple

import numpy as np

Array = Any

_SHORTEST = 1e-4  # of the time constant: plots nearer than this are one for the process
_TELLING = 12.0  # twice the gain in log likelihood: noise alone reaches it once in 400
_RATIOS = (0.1, 1.0, 10.0)  # of the variance that wanders over the noise's: where a search starts
_SCANS = (3.0, 20.0, 100.0)  # and of the time constant over the usual time between plots
MOST, _LONGEST = 50.0, 300.0  # of both: beyond, data hardly tell, and noise must not vanish
_CLOSE = 1e-3  # of both in logarithm: what matters of them is known far worse


class Wander(NamedTuple):
    """How errors wander along a target.

    Attributes:
        variance: (k,) m² or rad²; 0 where they do not.
        time_s: (k,) after which their correlation has fallen to 1/e.
    """

    variance: Array
    time_s: Array


class Factored(NamedTuple):
    """Precision of the process given the plots, tridiagonal.

    Attributes:
        precise: (m,) its diagonal.
        diagonal, lower: (m,) and (m - 1,) of its factors L D L'.
        log_prior: log determinant of the process's own covariance.
    """

    precise: Array
    diagonal: Array
    lower: Array
    log_prior: float


class Inverse(NamedTuple):
    """Inverse covariance of one channel's errors, delays aside.

    Attributes:
        weight: (m,) inverse variances of single plots' noise.
        slow: what wanders; None if nothing does.
    """

    weight: Array
    slow: Factored | None = None

    def __call__(self, values: Array) -> Array:
        """Inverse covariance times values (m,)."""
        weighted = self.weight * values
        return weighted - self.weight * self.smooth(weighted)

    def smooth(self, pull: Array) -> Array:
        """(m,) expectation of the process from weighted residuals (m,)."""
        from scipy.linalg.lapack import dpttrs

        if self.slow is None:
            return np.zeros_like(pull)
        return dpttrs(self.slow.diagonal, self.slow.lower, pull)[0]

    def uncertain(self) -> Array:
        """(m,) variance of the process given the plots: factors from both ends [rue2005]."""
        from scipy.linalg.lapack import dpttrf

        if self.slow is None:
            return np.zeros_like(self.weight)
        precise, diagonal, lower, _ = self.slow
        back = dpttrf(precise[::-1], (lower * diagonal[:-1])[::-1])[0][::-1]
        return 1.0 / (diagonal + back - precise)


def inverse(weight: Array, gap_s: Array, variance: float, time_s: float) -> Inverse:
    """Inverse covariance of noise and process together.

    Args:
        weight: (m,) inverse variances of the noise; 0 where nothing was measured.
        gap_s: (m,) since the target's plot before, infinite at its first.
        variance: of the process; 0 for none.
        time_s: of the process.
    """
    from scipy.linalg.lapack import dpttrf

    if not variance:
        return Inverse(weight)
    alike = np.exp(-np.maximum(gap_s / time_s, _SHORTEST))
    fresh = 1.0 / (variance * (1.0 - alike**2))
    precise = weight + fresh + np.append(alike[1:] ** 2 * fresh[1:], 0.0)
    diagonal, lower, _ = dpttrf(precise, -alike[1:] * fresh[1:])
    return Inverse(weight, Factored(precise, diagonal, lower, -float(np.log(fresh).sum())))


class Residuals(NamedTuple):
    """Of one channel, sorted by target and time: what a law of wandering is found from.

    Attributes:
        left: (m,) what is left.
        weight: (m,) inverse variances of the noise but for a factor; 0 for what does not count.
        gap_s: (m,) since the target's plot before, infinite at its first.
        levels: whether each target has a level of its own, which then tells nothing.
    """

    left: Array
    weight: Array
    gap_s: Array
    levels: bool

    def loss(self, variance: float, time_s: float) -> tuple[float, float]:
        """Minus twice the restricted log likelihood, and the factor of all variances, profiled."""
        own = inverse(self.weight, self.gap_s, variance, time_s)
        seen = self.weight > 0.0
        count, square = float(seen.sum()), float(self.left @ own(self.left))
        logs = -np.log(self.weight[seen]).sum()
        if own.slow is not None:
            logs += np.log(own.slow.diagonal).sum() + own.slow.log_prior
        if self.levels:
            starts = np.flatnonzero(np.isinf(self.gap_s))
            power = np.add.reduceat(own(np.ones_like(self.left)), starts)
            pull = np.add.reduceat(own(self.left), starts)[power > 0.0]
            power = power[power > 0.0]
            square -= float((pull**2 / power).sum())
            logs += np.log(power).sum()
            count -= len(power)
        factor = max(square / max(count, 1.0), np.finfo(float).tiny)
        return float(count * np.log(factor) + logs), factor


def wandering(residuals: Residuals) -> tuple[float, float]:
    """Variance and time constant by restricted maximum likelihood [patterson1971].

    Returns:
        Variance and time constant; (0, 0) if the likelihood hardly gains by them.
    """
    from scipy.optimize import minimize

    gaps = residuals.gap_s[np.isfinite(residuals.gap_s)]
    usual = float(np.median(gaps)) if gaps.size else 0.0
    counting = residuals.weight[residuals.weight > 0.0]
    if usual <= 0.0 or not counting.size:
        return 0.0, 0.0
    units = np.array([1.0 / np.median(counting), usual])

    def loss(numbers: Array) -> float:
        return residuals.loss(*(units * np.exp(numbers)))[0]

    none = residuals.loss(0.0, 1.0)[0]
    start = min((np.log(at) for at in product(_RATIOS, _SCANS)), key=loss)
    if loss(start) >= none:
        return 0.0, 0.0
    best = minimize(
        loss,
        start,
        method="Nelder-Mead",
        bounds=[(None, np.log(MOST)), (0.0, np.log(_LONGEST))],
        options={"xatol": _CLOSE, "fatol": _CLOSE},
    )
    if none - best.fun < _TELLING:
        return 0.0, 0.0
    variance, time_s = units * np.exp(best.x)
    return float(variance * residuals.loss(variance, time_s)[1]), float(time_s)
