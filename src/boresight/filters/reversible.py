"""Motions that can be run backwards: for what is said of one track without noise."""

from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.models.components import Component
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of, with_numbers

Array = Any


def later(component: Component, motion: Motion, dt: Any) -> Callable[[Array], Any]:
    """What a component measures after dt seconds, of the state before them."""
    return lambda state: component.value(motion.move(state, dt))


def check_reversible(motion: Motion, dt: float) -> None:
    """Refuse a motion with noise, or one whose step backwards does not undo its step.

    Args:
        motion: to be checked.
        dt: s; 0 stands for one second.

    Raises:
        UsageError: says which.
    """
    worst = {name: _largest(name, *pair) for name, pair in numbers(motion, "motion").items()}
    one = with_numbers(motion, "motion", worst)
    dt = dt if dt > 0.0 else 1.0
    if np.any(np.asarray(one.noise(dt), dtype=float)):
        raise UsageError(
            "information without a prior needs a motion without noise",
            why="noise wears information away, and how much depends on the prior",
            next_step="use ConstantVelocity(accel_mps2=0.0, dims=2)",
        )
    state = np.arange(1.0, len(motion.names) + 1.0)
    there_and_back = one.move(one.move(state, dt), -dt)
    if not np.allclose(there_and_back, state, rtol=1e-9, atol=1e-9):
        raise UsageError(
            f"{type(motion).__name__} cannot be run backwards",
            why="moving by -dt does not undo moving by dt",
        )


def _largest(name: str, value: Array, leaf: Any) -> Any:
    """A number at its largest over lanes and steps."""
    array = rate_of(name, value, leaf)[1]
    return np.max(array.reshape(-1, *leaf.shape), axis=0)
