"""Extended Kalman filter: block, sequential in any order, and iterated.

[jazwinski1970] A. H. Jazwinski, "Stochastic Processes and Filtering Theory", chapter 8.
Paper: kashyap (9) to (11) without their range correction; aditya section 3.
Differs from them: K_{k+1} is formed with H_{k+1} (aditya prints H_k); arctan2, predicted
velocities and wrapped angles (errata K10, K11); a NaN component is a missing one.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters import kalman
from boresight.filters.posterior import Posterior, innovation, tally
from boresight.maths import Gaussian, gradient, mirror, select
from boresight.models.components import Component

Array = Any
ANGLES_FIRST = ("elevation_rad", "azimuth_rad", "range_m", "height_m", "range_rate_mps")


def in_order(
    components: Sequence[Component], order: Sequence[str] = ANGLES_FIRST
) -> list[tuple[int, Component]]:
    """Position in the plot and component, in processing order; what is not named comes last."""
    rank = {name: i for i, name in enumerate(order)}
    numbered = enumerate(components)
    return sorted(numbered, key=lambda item: (rank.get(item[1].name, len(rank)), item[0]))


class Correction(NamedTuple):
    """What a modified filter changes in one scalar update.

    Attributes:
        at: (n,) where the component is linearised.
        shift: taken off the innovation.
        extra: added to the noise variance.
    """

    at: Array
    shift: Any
    extra: Any


Corrector = Callable[[Component, Gaussian], Correction]


def update_sequential(
    prior: Gaussian,
    z: Array,
    components: Sequence[Component],
    *,
    order: Sequence[str] = ANGLES_FIRST,
    correct: Corrector | None = None,
) -> Posterior:
    """Condition on one component at a time, each linearised at the latest estimate.

    Args:
        prior: predicted mean (n,), cov (n, n).
        z: plot (k,), NaN where missing.
        components: what the plot measures.
        order: names in processing order.
        correct: for modified filters: from a component and the latest estimate.
    """
    latest = prior
    seen, squares, logs = [], [], []
    innovations, variances = [None] * len(components), [None] * len(components)
    for i, component in in_order(components, order):
        at, shift, extra = correct(component, latest) if correct else (latest.mean, 0.0, 0.0)
        predicted, h = gradient(component.value, at)
        there, nu = innovation(component, z[i], predicted)
        nu = nu - there * shift
        r = component.sigma * component.sigma + extra
        latest, s = condition(latest, h, nu, r, there)
        seen.append(there)
        squares.append(nu * nu / s)
        logs.append(select(there < 0.5, 0.0, np.log(s)))
        innovations[i], variances[i] = nu, select(there < 0.5, np.nan, s)
    totals = tally(seen, squares, logs)
    return Posterior(*latest, *totals, np.array(innovations), np.array(variances))


def condition(prior: Gaussian, h: Array, nu: Any, r: Any, there: Any) -> tuple[Gaussian, Any]:
    """One scalar update: kashyap (9), last four lines.

    Args:
        prior: mean (n,), cov (n, n).
        h: (n,) gradient of the measurement.
        nu: innovation.
        r: noise variance.
        there: 1 if measured, 0 if missing: then nothing changes.

    Returns:
        The posterior and the variance of the innovation.
    """
    mean, cov = prior
    cross = cov @ h
    s = h @ cross + r
    gain = cross * (there / s)
    return Gaussian(mean + gain * nu, mirror(cov - np.outer(gain, cross))), s


def linearise(
    components: Sequence[Component], z: Array, mean: Array
) -> tuple[Array, Array, Array, Array]:
    """Innovations, gradients, noise and presence at `mean`; a missing row is empty with noise 1."""
    rows, nus, noise, seen = [], [], [], []
    for component, measured in zip(components, z, strict=True):
        predicted, h = gradient(component.value, mean)
        there, nu = innovation(component, measured, predicted)
        rows.append(h * there)
        nus.append(nu)
        noise.append(select(there < 0.5, 1.0, component.sigma * component.sigma))
        seen.append(there)
    return np.array(nus), np.array(rows), np.array(noise), np.array(seen)


def update(prior: Gaussian, z: Array, components: Sequence[Component]) -> Posterior:
    """Condition on all components at once, linearised at the prediction; Joseph's form.

    Args:
        prior: predicted mean (n,), cov (n, n).
        z: plot (k,), NaN where missing.
        components: what the plot measures.
    """
    nu, H, noise, seen = linearise(components, z, prior.mean)
    return kalman.condition(prior, nu, H, np.diag(noise), seen)


def update_iterated(
    prior: Gaussian, z: Array, components: Sequence[Component], *, iterations: int = 3
) -> Posterior:
    """Gauss-Newton on the posterior: relinearised at each estimate, always from the prior.

    [bell1993]. It fails, as the method does, when a target passes within a few degrees of zenith or
    nadir: an iterate lands beside the vertical axis, where the gradient of azimuth grows without
    bound, and the covariance taken there is far too small. Step halving helps in half of such runs:
    in the others the mode of the posterior itself lies there.

    Args:
        prior: predicted mean (n,), cov (n, n).
        z: plot (k,), NaN where missing.
        components: what the plot measures.
        iterations: 1 is the block EKF.

    Returns:
        The last iterate; NIS and likelihood are those of the prediction.
    """
    if iterations < 1:
        raise UsageError(f"{iterations=} is less than one")
    first = post = update(prior, z, components)
    for _ in range(iterations - 1):
        nu, H, noise, seen = linearise(components, z, post.mean)
        moved = nu - H @ (prior.mean - post.mean)
        post = kalman.condition(prior, moved, H, np.diag(noise), seen)
    return Posterior(
        post.mean, post.cov, first.nis, first.dof, first.loglik, first.innovation, first.variance
    )
