"""Refusals: what no formula may do raises `FormulaError` with the formula's file, line and cure.

A recorded formula runs for many targets at once, so it cannot look at one value. Two things are
not noticed, because they never touch a symbol: `np.nan_to_num` on recorded numbers gives them back
as they are, and `isinstance(x, float)` is False. Neither has a place in a formula.
"""

import os
import sys
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from boresight.errors import FormulaError

_INNER = (f"{Path(__file__).parent}{os.sep}", f"{Path(np.__file__).parent}{os.sep}", "<frozen")
_STDLIB = str(Path(os.__file__).parent)


def _is_inner(file: str) -> bool:
    """Whether a file is ours, NumPy's or Python's: not where the formula stands."""
    return file.startswith(_INNER) or os.path.dirname(file) == _STDLIB  # noqa: PTH120 - a string


def _place() -> str:
    """File and line of the formula: the innermost frame that is not ours, NumPy's or Python's."""
    frame = sys._getframe(1)  # noqa: SLF001 - the only way to name the caller's line cheaply
    while frame.f_back and _is_inner(frame.f_code.co_filename):
        frame = frame.f_back
    return f"{frame.f_code.co_filename}, line {frame.f_lineno}"


def refuse(what: str, cure: str) -> NoReturn:
    """Raise for what a formula did, at its own line."""
    raise FormulaError(
        f"a formula cannot be recorded: {what}",
        where=_place(),
        why="a recorded formula runs for many targets at once, so it cannot look at one value",
        next_step=cure,
    )


_FORBIDDEN = (
    (
        "__bool__",
        "it branches on a value (if, and, or, min, max, np.where, sort, ...)",
        "use boresight.maths.select(condition, a, b)",
    ),
    (
        "__float__ __int__ __index__ __complex__ __trunc__",
        "it turns a recorded number into a Python number ({}), as math.* and float arrays do",
        "use NumPy functions, and build arrays with np.array, np.block or np.eye(n) * x",
    ),
    ("__eq__ __ne__", "it compares for equality", "use <, <= and boresight.maths.select"),
    (
        "__mod__ __rmod__ __floordiv__ __rfloordiv__ __divmod__ __rdivmod__ __round__",
        "it uses {}",
        "use boresight.maths.wrap, or np.rint and np.floor",
    ),
    ("__rpow__", "it has a recorded number as exponent", "write it with np.exp and np.log"),
    (
        "__reduce__ __reduce_ex__ __copy__ __deepcopy__",
        "it copies or pickles a recorded number",
        "keep symbols inside the formula",
    ),
    (
        """tan arcsin arccos arctan sinh cosh tanh arcsinh arccosh arctanh log1p log2 log10 exp2
        cbrt ceil __ceil__ trunc deg2rad rad2deg degrees radians""",
        "np.{} has no recorded form",
        "write it with sqrt, exp, log, sin, cos, arctan2, rint and floor",
    ),
)


def forbid(kind: type) -> None:
    """Make a class of numbers raise `FormulaError` for all that cannot be recorded."""
    for names, what, cure in _FORBIDDEN:
        for name in names.split():

            def complain(
                self: Any,
                *args: Any,
                _what: str = what.format(name.strip("_")),
                _cure: str = cure,
                **kwargs: Any,
            ) -> NoReturn:
                del self, args, kwargs
                refuse(_what, _cure)

            setattr(kind, name, complain)


def located(error: BaseException) -> FormulaError:
    """A `FormulaError` for what NumPy itself raised on symbols, at the formula's own line."""
    place, step = "", error.__traceback__
    while step:
        name = step.tb_frame.f_code.co_filename
        if not _is_inner(name):
            place = f"{name}, line {step.tb_lineno}"
        step = step.tb_next
    return FormulaError(
        f"a formula cannot be recorded: {error}",
        where=place,
        why=f"NumPy raised {type(error).__name__} on recorded numbers",
        next_step="use +, -, *, /, @, sqrt, exp, log, sin, cos, arctan2 and boresight.maths",
    )
