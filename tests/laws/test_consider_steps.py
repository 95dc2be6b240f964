"""One step of a consider filter against the same step with target and errors side by side."""

import numpy as np
import pytest

from boresight import catalogue
from boresight.filters.consider import Consider
from boresight.models.considered import Considered, ConsideredRadar
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar

TERMS = ("range_bias_m", "azimuth_bias_deg", "time_bias_s")
RADAR = Radar(range_m=30.0, azimuth_deg=0.1)
LEVEL = ConstantVelocity(accel_mps2=0.5, dims=2)
MOTION = Considered(inner=LEVEL, terms=TERMS)
MEAN = np.array([12e3, -9e3, 160.0, 90.0])


@pytest.fixture
def known():
    """The filter, its radar, and a joint covariance of target and errors."""
    rng = np.random.default_rng(1)
    spread = np.array([80.0, 120.0, 9.0, 7.0, 40.0, 0.3, 0.5])
    root = 0.4 * np.tril(rng.normal(size=(7, 7)), -1) + np.eye(7)
    joint = (root @ root.T) * np.outer(spread, spread)
    inner = catalogue.lookup("ekf").recursion(LEVEL, RADAR).method
    return Consider(inner=inner), ConsideredRadar(radar=RADAR, cov=joint[4:, 4:]), joint


@pytest.mark.parametrize("dt", [0.5, 4.0, 30.0])
def test_errors_that_bend_the_path_are_predicted_as_beside_the_target(known, dt):
    """x moves by F and b stays; the radar sees x + M b, and M changes with the place."""
    method, sensor, joint = known
    F = np.block([[np.eye(2), dt * np.eye(2)], [np.zeros((2, 2)), np.eye(2)]])
    whole = np.block([[F, np.zeros((4, 3))], [np.zeros((3, 4)), np.eye(3)]])
    Q = np.zeros((7, 7))
    Q[:4, :4] = LEVEL.noise(dt)
    before = sensor.displaced(MEAN, MOTION)
    after = sensor.displaced(F @ MEAN, MOTION)

    def as_seen(cov, M):
        T = np.block([[np.eye(4), M], [np.zeros((3, 4)), np.eye(3)]])
        return T @ cov @ T.T

    seen = as_seen(joint, before)
    state = {"mean": MEAN, "cov": seen[:4, :4], "shared": seen[:4, 4:]}
    found = method.predict(state, MOTION, sensor, dt)
    expected = as_seen(whole @ joint @ whole.T + Q, after)
    np.testing.assert_allclose(found["mean"], F @ MEAN, rtol=1e-12)
    scale = np.sqrt(np.diag(expected))
    off = (found["cov"] - expected[:4, :4]) / np.outer(scale[:4], scale[:4])
    assert np.abs(off).max() < 1e-9
    off = (found["shared"] - expected[:4, 4:]) / np.outer(scale[:4], scale[4:])
    assert np.abs(off).max() < 1e-9


def test_what_is_told_has_the_variance_of_a_speed_times_a_time_bias(known):
    """Both uncertain and independent: the variance of their product comes on top."""
    method, sensor, _ = known
    spread = np.array([80.0, 120.0, 9.0, 7.0])
    M = sensor.displaced(MEAN, MOTION)
    shared = M @ sensor.cov  # of errors that the target knows nothing of
    state = {"mean": MEAN, "cov": np.diag(spread**2) + M @ shared.T, "shared": shared}
    told = method.output(state, MOTION, sensor)
    product = sensor.cov[2, 2] * np.diag([81.0, 49.0, 0.0, 0.0])
    np.testing.assert_allclose(told.cov[:4, :4], np.diag(spread**2) + product, atol=1e-6)
    np.testing.assert_allclose(told.mean, [*MEAN, 0.0, 0.0, 0.0])
