"""What must not matter does not matter: whole turns, the frame, and what is missing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.testing import symmetries
from boresight.testing.comparing import alike
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


def turn(entry, angle):
    """The angle, or the half turn nearest to it for filters whose points lie along the axes."""
    return np.pi * np.rint(angle / np.pi) if entry.by_axes else angle


@curved
@given(seed=seeds, turns=st.integers(-3, 3))
def test_a_whole_turn_changes_nothing(entry, world, seed, turns):
    symmetries.whole_turn(entry.on(world), world, seed, turns=turns)


@entries
@given(seed=seeds, beside=st.floats(-0.02, 0.02))
def test_the_seam_behind_the_sensor_is_a_place_like_any_other(entry, seed, beside):
    world = World(SPACE, POLAR)
    mean, cov, _ = world.case(seed)
    mean[:2] = np.hypot(*mean[:2]) * np.array([-np.cos(beside), np.sin(beside)])
    z = world.plot(mean, seed)
    z[1] = np.angle(np.exp(1j * (np.pi - beside + 0.03)))  # 0.03 rad beyond, often over the seam
    post = entry.update(world, mean, cov, z)
    half = np.diag([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])  # half a turn: the seam is now ahead
    ahead = entry.update(world, half @ mean, half @ cov @ half, z - [0.0, np.pi, 0.0])
    alike(post, ahead._replace(mean=half @ ahead.mean, cov=half @ ahead.cov @ half))


UPRIGHT = [(e, w) for e in CURVED for w in (World(PLANE, PLANAR), World(SPACE, POLAR))]
UPRIGHT += [(e, World(PLANE, LISTENING)) for e in BY_EAR]


@pytest.mark.parametrize(("entry", "world"), UPRIGHT, ids=str)
@given(seed=seeds, angle=angles)
def test_rotating_the_world_about_z_rotates_the_answer(entry, world, seed, angle):
    symmetries.rotation(entry.on(world), world, seed, angle=turn(entry, angle))


POSED = [(e, World(SPACE, replace(POLAR, pose=POSE))) for e in CURVED]
POSED += [(e, w) for e in BY_EAR for w in BEARING_WORLDS]


@pytest.mark.parametrize(("entry", "world"), POSED, ids=str)
@given(seed=seeds, angle=angles, east=st.floats(-3e4, 3e4), up=st.floats(-2e3, 2e3))
def test_moving_world_and_sensor_together_moves_the_answer(entry, world, seed, angle, east, up):
    shift, angle = (east, -east / 3, up), turn(entry, angle)
    symmetries.elsewhere(entry.on(world), world, seed, angle=angle, shift=shift)


@curved
@given(seed=seeds)
def test_a_missing_component_is_a_component_the_sensor_does_not_have(entry, world, seed):
    for i, name in enumerate(world.sensor.names):
        if not (entry.bank and name == "azimuth_rad"):  # what a bank begins on
            symmetries.missing_component(entry.on(world), world, seed, at=i)


@everywhere
@given(seed=seeds)
def test_a_plot_without_any_component_changes_nothing(entry, world, seed):
    told = not (entry.own_state or entry.bank)
    symmetries.missing_plot(entry.on(world), world, seed, told=told)


@everywhere
@given(seed=seeds, dt=st.floats(0.0, 30.0))
def test_covariances_stay_covariances_and_inputs_stay_theirs(entry, world, seed, dt):
    symmetries.covariance(entry.on(world), world, seed, dt=dt)
    symmetries.inputs(entry.on(world), world, seed, dt=dt)
    mean, cov, z = world.case(seed)
    recursion = entry.recursion(world)
    _, results = recursion.step(recursion.begin(mean, cov), {"z": z, "dt": dt})
    assert results["status"] == 0


@worlds
@pytest.mark.parametrize(
    "entry", [e for e in CURVED if "sequential" in e.name or e.name == "mekf"], ids=str
)
@given(seed=seeds)
def test_nis_and_likelihood_are_those_of_the_innovations(entry, world, seed):
    mean, cov, z = world.case(seed)
    z[seed % len(z)] = np.nan
    post = entry.update(world, mean, cov, z)
    there = ~np.isnan(z)
    nu, s = post.innovation[there], post.variance[there]
    assert post.dof == there.sum()
    assert post.nis == pytest.approx(np.sum(nu**2 / s), rel=1e-12)
    assert post.loglik == pytest.approx(-0.5 * np.sum(nu**2 / s + np.log(2 * np.pi * s)), rel=1e-12)
    assert np.isnan(post.variance[~there]).all()
    assert (post.innovation[~there] == 0).all()
