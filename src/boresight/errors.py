"""What can go wrong, as one tree; and the status a lane carries when it cannot raise.

    BoresightError
    ├── UsageError         the call is wrong                       exit 2
    ├── DataError          the data are wrong                      exit 65
    ├── MissingInputError  the file is not there or not readable   exit 66
    ├── MissingExtraError  an optional package is not installed    exit 69
    ├── OutputError        the result cannot be written            exit 74
    └── FormulaError       a formula cannot be recorded (lanes)    exit 2

Every error says what, where, why and what to do next, in that order. A lane of a compiled kernel
cannot raise: it carries a `Status`, and whoever reads the lane turns it into a sentence.
"""

from collections.abc import Iterable
from enum import IntEnum
from typing import Any


class BoresightError(Exception):
    """Base of every error boresight raises on purpose.

    Args:
        what: one sentence, no full stop needed, that names the wrong thing and its value.
        where: byte offset, record, row, line or column; empty if there is no place.
        why: the reason, where it is not obvious from `what`.
        next_step: the command or change to try next.
    """

    exit_code = 1

    def __init__(self, what: str, *, where: str = "", why: str = "", next_step: str = "") -> None:
        self.what, self.where, self.why, self.next_step = what, where, why, next_step
        super().__init__(str(self))

    def __str__(self) -> str:
        """Render the parts that are there, one a line."""
        parts = [self.what]
        for label, text in (("at", self.where), ("why", self.why), ("next", self.next_step)):
            if text:
                parts.append(f"  {label + ':':<6}{text}")
        return "\n".join(parts)

    @property
    def details(self) -> dict[str, Any]:
        """What an error has to say to programs beside its parts."""
        return {}

    def __reduce__(self) -> tuple[object, ...]:
        """Keep the parts when the error crosses a process boundary."""
        return _rebuild, (type(self), self.what, self.where, self.why, self.next_step)


def _rebuild(
    kind: type[BoresightError], what: str, where: str, why: str, next_step: str
) -> BoresightError:
    return kind(what, where=where, why=why, next_step=next_step)


class UsageError(BoresightError):
    """The call is wrong: an unknown name, a shape that does not fit, an option that contradicts."""

    exit_code = 2


class FormulaError(BoresightError):
    """A formula does something that cannot be recorded; the message names file, line and cure."""

    exit_code = 2


class DataError(BoresightError):
    """The data are wrong: not the format, damaged, out of range."""

    exit_code = 65


class MissingInputError(BoresightError):
    """The input is not there, or cannot be read."""

    exit_code = 66


class MissingExtraError(BoresightError):
    """An optional package is needed and not installed; the message has the exact `pip install`."""

    exit_code = 69


class OutputError(BoresightError):
    """The result cannot be written."""

    exit_code = 74


def unknown(kind: str, name: object, known: Iterable[str]) -> UsageError:
    """The error for a name that nothing of its kind has, with the nearest one that exists."""
    from difflib import get_close_matches

    names = [*known]
    near = get_close_matches(str(name).lower(), names, n=1)
    return UsageError(
        f"there is no {kind} {name!r}" + (f"; did you mean {near[0]!r}?" if near else ""),
        next_step=f"use one of {', '.join(names)}",
    )


class Status(IntEnum):
    """What became of a lane (a run, a track, a cell). `sentence` is what the user reads."""

    OK = 0
    NOT_FINITE = 1
    NOT_POSITIVE = 2
    NOT_STARTED = 3

    @property
    def sentence(self) -> str:
        """One sentence for the user."""
        return _SENTENCES[self]


_SENTENCES = {
    Status.OK: "every step was computed.",
    Status.NOT_FINITE: "the state stopped being a finite number.",
    Status.NOT_POSITIVE: "the covariance stopped being positive definite.",
    Status.NOT_STARTED: "no plot was complete enough to start from.",
}
