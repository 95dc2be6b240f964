"""Of every filter: a sensor that turns and moves sees the track that a fixed one does.

Acceptance 8. The sensor turns about the vertical at every scan, and all that moves moves with its
velocity. The filters' own frame stays where it was, so sigma points have the same axes in both.
"""

from dataclasses import replace

import numpy as np
import pytest

from boresight.filters.recursion import run_recursion
from boresight.maths import Gaussian
from boresight.models.sensors import Pose, Radar
from boresight.testing.worlds import turned
from laws.enrolled import (
    BY_EAR,
    CHIRP,
    CURVED,
    LISTENING,
    PLANAR,
    PLANE,
    POLAR,
    SPACE,
    Entry,
    World,
)

LANES, STEPS, DT = 6, 12, 2.0
ORIGIN, VELOCITY = np.array([9e3, 2e4, -500.0]), np.array([80.0, -35.0, 4.0])
CHIRP3 = replace(POLAR, range_rate_mps=2.0, range_rate_correlation=0.8)
LEVEL = Radar(range_m=30.0, azimuth_deg=0.8)  # in space: measures no elevation
RICH = (World(PLANE, CHIRP), World(SPACE, CHIRP3), World(SPACE, LEVEL))
PLAIN = [
    pytest.param(w, marks=pytest.mark.slow) for w in (World(PLANE, PLANAR), World(SPACE, POLAR))
]
ENTRIES = (*CURVED, Entry("ducm", {"scale_output": True}))


def flown(world, seed=7):
    """Priors of the lanes, and plots (lanes, steps, k) of targets that fly on from their means."""
    rng = np.random.default_rng(seed)
    priors = [world.prior(lane) for lane in range(LANES)]
    start = Gaussian(*(np.stack(part) for part in zip(*priors, strict=True)))
    truth, z, parts = start.mean, [], world.sensor.components(world.motion)
    for _ in range(STEPS):
        z.append([[c.value(x) + c.sigma * rng.normal() for c in parts] for x in truth])
        truth = np.array([world.motion.move(x, DT) for x in truth])
    return start, np.moveaxis(np.array(z), 0, 1)


SAILING = [(e, World(PLANE, LISTENING)) for e in BY_EAR]


@pytest.mark.parametrize(("entry", "world"), SAILING, ids=str)
def test_a_listener_that_turns_and_moves_gives_the_same_track(entry, world):
    test_a_turning_and_moving_sensor_gives_the_same_track(entry, world)


@pytest.mark.parametrize("world", [*RICH, *PLAIN], ids=str)
@pytest.mark.parametrize("entry", ENTRIES, ids=str)
def test_a_turning_and_moving_sensor_gives_the_same_track(entry, world):
    d, dt = world.motion.dims, np.array([[0.0, *[DT] * (STEPS - 1)]])
    start, z = flown(world)
    asked = ("mean", "cov", "loglik")
    fixed = run_recursion(entry.recursion(world), z, dt, start, outputs=asked)
    place = ORIGIN + VELOCITY * np.cumsum(dt)[:, None]
    angle = 0.7 * np.arange(STEPS) ** 1.5  # the filter starts in the frame of the first plot
    pose = Pose(
        position_m=place[None],
        rotation=np.stack([turned(-a) for a in angle])[None],
        velocity_mps=VELOCITY,
    )
    there = World(world.motion, replace(world.sensor, pose=pose))
    seen = z - np.where(np.array(world.sensor.names) == "azimuth_rad", angle[:, None], 0.0)
    shift = np.concatenate([ORIGIN[:d], VELOCITY[:d]])
    along = Gaussian(start.mean + shift, start.cov)
    moving = run_recursion(entry.recursion(there), seen, dt, along, outputs=asked)
    path = np.concatenate([place[:, :d], np.tile(VELOCITY[:d], (STEPS, 1))], axis=1)
    size = np.abs(fixed.mean).max((0, 1))
    np.testing.assert_allclose((moving.mean - path) / size, fixed.mean / size, rtol=0, atol=1e-9)
    sd = np.sqrt(np.einsum("bsii->bsi", fixed.cov))
    scale = sd[..., :, None] * sd[..., None, :]
    np.testing.assert_allclose(moving.cov / scale, fixed.cov / scale, rtol=0, atol=1e-9)
    np.testing.assert_allclose(moving.loglik, fixed.loglik, rtol=1e-7, atol=1e-6)
