"""The numbers inside a model, taken out and put back: how a model becomes input of a kernel.

A model is a frozen dataclass. Its float fields are numbers a kernel reads when it runs; everything
else (dimensions, names, switches) is structure, fixed when the formula is recorded. So one kernel
serves every noise level, and a noise may differ from lane to lane or from step to step.
"""

from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from boresight.errors import UsageError
from boresight.lanes import Leaf, Rate

Model = TypeVar("Model")


def _is_number(value: Any) -> bool:
    return isinstance(value, float | np.floating | np.ndarray)


def numbers(model: Any, prefix: str) -> dict[str, tuple[Any, Leaf]]:
    """Every number of a model by dotted name, with the leaf it is for one target."""
    found: dict[str, tuple[Any, Leaf]] = {}
    for field in fields(model):
        value, name = getattr(model, field.name), f"{prefix}.{field.name}"
        if is_dataclass(value):
            found |= numbers(value, name)
        elif _is_number(value):
            found[name] = (value, Leaf(_shape(field, value)))
    return found


def _shape(field: Any, value: Any) -> tuple[int, ...]:
    """What one target needs: as declared, or the last so many axes of what was given."""
    if "trailing" in field.metadata:
        return tuple(np.shape(value)[-field.metadata["trailing"] :])
    return tuple(field.metadata.get("shape", ()))


def with_numbers(model: Model, prefix: str, values: dict[str, Any]) -> Model:
    """The model with its numbers replaced (by symbols, when a formula is recorded)."""
    changed = object.__new__(type(model))  # the model was checked when it was made by its user
    for field in fields(model):  # type: ignore[arg-type]
        value, name = getattr(model, field.name), f"{prefix}.{field.name}"
        if is_dataclass(value):
            value = with_numbers(value, name, values)
        object.__setattr__(changed, field.name, values.get(name, value))
    return changed


def structure(model: Any) -> tuple[Any, ...]:
    """What of a model is fixed when its formula is recorded; hashable, numbers left out."""
    parts: list[Any] = [type(model).__qualname__]
    for field in fields(model):
        value = getattr(model, field.name)
        if is_dataclass(value):
            value = structure(value)
        elif _is_number(value):
            value = ("number", _shape(field, value))
        parts.append((field.name, value))
    return tuple(parts)


def rate_of(name: str, value: Any, leaf: Leaf) -> tuple[Rate, Any]:
    """How often a number changes, read off its leading axes, and the number in that rate's shape.

    Args:
        name: for the error message.
        value: (*shape) fixed; (lanes, *shape) per lane; (lanes or 1, steps or 1, *shape) both.
        leaf: what it is for one target.
    """
    array = np.asarray(value, dtype=float)
    lead = array.ndim - len(leaf.shape)
    if lead == 0:
        return Rate.FIXED, array
    if lead == 1:
        return Rate.LANE, array
    if lead != 2:
        raise UsageError(
            f"{name} has shape {array.shape}; one target needs {leaf.shape}",
            next_step="put lanes first and steps second, each with length 1 where it is constant",
        )
    lanes, steps = array.shape[:2]
    if lanes == 1:
        return (Rate.FIXED, array[0, 0]) if steps == 1 else (Rate.STEP, array[0])
    return (Rate.LANE, array[:, 0]) if steps == 1 else (Rate.EACH, array)
