"""Laws of a bent Gaussian: its update, its prediction with noise, what a mixture of them tells."""

import numpy as np
import pytest

from boresight.filters import line_of_sight_moments as closed
from boresight.filters import line_of_sight_plane as plane
from boresight.filters import line_of_sight_space as space
from boresight.filters.line_of_sight import LineOfSight, View
from boresight.maths import Gaussian
from boresight.maths.mixing import matched
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Pose, Radar
from boresight.testing.worlds import turned
from laws.enrolled import CHIRP, MOVING, PLANAR, PLANE, POLAR, SPACE, Entry, World

MEAN = np.array([800.0, 2.1, 12.0, -20.0])
COV = np.array(
    [[90.0, 0.1, 6.0, 20.0], [0.1, 0.01, 0.1, 0.3], [6.0, 0.1, 9.0, 8.0], [20.0, 0.3, 8.0, 64.0]]
)
BEND = np.array([0.04, -0.006])
BLIND = np.array([1.0, 20.0, 0.5, -30.0 / 64.0])  # measured: not correlated with the last state
MIXED = np.array([1.0, 20.0, 0.5, -0.3])


def posterior(row, bend, nu, noise):
    """Mean, covariance and bend of the exact posterior, by quadrature over all four states."""
    x, w = np.polynomial.hermite_e.hermegauss(24)
    grid = np.stack(np.meshgrid(*[x] * 4, indexing="ij")).reshape(4, -1)
    weight = np.prod(np.stack(np.meshgrid(*[w] * 4, indexing="ij")).reshape(4, -1), 0)
    off = np.linalg.cholesky(COV) @ grid
    off = off + np.array([bend[0], 0, bend[1], 0])[:, None] * (off[3] ** 2 - COV[3, 3])
    weight = weight * np.exp(-((nu - row @ off) ** 2) / (2.0 * noise))
    weight /= weight.sum()
    mean = off @ weight
    off = off - mean[:, None]
    columns = np.stack([np.ones(len(weight)), off[3], off[3] ** 2]) * np.sqrt(weight)
    fit = np.linalg.lstsq(columns.T, (off[[0, 2]] * np.sqrt(weight)).T, rcond=None)[0]
    return MEAN + mean, (off * weight) @ off.T, fit[2]


def off_by(row, scale, nu, noise=150.0):
    """How far an update is from the posterior, in its standard deviations; and its bend exactly."""
    part = closed.Part(MEAN, COV, scale * BEND)
    after, s = plane.condition(part, row, nu, noise, 1.0)
    mean, cov, bend = posterior(row, part.bend, nu, noise)
    np.testing.assert_allclose(after.bend, bend, rtol=1e-6)
    seen = row[[0, 2]] @ part.bend
    assert s == pytest.approx(row @ COV @ row + noise + 2.0 * seen**2 * COV[3, 3] ** 2)
    curved = np.array([after.bend[0], 0.0, after.bend[1], 0.0])
    told = after.cov + 2.0 * np.outer(curved, curved) * after.cov[3, 3] ** 2
    sd = np.sqrt(np.diag(cov))
    return np.max(np.abs(after.mean - mean) / sd), np.max(np.abs(told - cov) / np.outer(sd, sd))


@pytest.mark.parametrize("nu", [-40.0, 0.0, 40.0])
def test_an_update_is_the_posterior_to_first_order_in_the_bend(nu):
    """Of what the transverse velocity is seen in by the bend alone; half of it, a quarter of it."""
    whole, half = (np.array(off_by(BLIND, scale, nu)) for scale in (0.5, 0.25))
    assert np.all(whole < 0.06)
    assert np.all(half < whole / 2.9)


@pytest.mark.parametrize("nu", [-12.0, 0.0, 9.0])
def test_an_update_that_sees_the_transverse_velocity_is_near_the_posterior(nu):
    """Otherwise one term of first order is missing from the mean, 0.01 of a deviation here."""
    mean, cov = off_by(MIXED, 0.5, nu)
    assert mean < 0.013
    assert cov < 0.022


def test_noise_makes_a_bend_flatter():
    """E[(d² - var d) | d + noise] is the square of the regression times (e² - var e)."""
    part = closed.Part(MEAN, np.diag([90.0, 0.01, 9.0, 64.0]), BEND)
    after = plane.move(part, 0.0, np.diag([0.0, 0.0, 16.0, 16.0]))
    np.testing.assert_allclose(after.bend, BEND * 0.8**2, rtol=1e-12)


@pytest.mark.parametrize(("motion", "sensor"), [(PLANE, PLANAR), (SPACE, POLAR)], ids=["2", "3"])
def test_noise_of_the_motion_is_that_of_the_place(motion, sensor):
    """A target that is known exactly: after a second it is as uncertain as the motion says."""
    motion = ConstantVelocity(accel_mps2=2.0, dims=motion.dims, discretisation="continuous")
    d, method = motion.dims, LineOfSight(components=1)
    mean = np.array([9e3, -4e3, 5e3])[:d], np.array([-120.0, 80.0, 30.0])[:d]
    state = method.begin(Gaussian(np.concatenate(mean), 1e-12 * np.eye(2 * d)), motion, sensor)
    told = method.output(method.predict(state, motion, sensor, 1.0), motion, sensor)
    sd = np.sqrt(np.diag(motion.noise(1.0)))
    scale = np.outer(sd, sd)
    np.testing.assert_allclose(told.cov / scale, motion.noise(1.0) / scale, atol=1e-4)


@pytest.mark.parametrize("dt", [-90.0, -45.0, 30.0, 90.0])
def test_straight_flight_over_the_sensor_is_straight(dt):
    """Into the other half of the sky: a line is a line in any frame."""
    state = np.array([3e3, -2e3, 4e3, -90.0, 70.0, 15.0])
    part = closed.Part(space.enter(state), 1e-14 * np.eye(6), np.zeros(2))
    there = space.move(part, dt, np.zeros((6, 6))).mean
    expected = SPACE.move(state, dt)
    np.testing.assert_allclose(space.leave(there), expected, rtol=1e-9, atol=1e-6)
    assert abs(there[2]) <= np.pi / 2


def test_what_a_platform_does_is_no_news_of_the_target():
    """It flies on, or turns and goes elsewhere: told the same to second order in 0.03 rad."""
    mean, method = np.array([6e3, 7e3, -60.0, 90.0]), LineOfSight(components=1)
    pose = Pose(position_m=np.array([500.0, -300.0, 0.0]), velocity_mps=np.array([50.0, 20.0, 0.0]))
    elsewhere = Pose(
        position_m=np.array([3e3, 2e3, 0.0]),
        rotation=turned(0.8),
        velocity_mps=np.array([-90.0, 150.0, 0.0]),
    )
    on = Pose(position_m=pose.position_m + 4.0 * pose.velocity_mps, velocity_mps=pose.velocity_mps)
    radar = Radar(range_m=30.0, azimuth_deg=1.0, pose=pose)
    cov = np.diag([250.0, 250.0, 8.0, 8.0]) ** 2

    def told(after, scale):
        state = method.begin(Gaussian(mean, scale**2 * cov), PLANE, radar)
        there = Radar(range_m=30.0, azimuth_deg=1.0, pose=after)
        still = ConstantVelocity(accel_mps2=0.0, dims=2)
        return method.output(method.predict(state, still, there, 4.0), still, there)

    def apart(scale):
        a, b = told(on, scale), told(elsewhere, scale)
        sd = scale * np.sqrt(np.diag(told(on, 1.0).cov))
        gap = np.abs(a.cov - b.cov) / np.outer(sd, sd)
        return np.max(np.abs(a.mean - b.mean) / sd), np.max(gap)

    whole, half = np.array(apart(1.0)), np.array(apart(0.5))
    assert np.all(whole < 2e-2)
    assert whole[0] < 1e-3
    assert half[1] < whole[1] / 3.0


@pytest.mark.parametrize("told", ["mean", "unbiased"])
def test_what_is_told_is_the_mixture_of_what_its_parts_tell(told):
    method, weights = LineOfSight(components=3, told=told), np.array([0.5, 1.0, 0.2])
    means = MEAN + np.outer([0.0, 1.0, -1.0], [9.0, 0.05, 1.0, 30.0])
    state = {
        "means": means,
        "covs": np.tile(COV[np.triu_indices(4)], (3, 1)),
        "bends": np.tile(BEND, (3, 1)),
        "log_weights": np.log(weights),
    }
    found = method.output(state, PLANE, PLANAR)
    parts = [closed.Part(m, COV, BEND) for m in means]
    each = [closed.plane(part) for part in parts]
    centres = [closed.plane_mean(part, -1.0 if told == "unbiased" else 1.0) for part in parts]
    share = weights / weights.sum()
    mean = share @ np.array(centres)
    np.testing.assert_allclose(found.mean, mean, rtol=1e-12)
    second = [g.cov + np.outer(g.mean - mean, g.mean - mean) for g in each]
    np.testing.assert_allclose(found.cov, np.einsum("p,pij->ij", share, second), rtol=1e-9)


def test_unbiased_in_space_is_further_out_by_what_the_mean_is_short():
    """Angles of 0.05 and 0.03 rad alone: on the ground e^(half of both squares), in height one."""
    mean, cov = np.array([8e3, 2.1, 0.6, 12.0, -120.0, 60.0]), np.zeros((6, 6))
    cov[1, 1], cov[2, 2] = 0.05**2, 0.03**2
    place = space.leave(mean)[:3]
    longer = np.exp(0.5 * np.array([0.05**2 + 0.03**2] * 2 + [0.03**2]))
    found = space.unbiased(closed.Part(mean, cov, np.zeros(2)))[:3]
    np.testing.assert_allclose(found / place, longer, atol=1e-5)


def test_a_surprise_is_matched_by_two_moments_however_unlike_the_weights():
    """0.25 N(-1, 4) + 0.75 N(3, 1): mean 2, variance 0.25 (4 + 9) + 0.75 (1 + 1) = 4.75."""
    logs = [np.log(0.25), np.log(0.75)]
    assert matched(logs, [-1.0, 3.0], [4.0, 1.0]) == pytest.approx((2.0, 4.75))
    assert matched([-2000.0, 0.0], [-1.0, 3.0], [4.0, 1.0]) == pytest.approx((3.0, 1.0))


def test_angles_are_used_first_and_what_is_not_linear_last():
    def turns(sensor, motion):
        views = [View(c, motion, sensor, None) for c in sensor.components(motion)]
        return [view.turn for view in views]

    assert turns(MOVING, SPACE) == [1, 0, 0, 1]
    assert turns(CHIRP, PLANE) == [1, 0, 2]  # its range rate has a share of the range in it


@pytest.mark.parametrize("world", [World(PLANE, CHIRP), World(SPACE, MOVING)], ids=str)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_far_away_and_small_it_is_the_extended_filter(world, seed):
    """Metres at tens of kilometres: what is curved is a thousandth of what is not."""
    mean, cov = world.prior(seed)
    cov *= 1e-4
    z = world.plot(mean + np.linalg.cholesky(cov)[:, 0], seed, sigmas=0.1)
    ours, ekf = (Entry(name).update(world, mean, cov, z) for name in ("line-of-sight", "ekf"))
    sd = np.sqrt(np.diag(ekf.cov))
    np.testing.assert_allclose(ours.mean / sd, ekf.mean / sd, rtol=0, atol=3e-3)
    np.testing.assert_allclose(ours.cov / np.outer(sd, sd), ekf.cov / np.outer(sd, sd), atol=1e-2)
