"""A mapping against the models of a study file: every mistake in words, and what is left.

What is wrong is mended or taken out and the rest is checked again, so that what comes after (is
there such a filter, can it follow that motion) is told in the same breath.
"""

import json
from collections.abc import Iterator, Mapping
from copy import deepcopy
from difflib import get_close_matches
from functools import partial
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ValidationError
from pydantic.fields import FieldInfo

from boresight.laboratory.mistakes import Mistake, dotted
from boresight.laboratory.quantities import Kind
from boresight.laboratory.study_models import StudyFile
from boresight.laboratory.toml_places import Path

_WORDS = {
    "int_type": "is not a whole number",
    "int_from_float": "is not a whole number",
    "float_type": "is not a number",
    "finite_number": "is not a finite number",
    "string_type": "is not text in quotes",
    "list_type": "is not a list in brackets",
    "tuple_type": "is not a list in brackets",
    "dict_type": "is not a table",
    "model_type": "is not a table",
}
_BOUNDS = {
    "greater_than": "must be above {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be below {lt:g}",
    "less_than_equal": "must be at most {le:g}",
}
Place = tuple[str | int, ...]  # as pydantic has it, with the names of union members
_LONGEST = 40  # characters of a value that is quoted


def checked(raw: Mapping[str, Any]) -> tuple[StudyFile, list[Mistake]]:
    """A study file's content as models, what is wrong mended or left out; and what is wrong.

    Args:
        raw: as tomllib reads it.
    """
    mistakes: list[Mistake] = []
    left = deepcopy(dict(raw))
    mended: set[Place] = set()
    while True:
        try:
            return StudyFile.model_validate(left), mistakes
        except ValidationError as error:
            found = [(each, _path(each["loc"], left)) for each in error.errors()]
            if not mistakes:
                mistakes = [_mistake(each, path, left) for each, path in found]
            for each, path in found:
                if _path(path, left) == path:  # it was not taken out with another
                    _mend(left, each, path, mended)


def near(name: str, known: list[str]) -> str:
    """A hint for a name that is none of those known."""
    close = get_close_matches(name.lower(), known, n=1)
    return f"did you mean '{close[0]}'?" if close else f"there are: {', '.join(known)}"


def shown(value: Any) -> str:
    """A value as the file has it, cut if it is long."""
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _path(place: tuple[str | int, ...], raw: Any) -> Path:
    """The part of pydantic's place that the file has, without the names of union members."""
    path: Path = ()
    for part in place:
        is_there = part in raw if isinstance(raw, dict) else False
        if isinstance(raw, list) and isinstance(part, int):
            is_there = part < len(raw)
        if is_there:
            path, raw = (*path, part), raw[part]
    return path


def _mend(raw: dict[str, Any], error: Any, path: Path, mended: set[Place]) -> None:
    """Put an example where a quantity is wrong or missing; else take out what is wrong."""
    place = error["loc"]
    kind = _kind(_fields(place))
    is_element = error["type"] == "missing" and isinstance(place[-1], int)
    if kind is None or is_element or place in mended or error["type"] == "extra_forbidden":
        _prune(raw, path)
        return
    mended.add(place)
    path = (*path, place[-1]) if error["type"] == "missing" else path
    _at(raw, path[:-1])[path[-1]] = kind.example


def _prune(raw: dict[str, Any], path: Path) -> None:
    """Take out what is at the path: of lists the outermost, but a filter only by itself."""
    if len(path) == 2 and path[0] == "filter":
        raw["filter"][path[1]] = None
        return
    whole = next((i for i, part in enumerate(path) if isinstance(part, int)), len(path))
    path = path if path[:1] == ("filter",) else path[:whole]
    if path:
        del _at(raw, path[:-1])[path[-1]]
    else:
        raw.clear()


def _mistake(error: Any, path: Path, raw: Any) -> Mistake:
    """An error of pydantic in our words."""
    kind, context = error["type"], error.get("ctx", {})
    name, place = dotted(path), error["loc"]
    if kind == "extra_forbidden":
        known = [each for model in _models(place[:-1]) for each in model.model_fields]
        return Mistake(path, f"{name} is not a setting", near(str(path[-1]), known), at_key=True)
    if kind == "missing" and isinstance(place[-1], str):
        hint = f"give {place[-1]} = {json.dumps(_example(_fields(place)))}"
        return Mistake(path, f"{name} lacks {place[-1]}", hint, at_key=True)
    if kind == "union_tag_invalid":
        known = context["expected_tags"].replace("'", "").split(", ")
        return Mistake(
            (*path, "kind"),
            f"{name} has no kind {shown(context['tag'])}",
            near(context["tag"], known),
        )
    said = f"{name} = {shown(_at(raw, path))}"
    if kind == "missing":
        return Mistake(
            path, f"{said} has too few values", f"give {json.dumps(_example(_fields(place)))}"
        )
    if kind == "literal_error":
        known = [str(each) for each in _literals(context["expected"])]
        return Mistake(path, f"{said} is unknown", near(str(error["input"]), known))
    if kind == "value_error":
        what, hint = (*context["error"].args, "")[:2]
        return Mistake(path, f"{said} {what}", hint)
    if kind in {"too_short", "too_long"}:
        limit = context.get("min_length", context.get("max_length"))
        bound = "least" if kind == "too_short" else "most"
        return Mistake(
            path, f"{said} has {context['actual_length']} values", f"give at {bound} {limit}"
        )
    if kind in _WORDS:
        return Mistake(path, f"{said} {_WORDS[kind]}")
    if kind in _BOUNDS:
        return Mistake(path, f"{said} {_BOUNDS[kind].format(**context)}")
    return Mistake(path, f"{said} {error['msg'].replace('Input should', 'must')}")


def _at(raw: Any, path: Path) -> Any:
    for part in path:
        raw = raw[part]
    return raw


def _literals(expected: str) -> list[str]:
    """The values of "'a', 'b' or 'c'"."""
    return [each.strip("' ") for each in expected.replace(" or ", ",").split(",")]


def _models(place: tuple[str | int, ...]) -> list[type[BaseModel]]:
    """The models that may stand at a place of the file."""
    found: list[type[BaseModel]] = [StudyFile]
    for part in place:
        tagged = [each for each in found if _tag(each) == part]
        inner = [m.model_fields[part].annotation for m in found if part in m.model_fields]
        if tagged or inner:
            found = tagged or [each for hint in inner for each in _inside(hint)]
    return found


def _tag(model: type[BaseModel]) -> Any:
    """What `kind` says of a member of a union."""
    hint: Any = model.model_fields["kind"].annotation if "kind" in model.model_fields else None
    return get_args(hint)[0] if get_origin(hint) is Literal and len(get_args(hint)) == 1 else None


def _inside(hint: Any) -> list[type[BaseModel]]:
    """The models inside a type."""
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        return [hint]
    return [model for each in get_args(hint) for model in _inside(each)]


def _fields(place: Place) -> list[FieldInfo]:
    """What the models say of a setting, or of the list in which the place is."""
    names = [part for part in place if not isinstance(part, int)]
    fields = [model.model_fields.get(names[-1]) for model in _models(tuple(names[:-1]))]
    return [field for field in fields if field]


def _example(fields: list[FieldInfo]) -> Any:
    """What a setting that is missing may be."""
    told = [each for field in fields for each in field.examples or ()]
    kind = _kind(fields)
    return told[0] if told else kind.example if kind else "..."


def _kind(fields: list[FieldInfo]) -> Kind | None:
    """The kind of quantity that a setting is, or is a list of."""
    hints = [hint for each in fields for hint in (*each.metadata, each.annotation)]
    return next((kind for hint in hints for kind in _kinds(hint)), None)


def _kinds(hint: Any) -> Iterator[Kind]:
    """The kinds of quantity inside a type that is no table."""
    if isinstance(hint, BeforeValidator) and isinstance(hint.func, partial):
        yield hint.func.keywords["kind"]
    for each in get_args(hint):
        yield from _kinds(each)
