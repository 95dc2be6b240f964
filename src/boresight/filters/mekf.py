"""Modified extended Kalman filter: the range innovation corrected for curvature.

[kashyap] section 2.2, (9) to (11); [aditya] (16), (17). After S.-T. Park and J. G. Lee,
"Improved Kalman Filter Design for Three-Dimensional Radar Tracking", 2001.
Differs from them, by errata K1 to K4, K10, K11 and A4: gradients are derivatives (K1 was a slip);
the range innovation is r - r_bar - mu (K2); azimuth terms carry cos(elevation) (K3); mu is only
right at the point it was derived for, so the sequential form offers four readings (K4):

    printed       mu from the innovations, at the point the angles have already updated
    predicted     range, gradient and mu all at the predicted point
    second order  mu from the covariance the angles have left, and its variance added
    none          no mu

Range with both angles measured, slant and three-dimensional, or planar with azimuth alone.
"""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from boresight.filters import kalman
from boresight.filters.ekf import (
    ANGLES_FIRST,
    Correction,
    linearise,
    update_sequential,
)
from boresight.filters.posterior import Posterior, innovation
from boresight.maths import Gaussian, gradient
from boresight.models.components import Component

Array = Any
Mu = Literal["printed", "predicted", "second order", "none"]


def _angles(components: Sequence[Component]) -> list[tuple[int, Component]]:
    return [(i, c) for i, c in enumerate(components) if c.is_angle]


def _weights(components: Sequence[Component], mean: Array) -> dict[str, Any]:
    """cos² of the elevation for azimuth terms, 1 for elevation terms (erratum K3)."""
    elevation = next((c for c in components if c.name == "elevation_rad"), None)
    cos = np.cos(elevation.value(mean)) if elevation else 1.0
    return {"azimuth_rad": cos * cos, "elevation_rad": 1.0}


def _curvature(
    z: Array, components: Sequence[Component], mean: Array, distance: Any
) -> tuple[Any, Any]:
    """Mean and variance of what linearising the range at `mean` leaves out.

    kashyap (11) and aditya (16), (17) with errata K3 and A4; an angle that is missing adds nothing.
    """
    weights = _weights(components, mean)
    mu, variance = 0.0, 0.0
    for i, angle in _angles(components):
        there, nu = innovation(angle, z[i], angle.value(mean))
        s2, weight = angle.sigma * angle.sigma, weights[angle.name] * there
        mu = mu + distance / 2 * weight * (nu * nu - s2)
        variance = variance + distance * distance / 2 * weight * weight * s2 * s2
    return mu, variance


def _second_order(
    components: Sequence[Component], latest: Gaussian, distance: Any
) -> tuple[Any, Any]:
    """Second-order mean and variance of the range at an updated point (erratum K4)."""
    mean, cov = latest
    weights = _weights(components, mean)
    rows = [(weights[a.name], gradient(a.value, mean)[1]) for _, a in _angles(components)]
    mu, variance = 0.0, 0.0
    for w, h in rows:
        mu = mu + distance / 2 * w * (h @ cov @ h)
        for other, g in rows:
            covariance = h @ cov @ g
            variance = variance + distance * distance / 2 * w * other * covariance * covariance
    return mu, variance


def update_block(
    prior: Gaussian,
    z: Array,
    components: Sequence[Component],
    *,
    mu: bool = True,
    added_variance: bool = True,
) -> Posterior:
    """Condition on all components at once, as aditya's Table 1 does.

    Args:
        prior: predicted mean (n,), cov (n, n).
        z: plot (k,), NaN where missing.
        components: what the plot measures.
        mu: whether the artificial mean (17) is taken off the range innovation.
        added_variance: whether the artificial variance (16) is added to the range.
    """
    nu, H, noise, seen = linearise(components, z, prior.mean)
    for i, component in enumerate(components):
        if component.name == "range_m":
            distance = component.value(prior.mean)
            shift, extra = _curvature(z, components, prior.mean, distance)
            nu[i] = nu[i] - (shift * seen[i] if mu else 0.0)
            noise[i] = noise[i] + (extra * seen[i] if added_variance else 0.0)
    return kalman.condition(prior, nu, H, np.diag(noise), seen)


def update(
    prior: Gaussian,
    z: Array,
    components: Sequence[Component],
    *,
    order: Sequence[str] = ANGLES_FIRST,
    mu: Mu = "predicted",
    added_variance: bool = True,
) -> Posterior:
    """Condition on one component at a time, the range with its curvature corrected.

    Args:
        prior: predicted mean (n,), cov (n, n).
        z: plot (k,), NaN where missing.
        components: what the plot measures.
        order: names in processing order.
        mu: which reading of the range correction; see the module.
        added_variance: whether the range's variance grows by that of the correction.
    """

    def correct(component: Component, latest: Gaussian) -> Correction:
        if component.name != "range_m":
            return Correction(latest.mean, 0.0, 0.0)
        at = prior.mean if mu == "predicted" else latest.mean
        distance, h = gradient(component.value, at)
        shift, extra = _curvature(z, components, at, distance)
        if mu == "predicted":  # the residual is that of the predicted point: (11), erratum K4
            shift = shift + h @ (latest.mean - prior.mean)
        elif mu == "second order":
            shift, extra = _second_order(components, latest, distance)
        return Correction(at, 0.0 if mu == "none" else shift, extra if added_variance else 0.0)

    return update_sequential(prior, z, components, order=order, correct=correct)
