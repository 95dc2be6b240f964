"""What several motions share: names and checks of a state, Taylor series, noise on every axis."""

from dataclasses import fields
from typing import Any, Literal, get_args, get_origin

import numpy as np

from boresight.errors import UsageError
from boresight.models.checks import not_negative

Array = Any


def state_names(dims: int, *kinds: str) -> tuple[str, ...]:
    """Names of a state: each kind, such as "v{}_mps", for every axis."""
    return tuple(f"{kind.format(axis)}" for kind in kinds for axis in "xyz"[:dims])


def check_motion(motion: Any) -> None:
    """Standard deviations become floats or arrays and are checked, and so are the switches."""
    for field in fields(motion):
        value = getattr(motion, field.name)
        if field.type is float:
            object.__setattr__(motion, field.name, not_negative(field.name, value))
        elif get_origin(field.type) is Literal and value not in get_args(field.type):
            raise UsageError(
                f"{field.name}={value!r} is unknown",
                next_step=f"use one of {', '.join(get_args(field.type))}",
            )
    if not isinstance(motion.dims, int) or motion.dims not in (2, 3):
        raise UsageError(f"dims={motion.dims!r} is neither 2 nor 3")


def each_axis(block: list[list[Any]], dims: int) -> Array:
    """The same small matrix for every axis: kron(block, I)."""
    return np.kron(np.array(block), np.eye(dims))


def taylor(state: Array, dt: Any, dims: int) -> Array:
    """Taylor series of position and its derivatives over dt."""
    orders = state.reshape(-1, dims)
    moved = []
    for i in range(len(orders)):
        total, factor = orders[i], 1.0
        for j in range(i + 1, len(orders)):
            factor = factor * dt / (j - i)
            total = total + orders[j] * factor
        moved.append(total)
    return np.concatenate(moved)
