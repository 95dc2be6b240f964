"""The best straight track's residuals as those of a linear regression, and slopes along faults.

[bartlett1935] M. S. Bartlett, "Some Aspects of the Time-Correlation Problem in Regard to Tests of
Significance": of errors that are alike, fewer count.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.target_motion.contact import Contact

Array = Any
_NOTHING = 1e-6  # of a slope's length: what is left of it when the track explains all of it


class Fit(NamedTuple):
    """The best track's residuals; all in the order of time, only what was heard.

    Attributes:
        time_s: (m,).
        sigma: (m,) stated standard deviations, rad.
        rest: (m,) residuals in these, without what the track can explain.
        basis: (m, rank) orthonormal columns: what it can explain.
        across: (m, 2) slopes of each bearing with the target's North and East, in sigma per m.
        side: (m,) 1 for a bearing and right of the array's axis, -1 left of it.
        alike: correlation of neighbouring errors that tests must reckon with; 0 for independent.
    """

    time_s: Array
    sigma: Array
    rest: Array
    basis: Array
    across: Array
    side: Array
    alike: float = 0.0

    @property
    def dof(self) -> int:
        """Residuals that are free."""
        return len(self.rest) - int(self.basis.shape[1])

    @property
    def stretch(self) -> float:
        """How many such bearings tell as much of a slow change as one of independent error.

        Of a first-order autoregression [bartlett1935]; it is too many where errors of bearings
        further apart are less alike than that.
        """
        return (1.0 + self.alike) / (1.0 - self.alike)

    @property
    def worth(self) -> float:
        """How many independent residuals tell as much of a slow change."""
        return self.dof / self.stretch

    def without(self, slopes: Array) -> "Fit":
        """The same if what slopes (m, k) can explain is taken off as well."""
        more, _, _ = self.free(slopes)
        return self._replace(
            rest=self.rest - more @ (more.T @ self.rest), basis=np.hstack([self.basis, more])
        )

    def free(self, slopes: Array) -> tuple[Array, Array, Array]:
        """Parts of slopes (m, k) that the track cannot explain, as a singular value decomposition.

        Returns:
            (m, rank), (rank,), (rank, k): of slopes that are of length one before.
        """
        size = np.linalg.norm(slopes, axis=0)
        unit = slopes / np.where(size > 0.0, size, 1.0)
        left, values, right = np.linalg.svd(
            unit - self.basis @ (self.basis.T @ unit), full_matrices=False
        )
        kept = values > _NOTHING
        return left[:, kept], values[kept], right[kept]


def fitted(contact: Contact, mean: Array, residual: Array) -> Fit:
    """Residuals (steps,), rad, NaN where nothing was heard, of the track that ends at mean (4,)."""
    heard = np.isfinite(residual)
    ago = contact.time_s[heard] - contact.time_s[-1]
    away = mean[:2] + ago[:, None] * mean[2:4] - contact.position_m[heard]
    is_cone = ~np.isfinite(contact.bearing_rad[heard])
    bearing = np.arctan2(away[:, 1], away[:, 0])
    left = is_cone & (np.sin(bearing - contact.axis_rad[heard]) < 0.0)
    side, sigma = np.where(left, -1.0, 1.0), contact.sigma_rad[heard]
    turned = np.stack([-away[:, 1], away[:, 0]], axis=-1)
    square = np.maximum(np.sum(away**2, axis=-1), 1e-6)  # 1 mm: a target at the sensor
    across = turned * (side / square / sigma)[:, None]
    basis = _basis(np.hstack([across, across * ago[:, None]]))
    rest = residual[heard] / sigma
    return Fit(contact.time_s[heard], sigma, rest - basis @ (basis.T @ rest), basis, across, side)


def _basis(columns: Array) -> Array:
    """Orthonormal columns (m, rank) of the same span."""
    size = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return left[:, values > 1e-10 * values[0]]


def delay_slopes(fit: Fit, contact: Contact, heard: Array) -> Array:
    """(m,) how the bearings change with a delay of own ship's clock, in sigma a second.

    Own ship is then where it was a delay before, and a towed array points where it pointed.
    """
    moved = np.sum(fit.across * contact.velocity_mps[heard], axis=-1)
    if not contact.is_conical:
        return moved
    known, time = np.isfinite(contact.axis_rad), contact.time_s
    axis = np.interp(time, time[known], np.unwrap(contact.axis_rad[known]))
    turned = np.gradient(axis, time)[heard]
    is_cone = ~np.isfinite(contact.bearing_rad[heard])
    return moved + np.where(is_cone, fit.side * turned / fit.sigma, 0.0)
