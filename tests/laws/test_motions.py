"""A motion is a flow with a noise: time adds up, axes do not matter, nothing happens in no time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from boresight.errors import UsageError
from boresight.filters.kalman import predict
from boresight.lanes import jacobian
from boresight.maths import Gaussian
from boresight.models.motion import (
    ConstantAcceleration,
    ConstantVelocity,
    CoordinatedTurn,
    SphericalUnitRate,
    Static,
    WithHeightOffset,
)
from boresight.testing.worlds import turned
from laws.enrolled import MOTIONS
from laws.test_components import derivative
from oracles import filters as textbook

seeds = st.integers(0, 2**32)
times = st.floats(0.01, 30.0)
motions = pytest.mark.parametrize("motion", MOTIONS, ids=lambda m: f"{type(m).__name__}-{m.dims}")
FLOWS = [m for m in MOTIONS if not isinstance(m, SphericalUnitRate)]  # that one is an Euler step
flows = pytest.mark.parametrize("motion", FLOWS, ids=lambda m: f"{type(m).__name__}-{m.dims}")
CONTINUOUS = (
    ConstantVelocity(accel_mps2=1.5, dims=3, discretisation="continuous"),
    ConstantAcceleration(jerk_mps3=0.7, dims=2, discretisation="continuous"),
    Static(drift_m_per_sqrt_s=3.0, dims=2),
    WithHeightOffset(
        inner=ConstantVelocity(accel_mps2=1.5, dims=3, discretisation="continuous"),
        drift_m_per_sqrt_s=2.0,
    ),
)


def some_state(motion, seed):
    rng = np.random.default_rng(seed)
    sizes = {"m": 2e4, "mps": 150.0, "mps2": 3.0, "radps": 0.06, "km": 15.0}
    return np.array([rng.normal() * sizes[name.rsplit("_", 1)[-1]] for name in motion.names])


def close(a, b, rtol=1e-10):
    np.testing.assert_allclose(a, b, rtol=0, atol=rtol * np.max(np.abs(b)) + 1e-300)


@motions
@given(seed=seeds, dt=times)
def test_jacobians_are_derivatives(motion, seed, dt):
    state = some_state(motion, seed)
    moved, F = jacobian(lambda x: motion.move(x, dt), state)
    close(moved, motion.move(state, dt), 1e-14)
    for j, name in enumerate(motion.names):
        step = 1e-3 / max(dt, 1.0) if name == "turn_radps" else 1e-4 * abs(state[j]) + 1e-4
        column = derivative(lambda x: motion.move(x, dt), state, j, step)
        np.testing.assert_allclose(F[:, j], column, rtol=1e-8, atol=1e-11 * np.max(np.abs(column)))


@pytest.mark.parametrize("rate", [0.0, 1e-12, 1e-7, 0.9e-4, 1.1e-4, 1e-3, -1e-5, 3.0])
def test_turns_of_any_rate_are_arcs_with_their_derivatives(rate):
    """Tiny turns too, either side of the place where the series takes over."""
    motion, dt = CoordinatedTurn(accel_mps2=1.0, turn_accel_degps2=0.1), 2.0
    state = np.array([1e3, -2e3, 180.0, -90.0, rate])
    w = np.longdouble(rate)
    if rate:
        s, c = np.sin(w * 2) / w, (2 * np.sin(w) ** 2) / w
    else:
        s, c = np.longdouble(2), np.longdouble(0)
    x, y, vx, vy = (np.longdouble(v) for v in state[:4])
    exact = [x + s * vx - c * vy, y + c * vx + s * vy]
    moved, F = jacobian(lambda q: motion.move(q, dt), state)
    np.testing.assert_allclose(moved[:2], np.array(exact, dtype=float), rtol=1e-12)
    assert np.hypot(*moved[2:4]) == pytest.approx(np.hypot(180.0, 90.0), rel=1e-14)
    # By the series of the exact slopes where the rate is small, else by differences.
    for i in range(4):
        numeric = derivative(lambda q, i=i: motion.move(q, dt)[i], state, 4, 3e-6)
        assert F[i, 4] == pytest.approx(numeric, rel=1e-6, abs=1e-6)
    if abs(rate) <= 1.1e-4:
        slope = [-180.0 * 8 * rate / 3 + 90.0 * 2, 180.0 * 2 + 90.0 * 8 * rate / 3]
        np.testing.assert_allclose(F[:2, 4], slope, rtol=1e-7)


@given(seed=seeds, dt=times)
def test_a_coordinated_turn_follows_its_differential_equation(seed, dt):
    motion = CoordinatedTurn(accel_mps2=1.0, turn_accel_degps2=0.1)
    state = some_state(motion, seed)

    def rates(_, q):
        return [q[2], q[3], -q[4] * q[3], q[4] * q[2], 0.0]

    path = solve_ivp(rates, (0, dt), state, rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(motion.move(state, dt), path.y[:, -1], rtol=1e-7, atol=1e-5)


@given(seed=seeds, dt=times)
def test_polynomial_motions_are_taylor_series(seed, dt):
    rng = np.random.default_rng(seed)
    p, v, a = rng.normal(size=(3, 3)) * [[2e4], [150], [3]]
    still = ConstantVelocity(accel_mps2=0.0).move(np.concatenate([p, v]), dt)
    close(still, np.concatenate([p + v * dt, v]), 1e-14)
    moved = ConstantAcceleration(jerk_mps3=0.0).move(np.concatenate([p, v, a]), dt)
    close(moved, np.concatenate([p + v * dt + a * dt**2 / 2, v + a * dt, a]), 1e-14)


@flows
@given(seed=seeds, first=times, second=times)
def test_moving_twice_is_moving_once_for_the_sum(motion, seed, first, second):
    state = some_state(motion, seed)
    close(motion.move(motion.move(state, first), second), motion.move(state, first + second))


@pytest.mark.parametrize("motion", CONTINUOUS, ids=lambda m: type(m).__name__)
@given(first=times, second=times)
def test_continuous_noise_adds_up_over_time(motion, first, second):
    state = np.ones(len(motion.names))
    _, F = jacobian(lambda x: motion.move(x, second), state)
    together = F @ motion.noise(first) @ F.T + motion.noise(second)
    np.testing.assert_allclose(together, motion.noise(first + second), rtol=1e-12)


@pytest.mark.parametrize("dims", [2, 3])
@given(dt=times)
def test_discrete_noises_are_what_one_random_number_a_step_does(dims, dt):
    _, Q = textbook.discrete_velocity(dt, 1.5, dims)
    np.testing.assert_allclose(ConstantVelocity(accel_mps2=1.5, dims=dims).noise(dt), Q, rtol=1e-12)
    printed = ConstantVelocity(accel_mps2=1.5, dims=dims, discretisation="printed").noise(dt)
    np.testing.assert_allclose(printed, np.diag(np.diag(Q)), rtol=1e-12)
    gain = np.kron([[dt**2 / 2], [dt], [1.0]], np.eye(dims))
    jerky = ConstantAcceleration(jerk_mps3=0.7, dims=dims, discretisation="discrete").noise(dt)
    np.testing.assert_allclose(jerky, (0.7 * dt) ** 2 * gain @ gain.T, rtol=1e-12)


@given(dt=times)
def test_noise_of_a_turn(dt):
    _, Q = textbook.discrete_velocity(dt, 1.0, 2)
    N = CoordinatedTurn(accel_mps2=1.0, turn_accel_degps2=0.3).noise(dt)
    np.testing.assert_allclose(N[:4, :4], Q, rtol=1e-12)
    assert N[4, 4] == pytest.approx((0.3 * np.pi / 180 * dt) ** 2)
    assert not N[4, :4].any()
    assert not N[:4, 4].any()


def test_densities_of_continuous_noise_after_one_second():
    """Velocity grows by accel² a second, position by a third of it; likewise one order higher."""
    N = ConstantVelocity(accel_mps2=1.5, dims=2, discretisation="continuous").noise(1.0)
    assert (N[0, 0], N[0, 2], N[2, 2]) == pytest.approx((0.75, 1.125, 2.25))
    N = ConstantAcceleration(jerk_mps3=2.0, dims=2).noise(1.0)
    assert N[0, [0, 2, 4]] == pytest.approx([0.2, 0.5, 4 / 6])
    assert Static(drift_m_per_sqrt_s=3.0).noise(2.0)[0, 0] == pytest.approx(18.0)


@motions
@given(dt=times)
def test_noise_is_a_covariance(motion, dt):
    N = motion.noise(dt)
    np.testing.assert_array_equal(N, N.T)
    scale = np.sqrt(np.diag(N))
    assert np.linalg.eigvalsh(N / np.outer(scale, scale))[0] > -1e-12


@flows
@given(seed=seeds)
def test_nothing_happens_in_no_time(motion, seed):
    state = some_state(motion, seed)
    cov = np.diag(np.arange(1.0, len(state) + 1))
    still = predict(Gaussian(state, cov), motion, 0.0)
    np.testing.assert_array_equal(still.mean, state)
    np.testing.assert_array_equal(still.cov, cov)


@flows
@given(seed=seeds, dt=times, angle=st.floats(-np.pi, np.pi))
def test_axes_do_not_matter(motion, seed, dt, angle):
    state = some_state(motion, seed)
    R = turned(angle, motion.dims)
    blocks = [R] * (len(state) // motion.dims)
    n = len(state)
    T = np.eye(n)
    for i, block in enumerate(blocks):
        T[i * motion.dims : (i + 1) * motion.dims, i * motion.dims : (i + 1) * motion.dims] = block
    close(motion.move(T @ state, dt), T @ motion.move(state, dt))
    N = motion.noise(dt)
    close(T @ N @ T.T, N)


@given(seed=seeds)
def test_unit_rate_motion_is_the_derivative_of_polar_coordinates(seed):
    """Errata A1 to A3: rates of position, and their own rates, for unit polar rates."""
    motion = SphericalUnitRate(position_noise=0.1, velocity_noise=0.1)
    rng = np.random.default_rng(seed)
    r, az, el = rng.uniform(5, 40), rng.uniform(-3, 3), rng.uniform(0.1, 1.3)

    def path(t):
        radius, a, e = r + t, az + t, el + t
        flat = radius * np.cos(e)
        return np.array([flat * np.cos(a), flat * np.sin(a), radius * np.sin(e)])

    h = np.longdouble(1e-3)
    points = [path(np.longdouble(0) + k * h) for k in (-3, -2, -1, 0, 1, 2, 3)]
    first = sum(w * p for w, p in zip((-1, 9, -45, 0, 45, -9, 1), points, strict=True)) / (60 * h)
    second = sum(w * p for w, p in zip((2, -27, 270, -490, 270, -27, 2), points, strict=True)) / (
        180 * h * h
    )
    state = np.concatenate([path(0.0), [7.0, -8.0, 9.0]])
    moved = motion.move(state, 0.5)
    expected = state + 0.5 * np.concatenate([first, second]).astype(float)
    np.testing.assert_allclose(moved, expected, rtol=1e-9, atol=1e-9)
    assert np.diag(motion.noise(3.0)) == pytest.approx([0.01] * 6)


@given(seed=seeds, dt=times)
def test_prediction_is_the_textbook_s(seed, dt):
    motion = ConstantVelocity(accel_mps2=1.5, dims=3)
    rng = np.random.default_rng(seed)
    mean, root = some_state(motion, seed), rng.normal(size=(6, 6))
    F, Q = textbook.discrete_velocity(dt, 1.5, 3)
    expected = textbook.predict(mean, root @ root.T, F, Q)
    ours = predict(Gaussian(mean, root @ root.T), motion, dt)
    close(ours.mean, expected[0])
    close(ours.cov, expected[1])


@pytest.mark.parametrize(
    "make",
    [
        lambda: ConstantVelocity(accel_mps2=-1.0),
        lambda: ConstantVelocity(accel_mps2=float("nan")),
        lambda: ConstantVelocity(accel_mps2=1.0, dims=4),
        lambda: ConstantVelocity(accel_mps2=1.0, discretisation="other"),
        lambda: Static(dims=1),
        lambda: CoordinatedTurn(accel_mps2=1.0, turn_accel_degps2=-0.1),
    ],
)
def test_a_motion_that_cannot_be_is_refused(make):
    with pytest.raises(UsageError):
        make()


def test_whole_numbers_and_lists_are_numbers_too():
    assert ConstantVelocity(accel_mps2=1).accel_mps2.is_integer()
    np.testing.assert_array_equal(ConstantVelocity(accel_mps2=[1, 2]).accel_mps2, [1.0, 2.0])
