"""A normal as several Gaussians, and several Gaussians as one: by their first two moments."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from boresight.filters.line_of_sight_moments import NOTHING
from boresight.maths import Gaussian, mirror, select

Array = Any
# A standard normal as Gaussians of one width. Width; (offset, weight) of inner pairs; offset of the
# outermost pair, whose weight makes the variance 1. They are the closest in the mean square of the
# densities, to a fortieth of the normal's own (docs/decisions/0005-line-of-sight.md).
_SPLITS: dict[int, tuple[float, tuple[tuple[float, float], ...], float]] = {
    1: (1.0, (), 1.0),
    3: (2 / 3, (), 1.1395),
    5: (4 / 9, ((0.8368, 0.2481),), 1.8027),
}


def normal_as(parts: int) -> tuple[Array, Array, float]:
    """A standard normal as 1, 3 or 5 Gaussians: offsets, weights, and the width of each."""
    width, inner, outermost = _SPLITS[parts]
    left = 1.0 - width * width - 2.0 * sum(w * x * x for x, w in inner)
    pairs = [*inner, (outermost, left / (2.0 * outermost * outermost))][: parts // 2]
    offsets = [0.0, *(sign * x for x, _ in pairs for sign in (1.0, -1.0))]
    weights = [1.0 - 2.0 * sum(w for _, w in pairs), *(w for _, w in pairs for _ in "+-")]
    return np.array(offsets), np.array(weights), width


def split(whole: Gaussian, i: int, parts: int) -> tuple[list[Array], Array, Array]:
    """Several Gaussians that make up one, told apart by its state i.

    Args:
        whole: mean (n,), cov (n, n).
        i: what is split.
        parts: 1, 3 or 5.

    Returns:
        Their means, the covariance of each, and their weights. What is correlated with that state
        is split along its regression.
    """
    if parts == 1:
        return [whole.mean], whole.cov, np.ones(1)
    offsets, weights, width = normal_as(parts)
    line = whole.cov[:, i] / np.sqrt(whole.cov[i, i] + NOTHING)
    cov = mirror(whole.cov - (1.0 - width * width) * np.outer(line, line))
    return [whole.mean + x * line for x in offsets], cov, weights


def weigh(logs: Sequence[Any]) -> list[Any]:
    """Weights that sum to one, from their logarithms, of which one is 0 and none above."""
    weights = [np.exp(log) for log in logs]
    scale = 1.0 / sum(weights)
    return [weight * scale for weight in weights]


def mix(weights: Sequence[Any], values: Sequence[Any]) -> Any:
    """Average of the parts' values."""
    return sum(w * value for w, value in zip(weights, values, strict=True))


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
