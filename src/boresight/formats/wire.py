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

from boresight.formats.specs import Edition, Shape

Octets = NDArray[np.uint8]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Layout(NamedTuple):
    """Where the slots of n compound items lie in the buffer."""

    offsets: NDArray[np.int32]  # (slots, n), -1 where absent
    end: Integers  # (n,)
    is_good: Flags  # (n,)


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """Where the records of the good blocks lie.

    Attributes:
        block: (n,) index of each record's block, ascending.
        start: (n,) offset of each record in the buffer.
        offsets: (slots, n) offset of each item in the buffer, -1 where absent.
        is_good: (blocks,) the block is a whole number of valid records and nothing else.
    """

    block: Integers
    start: Integers
    offsets: NDArray[np.int32]
    is_good: Flags


def walk(buffer: Octets, starts: Integers, ends: Integers, edition: Edition) -> Walk:
    """Walk through the records of blocks.

    Args:
        buffer: the octets, less than 2 GiB; may hold anything besides the blocks.
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
        rounds.append((lanes, at, layout.offsets))
        goes_on = fits & (layout.end < ends[lanes])
        lanes, at = lanes[goes_on], layout.end[goes_on]
    return _in_order(rounds, is_good, len(edition.record.slots))


def _in_order(rounds: list[Any], is_good: Flags, slots: int) -> Walk:
    """Join the rounds, by block and then by place in the block, without those of bad blocks."""
    if not rounds:
        empty = np.empty(0, np.int64)
        return Walk(empty, empty, np.empty((slots, 0), np.int32), is_good)
    if len(rounds) == 1 and is_good[rounds[0][0]].all():
        block, start, offsets = rounds[0]
        return Walk(block, start, offsets, is_good)
    block, start, offsets = (np.concatenate(p, axis=-1) for p in zip(*rounds, strict=True))
    order = np.argsort(block, kind="stable")
    order = order[is_good[block[order]]]
    return Walk(block[order], start[order], offsets[:, order], is_good)


def lay_out(buffer: Octets, at: Integers, shape: Shape) -> Layout:
    """Find the slots of compound items (or records) that start at `at` (n,)."""
    fspec, at, is_good = _read_fspec(buffer, at, shape)
    offsets = np.full((len(shape.slots), len(at)), -1, np.int32)
    for index, slot in enumerate(shape.slots):
        present = (fspec[index // 7] & (128 >> index % 7)).astype(bool)
        if slot is None or not present.any():
            continue
        np.copyto(offsets[index], at, where=present, casting="same_kind")
        if slot.shape.kind == "fixed":
            np.add(at, slot.shape.size, out=at, where=present)
            continue
        lanes = np.flatnonzero(present)
        size, is_valid = _MEASURE[slot.shape.kind](buffer, at[lanes], slot.shape)
        at[lanes] += size
        is_good[lanes] &= is_valid
    return Layout(offsets, at, is_good)


@cache
def _undefined(shape: Shape) -> tuple[int, ...]:
    """Return, octet by octet, the FSPEC bits that no item owns; one that is set is an error."""
    masks = [0] * shape.fspec
    for index in range(7 * shape.fspec):
        if index >= len(shape.slots) or shape.slots[index] is None:
            masks[index // 7] |= 128 >> index % 7
    return tuple(masks)


def _read_fspec(buffer: Octets, at: Integers, shape: Shape) -> tuple[Octets, Integers, Flags]:
    """Return FSPEC octets (octets, n), zero where there is none, the offset after and validity."""
    fspec = np.zeros((shape.fspec, len(at)), np.uint8)
    after = at.copy()
    more = np.ones(len(at), bool)
    is_good = np.ones(len(at), bool)
    for index, undefined in enumerate(_undefined(shape)):
        np.copyto(fspec[index], buffer.take(after, mode="clip"), where=more)
        after += more
        is_good &= (fspec[index] & undefined) == 0
        more = (fspec[index] & 1).astype(bool)
        if not more.any():
            break
    return fspec, after, is_good & ~more


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
