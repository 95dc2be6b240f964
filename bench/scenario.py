"""What all benches filter: one straight flight, many runs of radar noise, all from one seed."""

from typing import Any, NamedTuple

import numpy as np

from boresight import ConstantVelocity, Radar
from boresight.maths import Gaussian

Array = Any
DT = 1.0  # s
PLANAR = ConstantVelocity(accel_mps2=0.5, dims=2)
SPATIAL = ConstantVelocity(accel_mps2=0.5, dims=3)
RADAR = Radar(range_m=30.0, azimuth_deg=0.5, elevation_deg=0.5)
FLAT = Radar(range_m=30.0, azimuth_deg=0.5)
SIGMA = np.array([30.0, np.radians(0.5), np.radians(0.5)])  # m, rad, rad


class Scenario(NamedTuple):
    """Plots and where the filter starts.

    Attributes:
        z: (runs, steps, 3) range, azimuth, elevation; m and rad.
        start: mean (6,), cov (6, 6).
    """

    z: Array
    start: Gaussian


def straight(runs: int, steps: int) -> Scenario:
    """Plots of a target that climbs away from the radar at 112 m/s; azimuth never wraps."""
    mean = np.array([10e3, 5e3, 3e3, 100.0, 50.0, 5.0])
    t = DT * np.arange(1, steps + 1)[:, None]
    x, y, z = (mean[:3] + t * mean[3:]).T
    polar = [np.sqrt(x * x + y * y + z * z), np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))]
    noise = np.random.default_rng(1).standard_normal((runs, steps, 3)) * SIGMA
    cov = np.diag([300.0**2] * 3 + [30.0**2] * 3)
    return Scenario(np.stack(polar, axis=-1) + noise, Gaussian(mean, cov))


def planar(given: Scenario) -> Scenario:
    """The same without height: range and azimuth, four states."""
    keep = np.array([0, 1, 3, 4])
    mean, cov = given.start
    return Scenario(given.z[..., :2].copy(), Gaussian(mean[keep], cov[np.ix_(keep, keep)]))
