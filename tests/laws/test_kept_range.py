"""The filter that keeps range and angles: its branches, its exact update, what it tells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.filters import spherical
from boresight.filters.start import from_polar, one_plot
from boresight.maths import Gaussian, wrap
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar
from laws.enrolled import ALL, MOVING, PLANAR, PLANE, POLAR, POLAR_WORLDS, SPACE, Entry, World
from oracles import filters as textbook

seeds = st.integers(0, 2**32)
KEEPS = spherical.SphericalCubature()


@pytest.mark.parametrize("world", [World(SPACE, POLAR), World(PLANE, PLANAR)], ids=str)
@given(seed=seeds)
def test_a_start_from_one_plot_is_kept_as_that_plot(world, seed):
    mean, _ = world.prior(seed)
    z = world.plot(mean, seed)
    start = one_plot(z[None], world.motion, world.sensor)
    kept = KEEPS.begin(Gaussian(start.mean[0], start.cov[0]), world.motion, world.sensor)
    d = world.motion.dims
    z[1] = wrap(z[1])
    np.testing.assert_allclose(kept["mean"][:d], z, rtol=1e-9, atol=1e-9)
    sigmas = np.array([c.sigma for c in world.sensor.components(world.motion)])
    scaled = kept["cov"][:d, :d] / np.outer(sigmas, sigmas)
    np.testing.assert_allclose(scaled, np.eye(d), atol=1e-8)


@pytest.mark.parametrize("world", POLAR_WORLDS, ids=str)
@given(seed=seeds, el=st.floats(-1.57, 1.57), sd=st.floats(1e-4, 1.7))
def test_no_time_changes_nothing_even_over_the_pole_and_through_the_sensor(world, seed, el, sd):
    """Points reach beyond 90 degrees, beyond half a turn and behind the sensor."""
    rng = np.random.default_rng(seed)
    n, d = len(world.motion.names), world.motion.dims
    mean = np.array([300.0, rng.uniform(-3.1, 3.1), el, *rng.normal(scale=50.0, size=n)])[:n]
    mean[d:] = rng.normal(scale=50.0, size=n - d)
    root = (
        np.tril(rng.normal(size=(n, n)))
        * np.array([100.0, *[0.3 * sd] * (d - 1)] + [9.0] * (n - d))[:, None]
    )
    cov = root @ root.T + np.diag([1e-4] * n)
    cov[1:d, 1:d] /= max(1.0, cov[1:d, 1:d].diagonal().max() / 3.0)
    if np.linalg.eigvalsh(cov)[0] <= 0.0:
        return
    pose = world.sensor.pose
    state = {"mean": mean, "cov": cov}
    if pose is not None:
        state |= {"position_m": pose.position_m, "rotation": pose.rotation}
    after = KEEPS.predict(state, world.motion, world.sensor, 0.0)
    np.testing.assert_allclose(after["mean"], mean, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(after["cov"], cov, rtol=1e-7, atol=1e-7 * np.max(cov))


def a_state(seed, dims=3, angle_sd=0.05):
    """Kept mean and a full covariance some 20 km out, at elevations up to 60 degrees."""
    rng = np.random.default_rng(seed)
    n = 2 * dims
    mean = np.array([rng.uniform(5e3, 4e4), *rng.uniform(-1.0, 1.0, dims - 1)])
    spread = np.array([300.0, *[angle_sd] * (dims - 1), *[30.0] * dims])
    root = (np.tril(rng.uniform(-0.5, 0.5, (n, n)), -1) + np.eye(n)) * spread[:, None]
    return np.concatenate([mean, rng.normal(scale=100.0, size=dims)]), root @ root.T


@given(seed=seeds)
def test_range_and_angles_are_used_by_the_textbook_s_linear_update(seed):
    mean, cov = a_state(seed)
    z = mean[:3] + np.array([250.0, 0.03, -0.04])
    z[seed % 3] = np.nan if seed % 2 else z[seed % 3]
    post, surprise = KEEPS.update({"mean": mean, "cov": cov}, z, SPACE, POLAR)
    R = np.diag([c.sigma**2 for c in POLAR.components(SPACE)])
    expected = textbook.joint_update(mean, cov, z, np.eye(3, 6), R)
    for ours, theirs in zip((*post.values(), surprise.nis, surprise.loglik), expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * np.max(np.abs(theirs)))


@pytest.mark.parametrize("dims", [2, 3])
@given(seed=seeds)
def test_what_is_told_has_the_moments_of_what_is_kept(dims, seed):
    """200,000 draws, 1 degree in each angle; six standard errors are one false alarm in 10^9."""
    mean, cov = a_state(seed, dims, 0.02)
    motion, sensor = ConstantVelocity(accel_mps2=1.0, dims=dims), POLAR if dims == 3 else PLANAR
    told = KEEPS.output({"mean": mean, "cov": cov}, motion, sensor)
    draws = np.random.default_rng(seed).multivariate_normal(mean, cov, 200_000)
    place, _ = from_polar(draws[:, :dims])
    x = np.concatenate([place, draws[:, dims:]], axis=1)
    root = np.linalg.inv(np.linalg.cholesky(told.cov))
    white = (x - told.mean) @ root.T
    np.testing.assert_allclose(white.mean(axis=0), 0.0, atol=6 / np.sqrt(len(x)))
    np.testing.assert_allclose(np.cov(white.T), np.eye(2 * dims), atol=0.025)


@pytest.mark.parametrize("sensor", [POLAR, MOVING, ALL], ids=["polar", "moving", "heights"])
@given(seed=seeds)
def test_far_away_and_small_it_is_the_extended_filter(sensor, seed):
    """Metres at tens of kilometres: what is curved is a ten-thousandth of what is not."""
    world = World(SPACE, sensor)
    mean, cov = world.prior(seed)
    cov *= 1e-4
    z = world.plot(mean + np.linalg.cholesky(cov)[:, 0], seed, sigmas=0.1)
    ours, ekf = (Entry(name).update(world, mean, cov, z) for name in ("ckf-spherical", "ekf"))
    sd = np.sqrt(np.diag(ekf.cov))
    np.testing.assert_allclose(ours.mean / sd, ekf.mean / sd, rtol=0, atol=3e-3)
    np.testing.assert_allclose(ours.cov / np.outer(sd, sd), ekf.cov / np.outer(sd, sd), atol=3e-3)
    assert ours.nis == pytest.approx(ekf.nis, abs=0.01)
    off = (ours.innovation - ekf.innovation)[:3] / np.sqrt(ekf.variance[:3])
    np.testing.assert_allclose(off, 0.0, atol=1e-9)  # of the range and angles of the prediction


@given(seed=seeds)
def test_an_estimate_beyond_the_zenith_is_the_same_place_on_this_side(seed):
    """Half a turn of azimuth, elevation mirrored, with all its correlations."""
    mean, cov = a_state(seed)
    mean[2] = 1.5
    z = np.array([np.nan, np.nan, 1.8])  # pulls the elevation beyond 90 degrees
    sharp = Radar(range_m=30.0, azimuth_deg=0.8, elevation_deg=0.01)
    post, _ = KEEPS.update({"mean": mean, "cov": cov}, z, SPACE, sharp)
    R = np.diag([30.0, *np.radians([0.8, 0.01])]) ** 2
    beyond, wide, *_ = textbook.joint_update(mean, cov, z, np.eye(3, 6), R)
    assert beyond[2] > np.pi / 2 > post["mean"][2]
    told = KEEPS.output(post, SPACE, sharp)
    same = KEEPS.output({"mean": beyond, "cov": wide}, SPACE, sharp)
    np.testing.assert_allclose(told.mean, same.mean, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(told.cov, same.cov, rtol=1e-7, atol=1e-7 * np.max(same.cov))
    assert abs(post["mean"][1]) <= np.pi


def test_noise_of_the_motion_is_that_of_the_place():
    """A target that is known exactly: after a second, Q turned into range and angles."""
    motion = ConstantVelocity(accel_mps2=2.0, dims=3, discretisation="continuous")
    polar = np.array([2e4, 0.7, 0.4])
    state = {
        "mean": np.array([*polar, 0.0, 0.0, 0.0]),
        "cov": np.diag([1e-9, 1e-18, 1e-18, *[1e-9] * 3]),
    }
    after = KEEPS.predict(state, motion, POLAR, 1.0)["cov"]
    _, J = from_polar(polar[None])
    back = np.block([[np.linalg.inv(J[0]), np.zeros((3, 3))], [np.zeros((3, 3)), np.eye(3)]])
    expected = back @ motion.noise(1.0) @ back.T
    sd = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(after / np.outer(sd, sd), expected / np.outer(sd, sd), atol=1e-5)


def test_what_an_uncertain_angle_adds_along_the_line_of_sight_is_told():
    """A range of 5 m, an angle of 0.05 rad, at 10 km: r cos a varies by 18 m."""
    r, v = 1e4, 0.05**2
    state = {"mean": np.array([r, 0.0, 0.0, 0.0]), "cov": np.diag([25.0, v, 1.0, 1.0])}
    told = KEEPS.output(state, PLANE, PLANAR)
    exact = (r**2 + 25.0) * (1.0 + np.exp(-2.0 * v)) / 2.0 - r**2 * np.exp(-v)
    assert told.cov[0, 0] == pytest.approx(exact, rel=0.02)


def test_right_overhead_an_azimuth_is_anything():
    """Where it has no slope, a start is finite, and no more certain than any angle is."""
    start = Gaussian(np.array([0.0, 0.0, 9e3, 5.0, 0.0, 0.0]), np.diag([1e4] * 3 + [9e2] * 3))
    kept = KEEPS.begin(start, SPACE, POLAR)
    np.testing.assert_allclose(kept["mean"][[0, 2]], [9e3, np.pi / 2], rtol=1e-6)
    assert kept["cov"][1, 1] == pytest.approx(np.pi**2 / 3.0)
    assert np.isfinite(kept["cov"]).all()
