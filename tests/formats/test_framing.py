"""Every way of wrapping blocks is found by itself and unwrapped to the same records."""

import struct

import making
import pytest

from boresight.errors import DataError
from boresight.formats.blocks import follow
from boresight.formats.framing import detect
from boresight.formats.recording import inspect, read_recording
from boresight.formats.stream import Account, stream

BLOCKS = making.radar_blocks(120)
PAYLOADS = [b"".join(BLOCKS[i : i + 3]) for i in range(0, len(BLOCKS), 3)]
VLAN, QINQ = (0x8100,), (0x88A8, 0x8100)
COOKED = b"\x00\x04\x00\x01\x00\x06" + b"\x01" * 6 + b"\x00\x00\x08\x00"
COOKED_2 = b"\x08\x00\x00\x00" + b"\x00" * 16
HOP_BY_HOP = b"\x11\x00" + b"\x01\x04" + b"\x00" * 4


def frames(**options):
    return [making.ethernet(payload, **options) for payload in PAYLOADS]


def no_ethernet(before=b""):
    return [before + frame[14:] for frame in frames()]


WRAPPED = {
    "raw": b"".join(BLOCKS),
    "final": making.final(PAYLOADS),
    "ioss-seq": making.final(PAYLOADS, sequence=True),
    "oradis": making.oradis(PAYLOADS),
    "gps": making.gps(BLOCKS),
    "rff": making.rff(PAYLOADS),
    "pcap little": making.pcap(frames()),
    "pcap big": making.pcap(frames(), order=">"),
    "pcap nano": making.pcap(frames(), nano=True),
    "pcap nano big": making.pcap(frames(), nano=True, order=">"),
    "pcap vlan": making.pcap(frames(tags=VLAN)),
    "pcap qinq": making.pcap(frames(tags=QINQ)),
    "pcap ip options": making.pcap(frames(options=b"\x01" * 8)),
    "pcap ipv6": making.pcap(frames(version=6)),
    "pcap ipv6 options": making.pcap(frames(version=6, options=HOP_BY_HOP)),
    "pcap octets after the frame": making.pcap(frames(pad=13)),
    "pcap raw ip": making.pcap(no_ethernet(), link=101),
    "pcap cooked": making.pcap(no_ethernet(COOKED), link=113),
    "pcap cooked 2": making.pcap(no_ethernet(COOKED_2), link=276),
    "pcapng": making.pcapng(frames()),
    "pcapng big": making.pcapng(frames(), order=">"),
}


@pytest.mark.parametrize("name", WRAPPED)
@pytest.mark.parametrize("chunk", [1 << 24, 1000])
def test_every_wrapping_yields_every_record(tmp_path, name, chunk):
    file = tmp_path / "recording"
    file.write_bytes(WRAPPED[name])
    account = Account()
    batches = list(stream(file, account, chunk=chunk))
    ours = sorted(n for b in batches for n in b.records.raw("220").tolist())
    assert ours == sorted(0xF00000 + i % 20 for i in range(len(BLOCKS)))
    assert account.framing == name.split()[0]
    assert (account.skipped, account.trailing, account.damaged) == (0, 0, [])


def test_octets_that_a_recorder_appends_to_payloads_are_left_out_and_told(tmp_path):
    file = tmp_path / "a.pcap"
    tail = b"\x00\x17recorder"
    file.write_bytes(making.pcap([making.ethernet(p + tail) for p in PAYLOADS]))
    found = inspect(file)
    assert found["categories"][0]["records"] == len(BLOCKS)
    assert found["skipped_bytes"] == 0
    assert f"{len(tail) * len(PAYLOADS)} octets" in " ".join(found["notes"])


def test_fragments_and_other_traffic_are_counted_not_decoded(tmp_path):
    file = tmp_path / "a.pcap"
    others = [
        making.ethernet(b"hello, world, this is not radar"),
        making.ethernet(BLOCKS[0], fragment=0x2000),
    ]
    file.write_bytes(making.pcap([*frames(), *others]))
    found = inspect(file)
    assert found["categories"][0]["records"] == len(BLOCKS)
    assert "1 IP fragments are not decoded." in found["notes"]
    assert "1 packets hold something else than ASTERIX over UDP." in found["notes"]


def test_a_capture_that_ends_inside_a_packet_says_where(tmp_path):
    data = WRAPPED["pcap little"]
    file = tmp_path / "a.pcap"
    file.write_bytes(data[:-20])
    found = inspect(file)
    assert found["categories"][0]["records"] == len(BLOCKS) - 1
    last = len(data) - 16 - len(frames()[-1])
    assert found["damaged"][0] == {"offset": last, "reason": "the file ends inside a packet"}


def test_packets_after_a_broken_packet_header_are_found_again(tmp_path):
    data = bytearray(WRAPPED["pcap little"])
    second = 24 + 16 + len(frames()[0])
    data[second + 8 : second + 12] = struct.pack("<I", 0x7FFFFFFF)
    file = tmp_path / "a.pcap"
    file.write_bytes(bytes(data))
    found = inspect(file)
    assert found["damaged"][0]["offset"] == second
    assert found["categories"][0]["records"] == len(BLOCKS)


@pytest.mark.parametrize("name", ["final", "ioss-seq", "oradis", "gps"])
def test_frames_after_a_broken_one_are_found_again(tmp_path, name):
    data = bytearray(WRAPPED[name])
    start = detect(bytes(data)).first
    per_frame = 1 if name == "gps" else 3
    at = start + (len(data) - start) // (len(BLOCKS) // per_frame) * 4
    data[at : at + 30] = b"\xff" * 30
    file = tmp_path / "a.rec"
    file.write_bytes(bytes(data))
    found = inspect(file)
    assert found["framing"] == name
    assert found["skipped_bytes"] > 0
    assert found["categories"][0]["records"] >= len(BLOCKS) - 2 * per_frame


def test_a_link_type_that_is_not_read_is_named(tmp_path):
    file = tmp_path / "a.pcap"
    file.write_bytes(making.pcap(frames(), link=147))
    with pytest.raises(DataError, match="link type 147"):
        inspect(file)


def test_a_raw_file_is_not_taken_for_a_recorders():
    assert detect(b"".join(BLOCKS)).name == "raw"
    assert len(follow(WRAPPED["raw"], 0, len(WRAPPED["raw"])).starts) == len(BLOCKS)


def test_progress_reaches_the_end(tmp_path):
    file = tmp_path / "a.ast"
    file.write_bytes(WRAPPED["raw"])
    seen = []
    read_recording(file, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (len(WRAPPED["raw"]),) * 2
