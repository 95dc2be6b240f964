"""Nearest neighbour: of several plots the one that a target is most likely to have made.

[barshalom1988] Y. Bar-Shalom and T. E. Fortmann, "Tracking and Data Association", section 6.
The simplest of associations and the one to beat: what it takes is treated as certain, so among many
false plots a filter that uses it believes too much, and its NEES says so.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters.posterior import innovation
from boresight.maths import Gaussian, cholesky, gradient, lower_solve, mirror, select
from boresight.models.components import Component
from boresight.models.sensors import Sensor

Array = Any
_CHIRP = ("range_m", "range_rate_mps")


@dataclass(frozen=True, kw_only=True)
class Nearest:
    """Takes the plot with the smallest squared Mahalanobis distance, if that is within a limit.

    Attributes:
        limit: largest squared distance that is taken; infinite: the nearest, however far.
        candidates: number of plots of a scan, m.
        correlation: of the noises of range and range rate; None where they are independent.
    """

    limit: float
    candidates: int
    correlation: Any = None

    def admit(
        self, prior: Gaussian, z: Array, components: Sequence[Component]
    ) -> tuple[Array, Any]:
        """The nearest plot inside the gate and 1, or a missing one and 0.

        Args:
            prior: predicted mean (n,), cov (n, n).
            z: plots (m, k), NaN where there is none. A plot that lacks a component is judged by
                the others.
            components: what the plots measure.
        """
        predicted, H = zip(*(gradient(c.value, prior.mean) for c in components), strict=True)
        S = np.array(H) @ prior.cov @ np.array(H).T + self._noise(components)
        best, chosen, taken = self.limit, np.full(len(components), np.nan), 0.0
        for plot in z:
            pairs = [innovation(*each) for each in zip(components, plot, predicted, strict=True)]
            there, nu = (np.array(column) for column in zip(*pairs, strict=True))
            distance = _distance(S, nu, there)
            nearer = (distance <= best) & (sum(there) > 0.5)
            best, taken = select(nearer, distance, best), select(nearer, 1.0, taken)
            chosen = np.array([select(nearer, a, b) for a, b in zip(plot, chosen, strict=True)])
        return chosen, taken

    def _noise(self, components: Sequence[Component]) -> Array:
        """(k, k) covariance of the plots' noise."""
        sigmas = np.array([component.sigma for component in components])
        R = np.diag(sigmas * sigmas)
        names = [component.name for component in components]
        if self.correlation is not None and set(_CHIRP) <= set(names):
            i, j = (names.index(name) for name in _CHIRP)
            R[i, j] = R[j, i] = self.correlation * sigmas[i] * sigmas[j]
        return R


def _distance(S: Array, nu: Array, there: Array) -> Any:
    """Squared distance by the components that were measured; the others have variance 1."""
    L, inverse = cholesky(mirror(S * np.outer(there, there) + np.diag(1.0 - there)))
    white = lower_solve(L, inverse, nu)
    return white @ white


def nearest(sensor: Sensor, limit: float, candidates: int) -> Nearest:
    """The gate for plots of a sensor.

    Args:
        sensor: what a filter believes of the sensor.
        limit: largest squared distance, above 0; 16 loses 1 in 900 of a consistent filter's own
            plots of three components.
        candidates: number of plots of a scan.

    Raises:
        UsageError: a limit that is not positive.
    """
    try:
        number = float(limit)
    except (TypeError, ValueError):
        number = np.nan
    if not number > 0.0:
        raise UsageError(
            f"gate={limit!r} is not a squared distance",
            why="it must be a positive number; about chi-square for a target's own plot",
            next_step="give gate=16, or float('inf') for the nearest plot however far",
        )
    rho = getattr(sensor, "range_rate_correlation", None)
    return Nearest(limit=number, candidates=candidates, correlation=rho)
