"""Symbols: what NumPy does to them is recorded as a straight-line program.

NumPy on an object array calls the elements' own operators and methods (`sqrt`, `arctan2`, ...), so
a formula written for floats runs unchanged on symbols and leaves behind the list of its operations.
What cannot be recorded, such as a branch on a value, raises `FormulaError` with file and line.

Structural zeros are folded: `0 * x` is 0 even where x might be NaN or infinite. Without that a
six-state filter has twice the operations; with it, a formula must not rely on `0 * nan`.
"""

import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from boresight.errors import FormulaError

# Operations that only a boolean results from; everything else is a float.
COMPARISONS = frozenset({"lt", "le", "isnan", "and", "or", "not"})
_HERE = str(Path(__file__).parent)
_NUMPY = str(Path(np.__file__).parent)

FOLD: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "arctan2": np.arctan2,
    "rint": np.rint,
    "floor": np.floor,
    "copysign": np.copysign,
    "lt": np.less,
    "le": np.less_equal,
    "isnan": np.isnan,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    "select": np.where,
    "pow2": np.exp2,
    "exponent": lambda x: np.frexp(x)[1] - 1.0,
    "mantissa": lambda x: np.frexp(x)[0] * 2.0,
}


def _place() -> str:
    """File and line of the formula: the innermost frame outside this folder and NumPy."""
    frame = sys._getframe(1)  # noqa: SLF001 - the only way to name the caller's line cheaply
    while frame.f_back and frame.f_code.co_filename.startswith((_HERE, _NUMPY, "<")):
        frame = frame.f_back
    return f"{frame.f_code.co_filename}, line {frame.f_lineno}"


def _refuse(what: str, cure: str) -> NoReturn:
    raise FormulaError(
        f"a formula cannot be recorded: {what}",
        where=_place(),
        why="a recorded formula runs for many targets at once, so it cannot look at one value",
        next_step=cure,
    )


class Graph:
    """The operations of one trace, each recorded once (equal operations are shared)."""

    def __init__(self) -> None:
        self.nodes: list[tuple[str, tuple[Any, ...]]] = []
        self._known: dict[tuple[str, tuple[Any, ...]], int] = {}

    def constant(self, value: float) -> "Symbol":
        """A constant, told from others by its bit pattern (0.0 is not -0.0)."""
        return self.intern("const", (struct.pack("<d", float(value)),))

    def input(self, name: str, element: int) -> "Symbol":
        """Element `element` of the declared input `name`."""
        return self.intern("input", (name, element))

    def apply(self, op: str, *args: "Symbol") -> "Symbol":
        """Record `op` on `args`, folding what is known now."""
        simpler = self._simplify(op, args)
        if simpler is not None:
            return simpler
        numbers = tuple(a.index for a in args)
        if op in ("add", "mul", "and", "or"):
            numbers = tuple(sorted(numbers))
        return self.intern(op, numbers)

    def value(self, index: int) -> float | None:
        """The constant at `index`, or None."""
        op, args = self.nodes[index]
        return float(struct.unpack("<d", args[0])[0]) if op == "const" else None

    def is_bool(self, index: int) -> bool:
        """Whether node `index` is a condition."""
        return self.nodes[index][0] in COMPARISONS

    def intern(self, op: str, args: tuple[Any, ...]) -> "Symbol":
        """The node of this operation, recorded now if it is new."""
        key = (op, args)
        index = self._known.get(key)
        if index is None:
            index = self._known[key] = len(self.nodes)
            self.nodes.append(key)
        return Symbol(self, index)

    def _simplify(self, op: str, args: tuple["Symbol", ...]) -> "Symbol | None":
        values = [self.value(a.index) for a in args]
        if op == "select":
            if args[1].index == args[2].index:
                return args[1]
        elif op in ("and", "or", "not"):
            return None
        elif None not in values and op not in COMPARISONS:
            with np.errstate(all="ignore"):
                return self.constant(FOLD[op](*map(np.float64, values)))
        elif op == "neg" and self.nodes[args[0].index][0] == "neg":
            return Symbol(self, self.nodes[args[0].index][1][0])
        return self._identity(op, args, values)

    def _identity(
        self, op: str, args: tuple["Symbol", ...], values: list[float | None]
    ) -> "Symbol | None":
        """Zeros and ones that are there by structure. Never reassociates, never `x - x -> 0`."""
        if len(args) != 2:
            return None
        (x, y), (u, v) = args, values
        rules: dict[str, list[tuple[bool, Callable[[], Symbol]]]] = {
            "add": [(u == 0, lambda: y), (v == 0, lambda: x)],
            "sub": [(v == 0, lambda: x), (u == 0, lambda: -y)],
            "mul": [
                (u == 0 or v == 0, lambda: self.constant(0.0)),
                (u == 1, lambda: y),
                (v == 1, lambda: x),
                (u == -1, lambda: -y),
                (v == -1, lambda: -x),
            ],
            "div": [
                (u == 0, lambda: self.constant(0.0)),
                (v == 1, lambda: x),
                (v == -1, lambda: -x),
            ],
        }
        for holds, result in rules.get(op, ()):
            if holds:
                return result()
        return None


def _operator(op: str) -> Callable[[Any, Any], Any]:
    def apply(self: "Symbol", other: Any) -> Any:
        other = self.lift(other)
        return NotImplemented if other is None else self.graph.apply(op, self, other)

    return apply


def _reflected(op: str) -> Callable[[Any, Any], Any]:
    def apply(self: "Symbol", other: Any) -> Any:
        other = self.lift(other)
        return NotImplemented if other is None else self.graph.apply(op, other, self)

    return apply


def _function(op: str) -> Callable[[Any], Any]:
    def apply(self: "Symbol") -> "Symbol":
        return self.graph.apply(op, self)

    return apply


class Symbol:
    """One number of a formula being recorded; an element of NumPy object arrays."""

    __slots__ = ("graph", "index")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, graph: Graph, index: int) -> None:
        self.graph, self.index = graph, index

    def lift(self, other: Any) -> "Symbol | None":
        """`other` as a symbol of this trace; None if NumPy should handle it (an array)."""
        if isinstance(other, Symbol):
            if other.graph is not self.graph:
                _refuse("it mixes symbols of two traces", "pass the value in as a declared input")
            return other
        if isinstance(other, int | float | np.floating | np.integer):
            return self.graph.constant(float(other))
        return None

    def _lifted(self, other: Any, name: str) -> "Symbol":
        symbol = self.lift(other)
        if symbol is None:
            _refuse(f"np.{name} with {type(other).__name__}", "pass floats or recorded numbers")
        return symbol

    __add__, __radd__ = _operator("add"), _reflected("add")
    __sub__, __rsub__ = _operator("sub"), _reflected("sub")
    __mul__, __rmul__ = _operator("mul"), _reflected("mul")
    __truediv__, __rtruediv__ = _operator("div"), _reflected("div")
    __lt__, __gt__ = _operator("lt"), _reflected("lt")
    __le__, __ge__ = _operator("le"), _reflected("le")
    __and__, __rand__ = _operator("and"), _reflected("and")
    __or__, __ror__ = _operator("or"), _reflected("or")
    __neg__, __abs__, __invert__ = _function("neg"), _function("abs"), _function("not")
    sqrt, exp, log = _function("sqrt"), _function("exp"), _function("log")
    sin, cos = _function("sin"), _function("cos")
    rint, floor, fabs = _function("rint"), _function("floor"), _function("abs")
    isnan, __floor__ = _function("isnan"), _function("floor")

    def __pos__(self) -> "Symbol":
        return self

    def conjugate(self) -> "Symbol":
        """A real number is its own conjugate (NumPy's inner products ask)."""
        return self

    def arctan2(self, x: Any) -> "Symbol":
        """Angle of the point (x, self), radians in (-pi, pi]."""
        return self.graph.apply("arctan2", self, self._lifted(x, "arctan2"))

    def copysign(self, sign: Any) -> "Symbol":
        """Magnitude of this number with the sign of `sign`."""
        return self.graph.apply("copysign", self, self._lifted(sign, "copysign"))

    def hypot(self, other: Any) -> Any:
        """Root of the sum of squares, unscaled: exact for magnitudes between 1e-150 and 1e150."""
        other = self._lifted(other, "hypot")
        return (self * self + other * other).sqrt()

    def __pow__(self, power: Any) -> Any:
        if isinstance(power, int | np.integer) or (isinstance(power, float) and power.is_integer()):
            return integer_power(self, int(power))
        if power == 0.5:
            return self.sqrt()
        return _refuse(f"power {power!r}", "write it with sqrt, exp and log")

    def __repr__(self) -> str:
        value = self.graph.value(self.index)
        return f"<number %{self.index}>" if value is None else f"<constant {value!r}>"


def integer_power(base: Any, power: int) -> Any:
    """`base ** power` by squaring, for floats, symbols and dual numbers alike."""
    if power < 0:
        return 1.0 / integer_power(base, -power)
    if power == 0:
        return base * 0.0 + 1.0
    half = integer_power(base, power // 2) if power > 1 else None
    square = base if half is None else half * half
    return square * base if half is not None and power % 2 else square


def _forbid(names: str, what: str, cure: str) -> None:
    for name in names.split():

        def refuse(self: Any, *args: Any, _name: str = name, **kwargs: Any) -> NoReturn:
            del self, args, kwargs
            _refuse(what.format(_name.strip("_")), cure)

        setattr(Symbol, name, refuse)


_forbid(
    "__bool__",
    "it branches on a value (if, and, or, min, max, np.where, sort, ...)",
    "use boresight.maths.select(condition, a, b)",
)
_forbid(
    "__float__ __int__ __index__ __complex__ __trunc__",
    "it turns a recorded number into a Python number ({}), as math.* and float arrays do",
    "use NumPy functions, and build arrays with np.array, np.block or np.eye(n) * x",
)
_forbid("__eq__ __ne__", "it compares for equality", "use <, <= and boresight.maths.select")
_forbid(
    "__mod__ __rmod__ __floordiv__ __rfloordiv__ __divmod__ __rdivmod__ __round__",
    "it uses {}",
    "use boresight.maths.wrap, or np.rint and np.floor",
)
_forbid("__rpow__", "it has a recorded number as exponent", "write it with np.exp and np.log")
_forbid(
    "__reduce__ __reduce_ex__ __copy__ __deepcopy__",
    "it copies or pickles a recorded number",
    "keep symbols inside the formula",
)
_forbid(
    "__iter__ __len__ __getitem__",
    "it treats a recorded number as a sequence",
    "declare the input as a Vector or Matrix",
)
_forbid(
    "tan arcsin arccos arctan sinh cosh tanh arcsinh arccosh arctanh log1p log2 log10 expm1 "
    "exp2 cbrt ceil __ceil__ trunc deg2rad rad2deg degrees radians",
    "np.{} has no recorded form",
    "write it with sqrt, exp, log, sin, cos, arctan2, rint and floor",
)


def located(error: BaseException) -> FormulaError:
    """A `FormulaError` for what NumPy itself raised on symbols, at the formula's own line."""
    place, step = "", error.__traceback__
    while step:
        name = step.tb_frame.f_code.co_filename
        if not name.startswith((_HERE, _NUMPY, "<")):
            place = f"{name}, line {step.tb_lineno}"
        step = step.tb_next
    return FormulaError(
        f"a formula cannot be recorded: {error}",
        where=place,
        why=f"NumPy raised {type(error).__name__} on recorded numbers",
        next_step="use +, -, *, /, @, sqrt, exp, log, sin, cos, arctan2 and boresight.maths",
    )
