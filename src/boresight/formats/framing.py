"""Finds by itself how a recording wraps its ASTERIX blocks, and unwraps them chunk by chunk.

    raw        blocks one after another
    pcap       UDP in Ethernet (VLAN, QinQ), Linux cooked or raw IP; IPv4 and IPv6; see `packets`
    pcapng     the same
    final      length (2, all of it), board, line, day, time (3, 10 ms), blocks, A5 A5 A5 A5
    ioss-seq   the same with a sequence number (4) after the length
    oradis     length (2, all of it), time (4), blocks
    gps        2,200 octets, then blocks with 10 octets after each
    rff        128 octets, then frames: time (4), length (2, least octet first), blocks
The last five follow what open decoders agree on; none of them was tried on a real recording here.
"""

import struct
from collections import Counter
from dataclasses import dataclass, field
from typing import Protocol

from boresight.formats.blocks import ASSIGNED, HEADER, LARGEST, Region, follow
from boresight.formats.packets import (
    PCAP_MAGIC,
    PCAPNG_MAGIC,
    PcapngReader,
    PcapReader,
    udp_payload,
)

_ENOUGH = 8  # frames in a row that settle the question


@dataclass(slots=True)
class Payloads:
    """What one buffer held: payloads that hold blocks, damage, counts, and where to go on."""

    starts: list[int] = field(default_factory=list)
    ends: list[int] = field(default_factory=list)
    damage: list[Region] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    stop: int = 0


class Framing(Protocol):
    """A way of wrapping blocks."""

    @property
    def name(self) -> str:
        """As `boresight inspect` prints it."""
        ...

    @property
    def first(self) -> int:
        """Octets of the file before the first frame."""
        ...

    def unwrap(self, data: bytes, *, more: bool) -> Payloads:
        """Return the payloads of whole frames in `data`; `stop` is where the next frame starts."""
        ...


class Raw:
    """Nothing is wrapped: one payload, whose last block may be cut by the buffer's end."""

    name = "raw"
    first = 0

    def unwrap(self, data: bytes, *, more: bool) -> Payloads:  # noqa: ARG002  (Framing's signature)
        """See `Framing`."""
        return Payloads([0], [len(data)], stop=len(data))


@dataclass(frozen=True, slots=True)
class Frames:
    """A recorder's frames: a head with a length, blocks, a tail.

    Attributes:
        name, first: see `Framing`.
        head: octets before the blocks.
        length: format and offset of the length in the frame.
        counts_all: the length counts head and tail too.
        tail: octets after the blocks.
        mark: what the tail is, where it is always the same.
    """

    name: str
    first: int
    head: int
    length: tuple[str, int]
    counts_all: bool
    tail: int
    mark: bytes = b""

    def after(self, data: bytes, at: int) -> int:
        """Return where the frame at `at` ends; 0 if it is none, -1 if the data end inside it."""
        fixed = self.head + self.tail
        if at + max(fixed, self.head + HEADER) > len(data):
            return -1
        (length,) = struct.unpack_from(self.length[0], data, at + self.length[1])
        end = at + length + (0 if self.counts_all else fixed)
        body = end - self.tail - at - self.head
        block = at + self.head
        inner = data[block + 1] << 8 | data[block + 2]
        if data[block] not in ASSIGNED or inner <= HEADER or inner > body:
            return 0
        if end > len(data):
            return -1
        return end if data[end - self.tail : end].startswith(self.mark) else 0

    def unwrap(self, data: bytes, *, more: bool) -> Payloads:
        """See `Framing`."""
        found, at = Payloads(), 0
        while at < len(data):
            after = self.after(data, at)
            if after > 0:
                found.starts.append(at + self.head)
                found.ends.append(after - self.tail)
            elif after < 0 and more and len(data) - at <= LARGEST + self.head + self.tail:
                break
            else:
                after = self._next(data, at + 1)
                found.damage.append(Region(at, after, f"no {self.name} frame starts here"))
            at = after
        found.stop = at
        return found

    def _next(self, data: bytes, at: int) -> int:
        """Return where two frames follow one another again, or the last one ends the data."""
        candidate = self._place(data, at)
        while candidate < len(data):
            after = self.after(data, candidate)
            if after > 0 and (after == len(data) or self.after(data, after) != 0):
                return candidate
            candidate = self._place(data, candidate + 1)
        return len(data)

    def _place(self, data: bytes, at: int) -> int:
        """Return the first offset from `at` on where a frame may start: after a tail's mark."""
        if not self.mark:
            return at
        mark = data.find(self.mark, at - len(self.mark))
        return mark + len(self.mark) if mark >= 0 else len(data)


class Packets:
    """UDP payloads of a capture."""

    def __init__(self, reader: PcapReader | PcapngReader) -> None:
        self._reader = reader
        self.name, self.first = reader.name, reader.first

    def unwrap(self, data: bytes, *, more: bool) -> Payloads:
        """See `Framing`."""
        found, at = Payloads(), 0
        while at < len(data):
            try:
                packet = self._reader.packet(data, at)
            except ValueError as error:
                after = self._next(data, at + 1)
                found.damage.append(Region(at, after, str(error)))
                at = after
                continue
            if packet is None:
                if not more:
                    found.damage.append(Region(at, len(data), "the file ends inside a packet"))
                    at = len(data)
                break
            self._keep(found, data, packet.start, packet.end, packet.link, is_cut=packet.is_cut)
            at = packet.after
        found.stop = at
        return found

    def _keep(
        self, found: Payloads, data: bytes, start: int, end: int, link: int, *, is_cut: bool
    ) -> None:
        if start == end:
            return
        payload = udp_payload(data, start, end, link)
        found.counts["packets"] += 1
        if payload.kind != "udp":
            found.counts[f"{payload.kind} packets"] += 1
        elif payload.end <= payload.start or data[payload.start] not in ASSIGNED:
            found.counts["other packets"] += 1
        else:
            found.counts["cut packets"] += is_cut
            found.starts.append(payload.start)
            found.ends.append(payload.end)

    def _next(self, data: bytes, at: int) -> int:
        """Return where three packets follow one another again, or the end."""
        places = self._reader.places(data, at)
        return next((place for place in places if self._leads_on(data, place)), len(data))

    def _leads_on(self, data: bytes, at: int) -> bool:
        for _ in range(3):
            try:
                packet = self._reader.packet(data, at)
            except ValueError:
                return False
            if packet is None:
                return False
            at = packet.after
            if at == len(data):
                return True
        return True


RECORDERS = (
    Frames("final", 0, 8, (">H", 0), True, 4, b"\xa5" * 4),
    Frames("ioss-seq", 0, 12, (">H", 0), True, 4, b"\xa5" * 4),
    Frames("oradis", 0, 6, (">H", 0), True, 0),
    Frames("gps", 2200, 0, (">H", 1), False, 10),
    Frames("rff", 128, 6, ("<H", 4), False, 0),
)


def detect(head: bytes) -> Framing:
    """Find the framing from a file's first octets (a megabyte is plenty)."""
    if head[:4] in PCAP_MAGIC:
        return Packets(PcapReader(head))
    if head[:4] == PCAPNG_MAGIC:
        return Packets(PcapngReader(head))
    best = max(RECORDERS, key=lambda frames: _in_a_row(frames, head))
    row = _in_a_row(best, head)
    is_whole = best.after(head, best.first) == len(head)
    plain = len(follow(head, 0, min(len(head), LARGEST)).starts)
    return best if row > plain and (row > 1 or is_whole) else Raw()


def _in_a_row(frames: Frames, head: bytes) -> int:
    """Count frames from the first on, or from a tail mark on where the first is damaged."""
    mark = head.find(frames.mark, frames.first) + len(frames.mark) if frames.mark else 0
    return max(_count(frames, head, frames.first), _count(frames, head, mark) if mark else 0)


def _count(frames: Frames, head: bytes, at: int) -> int:
    count = 0
    while count < _ENOUGH and (after := frames.after(head, at)) > 0:
        end = after - frames.tail
        if follow(head, at + frames.head, end).stop != end:
            break
        at = after
        count += 1
    return count
