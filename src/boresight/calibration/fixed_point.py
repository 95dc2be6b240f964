"""Solve x = step(x) when each step is dear: Anderson's mixing of the last few steps.

Expectation-maximisation creeps where classes overlap; mixing its steps takes their number from
hundreds to tens, and where it does not help the memory is emptied and plain steps go on.

    [walker2011] Homer F. Walker and Peng Ni, "Anderson Acceleration for Fixed-Point Iterations"

Differs from it: the memory is emptied when a step has grown, not by a condition number.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

Array = Any
_MEMORY = 10
_GROWTH = 2.0  # of a step against the smallest so far: mixing has led astray
_RANK = 1e-8  # of the largest singular value: differences below it are noise


def fixed_point(
    step: Callable[[Array], Array],
    start: Array,
    *,
    size: Callable[[Array], float],
    tolerance: float,
    most: int,
) -> tuple[Array, bool]:
    """Where a step leads nowhere else.

    Args:
        step: a map that converges by itself, however slowly; it must keep bounds itself.
        start: (n,).
        size: how large a difference is, in the units of `tolerance`.
        tolerance: of a plain step at the end.
        most: steps before giving up.

    Returns:
        The point after the last plain step, and whether the tolerance was met.
    """
    x, least = start, np.inf
    points: list[Array] = []
    moves: list[Array] = []
    for _ in range(most):
        image = step(x)
        move = image - x
        length = size(move)
        if length < tolerance:
            return image, True
        if length > _GROWTH * least:
            points, moves, least = [], [], np.inf
        least = min(least, length)
        points, moves = [*points, image][-_MEMORY:], [*moves, move][-_MEMORY:]
        x = _mixed(np.array(points), np.array(moves))
    return step(x), False


def _mixed(points: Array, moves: Array) -> Array:
    """The mixture of images whose mixture of moves is shortest."""
    if len(points) == 1:
        return points[0]
    share = np.linalg.lstsq(np.diff(moves, axis=0).T, moves[-1], rcond=_RANK)[0]
    return points[-1] - share @ np.diff(points, axis=0)
