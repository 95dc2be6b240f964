"""Known truth as knots of position and velocity, and how far tracks are from it.

Knots are a table with `flight`, `callsign`, `address`, `time_s`, `east_m` ... `up_mps`: ENU at a
site. Between two knots of a flight the truth is the cubic that has both their positions and
velocities (Hermite); outside a flight's knots there is none (NaN).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boresight.maths.gaussian import Array

if TYPE_CHECKING:
    import polars as pl

_AXES = ("east", "north", "up")
_FLIGHT_APART_S = 1e7  # longer than any recording: makes (flight, time) one ascending number


class Motion(NamedTuple):
    """Positions and velocities, ENU, (n, 3) each, m and m/s."""

    position: Array
    velocity: Array


@dataclass(frozen=True)
class Truth:
    """Every flight's knots, in the order of flight and time."""

    knots: "pl.DataFrame"

    def at(self, flight: Array, time_s: Array) -> Motion:
        """Where flights (n,) were at times (n,), and how fast; NaN where that is not known."""
        key = np.asarray(flight) * _FLIGHT_APART_S + time_s
        after = np.clip(np.searchsorted(self._key, key, side="right"), 1, len(self._key) - 1)
        start, end = after - 1, after
        step = self._key[end] - self._key[start]
        known = (step < _FLIGHT_APART_S / 2) & (self._key[start] <= key) & (key <= self._key[end])
        s = np.where(known, (key - self._key[start]) / step, np.nan)[:, None]
        return _hermite(s, step[:, None], self._at(start), self._at(end))

    @cached_property
    def _key(self) -> Array:
        columns = self.knots["flight"].to_numpy(), self.knots["time_s"].to_numpy()
        return columns[0] * _FLIGHT_APART_S + columns[1]

    @cached_property
    def _motion(self) -> Motion:
        position = self.knots.select(f"{axis}_m" for axis in _AXES).to_numpy()
        velocity = self.knots.select(f"{axis}_mps" for axis in _AXES).to_numpy()
        return Motion(position, velocity.astype(float))

    def _at(self, rows: Array) -> Motion:
        return Motion(self._motion.position[rows], self._motion.velocity[rows])


def _hermite(s: Array, step: Array, a: Motion, b: Motion) -> Motion:
    """Cubic with the motions `a` at s = 0 and `b` at s = 1, and its derivative in time."""
    chord = b.position - a.position
    bend_a, bend_b = a.velocity * step - chord, chord - b.velocity * step
    bow = (1 - s) * bend_a + s * bend_b
    position = a.position + s * chord + s * (1 - s) * bow
    slope = chord + (1 - 2 * s) * bow + s * (1 - s) * (bend_b - bend_a)
    return Motion(position, slope / step)
