"""Whether claimed covariances match actual errors, in decibels: noncredibility and inclination.

[li2006] X. R. Li and Z. Zhao, "Measuring Estimator's Credibility: Noncredibility Index".
Differs from it: the actual mean square error is taken from the same runs, whose number is then the
index's resolution. If errors are Gaussian and the claim is exact, each ratio of the two quadratic
forms is a chi-square variable with `runs` degrees of freedom over their number, whatever the number
of states (the run's own error, counted in the matrix, makes this exact): an index of about
4.9 / sqrt(runs) dB is chance.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.metrics import normalised

Array = Any


class Credibility(NamedTuple):
    """Ten times the decimal logarithm of the NEES over what it should be, averaged over runs.

    Attributes:
        index_db: average magnitude; 3 dB: errors are claimed wrong by a factor of 2 in variance.
        inclination_db: average; positive where covariances are too small, negative where too large.
    """

    index_db: Array
    inclination_db: Array


def mean_square_error(errors: Array) -> Array:
    """Average of e e' over runs: (..., n, n) from errors (runs, ..., n)."""
    return np.einsum("r...i,r...j->...ij", errors, errors) / len(errors)


def credibility(errors: Array, covs: Array, mse: Array | None = None) -> Credibility:
    """Noncredibility and inclination index.

    Args:
        errors: (runs, ..., n), estimate minus truth.
        covs: (runs, ..., n, n), what the filter claims.
        mse: (..., n, n), the actual mean square error; None: that of these errors.

    Returns:
        Both (...), averaged over runs; infinite where an error is not a number, or a matrix is
        no covariance.

    Raises:
        UsageError: too few runs for a matrix that has an inverse.
    """
    errors = np.asarray(errors, dtype=float)
    runs, n = len(errors), errors.shape[-1]
    if mse is None and runs <= n:
        raise UsageError(f"{runs} runs cannot tell the mean square error of {n} states")
    with np.errstate(invalid="ignore"):
        actual = mean_square_error(errors) if mse is None else np.asarray(mse, dtype=float)
    claimed = _squares(errors, covs)
    should = _squares(errors, np.broadcast_to(actual, (*errors.shape, n)))
    sound = np.isfinite(claimed) & np.isfinite(should)
    with np.errstate(divide="ignore", invalid="ignore"):
        level = 10.0 * np.log10(claimed / should)
    level = np.where(claimed == should, 0.0, level)  # both are 0 where there is no error
    level = np.where(sound, level, np.inf)
    return Credibility(np.mean(np.abs(level), axis=0), np.mean(level, axis=0))


def _squares(errors: Array, covs: Array) -> Array:
    """Quadratic forms e' P^-1 e (runs, ...); infinite where that is no number."""
    runs, *between, n = errors.shape
    flat = errors.reshape(runs, -1, n), np.reshape(covs, (runs, -1, n, n))
    return normalised(*flat).reshape(runs, *between)
