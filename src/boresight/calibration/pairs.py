"""Plots beside where the reference says their targets were: what a registration is made from."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.maths import wrap
from boresight.models.components import FORMULAS
from boresight.models.systematic import design

Array = Any


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Plots of one radar, each with its target's place and velocity from a reference.

    Attributes:
        time_s: (m,) of the plots, as they are stamped.
        target: (m,) number of the target, from 0: what clusters errors.
        names: identity of each target.
        channels: what is compared, of `models.systematic.CHANNELS`.
        z: (m, k) what the radar measured, m and rad; NaN where it did not.
        position: (m, 3) of the target at the plot's time, m: north, east, up at the radar.
        velocity: (m, 3) of the target, m/s.
        height_m: (m,) of the target above the ellipsoid.
        accuracy_m: (m,) standard deviation of the reference's position, NaN where not stated.
        row: (m,) of the plot in its table.
    """

    time_s: Array
    target: Array
    names: tuple[str, ...]
    channels: tuple[str, ...]
    z: Array
    position: Array
    velocity: Array
    height_m: Array
    accuracy_m: Array
    row: Array

    def __len__(self) -> int:
        """Number of pairs."""
        return len(self.time_s)

    def take(self, which: Array) -> "Pairs":
        """Some of the pairs, by mask or rows; targets keep their numbers and names."""
        kept = {name: getattr(self, name)[which] for name in _COLUMNS}
        return Pairs(names=self.names, channels=self.channels, **kept)

    def expected(self) -> Array:
        """(m, k) what a radar without errors would have measured."""
        p, v = np.moveaxis(self.position, -1, 0), np.moveaxis(self.velocity, -1, 0)
        return np.stack([FORMULAS[name](p, v) for name in self.channels], axis=-1)

    def residuals(self) -> Array:
        """(m, k) measured minus expected, angles wrapped; NaN where nothing was measured."""
        difference = self.z - self.expected()
        angles = [name.endswith("_rad") for name in self.channels]
        return np.where(angles, wrap(difference), difference)

    def design(self, terms: tuple[str, ...]) -> Array:
        """(m, k, n) what one unit of each term adds to the residuals."""
        return design(terms, self.channels, self.position, self.velocity)


_COLUMNS = (
    "time_s",
    "target",
    "z",
    "position",
    "velocity",
    "height_m",
    "accuracy_m",
    "row",
)
