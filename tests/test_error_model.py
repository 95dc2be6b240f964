"""The error model at the door: what it takes, gives and refuses."""

import re
from dataclasses import replace

import numpy as np
import pytest

import boresight as bs
from boresight import catalogue
from boresight.errors import UsageError
from boresight.filters.error_model import MODELS, correct

RADAR = bs.Radar(range_m=30, azimuth_deg=1.5, elevation_deg=1.5)
PLANE = bs.Radar(range_m=30, azimuth_deg=1.5)
MOTION = bs.ConstantVelocity(accel_mps2=0.5, dims=3)
BIAS = np.array([60.0, np.radians(2.0), np.radians(-1.5)])


@pytest.fixture(scope="module")
def simulated():
    truth, plots = bs.simulate("kashyap-set-2", RADAR, runs=20, seed=3)
    return truth, plots._replace(z=plots.z + BIAS)


def test_what_it_gives_goes_straight_to_a_filter(simulated):
    truth, plots = simulated
    found = bs.error_model(plots, truth, RADAR)
    assert found.plots.dt is plots.dt
    assert found.sensor == RADAR
    raw = bs.run("mekf", MOTION, RADAR, plots)
    estimate = bs.run("mekf", MOTION, found.sensor, found.plots)
    assert bs.rmse(estimate, truth) < 0.5 * bs.rmse(raw, truth)


def test_cartesian_plots_go_to_the_linear_filter(simulated):
    truth, plots = simulated
    found = bs.error_model(plots, truth, RADAR, model="kashyap", frame="cartesian", noise="full")
    assert isinstance(found.sensor, bs.CartesianPlots)
    estimate = bs.run("kf", MOTION, found.sensor, found.plots)
    assert bs.rmse(estimate, truth) < bs.rmse(bs.run("cmkf", MOTION, RADAR, plots), truth)


def test_the_error_is_reference_minus_plot(simulated):
    """Erratum K6: what is added is minus the bias."""
    truth, plots = simulated
    found = bs.error_model(plots, truth, RADAR)
    np.testing.assert_allclose(found.error[:, -1].mean(0), -BIAS, rtol=0.1)
    assert (found.probability[:, -1] > 0.99).all()
    left = (found.error[:, -1] + BIAS) / np.sqrt(np.diagonal(found.error_cov[:, -1], 0, -2, -1))
    assert np.abs(left).max() < 5.0


def test_arrays_and_seconds_do_as_well_as_what_simulate_gives(simulated):
    truth, plots = simulated
    whole = bs.error_model(plots, truth, RADAR)
    bare = bs.error_model(plots.z, truth.states[..., :3], RADAR, dt=plots.dt)
    np.testing.assert_array_equal(bare.plots, whole.plots.z)


def test_one_reference_serves_many_runs(simulated):
    truth, plots = simulated
    one = truth.states[:1, :, :3]
    found = bs.error_model(plots, one, RADAR)
    again = bs.error_model(plots, np.repeat(one, 20, axis=0), RADAR)
    np.testing.assert_array_equal(found.error, again.error)


def test_in_the_plane_there_are_two_channels():
    truth, plots = bs.simulate("kashyap-set-4", PLANE, runs=5, seed=3)
    found = bs.error_model(plots, truth, PLANE, model="kashyap")
    assert found.error.shape == (5, 500, 2)
    assert found.sensor.range_m.shape == (5, 500)


def test_what_is_no_channel_passes_as_it_is(simulated):
    truth, plots = simulated
    radar = replace(RADAR, range_rate_mps=1.0)
    z = np.concatenate([plots.z, np.full((20, 500, 1), 7.0)], axis=-1)
    found = bs.error_model(z, truth, radar, dt=plots.dt)
    assert (found.plots[..., 3] == 7.0).all()
    np.testing.assert_array_equal(found.plots[..., :3], bs.error_model(plots, truth, RADAR).plots.z)


def test_an_azimuth_beside_a_reference_in_space(simulated):
    """A radar without elevation: the reference's slant range and azimuth are known."""
    truth, plots = simulated
    found = bs.error_model(plots.z[..., :2], truth, PLANE, dt=plots.dt)
    whole = bs.error_model(plots, truth, RADAR)
    np.testing.assert_allclose(found.error, whole.error[..., :2], rtol=1e-9, atol=1e-12)


def test_the_air_is_taken_out_once():
    site = bs.Site(latitude_deg=51.0, longitude_deg=1.0, height_m=40.0)
    radar = replace(RADAR, site=site, atmosphere=bs.ExponentialAtmosphere())
    z = np.array([[[200e3, 1.0, 0.03]] * 3])
    clear = radar.without_air(z)
    assert z[0, 0, 0] - clear[0, 0, 0] > 10.0
    found = bs.error_model(z, np.full((1, 3, 3), np.nan), radar, dt=1.0)
    np.testing.assert_allclose(found.plots, clear, rtol=1e-12)
    assert found.sensor.atmosphere is None


def test_an_outage_holds_the_bias_while_its_variance_grows(simulated):
    truth, plots = simulated
    known = truth.states[..., :3].copy()
    known[:, 300:400] = np.nan
    found = bs.error_model(plots, known, RADAR)
    held, variance = found.error[:, 300:400], found.error_cov[:, 300:400, 0, 0]
    assert (held == held[:, :1]).all()
    np.testing.assert_allclose(variance[:, -1] - variance[:, 0], 0.05**2 * 99, rtol=1e-6)
    away = np.abs(bs.error_model(plots, known, RADAR, model="kashyap").error[:, 300:400, 1])
    assert away[:, -1].mean() > 50 * away[:, 0].mean()
    none = bs.error_model(plots, known, RADAR, outage="zero")
    np.testing.assert_array_equal(none.plots.z[:, 300:400, 0], plots.z[:, 300:400, 0])


def test_without_any_reference_plots_are_as_they_were(simulated):
    _, plots = simulated
    found = bs.error_model(plots, np.full((1, 500, 3), np.nan), RADAR)
    np.testing.assert_allclose(found.plots.z[..., 0], plots.z[..., 0], rtol=0)
    assert not found.error.any()
    np.testing.assert_allclose(found.probability, 1 / 101, rtol=1e-9)


def test_a_plot_that_has_no_place_has_no_noise(simulated):
    truth, plots = simulated
    z = plots.z.copy()
    z[:, 10, 1] = np.nan
    found = bs.error_model(z, truth, RADAR, dt=plots.dt, frame="cartesian", model="kashyap")
    assert np.isnan(found.plots[:, 10]).all()
    assert np.isnan(found.noise_cov[:, 10]).all()
    assert np.isfinite(found.error).all()


def test_noises_may_differ_from_run_to_run(simulated):
    truth, plots = simulated
    many = replace(RADAR, range_m=np.where(np.arange(20) < 10, 30.0, 90.0))
    found = bs.error_model(plots, truth, many)
    few = bs.error_model(plots.z[:10], truth.states[:10, :, :3], RADAR, dt=plots.dt)
    np.testing.assert_allclose(found.error[:10], few.error, rtol=1e-9)
    assert (found.error_cov[10:, -1, 0, 0] > found.error_cov[:10, -1, 0, 0].max()).all()


@pytest.mark.parametrize("name", ["error-model", "emekf", "ecmkf"])
def test_it_is_cited_as_filters_are(name):
    found = catalogue.cite(name)
    assert found["key"] == "kashyap"
    assert "reference minus plot" in found["differs"]


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"model": "kashap"}, "did you mean 'kashyap'"),
        ({"model": 3}, "the model is a int"),
        ({"colour": 1}, "no setting 'colour'"),
        ({"frame": "oblique"}, "frame='oblique' is unknown"),
        ({"drift_m": -1}, "drift_m=-1"),
        ({"drift_m": None}, "drift_m=None is not a number"),
        ({"odds": np.inf}, "odds=inf cannot be"),
        ({"alarm": 0}, "alarm=0.0 would be raised"),
        ({"floor": 2}, "floor=2"),
        ({"window": 1}, "at least 2"),
        ({"window": 201}, "at most 200"),
        ({"window": 10.0}, "window=10.0 is no whole number"),
        ({"window": True}, "window=True is no whole number"),
        ({"window": 5, "warm_up": 6}, "holds no more"),
        ({"warm_up": 6}, "window=None"),
        ({"noise": "full"}, 'or frame="cartesian"'),
    ],
)
def test_settings_that_cannot_be_are_refused(settings, sentence, simulated):
    truth, plots = simulated
    with pytest.raises(UsageError, match=sentence):
        bs.error_model(plots, truth, RADAR, **settings)


def test_a_wrong_call_is_named(simulated):
    truth, plots = simulated
    place = truth.states[..., :3]
    for reference, radar, sentence in (
        (place[:, :9], RADAR, r"the reference has shape \(20, 9, 3\)"),
        (place[..., :1], RADAR, "a position, 2 or 3 numbers"),
        (np.full((1, 500, 3), np.inf), RADAR, "infinite position"),
        (place[..., :2], RADAR, r"give positions \(x, y, z\)"),
        ("gps.csv", RADAR, "reference='gps.csv' is not a number"),
        (place, MOTION, "the radar is a ConstantVelocity"),
        (place, bs.Radar(range_rate_mps=1.0), "plots have shape"),
    ):
        with pytest.raises(UsageError, match=sentence):
            bs.error_model(plots, reference, radar)
    with pytest.raises(UsageError, match="no cartesian plots in 3 dimensions"):
        bs.error_model(plots.z[..., :2], place, PLANE, dt=1.0, frame="cartesian")
    with pytest.raises(UsageError, match="no polar plots"):
        bs.error_model(plots.z[..., :1], place, bs.Radar(range_rate_mps=1.0), dt=1.0)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"plots": np.zeros((500, 3))}, r"plots have shape \(500, 3\)"),
        ({"plots": np.zeros((20, 0, 3))}, r"plots have shape \(20, 0, 3\)"),
        ({"plots": np.full((20, 500, 3), -np.inf)}, "range_m is -inf"),
        ({"reference": None}, "reference=None is not a number"),
        ({"reference": np.zeros((500, 3))}, r"the reference has shape \(500, 3\)"),
        ({"reference": np.zeros((7, 500, 3))}, r"the reference has shape \(7, 500, 3\)"),
        ({"dt": None}, "the plots carry no dt"),
        ({"dt": -1.0}, "dt=-1.0 s: time runs forward"),
        ({"dt": np.nan}, "dt=nan s: time runs forward"),
        ({"dt": np.ones((20, 4))}, r"dt has shape \(20, 4\)"),
        ({"drift_m": np.ones(3)}, r"'model.drift_m' has shape \(3,\)"),
    ],
)
def test_arrays_that_cannot_be_are_refused(wrong, sentence, simulated):
    truth, plots = simulated
    usual = {"plots": plots.z, "reference": truth.states[..., :3], "radar": RADAR, "dt": 1.0}
    with pytest.raises(UsageError, match=sentence):
        bs.error_model(**usual | wrong)


@pytest.mark.parametrize("frame", ["polar", "cartesian"])
def test_a_window_of_equal_differences_is_refused_and_a_floor_helps(frame):
    """A target that stands still before a radar whose numbers are rounded."""
    z, place = np.tile([5000.0, 1.0, 0.1], (2, 30, 1)), np.tile([2000.0, 3000.0, 900.0], (1, 30, 1))
    with pytest.raises(UsageError, match="differences in a window of 10 make no covariance"):
        bs.error_model(z, place, RADAR, dt=1.0, model="kashyap", frame=frame)
    found = bs.error_model(z, place, RADAR, dt=1.0, model="kashyap", frame=frame, floor=0.01)
    nominal = bs.error_model(z, place, RADAR, dt=1.0, frame=frame)
    np.testing.assert_allclose(found.noise_cov[:, -1], 0.01 * nominal.noise_cov[:, -1], rtol=1e-9)


def test_a_full_window_of_too_few_differences_is_refused(simulated):
    truth, plots = simulated
    with pytest.raises(UsageError, match="too few for channels that vary together"):
        bs.error_model(plots, truth, RADAR, frame="cartesian", noise="full", window=3)


def test_a_window_longer_than_the_run_leaves_the_noise_as_it_was(simulated):
    truth, plots = simulated
    z, place = plots.z[:, :40], truth.states[:, :40, :3]
    found = bs.error_model(z, place, RADAR, dt=1.0, window=np.int64(41))
    assert found.sensor.azimuth_deg == pytest.approx(1.5)
    shorter = bs.error_model(z, place, RADAR, dt=1.0, window=30)
    assert not np.allclose(shorter.sensor.azimuth_deg[:, -1], 1.5, rtol=0.01)


def test_plots_that_came_at_once_are_plots_of_one_error(simulated):
    """dt = 0: without time to drift, a bias is the mean of all differences."""
    truth, plots = simulated
    z, place = plots.z[:, :50], truth.states[:, :50, :3]
    plain = bs.ErrorModel(odds=None, alarm=None, spread=1e4, correction="same epoch")
    found = bs.error_model(z, place, RADAR, dt=0.0, model=plain)
    r = np.linalg.norm(place, axis=-1)
    np.testing.assert_allclose(found.error[:, -1, 0], (r - z[..., 0]).mean(1), rtol=1e-6)
    assert np.isfinite(bs.error_model(z, place, RADAR, dt=0.0, model="kashyap").error).all()


def test_one_scan_is_corrected_by_its_own_reference_only(simulated):
    truth, plots = simulated
    z, place = plots.z[:, :1], truth.states[:, :1, :3]
    np.testing.assert_array_equal(bs.error_model(z, place, RADAR, dt=1.0).error, 0.0)
    same = bs.error_model(z, place, RADAR, dt=1.0, model="kashyap")
    half = (np.linalg.norm(place, axis=-1) - z[..., 0]) / 2  # as sure as a plot, spread 1
    np.testing.assert_allclose(same.error[..., 0], half, rtol=1e-9)


@pytest.mark.parametrize(("name", "frame"), [("emekf", "polar"), ("ecmkf", "cartesian")])
def test_the_papers_filters_say_which_two_steps_they_are(name, frame, simulated):
    """What the message says, done, is the filter."""
    truth, plots = simulated
    with pytest.raises(UsageError, match=f"{name} is two steps") as refused:
        bs.run(name, MOTION, RADAR, plots)
    first, second = re.search(r"found = (.*); (bs\.run.*)", str(refused.value)).groups()
    known = {"bs": bs, "plots": plots, "reference": truth, "radar": RADAR, "motion": MOTION}
    found = eval(first, known)  # noqa: S307 - the package's own words, tried
    estimate = eval(second, known | {"found": found})  # noqa: S307 - as above
    assert frame in first
    assert bs.rmse(estimate, truth) < 0.5 * bs.rmse(bs.run("ekf", MOTION, RADAR, plots), truth)


def test_no_runs_are_no_plots():
    found = bs.error_model(np.zeros((0, 5, 3)), np.zeros((1, 5, 3)), RADAR, dt=1.0)
    assert found.plots.shape == (0, 5, 3)
    assert found.error_cov.shape == (0, 5, 3, 3)


def test_a_camera_has_angles_only(simulated):
    truth, plots = simulated
    camera = bs.Radar(azimuth_deg=1.5, elevation_deg=1.5)
    found = bs.error_model(plots.z[..., 1:], truth, camera, dt=plots.dt)
    whole = bs.error_model(plots, truth, RADAR)
    np.testing.assert_allclose(found.error, whole.error[..., 1:], rtol=1e-9, atol=1e-12)
    with pytest.raises(UsageError, match="no cartesian plots"):
        bs.error_model(plots.z[..., 1:], truth, camera, dt=plots.dt, frame="cartesian")


def test_a_range_rate_that_goes_with_the_range_stays_as_it_was(simulated):
    truth, plots = simulated
    radar = replace(RADAR, range_rate_mps=1.0, range_rate_correlation=0.5)
    z = np.concatenate([plots.z, np.full((20, 500, 1), 7.0)], axis=-1)
    found = bs.error_model(z, truth, radar, dt=plots.dt, window=10)
    assert (found.plots[..., 3] == 7.0).all()
    assert found.sensor.range_rate_correlation == 0.5
    assert found.sensor.range_m.shape == (20, 500)


def test_a_radar_that_moves_sees_the_reference_from_where_it_was(simulated):
    truth, plots = simulated
    path = np.linspace([0.0, 0.0, 0.0], [3000.0, -500.0, 20.0], 500)[None]
    moving = replace(RADAR, pose=bs.Pose(position_m=path))
    found = bs.error_model(plots.z, truth.states[..., :3] + path, moving, dt=plots.dt)
    still = bs.error_model(plots, truth, RADAR)
    np.testing.assert_allclose(found.error, still.error, rtol=1e-6, atol=1e-9)


def test_a_reference_at_the_radar_itself_gives_numbers(simulated):
    """Its direction means nothing, and must not make a mess."""
    _, plots = simulated
    for model in MODELS:
        found = bs.error_model(plots, np.zeros((1, 500, 3)), RADAR, model=model, reference_m=5.0)
        assert np.isfinite(found.error).all()
        assert np.isfinite(found.error_cov).all()


def test_every_named_model_runs(simulated):
    truth, plots = simulated
    for name, model in MODELS.items():
        found = correct(plots.z, truth.states[..., :3], plots.dt, RADAR, model=name)
        same = correct(plots.z, truth.states[..., :3], plots.dt, RADAR, model=model)
        np.testing.assert_array_equal(found.z, same.z)
        assert np.isfinite(found.z).all()
