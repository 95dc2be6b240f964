"""Several Gaussians as one, by their first two moments; weights are kept as logarithms."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from boresight.lanes import select
from boresight.maths.gaussian import Gaussian
from boresight.maths.linalg import mirror

Array = Any


def weigh(logs: Sequence[Any]) -> list[Any]:
    """Weights that sum to one, from their logarithms, of which one is 0 and none above."""
    weights = [np.exp(log) for log in logs]
    scale = 1.0 / sum(weights)
    return [weight * scale for weight in weights]


def mix(weights: Sequence[Any], values: Sequence[Any]) -> Any:
    """Average of the parts' values; one of weight 0 may hold anything, NaN too."""
    total = 0.0
    for w, value in zip(weights, values, strict=True):
        total = select(w <= 0.0, total, total + w * value)  # a weight that is NaN must show
    return total


def greatest(logs: Sequence[Any]) -> Any:
    """The largest of some numbers."""
    top = logs[0]
    for log in logs[1:]:
        top = select(log > top, log, top)
    return top


def matched(logs: Sequence[Any], nus: Sequence[Any], variances: Sequence[Any]) -> tuple[Any, Any]:
    """Innovation and its variance, by the first two moments of the mixture."""
    top = greatest(logs)
    weights = weigh([log - top for log in logs])
    nu = mix(weights, nus)
    spread = [s + (each - nu) * (each - nu) for each, s in zip(nus, variances, strict=True)]
    return nu, mix(weights, spread)


def moments(weights: Sequence[Any], parts: Sequence[Gaussian]) -> Gaussian:
    """Mean and covariance of a mixture: what the parts have, and how far they lie apart.

    Args:
        weights: sum to one; a part with weight 0 has no say.
        parts: means (n,), covs (n, n).
    """
    mean = mix(weights, [part.mean for part in parts])
    apart = [part.mean - mean for part in parts]
    spread = [part.cov + np.outer(d, d) for part, d in zip(parts, apart, strict=True)]
    return Gaussian(mean, mirror(mix(weights, spread)))
