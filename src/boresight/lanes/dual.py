"""Dual numbers: gradients of formulas, taken while they run, on floats and on symbols.

A dual number is a value with its partial derivatives, kept as a sparse map so that what does not
depend on a variable costs nothing (a structural zero never becomes an operation).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.lanes.philox import philox
from boresight.lanes.refusals import forbid, refuse
from boresight.lanes.trace import Symbol, recorded_power

Array = Any  # float64 outside a trace, object (symbols) inside one


class Dual:
    """A value and its partial derivatives `slopes[i]` with respect to variable i."""

    __slots__ = ("slopes", "value")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: Any, slopes: dict[int, Any]) -> None:
        self.value, self.slopes = value, slopes

    def chain(self, value: Any, slope: Any) -> "Dual":
        """A function of this number: its value, and its slope times this one's slopes."""
        return Dual(value, {i: s * slope for i, s in self.slopes.items()})

    def __add__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if not isinstance(other, Dual):
            return Dual(self.value + other, self.slopes)
        slopes = dict(self.slopes)
        for i, s in other.slopes.items():
            slopes[i] = slopes[i] + s if i in slopes else s
        return Dual(self.value + other.value, slopes)

    __radd__ = __add__

    def __neg__(self) -> "Dual":
        return Dual(-self.value, {i: -s for i, s in self.slopes.items()})

    def __sub__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if not isinstance(other, Dual):
            return self.chain(self.value * other, other)
        return self.chain(self.value * other.value, other.value) + other.chain(0.0, self.value)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if not isinstance(other, Dual):
            return self.chain(self.value / other, 1.0 / other)
        inverse = 1.0 / other.value
        quotient = self.value * inverse
        return self.chain(quotient, inverse) - other.chain(0.0, quotient * inverse)

    def __rtruediv__(self, other: Any) -> Any:
        inverse = 1.0 / self.value
        return self.chain(other * inverse, -other * inverse * inverse)

    def __pow__(self, power: Any) -> Any:
        return recorded_power(self, power)

    def __pos__(self) -> "Dual":
        return self

    def conjugate(self) -> "Dual":
        """A real number is its own conjugate."""
        return self

    def __abs__(self) -> "Dual":
        return self.chain(abs(self.value), copysign(1.0, self.value))

    fabs = __abs__

    def sqrt(self) -> "Dual":
        """Square root; its slope is infinite at zero, so guard the argument first."""
        root = np.sqrt(self.value)
        return self.chain(root, 0.5 / root) if self.slopes else Dual(root, {})

    def exp(self) -> "Dual":
        """Exponential."""
        value = np.exp(self.value)
        return self.chain(value, value)

    def expm1(self) -> "Dual":
        """Exponential less one, exact near zero."""
        return self.chain(np.expm1(self.value), np.exp(self.value))

    def log(self) -> "Dual":
        """Natural logarithm."""
        return self.chain(np.log(self.value), 1.0 / self.value)

    def sin(self) -> "Dual":
        """Sine of an angle in radians."""
        return self.chain(np.sin(self.value), np.cos(self.value))

    def cos(self) -> "Dual":
        """Cosine of an angle in radians."""
        return self.chain(np.cos(self.value), -np.sin(self.value))

    def arctan2(self, other: Any) -> Any:
        """Angle of the point (other, self)."""
        x = other if isinstance(other, Dual) else Dual(other, {})
        inverse = 1.0 / (self.value * self.value + x.value * x.value)
        angle = np.arctan2(self.value, x.value)
        return self.chain(angle, x.value * inverse) - x.chain(0.0, self.value * inverse)

    def hypot(self, other: Any) -> Any:
        """Root of the sum of squares."""
        return (self * self + other * other).sqrt()

    def rint(self) -> "Dual":
        """Nearest integer: a constant where it is smooth."""
        return Dual(np.rint(self.value), {})

    def floor(self) -> "Dual":
        """Largest integer below: a constant where it is smooth."""
        return Dual(np.floor(self.value), {})

    __floor__ = floor  # what np.floor calls on objects

    def isnan(self) -> Any:
        """Whether the value is NaN."""
        return isnan(self.value)

    def __lt__(self, other: Any) -> Any:
        return self.value < _value(other)

    def __le__(self, other: Any) -> Any:
        return self.value <= _value(other)

    def __gt__(self, other: Any) -> Any:
        return self.value > _value(other)

    def __ge__(self, other: Any) -> Any:
        return self.value >= _value(other)


forbid(Dual)


def _value(x: Any) -> Any:
    return x.value if isinstance(x, Dual) else x


def _slopes(x: Any) -> dict[int, Any]:
    return x.slopes if isinstance(x, Dual) else {}


def _select_one(condition: Any, a: Any, b: Any) -> Any:
    if isinstance(a, Dual) or isinstance(b, Dual):
        keys = sorted({*_slopes(a), *_slopes(b)})
        picked = {
            i: _select_one(condition, _slopes(a).get(i, 0.0), _slopes(b).get(i, 0.0)) for i in keys
        }
        return Dual(_select_one(condition, _value(a), _value(b)), picked)
    if not isinstance(condition, Symbol):
        return a if condition else b
    return condition.graph.apply("select", condition, condition.lift(a), condition.lift(b))  # type: ignore[arg-type]


_select_each = np.frompyfunc(_select_one, 3, 1)
_RECORDED = (Symbol, Dual)
_OBJECT = np.dtype(object)


def _is_recorded(*args: Any) -> bool:
    return any(isinstance(a, _RECORDED) or getattr(a, "dtype", None) is _OBJECT for a in args)


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` where `condition` holds, else `b`, element by element; both are always computed.

    Make the argument of a singular function safe before the function, not after it: the branch
    not taken is computed too, and its derivative as well.
    """
    if _is_recorded(condition, a, b):
        return _select_each(condition, a, b)
    return np.where(condition, a, b)[()]


def isnan(x: Any) -> Any:
    """Whether x is NaN, which in a plot means missing; floats, arrays and symbols alike."""
    if isinstance(x, _RECORDED):
        return x.isnan()
    if getattr(x, "dtype", None) is _OBJECT:
        return np.frompyfunc(isnan, 1, 1)(x)
    return np.isnan(x)


def copysign(magnitude: Any, sign: Any) -> Any:
    """Magnitude of the first with the sign of the second; floats, symbols and dual numbers."""
    sign = _value(sign)
    if isinstance(magnitude, Dual):
        slope = copysign(1.0, magnitude.value) * copysign(1.0, sign)
        return magnitude.chain(copysign(magnitude.value, sign), slope)
    if isinstance(sign, Symbol):
        return sign.graph.apply("copysign", sign.lift(magnitude), sign)  # type: ignore[arg-type]
    if isinstance(magnitude, Symbol):
        return magnitude.copysign(sign)
    return np.copysign(magnitude, sign)


def random_pair(counter: tuple[Any, ...], key: tuple[Any, Any]) -> tuple[Any, Any]:
    """Two numbers of 52 bits in (0, 1), a function of a counter and a key (Philox4x32-10).

    Args:
        counter: four whole numbers below 2^32: floats, arrays that broadcast, or symbols.
        key: two such numbers.
    """
    words = (*counter, *key)
    graph = next((word.graph for word in words if isinstance(word, Symbol)), None)
    if graph is None:
        return philox(*words)
    lifted = [word for word in map(graph.lift, words) if word is not None]
    if len(lifted) < len(words):
        refuse("random numbers of an array", "pass floats or recorded numbers")
    return graph.apply("philox0", *lifted), graph.apply("philox1", *lifted)


def _seed(x: Array) -> Array:
    seeded = np.empty(len(x), dtype=object)
    for i, value in enumerate(x):
        seeded[i] = Dual(value, {i: 1.0})
    return seeded


def _row(y: Any, x: Array) -> Array:
    """Partial derivatives of y as an array of x's own kind."""
    row = np.array([x[0] * 0.0 for _ in x]) if len(x) else np.zeros(0)
    for i, slope in _slopes(y).items():
        row[i] = x[0] * 0.0 + slope if isinstance(x[0], Symbol) else slope
    return row


def gradient(h: Callable[[Array], Any], x: Array) -> tuple[Any, Array]:
    """Value and gradient of a scalar formula.

    Args:
        h: formula of one argument (n,) that returns one number.
        x: (n,) point, floats or symbols.

    Returns:
        h(x), and its gradient (n,).
    """
    y = h(_seed(x))
    return _value(y), _row(y, x)


def jacobian(f: Callable[[Array], Array], x: Array) -> tuple[Array, Array]:
    """Value and Jacobian of a vector formula.

    Args:
        f: formula of one argument (n,) that returns (m,).
        x: (n,) point, floats or symbols.

    Returns:
        f(x) of shape (m,), and its Jacobian (m, n).
    """
    ys = list(f(_seed(x)))
    values = np.array([_value(y) for y in ys])
    return values, np.array([_row(y, x) for y in ys])


def reach(f: Callable[[Array], Array], x: Array) -> list[int]:
    """How many of the first elements of x hold all that each output of a formula depends on.

    Known from the formula's structure, not from its values: an output that does not see a velocity
    is the same formula wherever only velocities differ.

    Args:
        f: formula of one argument (n,) that returns (m,).
        x: (n,) point, floats or symbols.
    """
    return [max(_slopes(y), default=-1) + 1 for y in f(_seed(x))]
