"""Modified extended Kalman filter: the range innovation corrected for curvature.

[kashyap] section 2.2, (9) to (11); [aditya] (16), (17). After S.-T. Park and J. G. Lee,
"Improved Kalman Filter Design for Three-Dimensional Radar Tracking", 2001.
Differs from them, by errata K1 to K4, K10, K11 and A4: gradients are derivatives (K1 was a slip);
the range innovation is r - r_bar - mu (K2); azimuth terms carry cos(elevation) (K3); mu is only
right at the point it was derived for (K4), so the sequential form offers four readings of it:
printed, predicted, second order and none.

    printed       mu from the innovations, at the point the angles have already updated
    predicted     range, gradient and mu all at the predicted point
    second order  mu from the covariance the angles have left, and its variance added
    none          no mu

Slant range in three dimensions, or range in the plane, with the angles that are measured.
"""

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np

from boresight.errors import UsageError
from boresight.filters import kalman
from boresight.filters.ekf import (
    ANGLES_FIRST,
    Correction,
    linearise,
    update_sequential,
)
from boresight.filters.posterior import Posterior, innovation
from boresight.maths import Gaussian, gradient, select
from boresight.models.components import Component

Array = Any
Mu = Literal["printed", "predicted", "second order", "none"]
_SEQUENTIAL = "use the sequential filter, mekf, to choose between readings of mu"


def _angles(
    z: Array, components: Sequence[Component], mean: Array, distance: Any
) -> list[tuple[Any, Array, Any, Any]]:
    """Weight, gradient, innovation and noise variance of every angle, at `mean`.

    The weight is what one squared radian of that angle bends the range by, over its radius: 1 for
    elevation, cos² of the elevation for azimuth (erratum K3). It is 1 / (r |gradient|)², which
    holds in the plane and where no elevation is measured too. A missing angle weighs nothing.
    """
    found = []
    for component, measured in zip(components, z, strict=True):
        if component.is_angle:
            predicted, h = gradient(component.value, mean)
            there, nu = innovation(component, measured, predicted)
            weight = there
            if component.name != "elevation_rad":  # whose gradient is 1 / r: the weight is 1
                bend = distance * distance * (h @ h)
                weight = there / select(bend > 0.0, bend, np.inf)  # overhead there is no slope
            found.append((weight, h, nu, component.sigma * component.sigma))
    return found


def _curvature(
    z: Array, components: Sequence[Component], mean: Array, distance: Any
) -> tuple[Any, Any]:
    """Mean and variance of what linearising the range at `mean` leaves out.

    kashyap (11) and aditya (16), (17) with errata K3 and A4.
    """
    mu, variance = 0.0, 0.0
    for weight, _, nu, s2 in _angles(z, components, mean, distance):
        mu = mu + weight * (nu * nu - s2)
        variance = variance + weight * weight * (s2 * s2)
    return distance * mu * 0.5, distance * distance * variance * 0.5


def _second_order(
    z: Array, components: Sequence[Component], latest: Gaussian, distance: Any
) -> tuple[Any, Any]:
    """Second-order mean and variance of the range at an updated point (erratum K4)."""
    mean, cov = latest
    rows = _angles(z, components, mean, distance)
    mu, variance = 0.0, 0.0
    for weight, h, _, _ in rows:
        mu = mu + distance / 2 * weight * (h @ cov @ h)
        for other, g, _, _ in rows:
            covariance = h @ cov @ g
            variance = variance + distance * distance / 2 * weight * other * covariance * covariance
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
    if not isinstance(mu, bool):
        raise UsageError(f"mu={mu!r} is neither True nor False", next_step=_SEQUENTIAL)
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
    if mu not in get_args(Mu):
        raise UsageError(f"mu={mu!r} is no reading", next_step=f"use one of {get_args(Mu)}")

    def correct(component: Component, latest: Gaussian) -> Correction:
        if component.name != "range_m":
            return Correction(latest.mean, 0.0, 0.0)
        at = prior.mean if mu == "predicted" else latest.mean
        distance, h = gradient(component.value, at)
        shift, extra = _curvature(z, components, at, distance)
        if mu == "predicted":  # the residual is that of the predicted point: (11), erratum K4
            shift = shift + h @ (latest.mean - prior.mean)
        elif mu == "second order":
            shift, extra = _second_order(z, components, latest, distance)
        return Correction(at, 0.0 if mu == "none" else shift, extra if added_variance else 0.0)

    return update_sequential(prior, z, components, order=order, correct=correct)
