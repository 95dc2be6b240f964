"""Sensors: what they measure, how well, and from where. Arguments name their units.

A sensor is frozen data. `components(motion)` gives the formulas of what it measures, in the order
in which a plot `z` holds them: range, azimuth, elevation, heights, range rate, those that it has.
A plot is an array (k,), SI units and radians, NaN where a component was not measured.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from boresight.errors import UsageError
from boresight.maths.frames import Site, ellipsoid_height
from boresight.models.components import FORMULAS, Component
from boresight.models.motion import OFFSET, Motion

Array = Any
_RADIANS = np.pi / 180.0
_SIGMAS = (
    "range_m",
    "azimuth_deg",
    "elevation_deg",
    "height_m",
    "pressure_altitude_m",
    "range_rate_mps",
)


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Where a sensor stands in the track frame, how it is turned, and how it moves.

    Attributes:
        position_m: (3,), in the track frame.
        rotation: (3, 3); rows are the sensor's axes in the track frame.
        velocity_mps: (3,), in the track frame.

    Each may have leading axes (lanes, steps): a moving platform is a pose for every step.
    """

    position_m: Array = field(default_factory=lambda: np.zeros(3), metadata={"shape": (3,)})
    rotation: Array = field(default_factory=lambda: np.eye(3), metadata={"shape": (3, 3)})
    velocity_mps: Array = field(default_factory=lambda: np.zeros(3), metadata={"shape": (3,)})


class Sensor(Protocol):
    """What a filter needs to know of a sensor."""

    @property
    def names(self) -> tuple[str, ...]:
        """What a plot of this sensor holds, in order, with units."""

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """The formulas of what is measured, for states of `motion`."""


@dataclass(frozen=True, kw_only=True)
class Radar:
    """A radar; its arguments are the standard deviations of what it measures.

    Attributes:
        range_m: slant range, m; None for a sensor that measures no range.
        azimuth_deg: azimuth, degrees.
        elevation_deg: elevation, degrees; None where it is not measured.
        height_m: reported height above the ellipsoid, m; needs `site`.
        pressure_altitude_m: what a transponder reports, m; needs `site`. It differs from the
            height by an offset that weather makes; a motion `WithHeightOffset` carries that.
        range_rate_mps: range rate, m/s, positive when opening.
        pose: None for a fixed radar at the origin of the track frame, along its axes.
        site: place of the track frame's origin; needed only for `height_m`. The frame is then
            x = North, y = East, z = up.
    """

    range_m: Any = None
    azimuth_deg: Any = None
    elevation_deg: Any = None
    height_m: Any = None
    pressure_altitude_m: Any = None
    range_rate_mps: Any = None
    pose: Pose | None = None
    site: Site | None = None

    def __post_init__(self) -> None:
        """Numbers become floats or arrays, and are checked."""
        for name in _SIGMAS:
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _sigma(name, value))
        if self.site is None and not (self.height_m is None and self.pressure_altitude_m is None):
            raise UsageError(
                "a radar that is told heights needs a site",
                why="height above the ellipsoid depends on where the frame's origin is",
                next_step="pass site=Site(latitude_deg=..., longitude_deg=..., height_m=...)",
            )

    @property
    def names(self) -> tuple[str, ...]:
        """What a plot of this sensor holds, in order."""
        given = {
            "range_m": self.range_m,
            "azimuth_rad": self.azimuth_deg,
            "elevation_rad": self.elevation_deg,
            "height_m": self.height_m,
            "pressure_altitude_m": self.pressure_altitude_m,
            "range_rate_mps": self.range_rate_mps,
        }
        return tuple(name for name, sigma in given.items() if sigma is not None)

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """The formulas of what is measured, for states of `motion`."""
        return tuple(self._component(name, motion) for name in self.names)

    def _component(self, name: str, motion: Motion) -> Component:
        if name in ("height_m", "pressure_altitude_m"):
            return Component(name, self._height(name, motion), getattr(self, name))
        formula, sigma = FORMULAS[name], getattr(self, name.replace("_rad", "_deg"))
        if name.endswith("_rad"):
            sigma = sigma * _RADIANS

        def value(state: Array) -> Any:
            return formula(*self.relative(state, motion.dims))

        return Component(name, value, sigma)

    def relative(self, state: Array, dims: int) -> tuple[Array, Array]:
        """Position and velocity (dims,) relative to the sensor, in the sensor's frame."""
        p = state[:dims]
        v = state[dims : 2 * dims] if len(state) >= 2 * dims else p * 0.0
        if self.pose is None:
            return p, v
        turn = self.pose.rotation[:dims, :dims]
        return (
            turn @ (p - self.pose.position_m[:dims]),
            turn @ (v - self.pose.velocity_mps[:dims]),
        )

    def _height(self, name: str, motion: Motion) -> Callable[[Array], Any]:
        has_offset = name == "pressure_altitude_m" and OFFSET in motion.names

        def value(state: Array) -> Any:
            north, east, up = state[: motion.dims]
            height = ellipsoid_height(east, north, up, self.site)  # type: ignore[arg-type]
            return height + state[motion.names.index(OFFSET)] if has_offset else height

        return value


def _sigma(name: str, value: Any) -> Any:
    sigma = float(value) if np.ndim(value) == 0 else np.asarray(value, dtype=float)
    if not np.all(np.asarray(sigma) > 0):
        raise UsageError(
            f"{name}={value!r} is not a standard deviation",
            why="it must be positive",
            next_step=f"leave {name} out if the sensor does not measure it",
        )
    return sigma


@dataclass(frozen=True, kw_only=True)
class PositionSensor:
    """A sensor that measures coordinates of the track frame: multilateration, GPS.

    Attributes:
        x_m, y_m, z_m: standard deviations, m; z_m is None for a planar sensor.
    """

    x_m: Any
    y_m: Any
    z_m: Any = None

    def __post_init__(self) -> None:
        """Numbers become floats or arrays, and are checked."""
        for name in self.names:
            object.__setattr__(self, name, _sigma(name, getattr(self, name)))

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates that are measured."""
        return ("x_m", "y_m") if self.z_m is None else ("x_m", "y_m", "z_m")

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """Each coordinate of the state's position."""
        if motion.dims < len(self.names):
            raise UsageError(f"a sensor of {self.names} cannot see a motion in {motion.dims} dims")
        return tuple(
            Component(name, lambda state, i=i: state[i], getattr(self, name))
            for i, name in enumerate(self.names)
        )


def Bearings(*, azimuth_deg: Any, pose: Pose | None = None) -> Radar:
    """A passive sensor that measures bearings only (degrees, standard deviation)."""
    return Radar(azimuth_deg=azimuth_deg, pose=pose)
