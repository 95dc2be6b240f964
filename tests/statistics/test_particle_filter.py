"""The particle filter on the paper's bearings: near the bound, and where the bank is.

Fixed seeds; 100 runs, 8,000 particles. The standard error of a ratio to the bound is 5 %, of the
ANEES (four states) 7 %; both filters hear the same bearings, so most of that is common to them.
"""

import numpy as np
import pytest

import boresight as bs
from boresight.experiments.bounds import average_in_covariance, bound_per_trajectory
from boresight.experiments.metrics import anees, rmse
from boresight.experiments.montecarlo import filtered
from boresight.experiments.scenario import lookup
from boresight.experiments.simulate import simulate

RUNS, COUNT, SEED, AT = 100, 8_000, 21, (240, 400, 800)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def heard():
    world = lookup("pradeep")
    truth, plots = simulate(world, runs=RUNS, seed=SEED)
    return world, truth, plots, bound_per_trajectory(truth, plots, world.motion, world.sensor)


@pytest.fixture(scope="module")
def found(heard):
    world, _, plots, _ = heard
    first = np.arctan2(plots.prior.mean[:, 1], plots.prior.mean[:, 0])[:, None]
    cloud = bs.bearing_particles(
        first, world.motion, world.sensor, speed_mps=11.0, count=COUNT, seed=SEED
    )
    return bs.particle_filter(plots.z, world.motion, world.sensor, plots.dt, cloud, seed=SEED)


def ratio(heard, estimate, k):
    _, truth, _, bound = heard
    at = slice(k, k + 1)
    best = average_in_covariance(bound, truth.names, of="position", scans=at)
    return rmse(estimate, truth, of="position", scans=at) / best


@pytest.mark.parametrize("k", AT)
def test_it_is_near_the_bound_and_no_worse_than_the_bank(heard, found, k):
    world, truth, plots, _ = heard
    bank = filtered("rp-ekf", world.motion, world.sensor, plots)
    ours, banks = ratio(heard, found, k), ratio(heard, bank, k)
    says = [anees(each, truth, scans=slice(k, k + 1)).value for each in (found, bank)]
    told = f"RMSE over the bound {ours:.2f}, ANEES {says[0]:.2f}; rp-ekf {banks:.2f}, {says[1]:.2f}"
    print(f"{k} s: {told}")  # noqa: T201 - pytest -s shows the figures, which are asked for
    assert 0.85 < ours < 1.3
    assert ours < 1.1 * banks  # paired: the two differ by 2 %
    assert 0.75 < says[0] < 1.35


def test_its_answer_is_the_banks_but_for_monte_carlo(heard, found):
    """Half a standard deviation is what 8,000 particles leave; the bank has its own error too."""
    world, _, plots, _ = heard
    bank = filtered("rp-ekf", world.motion, world.sensor, plots)
    for k in AT:
        sd = np.sqrt(np.diagonal(bank.cov[:, k], axis1=1, axis2=2))
        apart = (found.mean[:, k] - bank.mean[:, k]) / sd
        assert np.sqrt(np.mean(apart**2)) < 0.5
