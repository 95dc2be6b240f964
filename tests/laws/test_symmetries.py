"""What must not matter does not matter: whole turns, the frame, and what is missing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.maths import Gaussian
from boresight.models.sensors import Pose
from laws.enrolled import (
    BEARING_WORLDS,
    BY_EAR,
    CURVED,
    FILTERS,
    LINEAR_WORLDS,
    LISTENING,
    PLANAR,
    PLANE,
    POLAR,
    POLAR_WORLDS,
    POSE,
    SPACE,
    World,
    turned,
)

seeds = st.integers(0, 2**32)
angles = st.floats(-np.pi, np.pi)
entries = pytest.mark.parametrize("entry", CURVED, ids=str)
worlds = pytest.mark.parametrize("world", POLAR_WORLDS, ids=str)
BENT = [(e, w) for e in CURVED for w in POLAR_WORLDS]
BENT += [(e, w) for e in BY_EAR for w in BEARING_WORLDS]
LINEAR = [(e, w) for e in FILTERS for w in LINEAR_WORLDS]
curved = pytest.mark.parametrize(("entry", "world"), BENT, ids=str)
everywhere = pytest.mark.parametrize(("entry", "world"), [*LINEAR, *BENT], ids=str)


def same(a, b, rtol=1e-9):
    """Two posteriors agree to `rtol` of the largest number of each kind."""
    for one, other in ((a.mean, b.mean), (a.cov, b.cov)):
        np.testing.assert_allclose(one, other, rtol=0, atol=rtol * np.max(np.abs(other)))
    np.testing.assert_allclose([a.nis, a.loglik], [b.nis, b.loglik], rtol=1e-7)
    assert a.dof == b.dof


def turn(entry, angle):
    """The angle, or the half turn nearest to it for filters whose points lie along the axes."""
    return np.pi * np.rint(angle / np.pi) if entry.by_axes else angle


def drawn(world, seed):
    mean, cov = world.prior(seed)
    return mean, cov, world.plot(mean + np.linalg.cholesky(cov)[:, 0], seed)


@curved
@given(seed=seeds, turns=st.integers(-3, 3))
def test_a_whole_turn_changes_nothing(entry, world, seed, turns):
    mean, cov, z = drawn(world, seed)
    i = [name in ("azimuth_rad", "cone_rad") for name in world.sensor.names]
    further = z.copy()
    further[i] += turns * 2 * np.pi
    same(entry.update(world, mean, cov, further), entry.update(world, mean, cov, z))


@entries
@given(seed=seeds, beside=st.floats(-0.02, 0.02))
def test_the_seam_behind_the_sensor_is_a_place_like_any_other(entry, seed, beside):
    world = World(SPACE, POLAR)
    mean, cov, _ = drawn(world, seed)
    mean[:2] = np.hypot(*mean[:2]) * np.array([-np.cos(beside), np.sin(beside)])
    z = world.plot(mean, seed)
    z[1] = np.angle(np.exp(1j * (np.pi - beside + 0.03)))  # 0.03 rad beyond, often over the seam
    post = entry.update(world, mean, cov, z)
    half = np.diag([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])  # half a turn: the seam is now ahead
    ahead = entry.update(world, half @ mean, half @ cov @ half, z - [0.0, np.pi, 0.0])
    same(post, ahead._replace(mean=half @ ahead.mean, cov=half @ ahead.cov @ half))


UPRIGHT = [(e, w) for e in CURVED for w in (World(PLANE, PLANAR), World(SPACE, POLAR))]
UPRIGHT += [(e, World(PLANE, LISTENING)) for e in BY_EAR]


@pytest.mark.parametrize(("entry", "world"), UPRIGHT, ids=str)
@given(seed=seeds, angle=angles)
def test_rotating_the_world_about_z_rotates_the_answer(entry, world, seed, angle):
    mean, cov, z = drawn(world, seed)
    angle = turn(entry, angle)
    R = np.kron(np.eye(2), turned(angle, world.motion.dims))
    turned_z = z.copy()
    turned_z[world.sensor.names.index("azimuth_rad")] += angle
    straight = entry.update(world, mean, cov, z)
    round_about = entry.update(world, R @ mean, R @ cov @ R.T, turned_z)
    same(round_about, straight._replace(mean=R @ straight.mean, cov=R @ straight.cov @ R.T))


POSED = [(e, World(SPACE, replace(POLAR, pose=POSE))) for e in CURVED]
POSED += [(e, w) for e in BY_EAR for w in BEARING_WORLDS]


@pytest.mark.parametrize(("entry", "world"), POSED, ids=str)
@given(seed=seeds, angle=angles, east=st.floats(-3e4, 3e4), up=st.floats(-2e3, 2e3))
def test_moving_world_and_sensor_together_moves_the_answer(entry, world, seed, angle, east, up):
    mean, cov, z = drawn(world, seed)
    T, d, before = turned(turn(entry, angle)), np.array([east, -east / 3, up]), world.sensor.pose
    pose = Pose(
        position_m=T @ before.position_m + d,
        rotation=before.rotation @ T.T,
        velocity_mps=T @ before.velocity_mps,
    )
    elsewhere = World(world.motion, replace(world.sensor, pose=pose))
    dims = world.motion.dims
    R = np.kron(np.eye(2), T[:dims, :dims])
    shift = np.concatenate([d[:dims], np.zeros(dims)])
    here = entry.update(world, mean, cov, z)
    there = entry.update(elsewhere, R @ mean + shift, R @ cov @ R.T, z)
    same(there, here._replace(mean=R @ here.mean + shift, cov=R @ here.cov @ R.T))


@curved
@given(seed=seeds)
def test_a_missing_component_is_a_component_the_sensor_does_not_have(entry, world, seed):
    mean, cov, z = drawn(world, seed)
    for i, name in enumerate(world.sensor.names):
        fields = {name.replace("_rad", "_deg"): None}
        if name.startswith("range"):  # what is left is correlated with nothing
            fields["range_rate_correlation"] = None
        if len(world.sensor.names) == 1 or (entry.bank and name == "azimuth_rad"):
            continue  # nothing is left, or nothing that a bank begins on
        reduced = replace(world.sensor, **fields)
        gap = z.copy()
        gap[i] = np.nan
        same(
            entry.update(world, mean, cov, gap),
            entry.update(World(world.motion, reduced), mean, cov, np.delete(z, i)),
        )


@everywhere
@given(seed=seeds)
def test_a_plot_without_any_component_changes_nothing(entry, world, seed):
    mean, cov, z = drawn(world, seed)
    models = world.motion, world.sensor
    method = entry.recursion(world).method
    kept = method.begin(Gaussian(mean, cov), *models)
    after, _ = method.update(kept, np.full(len(z), np.nan), *models)
    assert after.keys() == kept.keys()
    for name, leaf in kept.items():
        np.testing.assert_allclose(after[name], leaf, rtol=1e-12, atol=1e-12 * np.max(leaf))
        if name in ("mean", "means"):
            np.testing.assert_array_equal(after[name], leaf)
    post = entry.update(world, mean, cov, np.full(len(z), np.nan))
    if not (entry.own_state or entry.bank):
        np.testing.assert_array_equal(post.mean, mean)
        np.testing.assert_allclose(post.cov, cov, rtol=1e-12, atol=1e-12 * np.max(cov))
    assert (post.nis, post.dof, post.loglik) == (0, 0, 0)


@everywhere
@given(seed=seeds, dt=st.floats(0.0, 30.0))
def test_covariances_stay_covariances_and_inputs_stay_theirs(entry, world, seed, dt):
    mean, cov, z = drawn(world, seed)
    z[seed % len(z)] = np.nan
    inputs = {"z": z, "dt": dt}
    before = [array.copy() for array in (mean, cov, z)]
    recursion = entry.recursion(world)
    _, results = recursion.step(recursion.begin(mean, cov), inputs)
    told = results["cov"]
    np.testing.assert_array_equal(told, told.T)
    assert np.linalg.eigvalsh(told / np.outer(*2 * [np.sqrt(np.diag(told))]))[0] > 0
    assert results["status"] == 0
    for array, copy in zip((mean, cov, z), before, strict=True):
        np.testing.assert_array_equal(array, copy)


@worlds
@pytest.mark.parametrize(
    "entry", [e for e in CURVED if "sequential" in e.name or e.name == "mekf"], ids=str
)
@given(seed=seeds)
def test_nis_and_likelihood_are_those_of_the_innovations(entry, world, seed):
    mean, cov, z = drawn(world, seed)
    z[seed % len(z)] = np.nan
    post = entry.update(world, mean, cov, z)
    there = ~np.isnan(z)
    nu, s = post.innovation[there], post.variance[there]
    assert post.dof == there.sum()
    assert post.nis == pytest.approx(np.sum(nu**2 / s), rel=1e-12)
    assert post.loglik == pytest.approx(-0.5 * np.sum(nu**2 / s + np.log(2 * np.pi * s)), rel=1e-12)
    assert np.isnan(post.variance[~there]).all()
    assert (post.innovation[~there] == 0).all()
