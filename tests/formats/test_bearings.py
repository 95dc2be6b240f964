"""Bearings in: columns, units, times; what is wrong with a file, where, and what is said of it."""

import numpy as np
import polars as pl
import pytest

from boresight.errors import DataError, MissingInputError, UsageError
from boresight.formats.bearings import bearings_table, read_bearings
from boresight.formats.scatter import deviations, robust_sd

GOOD = "time_s,bearing_deg\n0,10\n1,11\n2,12\n"


def csv(tmp_path, text, name="heard.csv"):
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    return file


def many(value="{b}", count=40, head="time_s,bearing_deg", noise=0.3, turn=1.0, seed=3):
    """A file of bearings that grow from 20 to 60 degrees, in any unit."""
    degrees = np.linspace(20, 60, count) + noise * np.random.default_rng(seed).normal(size=count)
    rows = [f"{t},{value.format(b=b * turn)}" for t, b in enumerate(degrees)]
    return "\n".join([head, *rows]) + "\n"


def test_a_plain_file_is_read_without_a_word(tmp_path):
    table, remarks = read_bearings(csv(tmp_path, GOOD))
    assert table["bearing_deg"].to_list() == [10.0, 11.0, 12.0]
    assert table["line"].to_list() == [2, 3, 4]
    assert remarks == ()


def test_parquet_says_the_same_as_csv(tmp_path):
    text = csv(tmp_path, "time_s,bearing_deg,conical,track\n0,10,true,7\n1,11,false,7\n")
    frame = pl.DataFrame(
        {"time_s": [0, 1], "bearing_deg": [10, 11], "conical": [1, 0], "track": [7, 7]}
    )
    frame.write_parquet(tmp_path / "heard.parquet")
    expected, _ = read_bearings(text)
    found, _ = read_bearings(tmp_path / "heard.parquet")
    names = ["time_s", "bearing_deg", "conical", "track"]
    assert found.select(names).equals(expected.select(names))


@pytest.mark.parametrize(
    ("head", "row", "name", "expected"),
    [
        ("time_s,bearing_rad", "1,1", "bearing_deg", 57.29577951308232),
        ("time_ms,bearing_deg", "1000,370", "bearing_deg", 370.0),
        ("time_s,bearing_mag_deg", "1,-10", "bearing_magnetic_deg", -10.0),
        ("time_s,bearing_magnetic_rad", "1,1", "bearing_magnetic_deg", 57.29577951308232),
        ("time_s,bearing_relative_deg", "1,-90", "bearing_relative_deg", -90.0),
        ("time_s,tdoa_ms", "1,2.5", "tdoa_s", 0.0025),
    ],
)
def test_units_and_kinds_of_bearings(tmp_path, head, row, name, expected):
    table, _ = read_bearings(csv(tmp_path, f"{head}\n{row}\n"))
    assert table["time_s"][0] == 1.0
    assert table[name][0] == pytest.approx(expected, rel=1e-15)


def test_a_column_map_names_what_is_ours_in_any_unit(tmp_path):
    file = csv(tmp_path, "when,brg,id\n1,0.5,a\n")
    columns = {"time_s": "when", "bearing_rad": "brg", "track": "id"}
    table, _ = read_bearings(file, columns=columns)
    assert table["bearing_deg"][0] == pytest.approx(28.64788975654116)
    assert table["track"].to_list() == ["a"]
    with pytest.raises(UsageError, match="azimut"):
        read_bearings(file, columns={"bearing_deg": "azimut"})


# 2017-09-12 16:58:26.96 UTC, from `date -u -d ... +%s`.
STAMP = 1505235506.96


@pytest.mark.parametrize(
    "text",
    [
        "2017-09-12T16:58:26.960Z", "2017-09-12 16:58:26.96", "12-Sep-2017 16:58:26.960",
        "2017-09-12T18:58:26.960+02:00", "2017-09-12T11:28:26.960-0530", "12 Sep 2017 16:58:26.96",
        "2017/09/12 16:58:26.96 UTC",
    ],
)  # fmt: skip
@pytest.mark.parametrize("name", ["time", "Time_UTC", "time_s"])
def test_dates_are_seconds_since_1970(tmp_path, text, name):
    table, _ = read_bearings(csv(tmp_path, f"{name},bearing_deg\n{text},10\n"))
    assert table["time_s"][0] == pytest.approx(STAMP, abs=1e-6)
    assert "time_utc" in table.columns


def test_times_of_day_count_on_over_midnight(tmp_path):
    text = "time,bearing_deg\n23:59:58.5,1\n23:59:59.5,2\n00:00:00.5,3\n00:00:01.5,4\n"
    table, remarks = read_bearings(csv(tmp_path, text))
    assert table["time_s"].to_list() == [86398.5, 86399.5, 86400.5, 86401.5]
    assert any("midnight" in each for each in remarks)


def test_an_evening_and_a_morning_in_order_are_one_day(tmp_path):
    table, remarks = read_bearings(csv(tmp_path, "time_s,bearing_deg\n20,1\n30,2\n80000,3\n"))
    assert table["time_s"].to_list() == [20, 30, 80000]
    assert remarks == ()


def test_unsorted_rows_are_sorted_and_said(tmp_path):
    table, remarks = read_bearings(csv(tmp_path, "time_s,bearing_deg\n0,1\n2,3\n1,2\n3,4\n"))
    assert table["bearing_deg"].to_list() == [1, 2, 3, 4]
    assert remarks == ("The rows were not in order of time (1 go back): sorted.",)


def test_contacts_one_after_another_are_in_order(tmp_path):
    text = "time_s,bearing_deg,contact\n0,1,a\n1,2,a\n0,5,b\n1,6,b\n"
    table, remarks = read_bearings(csv(tmp_path, text))
    assert sorted(table["track"].to_list()) == ["a", "a", "b", "b"]
    assert remarks == ()


def test_incomplete_rows_are_counted_or_refused(tmp_path):
    file = csv(tmp_path, GOOD + "3,nan\n4,\n,5\n")
    table, remarks = read_bearings(file)
    assert table.height == 3
    assert remarks == ("3 rows without a time or a bearing are skipped.",)
    with pytest.raises(DataError, match="line 5"):
        read_bearings(file, strict=True)


WRONG = {
    "no bearings": ("time_s,level\n0,1\n", "line 1", "bearing_deg"),
    "own ship's file": ("time_s,latitude_deg,longitude_deg\n0,1,2\n", "line 1", "--own-ship"),
    "no time": ("bearing_deg\n1\n", "line 1", "time_s"),
    "text for a number": (GOOD + "3,abeam\n", "line 5, column bearing_deg", "abeam"),
    "infinite": (GOOD + "3,inf\n", "line 5, column bearing_deg", "inf"),
    "two turns and more": (GOOD + "3,1000\n", "line 5, column bearing_deg", "1000"),
    "no sigma": ("time_s,bearing_deg,sigma_deg\n0,1,1\n1,2,0\n", "line 3", "is 0"),
    "a negative sigma": ("time_s,bearing_deg,sigma_deg\n0,1,-1\n", "line 2", "-1"),
    "a cone of 200": ("time_s,bearing_deg,conical\n0,200,true\n", "line 2", "180 astern"),
    "a cone of -5": ("time_s,bearing_deg,conical\n0,5,1\n1,-5,1\n", "line 3", "180 astern"),
    "perhaps a cone": ("time_s,bearing_deg,conical\n0,5,maybe\n", "line 2", "maybe"),
    "a date of two days": ("time,bearing_deg\n03/04/2017 10:00,5\n", "line 2", "two days"),
    "no time at all": ("time,bearing_deg\n12:00:00,5\nnoon,6\n", "line 3, column time", "noon"),
    "a header alone": ("time_s,bearing_deg\n", "0 rows", "no row"),
    "nothing but NaN": ("time_s,bearing_deg\nnan,1\n1,nan\n", "2 rows", "no row"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files_get_one_error_that_says_where(tmp_path, name):
    text, where, what = WRONG[name]
    with pytest.raises(DataError) as caught:
        read_bearings(csv(tmp_path, text))
    assert caught.value.exit_code == 65
    assert where in caught.value.where
    assert what in str(caught.value)
    assert "heard.csv" in str(caught.value)
    assert caught.value.next_step


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.mat"])
@pytest.mark.parametrize("octets", [b"\xff\xfe\x00", b"\x00" * 300, b"MATLAB 5.0 MAT-file" * 30])
def test_what_is_no_table_is_a_data_error(tmp_path, name, octets):
    (tmp_path / name).write_bytes(octets)
    with pytest.raises(DataError) as caught:
        read_bearings(tmp_path / name)
    assert caught.value.next_step


def test_empty_and_absent_files(tmp_path):
    with pytest.raises(DataError, match="empty"):
        read_bearings(csv(tmp_path, ""))
    with pytest.raises(MissingInputError):
        read_bearings(tmp_path / "nowhere.csv")


RADIANS = np.pi / 180


def test_radians_in_a_column_of_degrees_are_refused(tmp_path):
    file = csv(tmp_path, many(turn=RADIANS))
    with pytest.raises(DataError, match="radians") as caught:
        read_bearings(file)
    assert "bearing_rad" in caught.value.next_step
    assert read_bearings(file, degrees=True)[0].height == 40


def test_radians_are_known_by_their_turn(tmp_path):
    """Noisy ones, about North, from 0 to 6.28: no degrees do that."""
    rng = np.random.default_rng(5)
    heard = (np.radians(np.linspace(-4, 4, 60)) + 0.1 * rng.normal(size=60)) % (2 * np.pi)
    rows = "\n".join(f"{t},{b}" for t, b in enumerate(heard))
    with pytest.raises(DataError, match="a turn in radians"):
        read_bearings(csv(tmp_path, f"time_s,bearing_deg\n{rows}\n"))


def test_degrees_about_north_are_believed_and_said(tmp_path):
    file = csv(tmp_path, many(turn=0.1, noise=3.0))
    table, remarks = read_bearings(file)
    assert table.height == 40
    assert "taken as degrees" in remarks[0]
    assert read_bearings(file, degrees=True)[1] == ()
    radians = csv(tmp_path, many(turn=0.1 * RADIANS, noise=3.0, head="time_s,bearing_rad"))
    assert read_bearings(radians)[1] == ()


def test_tenths_of_degrees_are_no_radians_however_smooth(tmp_path):
    rows = "\n".join(f"{t},{0.1 * t:.1f}" for t in range(40))
    assert read_bearings(csv(tmp_path, f"time_s,bearing_deg\n{rows}\n"))[1] == ()


def test_degrees_all_round_raise_no_doubt(tmp_path):
    assert read_bearings(csv(tmp_path, many()))[1] == ()


def test_frames_are_checked_like_files_and_only_once():
    frame = pl.DataFrame({"time_s": [1, 0], "bearing_deg": [20.0, 10.0], "line": ["x", "y"]})
    table, remarks = bearings_table(frame)
    assert table["bearing_deg"].to_list() == [10.0, 20.0]
    assert len(remarks) == 1
    again, nothing = bearings_table(table)
    assert again.equals(table)
    assert nothing == ()
    assert frame["time_s"].to_list() == [1, 0]


def test_dates_of_a_frame_need_no_text():
    times = pl.Series(["2017-09-12 16:58:26.960"]).str.to_datetime(time_unit="us")
    table, _ = bearings_table(pl.DataFrame({"time": times, "bearing_deg": [10.0]}))
    assert table["time_s"][0] == pytest.approx(STAMP, abs=1e-6)


def test_scatter_is_that_of_the_noise_whatever_the_course():
    """1,000 uneven steps, a parabola, one in twenty wild. A robust sd has 3 % here: 4 of them."""
    rng = np.random.default_rng(11)
    time_s = np.cumsum(rng.uniform(0.5, 1.5, 1000))
    values = 3.0 + 0.4 * time_s - 1e-3 * time_s**2
    assert np.abs(deviations(time_s, values)).max() < 1e-9
    heard = values + 0.3 * rng.normal(size=1000)
    assert robust_sd(deviations(time_s, heard)) == pytest.approx(0.3, rel=0.12)
    heard[::20] += 50.0
    assert robust_sd(deviations(time_s, heard)) == pytest.approx(0.3, rel=0.4)
