"""What is wrong with a study file, everything at once: each with its line, a caret and a hint."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

from boresight.errors import BoresightError, UsageError
from boresight.laboratory.toml_places import Path, Place, Span, line_and_column, places

Made = TypeVar("Made")
_WIDEST = 100  # characters of a quoted line


class Mistake(NamedTuple):
    """One thing that is wrong.

    Attributes:
        path: of the setting, such as ("filter", 0, "name").
        what: the whole sentence, without a full stop.
        hint: what to do, or the nearest valid name.
        at_key: whether it is the name that is wrong, not the value.
    """

    path: Path
    what: str
    hint: str = ""
    at_key: bool = False


class Told(NamedTuple):
    """A mistake and where it stands: line and column from 1, or 0 where there is no text."""

    mistake: Mistake
    span: Span | None
    line: int
    column: int


class StudyError(UsageError):
    """A study with mistakes; `details` has them for `--json`."""

    def __init__(self, name: str, text: str, mistakes: Iterable[Mistake]) -> None:
        """Find the mistakes in the text.

        Args:
            name: of the file.
            text: its content; empty for a study that was given as a mapping.
            mistakes: in any order; the same is told once.
        """
        self.name, self.text, self.mistakes = name, text, tuple(dict.fromkeys(mistakes))
        spots = _places(text)
        told = [_told(each, text, spots) for each in self.mistakes]
        self.told = sorted(told, key=lambda each: (each.line, each.column))
        count = len(told)
        super().__init__(
            f"{name} has {count} mistakes" if count > 1 else f"{name} has a mistake",
            next_step=f"correct {'them' if count > 1 else 'it'}, and run the same command again",
        )

    def __str__(self) -> str:
        """The count, then each mistake with its line."""
        shown = (_shown(each, self.name, self.text) for each in self.told)
        return "\n".join([self.what, *shown, f"  next: {self.next_step}"])

    @property
    def details(self) -> dict[str, Any]:
        """Every mistake as plain data."""
        return {
            "mistakes": [
                {
                    "line": each.line or None,
                    "column": each.column or None,
                    "setting": dotted(each.mistake.path),
                    "what": each.mistake.what,
                    "hint": each.mistake.hint,
                }
                for each in self.told
            ]
        }

    def __reduce__(self) -> tuple[object, ...]:
        """Keep the mistakes when the error crosses a process boundary."""
        return type(self), (self.name, self.text, self.mistakes)


def dotted(path: Path) -> str:
    """A path as users say it: filter[0].name."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.lstrip(".")


def _places(text: str) -> dict[Path, Place]:
    return places(text) if text else {}


def _told(mistake: Mistake, text: str, spots: Mapping[Path, Place]) -> Told:
    """Where it is; what is not there at all is missing in the nearest table around it."""
    path = mistake.path
    while path and path not in spots:
        path = path[:-1]
    if not path:
        return Told(mistake, None, 0, 0)
    span = spots[path].key if mistake.at_key else spots[path].value
    return Told(mistake, span, *line_and_column(text, span.start))


def _shown(told: Told, name: str, text: str) -> str:
    """file:line:column: what; the line; a caret with the hint."""
    what, hint = told.mistake.what, told.mistake.hint
    if told.span is None:
        return f"{name}: {what}" + (f"\n  {hint}" if hint else "")
    line = text.split("\n")[told.line - 1]
    first = max(0, told.column - 1 - _WIDEST // 2) if len(line) > _WIDEST else 0
    shown = line[first : first + _WIDEST]
    start = told.column - 1 - first
    end = min(start + told.span.end - told.span.start, len(shown))
    blank = "".join(mark if mark == "\t" else " " for mark in shown[:start])
    margin = " " * len(str(told.line))
    return (
        f"{name}:{told.line}:{told.column}: {what}\n"
        f"  {told.line} | {shown}\n"
        f"  {margin} | {blank}{'^' * max(end - start, 1)} {hint}".rstrip()
    )


def attempt(mistakes: list[Mistake], path: Path, make: Callable[[], Made]) -> Made | None:
    """What is made, or None and a mistake at the path where it cannot be."""
    try:
        return make()
    except BoresightError as error:
        what, _, near = error.what.partition("; did you mean")
        hint = f"did you mean{near}" if near else error.next_step or error.why
        mistakes.append(Mistake(path, what, hint))
        return None
