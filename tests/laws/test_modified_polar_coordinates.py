"""Modified polar coordinates: against their definition, against draws, and apart from the range."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boresight as bs
from boresight.errors import UsageError
from boresight.filters import kalman
from boresight.filters.modified_polar import ModifiedPolar
from boresight.filters.recursion import Recursion, run_recursion
from boresight.maths import Gaussian
from boresight.models.motion import ConstantVelocity, CoordinatedTurn
from boresight.models.sensors import Bearings, Pose
from laws.enrolled import PLANE, SPACE

seeds = st.integers(0, 2**32)
STRAIGHT = ConstantVelocity(accel_mps2=0.0, dims=2)
TINY = np.diag([1e-2, 1e-2, 1e-6, 1e-6])  # m², m²/s²: a place, nearly


def heard_from(place, velocity=(0.0, 0.0)):
    return Bearings(
        azimuth_deg=0.33, pose=Pose(position_m=np.array([*place, 0]), velocity_mps=[*velocity, 0])
    )


def by_definition(state, own, velocity):
    """Rate of bearing, rate of range over range, bearing, one over range."""
    p, v = state[:2] - own, state[2:] - velocity
    r = np.hypot(*p)
    along, across = p @ v / r, (p[0] * v[1] - p[1] * v[0]) / r
    return np.array([across / r, along / r, np.arctan2(p[1], p[0]), 1.0 / r])


def somewhere(seed):
    """A target, own ship's place and velocity, and what own ship does next."""
    rng = np.random.default_rng(seed)
    r, b = rng.uniform(800.0, 3e4), rng.uniform(-np.pi, np.pi)
    own, velocity = rng.normal(size=2) * 5e3, rng.normal(size=2) * 8.0
    target = np.array([*(own + r * np.array([np.cos(b), np.sin(b)])), *rng.normal(size=2) * 11.0])
    return target, own, velocity, own + rng.normal(size=2) * 60.0


@pytest.mark.parametrize("predicted", ["points", "first order"])
@given(seed=seeds, dt=st.floats(0.5, 20.0))
def test_a_place_is_kept_and_predicted_by_definition(predicted, seed, dt):
    """Own ship turns as it likes; its velocity is its displacement over the interval."""
    target, own, velocity, later = somewhere(seed)
    method = ModifiedPolar(predicted=predicted)
    state = method.begin(Gaussian(target, TINY), STRAIGHT, heard_from(own, velocity))
    np.testing.assert_allclose(state["mean"], by_definition(target, own, velocity), rtol=1e-6)
    moved = method.predict(state, STRAIGHT, heard_from(later), dt)
    there = np.array([*(target[:2] + dt * target[2:]), *target[2:]])
    expected = by_definition(there, later, (later - own) / dt)
    scale = np.hypot(*expected[:2])
    np.testing.assert_allclose(moved["mean"][:2] / scale, expected[:2] / scale, atol=1e-4)
    np.testing.assert_allclose(moved["mean"][2:], expected[2:], rtol=1e-5, atol=1e-7)
    told = method.output(moved, STRAIGHT, heard_from(later))
    np.testing.assert_allclose(told.mean, there, rtol=1e-5, atol=0.1)


@given(seed=seeds, dt=st.floats(0.5, 20.0))
def test_small_uncertainties_and_process_noise_are_those_of_the_plane(seed, dt):
    target, own, velocity, later = somewhere(seed)
    rng = np.random.default_rng((seed, 1))
    root = np.diag([0.5, 0.5, 0.02, 0.02]) @ rng.uniform(-1.0, 1.0, (4, 4))
    cov = root @ root.T + TINY
    motion = ConstantVelocity(accel_mps2=0.01, dims=2)
    method = ModifiedPolar()
    state = method.begin(Gaussian(target, cov), motion, heard_from(own, velocity))
    told = method.output(state, motion, heard_from(own))
    scale = np.sqrt(np.diag(cov))
    np.testing.assert_allclose(told.cov / np.outer(scale, scale), cov / np.outer(scale, scale),
                               atol=1e-2)  # fmt: skip
    moved = method.predict(state, motion, heard_from(later), dt)
    told = method.output(moved, motion, heard_from(later))
    expected = kalman.predict(Gaussian(target, cov), motion, dt)
    scale = np.sqrt(np.diag(expected.cov))
    np.testing.assert_allclose(told.cov / np.outer(scale, scale),
                               expected.cov / np.outer(scale, scale), atol=2e-2)  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1])
def test_while_own_ship_sails_on_bearings_know_nothing_of_the_range(seed):
    """120 bearings: rates and bearing are the same whatever is believed of 1/r."""
    rng = np.random.default_rng(seed)
    target, own, velocity, _ = somewhere(seed)
    method = ModifiedPolar()
    start = Gaussian(target, np.diag([500.0, 500.0, 5.0, 5.0]) ** 2)
    state = method.begin(start, STRAIGHT, heard_from(own, velocity))
    told = np.eye(4)
    told[3, :3], told[3, 3] = rng.normal(size=3) * 1e-3 * state["mean"][3], 0.3
    shift = np.array([0.0, 0.0, 0.0, 0.4 * state["mean"][3]])
    other = {**state, "mean": state["mean"] + shift, "cov": told @ state["cov"] @ told.T}
    for step in range(1, 121):
        sensor = heard_from(own + step * velocity, velocity)
        z = state["mean"][2:3] + 0.006 * rng.normal(size=1)
        state, other = (method.predict(s, STRAIGHT, sensor, 1.0) for s in (state, other))
        (state, one), (other, two) = (method.update(s, z, STRAIGHT, sensor) for s in (state, other))
        assert one.loglik == pytest.approx(two.loglik, rel=1e-9, abs=1e-9)
    scale = np.sqrt(np.diag(state["cov"]))[:3]
    np.testing.assert_allclose((state["mean"] - other["mean"])[:3] / scale, 0.0, atol=1e-6)
    difference = (state["cov"] - other["cov"])[:3, :3] / np.outer(scale, scale)
    np.testing.assert_allclose(difference, 0.0, atol=1e-6)
    assert abs(state["mean"][3] / other["mean"][3] - 1.0) > 0.1


def test_a_wide_start_has_the_moments_of_uniform_ranges():
    """400,000 draws; their own errors are under a fifth of what is allowed."""
    rng, n = np.random.default_rng(4), 400_000
    method, sensor = ModifiedPolar(), heard_from((0.0, 0.0), (3.0, -7.0))
    spread = 19e3 / np.sqrt(12.0)
    start = Gaussian(np.array([10.5e3, 0.0, 5.0, 9.0]), np.diag([spread, 10.5, 11.0, 11.0]) ** 2)
    state = method.begin(start, STRAIGHT, sensor)
    r = rng.uniform(1e3, 20e3, n)
    v = start.mean[2:] - [3.0, -7.0] + 11.0 * rng.normal(size=(n, 2))
    drawn = np.stack([v[:, 1] / r, v[:, 0] / r, 1e-3 * rng.normal(size=n), 1.0 / r])
    scale = np.std(drawn, axis=1)
    np.testing.assert_allclose(state["mean"] / scale, drawn.mean(axis=1) / scale, atol=0.02)
    expected = np.cov(drawn) / np.outer(scale, scale)
    np.testing.assert_allclose(state["cov"] / np.outer(scale, scale), expected, atol=0.03)


def test_a_start_whose_velocity_goes_with_its_range_has_the_moments_of_draws():
    """400,000 lognormal ranges; of one over a uniform range the variance is another."""
    u, *rest = np.random.default_rng(6).normal(size=(4, 400_000))
    log_sd = np.sqrt(np.log(1.04))
    r = 5e3 * np.exp(log_sd * u - log_sd**2 / 2.0)
    along, across = 8.0 + 4.0 * u + 3.0 * rest[0], -3.0 - 2.0 * u + 3.0 * rest[1]
    plane = np.stack([r, 5.0 * rest[2], along, across])
    start = Gaussian(plane.mean(axis=1), np.cov(plane))
    state = ModifiedPolar().begin(start, STRAIGHT, heard_from((0.0, 0.0)))
    drawn = np.stack([across / r, along / r, 5.0 * rest[2] / r.mean(), 1.0 / r])
    scale = np.std(drawn, axis=1)
    np.testing.assert_allclose(state["mean"] / scale, drawn.mean(axis=1) / scale, atol=0.03)
    apart = (state["cov"] - np.cov(drawn)) / np.outer(scale, scale)
    np.testing.assert_allclose(apart.ravel()[:-1], 0.0, atol=0.03)


def test_a_wide_prediction_has_the_spread_of_its_cubature_points():
    """Plus and minus two columns of the root, each moved in the plane."""
    own, velocity, later, dt = np.array([2e3, -1e3]), np.array([6.0, 8.0]), [2.2e3, -8.4e2], 20.0
    cov = np.diag([2e-3, 1.5e-3, 0.02, 3e-5]) ** 2
    kept = np.array([1e-3, -2e-3, 0.6, 1.5e-4])
    state = {"mean": kept, "cov": cov, "position": own, "velocity": velocity}
    points = kept + np.concatenate([2.0 * np.sqrt(cov), -2.0 * np.sqrt(cov)])
    moved = []
    for turn, rate, bearing, inverse in points:
        ahead = np.array([np.cos(bearing), np.sin(bearing)])
        aside = np.array([-ahead[1], ahead[0]])
        v = velocity + (rate * ahead + turn * aside) / inverse
        there = np.array([*(own + ahead / inverse + dt * v), *v])
        moved.append(by_definition(there, np.array(later), (later - own) / dt))
    expected = np.cov(np.array(moved).T, ddof=0)
    found = ModifiedPolar().predict(state, STRAIGHT, heard_from(later), dt)
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found["mean"] / scale, np.mean(moved, axis=0) / scale, atol=1e-9)
    np.testing.assert_allclose(found["cov"] / np.outer(scale, scale),
                               expected / np.outer(scale, scale), atol=1e-9)  # fmt: skip


def test_a_bearing_through_south_is_kept_within_half_a_turn():
    method, sensor = ModifiedPolar(), heard_from((0.0, 0.0))
    state = method.begin(Gaussian(np.array([-1e3, 5.0, 0.0, -10.0]), TINY), STRAIGHT, sensor)
    moved = method.predict(state, STRAIGHT, sensor, 1.0)
    assert state["mean"][2] == pytest.approx(np.pi - 5e-3, abs=1e-6)
    assert moved["mean"][2] == pytest.approx(-np.pi + 5e-3, abs=1e-4)


@given(seed=seeds, ratio=st.floats(0.01, 3.0))
def test_any_start_is_kept_with_a_covariance(seed, ratio):
    """However wide its range, and however correlated."""
    target, own, _, _ = somewhere(seed)
    rng = np.random.default_rng((seed, 2))
    root = np.linalg.cholesky(np.eye(4) * 1e-3 + (a := rng.normal(size=(4, 4))) @ a.T)
    away = (target[:2] - own) * ratio
    root = np.array([[*away, 0, 0], [*(away[::-1] * [-0.01, 0.01]), 0, 0],
                     [0, 0, 9, 0], [0, 0, 0, 9]]).T @ root  # fmt: skip
    kept = ModifiedPolar().begin(Gaussian(target, root @ root.T), STRAIGHT, heard_from(own))["cov"]
    scale = np.sqrt(np.diag(kept))
    assert np.linalg.eigvalsh(kept / np.outer(scale, scale))[0] > -1e-9


def test_a_close_pass_leaves_numbers():
    """1,000 targets pass own ship within 50 m; bearings jump by more than 90 degrees in a step."""
    rng, steps, lanes = np.random.default_rng(8), 60, 1_000
    miss, speed = rng.uniform(0.0, 50.0, lanes), rng.uniform(5.0, 60.0, lanes)
    along = speed[:, None] * (np.arange(steps) - 30.5 + rng.uniform(-0.5, 0.5, (lanes, 1)))
    turn = rng.uniform(-np.pi, np.pi, (lanes, 1))
    z = np.arctan2(np.broadcast_to(miss[:, None], along.shape), along) + turn
    assert np.any(np.abs(np.diff(z)) > np.pi / 2, axis=1).mean() > 0.2
    z = (z + 0.006 * rng.normal(size=z.shape))[..., None]
    for name in ("modified-polar", "rp-modified-polar"):
        found = bs.run(name, PLANE, heard_from((0.0, 0.0)), z, dt=1.0, speed_mps=11.0)
        assert np.isfinite(found.mean).all()
        assert np.isfinite(found.cov).all()
        assert (np.linalg.norm(found.mean[..., :2], axis=-1) < 2.01e5).all()


def test_no_time_is_no_change():
    target, own, velocity, _ = somewhere(3)
    method, sensor = ModifiedPolar(), heard_from(own, velocity)
    state = method.begin(Gaussian(target, TINY), PLANE, sensor)
    again = method.predict(state, PLANE, sensor, 0.0)
    scale = np.sqrt(np.diag(state["cov"]))
    np.testing.assert_allclose(
        again["cov"] / np.outer(scale, scale), state["cov"] / np.outer(scale, scale), atol=1e-11
    )
    for name in ("mean", "position", "velocity"):
        np.testing.assert_allclose(again[name], state[name], rtol=1e-12)


def test_the_start_is_the_setting_s_range_on_the_bearing():
    sensor = heard_from((100.0, 200.0))
    start = ModifiedPolar(range_m=4e3, range_sd_m=900.0).start(np.array([[0.5]]), STRAIGHT, sensor)
    along = np.array([np.cos(0.5), np.sin(0.5)])
    np.testing.assert_allclose(start.mean[0, :2], np.array([100.0, 200.0]) + 4e3 * along)
    assert along @ start.cov[0, :2, :2] @ along == pytest.approx(900.0**2)
    z = np.full((2, 3, 1), 0.5)
    fine = run_recursion(Recursion(ModifiedPolar(), STRAIGHT, sensor), z, 1.0, start)
    assert np.isfinite(fine.mean).all()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"range_m": 5.0}, "5 m between 10 and"),
        ({"farthest_m": 1e3}, "between 10 and 1000"),
        ({"range_sd_m": 0.0}, "range_sd_m"),
        ({"predicted": "second order"}, "second order"),
    ],
)
def test_settings_that_are_none_are_refused(settings, said):
    with pytest.raises(UsageError, match=said):
        ModifiedPolar(**settings)


@pytest.mark.parametrize("motion", [SPACE, CoordinatedTurn(accel_mps2=1.0, turn_accel_degps2=0.3)])
def test_only_straight_motion_in_the_plane_is_followed(motion):
    with pytest.raises(UsageError, match="modified polar coordinates of a"):
        ModifiedPolar().layout(motion, heard_from((0.0, 0.0)))


def test_what_has_no_bearing_starts_nothing():
    sensor = replace(heard_from((0.0, 0.0)), azimuth_deg=None, range_m=30.0)
    with pytest.raises(UsageError, match="no start on a bearing from range_m"):
        ModifiedPolar().start(np.ones((1, 1)), STRAIGHT, sensor)


@pytest.mark.parametrize("name", ["ekf", "mgekf", "ukf", "ckf"])
def test_filters_that_need_a_range_say_which_does_not(name):
    with pytest.raises(UsageError, match="without range_m") as caught:
        bs.run(name, STRAIGHT, heard_from((0.0, 0.0)), np.ones((1, 4, 1)), dt=1.0)
    assert "rp-ekf" in str(caught.value)


@pytest.mark.parametrize(
    ("inverse", "range_m"), [(1e-9, 2e5), (-1e-3, 2e5), (2e-5, 5e4), (1e-4, 1e4)]
)
def test_what_is_told_is_positive_definite_however_little_is_known_of_the_range(inverse, range_m):
    """Known to a tenth of a metre per second across the line of sight, and not at all along it."""
    sensor, own = heard_from((3e3, -4e3)), {"position": np.array([3e3, -4e3]), "velocity": [5.0, 2]}
    cov = np.diag([5e-7, 5e-6, 2e-3, 5.0]) ** 2
    state = {"mean": np.array([2e-5, 1e-4, 0.7, inverse]), "cov": cov, **own}
    told = ModifiedPolar().output(state, STRAIGHT, sensor)
    along = np.array([np.cos(0.7), np.sin(0.7)])
    assert along @ told.cov[:2, :2] @ along == pytest.approx(2e5**2, rel=1e-6)
    far = np.linalg.norm(told.mean[:2] - own["position"])
    assert far == pytest.approx(range_m)
    assert along[::-1] * [-1, 1] @ told.cov[:2, :2] @ (along[::-1] * [-1, 1]) == pytest.approx(
        (2e-3 * far) ** 2, rel=1e-3
    )
    assert np.array_equal(told.cov, told.cov.T)
    np.linalg.cholesky(told.cov)
