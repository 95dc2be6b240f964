"""Mathematics that knows no sensor. Everything formulas use runs on floats and on symbols."""

from boresight.lanes import copysign, gradient, isnan, jacobian, reach, select
from boresight.maths.angles import wrap
from boresight.maths.gaussian import Gaussian
from boresight.maths.linalg import (
    cholesky,
    elimination,
    joseph,
    lower_solve,
    mirror,
    solve,
    upper_solve,
)

missing = isnan  # a component of a plot that is NaN was not measured

__all__ = [
    "Gaussian",
    "cholesky",
    "copysign",
    "elimination",
    "gradient",
    "isnan",
    "jacobian",
    "joseph",
    "lower_solve",
    "mirror",
    "missing",
    "reach",
    "select",
    "solve",
    "upper_solve",
    "wrap",
]
