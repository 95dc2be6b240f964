"""The noun every floor speaks: a Gaussian, with as many leading axes (lanes) as you like."""

from typing import Any, NamedTuple

Array = Any  # (…) of float64 outside a trace; of symbols (an object array) inside one


class Gaussian(NamedTuple):
    """A mean and its covariance.

    Attributes:
        mean: (..., n), SI units and radians.
        cov: (..., n, n), symmetric positive definite.
    """

    mean: Array
    cov: Array
