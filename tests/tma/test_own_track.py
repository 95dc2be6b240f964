"""Own ship between its fixes, on its clock, on the plane, and what it tows.

Figures are of the geometry, or of pyproj's geodesics.
"""

import numpy as np
import polars as pl
import pytest
from made_tables import heard, one, said, ship
from pyproj import Geod

from boresight.errors import DataError
from boresight.maths.frames import enu_from_geodetic
from boresight.target_motion.contacts import contacts
from boresight.target_motion.own_track import own_track

EARTH = Geod(ellps="WGS84")


def circle(count, dt, **more):
    """Own ship turning at 3 degrees a second at 10 m/s, and what it should be."""
    t = dt * np.arange(count)
    course = np.radians(3.0 * t)
    radius = 10.0 / np.radians(3.0)
    place = {"north_m": radius * np.sin(course), "east_m": radius * (1 - np.cos(course))}
    columns = {name: value(course) for name, value in more.items()}
    return pl.DataFrame({"time_s": t, **place, **columns})


def between(own, times):
    frame = pl.DataFrame({"time_s": times, "bearing_deg": 60 + 0.0 * times})
    found, _ = one(frame, own, sigma_deg=1)
    course, radius = np.radians(3.0 * times), 10.0 / np.radians(3.0)
    truth = radius * np.stack([np.sin(course), 1 - np.cos(course)], axis=-1)
    return np.abs(found.position_m - truth).max()


def test_course_and_speed_place_own_ship_better():
    """10 s apart in a turn: the cubic through velocities is 40 times nearer than through places."""
    times = np.linspace(11, 89, 40)
    with_course = {"course_deg": np.degrees, "speed_mps": lambda c: 10.0 + 0 * c}
    assert between(circle(11, 10.0, **with_course), times) < 0.05
    assert 0.05 < between(circle(11, 10.0), times) < 2.5
    assert between(circle(101, 1.0), times) < 0.05


def test_a_course_that_places_belie_is_not_used():
    own = ship(course_deg=0.0, speed_mps=5.0)
    found, remarks = one(heard(), own, sigma_deg=1)
    assert said(remarks, "course and speed do not agree")
    assert np.allclose(found.position_m[:, 1], 5 * found.time_s, rtol=0, atol=1e-9)
    assert one(heard(), ship(course_deg=90.0, speed_mps=5.0), sigma_deg=1)[1] == ()


def test_bearings_in_a_gap_are_kept_on_a_straight_leg_only():
    straight = ship().filter(~pl.col("time_s").is_between(40, 70))
    found, remarks = one(heard(), straight, sigma_deg=1)
    assert len(found.time_s) == 101
    assert remarks == ()
    rough = straight.with_columns(north_m=pl.Series(0.1 * np.sin(2.0 * np.arange(70.0))))
    assert len(one(heard(), rough, sigma_deg=1)[0].time_s) == 101
    turning = circle(101, 1.0).filter(~pl.col("time_s").is_between(40, 70))
    found, remarks = one(heard(), turning, sigma_deg=1)
    assert not np.any((found.time_s > 39) & (found.time_s < 71))
    assert len(found.time_s) == 101 - 31
    assert said(remarks, "31 bearings", "gaps")


def test_a_turn_at_the_end_of_a_gap_makes_it_unsure():
    """East up to the last fix before 70 s, and North from there."""
    t = np.arange(0.0, 101.0)
    course, ahead = np.where(t < 70, 90.0, 0.0), np.maximum(t - 70, 0.0)
    place = {"north_m": 5 * ahead, "east_m": 5 * np.minimum(t, 70.0)}
    own = pl.DataFrame({"time_s": t, **place, "course_deg": course, "speed_mps": 5.0})
    found, _ = one(heard(), own.filter(~pl.col("time_s").is_between(41, 69)), sigma_deg=1)
    assert len(found.time_s) == 101 - 29


def test_a_gap_is_longer_than_ten_seconds():
    """In a turn of 3 degrees a second 9 s between fixes are bridged, 13 s are not."""
    for last, count in ((48, 101), (52, 101 - 12)):
        turning = circle(101, 1.0).filter(~pl.col("time_s").is_between(41, last))
        assert len(one(heard(), turning, sigma_deg=1)[0].time_s) == count


def test_bearings_outside_the_log_are_counted_and_left_out():
    found, remarks = one(heard(101), ship(81), sigma_deg=1)
    assert found.time_s[-1] == 80
    assert said(remarks, "20 of 101 bearings")


APART = {
    "a time zone": (7200.0, "-7200 s (2 h"),
    "half an hour beside a zone": (19800.0, "-19800 s (5.5 h"),
    "midnight": (-86400.0, "+86400 s (another day)"),
    "an epoch": (1.5e9 - 1.5e9 % 86400, "another epoch"),
    "one from zero": (4000.0, "both begin together"),
}


@pytest.mark.parametrize("case", APART)
def test_no_time_in_common_names_the_shift_that_explains_it(case):
    shift, words = APART[case]
    own = ship().with_columns(pl.col("time_s") + shift)
    with pytest.raises(DataError, match="no time in common") as caught:
        contacts(heard(), own)
    assert words in caught.value.why
    assert "0.0 to 100.0" in caught.value.where
    option, _, value = caught.value.next_step.rpartition(" ")
    assert option.endswith("--own-ship-clock")
    assert len(one(heard(), own, own_ship_clock_s=float(value), sigma_deg=1)[0].time_s) == 101


def test_the_clock_is_added_to_own_ship_s_times():
    found, _ = one(heard(), ship(121), own_ship_clock_s=-10.0, sigma_deg=1)
    assert np.allclose(found.position_m[:, 1], 5 * (found.time_s + 10), rtol=0, atol=1e-9)


@pytest.mark.parametrize("both", [True, False])
def test_dates_become_seconds_of_the_first_day(both):
    start = pl.datetime(2017, 9, 12, 23, 59, 0)

    def dated(frame):
        moment = (start + pl.duration(milliseconds=1000 * pl.col("time_s"))).alias("time")
        return frame.with_columns(moment).drop("time_s")

    own = dated(ship()) if both else ship().with_columns(pl.col("time_s") + 86340)
    found, remarks = one(dated(heard()), own, sigma_deg=1)
    assert found.time_s[[0, -1]].tolist() == [86340, 86440]
    assert len(found.time_s) == 101
    assert said(remarks, "midnight UTC of 2017-09-12")


# latitude and longitude


def test_the_plane_holds_places_and_true_bearings_fifty_kilometres_out():
    """At 60 N, 50 km East of the first place: distances to 1 m, bearings to 0.002 degrees."""
    t = np.arange(0.0, 5001.0, 50.0)
    longitude, latitude, _ = EARTH.fwd(
        np.full(101, 5.0), np.full(101, 60.0), np.full(101, 90.0), 10.0 * t
    )
    own = pl.DataFrame({"time_s": t, "latitude_deg": latitude, "longitude_deg": longitude})
    bearing = 30.0 + 0.0 * t
    target = EARTH.fwd(longitude, latitude, bearing, np.full(101, 5000.0))
    frame = pl.DataFrame({"time_s": t, "bearing_deg": bearing})
    found, remarks = one(frame, own, sigma_deg=1)
    assert np.allclose(np.hypot(*found.position_m.T), 10 * t, rtol=0, atol=1.0)
    east, north, _ = enu_from_geodetic(target[1], target[0], 0.0, found.site).T
    line = np.stack([north, east], axis=-1) - found.position_m
    off = np.degrees(found.bearing_rad - np.arctan2(line[:, 1], line[:, 0]))
    assert np.abs(off).max() < 0.002
    leans = np.degrees(50_000 / 6.39e6) * np.tan(np.radians(60))  # to the West, where the pole is
    assert np.degrees(found.bearing_rad[-1]) - 30.0 == pytest.approx(-leans, abs=0.01)
    assert said(remarks, "Meridians converge", "0.7")
    relative = pl.DataFrame({"time_s": t, "bearing_relative_deg": bearing - 90.0})
    again, _ = one(relative, own.with_columns(heading_deg=pl.lit(90.0)), sigma_deg=1)
    assert np.allclose(again.bearing_rad, found.bearing_rad, rtol=0, atol=1e-12)


# a towed array


def test_a_towed_array_is_where_the_ship_was():
    """East for 500 m, then North: the array, 200 m astern, turns where the ship did."""
    t = np.arange(0.0, 201.0)
    east, north = np.minimum(5 * t, 500.0), np.maximum(5 * t - 500.0, 0.0)
    own = pl.DataFrame({"time_s": t, "north_m": north, "east_m": east})
    cones = pl.DataFrame({"time_s": t, "bearing_deg": 50.0 + 0 * t, "conical": True})
    found, _ = one(cones, own, tow_m=200.0, sigma_deg=1)
    first, turned = found.time_s < 130, found.time_s > 160
    assert np.allclose(found.position_m[first, 1], 5 * t[first] - 200, rtol=0, atol=1e-6)
    assert np.allclose(found.position_m[first, 0], 0, rtol=0, atol=1e-6)
    assert np.allclose(np.degrees(found.axis_rad[first]), 90, rtol=0, atol=1e-6)
    assert np.allclose(found.position_m[turned, 0], 5 * t[turned] - 700, rtol=0, atol=1e-6)
    assert np.allclose(np.degrees(found.axis_rad[turned]), 0, rtol=0, atol=1e-6)
    steady = np.abs(t - 100) > 2  # where the ship turns on the spot its curve has no speed
    assert np.allclose(found.velocity_mps[first & steady], [0, 5], rtol=0, atol=1e-6)
    assert np.allclose(np.hypot(*found.velocity_mps[steady].T), 5, rtol=0, atol=1e-6)


def test_a_towed_array_lies_along_the_path_whatever_the_ship_heads():
    cones = heard(conical=True)
    towed, _ = one(cones, ship(heading_deg=80.0), tow_m=200.0, sigma_deg=1)
    assert np.allclose(np.degrees(towed.axis_rad), 90.0, rtol=0, atol=1e-6)
    hull, _ = one(cones, ship(heading_deg=80.0), sigma_deg=1)
    assert np.allclose(np.degrees(hull.axis_rad), 80.0, rtol=0, atol=1e-6)


def test_a_heading_that_is_missing_for_long_is_told():
    def told(holes):
        time_s = np.arange(100.0)
        rows = {"time_s": time_s, "north_m": 3.0 * time_s, "east_m": 0.0 * time_s}
        heading = [None if low <= t < high else 0.0 for t in time_s for low, high in [holes]]
        remarks = []
        own_track(pl.DataFrame(rows | {"heading_deg": heading}), 0.0, remarks)
        return " ".join(remarks)

    assert "heading is missing for up to 41 s" in told((30, 70))
    assert "heading is missing for up to 40 s" in told((60, 100))
    assert "missing" not in told((30, 33))
