"""Files that are not what they seem: one error, its place, the next command, no traceback, fast."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

DEMO = Path(__file__).parents[2] / "src/boresight/demo/recording.ast"
HEADER = "time_s,range_m,azimuth_deg,address\n"


def ethernet(payload):
    """One UDP packet as a capture holds it."""
    udp = b"\x22\x98\x22\x98" + (8 + len(payload)).to_bytes(2, "big") + b"\0\0" + payload
    total = (20 + len(udp)).to_bytes(2, "big")
    address = b"\x0a\0\0\x01\xe0\0\0\x01"
    ip = b"\x45\0" + total + b"\0\0\0\0\x40\x11\0\0" + address + udp
    return b"\x01\0\x5e\0\0\x01" + b"\x02\0\0\0\0\x01" + b"\x08\0" + ip


def capture(payloads):
    """A pcap file of UDP payloads."""
    head = bytes.fromhex("d4c3b2a1 0200 0400 00000000 00000000 ffff0000 01000000")
    for payload in payloads:
        frame = ethernet(payload)
        head += bytes(8) + len(frame).to_bytes(4, "little") * 2 + frame
    return head


def blocks(count):
    """The first data blocks of the demo's recording."""
    octets, at, found = DEMO.read_bytes(), 0, []
    while len(found) < count:
        length = int.from_bytes(octets[at + 1 : at + 3], "big")
        found.append(octets[at : at + length])
        at += length
    return found


def table(*rows):
    """A CSV of plots."""
    return (HEADER + "\n".join(rows) + "\n").encode()


GOOD_ROW = "10.0,5000,45,A00001"
FIRST = b"".join(blocks(400))
NOISE = np.random.default_rng(1).integers(0, 256, 1_000_000, dtype=np.uint8).tobytes()

# name: (file's name, octets, exit code of inspect, words of the error or, where it is read, of the
# answer). Damage inside a recording is skipped and counted, so that inspect ends with 0 and says
# where; with --strict it ends with 65.
REFUSED = {
    "empty": ("a.ast", b"", 65, "byte offset 0"),
    "one byte": ("a.ast", b"\x30", 65, "byte offset 0"),
    "zero-length block": ("a.ast", b"\x30\0\0" * 100, 65, "byte offset"),
    "wrong category": ("a.ast", b"\xf7\0\x08hello" * 100, 65, "byte offset"),
    "random megabyte": ("a.ast", NOISE, 65, "byte offset"),
    "text": ("a.ast", b"plot 1 at 12:00, range 12 NM\n" * 100, 65, "byte offset"),
    "capture without ASTERIX": ("a.pcap", capture([b"hello, world" * 5] * 20), 65, "byte offset"),
    "columns missing": ("a.csv", b"t,r\n1,2\n", 65, "time_s"),
    "text for a number": ("a.csv", table(GOOD_ROW, "14,far,45,A00001"), 65, "line 3"),
    "negative range": ("a.csv", table(GOOD_ROW, "14,-5,45,A00001"), 65, "line 3"),
    "azimuth 400": ("a.csv", table(GOOD_ROW, "14,5000,400,A00001"), 65, "line 3"),
    "time backwards": ("a.csv", table(GOOD_ROW, "4,5000,45,A00001"), 65, "line 3"),
    "no Parquet": ("a.parquet", b"PAR1 but no more", 65, "PARQUET"),
}
# name: (octets, where the damage begins)
DAMAGED = {
    "length past the end": (FIRST + b"\x30\xff\xff\xfd", len(FIRST)),
    "cut mid-record": (FIRST[:-7], len(FIRST) - len(blocks(400)[-1])),
    "zero-length block inside": (FIRST + b"\x30\0\0" + FIRST, len(FIRST)),
    "noise inside": (FIRST + NOISE[:5000] + FIRST, len(FIRST)),
}


def boresight(*arguments):
    """Run the command line; return what it did."""
    return subprocess.run(
        [sys.executable, "-m", "boresight", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def assert_refused(done, code, said):
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("error: ") == 1
    assert said in done.stderr
    assert "  next: " in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", ["inspect", "track"])
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_recording_is_refused(tmp_path, case, command):
    name, octets, code, said = REFUSED[case]
    (tmp_path / name).write_bytes(octets)
    done = boresight(command, tmp_path / name)
    assert_refused(done, code, said)


@pytest.mark.parametrize("case", DAMAGED)
def test_damage_is_skipped_counted_and_placed(tmp_path, case):
    octets, at = DAMAGED[case]
    (tmp_path / "a.ast").write_bytes(octets)
    done = boresight("inspect", tmp_path / "a.ast")
    assert done.returncode == 0, done.stderr
    assert "bytes skipped" in done.stdout
    assert f"damaged at byte {at:,}:" in done.stdout
    strict = boresight("inspect", "--strict", tmp_path / "a.ast")
    assert_refused(strict, 65, f"byte offset {at}")


def test_trailing_bytes_of_a_recorder_are_left_out(tmp_path):
    whole, trailed = tmp_path / "whole.pcap", tmp_path / "trailed.pcap"
    whole.write_bytes(capture(blocks(200)))
    trailed.write_bytes(capture([block + b"\xa5\xa5\0\0\x12\x34" for block in blocks(200)]))
    left, right = (boresight("inspect", each) for each in (whole, trailed))
    assert left.returncode == right.returncode == 0
    assert "CAT034" in left.stdout
    rows = [[line for line in each.stdout.splitlines() if "CAT" in line] for each in (left, right)]
    assert rows[0] == rows[1]
    assert "1200 octets that a recorder appended" in right.stderr


def test_a_folder_is_no_file(tmp_path):
    done = boresight("track", tmp_path)
    assert_refused(done, 66, "is a folder")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read(tmp_path):
    secret = tmp_path / "secret.ast"
    secret.write_bytes(FIRST)
    secret.chmod(0)
    assert_refused(boresight("track", secret)[0], 66, "may not be read")


def test_rows_without_a_range_are_skipped_and_counted(tmp_path):
    rows = [f"{10 + 4 * i},{5000 + 400 * i},45,A00001" for i in range(20)]
    rows[7] = "38,nan,45,A00001"
    (tmp_path / "a.csv").write_bytes(table(*rows))
    done = boresight("inspect", tmp_path / "a.csv")
    assert done.returncode == 0, done.stderr
    assert " 19 " in done.stdout
    assert "1 row" in done.stderr
    assert_refused(boresight("inspect", "--strict", tmp_path / "a.csv"), 65, "line 9")
