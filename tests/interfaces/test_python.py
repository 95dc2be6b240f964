"""What a user types in Python."""

import numpy as np
import pytest

import boresight as bs
from boresight.errors import UsageError

RADAR = bs.Radar(range_m=30, azimuth_deg=0.5, elevation_deg=0.5)
MOTION = bs.ConstantVelocity(accel_mps2=0.5)


@pytest.fixture(scope="module")
def straight():
    """Noise-free plots of a target in straight flight, and its states (runs, scans, 6)."""
    time = np.arange(40.0)[:, None]
    velocity = np.array([[100.0, -50.0, 5.0], [-80.0, 120.0, 0.0]])[:, None]
    p = np.array([[20e3, 10e3, 5e3], [30e3, -9e3, 8e3]])[:, None] + velocity * time
    ground = np.hypot(p[..., 0], p[..., 1])
    z = np.stack(
        [
            np.linalg.norm(p, axis=-1),
            np.arctan2(p[..., 1], p[..., 0]),
            np.arctan2(p[..., 2], ground),
        ],
        axis=-1,
    )
    return z, np.concatenate([p, np.broadcast_to(velocity, p.shape)], axis=-1)


@pytest.mark.parametrize(("start", "used"), [("one plot", 1), ("two plots", 2)])
def test_a_start_from_plots_finds_a_noise_free_target(straight, start, used):
    z, states = straight
    estimate = bs.run("ekf", MOTION, RADAR, z, dt=1.0, start=start)
    assert np.abs(estimate.mean[:, used - 1, :3] - states[:, used - 1, :3]).max() < 1e-6
    assert np.abs(estimate.mean[:, -1] - states[:, -1]).max() < 1.0


def test_two_plots_give_the_velocity_and_one_does_not(straight):
    z, states = straight
    two = bs.run("ekf", MOTION, RADAR, z, dt=1.0, start="two plots").mean[:, 1, 3:]
    one = bs.run("ekf", MOTION, RADAR, z, dt=1.0, start="one plot").mean[:, 0, 3:]
    assert np.abs(two - states[:, 1, 3:]).max() < 1e-6
    assert np.all(one == 0.0)


def test_a_given_start_is_used_as_it_is(straight):
    z, states = straight
    given = bs.Gaussian(states[:, 0], np.eye(6) * 1e-6)
    dt = np.ones((1, 40))
    dt[0, 0] = 0.0
    estimate = bs.run("ekf", MOTION, RADAR, z, dt=dt, start=given, outputs=("mean", "nis"))
    assert np.abs(estimate.mean - states).max() < 1e-3
    assert estimate.nis.max() < 1e-9


def test_outputs_that_were_not_asked_for_are_not_there(straight):
    estimate = bs.run("ekf", MOTION, RADAR, straight[0], dt=1.0, outputs=("nis",))
    assert estimate.nis.shape == (2, 40)
    with pytest.raises(AttributeError, match="mean"):
        _ = estimate.mean


def test_last_is_the_last_of_each(straight):
    each = bs.run("mekf", MOTION, RADAR, straight[0], dt=1.0)
    last = bs.run("mekf", MOTION, RADAR, straight[0], dt=1.0, last=True)
    assert np.array_equal(each.mean[:, -1], last.mean)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ({"name": "mkf"}, "mekf"),
        ({"name": "mekf", "moo": 1}, "mu"),
        ({"name": "ekf", "start": "three plots"}, "two plots"),
        ({"name": "ekf", "dt": None}, "dt="),
        ({"name": "ekf", "outputs": ("median",)}, "mean"),
    ],
)
def test_a_mistake_is_a_usage_error_with_its_cure(straight, call, said):
    settings = {"dt": 1.0} | call
    name = settings.pop("name")
    with pytest.raises(UsageError, match=said):
        bs.run(name, MOTION, RADAR, straight[0], **settings)


def test_a_live_filter_says_what_is_wrong_with_a_plot(straight):
    step = bs.stream("ekf", MOTION, RADAR)
    state = step.start(straight[0][0, 0])
    with pytest.raises(UsageError, match="backwards"):
        step(state, straight[0][0, 1], dt=-1.0)
    with pytest.raises(UsageError, match="range_m"):
        step(state, np.zeros(2), dt=1.0)
    moved = step(state, straight[0][0, 1], dt=1.0)
    assert moved.status == bs.Status.OK
    assert moved.dof == 3.0
