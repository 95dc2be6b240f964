"""Batch linear least squares: converted plots of one target at rest, weighted by their covariances.

[barshalom2001] Y. Bar-Shalom, X. R. Li and T. Kirubarajan, "Estimation with Applications to
Tracking and Navigation", section 3.4.
Paper: bordonaro section 2.3 (LLSE).
Differs from it: a position with a missing (NaN) number is left out.
"""

from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.maths import Gaussian

Array = Any


def batch_least_squares(positions: Array, covariances: Array) -> Gaussian:
    """The position that fits best: sum(R⁻¹)⁻¹ sum(R⁻¹ z).

    Where R depends on the noise of z the result is biased, however many plots there are: that is
    what this estimator is for.

    Args:
        positions: (..., plots, d), m.
        covariances: (..., plots, d, d), m², or (d, d) for all.

    Returns:
        mean (..., d), cov (..., d, d); NaN where no plot is complete.

    Raises:
        UsageError: shapes that do not fit.
    """
    z, R = np.asarray(positions, dtype=float), np.asarray(covariances, dtype=float)
    if z.ndim < 2 or R.shape[-2:] != 2 * z.shape[-1:]:
        raise UsageError(
            f"positions {z.shape} do not fit covariances {R.shape}",
            next_step="give (..., plots, d) and (..., plots, d, d)",
        )
    gone = np.isnan(z).any(-1) | np.isnan(R).any((-2, -1))
    R = np.where(gone[..., None, None], np.eye(z.shape[-1]), R)
    information = np.linalg.inv(R) * ~gone[..., None, None]
    pulled = np.einsum("...pij,...pj->...i", information, np.nan_to_num(z))
    total = np.where(gone.all(-1)[..., None, None], np.nan, information.sum(-3))
    cov = np.linalg.inv(total)
    return Gaussian(np.linalg.solve(total, pulled[..., None])[..., 0], (cov + cov.mT) / 2)
