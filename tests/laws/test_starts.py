"""Starts: what one or two plots say, by least squares on paper and by sampling."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import UsageError
from boresight.filters.start import from_polar, on_bearing, one_plot, random_draw, two_plots
from boresight.maths import Gaussian
from boresight.models.coordinates import PositionSensor
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar
from laws.enrolled import AFLOAT, CONE, HEARD, MOTIONS, PLANAR, PLANE, POINT, POLAR, POSE, SPACE
from laws.test_components import derivative
from oracles import filters as textbook

seeds = st.integers(0, 2**32)


@pytest.mark.parametrize("dims", [2, 3])
@given(seed=seeds)
def test_cartesian_and_polar_are_inverse_with_their_jacobian(dims, seed):
    rng = np.random.default_rng(seed)
    polar = np.array([rng.uniform(1e3, 9e4), rng.uniform(-3, 3), rng.uniform(-1.2, 1.2)])[:dims]
    position, J = from_polar(polar[None])
    np.testing.assert_allclose(textbook.polar(position[0]), polar, rtol=1e-12)
    for i, step in enumerate([1.0, 1e-3, 1e-3][:dims]):
        column = derivative(from_polar_extended, polar, i, step)
        np.testing.assert_allclose(J[0][:, i], column, rtol=1e-9, atol=1e-9)


def from_polar_extended(polar):
    """x, y, z by definition, in the precision of the argument."""
    r, az = polar[0], polar[1]
    el = polar[2] if len(polar) == 3 else polar[0] * 0
    ground = r * np.cos(el)
    return np.array([ground * np.cos(az), ground * np.sin(az), r * np.sin(el)])[: len(polar)]


@pytest.mark.parametrize(
    ("motion", "sensor"), [(SPACE, POLAR), (PLANE, PLANAR)], ids=["space", "plane"]
)
def test_one_plot_has_the_spread_of_its_noise(motion, sensor):
    """20,000 noisy plots: sample covariance within 5 % of the stated one."""
    rng, d = np.random.default_rng(5), motion.dims
    z = np.array([40e3, 2.1, 0.2])[:d]
    sigmas = np.array([30.0, *np.radians([0.8, 0.6])])[:d]
    start = one_plot(z[None], motion, sensor)
    draws = np.stack([from_polar_extended(q) for q in z + sigmas * rng.normal(size=(20_000, d))])
    np.testing.assert_allclose(start.mean[0, :d], from_polar_extended(z), rtol=1e-12)
    root = np.linalg.inv(np.linalg.cholesky(start.cov[0][:d, :d]))
    np.testing.assert_allclose(root @ np.cov(draws.T) @ root.T, np.eye(d), atol=0.05)
    assert np.diag(start.cov[0])[d:] == pytest.approx([300.0**2] * d)
    assert not start.mean[0, d:].any()


@given(seed=seeds)
def test_a_start_sees_through_its_sensor_s_pose(seed):
    """The plot of the started state is the plot it was started from."""
    sensor = Radar(range_m=30.0, azimuth_deg=0.8, elevation_deg=0.6, pose=POSE)
    rng = np.random.default_rng(seed)
    z = np.array([rng.uniform(5e3, 9e4), rng.uniform(-3, 3), rng.uniform(-0.5, 1.2)])
    start = one_plot(z[None], SPACE, sensor)
    again = [c.value(start.mean[0]) for c in sensor.components(SPACE)]
    np.testing.assert_allclose(again, z, rtol=1e-9, atol=1e-9)
    H = POSE.rotation
    _, J = from_polar(z[None])
    expected = J[0] @ np.diag([30.0, *np.radians([0.8, 0.6])]) ** 2 @ J[0].T
    np.testing.assert_allclose(
        H @ start.cov[0][:3, :3] @ H.T, expected, atol=1e-9 * np.max(expected)
    )


@pytest.mark.parametrize("sensor", [HEARD, CONE], ids=["bearing", "cone"])
@given(seed=seeds)
def test_a_start_on_a_bearing_lies_on_it(sensor, seed):
    """Seen from its sensor; the range's spread along the line, the angle's across it."""
    rng = np.random.default_rng(seed)
    z = np.array([[rng.uniform(0.1, 3.0)]])
    start = on_bearing(z, PLANE, sensor, 3e3, 800.0, speed_mps=12.0)
    component = sensor.components(PLANE)[0]
    assert component.value(start.mean[0]) == pytest.approx(z[0, 0], abs=1e-12)
    turn, origin = AFLOAT.rotation[:2, :2], AFLOAT.position_m[:2]
    away = turn @ (start.mean[0, :2] - origin)
    np.testing.assert_allclose(away, 3e3 * np.array([np.cos(z[0, 0]), np.sin(z[0, 0])]))
    along = turn.T @ away / 3e3
    across = np.array([-along[1], along[0]])
    expected = 800.0**2 * np.outer(along, along)
    expected += (3e3 * np.radians(0.8)) ** 2 * np.outer(across, across)
    np.testing.assert_allclose(start.cov[0, :2, :2], expected, atol=1e-6)
    np.testing.assert_allclose(start.cov[0, 2:], np.eye(4)[2:] * 144.0)
    assert not start.mean[0, 2:].any()


def test_where_a_bearing_and_a_cone_are_heard_the_bearing_counts():
    """It has no two sides; where neither was heard there is no start."""
    both = Radar(azimuth_deg=0.5, cone_deg=2.0)
    z = np.array([[-0.4, 0.5], [np.nan, 0.5], [np.nan, np.nan]])
    found = on_bearing(z, PLANE, both, 1e3, 50.0, speed_mps=3.0)
    np.testing.assert_allclose(found.mean[:2, 1], 1e3 * np.sin([-0.4, 0.5]))
    spread = [np.linalg.eigvalsh(found.cov[i, :2, :2])[0] ** 0.5 for i in (0, 1)]
    np.testing.assert_allclose(spread, 1e3 * np.radians([0.5, 2.0]))
    assert np.all(np.isnan(found.mean[2, :2]))


@pytest.mark.parametrize("kind", ["discrete", "continuous"])
def test_two_plots_are_weighted_least_squares(kind):
    """State after two positions, nothing known before: generalised least squares, lane by lane."""
    motion = ConstantVelocity(accel_mps2=3.0, dims=3, discretisation=kind)
    rng = np.random.default_rng(3)
    first, second = rng.normal(size=(2, 4, 3)) * 1e4
    dt = np.array([1.0, 4.0, 4.0, 9.0])
    start = two_plots(first, second, dt, motion, POINT)
    R = np.diag([20.0, 35.0, 50.0]) ** 2
    for lane, T in enumerate(dt):
        back = np.block([[np.eye(3), -T * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
        Q = motion.noise(T)
        H = np.vstack([back[:3], np.eye(3, 6)])  # both plots as functions of the last state
        N = np.block([[R + (back @ Q @ back.T)[:3, :3], np.zeros((3, 3))], [np.zeros((3, 3)), R]])
        cov = np.linalg.inv(H.T @ np.linalg.inv(N) @ H)
        mean = cov @ H.T @ np.linalg.inv(N) @ np.concatenate([first[lane], second[lane]])
        np.testing.assert_allclose(start.mean[lane], mean, rtol=1e-7)
        np.testing.assert_allclose(start.cov[lane], cov, rtol=1e-7, atol=1e-7)


def test_random_draws_have_the_prior_s_moments_even_where_it_is_singular():
    root = np.array([[3.0, 0, 0], [1, 2, 0], [0, 0, 0]])
    prior = Gaussian(np.array([10.0, 20.0, 30.0]), root @ root.T)
    drawn = random_draw(prior, np.random.default_rng(1), 40_000).mean
    np.testing.assert_allclose(drawn.mean(0), prior.mean, atol=0.08)
    np.testing.assert_allclose(np.cov(drawn.T), prior.cov, atol=0.25)
    assert (drawn[:, 2] == 30.0).all()


@pytest.mark.parametrize("motion", [m for m in MOTIONS if m.names[0] == "x_m"], ids=str)
def test_further_states_start_with_a_spread_of_their_own_unit(motion):
    sensor = POLAR if motion.dims == 3 else PLANAR
    start = one_plot(np.array([[4e4, 1.0, 0.1][: motion.dims]]), motion, sensor)
    spreads = dict(zip(motion.names, np.sqrt(np.diag(start.cov[0])), strict=True))
    for name, spread in spreads.items():
        largest = {"mps2": 10, "radps": 0.1, "mps": 300}.get(name.rsplit("_", 1)[-1], 1e3)
        assert 0 < spread <= largest


@pytest.mark.parametrize(
    ("motion", "sensor"),
    [
        (SPACE, PLANAR),
        (SPACE, PositionSensor(x_m=1.0, y_m=1.0)),
        (PLANE, Radar(azimuth_deg=1.0)),
        (PLANE, Radar(range_m=1.0)),
    ],
    ids=["no elevation", "no z", "no range", "no azimuth"],
)
def test_a_plot_that_is_not_a_place_is_refused(motion, sensor):
    with pytest.raises(UsageError, match="where the target is"):
        one_plot(np.ones((1, len(sensor.names))), motion, sensor)


def test_what_is_missing_from_a_plot_is_missing_from_the_start():
    start = one_plot(np.array([[4e4, np.nan], [4e4, 1.0]]), PLANE, PLANAR)
    assert np.isnan(start.mean[0, :2]).all()
    assert np.isfinite(start.mean[1]).all()
