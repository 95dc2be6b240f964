"""Tables in and out: names, units, what is wrong and where, and that nothing is dropped unsaid."""

import json

import numpy as np
import polars as pl
import pytest
from making import radar_blocks

from boresight.errors import DataError, OutputError, UsageError
from boresight.formats.output import write_table
from boresight.formats.recording import inspect, read_recording
from boresight.formats.schema import REFERENCE
from boresight.formats.tables import read_table

GOOD = "time_s,range_m,azimuth_deg\n0,1000,10\n4,1100,20\n8,1200,30\n"


def csv(tmp_path, text, name="plots.csv"):
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    return file


def test_a_plain_table_is_read(tmp_path):
    found = read_recording(csv(tmp_path, GOOD))
    assert found.plots["range_m"].to_list() == [1000.0, 1100.0, 1200.0]
    assert found.plots["sensor"].to_list() == ["plots"] * 3
    assert found.summary["format"] == "csv"
    assert found.summary["categories"][0]["records"] == 3


@pytest.mark.parametrize(
    ("head", "row", "expected"),
    [
        ("time_s,range_nm,azimuth_deg", "1,2,3", (1.0, 3704.0, 3.0)),
        ("time_ms,range_km,azimuth_rad", "1500,2,1", (1.5, 2000.0, 57.29577951308232)),
        ("time_s,range_ft,azimuth_deg", "1,1000,3", (1.0, 304.8, 3.0)),
    ],
)
def test_units_in_names_are_understood(tmp_path, head, row, expected):
    plots = read_recording(csv(tmp_path, f"{head}\n{row}\n")).plots
    assert plots.select("time_s", "range_m", "azimuth_deg").row(0) == pytest.approx(expected)


def test_a_column_map_names_what_is_ours_in_any_unit(tmp_path):
    file = csv(tmp_path, "t,rng,az,squawk,extra\n1,2,3,7000,x\n")
    columns = {"time_s": "t", "range_nm": "rng", "azimuth_deg": "az", "mode_a": "squawk"}
    plots = read_recording(file, columns=columns).plots
    assert plots.row(0, named=True) == {
        "time_s": 1.0, "range_m": 3704.0, "azimuth_deg": 3.0, "mode_a": "7000", "extra": "x",
        "sensor": "plots",
    }  # fmt: skip


def test_rows_without_a_measurement_are_skipped_and_counted(tmp_path):
    file = csv(tmp_path, GOOD + "12,NaN,5\n16,,5\n20,5,5\n")
    found = read_recording(file)
    assert found.plots["time_s"].to_list() == [0, 4, 8, 20]
    assert found.summary["skipped_rows"] == 2
    assert "2 rows" in found.summary["notes"][0]
    with pytest.raises(DataError, match="line 5, column range_m"):
        read_recording(file, strict=True)


WRONG = {
    "no columns": ("a,b\n1,2\n", "line 1", "time_s, range_m, azimuth_deg"),
    "one column missing": ("time_s,range_m\n1,2\n", "line 1", "azimuth_deg"),
    "text for a number": (GOOD + "12,far,5\n", "line 5, column range_m", "far"),
    "a negative range": (GOOD + "12,-7,5\n", "line 5, column range_m", "-7"),
    "azimuth 400": (GOOD + "12,7,400\n", "line 5, column azimuth_deg", "400"),
    "a negative azimuth": (GOOD + "12,7,-1\n", "line 5, column azimuth_deg", "-1"),
    "time backwards": (GOOD + "6,7,5\n", "line 5, column time_s", "back by 2"),
    "an infinite range": (GOOD + "12,inf,5\n", "line 5, column range_m", "inf"),
    "only missing values": ("time_s,range_m,azimuth_deg\n1,,\n2,NaN,\n", "2 rows", "no row"),
    "a header alone": ("time_s,range_m,azimuth_deg\n", "0 rows", "no row"),
    "after remarks": ("# a\n# b\n" + GOOD + "12,7,400\n", "line 7", "400"),
    "after skipped rows": (GOOD + "9,,\n12,7,400\n", "line 6", "400"),
}


@pytest.mark.parametrize("read", [read_recording, inspect])
@pytest.mark.parametrize("name", WRONG)
def test_wrong_tables_get_one_error_that_says_where(tmp_path, name, read):
    text, where, what = WRONG[name]
    file = csv(tmp_path, text)
    with pytest.raises(DataError) as caught:
        read(file)
    assert caught.value.exit_code == 65
    assert where in caught.value.where
    assert what in str(caught.value)
    assert "plots.csv" in str(caught.value)
    assert caught.value.next_step


@pytest.mark.parametrize("octets", [b"\xff\xfe\x00", b"\x00" * 100, b"PAR1 no parquet PAR1"])
@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
def test_what_is_no_table_at_all_is_a_data_error(tmp_path, octets, name):
    file = tmp_path / name
    file.write_bytes(octets)
    with pytest.raises(DataError):
        read_recording(file)


def test_a_column_map_that_fits_nothing_is_refused(tmp_path):
    file = csv(tmp_path, GOOD)
    with pytest.raises(UsageError, match="rng"):
        read_recording(file, columns={"range_m": "rng"})
    with pytest.raises(UsageError, match="distance"):
        read_recording(file, columns={"distance": "range_m"})


def test_times_of_two_sensors_may_cross(tmp_path):
    text = "sensor,time_s,range_m,azimuth_deg\na,5,1,1\nb,1,1,1\na,6,1,1\nb,2,1,1\n"
    assert read_recording(csv(tmp_path, text)).plots.height == 4


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_what_is_written_is_read_again_to_the_last_bit(tmp_path, ending):
    file = tmp_path / "a.ast"
    file.write_bytes(b"".join(radar_blocks(200)))
    plots = read_recording(file).plots
    again = read_recording(write_table(plots, tmp_path / f"b{ending}", "plots"))
    for name in ("time_s", "range_m", "azimuth_deg", "pressure_altitude_m"):
        assert np.array_equal(again.plots[name], plots[name])
    for name in ("address", "mode_a", "sensor", "altitude_valid", "report_type"):
        assert again.plots[name].to_list() == plots[name].to_list()
    assert again.summary["addresses"] == 20
    assert again.summary["categories"][0]["scan_s"] == pytest.approx(4.0, abs=0.01)


def test_a_reference_is_checked_like_plots(tmp_path):
    text = "time_s,latitude_deg,longitude_deg,address\n1,41,2,ABC\n2,91,2,ABC\n"
    with pytest.raises(DataError, match="latitude_deg is 91"):
        read_table(csv(tmp_path, text), REFERENCE)


def tracks():
    return pl.DataFrame(
        {
            "track": [1, 1, 1, 2, 2, 3],
            "time_s": [0.0, 4.0, 8.0, 0.0, 4.0, 0.0],
            "latitude_deg": [41.0, 41.1, 41.2, 10.0, 10.1, 5.0],
            "longitude_deg": [2.0, 2.1, 2.2, 179.9, -179.9, 6.0],
            "height_m": [1000.0, None, 1100.0, 5.0, 6.0, 7.0],
            "address": ["ABCDEF", "ABCDEF", None, None, None, "000001"],
        }
    )


def test_geojson_holds_a_line_for_each_track(tmp_path):
    file = write_table(tracks(), tmp_path / "t.geojson", "tracks")
    content = json.loads(file.read_text())
    assert content["type"] == "FeatureCollection"
    assert content["boresight"]["table"] == "tracks"
    line, crossing, point = content["features"]
    expected = [[2.0, 41.0, 1000.0], [2.1, 41.1], [2.2, 41.2, 1100.0]]
    assert line["geometry"] == {"type": "LineString", "coordinates": expected}
    assert line["properties"]["address"] == "ABCDEF"
    assert (line["properties"]["first_s"], line["properties"]["points"]) == (0.0, 3)
    assert crossing["geometry"]["type"] == "MultiLineString"
    assert point["geometry"] == {"type": "Point", "coordinates": [6.0, 5.0, 7.0]}


def test_the_version_is_in_the_metadata(tmp_path):
    parquet = write_table(tracks(), tmp_path / "t.parquet", "tracks")
    assert pl.read_parquet_metadata(parquet)["table"] == "tracks"
    assert pl.read_parquet_metadata(parquet)["boresight"]
    first = write_table(tracks(), tmp_path / "t.csv", "tracks").read_text().splitlines()[0]
    assert json.loads(first.lstrip("# "))["table_version"] == "1"


def test_what_cannot_be_written_says_why(tmp_path):
    with pytest.raises(UsageError, match="parquet"):
        write_table(tracks(), tmp_path / "t.xlsx", "tracks")
    with pytest.raises(UsageError, match="track"):
        write_table(tracks().drop("track"), tmp_path / "t.geojson", "plots")
    for ending in ("csv", "parquet", "geojson"):
        with pytest.raises(OutputError) as caught:
            write_table(tracks(), tmp_path / "nowhere" / f"t.{ending}", "tracks")
        assert caught.value.exit_code == 74
