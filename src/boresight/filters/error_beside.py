"""One plot beside its reference, channel by channel: formulas for one target.

Paper: kashyap (2), (3) and section 2.1, dZ.
Differs from it: dZ is reference minus plot, wrapped in angles (errata K6, K10); any pose, the plane
too; the reference's own noise.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.maths import gradient, mirror, missing, select, wrap
from boresight.models.components import FORMULAS, Component
from boresight.models.conversions import convert
from boresight.models.error_model import ErrorModel
from boresight.models.sensors import Radar

Array = Any
POLAR, CARTESIAN = ("range_m", "azimuth_rad", "elevation_rad"), ("x_m", "y_m", "z_m")
_RADIANS = np.pi / 180.0


@dataclass(frozen=True)
class Case:
    """A model, a sensor and a number of axes: what decides the formula.

    Attributes:
        model: what the error is taken to be.
        sensor: what measured the plots.
        dims: axes of the reference, 2 or 3.
    """

    model: ErrorModel
    sensor: Radar
    dims: int

    @property
    def polar(self) -> bool:
        """Whether channels are range and angles."""
        return self.model.frame == "polar"

    @property
    def measured(self) -> tuple[str, ...]:
        """Components of the sensor that the channels are made of."""
        wanted = POLAR[: self.dims]
        if self.dims == 2 and POLAR[2] in self.sensor.names:
            raise UsageError(
                "a reference in the plane, and a radar that measures elevation",
                next_step="give positions (x, y, z)",
            )
        found = tuple(name for name in wanted if name in self.sensor.names)
        if not found or not (self.polar or found == wanted):
            raise UsageError(
                f"a sensor of {', '.join(self.sensor.names)} gives no {self.model.frame} plots "
                f"in {self.dims} dimensions",
                next_step='use frame="polar" and a sensor of range or angles',
            )
        return found

    @property
    def columns(self) -> list[int]:
        """Where in a plot they stand."""
        return [self.sensor.names.index(name) for name in self.measured]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, with units."""
        return self.measured if self.polar else CARTESIAN[: self.dims]

    def is_angle(self, channel: int) -> bool:
        """Whether a channel is an angle."""
        return self.channels[channel].endswith("_rad")

    def drift(self, channel: int) -> Any:
        """The model's drift in the channel's unit."""
        return self.model.drift_deg * _RADIANS if self.is_angle(channel) else self.model.drift_m

    @property
    def sigma(self) -> list[Any]:
        """The sensor's standard deviations of what is measured, m and rad."""
        given = [getattr(self.sensor, name.replace("_rad", "_deg")) for name in self.measured]
        return [
            s * _RADIANS if name.endswith("_rad") else s
            for name, s in zip(self.measured, given, strict=True)
        ]


class Beside(NamedTuple):
    """One plot beside its reference, by channel.

    Attributes:
        plot: (c,) as measured, NaN where missing.
        difference: (c,) reference minus plot, NaN where one is missing.
        noise: (c, c) of the plot, as the sensor has it.
        blur: (c,) variances of the reference.
    """

    plot: Array
    difference: Array
    noise: Array
    blur: Array


def beside(case: Case, z: Array, reference: Array) -> Beside:
    """A plot (k,) and a reference position (d,) in the channels of the case."""
    return (_polar if case.polar else _cartesian)(case, z, reference)


def _polar(case: Case, z: Array, reference: Array) -> Beside:
    """Range and angles as measured, and those of the reference as the sensor would see it."""
    place, gone = _safe(reference)
    rows = []
    for i, name in zip(case.columns, case.measured, strict=True):
        component = Component(name, partial(_seen, case, name), 0.0)
        seen, h = gradient(component.value, place)
        rows.append((z[i], select(gone, np.nan, component.residual(seen, z[i])), h @ h))
    plot, differences, slopes = (np.array(each) for each in zip(*rows, strict=True))
    noise = np.diag(np.array([s * s for s in case.sigma]))
    return Beside(plot, differences, noise, slopes * _blur(case))


def _seen(case: Case, name: str, place: Array) -> Any:
    return FORMULAS[name](*case.sensor.relative(place, case.dims))


def _cartesian(case: Case, z: Array, reference: Array) -> Beside:
    """The plot as a point of the track frame (3), and J R J' for its noise."""
    d = case.dims
    polar, gone = _safe(np.array([z[i] for i in case.columns]))
    point, noise = convert("conventional", polar, case.sigma)
    if case.sensor.pose is not None:
        turn = case.sensor.pose.rotation[:d, :d]
        point = turn.T @ point + case.sensor.pose.position_m[:d]
        noise = turn.T @ noise @ turn
    if case.model.noise == "diagonal":
        noise = np.diag(np.diag(noise))
    point = np.array([select(gone, np.nan, each) for each in point])
    return Beside(point, reference - point, mirror(noise), np.ones(d) * _blur(case))


def _safe(numbers: Array) -> tuple[Array, Any]:
    """The numbers, all 1 where one of them is missing, and whether one is."""
    gone = missing(sum(numbers))
    return np.array([select(gone, 1.0, each) for each in numbers]), gone


def _blur(case: Case) -> Any:
    return case.model.reference_m * case.model.reference_m


def back(case: Case, z: Array, plot: Array) -> Array:
    """A whole polar plot (k,) with its corrected channels (c,), angles wrapped."""
    whole = [*z]
    for i, name, value in zip(case.columns, case.measured, plot, strict=True):
        whole[i] = wrap(value) if name.endswith("_rad") else value
    return np.array(whole)
