"""Linear Kalman filter: the prediction that all filters share, and the joint linear update.

[kalman1960] R. E. Kalman, "A New Approach to Linear Filtering and Prediction Problems".
Paper: kashyap (6) to (8).
Differs from it: the prediction takes any motion, whose Jacobian is found by dual numbers (for a
linear motion that is the transition matrix itself); the update is in Joseph's form, and for a
single component in one that is shorter and keeps positive at least as long.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters.posterior import Posterior, tally
from boresight.maths import (
    Gaussian,
    cholesky,
    gradient,
    jacobian,
    joseph,
    lower_solve,
    mirror,
    missing,
    select,
    upper_solve,
)
from boresight.models.components import FORMULAS, Component
from boresight.models.motion import Motion

Array = Any
_SHORT = 1.0 - 2.0**-50


class Linear(NamedTuple):
    """A plot as a linear measurement: fields as `condition` takes them."""

    nu: Array
    H: Array
    R: Array
    seen: Array


def predict(prior: Gaussian, motion: Motion, dt: Any) -> Gaussian:
    """State after dt seconds.

    Args:
        prior: mean (n,), cov (n, n).
        motion: how the target moves.
        dt: s; 0 leaves the state as it is.

    Returns:
        kashyap (7), with the Jacobian of the motion for F.
    """
    moved, F = jacobian(lambda state: motion.move(state, dt), prior.mean)
    return Gaussian(moved, mirror(F @ prior.cov @ F.T + motion.noise(dt)))


def update(prior: Gaussian, z: Array, H: Array, R: Array) -> Posterior:
    """Condition on a linear measurement z = H x + noise.

    Args:
        prior: mean (n,), cov (n, n).
        z: (k,), NaN where missing.
        H: (k, n).
        R: (k, k) covariance of the noise.

    Returns:
        kashyap (8), in Joseph's form; missing rows change nothing.
    """
    k = len(z)
    gone = [missing(component) for component in z]
    seen = np.array([select(g, 0.0, 1.0) for g in gone])
    rows = np.array([h * there for h, there in zip(H, seen, strict=True)])
    # A missing row becomes a measurement of nothing with variance 1: it moves nothing.
    noise = np.array(
        [
            [R[i, j] * seen[i] * seen[j] + (i == j) * (1.0 - seen[i]) for j in range(k)]
            for i in range(k)
        ]
    )
    nu = np.array([select(g, 0.0, value) for g, value in zip(gone, z, strict=True)])
    return condition(prior, nu - rows @ prior.mean, rows, noise, seen)


def condition(prior: Gaussian, nu: Array, H: Array, R: Array, seen: Array) -> Posterior:
    """The joint update that every block filter ends in; Joseph's form.

    Args:
        prior: mean (n,), cov (n, n).
        nu: (k,) innovations, 0 where missing.
        H: (k, n) gradients, 0 where missing.
        R: (k, k) noise covariance, rows of the identity where missing.
        seen: (k,) 1 where measured, else 0.
    """
    if len(nu) == 1:
        return _condition_on_one(prior, nu, H[0], R[0, 0], seen)
    mean, cov = prior
    S = mirror(H @ cov @ H.T + R)
    L, inverse = cholesky(S)
    K = upper_solve(L, inverse, lower_solve(L, inverse, H @ cov)).T
    white = lower_solve(L, inverse, nu)
    # A missing row has S = 1 and nu = 0: it adds nothing to either sum.
    totals = tally(list(seen), list(white * white), [-2.0 * np.log(i) for i in inverse])
    variances = np.array([select(t < 0.5, np.nan, S[i, i]) for i, t in enumerate(seen)])
    return Posterior(mean + K @ nu, joseph(cov, K, H, R), *totals, nu, variances)


def _condition_on_one(prior: Gaussian, nu: Array, h: Array, r: Any, seen: Array) -> Posterior:
    """`condition` for k = 1: kashyap (9), last four lines; arguments as there, of the only row.

    A covariance from which a very sharp plot takes nearly all would be left with the rounding of
    what was taken, of either sign. So a little less is taken: four roundings are enough.
    """
    mean, cov = prior
    cross = cov @ h
    s = h @ cross + r
    s = select(s > 0.0, s, np.nan)  # a covariance that is none must not look like one again
    inverse = _SHORT / s
    gain = cross * inverse
    totals = tally(list(seen), [nu[0] * nu[0] * inverse], [np.log(s)])
    variances = np.array([select(seen[0] < 0.5, np.nan, s)])
    left = mirror(cov - np.outer(gain, cross))
    return Posterior(mean + gain * nu[0], left, *totals, nu, variances)


def update_plot(prior: Gaussian, z: Array, components: Sequence[Component]) -> Posterior:
    """Condition on a plot whose components are linear in the state (coordinates).

    Args:
        prior: predicted mean (n,), cov (n, n).
        z: plot (k,), NaN where missing.
        components: what the plot measures; gradients are taken at the prediction.

    Raises:
        UsageError: a component is known not to be linear.
    """
    curved = [component.name for component in components if component.name in FORMULAS]
    if curved:
        raise UsageError(
            f"the linear Kalman filter cannot use {curved[0]}",
            why="it is not linear in the state",
            next_step="use ekf",
        )
    pairs = [gradient(component.value, prior.mean) for component in components]
    H = np.array([h for _, h in pairs])
    offset = np.array([value - h @ prior.mean for value, h in pairs])
    R = np.diag(np.array([component.sigma * component.sigma for component in components]))
    return update(prior, z - offset, H, R)
