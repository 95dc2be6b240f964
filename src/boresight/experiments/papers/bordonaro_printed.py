"""bordonaro's formulas as they are printed, for verdicts on what a misprint decides.

Paper: bordonaro (22), (26) to (30), (37), (38).
Differs from it: not at all, so errata B2 to B7 are all in here; nothing else uses it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from boresight.filters import kalman
from boresight.filters.posterior import Posterior
from boresight.filters.steps import Updating
from boresight.maths import Gaussian, missing, select
from boresight.models.components import Component

Array = Any


def square_error(eta: Any, r: Any, sr: Any, sa: Any) -> Any:
    """(22), erratum B2: the mean square error of the plot's point times eta."""
    return eta * eta * (r + sr * sr) - 2.0 * eta * r * r * np.exp(-sa * sa / 2.0) + r * r


def decorrelated(z: Array, sigma: Array, position: Array, cov: Array) -> Gaussian:
    """(24) to (30), errata B3 to B5.

    Args:
        z: (2,) range and bearing.
        sigma: (2,) standard deviations.
        position: (2,) predicted.
        cov: (2, 2) of it.
    """
    (rm, am), (sr, sa), (x, y) = z, sigma, position
    xx, xy, yy = cov[0, 0], cov[0, 1], cov[1, 1]
    square = x * x + y * y
    s_at2 = (xx * y * y - 2.0 * xy * y * x + yy * x * x) / (square * square)  # (29)
    s_rt2 = (xx * x * x - 2.0 * xy + yy * y * y) / square  # (30), B5
    cos2, sin2 = (x * x - y * y) / square, 2.0 * x * y / square
    kept, lost = np.exp(-2.0 * sa * sa), np.exp(-2.0 * s_at2)
    A = 0.5 * (rm * rm + sr * sr + s_rt2) * np.exp(sa * sa)  # B3
    B = 0.5 * (rm * rm + s_rt2)  # B3
    r11 = A * (1.0 + cos2 * kept * lost) - B * (1.0 + cos2 * kept)  # (26), B4
    r22 = A * (1.0 - cos2 * kept * lost) - B * (1.0 - cos2 * kept)  # (27), B4
    r12 = A * sin2 * kept * lost - B * sin2 * kept  # (28), B4
    reach = np.exp(sa * sa / 2.0) * rm
    point = np.array([reach * np.cos(am), reach * np.sin(am)])  # (24), (25)
    return Gaussian(point, np.array([[r11, r12], [r12, r22]]))


def printed_update(prior: Gaussian, z: Array, components: Sequence[Component]) -> Posterior:
    """The linear Kalman filter with (24) to (30) as printed, for a sensor at the origin.

    Args:
        prior: predicted mean (n,), cov (n, n); positions x, y first.
        z: (2,) range and bearing, NaN where missing.
        components: range and bearing.
    """
    H = np.eye(2, len(prior.mean))
    gone = missing(z[0]) | missing(z[1])
    safe = np.array([select(gone, 1.0, value) for value in z])
    sigma = [part.sigma for part in components]
    found = decorrelated(safe, sigma, prior.mean[:2], H @ prior.cov @ H.T)
    point = np.array([select(gone, np.nan, value) for value in found.mean])
    return kalman.update(prior, point, H, found.cov)


# It starts as DUCM does, by erratum B9.
PRINTED_DUCM = Updating(formula=printed_update, conversion="ducm")
