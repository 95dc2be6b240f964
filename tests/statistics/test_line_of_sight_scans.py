"""The line-of-sight mixtures know their errors at every one of 100 scans: acceptance 14.

bordonaro's dynamic scenario, 20,000 truths drawn from the filters' own prior, fixed seed. A bent
posterior spreads its NEES up to 1.4 times as much as chi-square, so the ANEES of a filter that
knows has a standard error of at most 0.007: it leaves 0.88 to 1.05 by chance less than once in 1e9.
"""

import numpy as np
import pytest

from boresight.experiments.posterior import Flight, draw
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar
from oracles.bordonaro import SCANS, SIGMA_R, SPEED, World, anees, tracked

RUNS = 20_000


@pytest.mark.parametrize("components", [3, 5])
@pytest.mark.parametrize("sigma_deg", [5.0, 10.0, 15.0])
def test_the_anees_stays_near_one_at_every_scan(sigma_deg, components):
    sensor = Radar(range_m=SIGMA_R, azimuth_deg=sigma_deg)
    flight = Flight(sensor=sensor, range_m=1e4 * np.sqrt(2), speed_mps=SPEED, scans=SCANS)
    truth, z = draw(flight, runs=RUNS, seed=21)
    world = World(ConstantVelocity(accel_mps2=0.0, dims=2), sensor, truth.states, z)
    found = anees(world, tracked(world, "line-of-sight", components=components))
    assert found.shape == (SCANS,)
    assert found.min() >= 0.88
    assert found.max() <= 1.05
