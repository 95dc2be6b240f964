"""Bounds against Stone Soup's, and the one averaged in information against its own definition."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest
from stonesoup.metricgenerator.pcrbmetric import PCRBMetric
from stonesoup.models.measurement.nonlinear import (
    Cartesian2DToBearing,
    CartesianToBearingRange,
    CartesianToElevationBearingRange,
)
from stonesoup.models.transition.linear import (
    CombinedLinearGaussianTransitionModel,
    ConstantVelocity,
)
from stonesoup.types.array import CovarianceMatrix, StateVector
from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState
from stonesoup.types.state import GaussianState

import boresight as bs
from boresight.errors import UsageError
from boresight.experiments.bounds import bound_averaged, bound_per_trajectory
from boresight.experiments.scenario import lookup
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.maths import Gaussian
from oracles import textbook

NOW = dt.datetime(2000, 1, 1, tzinfo=dt.UTC)
SCANS, STEP_S, DENSITY = 40, 2.0, 0.7
SITE = np.array([-3000.0, 1500.0, 200.0])
SD = np.radians(0.8)
SENSORS = {
    "range and azimuth": (
        2,
        {"range_m": 25.0, "azimuth_deg": 0.8},
        lambda m: CartesianToBearingRange(
            ndim_state=4, mapping=m, noise_covar=np.diag([SD**2, 25.0**2])
        ),
    ),
    "range, azimuth and elevation": (
        3,
        {"range_m": 25.0, "azimuth_deg": 0.8, "elevation_deg": 0.8},
        lambda m: CartesianToElevationBearingRange(
            ndim_state=6, mapping=m, noise_covar=np.diag([SD**2, SD**2, 25.0**2])
        ),
    ),
    "bearings": (
        2,
        {"azimuth_deg": 0.8},
        lambda m: Cartesian2DToBearing(ndim_state=4, mapping=m, noise_covar=np.diag([SD**2])),
    ),
}


def flight(dims):
    """One trajectory that bends slowly; an uncertain start.

    No coordinate comes near zero: Stone Soup differentiates by steps of 2e-8 of each coordinate,
    and would lose its digits there.
    """
    t = STEP_S * np.arange(SCANS)
    position = [9000 - 40 * t, 4000 + 40 * t + 0.5 * t**2, 5000 + 3 * t][:dims]
    velocity = [-40 + 0 * t, 40 + t, 3 + 0 * t][:dims]
    states = np.stack(position + velocity, axis=-1)[None]
    names = bs.ConstantVelocity(accel_mps2=1.0, dims=dims).names
    cov = np.diag(np.square([400.0] * dims + [30.0] * dims))
    return Truth(t, states, names, states[:, 0]), Gaussian(states[:, 0], cov)


def plots_of(truth, prior, k, gone=()):
    """Only whether a component is there matters to a bound; none is at the start."""
    z = np.zeros((*truth.states.shape[:2], k))
    z[:, [0, *gone]] = np.nan
    return Plots(truth.time_s, z, np.diff(truth.time_s, prepend=0.0)[None], prior)


class Sites(np.ndarray):
    """Columns that stay columns: Stone Soup's models index an offset so, its bound's slices not."""

    def __new__(cls, columns):
        return np.asarray(columns, dtype=float).view(cls)

    def __getitem__(self, item):
        found = super().__getitem__(item)
        return StateVector(found) if np.ndim(found) == 1 else found


def stone_soup(truth, prior, model, sites, irf=1.0):
    """Its bound (scans, n, n), positions before velocities."""
    dims = truth.states.shape[2] // 2
    interleaved = np.arange(2 * dims).reshape(2, dims).T.ravel()  # x, vx, y, vy of ours
    path = GroundTruthPath(
        [
            GroundTruthState(
                x[interleaved][:, None], timestamp=NOW + dt.timedelta(seconds=float(t))
            )
            for t, x in zip(truth.time_s, truth.states[0], strict=True)
        ]
    )
    cov = CovarianceMatrix(prior.cov[np.ix_(interleaved, interleaved)])
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(DENSITY**2)] * dims)
    metric = PCRBMetric(
        prior=GaussianState(StateVector(path[0].state_vector), cov, timestamp=NOW),
        transition_model=motion,
        measurement_model=model(tuple(range(0, 2 * dims, 2))),
        sensor_locations=Sites(np.transpose(sites)[:dims]),
        irf=irf,
    )
    found = PCRBMetric._compute_pcrb_single(
        metric.prior,
        motion,
        metric.measurement_model,
        path,
        metric.sensor_locations,
        irf,
        metric.position_mapping,
        None,
    )["inverse_j"]
    back = np.argsort(interleaved)
    return found[:, back][:, :, back]


def far(ours, expected):
    """Largest difference, in standard deviations of the expected bound."""
    scale = np.sqrt(np.einsum("sii->si", expected))
    return np.max(np.abs(ours - expected) / scale[:, :, None] / scale[:, None, :])


def models(dims, settings, site=SITE):
    motion = bs.ConstantVelocity(accel_mps2=DENSITY, dims=dims, discretisation="continuous")
    return motion, bs.Radar(**settings, pose=bs.Pose(position_m=site))


@pytest.mark.parametrize("name", SENSORS)
def test_both_equal_stone_soup_on_one_trajectory(name):
    dims, settings, model = SENSORS[name]
    truth, prior = flight(dims)
    motion, sensor = models(dims, settings)
    plots = plots_of(truth, prior, len(sensor.names))
    seen = np.arange(SCANS) > 0
    expected = stone_soup(truth, prior, model, [SITE])
    averaged = bound_averaged(truth, prior, motion, sensor, dt=plots.dt, detection=seen)
    assert far(bound_per_trajectory(truth, plots, motion, sensor)[0], expected) < 1e-6
    assert far(averaged, expected) < 1e-6


def test_two_bearing_sensors_equal_stone_soup():
    """Each scan is two of ours with no time between them, seen from two places."""
    dims, settings, model = SENSORS["bearings"]
    truth, prior = flight(dims)
    sites = np.array([SITE, SITE + np.array([5000.0, -4000.0, 0.0])])
    twice = truth._replace(
        time_s=np.repeat(truth.time_s, 2), states=np.repeat(truth.states, 2, axis=1)
    )
    motion, sensor = models(dims, settings, np.tile(sites, (SCANS, 1))[None])
    plots = plots_of(twice, prior, 1, gone=(1,))
    expected = stone_soup(truth, prior, model, sites)
    ours = bound_per_trajectory(twice, plots, motion, sensor)[0, 1::2]
    assert far(ours, expected) < 1e-6
    seen = np.arange(2 * SCANS) > 1
    averaged = bound_averaged(twice, prior, motion, sensor, dt=plots.dt, detection=seen)
    assert far(averaged[1::2], expected) < 1e-6


def test_detection_reduces_information_as_in_stone_soup():
    dims, settings, model = SENSORS["range and azimuth"]
    truth, prior = flight(dims)
    motion, sensor = models(dims, settings)
    plots = plots_of(truth, prior, 2)
    detection = 0.6 * (np.arange(SCANS) > 0)
    ours = bound_averaged(truth, prior, motion, sensor, dt=plots.dt, detection=detection)
    assert far(ours, stone_soup(truth, prior, model, [SITE], irf=0.6)) < 1e-6
    # Averaged over which plots were there, the bound is larger (hernandez2004).
    generator = np.random.default_rng(1)
    many = truth._replace(
        states=np.repeat(truth.states, 500, axis=0), start=np.repeat(truth.start, 500, axis=0)
    )
    drawn = plots_of(many, prior, 2)
    drawn.z[generator.random((500, SCANS)) > 0.6] = np.nan
    each = np.mean(bound_per_trajectory(many, drawn, motion, sensor), axis=0)
    assert np.all(np.einsum("sii->si", each - ours)[2:] > 0.0)


def test_information_is_averaged_over_trajectories():
    """The textbook's recursion, its information matrix the average of the trajectories'."""
    world = replace(
        lookup("kashyap-set-2"),
        motion=bs.ConstantVelocity(accel_mps2=0.5, discretisation="continuous"),
        scans=30,
    )
    truth, _ = simulate(world, runs=50, seed=2)
    ours = bound_averaged(truth, world.prior, world.motion, world.sensor, dt=world.dt)
    R = np.diag(np.square([30.0, np.radians(1.5), np.radians(1.5)]))
    F, Q = white(world.dt_s)
    J = np.linalg.inv(world.prior_cov)
    for k in range(world.scans):
        if k:
            J = np.linalg.inv(F @ np.linalg.inv(J) @ F.T + Q)
        H = np.stack([textbook.polar_jacobian(x) for x in truth.states[:, k]])
        J = J + np.mean(np.swapaxes(H, 1, 2) @ np.linalg.solve(R, H), axis=0)
        assert far(ours[k : k + 1], np.linalg.inv(J)[None]) < 1e-6


def white(step):
    F = np.eye(6)
    F[:3, 3:] = step * np.eye(3)
    block = np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])
    return F, 0.25 * np.kron(block, np.eye(3))


def test_dynamics_are_averaged_too():
    """J' = D22 - D21 (J + D11)^-1 D12 with expectations over trajectories (tichavsky1998, 21)."""
    world = lookup("aditya")
    motion = replace(world.motion, position_noise=0.05, velocity_noise=0.02)
    scattered = replace(world, motion=motion, scans=5, draw=anywhere)
    truth, _ = simulate(scattered, runs=40, seed=3)
    step = np.full((1, 5), world.dt_s)
    ours = bound_averaged(truth, world.prior, motion, world.sensor, dt=step, detection=0.0)
    W, J = np.linalg.inv(motion.noise(world.dt_s)), np.linalg.inv(world.prior_cov)
    before = np.concatenate([truth.start[:, None], truth.states], axis=1)
    for k in range(5):
        F = np.stack([slopes(lambda x: motion.move(x, world.dt_s), x) for x in before[:, k]])
        D11, D12 = np.mean(np.swapaxes(F, 1, 2) @ W @ F, axis=0), -np.mean(F, axis=0).T @ W
        J = W - D12.T @ np.linalg.solve(J + D11, D12)
        assert np.allclose(ours[k], np.linalg.inv(J), rtol=1e-6, atol=1e-9)


def anywhere(normals):
    """States between which the motion differs."""
    return lookup("aditya").initial * (1.0 + 0.3 * normals)


def slopes(f, x, step=1e-5):
    steps = step * np.eye(len(x))
    return np.stack([(f(x + e) - f(x - e)) / (2 * step) for e in steps], axis=1)


def test_no_average_where_noise_cannot_explain_the_difference():
    motion = bs.CoordinatedTurn(accel_mps2=0.5, turn_accel_degps2=0.1)
    world = replace(
        lookup("kashyap-set-2"),
        name="turning",
        motion=motion,
        sensor=bs.Radar(range_m=30.0, azimuth_deg=1.0),
        initial=[9000.0, 3000.0, -100.0, 50.0, 0.05],
        prior_cov=np.diag([100.0**2, 100.0**2, 100.0, 100.0, 1e-4]),
        scans=10,
    )
    truth, _ = simulate(world, runs=5, seed=4)
    with pytest.raises(UsageError, match="no bound averaged in information"):
        bound_averaged(truth, world.prior, motion, world.sensor, dt=world.dt)
