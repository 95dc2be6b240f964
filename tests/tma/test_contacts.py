"""Contacts of two tables: the geometry, every doubt settled or refused, and the real towed array.

Figures are of the geometry; the example's truth was made apart.
"""

import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from made_tables import SIGMA, heard, one, said, ship

from boresight.errors import DataError, UsageError
from boresight.formats.bearings import read_bearings
from boresight.formats.own_ship import read_own_ship
from boresight.maths.frames import enu_from_geodetic
from boresight.target_motion.contacts import contacts

HERE = Path(__file__).parents[2]
ARRAY = HERE.parent / "shared" / "data" / "towed-array"


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


def test_bearings_without_scatter_are_not_taken_as_perfect():
    smooth = heard().with_columns(bearing_deg=60 + 0.2 * pl.col("time_s"))
    assert np.degrees(one(smooth, ship())[0].sigma_rad) == pytest.approx(np.full(101, 0.01))


def test_a_cone_is_never_magnetic():
    cones = heard(conical=True)
    found, _ = one(cones.with_columns(magnetic=pl.lit(value=True)), ship(), sigma_deg=1)
    assert np.allclose(np.degrees(found.cone_rad), cones["bearing_deg"], rtol=0, atol=1e-12)


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
    assert len(one(heard(3, sigma_deg=1.0), ship())[0].time_s) == 3


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


def test_two_near_bearings_on_either_side_of_south_are_averaged():
    again = heard()[50:51].with_columns(bearing_deg=pl.lit(180.3))
    frame = heard().with_columns(bearing_deg=pl.lit(179.9))
    found, _ = one(pl.concat([frame, again]), ship(), sigma_deg=SIGMA)
    assert np.degrees(found.bearing_rad[50]) == pytest.approx(180.1)


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
