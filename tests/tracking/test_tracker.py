"""Tracking plots of known truth. Statistical tests use fixed seeds; each states its band."""

import numpy as np
import polars as pl
import pytest

from boresight.catalogue import lookup
from boresight.errors import DataError, UsageError
from boresight.tracking.noise import Noise
from boresight.tracking.tracker import track

KNOWN = Noise(range_m=20.0, azimuth_deg=0.05, altitude_m=2.2, accel_mps2=0.002)


@pytest.fixture
def traffic(sky):
    return pl.concat([sky.aircraft(n) for n in range(20)])


def joined(result, plots):
    """Tracks beside the truth of the plot each row belongs to."""
    return result.tracks.join(plots, on=["address", "time_s"], suffix="_true")


@pytest.mark.parametrize("name", ["ekf", "mekf", "ekf-sequential"])
def test_tracks_lie_closer_to_the_truth_than_the_plots(traffic, site, name):
    result = track(traffic, filter=lookup(name), site=site, noise=KNOWN)
    assert (result.used, result.rejected, result.plots) == (2000, 0, 2000)
    late = joined(result, traffic).filter(pl.int_range(pl.len()).over("track") >= 20)
    error = np.hypot(late["east_m"] - late["east_m_true"], late["north_m"] - late["north_m_true"])
    across = late["range_m"] * np.radians(0.05)
    raw = np.sqrt(across.pow(2).mean() + 20.0**2)
    assert float(np.sqrt((error**2).mean())) < 0.5 * raw
    speed = np.hypot(late["east_mps"], late["north_mps"]) - late["truth_speed"]
    assert abs(float(speed.mean())) < 0.3
    assert float(speed.abs().quantile(0.95)) < 3.0


def test_nis_is_chi_square_when_the_noise_is_known(traffic, site):
    # Altitudes are constant here, so they add degrees of freedom without scatter: judge the two
    # noisy ones. 3,600 values: mean 1, sd sqrt(2 / 3600) = 0.024; band 4 sd, 6e-5 false alarms.
    result = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN)
    late = result.residuals.filter(pl.int_range(pl.len()).over("track") >= 10)
    squares = [
        ((late[f"{name}_residual_{unit}"] / late[f"{name}_sd_{unit}"]) ** 2).mean()
        for name, unit in (("range", "m"), ("azimuth", "deg"))
    ]
    assert abs(np.mean(squares) - 1.0) < 0.1


def test_noise_is_measured_and_straight_flight_asks_for_little_process_noise(traffic, site):
    result = track(traffic, filter=lookup("ekf"), site=site)
    noise = result.settings["noise"]
    assert noise["range_m"] == pytest.approx(20.0, rel=0.15)
    assert noise["azimuth_deg"] == pytest.approx(0.05, rel=0.15)
    assert noise["accel_mps2"] <= 0.1
    assert "first half" in result.settings["noise_chosen"]


def test_one_wild_plot_is_rejected_and_the_track_goes_on(traffic, site):
    wild = pl.when(pl.int_range(pl.len()) == 50).then(pl.col("range_m") + 3_000.0)
    plots = traffic.with_columns(range_m=wild.otherwise("range_m"))
    result = track(plots, filter=lookup("ekf"), site=site, noise=KNOWN)
    clean = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN)
    assert result.rejected == 1
    assert result.targets["restarts"].sum() == 0
    assert dict(result.skipped.select("reason", "count").iter_rows()) == {"rejected": 1}
    last = [r.tracks.filter(pl.col("address") == "F00000")[-1] for r in (result, clean)]
    assert abs(last[0]["east_m"][0] - last[1]["east_m"][0]) < 10.0


def test_a_track_that_keeps_rejecting_starts_anew_and_says_so(traffic, site):
    moved = pl.int_range(pl.len()).is_between(50, 99)
    plots = traffic.with_columns(
        range_m=pl.when(moved).then(pl.col("range_m") + 3_000.0).otherwise("range_m")
    )
    result = track(plots, filter=lookup("ekf"), site=site, noise=KNOWN)
    jumped = result.targets.filter(pl.col("address") == "F00000")
    assert jumped["restarts"].item() == 1
    assert result.rejected == 0
    status = result.tracks.filter(pl.col("address") == "F00000")["status"]
    assert status[50] == "restarted"
    assert status[0] == "started"
    assert any("started anew" in remark for remark in result.remarks)


def test_a_fixed_target_shows_the_bare_noise_of_the_radar(sky, site):
    generator = np.random.default_rng(5)
    still = sky.aircraft(1, plots=400).with_columns(
        range_m=30_000.0 + pl.Series(2.0 * generator.standard_normal(400)),
        azimuth_deg=100.0 + pl.Series(0.01 * generator.standard_normal(400)),
    )
    result = track(still, filter=lookup("ekf"), site=site, noise=KNOWN)
    target = result.targets.row(0, named=True)
    assert target["fixed"]
    assert target["range_sd_m"] == pytest.approx(still["range_m"].std(), rel=1e-9)
    assert target["azimuth_sd_deg"] == pytest.approx(still["azimuth_deg"].std(), rel=1e-6)


def test_without_heights_targets_are_tracked_in_the_plane_and_it_is_said(traffic, site):
    plots = traffic.drop("pressure_altitude_m")
    result = track(plots, filter=lookup("ekf"), site=site, noise=KNOWN)
    assert result.settings["dimensions"] == 2
    assert result.tracks["height_m"].is_nan().all()
    assert any("in the plane" in remark for remark in result.remarks)


def test_an_altitude_out_of_this_world_is_not_believed(traffic, site):
    wild = pl.when(pl.int_range(pl.len()) == 40).then(124_830.0)
    plots = traffic.with_columns(pressure_altitude_m=wild.otherwise("pressure_altitude_m"))
    result = track(plots, filter=lookup("ekf"), site=site, noise=KNOWN)
    assert result.rejected == 0
    assert result.tracks.filter(pl.col("address") == "F00000")["dof"][40] == 2


def test_without_a_site_there_is_no_latitude_and_it_is_said(traffic):
    result = track(traffic, filter=lookup("ekf"), noise=KNOWN)
    assert result.tracks["latitude_deg"].is_nan().all()
    assert any("--site" in remark for remark in result.remarks)


def test_a_covariance_in_the_table_is_the_filters_own(traffic, site):
    result = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN)
    late = joined(result, traffic).filter(pl.int_range(pl.len()).over("track") >= 20)
    d = np.stack([late["east_m"] - late["east_m_true"], late["north_m"] - late["north_m_true"]])
    c = late.select("cov_0_0", "cov_0_1", "cov_1_1").to_numpy()
    determinant = c[:, 0] * c[:, 2] - c[:, 1] ** 2
    nees = (c[:, 2] * d[0] ** 2 - 2 * c[:, 1] * d[0] * d[1] + c[:, 0] * d[1] ** 2) / determinant
    # 1,600 correlated values from 20 tracks, some 15 independent ones each: sd about 0.06 of 1.
    assert 0.75 < nees.mean() / 2 < 1.25


def test_targets_come_worst_first(traffic, site):
    nis = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN).targets["nis_per_dof"]
    assert nis.is_sorted(descending=True)


def test_the_busiest_sensor_is_tracked_unless_one_is_named(traffic, sky, site):
    other = sky.aircraft(1, plots=30).with_columns(sensor=pl.lit("3/4"))
    both = pl.concat([traffic, other])
    result = track(both, filter=lookup("ekf"), site=site, noise=KNOWN)
    assert result.plots == 2000
    assert any("2 sensors" in remark for remark in result.remarks)
    assert track(both, filter=lookup("ekf"), site=site, sensor="3/4", noise=KNOWN).plots == 30
    with pytest.raises(UsageError, match="5/6"):
        track(both, filter=lookup("ekf"), site=site, sensor="5/6")


def test_nothing_to_track_is_an_error_with_a_next_step(traffic, site):
    nameless = traffic.with_columns(address=pl.lit(None, dtype=pl.String))
    with pytest.raises(DataError, match="boresight inspect"):
        track(nameless, filter=lookup("ekf"), site=site)


def test_inputs_are_left_alone(traffic, site):
    before = traffic.clone()
    track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN)
    assert traffic.equals(before)
