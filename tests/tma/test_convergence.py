"""When an answer is good enough."""

from dataclasses import replace

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.target_motion.convergence import (
    check_criteria,
    converge,
    errors_inside,
    first_and_sustained,
    permitted,
    sure,
)
from boresight.target_motion.result import Criteria

CRITERIA = Criteria()
TRUTH = np.array([4_000.0, 0.2, 120.0, 15.0])
TIME = np.array([10.0, 20.0, 30.0, 40.0, 50.0])


@pytest.mark.parametrize(
    ("column", "limit"), [(0, 400.0), (1, 0.5), (2, 5.0), (3, 2.0 * 1852.0 / 3600.0)]
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_one_error_beyond_its_limit_is_enough(column, limit, sign):
    error = np.zeros(4)
    error[column] = sign * limit
    assert errors_inside(TRUTH + 0.999 * error, TRUTH, CRITERIA)
    assert not errors_inside(TRUTH + 1.001 * error, TRUTH, CRITERIA)


def test_the_range_is_held_against_the_true_one():
    """4,400 m for 4,000 is 10 % of the truth and 9.1 % of the estimate."""
    assert not errors_inside([4_401.0, 0.2, 120.0, 15.0], TRUTH, CRITERIA)


def test_angles_are_near_each_other_across_north():
    assert errors_inside([4_000.0, 359.9, 120.0, 15.0], TRUTH, CRITERIA)
    assert errors_inside([4_000.0, 0.2, 120.0 - 720.0, 15.0], TRUTH, CRITERIA)


def test_what_is_not_a_number_is_not_inside():
    estimate = np.array([TRUTH, [np.nan, 0.2, 120.0, 15.0]])
    assert errors_inside(estimate, TRUTH, CRITERIA).tolist() == [True, False]
    assert not sure(estimate[1], np.full(4, 0.01), CRITERIA)
    assert not sure(TRUTH, [1.0, np.nan, 0.1, 0.1], CRITERIA)


@pytest.mark.parametrize(("confidence", "sds"), [(0.9, 1.6448536), (0.99, 2.5758293)])
def test_sure_is_a_normal_distributions_quantile(confidence, sds):
    criteria = replace(CRITERIA, confidence=confidence)
    limits = np.array([400.0, 0.5, 5.0, CRITERIA.speed_mps])
    for column in range(4):
        sd = np.full(4, 1e-3)
        sd[column] = 0.999 * limits[column] / sds
        assert sure(TRUTH, sd, criteria)
        sd[column] = 1.001 * limits[column] / sds
        assert not sure(TRUTH, sd, criteria)


@pytest.mark.parametrize(
    ("held", "first", "sustained"),
    [
        ("01011", 20.0, 40.0),
        ("00001", 50.0, 50.0),
        ("11111", 10.0, 10.0),
        ("11110", 10.0, np.nan),
        ("00000", np.nan, np.nan),
    ],
)
def test_first_time_and_for_good(held, first, sustained):
    inside = np.array([c == "1" for c in held])
    assert first_and_sustained(inside, TIME) == pytest.approx((first, sustained), nan_ok=True)


def test_leading_axes_are_runs():
    inside = np.array([[[0, 1, 0, 1, 1], [1, 1, 1, 1, 0]]], dtype=bool)
    first, sustained = first_and_sustained(inside, TIME)
    assert first.tolist() == [[20.0, 10.0]]
    assert sustained[0, 0] == 40.0
    assert np.isnan(sustained[0, 1])


def test_the_bound_permits_from_where_it_is_narrow_for_good():
    """A tenth of the range at 90 %: from 4,000 m the bound must be 243 m."""
    bound = np.tile([1.0, 0.01, 0.1, 0.1], (5, 1))
    bound[:, 0] = np.inf, 240.0, 250.0, 240.0, 200.0
    assert permitted(bound, np.full(5, 4_000.0), CRITERIA, TIME) == 40.0
    assert np.isnan(permitted(np.full((5, 4), np.inf), np.full(5, 4_000.0), CRITERIA, TIME))


def test_a_narrow_answer_counts_only_where_bearings_tell_the_range():
    estimate, sd = np.tile(TRUTH, (5, 1)), np.tile([1.0, 0.01, 0.1, 0.1], (5, 1))
    known = TIME >= 30.0
    found = converge(estimate, sd, known, np.full((5, 4), np.inf), CRITERIA, TIME)
    assert (found.first_s, found.sustained_s, found.permitted_s) == (30.0, 30.0, None)
    never = converge(estimate, sd, np.zeros(5, dtype=bool), sd, CRITERIA, TIME)
    assert (never.first_s, never.sustained_s, never.permitted_s) == (None, None, 10.0)


@pytest.mark.parametrize("name", ["range_percent", "bearing_deg", "course_deg", "speed_mps"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_a_limit_is_above_zero_and_finite(name, value):
    with pytest.raises(UsageError, match=name):
        check_criteria(replace(CRITERIA, **{name: value}))


@pytest.mark.parametrize("value", [0.0, 1.0, -0.1, np.nan])
def test_a_confidence_lies_between_zero_and_one(value):
    with pytest.raises(UsageError, match="confidence"):
        check_criteria(replace(CRITERIA, confidence=value))
