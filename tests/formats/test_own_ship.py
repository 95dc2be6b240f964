"""Own ship's log in: where it says to be, at which times, and what is refused."""

import polars as pl
import pytest

from boresight.errors import DataError
from boresight.formats.own_ship import own_ship_table, read_own_ship

GOOD = "time_s,north_m,east_m\n0,0,0\n1,0,5\n2,0,10\n3,0,15\n"


def csv(tmp_path, text, name="ship.csv"):
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    return file


def test_a_plain_log_is_read_without_a_word(tmp_path):
    table, remarks = read_own_ship(csv(tmp_path, GOOD))
    assert table["east_m"].to_list() == [0, 5, 10, 15]
    assert remarks == ()


@pytest.mark.parametrize(
    ("head", "name", "expected"),
    [
        ("Time_s,Latitude,Longitude", "latitude_deg", 1.0),
        ("time_s,lat,lon", "longitude_deg", 2.0),
        ("time_s,latitude_rad,longitude_rad", "latitude_deg", 57.29577951308232),
        ("time_s,north_km,east_km", "north_m", 1000.0),
        ("time_s,east_nm,north_nm", "north_m", 3704.0),
    ],
)
def test_places_under_other_names_and_units(tmp_path, head, name, expected):
    head = head.replace("Time_s", "time_s")
    table, _ = read_own_ship(csv(tmp_path, f"{head}\n0,1,2\n1,1,2\n"))
    assert table[name][0] == pytest.approx(expected, rel=1e-14)


def test_course_and_speed_under_other_names(tmp_path):
    text = "time_s,lat,lon,cog_deg,sog_kt,heading_deg\n0,1,2,90,10,85\n1,1,2,90,10,85\n"
    table, _ = read_own_ship(csv(tmp_path, text))
    assert table["speed_mps"][0] == pytest.approx(18520 / 3600)
    assert table.select("course_deg", "heading_deg").row(0) == (90, 85)


X_IS_EAST = "time_s,x_m,y_m,course_deg\n0,0,0,80\n1,5,1,80\n2,10,2,80\n"
X_IS_NORTH = "time_s,x_m,y_m,course_deg\n0,0,0,10\n1,5,1,10\n2,10,2,10\n"
NOBODY_KNOWS = "time_s,x_m,y_m\n0,0,0\n1,5,1\n2,10,2\n"


@pytest.mark.parametrize(
    ("text", "north", "why"),
    [
        (X_IS_EAST, [0, 1, 2], "as course_deg says"),
        (X_IS_NORTH, [0, 5, 10], "as course_deg says"),
        (NOBODY_KNOWS, [0, 5, 10], "nothing in the file confirms"),
    ],
)
def test_x_and_y_are_never_taken_in_silence(tmp_path, text, north, why):
    table, remarks = read_own_ship(csv(tmp_path, text))
    assert table["north_m"].to_list() == north
    assert why in remarks[0]
    assert ("x_m was taken as East" in remarks[0]) == (north == [0, 1, 2])


def test_north_and_east_go_before_x_and_y(tmp_path):
    text = "time_s,x_m,y_m,north_m,east_m\n0,9,9,0,0\n1,9,9,1,2\n"
    table, remarks = read_own_ship(csv(tmp_path, text))
    assert table["east_m"].to_list() == [0, 2]
    assert remarks == ()


def test_time_that_goes_back_is_sorted_and_said(tmp_path):
    table, remarks = read_own_ship(csv(tmp_path, GOOD + "1.5,0,7.5\n"))
    assert table["east_m"].to_list() == [0, 5, 7.5, 10, 15]
    assert "sorted" in remarks[0]


def test_a_time_twice_is_taken_once(tmp_path):
    table, remarks = read_own_ship(csv(tmp_path, GOOD + "3,0,15\n"))
    assert table.height == 4
    assert "once each" in remarks[0]
    table, remarks = read_own_ship(csv(tmp_path, GOOD + "3,0,17\n"))
    assert table["east_m"].to_list() == [0, 5, 10, 16]
    assert "averaged" in remarks[0]


def test_a_place_that_cannot_be_is_left_out_and_said(tmp_path):
    rows = [f"{t},43.2,{179.999 + 1e-4 * t - 360 * (t > 10):.6f}" for t in range(21)]
    rows[7] = "7,0,0"
    rows[20] = "20,43.2,8.0"
    file = csv(tmp_path, "\n".join(["time_s,latitude_deg,longitude_deg", *rows]) + "\n")
    table, remarks = read_own_ship(file)
    assert table["time_s"].to_list() == [t for t in range(20) if t != 7]
    assert remarks == ("2 places in own ship's log cannot be, the first in line 9: left out.",)


def test_rows_without_a_place_are_counted(tmp_path):
    table, remarks = read_own_ship(csv(tmp_path, GOOD + "4,,20\n5,nan,25\n"))
    assert table.height == 4
    assert remarks[0].startswith("2 rows")


WRONG = {
    "nowhere": ("time_s,depth_m\n0,1\n", "line 1", "latitude_deg"),
    "half a place": ("time_s,latitude_deg\n0,1\n", "line 1", "longitude_deg"),
    "no time": ("latitude_deg,longitude_deg\n1,2\n", "line 1", "time_s"),
    "latitude 91": ("time_s,latitude_deg,longitude_deg\n0,91,0\n1,9,0\n", "line 2", "91"),
    "infinite": (GOOD + "4,0,inf\n", "line 6", "inf"),
    "negative speed": ("time_s,north_m,east_m,speed_kt\n0,0,0,-3\n", "line 2", "speed_mps"),
    "two places at once": (GOOD + "3,4000,15\n", "lines 5, 6", "4000 m apart"),
    "a jump for good": (GOOD + "4,0,9000\n5,0,9005\n", "line 6", "does not come back"),
    "one place": ("time_s,north_m,east_m\n0,0,0\n", "line 2", "one time only"),
    "one time": ("time_s,north_m,east_m\n0,0,0\n0,0,0\n", "line 2", "one time only"),
    "a header alone": ("time_s,north_m,east_m\n", "0 rows", "no row"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_logs_get_one_error_that_says_where(tmp_path, name):
    text, where, what = WRONG[name]
    with pytest.raises(DataError) as caught:
        read_own_ship(csv(tmp_path, text))
    assert where in caught.value.where
    assert what in str(caught.value)
    assert caught.value.next_step


def test_the_places_of_two_hydrophones_are_the_array():
    names = ["Sensor1_pos_x_m", "Sensor1_pos_y_m", "Sensor2_pos_x_m", "Sensor2_pos_y_m"]
    rows = [[0.0, 1.0], [10.0, 10.0], [-8.0, -7.0], [10.0, 10.0]]
    frame = pl.DataFrame({"time_s": [0.0, 1.0], **dict(zip(names, rows, strict=True))})
    table, remarks = own_ship_table(frame)
    assert table.select("north_m", "east_m", "axis_deg").rows() == [(10, -4, 90), (10, -3, 90)]
    assert "Sensor2 to Sensor1" in remarks[0]
