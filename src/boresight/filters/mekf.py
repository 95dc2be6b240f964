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
from boresight.maths import Gaussian, gradient
from boresight.models.components import Component

Array = Any
Mu = Literal["printed", "predicted", "second order", "none"]
_SEQUENTIAL = "use the sequential filter, mekf, to choose between readings of mu"


def _angles(components: Sequence[Component]) -> list[tuple[int, Component]]:
    return [(i, c) for i, c in enumerate(components) if c.is_angle]


def _weights(components: Sequence[Component], mean: Array, distance: Any) -> dict[str, Any]:
    """cos² of the elevation for azimuth terms, 1 for elevation terms (erratum K3).

    Where no elevation is measured it follows from the azimuth's gradient, 1 / (distance cos).
    """
    named = {component.name: component for component in components}
    weights = {"elevation_rad": 1.0}
    if "elevation_rad" in named:
        cos = np.cos(named["elevation_rad"].value(mean))
        weights["azimuth_rad"] = cos * cos
    elif "azimuth_rad" in named:
        _, h = gradient(named["azimuth_rad"].value, mean)
        weights["azimuth_rad"] = 1.0 / (distance * distance * (h @ h))
    return weights


def _curvature(
    z: Array, components: Sequence[Component], mean: Array, distance: Any
) -> tuple[Any, Any]:
    """Mean and variance of what linearising the range at `mean` leaves out.

    kashyap (11) and aditya (16), (17) with errata K3 and A4; an angle that is missing adds nothing.
    """
    weights = _weights(components, mean, distance)
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
    weights = _weights(components, mean, distance)
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
            shift, extra = _second_order(components, latest, distance)
        return Correction(at, 0.0 if mu == "none" else shift, extra if added_variance else 0.0)

    return update_sequential(prior, z, components, order=order, correct=correct)
