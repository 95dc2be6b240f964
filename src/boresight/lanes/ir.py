"""A program as LLVM's intermediate representation: one function that runs blocks of lanes.

The function takes one address, of the words that describe a call, and has this shape, with W lanes
in one instruction and blocks of 8 lanes in memory:

    fixed work, as scalars
    for each chunk of W lanes:
        load the state and the per-lane inputs; per-lane work
        for each step:
            load the step's inputs; the step's work; store the outputs of this step, and sums
        store the state and the outputs of the last step

State is always blocked, [block, number, 8]. Other per-lane data are either blocked too,
[block, step, number, 8], or plain rows, [lane, step, number], which the kernel gathers and
scatters itself: packing rows in NumPy would cost more than the filter does. What is summed over
lanes is [chunk, step, number] in both.

Floating-point flag `contract` only: multiply and add may fuse, NaN and infinity stay legal, and
every lane sees the same operations, so one lane and a million give the same bits.
"""

from boresight.lanes.outputs import output_base, write_outputs
from boresight.lanes.places import BLOCK, address, lane_base, step_base
from boresight.lanes.program import Program, Rate, Slot
from boresight.lanes.writer import Shape, Writer


def _scalar_loads(w: Writer, slot: Slot, argument: str, base: str) -> None:
    """Numbers the lanes share: FIXED and STEP inputs."""
    for k, node in w.elements.get(slot.name, ()):
        index = w.emit(f"add i64 {base}, {k}")
        pointer = w.emit(f"getelementptr double, ptr {argument}, i64 {index}")
        w.line(f"  %n{node} = load double, ptr {pointer}, align 8")


def _load(w: Writer, argument: str, base: str, element: int) -> str:
    place, kind = address(w, argument, base, element), w.vector
    if not w.shape.rows:
        return f"load {kind.number}, ptr {place}, align 8"
    width = w.shape.width
    return (
        f"call {kind.number} @llvm.masked.gather.{kind.suffix}f64.{kind.suffix}p0(<{width} x ptr> "
        f"{place}, i32 8, {kind.bit} splat (i1 true), {kind.number} poison)"
    )


def _state_offset(program: Program, name: str) -> int:
    offset = 0
    for slot in program.state:
        if f"state.{slot.name}" == name:
            return offset
        offset += slot.leaf.size
    raise KeyError(name)


def _state_base(w: Writer) -> str:
    start = w.emit(f"mul i64 %block, {w.program.state_size * BLOCK}")
    return w.emit(f"add i64 {start}, %inside")


def _state_pointer(w: Writer, argument: str, base: str, element: int) -> str:
    index = w.emit(f"add i64 {base}, {element * BLOCK}")
    return w.emit(f"getelementptr double, ptr {argument}, i64 {index}")


def _chunk_places(w: Writer) -> None:
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


def _unpack_frame(w: Writer, arrays: list[str]) -> None:
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
    w = Writer(program, shape)
    arguments = [f"%in{i}" for i in range(len(program.inputs))]
    results = [f"%out{i}" for i in range(len(program.outputs))]
    w.line(f"define void @{name}(ptr %frame) {attributes} {{\nentry:")
    _unpack_frame(w, [*results, *arguments])
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
        output_base(w, slot, result) for slot, result in zip(program.outputs, results, strict=True)
    ]
    w.line("  br label %step\nstep:\n  %t = phi i64 [ 0, %chunks ], [ %nextt, %step ]")
    _write_step(w, slots, old, lane_bases)
    write_outputs(w, results, out_bases, (Rate.EACH, Rate.STEP))
    w.line("  %nextt = add i64 %t, 1\n  %more = icmp ult i64 %nextt, %steps")
    w.line("  br i1 %more, label %step, label %done\ndone:")
    write_outputs(w, results, out_bases, (Rate.LANE,))
    base = _state_base(w)
    for k, node in enumerate(program.state_nodes):
        value = w.value(node, w.vector)
        pointer = _state_pointer(w, "%new", base, k)
        w.line(f"  store {w.vector.number} {value}, ptr {pointer}, align 8")
    w.line("  %nextchunk = add i64 %chunk, 1\n  %again = icmp ult i64 %nextchunk, %to")
    w.line("  br i1 %again, label %chunks, label %end\nend:\n  ret void\n}")
    return "\n".join(w.lines)


def _precompute_splats(w: Writer, rate: Rate) -> None:
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
    w: Writer, slots: list[tuple[Slot, str]]
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
            start = lane_base(w, argument, slot.leaf.size, "1")
            for k, node in w.elements.get(slot.name, ()):
                w.line(f"  %n{node} = {_load(w, argument, start, k)}")
        elif slot.rate == Rate.EACH:
            bases[slot.name] = lane_base(w, argument, slot.leaf.size, "%steps")
    w.compute(Rate.LANE)
    return old, bases


def _write_step(
    w: Writer, slots: list[tuple[Slot, str]], old: dict[int, str], bases: dict[str, str]
) -> None:
    top = len(w.lines)
    for slot, argument in slots:
        if slot.rate == Rate.STEP:
            _scalar_loads(w, slot, argument, w.emit(f"mul i64 %t, {slot.leaf.size}"))
    w.compute(Rate.STEP)
    _precompute_splats(w, Rate.STEP)
    for slot, argument in slots:
        if slot.rate == Rate.EACH:
            base = step_base(w, bases[slot.name], slot.leaf.size)
            for k, node in w.elements.get(slot.name, ()):
                w.line(f"  %n{node} = {_load(w, argument, base, k)}")
    w.compute(Rate.EACH)
    w.lines[top:top] = _carried(w, old)


def _carried(w: Writer, old: dict[int, str]) -> list[str]:
    """The state inside the loop: from memory on the first step, then from the step before."""
    lines, element = [], 0
    for slot in w.program.state:
        for k, node in w.elements.get(f"state.{slot.name}", ()):
            following = w.value(w.program.state_nodes[element + k], w.vector)
            sources = f"[ {old[node]}, %chunks ], [ {following}, %step ]"
            lines.append(f"  %n{node} = phi {w.vector.number} {sources}")
        element += slot.leaf.size
    return lines
