"""What a sensor measures, one formula for each quantity, in the sensor's own frame.

A component takes the target's position p (3,) or (2,) and velocity v relative to the sensor, in the
sensor's frame, and gives one number. Angles count from the frame's x axis towards y; surveillance
frames have x = North and y = East, so azimuth is clockwise from North. Distances are floored at
1 mm before anything is divided by them: a target at the sensor, or right above it, gives a finite
value and a finite gradient.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.maths import select
from boresight.maths.angles import wrap

Array = Any
_FLOOR = 1e-6  # m², the square of 1 mm


def _root(square: Any) -> Any:
    """Square root that stays away from zero, where its slope is infinite."""
    return np.sqrt(select(square < _FLOOR, _FLOOR, square))


def _off_axis(p: Array) -> tuple[Any, Any]:
    """(x, y) moved 1 mm off the vertical axis if it lies on it: azimuth stays regular."""
    on_axis = p[0] * p[0] + p[1] * p[1] < _FLOOR
    return select(on_axis, 1e-3, p[0]), select(on_axis, 0.0, p[1])


def range_m(p: Array, v: Array) -> Any:
    """Distance, m. Paper: kashyap (2), aditya (1)."""
    del v
    return _root(sum(x * x for x in p))


def azimuth_rad(p: Array, v: Array) -> Any:
    """Angle from x towards y, rad. Paper: kashyap (2), aditya (2), erratum K11 (arctan2)."""
    del v
    x, y = _off_axis(p)
    return np.arctan2(y, x)


def elevation_rad(p: Array, v: Array) -> Any:
    """Angle above the x-y plane, rad. Paper: kashyap (2), aditya (3)."""
    del v
    return np.arctan2(p[2], _root(p[0] * p[0] + p[1] * p[1]))


def cone_rad(p: Array, v: Array) -> Any:
    """Angle off the sensor's x axis, 0 to pi, rad: what a line array hears, on a cone about it."""
    del v
    return np.arctan2(_root(sum(x * x for x in p[1:])), p[0])


def range_rate_mps(p: Array, v: Array) -> Any:
    """Rate of distance, m/s, positive when opening (the opposite sign of a closing speed)."""
    return sum(x * u for x, u in zip(p, v, strict=True)) / range_m(p, v)


def azimuth_legs(p: Array) -> tuple[Any, Any]:
    """(x, y) whose arctan2(y, x) the azimuth is."""
    return _off_axis(p)


def cone_legs(p: Array) -> tuple[Any, Any]:
    """(x, |y|) whose arctan2(|y|, x) the cone's angle is, in the plane."""
    return p[0], _root(p[1] * p[1])


@dataclass(frozen=True)
class Component:
    """One measured number of a plot.

    Attributes:
        name: `range_m`, `azimuth_rad`, `elevation_rad`, `cone_rad`, `height_m`,
            `pressure_altitude_m`, `range_rate_mps`, or a coordinate.
        value: formula of the state (n,).
        sigma: standard deviation, in the unit of the name.
        legs: of an angle in a plane: the state (n,) to (x, y), linear in the state, whose
            arctan2(y, x) it is; None for everything else.
    """

    name: str
    value: Callable[[Array], Any]
    sigma: Any
    legs: Callable[[Array], tuple[Any, Any]] | None = None

    @property
    def is_angle(self) -> bool:
        """Angles wrap because the quantity is an angle."""
        return self.name.endswith("_rad")

    def residual(self, measured: Any, predicted: Any) -> Any:
        """Measured minus predicted, wrapped to (-pi, pi] for an angle (erratum K10)."""
        difference = measured - predicted
        return wrap(difference) if self.is_angle else difference


FORMULAS: dict[str, Callable[[Array, Array], Any]] = {
    "range_m": range_m,
    "azimuth_rad": azimuth_rad,
    "elevation_rad": elevation_rad,
    "cone_rad": cone_rad,
    "range_rate_mps": range_rate_mps,
}
