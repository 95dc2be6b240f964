"""A program as LLVM's intermediate representation: one function that runs blocks of lanes.

The function takes one address, of the words that describe a call, and has this shape, with W lanes
in one instruction and blocks of 8 lanes in memory:

    fixed work, as scalars
    for each chunk of W lanes:
        load the state and the per-lane inputs; per-lane work
        for each step:
            load the step's inputs; the step's work; store the outputs of this step
        store the state and the outputs of the last step

State is always blocked, [block, number, 8]. Other per-lane data are either blocked too,
[block, step, number, 8], or plain rows, [lane, step, number], which the kernel gathers and
scatters itself: packing rows in NumPy would cost more than the filter does.

Floating-point flag `contract` only: multiply and add may fuse, NaN and infinity stay legal, and
every lane sees the same operations, so one lane and a million give the same bits.
"""

from dataclasses import dataclass

from boresight.lanes.program import Program, Rate, Slot, is_condition

BLOCK = 8  # lanes of one block in memory, whatever the processor
_BINARY = {"add": "fadd contract", "sub": "fsub contract", "mul": "fmul contract"}
_BINARY |= {"div": "fdiv contract", "scale": "fmul"}  # a scaled half turn must stay one: no fusing
_CALLS = {"sqrt": "sqrt", "abs": "fabs", "rint": "rint", "floor": "floor", "copysign": "copysign"}
_CONDITIONS = {"lt": "fcmp olt", "le": "fcmp ole", "isnan": "fcmp uno"}
_LOGIC = {"and": "and", "or": "or"}


@dataclass(frozen=True)
class Shape:
    """What the code is generated for: lanes in one instruction, and the layout of its data."""

    width: int
    rows: bool


@dataclass(frozen=True)
class _Kind:
    """LLVM's names for the types of one rate: scalars, or vectors of W lanes."""

    number: str
    integer: str
    bit: str
    suffix: str


def _vector(width: int) -> _Kind:
    return _Kind(f"<{width} x double>", f"<{width} x i64>", f"<{width} x i1>", f"v{width}")


_SCALAR = _Kind("double", "i64", "i1", "")


class _Writer:
    """Lines of one function, with names for the values already computed."""

    def __init__(self, program: Program, shape: Shape) -> None:
        self.program, self.shape = program, shape
        self.lines: list[str] = []
        self.vector = _vector(shape.width)
        self.splats: dict[int, str] = {}
        self.temporaries = 0
        self.kinds = [self.vector if rate & Rate.LANE else _SCALAR for rate in program.rates]
        self.elements: dict[str, list[tuple[int, int]]] = {}  # of an input: (element, node)
        for node, (op, args) in enumerate(program.nodes):
            if op == "input":
                self.elements.setdefault(args[0], []).append((args[1], node))

    def emit(self, text: str) -> str:
        self.temporaries += 1
        name = f"%t{self.temporaries}"
        self.lines.append(f"  {name} = {text}")
        return name

    def line(self, text: str) -> None:
        self.lines.append(text)

    def constant(self, value: str, kind: _Kind, scalar: str = "double") -> str:
        return value if kind is _SCALAR else f"splat ({scalar} {value})"

    def value(self, node: int, kind: _Kind) -> str:
        """Operand text of a node, splatted if a scalar meets a vector instruction."""
        op, args = self.program.nodes[node]
        if op == "const":
            bits = int.from_bytes(args[0], "little")
            return self.constant(f"0x{bits:016X}", kind)
        if kind is _SCALAR or self.kinds[node] is kind:
            return f"%n{node}"
        if node not in self.splats:
            self.splats[node] = self.splat(f"%n{node}", "i1" if is_condition(op) else "double")
        return self.splats[node]

    def splat(self, scalar: str, element: str) -> str:
        w = self.shape.width
        first = self.emit(f"insertelement <{w} x {element}> poison, {element} {scalar}, i64 0")
        kind = f"<{w} x {element}>"
        return self.emit(
            f"shufflevector {kind} {first}, {kind} poison, <{w} x i32> zeroinitializer"
        )

    def compute(self, wanted: Rate) -> None:
        """Emit every operation of one rate, in recorded order."""
        for node, ((op, args), rate) in enumerate(
            zip(self.program.nodes, self.program.rates, strict=True)
        ):
            if rate is wanted and op not in ("const", "input"):
                kind = self.kinds[node]
                self.line(f"  %n{node} = {self.operation(op, args, kind)}")

    def operation(self, op: str, args: tuple[int, ...], kind: _Kind) -> str:
        x = [self.value(a, kind) for a in args]
        if op in _BINARY:
            return f"{_BINARY[op]} {kind.number} {x[0]}, {x[1]}"
        if op == "neg":
            return f"fneg {kind.number} {x[0]}"
        if op in _CALLS:
            operands = ", ".join(f"{kind.number} {a}" for a in x)
            return f"call {kind.number} @llvm.{_CALLS[op]}.{kind.suffix}f64({operands})"
        if op in _CONDITIONS:
            return f"{_CONDITIONS[op]} {kind.number} {x[0]}, {x[-1]}"
        if op in _LOGIC:
            return f"{_LOGIC[op]} {kind.bit} {x[0]}, {x[1]}"
        if op == "not":
            return f"xor {kind.bit} {x[0]}, {self.constant('true', kind, 'i1')}"
        if op == "select":
            return f"select {kind.bit} {x[0]}, {kind.number} {x[1]}, {kind.number} {x[2]}"
        return self.bits(op, x[0], kind)

    def bits(self, op: str, x: str, kind: _Kind) -> str:
        """Operations on the exponent bits, for whole numbers in range; see elementary.py."""

        def c(value: int) -> str:
            return self.constant(str(value), kind, "i64")

        if op == "pow2":  # adding 2**52 + 1023 leaves x + 1023 in the low bits: no conversion
            magic = self.constant("0x43300000000003FF", kind)
            low = self.emit(f"fadd {kind.number} {x}, {magic}")
            whole = self.emit(f"bitcast {kind.number} {low} to {kind.integer}")
            shifted = self.emit(f"shl {kind.integer} {whole}, {c(52)}")
            return f"bitcast {kind.integer} {shifted} to {kind.number}"
        whole = self.emit(f"bitcast {kind.number} {x} to {kind.integer}")
        if op == "mantissa":
            low = self.emit(f"and {kind.integer} {whole}, {c(0x000FFFFFFFFFFFFF)}")
            one = self.emit(f"or {kind.integer} {low}, {c(0x3FF0000000000000)}")
            return f"bitcast {kind.integer} {one} to {kind.number}"
        exponent = self.emit(f"lshr {kind.integer} {whole}, {c(52)}")
        biased = self.emit(f"or {kind.integer} {exponent}, {c(0x4330000000000000)}")
        number = self.emit(f"bitcast {kind.integer} {biased} to {kind.number}")
        return f"fsub {kind.number} {number}, {self.constant('0x43300000000003FF', kind)}"


def _scalar_loads(w: _Writer, slot: Slot, argument: str, base: str) -> None:
    """Numbers the lanes share: FIXED and STEP inputs."""
    for k, node in w.elements.get(slot.name, ()):
        index = w.emit(f"add i64 {base}, {k}")
        pointer = w.emit(f"getelementptr double, ptr {argument}, i64 {index}")
        w.line(f"  %n{node} = load double, ptr {pointer}, align 8")


def _address(w: _Writer, argument: str, base: str, element: int) -> str:
    """Pointer (blocked) or pointers (rows) of one number of the W lanes."""
    if not w.shape.rows:
        index = w.emit(f"add i64 {base}, {element * BLOCK}")
        return w.emit(f"getelementptr double, ptr {argument}, i64 {index}")
    width = w.shape.width
    return w.emit(f"getelementptr double, <{width} x ptr> {base}, i64 {element}")


def _load(w: _Writer, argument: str, base: str, element: int) -> str:
    address, kind = _address(w, argument, base, element), w.vector
    if not w.shape.rows:
        return f"load {kind.number}, ptr {address}, align 8"
    width = w.shape.width
    return (
        f"call {kind.number} @llvm.masked.gather.{kind.suffix}f64.{kind.suffix}p0(<{width} x ptr> "
        f"{address}, i32 8, {kind.bit} splat (i1 true), {kind.number} poison)"
    )


def _store(w: _Writer, argument: str, base: str, element: int, value: str) -> None:
    address, kind = _address(w, argument, base, element), w.vector
    if not w.shape.rows:
        w.line(f"  store {kind.number} {value}, ptr {address}, align 8")
        return
    width = w.shape.width
    w.line(
        f"  call void @llvm.masked.scatter.{kind.suffix}f64.{kind.suffix}p0({kind.number} {value}, "
        f"<{width} x ptr> {address}, i32 8, {kind.bit} splat (i1 true))"
    )


def _lane_base(w: _Writer, argument: str, size: int, steps: str) -> str:
    """Where the data of this chunk's lanes begin in an argument of `size` numbers a step."""
    numbers = w.emit(f"mul i64 {steps}, {size}")
    if not w.shape.rows:
        start = w.emit(f"mul i64 %block, {numbers}")
        scaled = w.emit(f"mul i64 {start}, {BLOCK}")
        return w.emit(f"add i64 {scaled}, %inside")
    offsets = w.emit(f"mul {w.vector.integer} %lane, {w.splat(numbers, 'i64')}")
    return w.emit(f"getelementptr double, ptr {argument}, {w.vector.integer} {offsets}")


def _step_base(w: _Writer, base: str, size: int) -> str:
    """`base` moved to step %t."""
    if not w.shape.rows:
        moved = w.emit(f"mul i64 %t, {size * BLOCK}")
        return w.emit(f"add i64 {base}, {moved}")
    moved = w.emit(f"mul i64 %t, {size}")
    return w.emit(f"getelementptr double, <{w.shape.width} x ptr> {base}, i64 {moved}")


def _state_offset(program: Program, name: str) -> int:
    offset = 0
    for slot in program.state:
        if f"state.{slot.name}" == name:
            return offset
        offset += slot.leaf.size
    raise KeyError(name)


def _state_base(w: _Writer) -> str:
    start = w.emit(f"mul i64 %block, {w.program.state_size * BLOCK}")
    return w.emit(f"add i64 {start}, %inside")


def _state_pointer(w: _Writer, argument: str, base: str, element: int) -> str:
    index = w.emit(f"add i64 {base}, {element * BLOCK}")
    return w.emit(f"getelementptr double, ptr {argument}, i64 {index}")


def _chunk_places(w: _Writer) -> None:
    """Block, place inside it, and (for rows) the lanes of this chunk; the last lane pads."""
    width = w.shape.width
    w.line(f"  %block = udiv i64 %chunk, {BLOCK // width}")
    w.line(f"  %part = urem i64 %chunk, {BLOCK // width}")
    w.line(f"  %inside = mul i64 %part, {width}")
    if w.shape.rows:
        first = w.splat(w.emit(f"mul i64 %chunk, {width}"), "i64")
        ramp = "<" + ", ".join(f"i64 {i}" for i in range(width)) + ">"
        lane = w.emit(f"add {w.vector.integer} {first}, {ramp}")
        last = w.splat(w.emit("sub i64 %lanes, 1"), "i64")
        call = f"call {w.vector.integer} @llvm.umin.{w.vector.suffix}i64"
        w.line(f"  %lane = {call}({w.vector.integer} {lane}, {w.vector.integer} {last})")


def _unpack_frame(w: _Writer, arrays: list[str]) -> None:
    """The words of a call: first chunk and the one after the last, steps, lanes, addresses."""
    kinds = dict.fromkeys(("%from", "%to", "%steps", "%lanes"), "i64")
    kinds |= dict.fromkeys(("%old", "%new", *arrays), "ptr")
    for i, (word, kind) in enumerate(kinds.items()):
        pointer = w.emit(f"getelementptr i64, ptr %frame, i64 {i}")
        w.line(f"  {word} = load {kind}, ptr {pointer}, align 8")


def write_ir(program: Program, shape: Shape, name: str, attributes: str) -> str:
    """LLVM text of the kernel.

    Args:
        program: lowered program (`elementary.lower`).
        shape: lanes in one instruction and data layout.
        name: symbol to export.
        attributes: function attributes of the target.
    """
    w = _Writer(program, shape)
    arguments = [f"%in{i}" for i in range(len(program.inputs))]
    results = [f"%out{i}" for i in range(len(program.outputs))]
    w.line(f"define void @{name}(ptr %frame) {attributes} {{\nentry:")
    _unpack_frame(w, [*arguments, *results])
    slots = list(zip(program.inputs, arguments, strict=True))
    for slot, argument in slots:
        if slot.rate == Rate.FIXED:
            _scalar_loads(w, slot, argument, "0")
    w.compute(Rate.FIXED)
    _precompute_splats(w, Rate.FIXED)
    w.line("  %some = icmp ult i64 %from, %to\n  br i1 %some, label %chunks, label %end\nchunks:")
    w.line("  %chunk = phi i64 [ %from, %entry ], [ %nextchunk, %done ]")
    _chunk_places(w)
    old, lane_bases = _write_lane_part(w, slots)
    out_bases = [
        _lane_base(w, r, s.leaf.size, "%steps" if s.rate == Rate.EACH else "1")
        for s, r in zip(program.outputs, results, strict=True)
    ]
    w.line("  br label %step\nstep:\n  %t = phi i64 [ 0, %chunks ], [ %nextt, %step ]")
    _write_step(w, slots, old, lane_bases)
    _write_outputs(w, results, out_bases, Rate.EACH)
    w.line("  %nextt = add i64 %t, 1\n  %more = icmp ult i64 %nextt, %steps")
    w.line("  br i1 %more, label %step, label %done\ndone:")
    _write_outputs(w, results, out_bases, Rate.LANE)
    base = _state_base(w)
    for k, node in enumerate(program.state_nodes):
        value = w.value(node, w.vector)
        pointer = _state_pointer(w, "%new", base, k)
        w.line(f"  store {w.vector.number} {value}, ptr {pointer}, align 8")
    w.line("  %nextchunk = add i64 %chunk, 1\n  %again = icmp ult i64 %nextchunk, %to")
    w.line("  br i1 %again, label %chunks, label %end\nend:\n  ret void\n}")
    return "\n".join(w.lines)


def _precompute_splats(w: _Writer, rate: Rate) -> None:
    """Splat shared numbers where they are computed, so that every later use is dominated."""
    users = {
        a
        for node, (op, args) in enumerate(w.program.nodes)
        if op not in ("const", "input") and w.kinds[node] is w.vector
        for a in args
    }
    users.update(w.program.state_nodes, *w.program.output_nodes)
    for node in sorted(users):
        if w.program.rates[node] is rate and w.program.nodes[node][0] != "const":
            w.value(node, w.vector)


def _write_lane_part(
    w: _Writer, slots: list[tuple[Slot, str]]
) -> tuple[dict[int, str], dict[str, str]]:
    base = _state_base(w)
    old: dict[int, str] = {}
    for slot in w.program.state:
        name = f"state.{slot.name}"
        for k, node in w.elements.get(name, ()):
            pointer = _state_pointer(w, "%old", base, _state_offset(w.program, name) + k)
            old[node] = w.emit(f"load {w.vector.number}, ptr {pointer}, align 8")
    bases = {}
    for slot, argument in slots:
        if slot.rate == Rate.LANE:
            start = _lane_base(w, argument, slot.leaf.size, "1")
            for k, node in w.elements.get(slot.name, ()):
                w.line(f"  %n{node} = {_load(w, argument, start, k)}")
        elif slot.rate == Rate.EACH:
            bases[slot.name] = _lane_base(w, argument, slot.leaf.size, "%steps")
    w.compute(Rate.LANE)
    return old, bases


def _write_step(
    w: _Writer, slots: list[tuple[Slot, str]], old: dict[int, str], bases: dict[str, str]
) -> None:
    top = len(w.lines)
    for slot, argument in slots:
        if slot.rate == Rate.STEP:
            _scalar_loads(w, slot, argument, w.emit(f"mul i64 %t, {slot.leaf.size}"))
    w.compute(Rate.STEP)
    _precompute_splats(w, Rate.STEP)
    for slot, argument in slots:
        if slot.rate == Rate.EACH:
            base = _step_base(w, bases[slot.name], slot.leaf.size)
            for k, node in w.elements.get(slot.name, ()):
                w.line(f"  %n{node} = {_load(w, argument, base, k)}")
    w.compute(Rate.EACH)
    w.lines[top:top] = _carried(w, old)


def _carried(w: _Writer, old: dict[int, str]) -> list[str]:
    """The state inside the loop: from memory on the first step, then from the step before."""
    lines, element = [], 0
    for slot in w.program.state:
        for k, node in w.elements.get(f"state.{slot.name}", ()):
            following = w.value(w.program.state_nodes[element + k], w.vector)
            sources = f"[ {old[node]}, %chunks ], [ {following}, %step ]"
            lines.append(f"  %n{node} = phi {w.vector.number} {sources}")
        element += slot.leaf.size
    return lines


def _write_outputs(w: _Writer, results: list[str], bases: list[str], rate: Rate) -> None:
    for slot, numbers, argument, base in zip(
        w.program.outputs, w.program.output_nodes, results, bases, strict=True
    ):
        if slot.rate != rate:
            continue
        place = _step_base(w, base, slot.leaf.size) if rate == Rate.EACH else base
        for k, node in enumerate(numbers):
            _store(w, argument, place, k, w.value(node, w.vector))
