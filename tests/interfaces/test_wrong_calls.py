"""Calls that are wrong in one way each: one clear error, made where the mistake was."""

import numpy as np
import pytest

import boresight as bs

LOOSE, PLANAR = (bs.ConstantVelocity(accel_mps2=0.5, dims=d) for d in (3, 2))
SITE = bs.Site(latitude_deg=41.0, longitude_deg=2.0, height_m=100.0)
MIRRORED = np.diag([1.0, 1.0, -1.0])

MODELS = {
    "axes too long": (lambda: bs.Pose(rotation=2.0 * np.eye(3)), "right angles"),
    "no axes": (lambda: bs.Pose(rotation=np.zeros((3, 3))), "right angles"),
    "left-handed": (lambda: bs.Pose(rotation=MIRRORED), "right-handed"),
    "planar axes": (lambda: bs.Pose(rotation=np.eye(2)), "rotation of a pose"),
    "axes not finite": (lambda: bs.Pose(rotation=np.full((3, 3), np.nan)), "rotation of a pose"),
    "planar place": (lambda: bs.Pose(position_m=[1.0, 2.0]), "position_m of a pose"),
    "endless place": (lambda: bs.Pose(position_m=[np.inf, 0, 0]), "three finite numbers"),
    "place in words": (lambda: bs.Pose(position_m="here"), "is not a number"),
    "sigma in words": (lambda: bs.Radar(range_m="thirty"), "range_m='thirty' is not a number"),
    "sigma without end": (lambda: bs.Radar(range_m=np.inf), "positive, finite"),
    "angle of turns": (lambda: bs.Radar(azimuth_deg=4000.0), "at most 180"),
    "nothing measured": (bs.Radar, "measures nothing"),
    "pose of another kind": (lambda: bs.Radar(range_m=1.0, pose=np.eye(3)), "is not a Pose"),
    "site of another kind": (lambda: bs.Radar(range_m=1.0, site=(1, 2, 3)), "pass site=bs.Site("),
    "noise without end": (lambda: bs.ConstantVelocity(accel_mps2=np.inf), "finite"),
    "noise in words": (lambda: bs.ConstantVelocity(accel_mps2="x"), "is not a number"),
    "dims no integer": (lambda: bs.ConstantVelocity(accel_mps2=1.0, dims=2.0), "neither 2 nor 3"),
    "offset in the plane": (
        lambda: bs.WithHeightOffset(inner=PLANAR, drift_m_per_sqrt_s=1.0),
        "no height to be offset",
    ),
    "coordinate not given": (lambda: bs.PositionSensor(x_m=None, y_m=1.0), "x_m=None"),
    "a matrix of two minds": (
        lambda: bs.CartesianPlots(cov=np.triu(np.ones((3, 3))) + np.eye(3)),
        "symmetric and positive definite",
    ),
    "a covariance below zero": (lambda: bs.CartesianPlots(cov=-np.eye(2)), "positive definite"),
    "elevation in the plane": (
        lambda: bs.Radar(range_m=1, elevation_deg=1).components(PLANAR),
        "elevation_rad cannot see a motion in 2 dimensions",
    ),
    "height in the plane": (
        lambda: bs.Radar(range_m=1, height_m=1, site=SITE).components(PLANAR),
        "height_m cannot see a motion in 2 dimensions",
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_a_model_that_cannot_be_is_refused_when_it_is_made(name):
    call, said = MODELS[name]
    with pytest.raises(bs.UsageError, match=r"\n  (why|next): |neither 2 nor 3") as caught:
        call()
    assert said in str(caught.value)


def test_a_pose_takes_lists_of_whole_numbers():
    z = np.array([[[1000.0, 0.3, 0.2], [1010.0, 0.3, 0.2]]])
    means = []
    for pose in (
        bs.Pose(position_m=[1, 2, 3], rotation=[[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        bs.Pose(
            position_m=np.array([1.0, 2, 3]),
            rotation=np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        ),
    ):
        radar = bs.Radar(range_m=10, azimuth_deg=1, elevation_deg=1, pose=pose)
        means.append(bs.run("ducm", LOOSE, radar, z, dt=1.0).mean)
    np.testing.assert_array_equal(*means)


RADAR = bs.Radar(range_m=30, azimuth_deg=1.0, elevation_deg=1.0)
PLOTS = np.tile([5000.0, 0.5, 0.1], (4, 6, 1))
ENDLESS = np.where(np.arange(72).reshape(4, 6, 3) == 40, np.inf, PLOTS)  # run 2, scan 1, azimuth
WRONG_RUNS = {
    "one plot only": ({"plots": PLOTS[0, 0]}, r"shape \(3,\)"),
    "too few components": ({"plots": PLOTS[..., :2]}, "the sensor measures range_m"),
    "no scans": ({"plots": PLOTS[:, :0]}, r"\(runs, scans, 3\) is needed"),
    "words": ({"plots": "plots"}, "is not a number"),
    "infinity": ({"plots": ENDLESS}, r"azimuth_rad is inf\n  at:   run 2, scan 1"),
    "dt backwards": ({"dt": -4.0}, "time runs forward"),
    "dt unknown": ({"dt": np.full((4, 6), np.nan)}, "time runs forward"),
    "dt without end": ({"dt": np.inf}, "time runs forward"),
    "dt of other scans": ({"dt": np.ones((1, 5))}, r"give a number, \(1, 6\)"),
    "dt with one axis": ({"dt": np.ones(6)}, r"give a number, \(1, 6\)"),
    "start of other states": ({"start": bs.Gaussian(np.zeros(4), np.eye(4))}, "vz_mps"),
    "start no Gaussian": ({"start": np.zeros(6)}, "Gaussian\\(mean, cov\\) of 6"),
    "two of one scan": ({"plots": PLOTS[:, :1], "start": "two plots"}, "of 1 scans"),
    "two at once": ({"dt": 0.0, "start": "two plots"}, "one instant"),
    "no spread": ({"speed_mps": 0.0}, "speed_mps=0.0 is not positive"),
    "motion": ({"motion": None}, "the motion is a NoneType"),
    "sensor": ({"sensor": LOOSE}, "the sensor is a ConstantVelocity"),
    "name": ({"name": None}, "there is no filter None"),
    "name in capitals": ({"name": "EKF"}, "did you mean 'ekf'"),
    "noise of other runs": (
        {"sensor": bs.Radar(range_m=[1.0, 2.0], azimuth_deg=1.0, elevation_deg=1.0)},
        "of 4 runs",
    ),
}


@pytest.mark.parametrize("name", WRONG_RUNS)
def test_a_wrong_run_is_refused_before_it_starts(name):
    changes, said = WRONG_RUNS[name]
    call = {"name": "ekf", "motion": LOOSE, "sensor": RADAR, "plots": PLOTS, "dt": 4.0} | changes
    with pytest.raises(bs.UsageError, match=said):
        bs.run(**call)


def test_a_smoother_wants_time_forward_and_an_estimate():
    estimate = bs.run("ekf", LOOSE, RADAR, PLOTS, dt=4.0)
    with pytest.raises(bs.UsageError, match="time runs forward"):
        bs.smooth(estimate, LOOSE, -4.0)
    with pytest.raises(bs.UsageError, match="cannot be smoothed"):
        bs.smooth(None, LOOSE)


WRONG_SETTINGS = [
    ("mekf", {"mu": 3}),
    ("mekf", {"order": "elevation_rad"}),
    ("iekf", {"iterations": "a"}),
    ("iekf", {"iterations": 2.5}),
    ("iplf", {"iterations": 3.5}),
    ("ukf", {"alpha": "x"}),
    ("ukf", {"beta": np.nan}),
    ("ducm", {"conversion": 3}),
    ("ducm", {"scale_output": "no"}),
    ("line-of-sight", {"components": True}),
]


@pytest.mark.parametrize(("name", "setting"), WRONG_SETTINGS)
def test_a_setting_of_another_kind_is_refused_with_its_default(name, setting):
    (key,) = setting
    with pytest.raises(bs.UsageError, match=f"is no setting of {name}\n  next: .*{key}="):
        bs.stream(name, LOOSE, RADAR, **setting)


@pytest.mark.parametrize("targets", [0, -1, "two", 1.5])
def test_a_stream_holds_a_whole_number_of_targets(targets):
    with pytest.raises(bs.UsageError, match="no number of targets"):
        bs.stream("ekf", LOOSE, RADAR, targets=targets)


@pytest.mark.parametrize("name", ["ekf", "line-of-sight"])
def test_a_live_filter_refuses_what_is_no_plot_no_time_and_no_state(name):
    step = bs.stream(name, LOOSE, RADAR)
    state = step.start(PLOTS[0, 0])
    for plot in (PLOTS[0, 0, :2], PLOTS[0], "plot", None):
        with pytest.raises(bs.UsageError, match=r"a plot|is not a number"):
            step.start(plot)
    for dt in (np.inf, np.nan, -1.0, "soon", None, np.ones(2)):
        with pytest.raises(bs.UsageError, match="does not go backwards"):
            step(state, PLOTS[0, 1], dt)
    with pytest.raises(bs.UsageError, match="other sizes, or none"):
        step(None, PLOTS[0, 1], 1.0)


@pytest.mark.parametrize("name", ["ekf", "line-of-sight"])
@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_live_start_from_half_a_plot_says_that_it_is_none(name, wrong):
    step = bs.stream(name, LOOSE, RADAR, targets=2)
    state = step.start(np.array([[5000.0, 0.5, 0.1], [5000.0, wrong, 0.1]]))
    assert state.status.tolist() == [bs.Status.OK, bs.Status.NOT_STARTED]
    assert np.isfinite(state.mean[0]).all()


DOPPLER = {"transmitted_hz": 1e4, "speed_mps": 10.0, "sigma_hz": 1.0, "sigma_deg": 2.5}
WRONG_DOPPLER = [
    {"sigma_hz": 0.0},
    {"sigma_deg": -2.0},
    {"sigma_deg": 5000.0},
    {"transmitted_hz": -5.0},
    {"propagation_mps": 0.0},
    {"drift_mps": -1.0},
    {"speed_mps": None},
]


@pytest.mark.parametrize("wrong", WRONG_DOPPLER)
def test_a_number_that_no_doppler_has_is_named(wrong):
    heard, bearings = np.full((2, 5), 10050.0), np.full((2, 5), 0.3)
    with pytest.raises(bs.UsageError, match=f"{next(iter(wrong))}="):
        bs.track_range_rate(heard, bearings, **DOPPLER | wrong)


WRONG_CONVERSIONS = {
    "many turns": ({"sigma": [30.0, 30.0, 0.1]}, "in an angle at most pi"),
    "words": ({"z": "plot"}, "z='plot' is not a number"),
    "name": ({"name": None}, "there is no conversion None"),
    "point": ({"prediction": np.zeros(3)}, "a prediction that is a ndarray"),
    "negative": ({"prediction": bs.Gaussian(np.ones(3), -np.eye(3))}, "negative variance"),
    "negative place": ({"prediction": bs.Given(PLOTS[0, 0], -np.ones(3))}, "negative variance"),
}


@pytest.mark.parametrize("name", WRONG_CONVERSIONS)
def test_a_conversion_that_cannot_be_is_refused(name):
    changes, said = WRONG_CONVERSIONS[name]
    call = {"name": "ducm", "z": PLOTS[0, 0], "sigma": [30.0, 0.1, 0.1]} | changes
    with pytest.raises(bs.UsageError, match=said):
        bs.convert(**call)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [({"runs": 0}, "runs=0"), ({"assume": {"dt_s": "x"}}, "as it is: --assume dt_s=1.0")],
)
def test_a_paper_is_not_repeated_by_halves(wrong, said):
    with pytest.raises(bs.UsageError, match=said):
        bs.reproduce("bordonaro", **wrong)


@pytest.mark.parametrize("wrong", [{"seed": 1.5}, {"runs": "many"}, {"first": None}])
def test_seeds_and_runs_are_whole_numbers(wrong):
    with pytest.raises(bs.UsageError, match="is not a whole number"):
        bs.simulate("bordonaro-static", **{"runs": 1, "seed": 1} | wrong)
