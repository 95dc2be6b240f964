"""UDP payloads out of captured packets: pcap (both byte orders, micro and nano) and pcapng."""

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from boresight.errors import DataError

PCAP_MAGIC = {
    b"\xd4\xc3\xb2\xa1": "<",
    b"\x4d\x3c\xb2\xa1": "<",
    b"\xa1\xb2\xc3\xd4": ">",
    b"\xa1\xb2\x3c\x4d": ">",
}
PCAPNG_MAGIC = b"\x0a\x0d\x0d\x0a"

_VLAN = {0x8100, 0x88A8, 0x9100}
_IPV4, _IPV6, _UDP, _FRAGMENT = 0x0800, 0x86DD, 17, 44
_IPV6_OPTIONS = {0, 43, 60}
_ETHERNET, _COOKED, _COOKED_2 = 1, 113, 276
_RAW_IP = {12, 14, 101, 228, 229}
_NULL = {0, 108}


class Payload(NamedTuple):
    """Where a UDP payload lies in the packet's octets, or why there is none."""

    start: int
    end: int
    kind: str  # "udp", "fragment" or "other"


_OTHER = Payload(0, 0, "other")
_FRAGMENTED = Payload(0, 0, "fragment")


def udp_payload(data: bytes, start: int, end: int, link: int) -> Payload:
    """Find the UDP payload of one captured packet between `start` and `end`.

    Lengths come from the IP and UDP headers, so that padding of short Ethernet frames is left out.
    """
    try:
        return _network(data, *_link(data, start, link), end)
    except (struct.error, IndexError):
        return _OTHER


def is_known_link(link: int) -> bool:
    """Tell whether packets of this link type can be read."""
    return link in {_ETHERNET, _COOKED, _COOKED_2} | _RAW_IP | _NULL


def _word(data: bytes, at: int) -> int:
    return data[at] << 8 | data[at + 1]


def _link(data: bytes, at: int, link: int) -> tuple[int, int]:
    """Return the network protocol and where its header starts."""
    if link in _RAW_IP or link in _NULL:
        at += 4 * (link in _NULL)
        return (_IPV4 if data[at] >> 4 == 4 else _IPV6), at
    if link == _COOKED:
        protocol, at = _word(data, at + 14), at + 16
    elif link == _COOKED_2:
        protocol, at = _word(data, at), at + 20
    else:
        protocol, at = _word(data, at + 12), at + 14
    while protocol in _VLAN:
        protocol, at = _word(data, at + 2), at + 4
    return protocol, at


def _network(data: bytes, protocol: int, at: int, end: int) -> Payload:
    if protocol == _IPV4:
        header = 4 * (data[at] & 15)
        end = min(end, at + _word(data, at + 2)) if _word(data, at + 2) else end
        if _word(data, at + 6) & 0x3FFF:
            return _FRAGMENTED
        return _datagram(data, at + header, end) if data[at + 9] == _UDP else _OTHER
    if protocol == _IPV6:
        end = min(end, at + 40 + _word(data, at + 4)) if _word(data, at + 4) else end
        following, at = data[at + 6], at + 40
        while following in _IPV6_OPTIONS:
            following, at = data[at], at + 8 * (data[at + 1] + 1)
        if following == _FRAGMENT:
            return _FRAGMENTED
        return _datagram(data, at, end) if following == _UDP else _OTHER
    return _OTHER


def _datagram(data: bytes, at: int, end: int) -> Payload:
    length = _word(data, at + 4)
    end = min(end, at + length) if length >= 8 else end
    return Payload(at + 8, max(at + 8, end), "udp")


class Packet(NamedTuple):
    """A captured packet, and where the next one starts."""

    start: int
    end: int
    link: int
    is_cut: bool
    after: int


class PcapReader:
    """Packets of a pcap file, chunk by chunk.

    Raises:
        DataError: a link type that is not read.
    """

    name = "pcap"

    def __init__(self, head: bytes) -> None:
        self._order = PCAP_MAGIC[head[:4]]
        self.first = 24
        if len(head) < self.first:
            raise DataError(
                "the pcap file ends inside its own header",
                where=f"byte offset {len(head)}",
                next_step="record it again; nothing is in it",
            )
        (snap, link) = struct.unpack(self._order + "II", head[16:24])
        self._largest = max(snap, 262_144)
        self._link = link & 0xFFFF
        _check_link(self._link)

    def packet(self, data: bytes, at: int) -> Packet | None:
        """Return the packet whose header is at `at`, None if the data end inside it.

        Raises:
            ValueError: this is no header of a packet.
        """
        if at + 16 > len(data):
            return None
        _, fraction, kept, full = struct.unpack_from(self._order + "IIII", data, at)
        if kept > self._largest or kept > full or not kept or fraction >= 1_000_000_000:
            raise ValueError(f"a packet header says {kept} of {full} octets were captured")
        if at + 16 + kept > len(data):
            return None
        return Packet(at + 16, at + 16 + kept, self._link, kept < full, at + 16 + kept)

    def places(self, data: bytes, at: int) -> list[int]:
        """Return offsets from `at` on where a packet header may be: both lengths below 65,536."""
        octets = np.frombuffer(data, np.uint8)[at:]
        high = (10, 11, 14, 15) if self._order == "<" else (8, 9, 12, 13)
        count = max(0, len(octets) - 16)
        may_be = ~np.any([octets[shift : shift + count] for shift in high], axis=0)
        places: list[int] = (np.flatnonzero(may_be) + at).tolist()
        return places


class PcapngReader:
    """Packets of a pcapng file, chunk by chunk; it remembers the interfaces described so far."""

    name = "pcapng"
    first = 0

    def __init__(self, head: bytes) -> None:
        self._order = "<" if head[8:12] == b"\x4d\x3c\x2b\x1a" else ">"
        self._links: list[int] = []

    def packet(self, data: bytes, at: int) -> Packet | None:
        """Return the block at `at`, an empty packet if it holds none; see `PcapReader.packet`."""
        if at + 12 > len(data):
            return None
        kind, size = struct.unpack_from(self._order + "II", data, at)
        if data[at : at + 4] == PCAPNG_MAGIC:
            self._order = "<" if data[at + 8 : at + 12] == b"\x4d\x3c\x2b\x1a" else ">"
            (size,) = struct.unpack_from(self._order + "I", data, at + 4)
            self._links = []
        if size < 12 or size % 4 or size > 16_777_216:
            raise ValueError(f"a pcapng block says it is {size} octets long")
        if at + size > len(data):
            return None
        return self._read(data, at, kind, at + size)

    def places(self, data: bytes, at: int) -> Iterator[int]:
        """Yield offsets from `at` on where an enhanced packet block may start."""
        kind = struct.pack(self._order + "I", 6)
        while (at := data.find(kind, at)) >= 0:
            yield at
            at += 1

    def _read(self, data: bytes, at: int, kind: int, after: int) -> Packet:
        if kind == 1:
            (link,) = struct.unpack_from(self._order + "H", data, at + 8)
            _check_link(link)
            self._links.append(link)
        elif kind == 6:
            interface, _, _, kept, full = struct.unpack_from(self._order + "IIIII", data, at + 8)
            if interface < len(self._links) and at + 28 + kept <= after:
                link = self._links[interface]
                return Packet(at + 28, at + 28 + kept, link, kept < full, after)
        elif kind == 3 and self._links:
            (full,) = struct.unpack_from(self._order + "I", data, at + 8)
            end = min(at + 12 + full, after - 4)
            return Packet(at + 12, end, self._links[0], end < at + 12 + full, after)
        return Packet(at, at, _ETHERNET, False, after)


def _check_link(link: int) -> None:
    if not is_known_link(link):
        raise DataError(
            f"packets of link type {link} are not read",
            where="the capture's header",
            why="Ethernet, Linux cooked and raw IP are",
            next_step="capture on the interface itself, for example tcpdump -i eth0 -w FILE udp",
        )
