"""What every update yields, and the two helpers that all of them share."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.maths import missing, select
from boresight.models.components import Component

Array = Any
LOG_TWO_PI = float(np.log(2.0 * np.pi))


class Posterior(NamedTuple):
    """A state conditioned on a plot, and how surprising the plot was.

    Attributes:
        mean: (n,).
        cov: (n, n).
        nis: normalised innovation squared, summed over the components that were measured.
        dof: how many were measured.
        loglik: log-likelihood of the plot given the prediction.
        innovation: (k,), measured minus predicted at the time each component was used; 0 where
            missing.
        variance: (k,), the filter's variance of each innovation; NaN where missing.
    """

    mean: Array
    cov: Array
    nis: Any
    dof: Any
    loglik: Any
    innovation: Array
    variance: Array


def innovation(component: Component, measured: Any, predicted: Any) -> tuple[Any, Any]:
    """Whether the component was measured, and its innovation: 0 if it was not."""
    seen = select(missing(measured), 0.0, 1.0)
    safe = select(seen < 0.5, predicted, measured)  # NaN must not reach the arithmetic
    return seen, component.residual(safe, predicted)


def tally(seen: Sequence[Any], squares: Sequence[Any], logs: Sequence[Any]) -> tuple[Any, Any, Any]:
    """NIS, degrees of freedom and log-likelihood of independent scalar innovations.

    Args:
        seen: 1 where measured, else 0.
        squares: innovation squared over its variance.
        logs: logarithm of each variance, 0 where missing.
    """
    nis, dof = sum(squares), sum(seen)
    return nis, dof, -0.5 * (nis + sum(logs) + LOG_TWO_PI * dof)
