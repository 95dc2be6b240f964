"""From what a study file says of filters to those who compete, tried for a step before they do."""

from dataclasses import replace
from functools import partial
from inspect import signature
from typing import Any

import numpy as np

from boresight import catalogue
from boresight.errors import BoresightError, UsageError
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import begin
from boresight.experiments.world import World
from boresight.filters.method import Filter, Outside
from boresight.laboratory.mistakes import Mistake, attempt, dotted
from boresight.laboratory.study import Contender
from boresight.laboratory.study_checks import near
from boresight.laboratory.study_models import FilterTable
from boresight.laboratory.study_sensors import COMPONENTS, motion_of
from boresight.laboratory.toml_places import Path
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, with_numbers
from boresight.models.sensors import Sensor

Array = Any


def contenders_of(
    tables: list[FilterTable | None], world: Scenario | None, mistakes: list[Mistake]
) -> tuple[Contender, ...]:
    """The filters with what they believe; those that cannot be made are left out and told.

    Args:
        tables: what the file says; None for what was wrong in itself.
        world: the scenario; None where it could not be made.
        mistakes: gets what is wrong.
    """
    _check_labels(tables, mistakes)
    if world is not None and attempt(mistakes, ("sensor",), partial(_start, world)) is None:
        world = None
    made = [
        _contender(table, ("filter", i), world, mistakes)
        for i, table in enumerate(tables)
        if table is not None
    ]
    return tuple(each for each in made if each is not None)


def settings_of(name: str) -> list[str]:
    """Names of a filter's own settings; none where there is no such filter."""
    found = attempt([], (), partial(catalogue.find, name))
    return _settings(found) if isinstance(found, Filter) else []


def _settings(found: Filter) -> list[str]:
    parameters = signature(found.formula).parameters.values()
    return [p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.name != "correct"]


def _check_labels(tables: list[FilterTable | None], mistakes: list[Mistake]) -> None:
    """No two filters are called the same."""
    seen = set()
    for i, table in enumerate(tables):
        label = None if table is None else table.label or table.name
        if label in seen:
            path = ("filter", i, "label" if table and table.label else "name")
            what = f"two filters are called '{label}'"
            mistakes.append(Mistake(path, what, 'give one of them a label = "..." of its own'))
        seen.add(label or object())


def _contender(
    table: FilterTable, path: Path, world: Scenario | None, mistakes: list[Mistake]
) -> Contender | None:
    before = len(mistakes)
    found = attempt(mistakes, (*path, "name"), partial(catalogue.find, table.name))
    if found is not None:
        found = _with_settings(found, table.model_extra or {}, path, mistakes)
    motion = None if world is None else world.motion
    if table.motion is not None:
        dims = 3 if motion is None else motion.dims
        motion = motion_of(table.motion, (*path, "motion"), motion, dims, mistakes)
    if world is not None and world.false_plots > 0 and table.gate is None:
        what = f"{dotted(path)} lacks a gate, and there are false plots"
        hint = "give gate = 16, a squared Mahalanobis distance"
        mistakes.append(Mistake((*path, "gate"), what, hint, at_key=True))
    if found is None or motion is None or world is None or len(mistakes) > before:
        return None
    sensor = believed(world.sensor, table.noise_scale)
    if isinstance(found, Filter):
        attempt(mistakes, path, partial(_try, found, motion, sensor, world))
    label = table.label or table.name
    return Contender(label=label, filter=found, motion=motion, sensor=sensor, gate=table.gate)


def _with_settings(
    found: Filter | Outside, given: dict[str, Any], path: Path, mistakes: list[Mistake]
) -> Filter | Outside:
    """The filter with its own settings, each that is wrong told."""
    known = _settings(found) if isinstance(found, Filter) else []
    for name, value in given.items():
        where = (*path, name)
        if name not in known:
            usual = [*known, *(each for each in FilterTable.model_fields if each != "name")]
            what = f"{dotted(where)} is not a setting of {found.name}"
            mistakes.append(Mistake(where, what, near(name, usual), at_key=True))
        elif isinstance(found, Filter):
            chosen = partial(found.with_settings, **{name: value})
            found = attempt(mistakes, where, chosen) or found
    return found


def believed(sensor: Any, noise_scale: float) -> Any:
    """The sensor with every noise variance multiplied."""
    if noise_scale == 1.0:
        return sensor
    given = {name: getattr(sensor, name) for name, _ in COMPONENTS.values()}
    root = np.sqrt(noise_scale)
    return replace(
        sensor, **{name: each * root for name, each in given.items() if each is not None}
    )


def _start(world: Scenario) -> tuple[World, Any]:
    """A world that can be simulated and started in; else an error that says what it lacks."""
    checked = World(world, world.sensor)
    with np.errstate(all="ignore"):
        try:
            return checked, _begun(world, world.motion, world.sensor)
        except UsageError as error:
            hint = 'measure more, or begin otherwise: [start] kind = "on bearing"'
            raise UsageError(error.what, next_step=hint) from None


def _begun(world: Scenario, motion: Motion, sensor: Sensor) -> Any:
    z = np.broadcast_to(_exact(world), (1, max(world.spent, 1), len(sensor.names)))
    return begin(world, motion, sensor, z, np.zeros((1, len(world.motion.names))))


def _exact(world: Scenario) -> Array:
    """(k,) what the sensor would measure of the scenario's first state without noise."""
    first = _first(world.sensor, "sensor")
    return np.array([each.value(world.initial) for each in first.components(world.motion)])


def _first(model: Any, prefix: str) -> Any:
    """A model with its numbers of the first lane and step."""
    found = numbers(model, prefix).items()
    values = {name: np.reshape(value, (-1, *leaf.shape))[0] for name, (value, leaf) in found}
    return with_numbers(model, prefix, values)


def _try(found: Filter, motion: Motion, sensor: Sensor, world: Scenario) -> bool:
    """One step of the filter on floats: what it cannot follow, it says."""
    n = len(motion.names)
    if world.begin in ("given", "random draw") and n != len(world.motion.names):
        raise UsageError(
            f"the scenario begins with {', '.join(world.motion.names)}, and the filter's motion "
            f"has {', '.join(motion.names)}",
            next_step='begin otherwise: [start] kind = "one plot"',
        )
    with np.errstate(all="ignore"):
        mean, cov = _begun(world, motion, sensor)
        try:
            recursion = found.recursion(_first(motion, "motion"), _first(sensor, "sensor"))
            recursion.method.layout(motion, sensor)  # which says what it is not made for
            state = recursion.begin(np.reshape(mean, (-1, n))[0], np.reshape(cov, (-1, n, n))[0])
            inputs = {name: value for name, (value, _) in recursion.models().items()}
            recursion.step(state, inputs | {"z": _exact(world), "dt": world.dt_s})
        except (BoresightError, ArithmeticError) as error:
            if isinstance(error, BoresightError):  # floats may overflow where lanes carry on
                raise
        except Exception as error:  # a user's own filter may raise anything
            raise UsageError(
                f"{found.name} fails at its first step: {type(error).__name__}: {error}",
                next_step="run it by itself: bs.run(...)",
            ) from error
    return True
