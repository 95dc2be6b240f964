"""Intervals of levels: Student's law as tables print it, and coverage where targets differ."""

import numpy as np
import pytest

from boresight.calibration.levels import Estimates, estimate


@pytest.mark.parametrize(
    ("freedom", "two_sided"), [(1.0, 12.706), (5.0, 2.571), (30.0, 2.042), (1e9, 1.960)]
)
def test_half_widths_are_those_of_printed_tables(freedom, two_sided):
    found = Estimates(np.array([3.0]), np.array([2.0]), np.array([freedom]))
    assert found.half_width()[0] == pytest.approx(2.0 * two_sided, rel=1e-3)


def test_what_lies_at_the_end_of_its_interval_has_a_chance_of_one_in_twenty():
    found = Estimates(np.array([-2.571, 2.571]), np.ones(2), np.full(2, 5.0))
    assert found.chance() == pytest.approx([0.05, 0.05], rel=1e-3)


def between(rng, targets, own_sd):
    """Two cells of each target: five plots before and 40 after a step of 1, of unit variance."""
    target = np.repeat(np.arange(targets), 2)
    count = np.tile([5.0, 40.0], targets)
    later = np.tile([0.0, 1.0], targets)
    y = (
        later
        + own_sd * rng.normal(size=targets)[target]
        + rng.normal(size=len(count)) / np.sqrt(count)
    )
    return np.column_stack([np.ones(len(count)), later]), y, count, target


def test_targets_that_differ_widely_tell_a_step_by_their_own_two_levels():
    """Then the step is known as well as if each target's level were a number of its own."""
    X, y, count, target = between(np.random.default_rng(2), 40, own_sd=100.0)
    found = estimate(X, y, count, target, np.array([[0.0, 1.0]]))
    own = (y[1::2] - y[0::2]).mean()
    assert found.value[0] == pytest.approx(own, abs=0.005)
    # The standard deviation of a sample's has a relative error of 11 % for 40 targets.
    assert found.sd[0] == pytest.approx(np.sqrt((1 / 5 + 1 / 40) / 40), rel=0.45)


def test_targets_that_are_alike_tell_it_as_well_as_all_their_plots_do():
    """No level of a target's own: the step is the difference of the means of all plots.

    Over 200 draws the mean square of what separates them is what levels that are estimated without
    need cost: less than a tenth of the variance itself.
    """
    rng, off = np.random.default_rng(3), []
    for _ in range(200):
        X, y, count, target = between(rng, 20, own_sd=0.0)
        found = estimate(X, y, count, target, np.array([[0.0, 1.0]]))
        off.append(found.value[0] - (y[1::2].mean() - y[0::2].mean()))
    assert np.mean(np.square(off)) < 0.1 * (1 / 5 + 1 / 40) / 20


@pytest.mark.parametrize("own_sd", [0.0, 0.5, 5.0])
def test_intervals_hold_the_truth_as_often_as_they_say(own_sd):
    """300 draws: 28 misses or more would have a chance of 0.2 %, and so would 4 or fewer."""
    rng, missed = np.random.default_rng(4), 0
    for _ in range(300):
        X, y, count, target = between(rng, 12, own_sd)
        found = estimate(X, y, count, target, np.array([[0.0, 1.0]]))
        missed += abs(found.value[0] - 1.0) > found.half_width()[0]
    assert 4 < missed < 28


@pytest.mark.parametrize("seed", [0, 1])
def test_levels_weigh_what_a_target_tells_against_what_targets_differ_by(seed):
    """Against the covariance of all rows written out, of targets with one row or two.

    The variances that are estimated are right to some per cent, so the estimates agree to a tenth
    of their standard deviation.
    """
    rng, targets, own_sd = np.random.default_rng(seed), 1_500, 0.2
    kept = rng.random(2 * targets) < 0.6
    target, later = np.repeat(np.arange(targets), 2)[kept], np.tile([0.0, 1.0], targets)[kept]
    count = rng.integers(2, 60, len(target)).astype(float)
    y = later + own_sd * rng.normal(size=targets)[target]
    y += rng.normal(size=len(y)) / np.sqrt(count)
    X = np.column_stack([np.ones(len(y)), later])
    V = np.diag(1.0 / count) + own_sd**2 * (target[:, None] == target)
    weighed = np.linalg.solve(V, X)
    cov = np.linalg.inv(X.T @ weighed)
    found = estimate(X, y, count, target, np.eye(2))
    sd = np.sqrt(np.diag(cov))
    assert np.abs((found.value - cov @ weighed.T @ y) / sd).max() < 0.1
    assert found.sd == pytest.approx(sd, rel=0.15)
