"""In the curved world each filter is its textbook, written a second time in `tests/oracles`."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from laws.enrolled import CURVED, PLANAR, PLANE, POLAR, SPACE, Entry, World
from oracles import filters as textbook

seeds = st.integers(0, 2**32)
WORLDS = (World(SPACE, POLAR), World(PLANE, PLANAR))
worlds = pytest.mark.parametrize("world", WORLDS, ids=str)


def noise(sensor):
    """R in m² and rad²; written out, because degrees are where it would go wrong."""
    spread = [sensor.range_m, sensor.azimuth_deg * np.pi / 180]
    if sensor.elevation_deg is not None:
        spread.append(sensor.elevation_deg * np.pi / 180)
    return np.diag(np.square(spread))


def agree(post, mean, cov, nis=None, loglik=None):
    """To 1e-8 of the largest number of each kind; the textbook inverts matrices."""
    np.testing.assert_allclose(post.mean, mean, atol=1e-8 * np.max(np.abs(mean)))
    np.testing.assert_allclose(post.cov, cov, atol=1e-8 * np.max(np.abs(cov)))
    if nis is not None:
        np.testing.assert_allclose([post.nis, post.loglik], [nis, loglik], rtol=1e-8)


def drawn(world, seed):
    """A prior, and a plot of a target some two standard deviations off."""
    mean, cov = world.prior(seed)
    truth = mean + 2 * np.linalg.cholesky(cov)[:, 0]
    return mean, cov, world.plot(truth, seed), noise(world.sensor)


@worlds
@given(seed=seeds)
def test_ekf(world, seed):
    mean, cov, z, R = drawn(world, seed)
    expected = textbook.ekf(mean, cov, z, R, world.motion.dims)
    agree(Entry("ekf").update(world, mean, cov, z), *expected)


@worlds
@pytest.mark.parametrize("iterations", [1, 2, 5])
@given(seed=seeds)
def test_iterated_ekf_is_gauss_newton(world, iterations, seed):
    mean, cov, z, R = drawn(world, seed)
    expected = textbook.iekf(mean, cov, z, R, world.motion.dims, iterations)
    agree(Entry("iekf", {"iterations": iterations}).update(world, mean, cov, z), *expected)


@worlds
@given(seed=seeds)
def test_block_mekf(world, seed):
    mean, cov, z, R = drawn(world, seed)
    expected = textbook.mekf_block(mean, cov, z, R, world.motion.dims)
    agree(Entry("mekf-block").update(world, mean, cov, z), *expected)


NAMES = ("range_m", "azimuth_rad", "elevation_rad")


@worlds
@pytest.mark.parametrize("rows", [(2, 1, 0), (0, 1, 2), (1, 0, 2)], ids=str)
@pytest.mark.parametrize("reading", ["none", "printed", "predicted", "second order"])
@given(seed=seeds)
def test_sequential_filters_in_every_order_and_reading(world, rows, reading, seed):
    mean, cov, z, R = drawn(world, seed)
    dims, order = world.motion.dims, tuple(NAMES[row] for row in rows)
    rows = [row for row in rows if row < dims]
    expected = textbook.sequential(mean, cov, z, R, dims, rows, reading)
    if reading == "none":
        agree(Entry("ekf-sequential", {"order": order}).update(world, mean, cov, z), *expected)
        settings = {"mu": "none", "added_variance": False, "order": order}
    else:
        settings = {"mu": reading, "order": order}
    agree(Entry("mekf", settings).update(world, mean, cov, z), *expected)


@worlds
@given(seed=seeds)
def test_the_added_variance_is_a_choice_of_its_own(world, seed):
    mean, cov, z, R = drawn(world, seed)
    rows = range(world.motion.dims)[::-1]
    expected = textbook.sequential(
        mean, cov, z, R, world.motion.dims, rows, "predicted", added_variance=False
    )
    agree(Entry("mekf", {"added_variance": False}).update(world, mean, cov, z), *expected)


@given(seed=seeds)
def test_in_the_plane_the_predicted_reading_is_the_block_form(seed):
    world = World(PLANE, PLANAR)
    mean, cov, z, _ = drawn(world, seed)
    block = Entry("mekf-block").update(world, mean, cov, z)
    agree(Entry("mekf").update(world, mean, cov, z), block.mean, block.cov)


@pytest.mark.parametrize("entry", CURVED, ids=str)
@pytest.mark.parametrize(
    "place", [(0, 0, 8e3), (0, 0, 0), (1e-4, 0, 5e3), (-2e4, -0.0, 1e3), (3e4, 1e3, 0)], ids=str
)
def test_no_place_is_singular(entry, place):
    """Right overhead, at the sensor, on the seam, on the horizon: finite, positive, and nearer."""
    world = World(SPACE, POLAR)
    mean, cov = np.array([*place, 30.0, -20.0, 5.0], float), np.diag([1e4] * 3 + [400.0] * 3)
    z = world.plot(mean + np.array([80, 60, 20, 0, 0, 0]), 1, sigmas=0.0)
    post = entry.update(world, mean, cov, z)
    assert np.isfinite([*post.mean, post.nis, post.loglik]).all()
    assert np.linalg.eigvalsh(post.cov)[0] > 0
