"""What a command answers: one plain object for machines, one screen for people."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import RenderableType


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The result of a command.

    Attributes:
        content: the object that `--json` prints; see DESIGN, 'The command line', for its keys.
        screen: makes what a person sees, for this many columns; called only if one looks.
        remarks: sentences for standard error.
        exit_code: 0, or 1 where a stated check failed.
    """

    content: Mapping[str, Any]
    screen: "Callable[[int], Sequence[RenderableType]]"
    remarks: Sequence[str] = ()
    exit_code: int = 0


def plain(value: Any) -> Any:
    """Return `value` as JSON can hold it: NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(each) for each in value]
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if hasattr(value, "tolist"):  # NumPy's scalars and arrays
        return plain(value.tolist())
    return str(value.as_posix() if isinstance(value, Path) else value)
