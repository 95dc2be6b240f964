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
        half_dt2: dt²/2 since the last plot, s²; per lane and step.
        accel_mps2: standard deviation of the acceleration of a target at rest, m/s².
        turn_radps: what each m/s of speed adds to that: fast targets can turn harder.
        limit: largest squared distance that is admitted.
        dims: number of position coordinates.
    """

    half_dt2: Any
    accel_mps2: float
    turn_radps: float
    limit: float
    dims: int = 3

    def admit(
        self, prior: Gaussian, z: Array, components: Sequence[Component]
    ) -> tuple[Array, Any]:
        """The plot, NaN if it is outside, and 1 if it was inside (or empty), else 0.

        Args:
            prior: predicted mean (n,), cov (n, n); positions, then velocities first.
            z: plot (k,).
            components: what the plot measures.
        """
        nu, H, noise, _ = linearise(components, z, prior.mean)
        position, velocity = H[:, : self.dims], prior.mean[self.dims : 2 * self.dims]
        speed = np.sqrt(velocity @ velocity + 1e-6)
        spread = self.half_dt2 * (self.accel_mps2 + self.turn_radps * speed)
        widened = H @ prior.cov @ H.T + spread * spread * (position @ position.T)
        L, inverse = cholesky(mirror(widened + np.diag(noise)))
        white = lower_solve(L, inverse, nu)
        inside = select(white @ white <= self.limit, 1.0, 0.0)
        return np.array([select(inside < 0.5, np.nan, value) for value in z]), inside
