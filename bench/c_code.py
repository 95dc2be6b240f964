"""The same arithmetic in the same order as our kernel's, as C++ for gcc: the rival we measure.

Two forms, because which one gcc likes better is not known beforehand:

    lanes    scalar operations inside one loop over the 8 lanes, for the vectoriser
    vectors  gcc's vector types and the processor's own square root and rounding

Both have the calling convention and the blocked layout of our own kernels, so gcc's function can
take the place of ours in `boresight.lanes.Kernel`. C++ only because gcc's C has no `?:` on vectors.
"""

import ctypes
import hashlib
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from boresight.lanes import BLOCK, Kernel, Program, Rate
from boresight.lanes.elementary import lower
from boresight.lanes.program import Slot
from boresight.lanes.writer import Shape

FORMS = ("lanes", "vectors")
COMMON = ("-O3", "-march=native", "-mprefer-vector-width=512", "-fno-math-errno")
FLAGS = {
    "plain": ("-fno-trapping-math",),
    "fast-math": ("-ffast-math",),
    "finite": ("-ffast-math", "-fno-finite-math-only", "-fno-associative-math"),
}

_HEAD = """
#include <cmath>
#include <cstring>
#include <immintrin.h>
typedef long long i64;
typedef double v8 __attribute__((vector_size(64), aligned(8)));
typedef i64 m8 __attribute__((vector_size(64), aligned(8)));
static inline double select_(bool c, double a, double b) { return c ? a : b; }
static inline v8 select_(m8 c, v8 a, v8 b) { return c ? a : b; }
static inline double sqrt_(double x) { return __builtin_sqrt(x); }
static inline double fabs_(double x) { return __builtin_fabs(x); }
static inline double rint_(double x) { return __builtin_rint(x); }
static inline double floor_(double x) { return __builtin_floor(x); }
static inline double copysign_(double x, double y) { return __builtin_copysign(x, y); }
static inline double pow2_(double x) {
  double low = x + 4503599627371519.0; i64 n; double y;
  memcpy(&n, &low, 8); n <<= 52; memcpy(&y, &n, 8); return y; }
static inline double mantissa_(double x) {
  i64 n; memcpy(&n, &x, 8);
  n = (n & 0x000FFFFFFFFFFFFFLL) | 0x3FF0000000000000LL; memcpy(&x, &n, 8); return x; }
static inline double exponent_(double x) {
  unsigned long long n; memcpy(&n, &x, 8);
  n = (n >> 52) | 0x4330000000000000ULL; memcpy(&x, &n, 8); return x - 4503599627371519.0; }
static inline v8 pow2_(v8 x) { return (v8)((m8)(x + 4503599627371519.0) << 52); }
static inline v8 mantissa_(v8 x) {
  return (v8)(((m8)x & 0x000FFFFFFFFFFFFFLL) | 0x3FF0000000000000LL); }
#ifdef __AVX512DQ__
static inline v8 sqrt_(v8 x) { return (v8)_mm512_sqrt_pd((__m512d)x); }
static inline v8 fabs_(v8 x) { return (v8)_mm512_abs_pd((__m512d)x); }
static inline v8 rint_(v8 x) { return (v8)_mm512_roundscale_pd((__m512d)x, 0x0C); }
static inline v8 floor_(v8 x) { return (v8)_mm512_roundscale_pd((__m512d)x, 0x09); }
static inline v8 copysign_(v8 x, v8 y) {
  const m8 sign = (m8){} + (i64)0x8000000000000000LL;
  return (v8)(((m8)x & ~sign) | ((m8)y & sign)); }
static inline v8 exponent_(v8 x) {
  return (v8)(m8)_mm512_or_si512(_mm512_srli_epi64((__m512i)x, 52),
    _mm512_set1_epi64(0x4330000000000000LL)) - 4503599627371519.0; }
#else
#define EACH(f) static inline v8 f(v8 x) { for (int l = 0; l < 8; ++l) x[l] = f(x[l]); return x; }
EACH(sqrt_) EACH(fabs_) EACH(rint_) EACH(floor_) EACH(exponent_)
static inline v8 copysign_(v8 x, v8 y) {
  for (int l = 0; l < 8; ++l) x[l] = copysign_(x[l], y[l]); return x; }
#endif
"""
_SYMBOLS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<="}
_SYMBOLS |= {"scale": "*", "and": "&", "or": "|"}
_CALLS = {"sqrt", "rint", "floor", "copysign", "pow2", "mantissa", "exponent"}
_LOGIC = {"lt", "le", "isnan", "and", "or", "not"}


def _expression(op: str, x: list[str]) -> str:
    if op in _SYMBOLS:
        return f"{x[0]} {_SYMBOLS[op]} {x[1]}"
    if op == "select":
        return f"select_({', '.join(x)})"
    if op == "isnan":
        return f"{x[0]} != {x[0]}"
    if op in _CALLS:
        return f"{op}_({', '.join(x)})"
    return {"neg": f"-{x[0]}", "abs": f"fabs_({x[0]})", "not": f"!{x[0]}"}[op]


def _nodes(program: Program, rates: set[Rate], number: str, condition: str) -> Iterator[str]:
    """Declarations of every operation of these rates, in recorded order."""
    for i, ((op, args), rate) in enumerate(zip(program.nodes, program.rates, strict=True)):
        if rate in rates and op not in ("const", "input"):
            operands = [_operand(program, a, number) for a in args]
            kind = condition if op in _LOGIC else number
            yield f"const {kind} n{i} = {_expression(op, operands)};"


def _operand(program: Program, node: int, number: str) -> str:
    """A node's name; what the lanes share is spread where a vector is needed."""
    op, args = program.nodes[node]
    lane = program.rates[node] & Rate.LANE
    if op == "const":
        bits = int.from_bytes(args[0], "little")
        name = f"__builtin_bit_cast(double, 0x{bits:016X}ULL)"
    else:
        name = f"n{node}"
    return name if lane or number == "double" else f"((v8){{}} + {name})"


def _inputs(program: Program, slot: Slot, template: str, kind: str) -> Iterator[str]:
    for i, (op, args) in enumerate(program.nodes):
        if op == "input" and args[0] == slot.name:
            yield f"const {kind} n{i} = {template.format(args[1])};"


def _state(program: Program, template: str, kind: str) -> Iterator[str]:
    offset = 0
    for slot in program.state:
        for i, (op, args) in enumerate(program.nodes):
            if op == "input" and args[0] == f"state.{slot.name}":
                yield f"const {kind} n{i} = {template.format(offset + args[1])};"
        offset += slot.leaf.size


def _body(program: Program, form: str) -> Iterator[str]:
    """One step of one block (vectors) or of one lane of it (lanes)."""
    vectors = form == "vectors"
    number, condition = ("v8", "m8") if vectors else ("double", "bool")
    ending = "{} * 8)" if vectors else "{} * 8 + l)"
    pointer = "*(v8*)(" if vectors else "*("
    yield from _state(program, "s[{}]" if vectors else "s[{}][l]", number)
    for k, slot in enumerate(program.inputs):
        size = slot.leaf.size * BLOCK
        base = f"in{k} + (b * steps + t) * {size} + " if slot.rate == Rate.EACH else ""
        base = f"in{k} + b * {size} + " if slot.rate == Rate.LANE else base
        if base:
            yield from _inputs(program, slot, f"{pointer}{base}{ending}", number)
    yield from _nodes(program, {Rate.LANE, Rate.EACH}, number, condition)
    for k, (slot, numbers) in enumerate(zip(program.outputs, program.output_nodes, strict=True)):
        place = "(b * steps + t)" if slot.rate == Rate.EACH else "b"
        for j, node in enumerate(numbers):
            target = f"{pointer}out{k} + {place} * {slot.leaf.size * BLOCK} + {ending.format(j)}"
            yield f"{target} = {_operand(program, node, number)};"
    left = "s[{}]" if vectors else "s[{}][l]"
    for j, node in enumerate(program.state_nodes):
        yield f"{left.format(j)} = {_operand(program, node, number)};"


def write_c(program: Program, form: str) -> str:
    """C++ source of a lowered program's kernel, in blocks.

    Args:
        program: lowered program (`elementary.lower`).
        form: "lanes" or "vectors".
    """
    arrays = ["old", "fresh", *(f"out{i}" for i in range(len(program.outputs)))]
    arrays += [f"in{i}" for i in range(len(program.inputs))]
    parameters = ["i64 from", "i64 to", "i64 steps", *(f"double* __restrict {a}" for a in arrays)]
    words = ["f[0]", "f[1]", "f[2]", *(f"(double*)f[{4 + i}]" for i in range(len(arrays)))]
    lines = [_HEAD, f"static inline void run({', '.join(parameters)}) {{"]
    for rate, moved in ((Rate.FIXED, ""), (Rate.STEP, "t * {size} + ")):
        if rate == Rate.STEP:
            lines += [f"for (i64 b = from; b < to; ++b) {{ v8 s_[{program.state_size}];"]
            lines += ["double (*s)[8] = (double(*)[8])s_;"] if form == "lanes" else ["v8* s = s_;"]
            lines += [f"memcpy(s, old + b * {program.state_size * 8}, sizeof s_);"]
            lines += ["for (i64 t = 0; t < steps; ++t) {"]
        for k, slot in enumerate(program.inputs):
            if slot.rate == rate:
                place = moved.format(size=slot.leaf.size)
                lines += _inputs(program, slot, f"in{k}[{place}{{}}]", "double")
        lines += _nodes(program, {rate}, "double", "bool")
    loop = "#pragma GCC ivdep\nfor (int l = 0; l < 8; ++l) {" if form == "lanes" else "{"
    lines += [loop, *_body(program, form), "}}"]
    lines += [f"memcpy(fresh + b * {program.state_size * 8}, s, sizeof s_);", "}}"]
    lines += [f'extern "C" void kernel(i64* f) {{ run({", ".join(words)}); }}']
    return "\n".join(lines)


def compile_c(source: str, flags: tuple[str, ...]) -> Any:
    """Gcc's function, with the calling convention of ours."""
    folder = Path(tempfile.gettempdir()) / "boresight-bench"
    folder.mkdir(exist_ok=True)
    name = hashlib.sha256(f"{flags}{source}".encode()).hexdigest()[:16]
    code, library = folder / f"{name}.cc", folder / f"{name}.so"
    if not library.exists():
        code.write_text(source)
        command = ["g++", "-w", *COMMON, *flags, "-shared", "-fPIC", str(code), "-o", str(library)]
        subprocess.run(command, check=True, capture_output=True)
    function = ctypes.CDLL(str(library)).kernel
    function.argtypes = [ctypes.c_void_p]
    function.restype = None
    return function


def gcc_kernel(kernel: Kernel, form: str, flags: tuple[str, ...]) -> Kernel:
    """The same program, run by the same machinery, with gcc's code in the place of ours."""
    if kernel.code is None or kernel.rows:
        raise ValueError("the rival is written for compiled kernels in blocks")
    source = write_c(lower(kernel.program, rounding=True), form)
    code = replace(kernel.code, shape=Shape(BLOCK, rows=False), call=compile_c(source, flags))
    return replace(kernel, code=code)
