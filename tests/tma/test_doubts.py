"""What contradicts itself in an answer is said, once, and most important first."""

import pytest

from boresight.maths.digits import rounded
from boresight.mixtures.range_parameterised import RangeParameterised
from boresight.target_motion.doubts import (
    of_difference,
    of_limits,
    of_residuals,
    of_spread,
)
from boresight.target_motion.result import Batch, Quantity, Residuals
from boresight.target_motion.result import Test as Question


def failed(name, follows=None):
    return Question(
        name=name, statistic=9.0, p_value=0.0, passed=False, words=f"{name}!", follows=follows
    )


def doubts(*tests):
    return of_residuals(Residuals(deg=None, tests=tests, false_alarm=0.01), 100)


def test_what_follows_is_named_behind_what_explains_it():
    found = doubts(
        failed("whiteness", "clock"),
        failed("outliers"),
        failed("clock"),
        failed("compass", "clock"),
    )
    assert found == (
        "clock! That would also explain what is found of: whiteness, compass.",
        "outliers!",
    )
    assert doubts(failed("outliers"), failed("clock")) == ("outliers!", "clock!")
    assert doubts() == ()
    assert "No steady track" in of_residuals(None, 5)[0]
    assert "nothing is left to test" in of_residuals(None, 4)[0]


def test_an_sd_below_half_of_the_bound_is_a_fault():
    assert of_spread(0.51, 1.0) == ()
    assert of_spread(float("nan"), 1.0) == ()
    (words,) = of_spread(123.4, 1234.0)
    assert "sd of 120 m" in words
    assert "below 1,200 m" in words


@pytest.mark.parametrize(("ends", "count"), [((300.0, 900.0), 1), ((900.0, 1100.0), 0)])
def test_a_range_that_was_not_believed_possible_is_doubted(ends, count):
    spread = RangeParameterised(nearest_m=1000.0, farthest_m=20000.0)
    region = Quantity(estimate=None, sd=None, regions={"90": (ends,)})
    assert len(of_limits(region, spread)) == count
    far = Quantity(estimate=None, sd=None, regions={"90": ((21e3, 22e3), (23e3, 24e3))})
    assert "21,000 to 24,000 m" in of_limits(far, spread)[0]


def test_sizes_have_two_digits():
    assert [rounded(each) for each in (79.4, 1_294.0, 0.0123, 0.0, 9.96)] == [
        "79",
        "1,300",
        "0.012",
        "0",
        "10.0",
    ]


def batch_at(range_m, sd_m):
    there = Quantity(estimate=range_m, sd=sd_m)
    return Batch(
        mean=None, cov=None, cost=0.0, converged=True,
        range_m=there, bearing_deg=there, course_deg=there, speed_mps=there,
    )  # fmt: skip


@pytest.mark.parametrize(("range_m", "count"), [(1290.0, 0), (1310.0, 1), (690.0, 1)])
def test_a_range_that_all_bearings_at_once_deny_is_doubted(range_m, count):
    answer = Quantity(estimate=range_m, sd=50.0)
    assert len(of_difference(answer, batch_at(1000.0, 100.0))) == count
    assert of_difference(Quantity(estimate=None, sd=None), batch_at(1000.0, 100.0)) == ()
    assert of_difference(answer, None) == ()
