"""Sensors: what they measure, how well, and from where. Arguments name their units.

A sensor is frozen data. `components(motion)` gives the formulas of what it measures, in the order
in which a plot `z` holds them: range, azimuth, elevation, heights, range rate, those that it has.
A plot is an array (k,), SI units and radians, NaN where a component was not measured.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Protocol

import numpy as np

from boresight.errors import UsageError
from boresight.maths import missing, select
from boresight.maths.frames import Site, ellipsoid_height
from boresight.models.atmosphere import EARTH_M, Atmosphere
from boresight.models.checks import as_number, rotation, standard_deviation, vector
from boresight.models.components import FORMULAS, Component, azimuth_legs, cone_legs
from boresight.models.motion import OFFSET, Motion

Array = Any
_RADIANS = np.pi / 180.0
_ROUNDS = 4  # of taking the air's effect out: each leaves a tenth of the error
_UPWARD = ("elevation_rad", "height_m", "pressure_altitude_m")  # what a plane does not have
_SIGMAS = (
    "range_m",
    "azimuth_deg",
    "elevation_deg",
    "cone_deg",
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

    Raises:
        UsageError: no three numbers, or axes that are no rotation.
    """

    position_m: Array = field(default_factory=lambda: np.zeros(3), metadata={"shape": (3,)})
    rotation: Array = field(default_factory=lambda: np.eye(3), metadata={"shape": (3, 3)})
    velocity_mps: Array = field(default_factory=lambda: np.zeros(3), metadata={"shape": (3,)})

    def __post_init__(self) -> None:
        """Numbers become arrays, and are checked; symbols of a recorded formula are left alone."""
        for each in fields(self):
            value = getattr(self, each.name)
            if not (isinstance(value, np.ndarray) and value.dtype.hasobject):
                checked = rotation(value) if each.name == "rotation" else vector(each.name, value)
                object.__setattr__(self, each.name, checked)


class Sensor(Protocol):
    """What a filter needs to know of a sensor."""

    @property
    def names(self) -> tuple[str, ...]:
        """What a plot of this sensor holds, in order, with units."""

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """The formulas of what is measured, for states of `motion`."""

    def independent(self, z: Array, motion: Motion) -> tuple[Array, tuple[Component, ...]]:
        """The plot and its components turned so that their noises are independent."""

    def coloured(self, normals: Array) -> Array:
        """Independent standard normals (k,) made as correlated as the sensor's noises are."""


@dataclass(frozen=True, kw_only=True)
class Radar:
    """A radar; its arguments are the standard deviations of what it measures.

    Attributes:
        range_m: slant range, m; None for a sensor that measures no range.
        azimuth_deg: azimuth, degrees.
        elevation_deg: elevation, degrees; None where it is not measured.
        cone_deg: angle off the pose's x axis, degrees: what a line array hears, which cannot tell
            one side of itself from the other.
        height_m: reported height above the ellipsoid, m; needs `site`.
        pressure_altitude_m: what a transponder reports, m; needs `site`. It differs from the
            height by an offset that weather makes; a motion `WithHeightOffset` carries that.
        range_rate_mps: range rate, m/s, positive when opening.
        range_rate_correlation: of the noises of range and range rate (a linear chirp couples
            them), between -1 and 1; None where they are independent.
        pose: None for a fixed radar at the origin of the track frame, along its axes.
        site: place of the track frame's origin; needed for heights and for the atmosphere. The
            frame is then x = North, y = East, z = up.
        atmosphere: the air between radar and target; None for a vacuum. Formulas are those of
            straight lines: `without_air` takes its effect out of plots before they are filtered.
    """

    range_m: Any = None
    azimuth_deg: Any = None
    elevation_deg: Any = None
    cone_deg: Any = None
    height_m: Any = None
    pressure_altitude_m: Any = None
    range_rate_mps: Any = None
    range_rate_correlation: Any = None
    pose: Pose | None = None
    site: Site | None = None
    atmosphere: Atmosphere | None = None

    def __post_init__(self) -> None:
        """Numbers become floats or arrays, and are checked."""
        for name in _SIGMAS:
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, standard_deviation(name, value))
        if self.range_rate_correlation is not None:
            _check_correlation(self)
        _check_kinds(self)
        told = (self.height_m, self.pressure_altitude_m, self.atmosphere)
        if self.site is None and any(each is not None for each in told):
            raise UsageError(
                "a radar that is told heights, or looks through air, needs a site",
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
            "cone_rad": self.cone_deg,
            "height_m": self.height_m,
            "pressure_altitude_m": self.pressure_altitude_m,
            "range_rate_mps": self.range_rate_mps,
        }
        return tuple(name for name, sigma in given.items() if sigma is not None)

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """The formulas of what is measured, for states of `motion`."""
        up = [name for name in self.names if name in _UPWARD]
        if up and motion.dims < 3:
            raise UsageError(
                f"a radar with {up[0]} cannot see a motion in {motion.dims} dimensions",
                next_step=f"use a motion with dims=3, or a radar without {', '.join(up)}",
            )
        return tuple(self._component(name, motion) for name in self.names)

    def _component(self, name: str, motion: Motion) -> Component:
        if name in ("height_m", "pressure_altitude_m"):
            return Component(name, self._height(name, motion), getattr(self, name))
        formula, sigma = FORMULAS[name], getattr(self, name.replace("_rad", "_deg"))
        if name.endswith("_rad"):
            sigma = sigma * _RADIANS

        def value(state: Array) -> Any:
            return formula(*self.relative(state, motion.dims))

        find = _legs(name, motion.dims)
        if find is None:
            return Component(name, value, sigma)

        def legs(state: Array) -> tuple[Any, Any]:
            return find(self.relative(state, motion.dims)[0])

        return Component(name, value, sigma, legs)

    def independent(self, z: Array, motion: Motion) -> tuple[Array, tuple[Component, ...]]:
        """The plot and its components; a range rate without what its noise shares with the range's.

        Where the range is missing there is nothing to take off.
        """
        parts = self.components(motion)
        if self.range_rate_correlation is None:
            return z, parts
        i, j = (self.names.index(name) for name in ("range_m", "range_rate_mps"))
        gone, (distance, rate) = missing(z[i]), (parts[i], parts[j])
        rho = select(gone, 0.0, 1.0) * self.range_rate_correlation
        slope = rho * rate.sigma / distance.sigma

        def value(state: Array) -> Any:
            return rate.value(state) - slope * distance.value(state)

        rest = Component(rate.name, value, rate.sigma * np.sqrt(1.0 - rho * rho))
        turned = [*z]
        turned[j] = z[j] - slope * select(gone, 0.0, z[i])
        return np.array(turned), (*parts[:j], rest, *parts[j + 1 :])

    def coloured(self, normals: Array) -> Array:
        """Independent standard normals (k,) with the correlation of range and range rate."""
        if self.range_rate_correlation is None:
            return normals
        i, j = (self.names.index(name) for name in ("range_m", "range_rate_mps"))
        rho, mixed = self.range_rate_correlation, [*normals]
        mixed[j] = rho * normals[i] + np.sqrt(1.0 - rho * rho) * normals[j]
        return np.array(mixed)

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

    def without_air(self, z: Array) -> Array:
        """Plots (..., k) as they would be in a vacuum: group delay and bending taken out.

        The air's effect is taken where the plot says the target is (range with altitude or
        elevation), and again where it then is; a plot that tells no height keeps its range.
        """
        if self.atmosphere is None or self.site is None:
            return z
        names, clear = self.names, np.array(z, dtype=float)
        effects = {"range_m": self.atmosphere.excess_range}
        effects["elevation_rad"] = self.atmosphere.bending
        for _ in range(_ROUNDS):
            place = (clear[..., names.index("range_m")], self._told_height(clear))
            for i, name in enumerate(names):
                if name in effects:
                    effect = effects[name](*place, self.site.height_m)
                    clear[..., i] = z[..., i] - np.nan_to_num(effect)
        return clear

    def _told_height(self, z: Array) -> Array:
        """Height above the ellipsoid, m, as the plots tell it; NaN where they do not."""
        columns = dict(zip(self.names, np.moveaxis(z, -1, 0), strict=True))
        for name in ("height_m", "pressure_altitude_m"):
            if name in columns:
                return columns[name]
        if "elevation_rad" not in columns:
            return np.full(z.shape[:-1], np.nan)
        r, el = columns["range_m"], columns["elevation_rad"]
        start = EARTH_M + self.site.height_m  # type: ignore[union-attr]
        return np.sqrt(start**2 + r**2 + 2 * start * r * np.sin(el)) - EARTH_M

    def _height(self, name: str, motion: Motion) -> Callable[[Array], Any]:
        has_offset = name == "pressure_altitude_m" and OFFSET in motion.names

        def value(state: Array) -> Any:
            north, east, up = state[: motion.dims]
            height = ellipsoid_height(east, north, up, self.site)  # type: ignore[arg-type]
            return height + state[motion.names.index(OFFSET)] if has_offset else height

        return value


def _legs(name: str, dims: int) -> Callable[[Array], tuple[Any, Any]] | None:
    """What an angle in a plane is made of; None for other components."""
    if name == "azimuth_rad":
        return azimuth_legs
    return cone_legs if name == "cone_rad" and dims < 3 else None


def _check_kinds(radar: Radar) -> None:
    """Something is measured, and a pose and a site are such."""
    if not radar.names:
        raise UsageError(
            "a radar that measures nothing", next_step="give at least one standard deviation"
        )
    for name, kind in (("pose", Pose), ("site", Site)):
        value = getattr(radar, name)
        if not isinstance(value, kind | None):
            raise UsageError(
                f"{name}={value!r} is not a {kind.__name__}",
                next_step=f"pass {name}=bs.{kind.__name__}(...)",
            )


def _check_correlation(radar: Radar) -> None:
    """It becomes a float or an array, and needs both of what it correlates."""
    rho = np.asarray(as_number("range_rate_correlation", radar.range_rate_correlation))
    if radar.range_m is None or radar.range_rate_mps is None:
        raise UsageError("a correlation of range and range rate needs a radar that measures both")
    if not np.all(np.abs(rho) < 1.0):
        raise UsageError(
            f"range_rate_correlation={radar.range_rate_correlation!r} is not a correlation",
            why="it must lie between -1 and 1",
        )
    object.__setattr__(radar, "range_rate_correlation", rho if rho.ndim else float(rho))


def Bearings(*, azimuth_deg: Any, pose: Pose | None = None) -> Radar:
    """A passive sensor that measures bearings only (degrees, standard deviation)."""
    return Radar(azimuth_deg=azimuth_deg, pose=pose)


def ConicalBearings(*, cone_deg: Any, pose: Pose) -> Radar:
    """A line array, towed or on a hull: it hears the angle off its own axis, not which side.

    Args:
        cone_deg: standard deviation of the angle, degrees.
        pose: where the array is, and its axis: the first row of `rotation`.
    """
    return Radar(cone_deg=cone_deg, pose=pose)
