"""The best straight track's residuals as those of a linear regression, and slopes along faults."""

from typing import Any, NamedTuple

import numpy as np

from boresight.target_motion.contact import Contact

Array = Any


class Fit(NamedTuple):
    """The best track's residuals; all in the order of time, only what was heard.

    Attributes:
        time_s: (m,).
        sigma: (m,) stated standard deviations, rad.
        rest: (m,) residuals in these, without what the track can explain.
        basis: (m, rank) orthonormal columns: what it can explain.
        across: (m, 2) slopes of each bearing with the target's North and East, in sigma per m.
        side: (m,) 1 for a bearing and right of the array's axis, -1 left of it.
    """

    time_s: Array
    sigma: Array
    rest: Array
    basis: Array
    across: Array
    side: Array

    @property
    def dof(self) -> int:
        """Residuals that are free."""
        return len(self.rest) - int(self.basis.shape[1])


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
