"""ASTERIX records by columns: every field of a million records is a handful of NumPy calls.

A `path` names a field: item, sub-items, field, joined by `/`, with the names of the specification
without its category: `040/RHO`, `130/SRL`, `140`, `380/IAS/IM`.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.formats.specs import Edition, Field, Shape
from boresight.formats.wire import Flags, Integers, Octets, fx_count, lay_out, part_count, walk

_SIX_BIT = np.frombuffer(
    b" ABCDEFGHIJKLMNOPQRSTUVWXYZ                     0123456789      ", np.uint8
)


class Cells(NamedTuple):
    """The places of one field: record of each, and the raw number there."""

    record: Integers
    raw: NDArray[np.int64]
    field: Field


@dataclass(frozen=True, eq=False)
class Records:
    """Records of one category and edition, in the order of the file.

    Attributes:
        edition: the layout they were read by.
        buffer: the octets they lie in.
        block: (n,) index of each record's block among those given.
        start: (n,) offset of each record in the buffer.
        offsets: (slots, n) offset of each item in the buffer, -1 where absent.
        is_good: (blocks,) whether the block was read; records of other blocks are not here.
    """

    edition: Edition
    buffer: Octets
    block: Integers
    start: Integers
    offsets: NDArray[np.int32]
    is_good: Flags

    def __len__(self) -> int:
        return len(self.block)

    def take(self, rows: NDArray[np.intp] | Flags) -> "Records":
        """Return some of the records."""
        return Records(
            self.edition,
            self.buffer,
            self.block[rows],
            self.start[rows],
            self.offsets[:, rows],
            self.is_good,
        )

    def has(self, path: str) -> Flags:
        """Return (n,) whether the item or sub-item is present; false where the edition lacks it."""
        found = np.zeros(len(self), bool)
        located = self._locate(path)
        if located is not None:
            found[located[0]] = True
        return found

    def cells(self, path: str) -> Cells | None:
        """Return every occurrence of a field, repeated items flattened in order.

        None where the edition has no such field.
        """
        located = self._locate(path)
        if located is None:
            return None
        rows, at, shape, name = located
        try:
            field = shape.field(name)
        except KeyError:
            return None
        rows, at = _occurrences(self.buffer, rows, at, shape, field)
        return Cells(rows, read_bits(self.buffer, at, field), field)

    def raw(self, path: str, absent: int = 0) -> NDArray[np.int64]:
        """Return (n,) the field as a whole number, two's complement where signed.

        Of a repeated item the first occurrence counts.
        """
        values = np.full(len(self), absent, np.int64)
        cells = self.cells(path)
        if cells is not None:
            values[cells.record[::-1]] = cells.raw[::-1]
        return values

    def flag(self, path: str) -> Flags:
        """Return (n,) whether the field is there and not zero."""
        return np.not_equal(self.raw(path), 0)

    def value(self, path: str) -> NDArray[np.float64]:
        """Return (n,) the field in the unit of the specification, NaN where absent."""
        values = np.full(len(self), np.nan)
        cells = self.cells(path)
        if cells is not None:
            values[cells.record[::-1]] = cells.raw[::-1] * cells.field.lsb
        return values

    def text(self, path: str) -> NDArray[np.bytes_]:
        """Return (n,) a text field without its padding, empty where absent."""
        cells = self.cells(path)
        if cells is None:
            return np.zeros(len(self), "S1")
        texts = letters(cells.raw, cells.field)
        values = np.zeros(len(self), texts.dtype)
        values[cells.record] = texts
        return np.strings.rstrip(values, b" ")

    def explicit(self, path: str) -> list[bytes | None]:
        """Return (n,) the octets of an item of explicit length, without the length."""
        values: list[bytes | None] = [None] * len(self)
        located = self._locate(path)
        if located is not None:
            for row, at in zip(located[0], located[1], strict=True):
                values[row] = self.buffer[at + 1 : at + int(self.buffer[at])].tobytes()
        return values

    @cached_property
    def _layouts(self) -> dict[str, NDArray[np.int32]]:
        return {}

    def _locate(self, path: str) -> tuple[Integers, Integers, Shape, str] | None:
        """Follow a path to its last item: rows that have it, offsets, shape, rest of the path."""
        item, *rest = path.split("/")
        frn = self.edition.frn(item)
        if frn is None:
            return None
        slot = self.edition.record.slots[frn]
        assert slot is not None  # noqa: S101  (frn finds no spare slot)
        shape = slot.shape
        rows = np.flatnonzero(self.offsets[frn] >= 0)
        at = self.offsets[frn, rows].astype(np.int64)
        while shape.kind == "compound" and rest:
            names = [sub.name if sub else "" for sub in shape.slots]
            if rest[0] not in names:
                return None
            index = names.index(rest.pop(0))
            offsets = self._inside(item, at, shape)[index].astype(np.int64)
            rows, at = rows[offsets >= 0], offsets[offsets >= 0]
            sub = shape.slots[index]
            assert sub is not None  # noqa: S101  (a name was found)
            shape, item = sub.shape, f"{item}/{sub.name}"
        return rows, at, shape, "/".join(rest)

    def _inside(self, item: str, at: Integers, shape: Shape) -> NDArray[np.int32]:
        """Lay a compound item out once, however many of its fields are asked for."""
        if item not in self._layouts:
            self._layouts[item] = lay_out(self.buffer, at, shape).offsets
        return self._layouts[item]


def decode(buffer: Octets, starts: Integers, ends: Integers, edition: Edition) -> Records:
    """Read whole blocks of one category; see `boresight.formats.wire.walk` for the arguments."""
    found = walk(buffer, starts, ends, edition)
    return Records(edition, buffer, found.block, found.start, found.offsets, found.is_good)


def _occurrences(
    buffer: Octets, rows: Integers, at: Integers, shape: Shape, field: Field
) -> tuple[Integers, Integers]:
    """Return record and item offset of each occurrence of `field`."""
    if shape.kind == "extended":
        ends = np.cumsum(shape.parts) * 8
        part = int(np.searchsorted(ends, field.offset, side="right"))
        has_part = part_count(buffer, at, shape) > part
        return rows[has_part], at[has_part]
    if shape.kind == "repetitive":
        return _repeat(rows, at + 1, buffer[at].astype(np.int64), shape.size)
    if shape.kind == "fx":
        return _repeat(rows, at, fx_count(buffer, at, shape), shape.size)
    return rows, at


def _repeat(rows: Integers, at: Integers, count: Integers, size: int) -> tuple[Integers, Integers]:
    first = np.cumsum(count) - count
    index = np.arange(int(count.sum())) - np.repeat(first, count)
    return np.repeat(rows, count), np.repeat(at, count) + size * index


def read_bits(buffer: Octets, at: Integers, field: Field) -> NDArray[np.int64]:
    """Return (n,) the number in `field` of the items at `at`, sign extended where it has a sign."""
    first, last = field.offset // 8, -(-(field.offset + field.width) // 8)
    raw = np.zeros(len(at), np.uint64)
    for index in range(first, last):
        raw = (raw << np.uint64(8)) | buffer.take(at + index, mode="clip")
    raw = raw >> np.uint64(8 * last - field.offset - field.width)
    if field.width < 64:
        raw = raw & np.uint64((1 << field.width) - 1)
    values = raw.astype(np.int64)
    if field.is_signed:
        values -= (values >> (field.width - 1) & 1) << field.width
    return values


def letters(raw: NDArray[np.int64], field: Field) -> NDArray[np.bytes_]:
    """Return (n,) text of raw numbers: six-bit or ASCII characters, or octal digits."""
    bits = {"c": 6, "a": 8, "o": 3}[field.kind]
    count = field.width // bits
    shifts = np.arange(count - 1, -1, -1) * bits
    codes = (raw[:, None] >> shifts) & ((1 << bits) - 1)
    if field.kind == "c":
        octets = _SIX_BIT[codes]
    else:
        octets = (codes + (ord("0") if field.kind == "o" else 0)).astype(np.uint8)
    return np.ascontiguousarray(octets).view(f"S{count}")[:, 0]
