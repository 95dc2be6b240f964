"""A normal as several Gaussians that have its first two moments."""

from typing import Any

import numpy as np

from boresight.filters.line_of_sight_moments import NOTHING
from boresight.maths import Gaussian, mirror

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
