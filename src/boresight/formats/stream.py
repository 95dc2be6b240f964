"""A recording as a stream of decoded batches: chunk by chunk, damage skipped, counted and told."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from boresight.errors import DataError
from boresight.formats import blocks
from boresight.formats.blocks import Region
from boresight.formats.decoding import Account, Batch, Chunk, decode_chunk
from boresight.formats.framing import Framing, Payloads, Raw, detect
from boresight.formats.salvage import calm_end, salvage
from boresight.formats.specs import categories

CHUNK = 16 * 1024 * 1024
_HEAD = 1024 * 1024
_TOLD = 1_000  # damaged places listed one by one

Progress = Callable[[int, int], None]


def stream(
    path: Path,
    account: Account,
    *,
    strict: bool = False,
    chunk: int = CHUNK,
    progress: Progress | None = None,
) -> Iterator[Batch]:
    """Read an ASTERIX recording.

    Args:
        path: a file that can be read.
        account: filled while reading.
        strict: stop at the first damage.
        chunk: octets read at a time; the memory needed follows it.
        progress: called with octets read and their total.

    Raises:
        DataError: it is no ASTERIX recording; or, with `strict`, something in it is damaged.
    """
    account.bytes = path.stat().st_size
    with path.open("rb") as file:
        framing = detect(file.read(_HEAD))
        account.framing = framing.name
        file.seek(framing.first)
        base, rest, more = framing.first, b"", True
        while more:
            read = file.read(chunk)
            more = len(read) == chunk
            data = rest + read
            batches, stop = _read(framing, data, base, account, more=more, strict=strict)
            yield from batches
            rest, base = data[stop:], base + stop
            if progress is not None:
                progress(base, account.bytes)
    _refuse_other_formats(path, account)


def _read(
    framing: Framing, data: bytes, base: int, account: Account, *, more: bool, strict: bool
) -> tuple[list[Batch], int]:
    """Decode one buffer; return its records and where the next buffer starts."""
    part, stop = _split(framing, data, base, account, more=more)
    is_open = more and isinstance(framing, Raw)
    if is_open and len(part.starts):
        stop = _settled(part, stop)
        part = part.until(stop)
    batches, is_good = decode_chunk(part, account)
    calm = calm_end(part, is_good, stop) if is_open else stop
    if calm < stop:
        part, stop = part.until(calm), calm
        batches, is_good = decode_chunk(part, account)
    found = salvage(part, batches, is_good, account)
    account.unknown.update(found.unknown)
    account.decoded += sum(len(batch.records) for batch in found.batches)
    _tell(found.damage, base, account, strict=strict)
    return found.batches, stop


def _settled(part: Chunk, stop: int) -> int:
    """Return the start of the last block that is read: what follows may show that it is none."""
    read = part.starts[np.isin(part.octets[part.starts], categories())]
    near = read[read >= stop - 2 * blocks.LARGEST]
    return int(near[-1] if len(near) else part.starts[-1])


def _split(
    framing: Framing, data: bytes, base: int, account: Account, *, more: bool
) -> tuple[Chunk, int]:
    """Unwrap and split one buffer; return it with where the next one starts."""
    found = framing.unwrap(data, more=more)
    account.counts.update(found.counts)
    if isinstance(framing, Raw):
        split = blocks.split(data, 0, len(data), more=more)
        starts, ends, gaps, stop = split
    else:
        starts, ends, gaps = _split_payloads(data, found, account)
        stop = found.stop
    octets = np.frombuffer(data, np.uint8)
    arrays = np.array(starts, np.int64), np.array(ends, np.int64)
    return Chunk(octets, base, *arrays, gaps), stop


def _split_payloads(
    data: bytes, found: Payloads, account: Account
) -> tuple[list[int], list[int], list[Region]]:
    """Split every payload into blocks; what a recorder appends to one is left out."""
    starts: list[int] = []
    ends: list[int] = []
    gaps = list(found.damage)
    for start, end in zip(found.starts, found.ends, strict=True):
        inside = blocks.follow(data, start, end)
        starts += inside.starts
        ends += inside.ends
        rest = end - inside.stop
        if not inside.starts or _is_cut_block(data, inside.stop, end):
            gaps.append(Region(inside.stop, end, blocks.why_not(data, inside.stop, end)))
        elif rest:
            account.trailing += rest
            account.counts["payloads with trailing octets"] += 1
    return starts, ends, gaps


def _is_cut_block(data: bytes, at: int, end: int) -> bool:
    """Tell a second block that is damaged from the few octets that recorders append."""
    return end - at >= 32 and data[at] in categories() and data[at + 1] < 8


def _tell(damage: list[Region], base: int, account: Account, *, strict: bool) -> None:
    """Count damage; with `strict`, raise for the first."""
    for start, end, reason in damage:
        account.skipped += end - start
        account.damaged_places += 1
        if len(account.damaged) < _TOLD:
            account.damaged.append({"offset": base + start, "reason": reason})
        if strict:
            raise DataError(
                "the recording is damaged",
                where=f"byte offset {base + start}",
                why=reason,
                next_step="read it without --strict: what is damaged is then skipped and counted",
            )


def _refuse_other_formats(path: Path, account: Account) -> None:
    """Raise if nothing was decoded, or so little that chance explains it."""
    if account.decoded and account.skipped <= 0.9 * account.bytes:
        return
    if account.unknown and not account.decoded and 2 * account.skipped < account.bytes:
        what = ", ".join(
            f"{category} ({n} blocks)" for category, n in sorted(account.unknown.items())
        )
        why = f"it holds category {what}; read are {', '.join(map(str, categories()))}"
    elif account.damaged:
        first = account.damaged[0]
        why = f"first at byte {first['offset']}: {first['reason']}"
    else:
        why = "no packet of it holds an ASTERIX block" if account.counts else "it holds no block"
    raise DataError(
        f"{path.name} holds no ASTERIX data that can be read",
        where=f"byte offset {account.damaged[0]['offset'] if account.damaged else 0}",
        why=why,
        next_step=f"look at its first octets: xxd {path.name} | head",
    )
