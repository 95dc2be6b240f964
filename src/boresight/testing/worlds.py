"""Worlds that filters are judged in: how targets move, what sees them, and states that make sense.

Everything drawn is decided by a seed, so that a broken law can be broken again.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from boresight.models.coordinates import PositionSensor
from boresight.models.motion import ConstantVelocity, Motion
from boresight.models.sensors import Bearings, Pose, Radar, Sensor

Array = Any
km = 1e3
_SPREAD = {"m": 200.0, "mps": 80.0, "mps2": 3.0, "radps": 0.02, "km": 1.0}


class Case(NamedTuple):
    """What is known of a target, and a plot of it.

    Attributes:
        mean: (n,).
        cov: (n, n).
        z: (k,), SI units and radians.
    """

    mean: Array
    cov: Array
    z: Array


@dataclass(frozen=True, eq=False)
class World:
    """A motion, a sensor, and states that make sense in it.

    Attributes:
        motion: how targets move.
        sensor: what sees them.
        name: what messages call it.
    """

    motion: Motion
    sensor: Sensor
    name: str = ""

    def __str__(self) -> str:
        seen = "-".join(name.split("_")[0] for name in self.sensor.names)
        return self.name or f"{type(self.motion).__name__}{self.motion.dims}-{seen}"

    def prior(self, seed: int) -> tuple[Array, Array]:
        """A mean some 5 to 60 km out and a full covariance (n, n), condition about 1e4."""
        rng = np.random.default_rng(seed)
        dims, n = self.motion.dims, len(self.motion.names)
        spread = np.array([_SPREAD[name.rsplit("_", 1)[-1]] for name in self.motion.names])
        spread[:dims] = 200.0
        root = np.tril(rng.uniform(-0.5, 0.5, (n, n)), -1) + np.diag(rng.uniform(0.5, 1.5, n))
        root *= spread[:, None]
        mean = rng.normal(size=n) * spread
        azimuth, ground = rng.uniform(-np.pi, np.pi), rng.uniform(5 * km, 60 * km)
        mean[:2] = ground * np.cos(azimuth), ground * np.sin(azimuth)
        if dims == 3:
            mean[2] = rng.uniform(1 * km, 12 * km)
        return mean, root @ root.T

    def plot(self, mean: Array, seed: Any, sigmas: float = 1.0) -> Array:
        """What the sensor would measure of `mean`, with noise."""
        rng = np.random.default_rng((seed, 1))
        parts = self.sensor.components(self.motion)
        return np.array([c.value(mean) + sigmas * c.sigma * rng.normal() for c in parts])

    def case(self, seed: int) -> Case:
        """A prior, and a plot of a target one standard deviation off."""
        mean, cov = self.prior(seed)
        return Case(mean, cov, self.plot(mean + np.linalg.cholesky(cov)[:, 0], seed))


def turned(angle: float, dims: int = 3) -> Array:
    """Rotation about z by `angle` rad, (dims, dims)."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.eye(3)
    R[:2, :2] = [[c, -s], [s, c]]
    return R[:dims, :dims]


def tilted(a: float, b: float) -> Array:
    """A rotation of no particular kind, (3, 3)."""
    c, s = np.cos(b), np.sin(b)
    return turned(a) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ turned(b - a)


PLANE = ConstantVelocity(accel_mps2=2.0, dims=2)
SPACE = ConstantVelocity(accel_mps2=2.0, dims=3)
FLYING = Pose(
    position_m=np.array([4 * km, -7 * km, 300.0]),
    rotation=tilted(0.4, 0.2),
    velocity_mps=np.array([120.0, -60.0, 3.0]),
)
SAILING = Pose(
    position_m=np.array([4 * km, -7 * km, 0.0]),
    rotation=turned(0.4),
    velocity_mps=np.array([4.0, -9.0, 0.0]),
)
LINEAR = (
    World(SPACE, PositionSensor(x_m=20.0, y_m=35.0, z_m=50.0), "positions in space"),
    World(PLANE, PositionSensor(x_m=20.0, y_m=35.0), "positions in the plane"),
)
UPRIGHT = (
    World(SPACE, Radar(range_m=30.0, azimuth_deg=0.8, elevation_deg=0.6), "radar in space"),
    World(PLANE, Radar(range_m=30.0, azimuth_deg=0.8), "radar in the plane"),
)
POSED = (
    World(
        SPACE,
        Radar(range_m=30.0, azimuth_deg=0.8, elevation_deg=0.6, range_rate_mps=2.0, pose=FLYING),
        "flying Doppler radar",
    ),
    World(PLANE, Bearings(azimuth_deg=0.8, pose=SAILING), "bearings from a ship"),
)
CURVED = (*UPRIGHT, *POSED)
WORLDS = (*LINEAR, *CURVED)
