"""Errata A1 to A8: what aditya prints fails, what the package does passes."""

from dataclasses import replace

import numpy as np
import pytest

from boresight.experiments.metrics import anis, percent_fit_error, rmse
from boresight.experiments.montecarlo import filtered
from boresight.experiments.papers.aditya_study import observability
from boresight.experiments.scenario import lookup, paper
from boresight.experiments.simulate import simulate
from boresight.filters import mekf
from boresight.filters.kalman import predict
from boresight.filters.recursion import Estimate, Recursion, run_recursion
from boresight.filters.steps import Updating
from boresight.maths import Gaussian, jacobian
from boresight.models.motion import SphericalUnitRate, Static
from boresight.models.sensors import Radar
from oracles import printed

PLACE = np.array([15.0, 12.0, 5.0])
MOTION = SphericalUnitRate(position_noise=0.01, velocity_noise=0.01)


def at_unit_rates(t):
    """Cartesian position after t seconds if range, azimuth and elevation all grow at rate 1."""
    x, y, z = PLACE
    r, az, el = np.linalg.norm(PLACE) + t, np.arctan2(y, x) + t, np.arctan2(z, np.hypot(x, y)) + t
    return r * np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])


def rates(state):
    """Right-hand sides of the package's motion: what one second of Euler adds."""
    return MOTION.move(state, 1.0) - state


STATE = np.array([*PLACE, -60.0, -70.0, -40.0])


def test_a1_rate_of_y():
    numeric = (at_unit_rates(1e-5) - at_unit_rates(-1e-5))[1] / 2e-5
    assert rates(STATE)[1] == pytest.approx(numeric, abs=1e-8)
    assert abs(printed.aditya_y_rate(PLACE, 1.0, 1.0, 1.0) - numeric) > 0.1


def test_a2_positions_are_integrated_not_iterated():
    state, iterated, steps, dt = STATE, STATE, 11, 1e-4
    for _ in range(steps):
        state = MOTION.move(state, dt)
        iterated = printed.aditya_map(iterated)
    exact = at_unit_rates(steps * dt)
    assert np.linalg.norm(state[:3] - exact) < 1e-4  # km: Euler's error, of order dt
    halved = STATE
    for _ in range(2 * steps):
        halved = MOTION.move(halved, dt / 2)
    left = np.linalg.norm(state[:3] - exact) / np.linalg.norm(halved[:3] - exact)
    assert left == pytest.approx(2.0, rel=0.01)  # a method of first order
    assert np.linalg.norm(iterated[:3]) > 200.0


def test_a3_rate_of_vy():
    h = 1e-4
    numeric = (at_unit_rates(h) - 2 * at_unit_rates(0.0) + at_unit_rates(-h)) / h**2
    assert rates(STATE)[3:] == pytest.approx(numeric, abs=1e-4)
    wrong = printed.aditya_map(STATE)[3:]
    assert wrong[[0, 2]] == pytest.approx(numeric[[0, 2]], abs=1e-4)
    assert abs(wrong[1] - numeric[1]) > 10.0


def test_a4_artificial_mean_is_half_of_what_is_printed():
    """r = 1000, 30 m across both ways, angles to 0.1 rad; standard error 0.03 m."""
    draws, noise, r = 400_000, 0.1, 1000.0
    generator = np.random.default_rng(4)
    across = 30.0 * generator.standard_normal((draws, 2))
    ground = np.hypot(r, across[:, 0])
    z = np.stack(
        [
            np.hypot(ground, across[:, 1]),
            np.arctan2(across[:, 0], r) + noise * generator.standard_normal(draws),
            np.arctan2(across[:, 1], ground) + noise * generator.standard_normal(draws),
        ],
        axis=-1,
    )
    radar = Radar(range_m=1.0, azimuth_deg=np.degrees(noise), elevation_deg=np.degrees(noise))
    prior = Gaussian(np.array([r, 0.0, 0.0]), np.diag([1e-6, 900.0, 900.0]))
    recursion = Recursion(Updating(formula=mekf.update_block), Static(dims=3), radar)
    found = run_recursion(recursion, z[:, None], 0.0, prior, outputs=("innovation",))
    residual = found.innovation[:, 0, 0]
    longer = np.mean(z[:, 0]) - r
    error = np.std(residual) / np.sqrt(draws)
    assert error < 0.04
    assert longer == pytest.approx(0.9, abs=0.01)
    assert abs(np.mean(residual)) < 5 * error
    wrong = printed.aditya_mu(r, z[:, 1], z[:, 2], noise, noise)
    assert np.mean(wrong) - longer > 0.9 - 5 * error


def test_a4_absolute_angles_put_the_target_kilometres_away():
    """(17) read literally: the squares of the measured angles, not of the innovations."""
    world = lookup("aditya")
    truth, plots = simulate(world, runs=40, seed=4)
    literal = _literal_filter(world, plots)
    right = filtered("mekf-block", world.motion, world.sensor, plots)
    assert rmse(right, truth) < 0.2
    assert rmse(Estimate({"mean": literal}, right.final), truth) > 1.0


def _literal_filter(world, plots):
    """aditya's Table 1 with (17) as printed; the prediction is the corrected one (A5)."""
    sigmas = [c.sigma for c in world.sensor.components(world.motion)]
    r_noise, sa, se = sigmas
    means = []
    for z in plots.z:
        mean, cov, path = plots.prior.mean, plots.prior.cov, []
        for plot in z:
            mean, cov = predict(Gaussian(mean, cov), world.motion, world.dt_s)
            x, y, height = mean[:3]
            ground = np.hypot(x, y)
            r = np.hypot(ground, height)
            H = np.zeros((3, 6))
            H[0, :3] = mean[:3] / r
            H[1, :2] = np.array([-y, x]) / ground**2
            H[2, :3] = np.array([-x * height / ground, -y * height / ground, ground]) / r**2
            nu = plot - np.array([r, np.arctan2(y, x), np.arctan2(height, ground)])
            nu[0] -= printed.aditya_mu(r, plot[1], plot[2], sa, se)
            R = np.diag([printed.range_variance(r, r_noise, sa, se), sa**2, se**2])
            K = cov @ H.T @ np.linalg.inv(H @ cov @ H.T + R)
            mean, cov = mean + K @ nu, (np.eye(6) - K @ H) @ cov
            path.append(mean)
        means.append(path)
    return np.array(means)


def test_a5_printed_prediction_is_no_covariance():
    world = lookup("aditya")
    Q = world.motion.noise(world.dt_s)
    _, A = jacobian(rates, world.initial)
    as_printed = printed.aditya_predict(A, world.prior_cov, Q)
    assert np.linalg.eigvalsh(as_printed)[0] < -0.1
    right = predict(world.prior, world.motion, world.dt_s).cov
    assert np.linalg.eigvalsh(right)[0] > 0.04


def test_a5_corrected_prediction_is_the_covariance_of_what_happens():
    """Against 200,000 draws moved one long step; standard error of a variance 0.3 %."""
    draws, dt = 200_000, 0.05
    prior_cov = 1e-4 * np.eye(6)
    generator = np.random.default_rng(5)
    starts = STATE + 1e-2 * generator.standard_normal((draws, 6))
    moved = _vectorised_move(starts, dt) + 0.01 * generator.standard_normal((draws, 6))
    true = np.cov(moved.T)
    right = predict(Gaussian(STATE, prior_cov), MOTION, dt).cov
    scale = np.sqrt(np.outer(np.diag(true), np.diag(true)))
    assert np.max(np.abs(right - true) / scale) < 0.012  # four standard errors
    _, A = jacobian(rates, STATE)
    wrong = printed.aditya_predict(A, prior_cov, MOTION.noise(dt))
    assert np.max(np.abs(wrong - true) / scale) > 0.1


def _vectorised_move(states, dt):
    right = printed.aditya_map(states.T)
    x, y, z = states[:, :3].T
    right[4] -= 4 * x * z / np.hypot(x, y)  # A3
    return states + dt * right.T


def test_a6_velocities_leave_no_trace_in_the_plots():
    world = lookup("aditya")
    faster = replace(world, initial=world.initial + np.repeat([0.0, 100.0], 3))
    (slow_truth, slow), (fast_truth, fast) = (simulate(w, runs=5, seed=6) for w in (world, faster))
    assert np.array_equal(slow.z, fast.z)
    assert np.min(np.abs(fast_truth.states - slow_truth.states)[..., 3:]) > 99.0
    O = observability(world)
    assert np.linalg.matrix_rank(O) == 3
    assert np.all(O[:, 3:] == 0.0)


def test_a6_a_filter_started_wrong_in_velocity_stays_wrong():
    world = lookup("aditya")
    truth, plots = simulate(world, runs=20, seed=7)
    wrong = plots.prior.mean + np.repeat([0.0, 10.0], 3)
    for name in ("ekf", "mekf-block"):
        found = filtered(
            name, world.motion, world.sensor, plots._replace(prior=Gaussian(wrong, plots.prior.cov))
        )
        error = (found.mean - truth.states)[:, -1, 3:]
        assert np.all(np.abs(error - 10.0) < 1.0)


def test_a7_printed_r_is_not_that_of_the_printed_sigmas():
    """NIS per component, 400 runs of 80 scans: 96,000 degrees of freedom."""
    world, other = lookup("aditya"), lookup("aditya-r-as-printed")
    _, plots = simulate(world, runs=400, seed=8)
    late = slice(20, None)
    right = anis(filtered("ekf", world.motion, world.sensor, plots), scans=late)
    wrong = anis(filtered("ekf", world.motion, other.sensor, plots), scans=late)
    assert right.value == pytest.approx(1.0, abs=0.03)
    assert wrong.value > 3.0
    for name in ("ekf", "mekf-block"):
        _, plots_r = simulate(other, runs=400, seed=8)
        agree = anis(filtered(name, other.motion, other.sensor, plots_r), scans=late)
        assert agree.value == pytest.approx(1.0, abs=0.03)


def test_a8_percentages_are_errors_times_a_hundred():
    table = paper("aditya")
    column, stated = table["table3"]["mekf"], table["claims"]["AD-C2"]["percent"]
    smallest, largest = 100 * min(column.values()), 100 * max(column.values())
    assert round(smallest, 2) == 0.74 != stated[0]
    assert round(largest, 2) == stated[1]


def test_a8_a_percent_fit_error_does_not_depend_on_the_unit():
    world = lookup("aditya")
    truth, plots = simulate(world, runs=5, seed=9)
    found = filtered("mekf-block", world.motion, world.sensor, plots)
    metres = truth._replace(states=1e3 * truth.states)
    in_metres = Estimate({"mean": 1e3 * found.mean}, found.final)
    for name, values in percent_fit_error(found, truth).items():
        assert percent_fit_error(in_metres, metres)[name] == pytest.approx(values, rel=1e-9)
    assert rmse(in_metres, metres) == pytest.approx(1e3 * rmse(found, truth))
