"""A study's sweep: what each combination of swept values makes of the file."""

import json
from collections.abc import Iterator, Mapping
from copy import deepcopy
from itertools import pairwise, product
from math import prod
from typing import Any, NamedTuple

from boresight.laboratory.mistakes import Mistake
from boresight.laboratory.study_checks import near
from boresight.laboratory.study_filters import settings_of
from boresight.laboratory.study_models import FilterTable
from boresight.laboratory.toml_places import Path

_SWEPT = ("scenario", "sensor", "motion", "start", "filter")
_MOST = 1_000  # settings: a table of more is no table


class Axis(NamedTuple):
    """Something that is swept.

    Attributes:
        name: as the table calls it: sensor.azimuth.sigma.
        source: where in the file it stands.
        values: as the file has them.
    """

    name: str
    source: Path
    values: list[Any]


class Variant(NamedTuple):
    """The file with one combination of swept values.

    Attributes:
        values: what is swept and its value, as written.
        raw: the file's content.
        origins: where values come from that were put in, by where they were put.
    """

    values: tuple[tuple[str, str], ...]
    raw: dict[str, Any]
    origins: dict[Path, Path]

    def located(self, mistake: Mistake) -> Mistake:
        """The mistake where the file has it: of a swept value, in the sweep."""
        path = mistake.path
        for target, source in self.origins.items():
            if path[: len(target)] == target:
                return mistake._replace(path=source[:-1] if mistake.at_key else source)
            if mistake.at_key and path and target[: len(path)] == path:
                return mistake._replace(path=source[:-1])
        return mistake


def variants(raw: Mapping[str, Any], mistakes: list[Mistake]) -> list[Variant]:
    """The file with every combination of what its sweep says; itself where it has none.

    Args:
        raw: as tomllib reads it.
        mistakes: gets what is wrong with the sweep.
    """
    plain = _plain(raw)
    axes = list(_axes(plain.pop("sweep", {}), ("sweep",), mistakes))
    count = prod(len(axis.values) for axis in axes)
    if count > _MOST:
        what = f"the sweep has {count:,} combinations"
        mistakes.append(Mistake(("sweep",), what, f"at most {_MOST:,} can be run", at_key=True))
        axes = []
    places = product(*(range(len(axis.values)) for axis in axes))
    return [_variant(plain, axes, each) for each in places]


def _plain(raw: Mapping[str, Any]) -> dict[str, Any]:
    """A copy with tables where a name stands for one, so that more can be put in."""
    plain = deepcopy(dict(raw))
    if isinstance(plain.get("scenario"), str):
        plain["scenario"] = {"name": plain["scenario"]}
    filters = plain.get("filter")
    if isinstance(filters, str | dict):
        filters = [filters]
    if isinstance(filters, list):
        plain["filter"] = [{"name": each} if isinstance(each, str) else each for each in filters]
    return plain


def _axes(table: Any, path: Path, mistakes: list[Mistake]) -> Iterator[Axis]:
    """What is swept; "a.b" = [...] and a.b = [...] are the same."""
    if not isinstance(table, dict):
        mistakes.append(
            Mistake(path, "sweep is not a table", 'give [sweep] "sensor.range.sigma" = [...]')
        )
        return
    for key, value in table.items():
        source = (*path, key)
        name = ".".join(str(each) for each in source[1:])
        if isinstance(value, dict):
            yield from _axes(value, source, mistakes)
        elif not isinstance(value, list) or not value:
            mistakes.append(
                Mistake(source, f"the sweep of {name} has no values", "give a list: [..., ...]")
            )
        elif name.partition(".")[0] not in _SWEPT:
            hint = near(name.partition(".")[0], [*_SWEPT])
            mistakes.append(Mistake(source, f"{name} cannot be swept", hint, at_key=True))
        else:
            yield Axis(name, source, value)


def _variant(plain: dict[str, Any], axes: list[Axis], place: tuple[int, ...]) -> Variant:
    raw, origins, values = deepcopy(plain), {}, []
    for axis, i in zip(axes, place, strict=True):
        value = axis.values[i]
        values.append(
            (axis.name, value if isinstance(value, str) else json.dumps(value, default=str))
        )
        for target in _targets(tuple(axis.name.split(".")), raw):
            _put(raw, target, value)
            origins[target] = (*axis.source, i)
    return Variant(tuple(values), raw, origins)


def _targets(parts: Path, raw: dict[str, Any]) -> list[Path]:
    """Where a swept value goes: of filters, to the one that is named, or to all that know it."""
    filters = raw.get("filter")
    if parts[0] != "filter" or not isinstance(filters, list) or len(parts) < 2:
        return [parts]
    tables = [each if isinstance(each, dict) else {} for each in filters]
    named = [
        i for i, each in enumerate(tables) if parts[1] in (each.get("label"), each.get("name"))
    ]
    if named and len(parts) > 2:
        return [("filter", i, *parts[2:]) for i in named]
    usual = FilterTable.model_fields
    knowing = [
        i
        for i, each in enumerate(tables)
        if parts[1] in usual or parts[1] in settings_of(str(each.get("name")))
    ]
    return [("filter", i, *parts[1:]) for i in knowing or range(len(tables))]


def _put(raw: dict[str, Any], path: Path, value: Any) -> None:
    """Set what is at the path, tables made on the way; of lists there is that of filters."""
    inner: Any = raw
    for part, following in pairwise(path):
        found = inner.get(part) if isinstance(inner, dict) else inner[part]
        if not isinstance(found, list if isinstance(following, int) else dict):
            found = inner[part] = {}
        inner = found
    inner[path[-1]] = value
