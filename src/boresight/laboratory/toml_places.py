"""Where in a TOML text its keys and values are; tomllib reads them, but does not say where.

The text has been read by tomllib, so it is TOML, and little is left to find: a key ends at `=` or
`]`, and a value is text in quotes, something in brackets, or goes on to the next comma, bracket,
remark or end of line. Keys are read by tomllib itself.
"""

import re
import tomllib
from typing import Any, NamedTuple

Path = tuple[str | int, ...]
_GAP = re.compile(r"(?:[ \t\n]|#[^\n]*)*")
_QUOTED = r""" "(?:[^"\\\n]|\\.)*" | '[^'\n]*' """
_PART = re.compile(rf"[A-Za-z0-9_-]+ | {_QUOTED}", re.VERBOSE)
_KEY = re.compile(rf"(?:{_PART.pattern}) (?: [ \t]*\.[ \t]* (?:{_PART.pattern}) )*", re.VERBOSE)
_LONG = r""" \"{3} (?:[^\\]|\\.)*? \"{3,5} | '{3} .*? '{3,5} """
_BARE = r"[^,\]}\#\n]+"
_VALUE = re.compile(rf"{_LONG} | {_QUOTED} | {_BARE}", re.VERBOSE | re.DOTALL)


class Span(NamedTuple):
    """Characters [start, end) of a text."""

    start: int
    end: int


class Place(NamedTuple):
    """Where a key is, and its value; of a table, both are what names it."""

    key: Span
    value: Span


def places(text: str) -> dict[Path, Place]:
    """The place of every key, table and element of an array.

    Args:
        text: TOML that tomllib accepts, each line ending in a line feed.

    Returns:
        By path from the root, such as ("filter", 0, "name"). What is named more than once, as
        tables are by their headers and by dotted keys, is where it is named first.
    """
    return _Finder(text).found


def line_and_column(text: str, offset: int) -> tuple[int, int]:
    """Line and column of a character, both from 1."""
    before = text[:offset]
    return before.count("\n") + 1, offset - before.rfind("\n")


class _Finder:
    """Goes once through the text; `at` is the next character."""

    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0
        self.found: dict[Path, Place] = {}
        self.lengths: dict[Path, int] = {}  # of arrays of tables
        table: Path = ()
        self.skip()
        while self.at < len(text):
            table = self.header() if text[self.at] == "[" else self.pair(table)
            self.skip()

    def skip(self, marks: str = "") -> None:
        """Go on to what is neither blank nor a remark nor, once, one of these marks."""
        self.at = _match(_GAP, self.text, self.at).end()
        if marks and self.text[self.at] in marks:
            self.at = _match(_GAP, self.text, self.at + 1).end()

    def header(self) -> Path:
        """[table] or [[array of tables]]: the path of what follows it."""
        brackets = 2 if self.text.startswith("[[", self.at) else 1
        self.at += brackets
        self.skip()
        path: Path = ()
        for name, span in self.key():
            path += (name,)
            self.found.setdefault(path, Place(span, span))
            if path in self.lengths:
                path += (self.lengths[path] - 1,)
        if brackets == 2:
            path = self.appended(path, span)
        self.skip()
        self.at += brackets
        return path

    def appended(self, path: Path, span: Span) -> Path:
        """The path of the array's next table."""
        array = path[:-1] if isinstance(path[-1], int) else path
        number = self.lengths.get(array, 0)
        self.lengths[array] = number + 1
        self.found[(*array, number)] = Place(span, span)
        return (*array, number)

    def key(self) -> list[tuple[str, Span]]:
        """The parts of a dotted key."""
        whole = _match(_KEY, self.text, self.at)
        self.at = whole.end()
        spans = [part.span() for part in _PART.finditer(self.text, *whole.span())]
        names = _names(tomllib.loads(f"{whole.group()} = 0"))
        return [(name, Span(*span)) for name, span in zip(names, spans, strict=True)]

    def pair(self, table: Path) -> Path:
        """A key and its value; returns the table, which stays."""
        names = self.key()
        self.skip("=")
        path = table + tuple(name for name, _ in names)
        value = self.value(path)
        for i, (_, span) in enumerate(names[:-1]):
            self.found.setdefault(path[: len(table) + i + 1], Place(span, span))
        self.found[path] = Place(names[-1][1], value)
        return table

    def value(self, path: Path) -> Span:
        """Any value."""
        start = self.at
        if self.text[start] == "[":
            self.array(path)
        elif self.text[start] == "{":
            self.inline(path)
        else:
            text = _match(_VALUE, self.text, start).group().rstrip()
            self.at = start + len(text)
        return Span(start, self.at)

    def array(self, path: Path) -> None:
        """[value, value]."""
        self.at += 1
        self.skip()
        number = 0
        while self.text[self.at] != "]":
            span = self.value((*path, number))
            self.found[(*path, number)] = Place(span, span)
            self.skip(",")
            number += 1
        self.at += 1

    def inline(self, path: Path) -> None:
        """{key = value, key = value}."""
        self.at += 1
        self.skip()
        while self.text[self.at] != "}":
            self.pair(path)
            self.skip(",")
        self.at += 1


def _names(nested: dict[str, Any]) -> list[str]:
    """The keys of {"a": {"b": 0}}, outermost first."""
    ((name, inner),) = nested.items()
    return [name, *(_names(inner) if isinstance(inner, dict) else [])]


def _match(pattern: re.Pattern[str], text: str, at: int) -> re.Match[str]:
    found = pattern.match(text, at)
    if found is None:
        raise ValueError(f"not TOML at character {at}")
    return found
