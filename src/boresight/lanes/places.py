"""Where numbers lie in memory: a block's, or a row's, in a kernel's arguments."""

from boresight.lanes.writer import Writer

BLOCK = 8  # lanes of one block in memory, whatever the processor


def address(w: Writer, argument: str, base: str, element: int) -> str:
    """Pointer (blocked) or pointers (rows) of one number of the W lanes."""
    if not w.shape.rows:
        index = w.emit(f"add i64 {base}, {element * BLOCK}")
        return w.emit(f"getelementptr double, ptr {argument}, i64 {index}")
    width = w.shape.width
    return w.emit(f"getelementptr double, <{width} x ptr> {base}, i64 {element}")


def lane_base(w: Writer, argument: str, size: int, steps: str) -> str:
    """Where the data of this chunk's lanes begin in an argument of `size` numbers a step."""
    numbers = w.emit(f"mul i64 {steps}, {size}")
    if not w.shape.rows:
        start = w.emit(f"mul i64 %block, {numbers}")
        scaled = w.emit(f"mul i64 {start}, {BLOCK}")
        return w.emit(f"add i64 {scaled}, %inside")
    offsets = w.emit(f"mul {w.vector.integer} %lane, {w.splat(numbers, 'i64')}")
    return w.emit(f"getelementptr double, ptr {argument}, {w.vector.integer} {offsets}")


def step_base(w: Writer, base: str, size: int) -> str:
    """`base` moved to step %t."""
    if not w.shape.rows:
        moved = w.emit(f"mul i64 %t, {size * BLOCK}")
        return w.emit(f"add i64 {base}, {moved}")
    moved = w.emit(f"mul i64 %t, {size}")
    return w.emit(f"getelementptr double, <{w.shape.width} x ptr> {base}, i64 {moved}")
