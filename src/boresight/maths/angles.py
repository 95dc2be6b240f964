"""Angles are wrapped because the quantity is an angle; runs on floats, arrays and symbols."""

import numpy as np

from boresight.maths.gaussian import Array

TURN = 2 * np.pi


def wrap(angle: Array) -> Array:
    """Bring an angle in radians, or a difference of two, into the half-open turn (-pi, pi].

    Angles already inside come back bit for bit; a NaN stays a NaN. One branch-free formula for
    floats, arrays of any shape and symbols of a recorded formula.
    """
    return angle + TURN * np.floor(0.5 - angle / TURN)
