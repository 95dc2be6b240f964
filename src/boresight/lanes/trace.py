"""Symbols: what NumPy does to them is recorded as a straight-line program.

NumPy on an object array calls the elements' own operators and methods (`sqrt`, `arctan2`, ...), so
a formula written for floats runs unchanged on symbols and leaves behind the list of its operations.
What cannot be recorded, such as a branch on a value, raises `FormulaError` with file and line.

Structural zeros are folded: `0 * x` is 0 even where x might be NaN or infinite. Without that a
six-state filter has twice the operations; with it, a formula must not rely on `0 * nan`.
"""

import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.lanes.philox import philox
from boresight.lanes.refusals import forbid, refuse

# Operations that only a boolean results from; everything else is a float.
COMPARISONS = frozenset({"lt", "le", "isnan", "and", "or", "not"})
_LOGIC = frozenset({"and", "or", "not"})  # of conditions; the other comparisons are of numbers
_COMMUTE = frozenset({"add", "mul", "and", "or"})
_ARITHMETIC = frozenset({"add", "sub", "mul", "div"})
_UNITS = (1.0, -1.0)
FOLD: dict[str, Callable[..., Any]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "scale": np.multiply,
    "neg": np.negative,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "expm1": np.expm1,
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
    "philox0": lambda *words: philox(*words)[0],
    "philox1": lambda *words: philox(*words)[1],
}


class Graph:
    """The operations of one trace, each recorded once (equal operations are shared)."""

    def __init__(self) -> None:
        self.nodes: list[tuple[str, tuple[Any, ...]]] = []
        self.values: list[float | None] = []  # of each node that is a constant
        self._known: dict[tuple[str, tuple[Any, ...]], int] = {}

    def constant(self, value: float) -> "Symbol":
        """A constant, told from others by its bit pattern (0.0 is not -0.0)."""
        return self.intern("const", (struct.pack("<d", value),))

    def input(self, name: str, element: int) -> "Symbol":
        """Element `element` of the declared input `name`."""
        return self.intern("input", (name, element))

    def lift(self, value: Any) -> "Symbol | None":
        """`value` as a symbol of this trace; None if it is no number (an array, a dual number)."""
        if isinstance(value, Symbol):
            if value.graph is not self:
                refuse("it mixes symbols of two traces", "pass the value in as a declared input")
            return value
        if isinstance(value, int | float | np.floating | np.integer):
            return self.constant(float(value))
        return None

    def apply(self, op: str, *args: "Symbol") -> "Symbol":
        """Record `op` on `args`, folding what is known now."""
        self._check(op, args)
        simpler = self._simplify(op, args)
        if simpler is not None:
            return simpler
        numbers = tuple([a.index for a in args])
        if op in _COMMUTE and numbers[0] > numbers[1]:
            numbers = numbers[::-1]
        return self.intern(op, numbers)

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
            self.values.append(struct.unpack("<d", args[0])[0] if op == "const" else None)
        return Symbol(self, index)

    def _check(self, op: str, args: tuple["Symbol", ...]) -> None:
        """Conditions and numbers are different things: a compiled kernel cannot mix them."""
        for position, argument in enumerate(args):
            is_condition = self.nodes[argument.index][0] in COMPARISONS
            if is_condition is (op in _LOGIC or (op == "select" and position == 0)):
                continue
            if is_condition:
                refuse("it calculates with a condition", "use select(condition, 1.0, 0.0)")
            refuse("it takes a number for a condition", "compare it first, as in x < 0.0")

    def _simplify(self, op: str, args: tuple["Symbol", ...]) -> "Symbol | None":
        if op in _ARITHMETIC:
            x, y = args
            u, v = self.values[x.index], self.values[y.index]
            if u is None or v is None:
                return None if u is v else self._identity(op, x, y, u, v)
            return self._fold(op, [u, v])
        if op == "select":
            return args[1] if args[1].index == args[2].index else None
        if op in COMPARISONS:
            return None
        if op == "neg" and self.nodes[args[0].index][0] == "neg":
            return Symbol(self, self.nodes[args[0].index][1][0])
        if op == "exp" and self.nodes[args[0].index][0] == "select":
            return self._exp_of_select(*self.nodes[args[0].index][1])
        values = [self.values[a.index] for a in args]
        return None if None in values else self._fold(op, values)

    def _exp_of_select(self, condition: int, a: int, b: int) -> "Symbol | None":
        """Of a number and a constant: the number's own exponential is often there already."""
        if self.values[a] is None and self.values[b] is None:
            return None
        both = [self.apply("exp", Symbol(self, i)) for i in (a, b)]
        return self.apply("select", Symbol(self, condition), *both)

    def _fold(self, op: str, values: list[float | None]) -> "Symbol":
        with np.errstate(all="ignore"):
            return self.constant(float(FOLD[op](*map(np.float64, values))))

    def _identity(
        self, op: str, x: "Symbol", y: "Symbol", u: float | None, v: float | None
    ) -> "Symbol | None":
        """Zeros and ones that are there by structure. Never reassociates, never `x - x -> 0`."""
        if op == "add":
            return y if u == 0 else x if v == 0 else None
        if op == "sub":
            return x if v == 0 else -y if u == 0 else None
        if op == "mul" and (u == 0 or v == 0):
            return self.constant(0.0)
        if op == "mul" and u in _UNITS:
            return y if u == 1 else -y
        if op == "div" and u == 0:
            return self.constant(0.0)
        if op in ("mul", "div") and v in _UNITS:
            return x if v == 1 else -x
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
        return self.graph.lift(other)

    def _lifted(self, other: Any, name: str) -> "Symbol":
        symbol = self.lift(other)
        if symbol is None:
            refuse(f"np.{name} with {type(other).__name__}", "pass floats or recorded numbers")
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
    sqrt, log = _function("sqrt"), _function("log")
    exp, expm1 = _function("exp"), _function("expm1")
    sin, cos = _function("sin"), _function("cos")
    rint, floor, fabs = _function("rint"), _function("floor"), _function("abs")
    isnan, __floor__ = _function("isnan"), _function("floor")

    def __pos__(self) -> "Symbol":
        return self

    def conjugate(self) -> "Symbol":
        """A real number is its own conjugate (NumPy's inner products ask)."""
        return self

    def arctan2(self, x: Any) -> Any:
        """Angle of the point (x, self), radians in (-pi, pi]."""
        if hasattr(x, "slopes"):  # beside a dual number this one is a constant
            return type(x)(self, {}).arctan2(x)
        return self.graph.apply("arctan2", self, self._lifted(x, "arctan2"))

    def copysign(self, sign: Any) -> "Symbol":
        """Magnitude of this number with the sign of `sign`."""
        return self.graph.apply("copysign", self, self._lifted(sign, "copysign"))

    def hypot(self, other: Any) -> Any:
        """Root of the sum of squares, unscaled: exact for magnitudes between 1e-150 and 1e150."""
        other = other if hasattr(other, "slopes") else self._lifted(other, "hypot")
        return (self * self + other * other).sqrt()

    def __pow__(self, power: Any) -> Any:
        return recorded_power(self, power)

    def __repr__(self) -> str:
        value = self.graph.values[self.index]
        return f"<number %{self.index}>" if value is None else f"<constant {value!r}>"


def recorded_power(base: Any, power: Any) -> Any:
    """`base ** power` for whole powers and the square root; refuses all others."""
    if isinstance(power, int | np.integer) or (isinstance(power, float) and power.is_integer()):
        return integer_power(base, int(power))
    if isinstance(power, float) and power == 0.5:
        return base.sqrt()
    return refuse(f"power {power!r}", "write it with sqrt, exp and log")


def integer_power(base: Any, power: int) -> Any:
    """`base ** power` by squaring, for floats, symbols and dual numbers alike."""
    if power < 0:
        return 1.0 / integer_power(base, -power)
    if power == 0:
        return base * 0.0 + 1.0
    half = integer_power(base, power // 2) if power > 1 else None
    square = base if half is None else half * half
    return square * base if half is not None and power % 2 else square


forbid(Symbol)
