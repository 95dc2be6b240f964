"""Who must obey the laws: every filter, motion and component, in the worlds they are made for."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from boresight import catalogue
from boresight.maths.frames import Site
from boresight.models.coordinates import CartesianPlots, PositionSensor
from boresight.models.motion import (
    ConstantAcceleration,
    ConstantVelocity,
    CoordinatedTurn,
    SphericalUnitRate,
    Static,
    WithHeightOffset,
)
from boresight.models.sensors import Bearings, ConicalBearings, Pose, Radar
from boresight.testing import World
from boresight.testing.subjects import Stepping
from boresight.testing.worlds import FLYING, PLANE, SPACE, turned

km = 1e3
SITE = Site(latitude_deg=51.1, longitude_deg=1.2, height_m=45.0)
POSE = FLYING
POLAR = Radar(range_m=30.0, azimuth_deg=0.8, elevation_deg=0.6)
PLANAR = Radar(range_m=30.0, azimuth_deg=0.8)
MOVING = Radar(range_m=30.0, azimuth_deg=0.8, elevation_deg=0.6, range_rate_mps=2.0, pose=POSE)
ALL = Radar(
    range_m=30.0,
    azimuth_deg=0.8,
    elevation_deg=0.6,
    height_m=60.0,
    pressure_altitude_m=40.0,
    range_rate_mps=2.0,
    site=SITE,
)
POINT = PositionSensor(x_m=20.0, y_m=35.0, z_m=50.0)
FLAT = PositionSensor(x_m=20.0, y_m=35.0)
AFLOAT = Pose(
    position_m=np.array([4 * km, -7 * km, 0.0]),
    rotation=turned(0.4),
    velocity_mps=np.array([4.0, -9.0, 0.0]),
)
LISTENING = Bearings(azimuth_deg=0.8)
HEARD = Bearings(azimuth_deg=0.8, pose=AFLOAT)
CONE = ConicalBearings(cone_deg=0.8, pose=AFLOAT)
DOPPLER = Radar(azimuth_deg=0.8, range_rate_mps=2.0, pose=AFLOAT)
CHIRP = Radar(range_m=30.0, azimuth_deg=0.8, range_rate_mps=2.0, range_rate_correlation=-0.7)
OBLONG = CartesianPlots(cov=np.array([[900.0, -500.0], [-500.0, 400.0]]))


@dataclass(frozen=True, eq=False)
class Entry:
    """One filter with settings.

    Attributes:
        curved: it takes angles and ranges.
        by_axes: its sigma points lie along the axes of the state, so only half a turn of the world
            about the vertical turns its answer exactly.
        own_state: what it keeps is curved in the motion's coordinates. So a linear world is none to
            it, and a start is not told bit for bit; what it keeps is.
        straight: it follows straight flight only, and refuses other motions.
        bank: it begins on the direction of a start and not at its range, so that a start is not
            told as it was given; and it has no use for a sensor without an angle, so a linear world
            is none to it either.
    """

    name: str
    settings: dict[str, Any] = field(default_factory=dict)
    curved: bool = True
    by_axes: bool = False
    own_state: bool = False
    straight: bool = False
    bank: bool = False

    def __str__(self):
        return "-".join([self.name, *(str(v).replace(" ", "") for v in self.settings.values())])

    def on(self, world):
        """The filter as the laws see it; skips where it is not made for the world."""
        if self.straight and isinstance(world.motion, CoordinatedTurn):
            pytest.skip("follows straight flight only")
        return Stepping(catalogue.lookup(self.name).with_settings(**self.settings))

    def recursion(self, world):
        """Predict and update in `world`."""
        return self.on(world).recursion(world)

    def update(self, world, mean, cov, z):
        """The formula itself, on floats: Posterior of one target."""
        return self.on(world).update(world, mean, cov, z)


RANGE_FIRST = ("range_m", "azimuth_rad", "elevation_rad")
FILTERS = (
    Entry("kf", curved=False),
    Entry("ekf"),
    Entry("ekf-sequential"),
    Entry("ekf-sequential", {"order": RANGE_FIRST}),
    Entry("iekf", {"iterations": 3}),
    Entry("mekf"),
    Entry("mekf", {"mu": "printed"}),
    Entry("mekf", {"mu": "second order", "order": ("azimuth_rad", "elevation_rad")}),
    Entry("mekf", {"mu": "none", "added_variance": False}),
    Entry("mekf-block"),
    Entry("mekf-block", {"mu": False, "added_variance": False}),
    Entry("mgekf"),
    Entry("mgekf", {"gain": "small angle", "widest_deg": 30.0}),
    Entry("cmkf"),
    Entry("cmkf-d"),
    Entry("cmkf-d", {"conversion": "cmkf-d-t"}),
    Entry("ucm"),
    Entry("mucm"),
    Entry("mmse"),
    Entry("ducm"),
    Entry("ducm", {"conditioning": "previous measurement"}),
    Entry("range-rate"),
    Entry("ukf", by_axes=True),
    Entry("ukf", {"alpha": 0.5, "beta": 2.0, "kappa": 1.0}, by_axes=True),
    Entry("ckf", by_axes=True),
    Entry("iplf", by_axes=True),
    Entry("iplf", {"iterations": 3}, by_axes=True),
    Entry("ckf-spherical", by_axes=True, own_state=True),
    Entry("line-of-sight", own_state=True, straight=True),
    Entry("line-of-sight", {"told": "unbiased"}, own_state=True, straight=True),
)
CURVED = tuple(entry for entry in FILTERS if entry.curved)
BY_EAR = (
    Entry("modified-polar", own_state=True, straight=True),
    Entry("modified-polar", {"predicted": "first order"}, own_state=True, straight=True),
    Entry("rp-ekf", bank=True),
    Entry("rp-ekf", {"cells": 3, "prune": 0.0}, bank=True),
    Entry("rp-mgekf", bank=True),
    Entry("rp-ukf", by_axes=True, bank=True),
    Entry("rp-ckf", by_axes=True, bank=True),
    # Six cells on each side of a cone are more than a kernel holds.
    Entry("rp-modified-polar", {"cells": 3}, own_state=True, straight=True, bank=True),
)

LINEAR_WORLDS = (World(SPACE, POINT), World(PLANE, FLAT), World(PLANE, OBLONG))
POLAR_WORLDS = (
    World(SPACE, POLAR),
    World(PLANE, PLANAR),
    World(SPACE, MOVING),
    World(CoordinatedTurn(accel_mps2=1.0, turn_accel_degps2=0.3), PLANAR),
    World(WithHeightOffset(inner=SPACE, drift_m_per_sqrt_s=2.0), ALL),
    World(PLANE, CHIRP),
)
BEARING_WORLDS = (World(PLANE, HEARD), World(PLANE, CONE), World(PLANE, DOPPLER))
MOTIONS = (
    PLANE,
    SPACE,
    ConstantVelocity(accel_mps2=1.5, dims=3, discretisation="continuous"),
    ConstantVelocity(accel_mps2=1.5, dims=2, discretisation="printed"),
    ConstantAcceleration(jerk_mps3=0.7, dims=3),
    ConstantAcceleration(jerk_mps3=0.7, dims=2, discretisation="discrete"),
    CoordinatedTurn(accel_mps2=1.0, turn_accel_degps2=0.3),
    Static(drift_m_per_sqrt_s=3.0, dims=3),
    Static(drift_m_per_sqrt_s=3.0, dims=2),
    WithHeightOffset(inner=SPACE, drift_m_per_sqrt_s=2.0),
    SphericalUnitRate(position_noise=0.1, velocity_noise=0.2),
)
