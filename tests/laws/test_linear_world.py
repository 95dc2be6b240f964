"""In a linear world every filter is the textbook's joint Kalman filter, whatever its method."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.testing.symmetries import kalman, some_plots
from laws.enrolled import FILTERS, LINEAR_WORLDS, Entry
from oracles import filters as textbook

seeds = st.integers(0, 2**32)
periods = st.floats(0.1, 20.0)


def our_run(entry, world, mean, cov, plots, dt):
    recursion = entry.recursion(world)
    state = recursion.begin(mean, cov)
    for z in plots:
        state, results = recursion.step(state, {"z": z, "dt": dt})
    return results["mean"], results["cov"], results["nis"], results["loglik"]


def agree(ours, theirs):
    """Each number to 1e-9 of the size of its kind: means, covariances, NIS, likelihood."""
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.max(np.abs(b)))


@pytest.mark.parametrize("world", LINEAR_WORLDS, ids=str)
@pytest.mark.parametrize("entry", [e for e in FILTERS if not e.own_state], ids=str)
@given(seed=seeds, dt=periods)
def test_equals_the_joint_kalman_filter_with_plots_missing(entry, world, seed, dt):
    kalman(entry.on(world), world, seed, dt=dt)


@pytest.mark.parametrize("name", ["ekf-sequential", "mekf"])
@given(seed=seeds)
def test_the_order_of_components_is_irrelevant(name, seed):
    world = LINEAR_WORLDS[0]
    mean, cov = world.prior(seed)
    plots = some_plots(world, mean, seed)
    runs = [
        our_run(Entry(name, {"order": order}), world, mean, cov, plots, 2.0)
        for order in itertools.permutations(world.sensor.names)
    ]
    for run in runs[1:]:
        agree(run, runs[0])


@given(seed=seeds, iterations=st.integers(2, 6))
def test_iterating_changes_nothing(seed, iterations):
    world = LINEAR_WORLDS[0]
    mean, cov = world.prior(seed)
    plots = some_plots(world, mean, seed)
    once = our_run(Entry("iekf", {"iterations": 1}), world, mean, cov, plots, 2.0)
    agree(our_run(Entry("iekf", {"iterations": iterations}), world, mean, cov, plots, 2.0), once)


@given(seed=seeds)
def test_a_correlated_noise_is_used_and_missing_rows_are_left_out(seed):
    from boresight.filters.kalman import update
    from boresight.maths import Gaussian

    world = LINEAR_WORLDS[0]
    mean, cov = world.prior(seed)
    rng = np.random.default_rng((seed, 3))
    H, root = rng.normal(size=(3, 6)), rng.normal(scale=40.0, size=(3, 3))
    R = root @ root.T + 100.0 * np.eye(3)
    z = H @ mean + rng.normal(scale=50.0, size=3)
    z[seed % 3] = np.nan
    post = update(Gaussian(mean, cov), z, H, R)
    expected = textbook.joint_update(mean, cov, z, H, R)
    agree((post.mean, post.cov, post.nis, post.loglik), expected)
    assert post.dof == 2
    assert np.isnan(post.variance[seed % 3])
    assert post.innovation[seed % 3] == 0.0
