"""What a kernel writes: each lane's numbers, at every step or after the last, and sums over lanes.

Sums are added in one binary tree over the lanes of a block, ((0 + 1) + (2 + 3)) + ..., and never
fused with what is summed: they are the same bits however many lanes one instruction has.
"""

from boresight.lanes.places import address, lane_base, step_base
from boresight.lanes.program import Rate, Slot
from boresight.lanes.writer import Writer


def _store(w: Writer, argument: str, base: str, element: int, value: str) -> None:
    place, kind = address(w, argument, base, element), w.vector
    if not w.shape.rows:
        w.line(f"  store {kind.number} {value}, ptr {place}, align 8")
        return
    width = w.shape.width
    w.line(
        f"  call void @llvm.masked.scatter.{kind.suffix}f64.{kind.suffix}p0({kind.number} {value}, "
        f"<{width} x ptr> {place}, i32 8, {kind.bit} splat (i1 true))"
    )


def _store_turned(w: Writer, bases: str, element: int, values: list[str]) -> None:
    """Several numbers of W lanes, turned so that each lane's lie side by side: a store a lane.

    A scatter of every number costs twice as much.
    """
    width, some = w.shape.width, len(values)
    rows = [*values, *["poison"] * (width - some)]
    distance = 1
    while distance < width:
        for i in (i for i in range(width) if not i & distance):
            rows[i], rows[i + distance] = _sides(w, rows[i], rows[i + distance], distance)
        distance *= 2
    for lane, row in enumerate(rows):
        start = w.emit(f"extractelement <{width} x ptr> {bases}, i64 {lane}")
        place = w.emit(f"getelementptr double, ptr {start}, i64 {element}")
        w.line(f"  store {_part(w, row, some)}, ptr {place}, align 8")


def _store_sums(w: Writer, argument: str, base: str, element: int, values: list[str]) -> None:
    """The sums over W lanes of up to W numbers, side by side: W numbers take W - 1 additions."""
    width, some = w.shape.width, len(values)
    rows, distance = values, 1
    while distance < width:
        pairs = [(rows[i], [*rows, "poison"][i + 1]) for i in range(0, len(rows), 2)]
        sides = [_sides(w, a, b, distance) for a, b in pairs]
        rows = [w.emit(f"fadd {w.vector.number} {low}, {high}") for low, high in sides]
        distance *= 2
    index = w.emit(f"add i64 {base}, {element}")
    place = w.emit(f"getelementptr double, ptr {argument}, i64 {index}")
    w.line(f"  store {_part(w, rows[0], some)}, ptr {place}, align 8")


def _sides(w: Writer, first: str, second: str, distance: int) -> tuple[str, str]:
    """Two vectors as two by 2 x 2 squares turned: lanes without the bit `distance`, and with it."""
    width, kind = w.shape.width, w.vector.number
    low = [p + width - distance if p & distance else p for p in range(width)]
    high = [p + width if p & distance else p + distance for p in range(width)]
    pair = f"{kind} {first}, {kind} {second}"
    return _shuffle(w, pair, low), _shuffle(w, pair, high)


def _part(w: Writer, row: str, some: int) -> str:
    """The first lanes of a vector, with their type."""
    kind = w.vector.number
    if some == w.shape.width:
        return f"{kind} {row}"
    if some == 1:  # LLVM 22 aborts on vectors of one lane
        return f"double {w.emit(f'extractelement {kind} {row}, i64 0')}"
    return f"<{some} x double> {_shuffle(w, f'{kind} {row}, {kind} poison', list(range(some)))}"


def _shuffle(w: Writer, pair: str, mask: list[int]) -> str:
    places = ", ".join(f"i32 {p}" for p in mask)
    return w.emit(f"shufflevector {pair}, <{len(mask)} x i32> <{places}>")


def output_base(w: Writer, slot: Slot, argument: str) -> str:
    """Where this chunk's numbers of an output begin."""
    if slot.rate != Rate.STEP:
        return lane_base(w, argument, slot.leaf.size, "%steps" if slot.rate == Rate.EACH else "1")
    numbers = w.emit(f"mul i64 %steps, {slot.leaf.size}")
    return w.emit(f"mul i64 %chunk, {numbers}")


def write_outputs(w: Writer, results: list[str], bases: list[str], rates: tuple[Rate, ...]) -> None:
    """Store the outputs of some rates, as many numbers at once as there are lanes."""
    for slot, numbers, argument, base in zip(
        w.program.outputs, w.program.output_nodes, results, bases, strict=True
    ):
        if slot.rate in rates:
            values = [w.value(node, w.vector) for node in numbers]
            write = _write_sums if slot.rate == Rate.STEP else _write_lanes
            write(w, slot, argument, base, values)


def _write_lanes(w: Writer, slot: Slot, argument: str, base: str, values: list[str]) -> None:
    place = step_base(w, base, slot.leaf.size) if slot.rate == Rate.EACH else base
    k, count = 0, len(values)
    while k < count:  # the largest power of two that is left, but no more than the lanes
        some = min(w.shape.width, 1 << (count - k).bit_length() - 1) if w.shape.rows else 1
        if some == 1:
            _store(w, argument, place, k, values[k])
        else:
            _store_turned(w, place, k, values[k : k + some])
        k += some


def _write_sums(w: Writer, slot: Slot, argument: str, base: str, values: list[str]) -> None:
    moved = w.emit(f"mul i64 %t, {slot.leaf.size}")
    place = w.emit(f"add i64 {base}, {moved}")
    for k in range(0, len(values), w.shape.width):
        _store_sums(w, argument, place, k, values[k : k + w.shape.width])
