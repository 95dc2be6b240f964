"""Wrapping: the angle stays the same angle, and lands in the half-open turn."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.lanes import gradient
from boresight.maths.angles import wrap

any_angle = st.floats(-1e4, 1e4)
inside = st.floats(-3.1415, 3.1415)


@given(any_angle)
def test_a_wrapped_angle_is_the_same_angle_in_the_half_open_turn(angle):
    wrapped = wrap(angle)
    assert -np.pi < wrapped <= np.pi
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-11)


@given(inside, st.integers(-1000, 1000))
def test_whole_turns_change_nothing(angle, turns):
    assert wrap(angle) == angle
    assert wrap(angle + turns * 2 * np.pi) == pytest.approx(angle, abs=2e-12)


@pytest.mark.parametrize("turns", [-2.5, -1.5, -0.5, 0.5, 1.5, 2.5])
def test_half_a_turn_is_plus_pi(turns):
    assert wrap(turns * 2 * np.pi) == np.pi


def test_arrays_wrap_as_their_elements_do_and_are_left_alone():
    angles = np.array([[-4.0, 0.0, np.nan], [3.0, 9.0, -0.1]])
    before = angles.copy()
    wrapped = wrap(angles)
    one_by_one = np.array([[wrap(angle) for angle in row] for row in angles])
    np.testing.assert_array_equal(wrapped, one_by_one)
    np.testing.assert_array_equal(angles, before)
    assert np.isnan(wrapped[0, 2])


def test_wrapping_leaves_the_slope_alone():
    wrapped, slope = gradient(lambda x: wrap(x[0] * 2), np.array([5.0]))
    assert wrapped == pytest.approx(10 - 4 * np.pi)
    assert slope == [2.0]
