"""What a user gives a model, checked when the model is made: is it what it stands for?"""

from typing import Any

import numpy as np

from boresight.errors import UsageError

Array = Any
_UNIT = 1e-6  # by which axes of a rotation that was typed or stored may miss right angles
_HALF_TURN_DEG = 180.0


def as_number(name: str, value: Any) -> Any:
    """The value as a float or an array of them; UsageError where it is neither."""
    try:
        given = np.asarray(value)
        array = given.astype(float, copy=False) if given.dtype.kind in "biuf" else None
    except ValueError:  # rows of different lengths
        array = None
    if array is None:
        raise UsageError(
            f"{name}={value!r} is not a number", next_step="give a number, or an array of them"
        )
    return array if array.ndim else float(array)


def standard_deviation(name: str, value: Any) -> Any:
    """The value as a float or an array; UsageError where it is not positive or of no use.

    Args:
        name: ends in `_deg` where it is an angle's.
        value: a number, or an array of them.
    """
    sigma = as_number(name, value)
    widest = _HALF_TURN_DEG if name.endswith("_deg") else np.finfo(float).max
    if not np.all((np.asarray(sigma) > 0) & (np.asarray(sigma) <= widest)):
        limit = f"positive and at most {widest:g}" if name.endswith("_deg") else "positive, finite"
        raise UsageError(
            f"{name}={value!r} is not a standard deviation",
            why=f"it must be {limit}",
            next_step=f"leave {name} out if the sensor does not measure it",
        )
    return sigma


def positive(name: str, value: Any) -> Any:
    """What must be positive and finite, as a float or an array."""
    number = as_number(name, value)
    if not np.all((np.asarray(number) > 0) & np.isfinite(number)):
        raise UsageError(f"{name}={value!r} is not positive and finite")
    return number


def not_negative(name: str, value: Any) -> Any:
    """A standard deviation that may be zero, as a float or an array."""
    number = as_number(name, value)
    if not np.all((np.asarray(number) >= 0) & np.isfinite(number)):
        raise UsageError(
            f"{name}={value!r} is not a standard deviation",
            why="it must be finite and not negative",
        )
    return number


def vector(name: str, value: Any) -> Array:
    """Three numbers, with or without leading axes, as an array (..., 3)."""
    array = np.asarray(as_number(name, value))
    if array.shape[-1:] != (3,) or not np.isfinite(array).all():
        raise UsageError(
            f"{name} of a pose is {_shown(array)}",
            why="it must be three finite numbers, also where the motion is planar",
        )
    return array


def rotation(value: Any) -> Array:
    """Axes (..., 3, 3) at right angles, of length 1 and right-handed."""
    array = np.asarray(as_number("rotation", value))
    square = array.shape[-2:] == (3, 3)
    if not (square and np.isfinite(array).all() and _is_rotation(array)):
        raise UsageError(
            f"rotation of a pose is {_shown(array)}",
            why="its rows must be three axes at right angles, of length 1 and right-handed",
            next_step="give the sensor's axes in the track frame, one a row",
        )
    return array


def _is_rotation(array: Array) -> bool:
    off = np.abs(array @ array.mT - np.eye(3)).max(initial=0.0)
    return bool(off <= _UNIT and np.all(np.linalg.det(array) > 0))


def _shown(array: Array) -> str:
    """Small arrays as they are, large ones by their shape."""
    return str(array.tolist()) if array.size <= 9 else f"of shape {array.shape}"
