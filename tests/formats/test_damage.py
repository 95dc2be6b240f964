"""Damage is skipped, counted and told; every undamaged block comes through; no other errors."""

import contextlib
import random

import making
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boresight.errors import BoresightError, DataError, MissingInputError
from boresight.formats.encode import encode_block, encode_records
from boresight.formats.recording import inspect, read_recording
from boresight.formats.stream import Account, stream

BLOCKS = making.radar_blocks(600)
STARTS = np.cumsum([0, *map(len, BLOCKS)])[:-1]
CLEAN = b"".join(BLOCKS)


def places_of(data, tmp_path, chunk=1 << 24):
    """Offsets of the blocks that are read, and what is told of the rest."""
    file = tmp_path / "damaged.ast"
    file.write_bytes(data)
    account = Account()
    found = []
    for batch in stream(file, account, chunk=chunk):
        found += (batch.base + batch.records.start - 3).tolist()
    return set(found), account


@settings(max_examples=60)
@given(st.integers(0, 2**32), st.sampled_from(["flip", "zero", "drop", "insert", "length", "cut"]))
def test_every_undamaged_block_is_recovered(tmp_path_factory, seed, kind):
    rng = random.Random(seed)  # noqa: S311  (a repeatable test)
    data, survivors = damage(rng, kind)
    for chunk in (1 << 24, 4096):
        found, account = places_of(data, tmp_path_factory.mktemp("d"), chunk)
        assert survivors <= found
        assert account.skipped < len(data)


def damage(rng, kind):
    """Damage up to eight places of a recording; return it with the offsets of whole blocks."""
    pieces, survivors, at = [], set(), 0
    hit = set(rng.sample(range(len(BLOCKS)), rng.randint(1, 8)))
    for index, block in enumerate(BLOCKS):
        piece = bytearray(block)
        if index in hit:
            spoil(rng, kind, piece)
        if bytes(piece) == block:
            survivors.add(at)
        pieces.append(bytes(piece))
        at += len(piece)
    return b"".join(pieces), survivors


def spoil(rng, kind, piece):
    at = rng.randrange(len(piece))
    if kind == "flip":
        piece[at] ^= 1 << rng.randrange(8)
    elif kind == "zero":
        piece[at:] = b"\x00" * (len(piece) - at)
    elif kind == "drop":
        del piece[at:]
    elif kind == "cut":
        del piece[: at + 1]
    elif kind == "insert":
        piece[at:at] = rng.randbytes(rng.randint(1, 300))
    else:
        piece[1:3] = rng.randrange(65_536).to_bytes(2, "big")


@settings(max_examples=60)
@given(st.binary(min_size=1, max_size=3000), st.integers(0, 20_000))
def test_random_octets_raise_nothing_but_our_errors(tmp_path_factory, noise, at):
    file = tmp_path_factory.mktemp("n") / "noise.ast"
    for data in (noise, CLEAN[:at] + noise + CLEAN[at:], noise + making.pcap([noise])):
        file.write_bytes(data)
        with contextlib.suppress(BoresightError):
            read_recording(file)


def test_skipped_octets_are_counted_exactly(tmp_path):
    noise = b"\xff" * 77
    at = int(STARTS[300])
    found, account = places_of(CLEAN[:at] + noise + CLEAN[at:], tmp_path)
    assert len(found) == len(BLOCKS)
    assert account.skipped == 77
    assert account.damaged == [{"offset": at, "reason": "category 255 is not assigned"}]


def test_a_length_that_swallows_other_blocks_hides_none_of_them(tmp_path):
    data = bytearray(CLEAN)
    at = int(STARTS[100])
    data[at + 1 : at + 3] = int(STARTS[110] - at).to_bytes(2, "big")
    found, account = places_of(bytes(data), tmp_path)
    assert set(STARTS.tolist()) - {at} == found
    assert account.skipped == len(BLOCKS[100])
    assert account.damaged[0]["offset"] == at


def test_a_record_that_names_no_source_is_damage_where_others_do(tmp_path):
    nameless = encode_block(48, encode_records(48, "1.32", {"220": [5, 6]}))
    at = int(STARTS[50])
    found, account = places_of(CLEAN[:at] + nameless + CLEAN[at:], tmp_path)
    assert len(found) == len(BLOCKS)
    assert (account.skipped, account.damaged[0]["offset"]) == (len(nameless), at)


def test_strict_stops_at_the_first_damage_and_says_where(tmp_path):
    file = tmp_path / "a.ast"
    at = int(STARTS[10])
    file.write_bytes(CLEAN[:at] + b"\xff" + CLEAN[at:])
    with pytest.raises(DataError, match=f"byte offset {at}") as caught:
        read_recording(file, strict=True)
    assert caught.value.exit_code == 65
    assert "--strict" in caught.value.next_step


def test_unknown_categories_are_counted(tmp_path):
    file = tmp_path / "a.ast"
    file.write_bytes(CLEAN + bytes([63, 0, 6, 1, 2, 3]) * 3 + CLEAN)
    found = inspect(file)
    assert found["unknown_categories"] == [{"category": 63, "blocks": 3}]
    assert found["skipped_bytes"] == 0
    assert found["categories"][0]["records"] == 2 * len(BLOCKS)


def header(category, length):
    return bytes([category]) + length.to_bytes(2, "big")


BAD = {
    "empty": (b"", 0),
    "one byte": (b"\x30", 0),
    "zero-length block": (header(48, 0) + bytes(40), 0),
    "length past the end": (header(48, 5000) + BLOCKS[0][3:], 0),
    "wrong category": (b"".join(bytes([7]) + block[1:] for block in BLOCKS), 0),
    "unassigned category": (b"".join(bytes([99]) + block[1:] for block in BLOCKS), 0),
    "cut mid-record": (BLOCKS[0][:-5], 0),
    "random megabyte": (random.Random(1).randbytes(1_000_000), 0),  # noqa: S311  (repeatable)
    "a megabyte of zeros": (bytes(1_000_000), 0),
    "pcap header only": (making.pcap([]), 0),
    "pcap of one octet packets": (making.pcap([b"\x00"] * 50), 0),
    "half a pcap header": (making.pcap([])[:11], 0),
    "text": (b"time_s,range_m,azimuth_deg\n1,2,3\n" * 2000, 0),
}


@pytest.mark.parametrize("read", [read_recording, inspect])
@pytest.mark.parametrize("name", BAD)
def test_bad_files_get_one_clear_error(tmp_path, name, read):
    file = tmp_path / "bad.ast"
    file.write_bytes(BAD[name][0])
    with pytest.raises(DataError) as caught:
        read(file)
    assert caught.value.exit_code == 65
    assert "byte offset" in caught.value.where
    assert caught.value.next_step
    assert "bad.ast" in str(caught.value) or "pcap" in str(caught.value)


@pytest.mark.parametrize("where", ["missing.ast", "."])
def test_what_is_not_there_is_another_error(tmp_path, where):
    with pytest.raises(MissingInputError) as caught:
        inspect(tmp_path / where)
    assert caught.value.exit_code == 66
    assert caught.value.next_step


def test_a_file_that_may_not_be_read_says_how_to_allow_it(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(MissingInputError, match="chmod"):
        inspect(tmp_path / "secret.ast")
