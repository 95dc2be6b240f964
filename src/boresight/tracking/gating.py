"""The gate: a plot that no plausible manoeuvre explains is turned away before the update."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.filters.ekf import linearise
from boresight.maths import Gaussian, cholesky, lower_solve, mirror, select
from boresight.models.components import Component

Array = Any


@dataclass(frozen=True, kw_only=True)
class ManoeuvreGate:
    """Mahalanobis gate on the joint innovation, widened by what a manoeuvre may have done.

    Identity already says whose plot it is; the gate only has to catch reflections, garbled ranges
    and other gross errors, so it must not turn away an aircraft that turns hard.

    Attributes:
        spread_m: standard deviation of the displacement by an unmodelled manoeuvre since the last
            plot, each axis, m; usually per lane and step, half the acceleration times dt².
        limit: largest squared distance that is admitted.
    """

    spread_m: Any
    limit: float

    def admit(
        self, prior: Gaussian, z: Array, components: Sequence[Component]
    ) -> tuple[Array, Any]:
        """The plot, NaN if it is outside, and 1 if it was inside (or empty), else 0.

        Args:
            prior: predicted mean (n,), cov (n, n); positions are its first three states.
            z: plot (k,).
            components: what the plot measures.
        """
        nu, H, noise, _ = linearise(components, z, prior.mean)
        position = H[:, :3] if len(prior.mean) >= 6 else H[:, :2]
        widened = H @ prior.cov @ H.T + self.spread_m * self.spread_m * (position @ position.T)
        L, inverse = cholesky(mirror(widened + np.diag(noise)))
        white = lower_solve(L, inverse, nu)
        inside = select(white @ white <= self.limit, 1.0, 0.0)
        return np.array([select(inside < 0.5, np.nan, value) for value in z]), inside
