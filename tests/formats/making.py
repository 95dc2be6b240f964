"""Recordings made on the spot: a radar, its blocks, and the ways recorders wrap them."""

import struct

import numpy as np

from boresight.formats.encode import encode_block, encode_records

SAC, SIC = 25, 100


def radar_columns(count, *, start_s=40_000.0, targets=20, scan_s=4.0):
    """Columns of CAT048 reports: `targets` aircraft, one report each a scan, flying straight."""
    scan, target = np.divmod(np.arange(count), targets)
    time_s = start_s + scan_s * (scan + target / targets)
    return {
        "010/SAC": SAC,
        "010/SIC": SIC,
        "140": time_s % 86_400,
        "020/TYP": np.full(count, 7),
        "040/RHO": 10 + 3.0 * target + 0.01 * scan,
        "040/THETA": 360 * target / targets,
        "070/MODE3A": [f"{1000 + t:04d}" for t in target % 8],
        "090/FL": 100 + 10.0 * target,
        "161/TRN": target + 1,
        "220": 0xF00000 + target,
        "240": [f"BOR{t:03d}" for t in target],
    }


def radar_blocks(count=400, **options):
    """One block a report, so that each may be damaged alone."""
    records = encode_records(48, "1.32", radar_columns(count, **options))
    return [encode_block(48, [record]) for record in records]


def ethernet(payload, *, tags=(), version=4, options=b"", pad=0, fragment=0):
    """A UDP packet in Ethernet, padded to 60 octets as network cards do."""
    udp = struct.pack(">HHHH", 8600, 8600, 8 + len(payload), 0) + payload
    if version == 4:
        words = 5 + len(options) // 4
        size = 4 * words + len(udp)
        head = struct.pack(
            ">BBHHHBBH4s4s", 0x40 | words, 0, size, 7, fragment, 64, 17, 0, b"\x0a" * 4, b"\x0b" * 4
        )
        kind, network = 0x0800, head + options + udp
    else:
        head = struct.pack(
            ">IHBB16s16s",
            6 << 28,
            len(options) + len(udp),
            0 if options else 17,
            64,
            b"\x01" * 16,
            b"\x02" * 16,
        )
        kind, network = 0x86DD, head + options + udp
    tagged = b"".join(struct.pack(">HH", tag, 42) for tag in tags)
    frame = b"\x01" * 12 + tagged + struct.pack(">H", kind) + network
    return frame + b"\x00" * max(0, 60 - len(frame)) + b"\xee" * pad


def pcap(frames, *, order="<", nano=False, link=1):
    magic = 0xA1B23C4D if nano else 0xA1B2C3D4
    head = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 262_144, link)
    packets = [
        struct.pack(order + "IIII", 1_700_000_000 + i, 1000, len(f), len(f)) + f
        for i, f in enumerate(frames)
    ]
    return head + b"".join(packets)


def pcapng(frames, *, order="<", link=1):
    def block(kind, body):
        body += b"\x00" * (-len(body) % 4)
        size = struct.pack(order + "I", 12 + len(body))
        return struct.pack(order + "I", kind) + size + body + size

    out = block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))
    out += block(1, struct.pack(order + "HHI", link, 0, 262_144))
    for frame in frames:
        head = struct.pack(order + "IIIII", 0, 0, 0, len(frame), len(frame))
        out += block(6, head + frame)
    return out


def final(payloads, *, sequence=False):
    out = b""
    for number, payload in enumerate(payloads):
        middle = struct.pack(">I", number) if sequence else b""
        size = 8 + len(middle) + len(payload) + 4
        out += (
            struct.pack(">H", size) + middle + b"\x01\x02\x10\x00\x10\x00" + payload + b"\xa5" * 4
        )
    return out


def oradis(payloads):
    return b"".join(struct.pack(">HI", 6 + len(p), 77) + p for p in payloads)


def gps(blocks):
    return b"\x20" * 2200 + b"".join(block + b"\x99" * 10 for block in blocks)


def rff(payloads):
    head = b"2026-01-01 00:00:00 2026-01-01 01:00:00 ".ljust(128, b"\x00")
    return head + b"".join(struct.pack("<IH", 5, len(p)) + p for p in payloads)
