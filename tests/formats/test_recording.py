"""From octets to tables: units, validity, downlinked values, midnight, editions."""

import making
import numpy as np
import pytest
from asterix_oracle import SPECS

from boresight.formats import specs
from boresight.formats.encode import encode_block, encode_blocks, encode_records
from boresight.formats.recording import inspect, read_recording


def recording(tmp_path, *parts):
    file = tmp_path / "made.ast"
    file.write_bytes(b"".join(parts))
    return read_recording(file)


def blocks(category, name, columns):
    records = encode_records(category, name, columns)
    return b"".join(encode_blocks(category, records, np.arange(len(records))))


def row(frame, index=0):
    return frame.row(index, named=True)


def test_plots_of_a_mode_s_radar_have_units_validity_and_downlinked_values(tmp_path):
    bds50 = bds_50(roll=-20.0, track=350.0, knots=300)
    columns = {
        "010/SAC": 25,
        "010/SIC": 100,
        "140": [100.0, 104.0, 108.0],
        "020/TYP": [7, 2, 0],
        "020/RAB": [0, 1, 0],
        "040/RHO": [100.0, 50.0, 25.0],
        "040/THETA": [90.0, 180.0, 270.0],
        "070/MODE3A": ["7421", "0001", None],
        "070/G": [0, 1, np.nan],
        "090/FL": [350.0, -2.0, None],
        "090/V": [0, 1, np.nan],
        "120/CAL/CAL": [-80, 5, np.nan],
        "120/CAL/D": [0, 1, np.nan],
        "220": np.ma.array([0xABCDEF, 1, 0], mask=[False, False, True]),
        "240": ["BAW12", "", ""],
        "250/MBDATA": np.ma.array(
            [[1, bds50], [bds50 ^ (1 << 32), 0], [0, 0]], mask=[[0, 0], [0, 1], [1, 1]]
        ),
        "250/BDS1": np.ma.array([[4, 5], [5, 0], [0, 0]], mask=[[0, 0], [0, 1], [1, 1]]),
        "250/BDS2": np.ma.array([[0, 0], [0, 0], [0, 0]], mask=[[0, 0], [0, 1], [1, 1]]),
        "161/TRN": 77,
        "200/GSP": 0.1,
    }
    plots = recording(tmp_path, blocks(48, "1.32", columns)).plots
    first, second, third = (row(plots, i) for i in range(3))
    assert first["sensor"] == "25/100"
    assert first["range_m"] == 185_200.0
    assert first["azimuth_deg"] == 90.0
    assert first["pressure_altitude_m"] == pytest.approx(10_668.0)
    assert (first["altitude_valid"], second["altitude_valid"]) == (True, False)
    assert third["altitude_valid"] is None
    assert (first["mode_a"], second["mode_a"], third["mode_a"]) == ("7421", "0001", None)
    assert (first["mode_a_valid"], second["mode_a_valid"]) == (True, False)
    assert (first["address"], second["address"], third["address"]) == ("ABCDEF", "000001", None)
    assert (first["aircraft_id"], second["aircraft_id"]) == ("BAW12", None)
    assert plots["report_type"].to_list() == ["psr+mode-s", "ssr", "none"]
    assert plots["fixed_transponder"].to_list() == [False, True, False]
    assert plots["range_rate_mps"].to_list() == [-80.0, None, None]
    assert first["ground_speed_mps"] == pytest.approx(300 * 1852 / 3600)
    assert first["true_track_deg"] == pytest.approx(350.0, abs=0.09)
    assert first["roll_deg"] == pytest.approx(-20.0, abs=0.09)
    assert second["ground_speed_mps"] is None  # its status bit is zero
    assert second["true_track_deg"] is not None
    assert third["roll_deg"] is None
    assert first["radar_speed_mps"] == pytest.approx(185.2, abs=0.06)
    assert first["radar_track"] == 77


def bds_50(*, roll, track, knots):
    """ICAO Doc 9871, table A-2-80: status, sign and value of roll, track and ground speed."""
    bits = f"1{round(roll * 256 / 45) & 0x3FF:010b}"
    bits += f"1{round((track - 360) * 512 / 90) & 0x7FF:011b}"
    bits += f"1{knots // 2:010b}"
    return int(bits.ljust(56, "0"), 2)


def test_times_count_on_over_midnight_for_each_sensor(tmp_path):
    columns = {"010/SAC": 1, "010/SIC": [1, 2, 1, 2, 1, 3], "220": 5}
    times = [86_399.5, 86_399.9, 0.5, 86_399.95, 4.5, 5.0]
    plots = recording(tmp_path, blocks(48, "1.32", columns | {"140": times})).plots
    expected = [86_399.5, 86_399.9, 86_399.95, 86_400.5, 86_404.5, 86_405.0]
    np.testing.assert_allclose(plots["time_s"], expected, atol=1 / 128)


def test_services_and_plots_of_one_radar_share_a_clock(tmp_path):
    norths = {"010/SAC": 1, "010/SIC": 1, "000": 1, "030": [86_398.0, 2.0, 6.0], "120/LAT": 41.5}
    norths |= {"120/LON": 2.25, "120/HGT": 27.0, "041": 4.0, "050/COM/NOGO": [0, 1, 0]}
    plot = {"010/SAC": 1, "010/SIC": 1, "140": [3.0], "220": 5}
    found = recording(tmp_path, blocks(34, "1.29", norths), blocks(48, "1.32", plot))
    np.testing.assert_allclose(found.sectors["time_s"], [86_398.0, 86_402.0, 86_406.0])
    np.testing.assert_allclose(found.plots["time_s"], [86_403.0])
    sector = row(found.sectors)
    assert sector["message"] == "north"
    assert (sector["latitude_deg"], sector["height_m"]) == (pytest.approx(41.5, abs=2e-5), 27.0)
    assert found.sectors["no_go"].to_list() == [False, True, False]
    assert [entry["scan_s"] for entry in found.summary["categories"]] == [4.0, 4.0]


def test_a_reference_says_which_time_it_has_and_how_accurate_it_is(tmp_path):
    columns = {
        "010/SAC": 1,
        "010/SIC": 9,
        "080": [1, 2, 3],
        "071": [10.0, np.nan, np.nan],
        "073": [10.5, 11.0, 12.0],
        "074/FSI": [0, 0, 2],
        "074/TOMRP": [0.25, 0.125, 0.75],
        "130/LAT": 41.0,
        "130/LON": -70.5,
        "131/LAT": [41.25, np.nan, np.nan],
        "131/LON": [-70.25, np.nan, np.nan],
        "140": [10_000.0, np.nan, np.nan],
        "145": 100.0,
        "090/NACP": [10, np.nan, np.nan],
        "090/NUCPNIC": [8, 7, 7],
        "210/VN": [2, 0, 2],
    }
    reference = recording(tmp_path, blocks(21, "2.6", columns)).reference
    assert reference["time_kind"].to_list() == ["applicability", "reception", "reception"]
    np.testing.assert_allclose(reference["time_s"], [10.0, 11.125, 11.75], atol=1e-6)
    assert reference["latitude_deg"].to_list() == pytest.approx([41.25, 41.0, 41.0], abs=2e-5)
    assert reference["height_m"][0] == pytest.approx(3048.0)
    assert reference["accuracy_m"].to_list() == [10.0, 92.6, None]
    assert reference["quality_kind"].to_list() == ["nacp", "nucp", None]
    assert reference["age_s"][0] == pytest.approx(0.25, abs=1e-6)


def test_multilateration_has_x_and_y_and_coasted_tracks_are_none(tmp_path):
    columns = {"010/SAC": 0, "010/SIC": 107, "000": [1, 1, 2], "140": [5.0, 6.0, 7.0]}
    columns |= {"020/TYP": 1, "042/X": [-100.0, 50.0, np.nan], "042/Y": [7.0, 8.0, np.nan]}
    columns |= {"170/CST": [0, 1, np.nan], "220": 0x342387}
    plots = recording(tmp_path, blocks(10, "1.1", columns)).plots
    assert plots["x_m"].to_list() == [-100.0, 50.0]
    assert plots["report_type"].to_list() == ["mode-s", "none"]
    assert plots["range_m"].null_count() == 2


def test_sources_of_different_editions_are_told_apart(tmp_path):
    count = 60
    time = np.arange(count) * 1.0
    own = {"010/SAC": 1, "080": 7, "130/LON": 2.0 + time * 1e-3}
    old = {**own, "010/SIC": 1, "030": 100 + time, "130/LAT": 41 + time * 1e-3, "145": 300.0}
    new = {**own, "010/SIC": 2, "071": 100 + time, "130/LAT": 42 + time * 1e-3, "145": 200.0}
    found = recording(tmp_path, blocks(21, "0.23", old), blocks(21, "2.4", new))
    editions = {c["sensor"]: c["edition"] for c in found.summary["categories"]}
    assert editions["1/1"] == "0.23"
    assert editions["1/2"] in found.summary["notes"][0]
    by_sensor = found.reference.group_by("sensor", maintain_order=True)
    latitude = {key[0]: table["latitude_deg"][0] for key, table in by_sensor}
    assert latitude == {"1/1": pytest.approx(41, abs=3e-5), "1/2": pytest.approx(42, abs=3e-5)}


@pytest.mark.parametrize("name", [n for c, n in SPECS if c == 21])
def test_no_edition_of_cat021_is_read_with_another_layout(tmp_path, name):
    edition = specs.edition(21, name)
    time = np.arange(200.0)
    when = "030" if name.startswith("0") else "071"
    columns = {"010/SAC": 1, "010/SIC": 4, "080": 3 + np.arange(200) % 4, when: 5000 + time}
    columns |= {"130/LAT": -30 + time * 1e-4, "130/LON": 100 + time * 1e-4, "145": 350.0}
    columns |= {"170": "BOR123", "140": 35_000.0}
    found = recording(tmp_path, blocks(21, name, columns))
    named = specs.edition(21, found.summary["categories"][0]["edition"])
    layout = [slot and slot.name for slot in edition.record.slots][:24]
    assert [slot and slot.name for slot in named.record.slots][:24] == layout
    np.testing.assert_allclose(found.reference["latitude_deg"], -30 + time * 1e-4, atol=2e-5)
    assert set(found.reference["aircraft_id"]) == {"BOR123"}


def test_of_editions_that_read_alike_the_newest_is_named_and_the_others_told(tmp_path):
    columns = making.radar_columns(50)
    file = tmp_path / "a.ast"
    file.write_bytes(encode_block(48, encode_records(48, "1.30", columns)))
    found = inspect(file)
    assert found["categories"][0]["records"] == 50
    assert found["addresses"] == 20
    assert found["categories"][0]["edition"] == "1.32"
    assert "1.27, 1.28, 1.29, 1.30, 1.31, 1.32 read alike" in found["notes"][0]
