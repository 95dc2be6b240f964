"""The filter that keeps range and angles, where angles are known to 10 degrees: acceptance 10.

Fixed seeds; 1,000 runs of 500 scans. The standard error of the ratio to the bound is 0.007, of the
ANEES 0.0065, and of the range 0.02 m: measured at 1.014, 1.005 and 1.98 m, they lie two, eight and
eleven of these inside their limits. Close passes: 100,000 runs, of which none may be not finite.
"""

import numpy as np
import pytest

from boresight import catalogue
from boresight.experiments.bounds import average_in_covariance, bound_per_trajectory
from boresight.experiments.metrics import anees, anis, diverged, rmse
from boresight.experiments.montecarlo import filtered
from boresight.experiments.scenario import lookup
from boresight.experiments.simulate import simulate
from boresight.filters.recursion import run_recursion
from boresight.filters.start import one_plot
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar

LATE = slice(20, None)


@pytest.fixture(scope="module")
def wide():
    world = lookup("kashyap-10deg")
    truth, plots = simulate(world, runs=1000, seed=2)
    bound = bound_per_trajectory(truth, plots, world.motion, world.sensor)
    return world, truth, plots, bound


def flown(wide, name, **settings):
    world, _, plots, _ = wide
    outputs = ("mean", "cov", "nis", "dof", *(("kept_mean",) if name == "ckf-spherical" else ()))
    return filtered(name, world.motion, world.sensor, plots, settings=settings, outputs=outputs)


@pytest.fixture(scope="module")
def kept(wide):
    return flown(wide, "ckf-spherical")


def ratio(wide, found, of="position"):
    _, truth, _, bound = wide
    best = average_in_covariance(bound, truth.names, of=of, scans=LATE)
    return rmse(found, truth, of=of, scans=LATE) / best


def test_position_is_at_the_bound_and_the_filter_knows(wide, kept):
    _, truth, _, _ = wide
    assert ratio(wide, kept) <= 1.03
    assert ratio(wide, kept, of="velocity") <= 1.03
    assert 0.90 <= anees(kept, truth, scans=LATE).value <= 1.06
    assert anis(kept, scans=LATE).value == pytest.approx(1.0, abs=0.01)
    assert diverged(kept, truth, scans=LATE) == 0.0


def test_its_range_is_sharper_than_the_distance_of_the_mean_it_tells(wide, kept):
    _, truth, _, _ = wide
    distance = np.linalg.norm(truth.states[..., :3], axis=-1)
    error = (kept.kept_mean[..., 0] - distance)[:, LATE]
    assert np.sqrt(np.mean(error**2)) <= 2.2
    told = np.linalg.norm(kept.mean[..., :3], axis=-1) - distance
    assert np.sqrt(np.mean(told[:, LATE] ** 2)) > 3.0  # a mean lies inside the arc


@pytest.mark.parametrize(("name", "most"), [("ukf", 1.08), ("ckf", 1.12)])
def test_cartesian_points_are_near_the_bound_and_too_sure(wide, name, most):
    _, truth, _, _ = wide
    found = flown(wide, name)
    assert 1.03 < ratio(wide, found) <= most
    assert 1.15 < anees(found, truth, scans=LATE).value < 1.8
    assert diverged(found, truth, scans=LATE) == 0.0


def test_regressing_on_the_posterior_loses_runs_beside_the_zenith(wide):
    """Reported, not hidden: 2 runs in 1,000 diverge; without the guard of `sigma.update` 10 do."""
    _, truth, _, _ = wide
    found = flown(wide, "iplf")
    assert 0.0 < diverged(found, truth, scans=LATE) <= 0.005


def passes(runs, dims, sensor, seed, scans=40, dt=2.0):
    """Straight flights that pass at 0.1 m to 2 km: states and plots (runs, scans + 1, ...)."""
    rng = np.random.default_rng(seed)
    along = rng.normal(size=(runs, dims))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    aside = rng.normal(size=(runs, dims))
    aside -= np.sum(aside * along, axis=1, keepdims=True) * along
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    velocity = rng.uniform(30.0, 300.0, (runs, 1)) * along
    nearest = 10 ** rng.uniform(-1.0, 3.3, (runs, 1)) * aside
    time = dt * np.arange(scans + 1) - rng.uniform(0.3, 0.9, (runs, 1)) * dt * scans
    position = nearest[:, None] + time[..., None] * velocity[:, None]
    motion = ConstantVelocity(accel_mps2=0.5, dims=dims)
    states = np.concatenate([position, np.broadcast_to(velocity[:, None], position.shape)], -1)
    parts = sensor.components(motion)
    z = np.stack([c.value(np.moveaxis(states, -1, 0)) for c in parts], axis=-1)
    return motion, states, z + rng.normal(size=z.shape) * [c.sigma for c in parts]


def lost(name, motion, states, z, sensor):
    """Share of runs whose NEES per state averages above 100; raises where one is not finite."""
    recursion = catalogue.lookup(name).recursion(motion, sensor)
    found = run_recursion(recursion, z[:, 1:], 2.0, one_plot(z[:, 0], motion, sensor))
    assert np.isfinite(found.mean).all()
    assert np.isfinite(found.cov).all()
    error = found.mean - states[:, 1:]
    white = np.linalg.solve(found.cov, error[..., None])[..., 0]
    squares = np.sum(error * white, axis=-1).mean(axis=1) / error.shape[-1]
    return np.mean(~(squares < 100.0))


# Of runs, in the plane and in space, at most. Measured with 100,000 at 0.3 degrees, where most are:
# 0.0003 and 0.026, 0.0003 and 0.028, 0.0006 and 0.006, 0.0002 and 0.0025, 0.023 and 0.040 (a range
# is not normal there, see docs/decisions/0005-line-of-sight.md); ekf 0.035 and 0.042, ducm none.
SHARES = {
    "ukf": (0.001, 0.035),
    "ckf": (0.001, 0.04),
    "iplf": (0.0015, 0.01),
    "ckf-spherical": (0.001, 0.005),
    "line-of-sight": (0.03, 0.05),
}


@pytest.mark.parametrize("name", SHARES)
@pytest.mark.parametrize("dims", [2, 3])
def test_close_passes_leave_numbers_finite_and_few_runs_lost(name, dims):
    sensor = Radar(range_m=30.0, azimuth_deg=0.3, elevation_deg=0.3 if dims == 3 else None)
    assert lost(name, *passes(2_000, dims, sensor, seed=1), sensor) <= SHARES[name][dims - 2]


@pytest.mark.slow
@pytest.mark.parametrize("name", SHARES)
@pytest.mark.parametrize("degrees", [0.3, 3.0])
@pytest.mark.parametrize("dims", [2, 3])
def test_a_hundred_thousand_close_passes(name, dims, degrees):
    sensor = Radar(range_m=30.0, azimuth_deg=degrees, elevation_deg=degrees if dims == 3 else None)
    shares = [
        lost(name, *passes(10_000, dims, sensor, seed=(dims, part)), sensor) for part in range(10)
    ]
    assert np.mean(shares) <= SHARES[name][dims - 2]
