"""The command line: from what was typed to an answer, and what becomes of whatever goes wrong."""

import shlex
import sys
import traceback
from collections.abc import Sequence

from cyclopts import CycloptsError

from boresight.errors import BoresightError, UsageError
from boresight.interfaces import pages, terminal
from boresight.interfaces.commands import Job, app
from boresight.interfaces.terminal import Manner

__all__ = ["app", "run"]
FAULT = 70
FLAGS = {"--json": "as_json", "--quiet": "is_quiet", "--debug": "is_debug"}


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; only Ctrl-C and a broken pipe get out."""
    tokens, manner = _manner(arguments)
    try:
        job = _parse(tokens)
        answer = job(manner) if job else None
        if answer is not None:
            terminal.show(answer, manner)
        sys.stdout.flush()
    except (BrokenPipeError, KeyboardInterrupt):
        raise  # whoever called handles both, wherever they happen
    except Exception as error:  # noqa: BLE001 - a user is told of any fault, and of ours as ours
        return _fail(error, manner)
    return answer.exit_code if answer is not None else 0


def _manner(arguments: Sequence[str]) -> tuple[list[str], Manner]:
    """Part the options of every command, wherever they stand, from the command's own."""
    end = list(arguments).index("--") if "--" in arguments else len(arguments)
    given = {FLAGS[each]: True for each in arguments[:end] if each in FLAGS}
    rest = [each for each in arguments[:end] if each not in FLAGS]
    command = shlex.join(["boresight", *arguments])
    return [*rest, *arguments[end:]], Manner(command=command, **given)


def _parse(tokens: Sequence[str]) -> Job | None:
    """Return the job of a command line; None where cyclopts has printed a page of help."""
    try:
        job: Job | None = app(
            tokens, exit_on_error=False, print_error=False, result_action="return_value"
        )
    except CycloptsError as error:
        known = next((each for each in tokens if each in pages.COMMANDS), "")
        step = f"boresight {known} --help" if known else "boresight --help"
        raise UsageError(" ".join(str(error).split()), next_step=step) from None
    return job


def _fail(error: Exception, manner: Manner) -> int:
    """Tell the user what went wrong; return the exit code."""
    if manner.is_debug:
        traceback.print_exception(error)
    if not isinstance(error, BoresightError):
        error = FaultError(
            f"boresight failed by a fault of its own: {type(error).__name__}: {error}",
            next_step="run again with --debug and report what it prints",
        )
    terminal.complain(error, manner)
    return error.exit_code


class FaultError(BoresightError):
    """boresight itself is wrong."""

    exit_code = FAULT
