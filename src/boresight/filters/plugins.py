"""Filters that other installed packages offer, by entry points of the group `boresight.filters`.

    [project.entry-points."boresight.filters"]
    my-ekf = "my_package.filters:MY_EKF"      # a bs.Filter, a bs.Outside or an update formula

A package is imported when its filter is asked for by name, and not before: a broken one harms
nobody else. A name that boresight has itself, or that two packages offer, stands for nothing of
theirs.
"""

import sys
import warnings
from collections.abc import Container
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from boresight.errors import UsageError
from boresight.filters.method import Filter, Outside

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "boresight.filters"


def offered(taken: Container[str]) -> "dict[str, tuple[EntryPoint, ...]]":
    """What installed packages offer, by name; with a warning where the name is taken."""
    found = _listed(tuple(sys.path))
    for name in [each for each in found if each in taken]:
        warnings.warn(
            f"the filter {name!r} of {_whose(found[name])} is not used: boresight has one of its "
            "own under that name",
            stacklevel=3,
        )
    return {name: points for name, points in found.items() if name not in taken}


@lru_cache(maxsize=4)
def _listed(path: tuple[str, ...]) -> "dict[str, tuple[EntryPoint, ...]]":
    """Entry points by name; a few milliseconds, so once for each search path."""
    from importlib.metadata import entry_points

    del path
    found: dict[str, tuple[EntryPoint, ...]] = {}
    for point in entry_points(group=GROUP):
        if point not in found.get(point.name, ()):  # a package may be met twice on the path
            found[point.name] = (*found.get(point.name, ()), point)
    return found


def _whose(points: "tuple[EntryPoint, ...]") -> str:
    return " and ".join(sorted({p.dist.name if p.dist else "an unnamed package" for p in points}))


def loaded(name: str, points: "tuple[EntryPoint, ...]") -> Filter | Outside:
    """The filter of that name.

    Raises:
        UsageError: two packages offer it, or what is offered cannot be loaded or is no filter; the
            package is named.
    """
    whose = _whose(points)
    if len(points) > 1:
        raise UsageError(
            f"the filter {name!r} is offered more than once",
            why=f"by {whose}",
            next_step="uninstall all but one of them, or pass the filter itself",
        )
    try:
        value = points[0].load()
    except Exception as error:
        raise UsageError(
            f"the filter {name!r} of the package {whose} cannot be loaded",
            where=points[0].value,
            why=f"{type(error).__name__}: {error}",
            next_step=f"repair or uninstall {whose}; every other filter works",
        ) from error
    return as_filter(value, name=name, origin=f"what the package {whose} offers as {name!r}")


def as_filter(value: Any, *, name: str = "", origin: str = "") -> Filter | Outside:
    """A filter as it is, or an update formula as one.

    Args:
        value: what a user gave.
        name: what it must be called; empty: as it calls itself.
        origin: whose it is, for the error; empty: the caller's own.

    Raises:
        UsageError: it is no filter, or is called something else.
    """
    if callable(value) and not isinstance(value, Filter | Outside | type):
        value = Filter(name=name or getattr(value, "__name__", "formula"), formula=value)
    if not isinstance(value, Filter | Outside):
        raise UsageError(
            f"{origin} is no filter" if origin else f"there is no filter {value!r}",
            why=f"it is a {type(value).__name__}",
            next_step="give a name, a bs.Filter, a bs.Outside or a function "
            "update(prior, z, components)",
        )
    if name and value.name != name:
        raise UsageError(
            f"{origin} calls itself {value.name!r}", next_step="give both the same name"
        )
    return value
