"""The terminal: one object or one screen on standard output, everything else on standard error."""

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from boresight.errors import BoresightError
from boresight.interfaces.answers import Answer, plain

if TYPE_CHECKING:
    from rich.console import Console

NARROWEST, WIDEST = 60, 140


@dataclass(frozen=True)
class Watch:
    """What a long job tells as it goes: how much is done, or in words what it is at."""

    update: Callable[..., None]

    def count(self, done: float, total: float) -> None:
        """So much is done, of so much."""
        self.update(completed=done, total=total)

    def say(self, words: str) -> None:
        """This is what is done now."""
        self.update(description=words[:1].upper() + words[1:])


@dataclass(frozen=True, kw_only=True)
class Manner:
    """How this run was called, and how it speaks."""

    command: str = ""
    as_json: bool = False
    is_quiet: bool = False
    is_debug: bool = False


def show(answer: Answer, manner: Manner) -> None:
    """Print an answer: its object alone with `--json`, else its screen; remarks to the side."""
    if manner.as_json:
        write_object(answer.content)
    else:
        console = _console(sys.stdout)
        with console.capture() as screen:  # rich would end the program at a broken pipe
            for part in answer.screen(console.width):
                console.print(part, crop=False)
        sys.stdout.write(screen.get())
    sys.stdout.flush()  # a reader that has left is noticed here, before anything else is said
    if not manner.is_quiet:
        remark(answer.remarks)


def write_object(content: Mapping[str, Any]) -> None:
    """Print one JSON object: on one line for a program, indented for a person."""
    indent = 2 if sys.stdout.isatty() else None
    sys.stdout.write(json.dumps(plain(content), allow_nan=False, indent=indent) + "\n")


def remark(sentences: Iterable[str]) -> None:
    """Print sentences on standard error."""
    console = _console(sys.stderr)
    for sentence in sentences:
        console.print(f"remark: {sentence}", markup=False, highlight=False, style="dim")


def complain(error: BoresightError, manner: Manner) -> None:
    """Print an error on standard error, and with `--json` as the one object on standard output."""
    sys.stderr.write(f"error: {error}\n")
    if manner.as_json:
        parts: dict[str, Any] = {"what": error.what, "where": error.where, "why": error.why}
        parts |= {"next_step": error.next_step, "exit_code": error.exit_code}
        write_object({"error": parts | error.details})


@contextmanager
def progress(title: str, manner: Manner) -> Iterator[Watch]:
    """Show a bar on standard error while a job runs, if a person sees it; gone when it ends."""
    if manner.is_quiet or not sys.stderr.isatty():
        yield Watch(lambda **_: None)
        return
    from rich import progress as bars

    columns = (
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        bars.TaskProgressColumn(),
        bars.TimeRemainingColumn(),
    )
    with bars.Progress(*columns, console=_console(sys.stderr), transient=True) as display:
        task = display.add_task(title, total=None)
        yield Watch(partial(display.update, task))


def _console(stream: Any) -> "Console":
    """Return a console of a readable width; rich itself obeys NO_COLOR."""
    from rich.console import Console

    console = Console(file=stream, highlight=False, soft_wrap=False, emoji=False)
    wanted = console.width if stream.isatty() or "COLUMNS" in os.environ else 100
    console.width = min(max(wanted, NARROWEST), WIDEST)
    return console
