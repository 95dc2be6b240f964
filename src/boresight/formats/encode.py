"""ASTERIX from columns: the inverse of `asterix`, driven by the same table.

records = encode_records(48, "1.32", {"010/SAC": sac, "040/RHO": rho_nm, "220": address, ...})
blocks = encode_blocks(48, records, sector)
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boresight.errors import UsageError
from boresight.formats.pack import Context, as_rows, pack
from boresight.formats.specs import Shape, Slot, edition
from boresight.formats.wire import Flags, Integers, Octets

_LARGEST_BLOCK = 65_535


class Part(NamedTuple):
    """The octets of one item in n records, each row padded at its end."""

    present: Flags  # (n,)
    octets: Octets  # (n, widest)
    size: Integers  # (n,) 0 where absent


def encode_records(
    category: int, edition_name: str, columns: Mapping[str, Any], *, raw: bool = False
) -> list[bytes]:
    """Encode n records.

    Args:
        category: 10, 21, 34, 48 or 62.
        edition_name: a published edition, such as "1.32".
        columns: path of a field (see `asterix`) to its n values, or one value for all. Quantities
            are in the specification's unit and are rounded to its step; text is str or bytes;
            everything else is a whole number. Absent is NaN, None, an empty text or a masked
            entry. The fields of a repeated item are (n, k), absent from the right. Items of
            explicit length ("SP", "RE") are bytes without their length.
        raw: quantities and text are whole numbers too, as on the wire.

    Returns:
        One bytes object a record: FSPEC and items, without a block's header. An item is there
        where at least one of its columns is; its other fields are zero.

    Raises:
        UsageError: an unknown category, edition or path, or a value that its field cannot hold.
    """
    shape = edition(category, edition_name).record
    count = max((len(as_rows(values)) for values in columns.values()), default=0)
    part = _compound(shape, dict(columns), count, Context(f"CAT{category:03d}", raw))
    return [row[:size].tobytes() for row, size in zip(part.octets, part.size.tolist(), strict=True)]


def encode_block(category: int, records: Sequence[bytes]) -> bytes:
    """Join records into one block."""
    body = b"".join(records)
    if not body or len(body) + 3 > _LARGEST_BLOCK:
        raise UsageError(
            f"a block cannot hold {len(records)} records of {len(body)} octets together",
            why=f"its length, header included, is 4 to {_LARGEST_BLOCK}",
            next_step="put the records into more groups",
        )
    return bytes([category]) + (len(body) + 3).to_bytes(2, "big") + body


def encode_blocks(category: int, records: Sequence[bytes], groups: ArrayLike) -> list[bytes]:
    """Join neighbouring records of the same group (say, sector) into one block each."""
    marks = np.asarray(groups)
    edges = [0, *(np.flatnonzero(marks[1:] != marks[:-1]) + 1).tolist(), len(records)]
    return [
        encode_block(category, records[first:last])
        for first, last in pairwise(edges)
        if last > first
    ]


def _compound(shape: Shape, columns: dict[str, Any], count: int, context: Context) -> Part:
    """Encode FSPEC and items of n compound items (or records)."""
    groups = _by_item(columns)
    parts: dict[int, Part] = {}
    for index, slot in enumerate(shape.slots):
        if slot is not None and slot.name in groups:
            parts[index] = _item(slot, groups.pop(slot.name), count, context.below(slot.name))
    if groups:
        raise context.refuse(f"no item {', '.join(sorted(groups))} in this edition")
    return _join(shape, parts, count)


def _by_item(columns: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Group columns by the first name of their path; the rest of the path stays as key."""
    groups: dict[str, dict[str, Any]] = {}
    for path, values in columns.items():
        item, _, rest = path.partition("/")
        groups.setdefault(item, {})[rest] = values
    return groups


def _join(shape: Shape, parts: dict[int, Part], count: int) -> Part:
    """Put an FSPEC before items and the items one after another."""
    bits = np.zeros((count, shape.fspec, 8), np.uint8)
    for index, part in parts.items():
        bits[:, index // 7, index % 7] = part.present
    used: Flags = np.any(bits, axis=2)
    octets = np.where(np.any(used, axis=1), shape.fspec - np.argmax(used[:, ::-1], axis=1), 1)
    bits[:, :, 7] = np.arange(1, shape.fspec + 1) < octets[:, None]
    fspec = Part(np.ones(count, bool), np.packbits(bits, axis=2)[:, :, 0], octets.astype(np.int64))
    in_order = [fspec, *(parts[index] for index in sorted(parts))]
    present: Flags = np.any(used, axis=1)
    return _concatenate(in_order, present)


def _concatenate(parts: list[Part], present: Flags) -> Part:
    """Join padded rows without the padding between them."""
    total = np.sum([part.size for part in parts], axis=0).astype(np.int64)
    out = np.zeros((len(total), int(total.max(initial=0))), np.uint8)
    at = np.zeros(len(total), np.int64)
    for part in parts:
        rows, columns = np.nonzero(np.arange(part.octets.shape[1]) < part.size[:, None])
        out[rows, at[rows] + columns] = part.octets[rows, columns]
        at += part.size
    return Part(present, out, total)


def _item(slot: Slot, columns: dict[str, Any], count: int, context: Context) -> Part:
    """Encode one item of n records."""
    shape = slot.shape
    if shape.kind == "compound":
        part = _compound(shape, columns, count, context)
        return part._replace(size=part.size * part.present)
    if shape.kind == "explicit":
        return _explicit(columns[""], count, context)
    if shape.kind in ("repetitive", "fx"):
        return _repeated(shape, columns, count, context)
    octets = max(shape.size, sum(shape.parts))
    bits, present = pack(shape, columns, (count,), octets, context)
    return _extended(shape, bits, present) if shape.kind == "extended" else _plain(bits, present)


def _plain(octets: Octets, present: Flags) -> Part:
    return Part(present, octets, present * np.int64(octets.shape[1]))


def _extended(shape: Shape, octets: Octets, present: Flags) -> Part:
    """Keep the parts up to the last one that holds anything, and set FX before it."""
    ends = np.cumsum(shape.parts)
    starts = ends - shape.parts
    is_used = np.stack(
        [octets[:, a:b].any(axis=1) for a, b in zip(starts, ends, strict=True)], axis=1
    )
    parts = np.maximum(len(ends) - np.argmax(is_used[:, ::-1], axis=1), 1)
    parts = np.where(is_used.any(axis=1), parts, 1)
    for index, end in enumerate(ends[:-1]):
        octets[:, end - 1] |= (parts > index + 1).astype(np.uint8)
    return Part(present, octets, ends[parts - 1] * present)


def _repeated(shape: Shape, columns: dict[str, Any], count: int, context: Context) -> Part:
    """Encode an item repeated by count or by FX; columns are (n, k), absent from the right."""
    tables = {name: _table_of(values, count) for name, values in columns.items()}
    times = max(table.shape[1] for table in tables.values())
    octets, is_there = pack(shape, tables, (count, times), shape.size, context)
    repeats = is_there.sum(axis=1)
    if (is_there[:, 1:] & ~is_there[:, :-1]).any():
        raise context.refuse("repetitions must be absent from the right")
    if shape.kind == "fx":
        octets[:, :, -1] |= (np.arange(1, times + 1) < repeats[:, None]).astype(np.uint8)
    body = octets.reshape(count, times * shape.size)
    size = repeats * shape.size
    if shape.kind == "repetitive":
        if times > 255:
            raise context.refuse(f"{times} repetitions, and 255 is the most")
        body = np.concatenate([repeats[:, None].astype(np.uint8), body], axis=1)
        size = size + (repeats > 0)
    return Part(repeats > 0, body, size.astype(np.int64))


def _table_of(values: Any, count: int) -> NDArray[Any]:
    """Return values of repetitions as (n, k)."""
    table = values if isinstance(values, np.ndarray) else np.asarray(values)
    if table.ndim < 2:
        table = table.reshape(-1, 1)
    return np.broadcast_to(table, (count, table.shape[1])) if len(table) == 1 else table


def _explicit(values: Any, count: int, context: Context) -> Part:
    """Encode octets with their own length before them."""
    texts = [b"" if value is None else bytes(value) for value in as_rows(values)]
    texts = texts * count if len(texts) == 1 else texts
    size = np.array([len(text) + 1 if text else 0 for text in texts], np.int64)
    if size.max(initial=0) > 255:
        raise context.refuse(f"{int(size.max()) - 1} octets, and 254 are the most")
    out = np.zeros((count, int(size.max(initial=0))), np.uint8)
    for row, text in enumerate(texts):
        out[row, : size[row]] = np.frombuffer(bytes([size[row]]) + text, np.uint8)[: size[row]]
    return Part(size > 0, out, size)
