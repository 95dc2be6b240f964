"""Where random targets may be: spreads of single numbers, made of standard normals.

A draw takes one standard normal for each number, whatever its law, so that worlds that differ in
one law share the rest of their random numbers.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.errors import UsageError

Array = Any


@dataclass(frozen=True)
class Uniform:
    """Between two values, all alike."""

    low: float
    high: float

    def __post_init__(self) -> None:
        if not (np.isfinite([self.low, self.high]).all() and self.low <= self.high):
            raise UsageError(f"{self} is no interval", next_step="give the lower value first")

    def of(self, normal: Array) -> Array:
        """One value for each standard normal."""
        from scipy.special import ndtr

        return self.low + (self.high - self.low) * ndtr(normal)

    @property
    def mean(self) -> float:
        """Of all values."""
        return (self.low + self.high) / 2.0

    @property
    def square(self) -> float:
        """Mean of the values' squares."""
        return (self.low**2 + self.low * self.high + self.high**2) / 3.0

    def phase(self, times: int) -> complex:
        """Mean of exp(i times x), for values x in degrees."""
        half = np.radians(self.high - self.low) / 2.0
        return complex(np.exp(1j * times * np.radians(self.mean)) * np.sinc(times * half / np.pi))


@dataclass(frozen=True)
class Normal:
    """Around a mean; `sd` may be 0."""

    mean: float
    sd: float

    def __post_init__(self) -> None:
        if not (np.isfinite([self.mean, self.sd]).all() and self.sd >= 0.0):
            raise UsageError(f"{self} is no normal law", next_step="give a mean, and sd >= 0")

    def of(self, normal: Array) -> Array:
        """One value for each standard normal."""
        return self.mean + self.sd * normal

    @property
    def square(self) -> float:
        """Mean of the values' squares."""
        return self.mean**2 + self.sd**2

    def phase(self, times: int) -> complex:
        """Mean of exp(i times x), for values x in degrees."""
        mean, sd = times * np.radians([self.mean, self.sd])
        return complex(np.exp(1j * mean - sd**2 / 2.0))


Spread = Uniform | Normal


def spread(value: "Spread | float") -> Spread:
    """The spread itself, or that of a number which is always the same."""
    return value if isinstance(value, Uniform | Normal) else Normal(float(value), 0.0)


@dataclass(frozen=True)
class Annulus:
    """Between two distances from the origin, every square metre alike.

    Attributes:
        near_m, far_m: distances, m; `near_m` may be 0.
        azimuth_deg: from x towards y: clockwise from North where x is North.
    """

    near_m: float
    far_m: float
    azimuth_deg: Spread = Uniform(0.0, 360.0)

    def __post_init__(self) -> None:
        if not 0.0 <= self.near_m < self.far_m < np.inf:
            raise UsageError(
                f"near_m={self.near_m}, far_m={self.far_m} is no annulus",
                next_step="give the smaller distance first",
            )

    def of(self, normal: Array) -> Array:
        """One distance for each standard normal."""
        return np.sqrt(Uniform(self.near_m**2, self.far_m**2).of(normal))

    @property
    def mean(self) -> float:
        """Of the distance."""
        return 2.0 * (self.far_m**3 - self.near_m**3) / (3.0 * (self.far_m**2 - self.near_m**2))

    @property
    def square(self) -> float:
        """Mean of the distance's square."""
        return (self.near_m**2 + self.far_m**2) / 2.0


def towards(length: "Spread | Annulus", direction: Spread) -> tuple[Array, Array]:
    """Mean (2,) and covariance (2, 2) of an arrow of random length and independent direction."""
    once, twice = direction.phase(1), direction.phase(2)
    mean = length.mean * np.array([once.real, once.imag])
    turned = np.array([[twice.real, twice.imag], [twice.imag, -twice.real]])
    return mean, length.square * (np.eye(2) + turned) / 2.0 - np.outer(mean, mean)
