"""Elementary functions as formulas of add, multiply, select and two bit operations.

A compiled kernel has no vector mathematics library to call, so `sin`, `cos`, `exp`, `expm1`, `log`
and `arctan2` are spelled out here, on the same symbols as any formula: a sine and a cosine of one
angle share their range reduction, and work on fixed inputs is hoisted like any other.

Coefficients are those of Sun's freely distributable mathematics library (fdlibm), whose error
bounds are below one unit in the last place on the reduced interval; ours add the reduction's.
"""

import math
from collections.abc import Callable
from typing import Any

from boresight.lanes.dual import copysign, select
from boresight.lanes.program import Program, assemble
from boresight.lanes.trace import Graph, Symbol

# pi/2 in three parts of 33 bits, so that multiples of the first two are exact.
_HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
_SIN = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
_LOG = (
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
    1.818357216161805012e-01,
    1.531383769920937332e-01,
    1.479819860511658591e-01,
)
_ATAN = (
    -3.33333333333329318027e-01,
    1.99999999998764832476e-01,
    -1.42857142725034663711e-01,
    1.11111104054623557880e-01,
    -9.09088713343650656196e-02,
    7.69187620504482999495e-02,
    -6.66107313738753120669e-02,
    5.83357013379057348645e-02,
    -4.97687799461593236017e-02,
    3.65315727442169155270e-02,
    -1.62858201153657823623e-02,
)
_LN2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
LARGEST_ANGLE = 1e6  # rad; above it the three-part reduction loses bits, so the result is NaN
_BIG = 2.0**52


def _horner(coefficients: tuple[float, ...], z: Any) -> Any:
    total = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        total = total * z + c
    return total


def rint(x: Any) -> Any:
    """Nearest integer, ties to even, by adding and taking away 2**52 (SSE2 has nothing better)."""
    a = abs(x)
    return select(a < _BIG, copysign((a + _BIG) - _BIG, x), x)


def _floor(x: Any) -> Any:
    nearest = rint(x)
    return nearest - select(x < nearest, 1.0, 0.0)


def near_zero(r: Any) -> tuple[Any, Any]:
    """Sine and cosine of an angle in +-pi/4; of floats and arrays too."""
    z = r * r
    sine = r + r * (z * _horner(_SIN, z))
    return sine, (1.0 - 0.5 * z) + z * z * _horner(_COS, z)


def _quadrant(x: Any) -> tuple[Any, Any, Any]:
    """Sine and cosine of the remainder in +-pi/4, and the quadrant 0 to 3."""
    n = (x * (2.0 / math.pi)).rint()
    r = ((x - n * _HALF_PI[0]) - n * _HALF_PI[1]) - n * _HALF_PI[2]
    return *near_zero(r), n - 4.0 * (n * 0.25).floor()


def _in_range(x: Any, y: Any) -> Any:
    return select(abs(x) <= LARGEST_ANGLE, y, math.nan)


def sin(x: Any) -> Any:
    """Sine; 1.5 units in the last place to 1e3 rad, 2.3 to 1e6, NaN beyond."""
    sine, cosine, q = _quadrant(x)
    odd = (q >= 1.0) & (q <= 1.0) | (q >= 3.0)
    magnitude = select(odd, cosine, sine)
    signed = select(q >= 2.0, -magnitude, magnitude)
    return _in_range(x, select(abs(x) < 1e-8, x, signed))  # keeps -0.0


def cos(x: Any) -> Any:
    """Cosine; 1.5 units in the last place to 1e3 rad, 2.3 to 1e6, NaN beyond."""
    sine, cosine, q = _quadrant(x)
    odd = (q >= 1.0) & (q <= 1.0) | (q >= 3.0)
    magnitude = select(odd, sine, cosine)
    return _in_range(x, select((q >= 1.0) & (q <= 2.0), -magnitude, magnitude))


def exp(x: Any) -> Any:
    """Exponential, 1.2 units in the last place; below -708 it is 0 (no denormals)."""
    safe = select(x < -708.0, -708.0, select(x > 709.8, 709.8, x))  # whose value is infinite
    k = (safe * (1.0 / math.log(2.0))).rint()
    r = (safe - k * _LN2[0]) - k * _LN2[1]
    series = _horner(tuple(1.0 / math.factorial(i) for i in range(14)), r)
    half = (k * 0.5).floor()
    value = series * half.graph.apply("pow2", half) * half.graph.apply("pow2", k - half)
    return select(x < -708.0, 0.0, value)


def expm1(x: Any) -> Any:
    """Exponential less one, 1.8 units in the last place; as fast as the exponential."""
    safe = select(x < -708.0, -708.0, select(x > 709.8, 709.8, x))  # -1, and infinite
    k = (safe * (1.0 / math.log(2.0))).rint()
    r = (safe - k * _LN2[0]) - k * _LN2[1]
    less_one = r + r * r * _horner(tuple(1.0 / math.factorial(i) for i in range(2, 15)), r)
    half = (k * 0.5).floor()
    low, high, inverse = (half.graph.apply("pow2", e) for e in (half, k - half, half - k))
    value = (less_one * low + (low - inverse)) * high  # 2**k (1 + less_one) - 1: exact at k = 0
    return select(abs(x) < 1e-20, x, value)  # keeps -0.0


def log(x: Any) -> Any:
    """Natural logarithm of normal numbers, 0.8 units in the last place; 0 gives -inf."""
    e, m = x.graph.apply("exponent", x), x.graph.apply("mantissa", x)
    large = m > math.sqrt(2.0)
    m, e = select(large, 0.5 * m, m), select(large, e + 1.0, e)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    half_square = 0.5 * f * f
    tail = s * (half_square + z * _horner(_LOG, z)) + e * _LN2[1]
    value = e * _LN2[0] - ((half_square - tail) - f)
    if x.graph.nodes[x.index][0] in ("philox0", "philox1"):  # a number in (0, 1)
        return value
    value = select(x <= 0.0, select(x < 0.0, math.nan, -math.inf), value)
    return select(x < math.inf, value, x)


def arctan2(y: Any, x: Any) -> Any:
    """Angle of (x, y), 2.3 units in the last place, signed zeros; NaN where both are infinite."""
    ay, ax = abs(y), abs(x)
    steep = ax < ay
    small, large = select(steep, ax, ay), select(steep, ay, ax)
    turned = 0.41421356237309503 * large < small  # tan(pi/8)
    top = select(turned, small - large, small)
    bottom = select(turned, small + large, large)
    t = top / select(bottom <= 0.0, 1.0, bottom)
    z = t * t
    angle = t + t * (z * _horner(_ATAN, z)) + select(turned, math.pi / 4, 0.0)
    angle = select(steep, math.pi / 2 - angle, angle)
    behind = copysign(1.0, x) < 0.0
    return copysign(select(behind, math.pi - angle, angle), y)


def _divide(x: Any, y: Any) -> Any:
    """A quotient; by a constant it is a product, one unit in the last place from the quotient."""
    c = y.graph.values[y.index]
    if c is None or not 1e-300 < abs(c) < 1e300:
        return x / y
    return x.graph.apply("scale", x, y.graph.constant(1.0 / c))


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": sin,
    "cos": cos,
    "exp": exp,
    "expm1": expm1,
    "log": log,
    "arctan2": arctan2,
    "div": _divide,
}
_ROUNDING: dict[str, Callable[..., Any]] = {"rint": rint, "floor": _floor}


def lower(program: Program, *, rounding: bool) -> Program:
    """The program with elementary functions spelled out.

    Args:
        program: any program.
        rounding: whether the processor rounds by itself; if not, that is spelled out too.
    """
    flat = _spell(program, _FUNCTIONS)
    return flat if rounding else _spell(flat, _ROUNDING)


def _spell(program: Program, functions: dict[str, Callable[..., Any]]) -> Program:
    graph = Graph()
    moved: list[Symbol] = []
    for op, args in program.nodes:
        if op in functions:
            moved.append(functions[op](*[moved[a] for a in args]))
        elif op in ("const", "input"):
            moved.append(graph.intern(op, args))
        else:  # folded already, and operands keep their order
            moved.append(graph.intern(op, tuple([moved[a].index for a in args])))
    return assemble(
        graph,
        program.inputs,
        program.state,
        program.outputs,
        [moved[n].index for n in program.state_nodes],
        [[moved[n].index for n in numbers] for numbers in program.output_nodes],
    )
