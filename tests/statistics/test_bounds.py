"""The Cramer-Rao recursion in covariance form against the textbook's information form."""

from dataclasses import replace

import numpy as np
import pytest

from boresight.experiments.bounds import average_in_covariance, bound_per_trajectory
from boresight.experiments.metrics import rmse
from boresight.experiments.montecarlo import filtered
from boresight.experiments.scenario import lookup
from boresight.experiments.simulate import simulate
from boresight.models.coordinates import PositionSensor
from boresight.models.motion import ConstantVelocity, SphericalUnitRate
from oracles import textbook

ACCEL_DENSITY = 0.5


def white_noise_acceleration(dt):
    """F and Q of continuous white acceleration: Q has an inverse."""
    F = np.eye(6)
    F[:3, 3:] = dt * np.eye(3)
    block = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    return F, ACCEL_DENSITY**2 * np.kron(block, np.eye(3))


def test_equals_the_information_form_where_that_exists():
    world = replace(
        lookup("kashyap-set-2"),
        motion=ConstantVelocity(accel_mps2=ACCEL_DENSITY, discretisation="continuous"),
        scans=60,
    )
    truth, plots = simulate(world, runs=4, seed=1)
    ours = bound_per_trajectory(truth, plots, world.motion, world.sensor)
    R = np.diag(np.square([30.0, np.radians(1.5), np.radians(1.5)]))
    F, Q = white_noise_acceleration(world.dt_s)
    for states, bound in zip(truth.states, ours, strict=True):
        expected = textbook.information_bound(states, world.prior_cov, F, Q, R)
        scale = np.sqrt(np.einsum("sii->si", expected))
        difference = np.abs(bound - expected) / scale[:, :, None] / scale[:, None, :]
        assert np.max(difference) < 1e-6  # numeric gradients


def test_a_linear_filter_reaches_it_exactly_with_singular_noise():
    world = replace(
        lookup("kashyap-set-2"), sensor=PositionSensor(x_m=10.0, y_m=20.0, z_m=30.0), scans=100
    )
    truth, plots = simulate(world, runs=2000, seed=2)
    bound = bound_per_trajectory(truth, plots, world.motion, world.sensor)
    found = filtered("kf", world.motion, world.sensor, plots)
    assert np.allclose(found.cov, bound, rtol=1e-9, atol=1e-12)
    late = slice(20, None)
    ratio = rmse(found, truth, scans=late) / average_in_covariance(bound, truth.names, scans=late)
    assert ratio == pytest.approx(1.0, abs=0.02)


def test_what_was_not_measured_tells_nothing():
    world = replace(lookup("kashyap-set-2"), scans=30)
    truth, plots = simulate(world, runs=3, seed=3)
    blind = plots._replace(z=np.full_like(plots.z, np.nan))
    bound = bound_per_trajectory(truth, blind, world.motion, world.sensor)
    F, Q = textbook.white_acceleration(3, 1.0, 0.25)
    expected = world.prior_cov
    for k in range(world.scans):
        expected = F @ expected @ F.T + Q if k else expected
        assert np.allclose(bound[:, k], expected, rtol=1e-9)


def test_a_motion_that_is_not_linear_is_linearised_where_the_target_was():
    """One long step without a plot: F P F' + Q, F from central differences at the start."""
    motion = SphericalUnitRate(position_noise=0.01, velocity_noise=0.01)
    world = replace(lookup("aditya"), motion=motion, dt_s=0.3, scans=2)
    truth, plots = simulate(world, runs=2, seed=4)
    blind = plots._replace(z=np.full_like(plots.z, np.nan))
    bound = bound_per_trajectory(truth, blind, motion, world.sensor)
    expected = np.broadcast_to(world.prior_cov, (2, 6, 6))
    for k, before in enumerate((truth.start, truth.states[:, 0])):
        F = np.stack([_slopes(lambda x: motion.move(x, 0.3), x) for x in before])
        expected = F @ expected @ np.swapaxes(F, 1, 2) + motion.noise(0.3)
        assert np.allclose(bound[:, k], expected, rtol=1e-6, atol=1e-9)


def _slopes(f, x, step=1e-5):
    steps = step * np.eye(len(x))
    return np.stack([(f(x + e) - f(x - e)) / (2 * step) for e in steps], axis=1)
