"""Where every item of every record lies, for all blocks at once.

Blocks are lanes. In each round all lanes read the FSPEC of their next record together; then, FRN by
FRN, the lanes that have the item take its length from its shape. A record is a compound item whose
slots are the user application profile, so one function serves both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.formats.specs import Edition, Shape, Slot

Octets = NDArray[np.uint8]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Layout(NamedTuple):
    """Where the slots of n compound items lie in the buffer."""

    offsets: Integers  # (n, slots), -1 where absent
    end: Integers  # (n,)
    is_good: Flags  # (n,)


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """Where the records of the good blocks lie.

    Attributes:
        block: (n,) index of each record's block, ascending.
        start: (n,) offset of each record in the buffer.
        offsets: (n, slots) offset of each item in the buffer, -1 where absent.
        is_good: (blocks,) the block is a whole number of valid records and nothing else.
    """

    block: Integers
    start: Integers
    offsets: NDArray[np.int32]
    is_good: Flags


def walk(buffer: Octets, starts: Integers, ends: Integers, edition: Edition) -> Walk:
    """Walk through the records of blocks.

    Args:
        buffer: the octets; may hold anything besides the blocks.
        starts: (blocks,) offset of each block's category octet.
        ends: (blocks,) offset after each block's last octet, at most `len(buffer)`.
        edition: the layout to read them by.
    """
    is_good = ends > starts + 3
    lanes = np.flatnonzero(is_good)
    at = starts[lanes] + 3
    rounds = []
    while lanes.size:
        layout = lay_out(buffer, at, edition.record)
        fits = layout.is_good & (layout.end <= ends[lanes])
        is_good[lanes[~fits]] = False
        rounds.append((lanes, at, layout.offsets.astype(np.int32)))
        goes_on = fits & (layout.end < ends[lanes])
        lanes, at = lanes[goes_on], layout.end[goes_on]
    return _in_order(rounds, is_good, len(edition.record.slots))


def _in_order(rounds: list[Any], is_good: Flags, slots: int) -> Walk:
    """Join the rounds, by block and then by place in the block, without those of bad blocks."""
    if not rounds:
        empty = np.empty(0, np.int64)
        return Walk(empty, empty, np.empty((0, slots), np.int32), is_good)
    block, start, offsets = (np.concatenate(parts) for parts in zip(*rounds, strict=True))
    order = np.argsort(block, kind="stable")
    order = order[is_good[block[order]]]
    return Walk(block[order], start[order], offsets[order], is_good)


def lay_out(buffer: Octets, at: Integers, shape: Shape) -> Layout:
    """Find the slots of compound items (or records) that start at `at` (n,)."""
    present, at, is_good = _read_fspec(buffer, at, shape)
    offsets = np.full(present.shape, -1, np.int64)
    for first, last, sizes in _plan(shape):
        if sizes is not None:
            here = present[:, first:last]
            after = at[:, None] + np.cumsum(here * sizes, axis=1)
            offsets[:, first:last] = np.where(here, after - sizes, -1)
            at = after[:, -1]
            continue
        lanes = np.flatnonzero(present[:, first])
        if lanes.size:
            slot = shape.slots[first]
            assert slot is not None  # noqa: S101  (a lane with a spare bit set is bad, not present)
            offsets[lanes, first] = at[lanes]
            size, is_valid = _MEASURE[slot.shape.kind](buffer, at[lanes], slot.shape)
            at[lanes] += size
            is_good[lanes] &= is_valid
    return Layout(offsets, at, is_good)


@cache
def _plan(shape: Shape) -> tuple[tuple[int, int, Any], ...]:
    """Split slots into runs of fixed items, which one sum places, and single other items."""
    steps: list[tuple[int, int, Any]] = []
    for index, slot in enumerate(shape.slots):
        size = _fixed_size(slot)
        if size is None:
            steps.append((index, index + 1, None))
        elif steps and steps[-1][2] is not None:
            first, _, sizes = steps[-1]
            steps[-1] = (first, index + 1, np.append(sizes, size))
        else:
            steps.append((index, index + 1, np.array([size])))
    return tuple(steps)


def _fixed_size(slot: Slot | None) -> int | None:
    if slot is None:
        return 0
    return slot.shape.size if slot.shape.kind == "fixed" else None


@cache
def _undefined(shape: Shape) -> NDArray[np.intp]:
    """Return the FSPEC bits that no item owns: one that is set makes the record bad."""
    spare = [index for index, slot in enumerate(shape.slots) if slot is None]
    return np.array([*spare, *range(len(shape.slots), 7 * shape.fspec)], np.intp)


def _read_fspec(buffer: Octets, at: Integers, shape: Shape) -> tuple[Flags, Integers, Flags]:
    """Return the presence of each slot (n, slots), the offset after the FSPEC and validity."""
    octets = np.zeros((len(at), shape.fspec), np.uint8)
    more = np.ones(len(at), bool)
    size = np.zeros(len(at), np.int64)
    for index in range(shape.fspec):
        octet = buffer.take(at + index, mode="clip")
        octets[:, index] = octet * more
        size += more
        more = more & (octet & 1).astype(bool)
        if not more.any():
            break
    bits = np.unpackbits(octets, axis=1).reshape(len(at), shape.fspec, 8)[:, :, :7]
    present = bits.reshape(len(at), 7 * shape.fspec).astype(bool)
    is_good = ~more & ~present[:, _undefined(shape)].any(axis=1)
    present[:, _undefined(shape)] = False
    return present[:, : len(shape.slots)], at + size, is_good


def part_count(buffer: Octets, at: Integers, shape: Shape) -> Integers:
    """Return how many parts extended items have; one more than there are if FX never ends."""
    count = np.ones(len(at), np.int64)
    more = np.ones(len(at), bool)
    end = 0
    for index, octets in enumerate(shape.parts):
        end += octets
        if index + 1 < len(shape.parts) or shape.is_open:
            more = more & (buffer.take(at + end - 1, mode="clip") & 1).astype(bool)
            count += more
    return count


def _measure_extended(buffer: Octets, at: Integers, shape: Shape) -> tuple[Integers, Flags]:
    count = part_count(buffer, at, shape)
    is_good = count <= len(shape.parts)
    ends = np.cumsum(shape.parts)
    return ends[np.minimum(count, len(ends)) - 1].astype(np.int64), is_good


def _measure_repetitive(buffer: Octets, at: Integers, shape: Shape) -> tuple[Integers, Flags]:
    count = buffer.take(at, mode="clip").astype(np.int64)
    return 1 + shape.size * count, np.ones(len(at), bool)


def fx_count(buffer: Octets, at: Integers, shape: Shape) -> Integers:
    """Return how many repetitions items repeated by FX have."""
    count = np.zeros(len(at), np.int64)
    lanes = np.arange(len(at))
    while lanes.size:
        count[lanes] += 1
        last = at[lanes] + shape.size * count[lanes] - 1
        more = (buffer.take(last, mode="clip") & 1).astype(bool) & (last < len(buffer))
        lanes = lanes[more]
    return count


def _measure_fx(buffer: Octets, at: Integers, shape: Shape) -> tuple[Integers, Flags]:
    return shape.size * fx_count(buffer, at, shape), np.ones(len(at), bool)


def _measure_explicit(buffer: Octets, at: Integers, _: Shape) -> tuple[Integers, Flags]:
    size = buffer.take(at, mode="clip").astype(np.int64)
    return size, size > 0


def _measure_compound(buffer: Octets, at: Integers, shape: Shape) -> tuple[Integers, Flags]:
    layout = lay_out(buffer, at, shape)
    return layout.end - at, layout.is_good


_MEASURE: dict[str, Callable[[Octets, Integers, Shape], tuple[Integers, Flags]]] = {
    "extended": _measure_extended,
    "repetitive": _measure_repetitive,
    "fx": _measure_fx,
    "explicit": _measure_explicit,
    "compound": _measure_compound,
}
