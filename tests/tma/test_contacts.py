"""Contacts of two tables: the geometry, every doubt settled or refused, and the real towed array.

Figures are of the geometry, or of pyproj's geodesics; the example's truth was made apart.
"""

import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from pyproj import Geod

from boresight.errors import DataError, UsageError
from boresight.formats.bearings import read_bearings
from boresight.formats.own_ship import read_own_ship
from boresight.maths.frames import enu_from_geodetic
from boresight.tma.contacts import contacts

HERE = Path(__file__).parents[2]
ARRAY = HERE.parent / "shared" / "data" / "towed-array"
EARTH = Geod(ellps="WGS84")
SIGMA = 0.5


def ship(count=101, dt=1.0, **more):
    """East at 5 m/s."""
    t = dt * np.arange(count)
    return pl.DataFrame({"time_s": t, "north_m": 0.0 * t, "east_m": 5.0 * t, **more})


def heard(count=101, dt=1.0, seed=1, **more):
    """A contact on 060, falling back by 0.2 degrees a second, with an error of half a degree."""
    t = dt * np.arange(count)
    noise = SIGMA * np.random.default_rng(seed).normal(size=count)
    return pl.DataFrame({"time_s": t, "bearing_deg": 60 + 0.2 * t + noise, **more})


def said(remarks, *words):
    return any(all(word in each for word in words) for each in remarks)


def one(bearings, own_ship, **options):
    (found,), remarks = contacts(bearings, own_ship, **options)
    return found, remarks


def test_a_plain_pair_of_tables_is_a_contact():
    frame = heard(sigma_deg=SIGMA)
    found, remarks = one(frame, ship(), name="a")
    assert found.name == "a"
    assert np.allclose(np.degrees(found.bearing_rad), frame["bearing_deg"], rtol=0, atol=1e-12)
    assert np.allclose(found.position_m[:, 1], 5 * found.time_s, rtol=0, atol=1e-9)
    assert np.allclose(found.velocity_mps, [0, 5], rtol=0, atol=1e-9)
    assert np.allclose(found.sigma_rad, np.radians(SIGMA))
    assert found.site is None
    assert not found.is_conical
    assert found.plots.shape == (1, 101, 1)
    assert remarks == ()


def test_nobody_s_frame_is_changed():
    bearings, own = heard(), ship()
    before = bearings.clone(), own.clone()
    contacts(bearings, own)
    assert bearings.equals(before[0])
    assert own.equals(before[1])


def test_bearings_past_a_turn_are_wrapped():
    found, _ = one(heard().with_columns(pl.col("bearing_deg") + 360), ship(), sigma_deg=1)
    again, _ = one(heard(), ship(), sigma_deg=1)
    assert np.allclose(found.bearing_rad, again.bearing_rad, rtol=0, atol=1e-12)
    assert np.abs(found.bearing_rad).max() <= np.pi


# sigma: the column, the argument, the scatter


def test_sigma_is_the_column_s_then_the_argument_s():
    column = pl.Series([0.7, None] * 50 + [0.7])
    found, _ = one(heard(sigma_deg=column), ship(), sigma_deg=0.4)
    assert np.allclose(np.degrees(found.sigma_rad), [0.7, 0.4] * 50 + [0.7])


def test_sigma_is_else_the_scatter_and_said():
    """Of 1,001 bearings a robust sd has 3 %; the band is four of them."""
    found, remarks = one(heard(1001), ship(1001))
    assert np.degrees(found.sigma_rad[0]) == pytest.approx(SIGMA, rel=0.12)
    assert said(remarks, "scatter", f"{np.degrees(found.sigma_rad[0]):.3g} degrees")


def test_too_few_bearings_do_not_tell_their_scatter():
    with pytest.raises(DataError, match="how good") as caught:
        contacts(heard(8), ship())
    assert "--sigma" in caught.value.next_step
    assert len(one(heard(8), ship(), sigma_deg=1)[0].time_s) == 8


@pytest.mark.parametrize(("sigma", "words"), [(0.05, "surer"), (5.0, "modest")])
def test_a_sigma_that_the_scatter_belies_is_said(sigma, words):
    assert said(one(heard(sigma_deg=sigma), ship())[1], words)


# what a bearing is of


def test_magnetic_bearings_need_a_declination():
    true, _ = one(heard(), ship(), sigma_deg=1)
    named = heard().rename({"bearing_deg": "bearing_magnetic_deg"})
    for frame in (named, heard(magnetic=True)):
        with pytest.raises(DataError, match="magnetic") as caught:
            contacts(frame, ship(), sigma_deg=1)
        assert "--declination" in caught.value.next_step
        found, _ = one(frame, ship(), sigma_deg=1, declination_deg=-3.0)
        off = np.degrees(found.bearing_rad - true.bearing_rad)
        assert np.allclose(off, -3.0, rtol=0, atol=1e-9)


def test_true_bearings_are_not_turned_by_a_declination():
    found, remarks = one(heard(), ship(), sigma_deg=1, declination_deg=10.0)
    assert np.array_equal(found.bearing_rad, one(heard(), ship(), sigma_deg=1)[0].bearing_rad)
    assert said(remarks, "Declination", "not used")


def test_relative_bearings_need_a_heading():
    relative = heard().select("time_s", bearing_relative_deg=pl.col("bearing_deg") - 90)
    with pytest.raises(DataError, match="heading"):
        contacts(relative, ship(course_deg=90.0), sigma_deg=1)
    found, _ = one(relative, ship(heading_deg=90.0), sigma_deg=1)
    assert np.allclose(np.degrees(found.bearing_rad), heard()["bearing_deg"], rtol=0, atol=1e-9)


def test_a_heading_through_north_is_not_averaged_through_south():
    heading = np.where(np.arange(101) % 2, 359.0, 1.0)
    times = 0.5 + np.arange(50.0)
    relative = pl.DataFrame({"time_s": times, "bearing_relative_deg": 20.0 + 0.0 * times})
    found, _ = one(relative, ship(heading_deg=heading), sigma_deg=1)
    assert np.allclose(np.degrees(found.bearing_rad), 20.0, rtol=0, atol=1e-9)


def test_holes_in_the_heading_are_filled_from_both_sides():
    heading = [None if t % 10 else (350.0 + 0.2 * t) % 360 for t in range(101)]
    times = 0.5 + np.arange(50.0)
    relative = pl.DataFrame({"time_s": times, "bearing_relative_deg": 0.0 * times})
    found, _ = one(relative, ship(heading_deg=pl.Series(heading)), sigma_deg=1)
    assert np.allclose(np.degrees(found.bearing_rad), 0.2 * times - 10, rtol=0, atol=1e-9)


def test_cones_are_off_the_array_s_axis():
    cones = heard(conical=True)
    found, _ = one(cones, ship(), sigma_deg=1)
    assert np.allclose(np.degrees(found.cone_rad), cones["bearing_deg"], rtol=0, atol=1e-12)
    assert np.isnan(found.bearing_rad).all()
    assert np.allclose(np.degrees(found.axis_rad), 90.0, rtol=0, atol=1e-6)
    given, _ = one(cones, ship(axis_deg=93.0, heading_deg=80.0), sigma_deg=1)
    assert np.allclose(np.degrees(given.axis_rad), 93.0)


def test_an_axis_that_nobody_knows_is_refused():
    still = ship().with_columns(east_m=pl.lit(0.0))
    with pytest.raises(DataError, match="axis"):
        contacts(heard(conical=True), still, sigma_deg=1)
    assert one(heard(conical=True), still.with_columns(heading_deg=10.0), sigma_deg=1)


SPACING, SOUND = 20.0, 1500.0


def differences(cosine, **more):
    cosine = np.asarray(cosine, dtype=float)
    time_s = np.arange(len(cosine), dtype=float)
    return pl.DataFrame({"time_s": time_s, "tdoa_s": SPACING / SOUND * cosine, **more})


def test_time_differences_are_cones():
    angle = np.linspace(20, 160, 60)
    frame = differences(np.cos(np.radians(angle)), sigma_tdoa_s=1e-4)
    with pytest.raises(DataError, match="spacing"):
        contacts(frame, ship())
    found, _ = one(frame, ship(), array_spacing_m=SPACING)
    assert np.allclose(np.degrees(found.cone_rad), angle, rtol=0, atol=1e-9)
    abeam = np.argmin(np.abs(angle - 90))
    noise = SOUND * 1e-4 / SPACING
    assert found.sigma_rad[abeam] == pytest.approx(noise, rel=0.01)
    assert found.sigma_rad[0] == pytest.approx(noise / np.sin(np.radians(20)), rel=0.05)


def test_the_error_at_endfire_is_that_of_arccos():
    """20,000 draws tell a root mean square to 1 %; one number tells a skew law to 30 %."""
    noise = 0.0075
    found, _ = one(differences([1.0] * 20, sigma_tdoa_s=noise * SPACING / SOUND), ship(),
                   array_spacing_m=SPACING)  # fmt: skip
    cosine = 1.0 + noise * np.random.default_rng(2).normal(size=20_000)
    drawn = np.arccos(np.minimum(cosine, 1.0))
    assert found.sigma_rad[0] == pytest.approx(np.sqrt(np.mean(drawn**2)), rel=0.3)


def test_differences_longer_than_the_array_are_clipped_or_left_out():
    frame = differences([0.5, 1.01, -1.01, 1.05, 0.4, 0.3], sigma_tdoa_s=1e-4)
    found, remarks = one(frame, ship(), array_spacing_m=SPACING)
    assert np.allclose(np.degrees(found.cone_rad)[[0, 1, 2]], [60, 0, 180], rtol=0, atol=1e-9)
    assert len(found.time_s) == 5
    assert said(remarks, "2 time differences", "endfire")
    assert said(remarks, "1 time differences", "left out")
    with pytest.raises(DataError, match="every time difference"):
        contacts(differences([500.0] * 5), ship(), array_spacing_m=SPACING, sigma_deg=1)


def test_sound_is_the_table_s_unless_told():
    frame = differences([0.5] * 20, sigma_tdoa_s=1e-4, sound_speed_mps=1200.0)
    for told, speed in ((None, 1200.0), (1450.0, 1450.0)):
        found, _ = one(frame, ship(), array_spacing_m=SPACING, sound_speed_mps=told)
        assert np.cos(found.cone_rad[0]) == pytest.approx(0.5 * speed / SOUND)


def test_contacts_that_draw_ahead_make_one_look_at_the_array():
    tracks = [differences(np.linspace(-0.5, 0.5, 20), track=str(i)) for i in range(6)]
    options = {"array_spacing_m": SPACING, "sigma_deg": 1.0}
    assert said(contacts(pl.concat(tracks), ship(), **options)[1], "6 of 6", "exchanged")
    back = pl.concat(tracks).with_columns(-pl.col("tdoa_s"))
    assert not said(contacts(back, ship(), **options)[1], "exchanged")


# own ship between its fixes


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
    turning = circle(101, 1.0).filter(~pl.col("time_s").is_between(40, 70))
    found, remarks = one(heard(), turning, sigma_deg=1)
    assert not np.any((found.time_s > 39) & (found.time_s < 71))
    assert len(found.time_s) == 101 - 31
    assert said(remarks, "31 bearings", "gaps")


def test_bearings_outside_the_log_are_counted_and_left_out():
    found, remarks = one(heard(101), ship(81), sigma_deg=1)
    assert found.time_s[-1] == 80
    assert said(remarks, "20 of 101 bearings")


APART = {
    "a time zone": (7200.0, "-7200 s (2 h"),
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


# several contacts, and two bearings at one time


def two_tracks():
    return pl.concat([heard(30, track="b"), heard(60, seed=2, track="a"), heard(2, track="c")])


def test_contacts_come_with_the_longest_first_and_short_ones_are_named():
    found, remarks = contacts(two_tracks(), ship(), sigma_deg=1)
    assert [(each.name, len(each.time_s)) for each in found] == [("a", 60), ("b", 30)]
    assert said(remarks, "fewer than 3", "c left out")
    (chosen,), _ = contacts(two_tracks(), ship(), sigma_deg=1, track="b")
    assert chosen.name == "b"
    with pytest.raises(UsageError, match="contact 'd'"):
        contacts(two_tracks(), ship(), track="d")


@pytest.mark.parametrize("count", [1, 2])
def test_one_bearing_makes_no_contact(count):
    with pytest.raises(DataError, match="3 bearings"):
        contacts(heard(count, sigma_deg=1.0), ship())


def test_the_same_row_twice_is_taken_once():
    found, remarks = one(pl.concat([heard(), heard()[50:52]]), ship(), sigma_deg=1)
    assert len(found.time_s) == 101
    assert said(remarks, "2 bearings", "taken once")
    assert np.allclose(np.degrees(found.sigma_rad), 1.0)


def test_two_near_bearings_at_one_time_are_averaged():
    again = heard()[50:51].with_columns(pl.col("bearing_deg") + 0.8)
    found, remarks = one(pl.concat([heard(), again]), ship(), sigma_deg=SIGMA)
    assert len(found.time_s) == 101
    assert np.degrees(found.bearing_rad[50]) == pytest.approx(heard()["bearing_deg"][50] + 0.4)
    assert np.degrees(found.sigma_rad[50]) == pytest.approx(SIGMA / np.sqrt(2))
    assert said(remarks, "averaged")


def test_a_true_bearing_goes_before_a_cone_of_its_time():
    both = pl.concat([heard(conical=False), heard(conical=True)[40:50]])
    found, remarks = one(both, ship(heading_deg=90.0), sigma_deg=1)
    assert len(found.time_s) == 101
    assert not found.is_conical
    assert said(remarks, "10 cones", "left out")


def test_two_far_bearings_at_one_time_may_be_two_contacts():
    again = heard()[50:51].with_columns(pl.col("bearing_deg") + 40)
    with pytest.raises(DataError, match="at one time") as caught:
        contacts(pl.concat([heard(), again]), ship(), sigma_deg=SIGMA)
    assert "two contacts" in caught.value.why
    assert "51, 102" in caught.value.where


@pytest.mark.parametrize(
    "options",
    [
        {"sigma_deg": 0.0}, {"sigma_deg": np.nan}, {"tow_m": -1.0}, {"own_ship_clock_s": np.inf},
        {"declination_deg": 500.0},
    ],
)  # fmt: skip
def test_numbers_that_cannot_be_are_refused(options):
    with pytest.raises(UsageError):
        contacts(heard(magnetic=True), ship(), **{"declination_deg": 0.0, **options})


# the example, and the sea


def test_the_example_is_the_scenario_it_says():
    """746 bearings: their mean error has 0.012 degrees, the band is four of them."""
    bearings, more = read_bearings(HERE / "examples" / "tma" / "bearings.csv")
    own, again = read_own_ship(HERE / "examples" / "tma" / "own-ship.csv")
    assert (*more, *again) == ()
    found, remarks = one(bearings, own)
    assert remarks == ()
    truth = pl.read_csv(HERE / "examples" / "tma" / "truth.csv")
    east, north, _ = enu_from_geodetic(
        truth["latitude_deg"].to_numpy(), truth["longitude_deg"].to_numpy(), 0.0, found.site
    ).T
    seen = np.stack(
        [np.interp(found.time_s, truth["time_s"], axis) for axis in (north, east)], axis=-1
    )
    away = seen - found.position_m
    off = np.degrees(found.bearing_rad - np.arctan2(away[:, 1], away[:, 0]))
    assert abs(off.mean()) < 0.05
    assert off.std() == pytest.approx(np.degrees(found.sigma_rad[0]), rel=0.1)
    assert np.diff(found.time_s).max() > 30
    assert np.hypot(*found.velocity_mps[60]) == pytest.approx(10.3, abs=0.02)


@pytest.mark.skipif(not ARRAY.exists(), reason="the towed array's recording is not here")
def test_the_towed_array_at_sea():
    begun = time.perf_counter()
    bearings, told = read_bearings(ARRAY / "tdoa-tracks.mat")
    own, told_own = read_own_ship(ARRAY / "own-ship.csv")
    found, remarks = contacts(bearings, own)
    assert time.perf_counter() - begun < 5.0
    assert len(found) == 43
    assert [len(each.time_s) for each in found[:2]] == [1440, 83]
    assert sum(len(each.time_s) for each in found) == bearings.height
    assert all(each.is_conical and np.isfinite(each.sigma_rad).all() for each in found)
    falls = [np.polyfit(each.time_s, each.cone_rad, 1)[0] > 0 for each in found]
    assert sum(falls) >= 40
    course = np.degrees(np.arctan2(*found[0].velocity_mps.mean(axis=0)[::-1]))
    assert np.degrees(found[0].axis_rad) == pytest.approx(course, abs=0.5)
    assert said(told, "ahead")
    assert said(told_own, "midway")
    assert said(remarks, "midnight UTC of 2017-09-12")
    assert said(remarks, "smoothed")


@pytest.mark.skipif(not ARRAY.exists(), reason="the towed array's recording is not here")
def test_the_array_s_x_is_east_because_the_ship_s_longitude_says_so():
    own = pl.read_csv(ARRAY / "own-ship.csv")
    first, last = own[0], own[-1]
    metres = 111_195.0 * np.cos(np.radians(first["Boat_Latitude"][0]))
    east = metres * (last["Boat_Longitude"][0] - first["Boat_Longitude"][0])
    assert last["Boat_pos_x_m"][0] - first["Boat_pos_x_m"][0] == pytest.approx(east, rel=0.01)
    ahead = own["Sensor1_pos_x_m"] - own["Sensor2_pos_x_m"]
    assert ahead.min() > 20  # the ship runs East
