"""Sigma-point filters: unscented, cubature, and iterated posterior linearisation.

[julier2004] S. J. Julier and J. K. Uhlmann, "Unscented Filtering and Nonlinear Estimation";
[arasaratnam2009] I. Arasaratnam and S. Haykin, "Cubature Kalman Filters"; [garcia2015]
A. F. Garcia-Fernandez, L. Svensson, M. R. Morelande and S. Sarkka, "Posterior Linearization Filter:
Principles and Implementation Using Sigma Points".

Differs from them: points are taken in pairs, m + s L_j and m - s L_j, about a centre: what the two
halves of a pair differ by is a slope, where they meet is curvature, so that formulas become
h(x) = mean + D u + rest with x = m + L u, and nothing cancels. Residuals of angles are wrapped
relative to the centre, so a mean of angles is right on either side of 180 degrees. A motion that is
linear is predicted by its matrix, which is what points would give. A missing component is one that
the sensor does not have. A posterior is regressed on only where that leaves less to noise. The
update is in Joseph's form, which needs no square-root form beside it: plots a hundred million times
sharper than the start leave every covariance positive.

With s² = alpha² (n + kappa) the covariance of the rest is sum_j e_j e_j' / s² +
(beta - alpha²) d d', where e_j are the midpoints of the pairs and d = sum_j e_j / s² is what
curvature adds to the mean. So it is positive for any s where beta is at least alpha², and for the
cubature rule (alpha = 1, beta = kappa = 0), where it is the scatter of the midpoints. Points lie
along the columns of Cholesky's factor, hence depend on the axes of the state.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters import kalman
from boresight.filters.kalman import Linear
from boresight.filters.posterior import Posterior, innovation
from boresight.filters.steps import Updating
from boresight.maths import (
    Gaussian,
    cholesky,
    elimination,
    lower_solve,
    mirror,
    reach,
    select,
    upper_solve,
)
from boresight.models.components import Component
from boresight.models.motion import (
    ConstantAcceleration,
    ConstantVelocity,
    Motion,
    Static,
    WithHeightOffset,
)

Array = Any
Formula = Callable[[Array], Array]
Apart = Callable[[Array, Array], Array]
_LINEAR = (ConstantVelocity, ConstantAcceleration, Static, WithHeightOffset)


@dataclass(frozen=True)
class Rule:
    """Where sigma points lie and what they weigh: the scaled unscented transformation.

    Attributes:
        alpha, beta, kappa: as in julier2004.
    """

    alpha: float = 1.0
    beta: float = 0.0
    kappa: float = 0.0

    def spread(self, n: int) -> float:
        """How many standard deviations the points of n dimensions lie from their centre."""
        if not (self.alpha > 0.0 and n + self.kappa > 0.0):
            raise UsageError(
                f"alpha={self.alpha!r} and kappa={self.kappa!r} place no sigma points",
                why=f"alpha and n + kappa must be positive, and n is {n}",
            )
        return float(self.alpha * np.sqrt(n + self.kappa))

    @property
    def lift(self) -> float:
        """Weight of the centre in a covariance beyond its weight in the mean, less one."""
        return self.beta - self.alpha * self.alpha


CUBATURE = Rule()


class Affine(NamedTuple):
    """A formula of x = m + L u, u standard normal, as an affine one: y = mean + D u + rest.

    Attributes:
        mean: (k,).
        D: (k, n) what becomes of the columns of L.
        rest: (k, k) covariance of what is not affine.
    """

    mean: Array
    D: Array
    rest: Array


def regress(formula: Formula, apart: Apart, mean: Array, L: Array, rule: Rule) -> Affine:
    """Statistical linear regression of a formula on sigma points (garcia2015).

    Args:
        formula: of a state (n,), gives (k,).
        apart: difference of two values of the formula, (k,); angles wrapped.
        mean: (n,).
        L: (n, n) lower factor of the covariance. Columns beyond what an output depends on leave
            it where it is and cost nothing.
        rule: where the points lie.
    """
    spread, centre, reaches = rule.spread(len(mean)), formula(mean), reach(formula, mean)
    slopes, bends = [], []
    for j in range(max(reaches)):
        step = spread * L[:, j]
        ahead, behind = (apart(formula(x), centre) for x in (mean + step, mean - step))
        touched = [j < r for r in reaches]
        slopes.append(_kept((ahead - behind) * (0.5 / spread), touched))
        bends.append(_kept((ahead + behind) * 0.5, touched))
    slopes += [[0.0] * len(reaches)] * (len(mean) - len(slopes))
    E = np.array(bends).T / spread
    shift = sum(E.T) / spread
    rest = mirror(E @ E.T + rule.lift * np.outer(shift, shift))
    return Affine(centre + shift, np.array(slopes).T, rest)


def _kept(values: Array, touched: Sequence[bool]) -> list[Any]:
    """Values where they are touched, zeros by structure elsewhere."""
    return [value if there else 0.0 for value, there in zip(values, touched, strict=True)]


def predict(prior: Gaussian, motion: Motion, dt: Any, *, rule: Rule = CUBATURE) -> Gaussian:
    """State after dt seconds, by sigma points where the motion is not linear.

    Args:
        prior: mean (n,), cov (n, n).
        motion: how the target moves.
        dt: s.
        rule: where the points lie.
    """
    if isinstance(motion, _LINEAR):
        return kalman.predict(prior, motion, dt)
    L, _ = cholesky(prior.cov)
    moved, D, rest = regress(lambda x: motion.move(x, dt), np.subtract, prior.mean, L, rule)
    return Gaussian(moved, mirror(D @ D.T + rest + motion.noise(dt)))


def update(
    prior: Gaussian,
    z: Array,
    components: Sequence[Component],
    *,
    rule: Rule = CUBATURE,
    iterations: int | None = 1,
) -> Posterior:
    """Condition on all components, regressed on points of the prior and then of the posterior.

    A new regression is taken only where it leaves less to noise than the one before: else iterates
    run away to the vertical axis, where an azimuth seems to tell everything.

    Args:
        prior: predicted mean (n,), cov (n, n).
        z: plot (k,), NaN where missing.
        components: what the plot measures.
        rule: where the points lie.
        iterations: number of regressions; 1 is the unscented or cubature filter. None: 5 of up to
            5 states and 2 of more, where 5 of all that may be measured do not fit a kernel.

    Returns:
        The last posterior; NIS and likelihood are those of the prediction.
    """
    if iterations is None:
        iterations = 5 if len(prior.mean) <= 5 else 2
    best = linearise(prior, prior, z, components, rule)
    first = kalman.condition(prior, *best)
    for _ in range(iterations - 1):
        again = linearise(prior, _posterior(prior, best), z, components, rule)
        better = _volume(again.R) < _volume(best.R)
        best = Linear(*(select(better, a, b) for a, b in zip(again, best, strict=True)))
    last = kalman.condition(prior, *best)
    return Posterior(last.mean, last.cov, *first[2:])


def linearise(
    prior: Gaussian, at: Gaussian, z: Array, components: Sequence[Component], rule: Rule
) -> Linear:
    """Components regressed on points of `at`; a missing one is empty with noise 1.

    Args:
        prior: whose innovations are wanted.
        at: where the points are.
        z: plot (k,), NaN where missing.
        components: what the plot measures.
        rule: how the points lie.
    """
    L, inverse = cholesky(at.cov)
    predicted, D, rest = regress(
        partial(_values, components),
        lambda a, b: np.array([c.residual(u, v) for c, u, v in zip(components, a, b, strict=True)]),
        at.mean,
        L,
        rule,
    )
    pairs = [innovation(c, v, p) for c, v, p in zip(components, z, predicted, strict=True)]
    seen, nu = (np.array(part) for part in zip(*pairs, strict=True))
    # A prior that is no Gaussian predicts NaN, which a missing component must not pass on.
    nu = np.array([select(s < 0.5, 0.0, v) for s, v in zip(seen, nu, strict=True)])
    slopes = upper_solve(L, inverse, D.T).T
    H = np.array([select(s < 0.5, 0.0, h) for s, h in zip(seen, slopes, strict=True)])
    noise = rest + np.diag(np.array([c.sigma * c.sigma for c in components]))
    both, alone = np.outer(seen, seen), np.eye(len(seen))
    noise = np.array(
        [
            [select(s < 0.5, one, v) for s, one, v in zip(*row, strict=True)]
            for row in zip(both, alone, noise, strict=True)
        ]
    )
    return Linear(nu - H @ (prior.mean - at.mean), H, noise, seen)


def _values(components: Sequence[Component], x: Array) -> Array:
    return np.array([component.value(x) for component in components])


def _posterior(prior: Gaussian, known: Linear) -> Gaussian:
    """The prior conditioned on linear components: `kalman.condition` in its short form."""
    nu, H, R, _ = known
    across = H @ prior.cov
    L, inverse = cholesky(mirror(across @ H.T + R))
    half = lower_solve(L, inverse, across)
    mean = prior.mean + half.T @ lower_solve(L, inverse, nu)
    return Gaussian(mean, mirror(prior.cov - half.T @ half))


def _volume(cov: Array) -> Any:
    """Determinant."""
    return np.prod(elimination(cov))


def _method(rule: Rule, iterations: int | None = 1) -> Updating:
    settings = (("iterations", iterations), ("rule", rule))
    moved = partial(predict, rule=rule)
    return Updating(formula=update, settings=settings, moved=moved, conversion="mucm")


@cache
def unscented(*, alpha: float = 1.0, beta: float = 2.0, kappa: float = 0.0) -> Updating:
    """Unscented Kalman filter.

    Args:
        alpha: how far the points lie, over the square root of n + kappa standard deviations.
        beta: what is known of the distribution; 2 is right for one Gaussian element.
        kappa: what widens the points. The defaults are positive for any number of states; with
            beta < alpha² and kappa < 0 a covariance may be negative.
    """
    return _method(Rule(alpha, beta, kappa))


@cache
def cubature() -> Updating:
    """Cubature Kalman filter, third degree."""
    return _method(CUBATURE)


@cache
def posterior_linearisation(*, iterations: int | None = None) -> Updating:
    """Iterated posterior linearisation filter, with cubature points.

    Args:
        iterations: as in `update`.
    """
    if iterations is not None and iterations < 1:
        raise UsageError(f"{iterations=} is less than one")
    return _method(CUBATURE, iterations)
