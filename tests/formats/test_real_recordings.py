"""The real recordings, held against what is known of them and against libasterix."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from asterix_oracle import SPECS, fields_of

from boresight.formats import specs
from boresight.formats.asterix import decode
from boresight.formats.recording import inspect, read_recording

DATA = Path(__file__).parents[2] / "../shared/data"
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="the real recordings (../shared/data) are not here"
)
BARCELONA = DATA / "barcelona-60nm/plots-cat048.ast"
SAENZ_PENA = DATA / "saenz-pena/plots-cat048.pcap"
ADSB = DATA / "barcelona-surface/adsb.ast"


def oracle_agrees(file, category, name, records):
    """Compare every field of some records with libasterix's."""
    data = file.read_bytes()
    starts, ends, at = [], [], 0
    while at < len(data):
        starts.append(at)
        at += int.from_bytes(data[at + 1 : at + 3], "big")
        ends.append(at)
    picked = np.unique(np.linspace(0, len(starts) - 1, records).astype(int))
    edition = specs.edition(category, name)
    ours = decode(
        np.frombuffer(data, np.uint8), np.array(starts)[picked], np.array(ends)[picked], edition
    )
    edges = [*ours.start.tolist(), None]
    expected = {}
    for index, start in enumerate(ours.start.tolist()):
        end = (
            edges[index + 1]
            if index + 1 < len(ours) and ours.block[index] == ours.block[index + 1]
            else ends[picked[ours.block[index]]]
        )
        for path, cells in fields_of(SPECS[category, name], data[start:end]).items():
            expected.setdefault(path, []).extend((index, raw) for raw, _ in cells)
    assert len(ours) >= len(picked)
    for path, cells in expected.items():
        found = ours.cells(path)
        if path in ("SP", "RE"):
            assert found is None
            continue
        raw = found.raw.astype(np.uint64) & np.uint64(2**found.field.width - 1)
        assert list(zip(found.record.tolist(), raw.tolist(), strict=True)) == cells, path
    return len(expected)


@needs_data
def test_the_barcelona_hour_is_what_it_is_known_to_be():
    found = inspect(BARCELONA)
    (entry,) = found["categories"]
    assert (entry["category"], entry["records"], entry["sensor"]) == (48, 44_085, "20/129")
    assert found["addresses"] == 177
    assert found["skipped_bytes"] == 0
    assert entry["scan_s"] == pytest.approx(4.0, abs=0.02)
    assert found["framing"] == "raw"
    types = read_recording(BARCELONA).plots["report_type"].value_counts()
    # 15,248 replies to a roll call and one to an all-call.
    expected = {"psr+mode-s": 28_064, "mode-s": 15_249, "ssr": 362, "ssr+psr": 238, "none": 172}
    assert dict(types.rows()) == expected


@needs_data
def test_a_sample_of_the_barcelona_hour_equals_libasterix():
    assert oracle_agrees(BARCELONA, 48, "1.32", 400) > 50


@needs_data
@pytest.mark.slow
def test_all_of_the_barcelona_hour_equals_libasterix():
    assert oracle_agrees(BARCELONA, 48, "1.32", 44_085) > 50


@needs_data
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "category", "edition", "records"),
    [
        ("adsb.ast", 21, "0.23", 24_581),
        ("smr.ast", 10, "1.1", 38_117),
        ("mlat.ast", 10, "1.1", 38_548),
    ],
)
def test_all_of_the_surface_recordings_equal_libasterix(name, category, edition, records):
    assert oracle_agrees(DATA / "barcelona-surface" / name, category, edition, records) > 10


@needs_data
def test_downlinked_speed_agrees_with_the_radars_own_tracker():
    plots = read_recording(BARCELONA).plots.drop_nulls(["ground_speed_mps", "radar_speed_mps"])
    difference = (plots["ground_speed_mps"] - plots["radar_speed_mps"]).abs()
    assert difference.median() < 1.5
    assert plots.height > 5_000


@needs_data
def test_inspect_takes_less_than_300_mb():
    # Not ru_maxrss: that of a process counts what its parent held when it forked.
    script = (
        "from boresight.formats.recording import inspect\n"
        f"inspect({str(BARCELONA)!r})\n"
        "print(next(l for l in open('/proc/self/status') if l.startswith('VmHWM')).split()[1])\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    assert int(done.stdout) / 1024 < 300


@needs_data
def test_the_saenz_pena_capture_holds_cat034_and_cat048():
    found = inspect(SAENZ_PENA)
    assert [(c["category"], c["sensor"]) for c in found["categories"]] == [
        (34, "226/232"),
        (48, "226/232"),
    ]
    assert [c["records"] for c in found["categories"]] == [8_783, 1_883]
    assert [c["scan_s"] for c in found["categories"]] == pytest.approx([7.63, 7.63], abs=0.02)
    assert (found["framing"], found["skipped_bytes"]) == ("pcap", 0)


@needs_data
def test_adsb_of_edition_023_is_named_and_no_position_is_wrong():
    """13 positions are wrong in the recording itself, which libasterix reads the same."""
    found = read_recording(ADSB)
    (entry,) = found.summary["categories"]
    assert (entry["edition"], entry["records"]) == ("0.23", 24_581)
    marks = found.reference["position_jumps"]
    assert marks.sum() == 11  # the other two are all there is of their aircraft
    table = found.reference.filter(~marks).sort("address", "time_s")
    assert table.height > 24_500
    assert table["latitude_deg"].is_between(38.5, 43.5).all()
    assert table["longitude_deg"].is_between(-0.5, 5.0).all()
    step = np.diff(table["time_s"])
    same = (table["address"][1:] == table["address"][:-1]).to_numpy() & (step < 30)
    north = np.diff(table["latitude_deg"]) * 111_000
    east = np.diff(table["longitude_deg"]) * 83_000
    # Reports are stamped up to seconds late; a misread position is off by tens of kilometres.
    assert (np.hypot(north, east)[same] <= 350 * step[same] + 2_000).all()
    assert oracle_agrees(ADSB, 21, "0.23", 400) > 10


@needs_data
def test_the_system_tracks_of_a_centre_are_read():
    found = read_recording(DATA / "saenz-pena/system-tracks-cat062.pcap")
    assert found.system_tracks.height == 26_194
    assert found.system_tracks["latitude_deg"].is_between(-60, 0).all()
    assert found.summary["categories"][0]["sensor"] == "226/2"
