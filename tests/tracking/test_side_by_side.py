"""Filters side by side, on plots of known truth. Statistical tests use fixed seeds and say how
often they would fail by chance.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy import stats

from boresight import catalogue
from boresight.catalogue import lookup
from boresight.errors import UsageError
from boresight.formats.recording import read_recording
from boresight.maths.frames import Site
from boresight.tracking.beside import Flown, clustered, side_by_side
from boresight.tracking.case import prepare
from boresight.tracking.choose import recursion_for
from boresight.tracking.flight import fly
from boresight.tracking.noise import Noise
from boresight.tracking.tracker import track

KNOWN = Noise(range_m=20.0, azimuth_deg=0.05, altitude_m=2.2, accel_mps2=0.002)
DATA = Path(__file__).parents[3] / "shared/data"
RECORDINGS = {
    "barcelona-60nm/plots-cat048.ast": Site(
        latitude_deg=41.3007023, longitude_deg=2.1020582, height_m=27.26
    ),
    "saenz-pena/plots-cat048.pcap": None,
}


class Broken:
    """A filter whose states stop being numbers: the square of its noise is beyond them."""

    name = "broken"

    def recursion(self, motion, sensor):
        inner = replace(motion.inner, accel_mps2=1e200)
        return lookup("ekf").recursion(replace(motion, inner=inner), sensor)


@pytest.fixture(scope="module")
def traffic():
    from conftest import Sky

    late = Sky().aircraft(20, start_s=215.0, plots=45)
    return pl.concat([*(Sky().aircraft(n) for n in range(20)), late])


@pytest.fixture(scope="module")
def compared(traffic):
    from conftest import SITE

    banking = pl.when(pl.col("address") == "F00003").then(20.0).otherwise(0.0)
    told = traffic.with_columns(ground_speed_mps=pl.col("truth_speed"), roll_deg=banking)
    others = [lookup(name) for name in ("iekf", "mekf")]
    return track(told, filter=lookup("ekf"), compare=others, site=SITE, noise=KNOWN)


def flown(case, site, name, noise):
    recursion = recursion_for(lookup("ekf"), noise, site, case.flights.z.shape[1])
    return Flown(name, recursion, fly(case.flights, recursion, site))


def test_with_independent_plots_the_interval_is_students():
    difference = np.random.default_rng(3).standard_normal(40)
    found = clustered(difference, np.arange(40))
    low, high = stats.t.interval(0.95, 39, difference.mean(), stats.sem(difference))
    assert found.ci95 == pytest.approx((low, high), rel=1e-12)
    assert (found.plots, found.tracks) == (40, 40)


def test_plots_that_say_the_same_do_not_narrow_the_interval():
    difference = np.random.default_rng(4).standard_normal(30)
    once = clustered(difference, np.arange(30))
    often = clustered(np.repeat(difference, 50), np.repeat(np.arange(30), 50))
    assert often.ci95 == pytest.approx(once.ci95, rel=1e-12)


def test_the_interval_holds_the_truth_as_often_as_it_says():
    # 2,000 draws of 40 tracks of 5 to 100 plots; a share of 0.95 has sd 0.0049. The interval of
    # unequal clusters is known to be slightly narrow: the band is 4 sd, one failure in 10,000.
    generator = np.random.default_rng(5)
    hits = 0
    for _ in range(2000):
        track_of = np.repeat(np.arange(40), generator.integers(5, 100, 40))
        own = generator.standard_normal(40)[track_of]
        low, high = clustered(own + generator.standard_normal(len(own)), track_of).ci95
        hits += low < 0 < high
    assert abs(hits / 2000 - 0.95) < 0.0195


def test_one_track_or_none_gives_no_interval():
    assert np.isnan(clustered(np.ones(5), np.zeros(5)).ci95).all()
    assert clustered(np.zeros(0), np.zeros(0)).plots == 0


def in_the_plane(aircraft=40, plots=100):
    """Straight flights in the plane, 20 m and 0.05 degrees of noise, as a radar without heights."""
    generator = np.random.default_rng(6)
    time = 4.0 * np.arange(plots) + generator.uniform(0, 4, (aircraft, 1))
    heading, away = generator.uniform(0, 2 * np.pi, (2, aircraft, 1))
    place = 60e3 * np.exp(1j * away) + 150.0 * np.exp(1j * heading) * (time - 200.0)
    noise = generator.standard_normal((2, *time.shape))
    columns = {
        "time_s": time,
        "range_m": np.abs(place) + 20.0 * noise[0],
        "azimuth_deg": np.mod(np.degrees(np.angle(place)) + 0.05 * noise[1], 360.0),
        "address": np.repeat([f"{n:06X}" for n in range(aircraft)], plots),
    }
    return pl.DataFrame({name: values.ravel() for name, values in columns.items()})


def test_a_filter_that_overstates_its_noise_loses_what_theory_says(site):
    # All variances are four times the true ones: each of two components loses
    # ln 2 - (1 - 1/4) / 2 = 0.318 of log-likelihood. The interval misses once in 20 seeds.
    case = prepare(in_the_plane(), site, None)
    wide = replace(KNOWN, range_m=40.0, azimuth_deg=0.1, accel_mps2=0.004)
    known, wide = (flown(case, site, *each) for each in (("known", KNOWN), ("wide", wide)))
    (_, loser), _ = side_by_side(case, [known, wide], site)
    (_, winner), _ = side_by_side(case, [wide, known], site)
    low, high = loser.gain.ci95
    assert low < -0.636 < high
    assert high - low < 0.15
    assert winner.gain.mean == pytest.approx(-loser.gain.mean)
    assert winner.nis_per_dof == pytest.approx(4 * loser.nis_per_dof, rel=0.02)


def test_the_scatter_of_the_prediction_is_the_radars_noise(compared):
    # In settled straight flight a prediction is far better than a plot: 20 m and 0.05 degrees.
    # 1,000 residuals: half the middle 68 % has a relative sd of about 0.033; band 5 of them.
    for row in compared.filters:
        assert row.range_sd_m == pytest.approx(20.0, rel=0.17)
        assert row.azimuth_sd_deg == pytest.approx(0.05, rel=0.17)


def test_ground_speed_is_held_against_the_downlinked_one(compared, traffic, site):
    for row in compared.filters:
        assert row.speeds == row.scored > 900
        assert 0 < row.speed_error_median_mps < 1.5
        assert row.speed_error_median_mps < row.speed_error_95_mps < 5
    untold = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN)
    assert untold.filters[0].speeds == 0
    assert np.isnan(untold.filters[0].speed_error_median_mps)


def test_rows_follow_from_the_scores(compared):
    times = compared.tracks["time_s"]
    half = (times.min() + times.max()) / 2
    assert compared.scores["time_s"].min() >= half
    for row in compared.filters:
        mine = compared.scores.filter(pl.col("filter") == row.filter)
        straight = mine.filter("straight")
        assert 0.9 < len(straight) / len(mine) < 1
        assert row.scored == len(mine)
        assert row.loglik == pytest.approx(mine["loglik"].mean())
        assert row.nis_per_dof == pytest.approx(straight["nis"].sum() / straight["dof"].sum())
    first, *others = compared.filters
    base = compared.scores.filter(pl.col("filter") == first.filter)
    for row in others:
        mine = compared.scores.filter(pl.col("filter") == row.filter)
        pairs = mine.join(base, on=["track", "time_s"])
        assert row.gain.mean == pytest.approx((pairs["loglik"] - pairs["loglik_right"]).mean())
        assert row.gain.plots == len(pairs)


def test_a_plot_is_scored_when_its_track_has_settled(compared):
    late = compared.tracks.filter(pl.col("address") == "F00014")
    mine = compared.scores.filter(pl.col("track") == late["track"][0])
    assert mine["time_s"].min() == late["time_s"][8]
    assert set(mine["filter"]) == {"ekf", "iekf", "mekf"}


def test_what_only_one_filter_was_scored_on_is_in_no_difference(traffic, site):
    case = prepare(traffic, site, None)
    main, other = (flown(case, site, name, KNOWN) for name in ("main", "other"))
    turned_away = np.arange(len(case.flights.time)) % 10 == 0
    main.result.values["dof"][turned_away] = 0
    main.result.values["loglik"][turned_away] = -1e6
    (first, second), scores = side_by_side(case, [main, other], site)
    assert first.scored == second.gain.plots < second.scored
    assert second.gain.mean == 0
    assert scores["gain"].null_count() == second.scored - first.scored


def test_ground_speed_leaves_the_climb_out(traffic, site):
    told = traffic.with_columns(ground_speed_mps=pl.col("truth_speed"))
    case = prepare(told, site, None)
    level, climbing = (flown(case, site, name, KNOWN) for name in ("level", "climbing"))
    climbing.result.values["mean"][:, 5] = 1e3
    (first, second), _ = side_by_side(case, [level, climbing], site)
    assert second.speed_error_median_mps == first.speed_error_median_mps


def test_the_first_filter_is_tracked_as_if_it_were_alone(compared, traffic, site):
    alone = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN)
    assert alone.tracks.equals(compared.tracks)
    assert alone.scores is None
    assert [row.filter for row in compared.filters] == ["ekf", "iekf", "mekf"]
    assert alone.filters[0].loglik == compared.filters[0].loglik
    assert np.isnan(compared.filters[0].gain.mean)
    assert compared.filters[0].updates + 21 == compared.used


def test_noise_is_chosen_with_the_first_and_said(traffic, site):
    result = track(traffic, filter=lookup("mekf"), compare=[lookup("ekf")], site=site)
    assert "with mekf" in result.settings["noise_chosen"]


def test_a_filter_that_cannot_take_the_plots_is_refused_or_left_out(traffic, site):
    ask = {"filter": lookup("ekf"), "site": site, "noise": KNOWN}
    with pytest.raises(UsageError, match="linear Kalman filter cannot use range"):
        track(traffic, compare=[lookup("kf")], **ask)
    result = track(traffic, compare=[lookup("kf"), lookup("mekf")], leave_out=True, **ask)
    assert [row.filter for row in result.filters] == ["ekf", "mekf"]
    assert any("kf is not compared: the linear Kalman" in said for said in result.remarks)
    with pytest.raises(UsageError, match="linear Kalman"):
        track(traffic, leave_out=True, **(ask | {"filter": lookup("kf")}))


def test_a_filter_that_fails_loses_no_result_of_the_others(traffic, site):
    ask = {"filter": lookup("ekf"), "site": site, "noise": KNOWN}
    well = track(traffic, compare=[lookup("mekf")], **ask)
    result = track(traffic, compare=[Broken(), lookup("mekf")], **ask)
    first, broken, last = result.filters
    assert result.tracks.equals(well.tracks)
    assert last.gain == well.filters[1].gain
    assert broken.failed_share > 0.3
    assert "not finite" in broken.remark
    assert broken.scored == broken.gain.plots == 0
    assert first.failed_share == 0


def test_without_heights_the_noise_is_found_too(traffic, site):
    plots = traffic.drop("pressure_altitude_m")
    result = track(plots, filter=lookup("ekf"), compare=[lookup("mekf")], site=site)
    assert result.settings["noise"]["range_m"] == pytest.approx(20.0, rel=0.15)
    assert all(row.scored > 900 for row in result.filters)


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) for n in RECORDINGS])
def test_every_filter_runs_on_the_real_recordings(name):
    if not (DATA / name).exists():
        pytest.skip(f"the recording {name} is not beside this checkout")
    plots = read_recording(DATA / name).plots
    others = [lookup(each) for each in catalogue.names() if each != "mekf"]
    result = track(
        plots, filter=lookup("mekf"), compare=others, leave_out=True, site=RECORDINGS[name]
    )
    left_out = set(catalogue.names()) - {row.filter for row in result.filters}
    said = " ".join(result.remarks)
    assert all(f"{each} is not compared" in said for each in left_out)
    main = result.filters[0]
    for row in result.filters:
        assert row.failed_share < 1e-3
        assert row.scored > 0.9 * main.scored
        assert np.isfinite(row.loglik)
