"""The numbers in a stream's models: its own, and those of its sensor where that has moved."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.lanes import Leaf, Rate
from boresight.models.parameters import numbers, rate_of, structure
from boresight.models.sensors import Sensor

Array = Any


def rated(models: Mapping[str, tuple[Any, Leaf]], lanes: int) -> dict[str, tuple[Rate, Array]]:
    """How often each number of models changes, and its value: of all targets, or a row for each.

    Raises:
        UsageError: it changes from step to step, or is for another number of targets.
    """
    found = {name: rate_of(name, *pair) for name, pair in models.items()}
    for name, (rate, value) in found.items():
        if rate & Rate.STEP:
            raise UsageError(
                f"{name} changes from step to step; a stream needs one value",
                next_step="give that of the first plot, and each later one with its plot: "
                "step(state, plot, dt, sensor=...)",
            )
        if rate is Rate.LANE and len(value) != lanes:
            raise UsageError(f"{name} is for {len(value)} targets, and the stream for {lanes}")
    return found


def moved(
    sensor: Sensor, own: tuple[Any, ...], kept: Mapping[str, Array], lanes: int
) -> dict[str, Array]:
    """What a kernel reads of a sensor that has moved, in the shapes of the stream's own numbers.

    Args:
        sensor: as it is now.
        own: `structure` of the stream's.
        kept: the stream's numbers, by the names of its kernel's inputs.
        lanes: how many targets.

    Raises:
        UsageError: the sensor has another structure, or a number for each target where one was.
    """
    now = structure(sensor)
    if now != own:
        raise _another(_difference(now, own))
    found = {}
    for name, (_, value) in rated(numbers(sensor, "sensor"), lanes).items():
        if name not in kept:  # the formula has no use for it
            continue
        shape = kept[name].shape
        if value.ndim > len(shape):
            raise _another(f"in {name}, which was one number for all targets")
        found[name] = np.asarray(np.broadcast_to(value, shape), order="C")
    return found


def _difference(now: tuple[Any, ...], own: tuple[Any, ...]) -> str:
    (kind, *theirs), (own_kind, *ours) = now, own
    if kind != own_kind:
        return f"in kind: it is a {kind}, the stream's a {own_kind}"
    name: str = next(new[0] for new, old in zip(theirs, ours, strict=True) if new != old)
    return f"in its {name}"


def _another(difference: str) -> UsageError:
    return UsageError(
        f"the sensor is not the stream's: it differs {difference}",
        why="a stream's formula is fixed; from plot to plot only the numbers in it may change",
        next_step="begin the stream with a sensor that has all that a later one has",
    )
