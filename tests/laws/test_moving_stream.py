"""A stream whose sensor moves: the pose and the noise of a call are those of its plot, no other's.

The reference is the same recursion over the whole recording, its sensor's numbers given for every
step at once.
"""

from dataclasses import replace

import numpy as np
import pytest

import boresight as bs
from boresight.errors import UsageError
from boresight.filters.recursion import run_recursion
from boresight.filters.stream import Stream
from boresight.maths import Gaussian
from boresight.testing.worlds import turned
from laws.enrolled import (
    BEARING_WORLDS,
    BY_EAR,
    CURVED,
    HEARD,
    PLANE,
    POSE,
    World,
)

LANES, STEPS, DT = 5, 6, 2.0
BANK = next(entry for entry in BY_EAR if entry.name == "rp-ekf")
OUTPUTS = ("mean", "cov", "nis", "dof", "loglik", "status")
PAIRS = [
    *((entry, World(PLANE, HEARD)) for entry in (*BY_EAR, *CURVED[:4])),
    *((entry, world) for entry in (BY_EAR[0], BANK) for world in BEARING_WORLDS[1:]),
]


def sailing(world):
    """One sensor for each step, and the same as one sensor whose numbers change with the steps."""
    rng = np.random.default_rng(5)
    place = POSE.position_m + np.cumsum(rng.normal(0.0, 300.0, (STEPS, 3)), axis=0)
    turn = np.stack([turned(angle) for angle in rng.uniform(0.0, 0.5, STEPS)])
    speed = rng.normal(0.0, 5.0, (STEPS, 3))
    sigma = rng.uniform(0.3, 3.0, STEPS)
    angle = "cone_deg" if world.sensor.cone_deg is not None else "azimuth_deg"
    each = [
        replace(
            world.sensor,
            pose=bs.Pose(position_m=place[t], rotation=turn[t], velocity_mps=speed[t]),
            **{angle: sigma[t]},
        )
        for t in range(STEPS)
    ]
    pose = bs.Pose(position_m=place[None], rotation=turn[None], velocity_mps=speed[None])
    return each, replace(world.sensor, pose=pose, **{angle: sigma[None]})


def heard(world, each, seed=3):
    priors = [world.prior(lane) for lane in range(LANES)]
    start = Gaussian(*(np.stack(part) for part in zip(*priors, strict=True)))
    rng = np.random.default_rng(seed)
    z = [
        [
            [c.value(m) + c.sigma * rng.normal() for c in now.components(world.motion)]
            for now in each
        ]
        for m in start.mean
    ]
    z = np.array(z)
    z[1, 2] = np.nan
    return start, z


def same(ours, theirs, entry):
    """To the bit; but a long kernel fuses other products where its inputs change by the step."""
    if entry.by_axes:
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)
    else:
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(("entry", "world"), PAIRS, ids=str)
def test_a_sensor_that_moves_live_is_the_one_that_moves_in_a_batch(entry, world):
    each, along = sailing(world)
    start, z = heard(world, each)
    there = World(world.motion, along)
    batch = run_recursion(entry.recursion(there), z, DT, start, outputs=OUTPUTS)
    recursion = entry.recursion(World(world.motion, world.sensor))
    alone, together = Stream(recursion), Stream(recursion, LANES)
    one = alone.start(Gaussian(start.mean[3], start.cov[3]), sensor=each[0])
    every = together.start(start, sensor=each[0])
    for t, now in enumerate(each):
        one = alone(one, z[3, t], DT, sensor=now)
        every = together(every, z[:, t], DT, sensor=now)
        for name in OUTPUTS:
            same(getattr(one, name), batch.others[name][3, t], entry)
            same(getattr(every, name), batch.others[name][:, t], entry)
            np.testing.assert_array_equal(getattr(one, name), getattr(every, name)[3])


def test_a_call_leaves_nothing_behind():
    world = World(PLANE, HEARD)
    each, _ = sailing(world)
    start, z = heard(world, each)
    step = Stream(BANK.recursion(world))
    begun = step.start(Gaussian(start.mean[0], start.cov[0]))
    before = step(begun, z[0, 0], DT)
    elsewhere = step(begun, z[0, 0], DT, sensor=each[1])
    after = step(begun, z[0, 0], DT)
    np.testing.assert_array_equal(after.mean, before.mean)
    np.testing.assert_array_equal(after.cov, before.cov)
    assert not np.array_equal(elsewhere.mean, before.mean)


def test_each_target_may_have_a_sensor_of_its_own_that_moves():
    ekf = next(entry for entry in CURVED if entry.name == "ekf")
    place = np.array([[0.0, 0.0, 0.0], [500.0, 0.0, 0.0]])
    prior = Gaussian(*World(PLANE, HEARD).prior(2))
    plots = np.array([[0.3], [0.4]])
    by_target = World(PLANE, bs.Bearings(azimuth_deg=1.0, pose=bs.Pose(position_m=place)))
    step = Stream(ekf.recursion(by_target), 2)
    state = step.start(prior)
    now = bs.Bearings(azimuth_deg=2.0, pose=bs.Pose(position_m=place + 50.0))
    at_one_place = bs.Bearings(azimuth_deg=2.0, pose=bs.Pose(position_m=place[1] + 50.0))
    apart = step(state, plots, DT, sensor=now)
    together = step(state, plots, DT, sensor=at_one_place)  # one pose for all will do
    for lane, p in enumerate(place):
        head = bs.Bearings(azimuth_deg=2.0, pose=bs.Pose(position_m=p + 50.0))
        one = Stream(ekf.recursion(World(PLANE, head)))
        alone = one(one.start(prior), plots[lane], DT)
        np.testing.assert_array_equal(apart.mean[lane], alone.mean)
        np.testing.assert_array_equal(apart.cov[lane], alone.cov)
    np.testing.assert_array_equal(together.mean[1], apart.mean[1])
    assert not np.array_equal(together.mean[0], apart.mean[0])


def test_from_the_first_bearing_on_the_verbs_agree():
    """Own ship turns; its pose comes with each bearing, the first one included."""
    t = np.arange(60.0)
    place = np.stack([40.0 * np.sin(t / 20.0), 5.0 * t, 0.0 * t], axis=-1)
    z = np.arctan2(3000.0 - 4.0 * t - place[:, 1], 4000.0 + 3.0 * t - place[:, 0])[:, None]
    motion = bs.ConstantVelocity(accel_mps2=0.0, dims=2)
    along = bs.Bearings(azimuth_deg=0.5, pose=bs.Pose(position_m=place[None]))
    batch = bs.run("rp-ekf", motion, along, z[None], dt=1.0)
    each = [bs.Bearings(azimuth_deg=0.5, pose=bs.Pose(position_m=p)) for p in place]
    step = bs.stream("rp-ekf", motion, each[7])  # any place will do
    state = step.start(z[0], sensor=each[0])
    for plot, now in zip(z[1:], each[1:], strict=True):
        state = step(state, plot, dt=1.0, sensor=now)
    np.testing.assert_array_equal(state.mean, batch.mean[0, -1])
    np.testing.assert_array_equal(state.cov, batch.cov[0, -1])


MOVED = bs.Bearings(azimuth_deg=1.0, pose=bs.Pose(position_m=(10.0, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("own", "later", "said"),
    [
        (bs.Bearings(azimuth_deg=1.0), MOVED, "pose"),
        (MOVED, bs.Bearings(azimuth_deg=1.0), "pose"),
        (MOVED, bs.Radar(range_m=30.0, azimuth_deg=1.0, pose=MOVED.pose), "range_m"),
        (MOVED, bs.ConicalBearings(cone_deg=1.0, pose=MOVED.pose), "azimuth_deg"),
        (MOVED, MOVED.pose, "kind"),
        (MOVED, bs.Bearings(azimuth_deg=np.array([1.0, 2.0]), pose=MOVED.pose), "2 targets"),
        (MOVED, bs.Bearings(azimuth_deg=np.ones((1, 7)), pose=MOVED.pose), "step to step"),
    ],
)
def test_a_sensor_of_another_structure_is_refused_with_the_difference(own, later, said):
    step = Stream(BANK.recursion(World(PLANE, own)))
    state = step.start([0.3])
    with pytest.raises(UsageError) as refused:
        step(state, [0.3], DT, sensor=later)
    assert said in str(refused.value)
    with pytest.raises(UsageError):
        step.start([0.3], sensor=later)


def test_numbers_for_other_targets_are_refused_at_once():
    per_target = bs.Bearings(azimuth_deg=np.array([1.0, 2.0]))
    with pytest.raises(UsageError, match="2 targets, and the stream for 5"):
        Stream(BANK.recursion(World(PLANE, per_target)), 5)
    one = Stream(BANK.recursion(World(PLANE, bs.Bearings(azimuth_deg=1.0))), 2)
    with pytest.raises(UsageError, match="one number for all"):
        one.start([[0.1], [0.2]], sensor=per_target)
