"""Weights of a bank: Bayes in logarithms, whatever its members say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from boresight.maths import Gaussian
from boresight.maths.mixing import greatest, matched, moments, weigh
from boresight.mixtures.weights import GONE, reweigh, weights_over_time
from oracles import pradeep as paper

STEPS, CELLS = 7, 4
SAID = arrays.arrays(float, (STEPS, CELLS), elements=st.floats(-40.0, 40.0))
PRUNE = st.sampled_from([0.0, 1e-3, 0.05, 0.9999])


def shares(logs):
    return np.array(weigh(logs))


@given(SAID)
def test_one_pass_is_bayes(loglik):
    found = weights_over_time(loglik, prune=0.0)
    np.testing.assert_allclose(found, paper.weights(loglik), atol=1e-12)


@given(SAID, PRUNE)
def test_one_pass_is_step_by_step(loglik, prune):
    logs, told = [0.0] * CELLS, []
    for said in loglik:
        logs = reweigh(logs, list(said), prune)
        told.append(shares(logs))
    np.testing.assert_allclose(weights_over_time(loglik, prune=prune), told, atol=1e-12)


@given(SAID, PRUNE)
def test_they_are_shares_and_the_greatest_stays(loglik, prune):
    found = weights_over_time(loglik, prune=prune)
    np.testing.assert_allclose(found.sum(axis=-1), 1.0, rtol=1e-14)
    assert np.all(found >= 0.0)
    assert np.all(found.max(axis=-1) >= 1.0 / CELLS)
    kept = weights_over_time(loglik[:1], prune=prune)[0]
    assert kept[np.argmax(loglik[0])] > 0.0


@given(SAID, PRUNE, st.permutations(range(CELLS)))
def test_cells_have_no_order(loglik, prune, order):
    found = weights_over_time(loglik, prune=prune)
    # A share within rounding of the threshold may go in one order of summing and not in another.
    np.testing.assert_allclose(
        weights_over_time(loglik[:, order], prune=prune), found[:, order], atol=1e-10
    )


@given(SAID, PRUNE, arrays.arrays(float, (STEPS, 1), elements=st.floats(-1e5, 1e5)))
def test_what_is_alike_for_all_changes_nothing(loglik, prune, alike):
    found = weights_over_time(loglik, prune=prune)
    np.testing.assert_allclose(weights_over_time(loglik + alike, prune=prune), found, atol=1e-8)


def test_a_bearing_that_is_missing_leaves_them():
    loglik = np.array([[0.3, -1.0, 0.1], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found = weights_over_time(loglik)
    assert np.array_equal(found[1], found[0])
    assert np.array_equal(found[2], found[0])


@pytest.mark.parametrize("nothing", [-np.inf, np.nan, np.inf, -1e12])
def test_where_nobody_foresaw_it_they_stay(nothing):
    before = [-0.7, 0.0, GONE]
    assert list(reweigh(before, [nothing] * 3, 1e-3)) == before


@pytest.mark.parametrize("nothing", [-np.inf, np.nan, np.inf, -1e12])
@pytest.mark.parametrize("prune", [0.0, 1e-3])
def test_a_member_that_says_nothing_goes_for_good(nothing, prune):
    loglik = np.array([[0.0, 0.5, 0.2], [nothing, -60.0, 0.0], [900.0, 0.0, 0.0]])
    found = weights_over_time(loglik, prune=prune)
    assert found[0, 0] > 0.2
    assert found[1, 0] == found[2, 0] == 0.0


@pytest.mark.parametrize("share", [1e-3, 0.05, 0.3])
def test_below_the_share_it_goes_and_does_not_return(share):
    """Its share of all, not of the greatest; a hair above, it stays."""
    for hair, stays in ((1.0 - 1e-6, False), (1.0 + 1e-6, True)):
        part = share * hair
        first = np.log([part, (1.0 - part) / 2, (1.0 - part) / 2])
        found = weights_over_time(np.array([first, [50.0, 0.0, 0.0]]), prune=share)
        assert bool(found[0, 0] > 0.0) is stays
        assert found[1, 0] == (pytest.approx(1.0) if stays else 0.0)


def test_the_last_is_never_pruned():
    generator = np.random.default_rng(1)
    loglik = 5.0 * generator.standard_normal((1_000, 60, 6))
    found = weights_over_time(loglik, prune=0.999)
    assert np.all(found.sum(axis=-1) > 1.0 - 1e-12)
    assert np.mean(found[:, -1] == 1.0) == pytest.approx(1.0 / 6.0)


def test_lanes_do_not_know_of_each_other():
    loglik = np.random.default_rng(2).standard_normal((5, 3, 9, 4))
    found = weights_over_time(loglik, prune=0.05)
    assert found.shape == loglik.shape
    assert np.array_equal(found[4, 1], weights_over_time(loglik[4, 1], prune=0.05))


def mixture(seed, cells=3, n=2):
    generator = np.random.default_rng(seed)
    share = generator.dirichlet(np.ones(cells))
    roots = generator.standard_normal((cells, n, n))
    means = 3.0 * generator.standard_normal((cells, n))
    return share, [Gaussian(m, A @ A.T) for m, A in zip(means, roots, strict=True)], roots


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_moments_of_a_mixture_by_drawing_from_it(seed):
    """Six standard errors of 400,000 draws each: one false alarm in a hundred million."""
    share, parts, roots = mixture(seed)
    generator, count = np.random.default_rng(seed), 400_000
    which = generator.choice(len(share), count, p=share)
    drawn = np.array([part.mean for part in parts])[which]
    drawn += np.einsum("nij,nj->ni", roots[which], generator.standard_normal((count, 2)))
    found = moments(list(share), parts)
    apart = drawn - found.mean
    assert np.all(abs(apart.mean(axis=0)) < 6 * drawn.std(axis=0) / np.sqrt(count))
    squares = apart[:, :, None] * apart[:, None, :]
    error = squares.std(axis=0) / np.sqrt(count)
    assert np.all(abs(squares.mean(axis=0) - found.cov) < 6 * error)


def test_a_part_without_weight_may_hold_anything():
    _, parts, _ = mixture(4, cells=2)
    ruined = Gaussian(np.full(2, np.nan), np.full((2, 2), np.inf))
    whole, with_it = (
        moments([0.3, 0.7], parts),
        moments([0.3, 0.0, 0.7], [parts[0], ruined, parts[1]]),
    )
    np.testing.assert_allclose(with_it.mean, whole.mean)
    np.testing.assert_allclose(with_it.cov, whole.cov)


@given(st.lists(st.floats(-30.0, 30.0), min_size=2, max_size=5))
def test_a_forecast_has_the_moments_of_the_mixture(logs):
    generator = np.random.default_rng(5)
    nus, variances = generator.standard_normal((2, len(logs)))
    share = np.exp(logs) / np.sum(np.exp(logs))
    nu, variance = matched(logs, list(nus), list(variances**2))
    assert nu == pytest.approx(share @ nus, abs=1e-12)
    assert variance == pytest.approx(
        share @ (variances**2 + nus**2) - (share @ nus) ** 2, abs=1e-12
    )
    assert greatest(logs) == max(logs)
    far = matched([log - 9_000.0 for log in logs], list(nus), list(variances**2))
    assert far == pytest.approx((nu, variance), abs=1e-9)
