"""What decides a study's numbers, line by line, and the one digest of the numbers themselves."""

import hashlib
import inspect
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from boresight.laboratory.result import Cell
from boresight.laboratory.study import Study

Array = Any
_ONLY_SAID = {  # what changes no number of a run
    "Study": {"name", "runs", "false_alarm"},
    "Setting": {"values"},
    "Contender": {"label"},
    "Scenario": {"source"},
    "Filter": {"summary", "paper"},
    "Outside": {"summary"},
}
_TIMES = {"ns_per_step"}
_WORDS = {"label", "values", "verdicts", "doubts"}


def processor() -> str:
    """The level that formulas are compiled for here, or `numpy`; it decides the last bits."""
    from boresight.lanes.simd import target

    goal = target()
    return goal.name if goal else "numpy"


def identity(study: Study) -> dict[str, str]:
    """What decides each run's numbers, as text by place, such as `settings[0].scenario.dt_s`.

    The number of runs is not among it: run 7 is the same whatever it is, so a study can go on.
    """
    lines = dict(_lines("", study))
    return {"boresight": version("boresight"), "processor": processor()} | lines


def _lines(place: str, value: Any) -> Iterator[tuple[str, str]]:
    """Each number, name and function below a value."""
    if isinstance(value, np.ndarray):
        yield place, f"{value.dtype} {value.shape} {_array(value)}"
    elif value is None or isinstance(
        value, str | bytes | bool | int | float | complex | np.generic
    ):
        yield place, repr(value)
    elif is_dataclass(value) and not isinstance(value, type):
        yield f"{place}.type".lstrip("."), _name(type(value))
        for each in fields(value):
            if each.name not in _ONLY_SAID.get(type(value).__name__, ()):
                yield from _lines(f"{place}.{each.name}".lstrip("."), getattr(value, each.name))
    elif isinstance(value, list | tuple):
        yield place, f"{len(value)} of them"
        for i, each in enumerate(value):
            yield from _lines(f"{place}[{i}]", each)
    elif isinstance(value, Mapping):
        for key in sorted(value, key=repr):
            yield from _lines(f"{place}[{key!r}]", value[key])
    elif isinstance(value, partial):
        yield from _lines(place, value.func)
        yield from _lines(f"{place}.arguments", (value.args, value.keywords))
    elif hasattr(inspect.unwrap(value) if callable(value) else value, "__qualname__"):
        yield from _function(place, inspect.unwrap(value))
    else:
        yield f"{place}.type", _name(type(value))
        yield from _lines(place, getattr(value, "__dict__", repr(value)))


def _function(place: str, value: Any) -> Iterator[tuple[str, str]]:
    """Name of a function or class; of one that is not ours also what it says and holds."""
    if value.__module__.split(".")[0] == "boresight":
        yield place, _name(value)
        return
    try:
        text = inspect.getsource(value).encode()
    except (OSError, TypeError):  # typed at a prompt, or compiled
        text = getattr(getattr(value, "__code__", None), "co_code", b"")
    yield place, f"{_name(value)} sha256:{hashlib.sha256(text).hexdigest()}"
    held = [cell.cell_contents for cell in getattr(value, "__closure__", None) or ()]
    for i, each in enumerate(held):
        if not callable(each):  # it may be the function itself
            yield from _lines(f"{place}.held[{i}]", each)


def _array(value: Array) -> str:
    """A short array in full, a long one by its digest."""
    text = repr(value.tolist())
    return text if value.size <= 36 else f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def _name(value: Any) -> str:
    return f"{value.__module__}.{value.__qualname__}"


def differences(ours: Mapping[str, str], theirs: Mapping[str, str]) -> list[str]:
    """Where two identities differ, a phrase each."""
    places = [p for p in (*ours, *(set(theirs) - set(ours))) if ours.get(p) != theirs.get(p)]
    return [f"{p} is {theirs.get(p, 'not')} there, {ours.get(p, 'not')} here" for p in places]


def digest(cells: Iterable[Cell]) -> str:
    """SHA-256 of all numbers of cells but times, in a form that no machine changes."""
    found = hashlib.sha256()
    for cell in cells:
        for each in fields(cell):
            if each.name not in _TIMES | _WORDS:
                for part in _canonical(each.name, getattr(cell, each.name)):
                    found.update(part)
    return found.hexdigest()


def _canonical(name: str, value: Any) -> Iterator[bytes]:
    """Names, shapes and little-endian doubles; every NaN alike."""
    if isinstance(value, Mapping):
        for key in sorted(value):
            yield from _canonical(f"{name}.{key}", value[key])
        return
    if isinstance(value, str):
        yield f"{name}={value};".encode()
        return
    array = np.array(value, dtype="<f8")
    array[np.isnan(array)] = np.nan
    yield f"{name}{array.shape}:".encode() + array.tobytes()
