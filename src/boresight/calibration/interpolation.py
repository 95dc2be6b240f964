"""Where a reference's target was between two of its reports: local cubics, exact on the ellipsoid.

Between two neighbouring reports of one target the path is the cubic that has their positions, and
at each of them the velocity of the parabola through it and its neighbours. Velocities that reports
tell are not used: they are late in turns, and a centre's are now and then far off. Reports further
apart than the reference's longest gap are never joined.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.calibration.references import Reference
from boresight.maths.frames import Site, enu_axes, enu_from_geodetic

Array = Any
_NORTH_EAST_UP = (1, 0, 2)


@dataclass(frozen=True, eq=False)
class Paths:
    """Reports of a reference as arrays, by target and time.

    Attributes:
        time: (n,) s, on the clock of the plots.
        target: (n,) number of what may be interpolated.
        ground, upward: (n, 3) north, east, up at the site: the place at height 0, m, and what a
            metre of height adds to it.
        height: (n,) geometric, m; NaN where not known.
        pressure: (n,) pressure altitude, m; NaN where not known.
        accuracy: (n,) standard deviation of the position in one axis, m; NaN where not told.
        on_ground: (n,) whether the target says that it stands on the ground.
        longest_gap_s: over which nothing is interpolated.
    """

    time: Array
    target: Array
    ground: Array
    upward: Array
    height: Array
    pressure: Array
    accuracy: Array
    on_ground: Array
    longest_gap_s: float

    @classmethod
    def of(cls, reference: Reference, site: Site) -> "Paths":
        """The paths of a reference on its own clock, as seen from a site."""
        table = reference.table
        place = table["latitude_deg"].to_numpy(), table["longitude_deg"].to_numpy()
        ground = enu_from_geodetic(*place, 0.0, site)
        upward = _normal(*np.radians(place)) @ enu_axes(site).T
        return cls(
            time=table["time_s"].to_numpy(),
            target=table["target"].to_numpy(),
            ground=ground[:, _NORTH_EAST_UP],
            upward=upward[:, _NORTH_EAST_UP],
            height=table["height_m"].to_numpy(),
            pressure=table["pressure_altitude_m"].to_numpy(),
            accuracy=table["accuracy_m"].to_numpy(),
            on_ground=table["on_ground"].to_numpy(),
            longest_gap_s=reference.longest_gap_s,
        )

    def __post_init__(self) -> None:
        """Keys for the search: whole numbers, so that no time is rounded."""
        instants = np.unique(self.time)
        object.__setattr__(self, "_instants", instants)
        object.__setattr__(self, "_keys", self._key(self.target, self.time))

    def _key(self, target: Array, time: Array) -> Array:
        instants = self._instants  # type: ignore[attr-defined]
        rank = np.searchsorted(instants, time, side="right")
        return target.astype(np.int64) * (len(instants) + 1) + rank

    def before(self, target: Array, time: Array) -> Array:
        """(m,) row of the report before each time, -1 where no two reports enclose it closely.

        Args:
            target: (m,) numbers of targets.
            time: (m,) s.
        """
        keys = self._keys  # type: ignore[attr-defined]
        found = np.searchsorted(keys, self._key(target, time), side="right") - 1
        last = max(len(keys) - 2, 0)
        at: Array = np.clip(found, 0, last)
        # The last report of a target stands for its own instant.
        ends = (self.time[at] == time) & ~self.joined(at)
        at = np.clip(np.where(ends, at - 1, np.minimum(found, last)), 0, last)
        after = np.minimum(at + 1, len(keys) - 1)
        inside = (self.target[at] == target) & (self.time[at] <= time) & (time <= self.time[after])
        return np.where(inside & self.joined(at), at, -1)

    def joined(self, row: Array) -> Array:
        """(m,) whether a row and the next are of one target and close enough to be joined."""
        after = np.clip(row + 1, 0, len(self.time) - 1)
        row = np.clip(row, 0, len(self.time) - 1)
        gap = self.time[after] - self.time[row]
        return (self.target[after] == self.target[row]) & (gap > 0) & (gap <= self.longest_gap_s)

    def linear(self, values: Array, row: Array, time: Array) -> Array:
        """(m,) a quantity between two reports; NaN unless both tell it."""
        share = (time - self.time[row]) / (self.time[row + 1] - self.time[row])
        return values[row] + share * (values[row + 1] - values[row])

    def told_height(self, row: Array, time: Array, site: Site) -> Array:
        """(m,) height as the reference tells it: geometric, else pressure altitude, else ground.

        Ground is at the height of the site. NaN where it tells nothing.
        """
        told = [self.linear(each, row, time) for each in (self.height, self.pressure)]
        ground = np.where(self.on_ground[row], site.height_m, np.nan)
        level = np.where(np.isnan(told[0]), told[1], told[0])
        return np.where(np.isnan(level), ground, level)

    def at(self, row: Array, time: Array, height: Array) -> tuple[Array, Array]:
        """Position and velocity between reports `row` and `row + 1`.

        Args:
            row: (m,) as `before` gives them, none of them -1.
            time: (m,) s.
            height: (m,) above the ellipsoid, m, taken where the reports do not tell theirs.

        Returns:
            (m, 3) position, m, and (m, 3) velocity, m/s: north, east, up at the site.
        """
        near = self._place(row, height), self._place(row + 1, height)
        step = self.time[row + 1] - self.time[row]
        chord = (near[1] - near[0]) / step[:, None]
        slopes = [
            self._slope(end, other, position, chord, step, height)
            for end, other, position in ((row, row - 1, near[0]), (row + 1, row + 2, near[1]))
        ]
        slopes = _completed(slopes, chord)
        return _hermite(near, slopes, step[:, None], ((time - self.time[row]) / step)[:, None])

    def line(self, row: Array, time: Array, height: Array) -> Array:
        """(m, 3) position as `at` gives it, on the straight line between two reports."""
        share = ((time - self.time[row]) / (self.time[row + 1] - self.time[row]))[:, None]
        first, last = self._place(row, height), self._place(row + 1, height)
        return (1 - share) * first + share * last

    def _place(self, row: Array, height: Array) -> Array:
        told = self.height[row]
        level = np.where(np.isnan(told), height, told)
        place: Array = self.ground[row] + level[:, None] * self.upward[row]
        return place

    def _slope(
        self,
        row: Array,
        other: Array,
        position: Array,
        chord: Array,
        step: Array,
        height: Array,
    ) -> Array:
        """(m, 3) velocity at a report: that of a parabola through the chord and the report beyond.

        NaN where there is no report beyond that may be joined.
        """
        joined = self.joined(np.minimum(row, other)) & (other >= 0) & (other < len(self.time))
        beyond = np.where(joined, other, row)
        span = np.abs(self.time[beyond] - self.time[row])
        span = np.where(joined, span, 1.0)[:, None]
        outward = (self._place(beyond, height) - position) / span
        sign = np.sign(other - row)[:, None]
        step = step[:, None]
        slope = (span * chord + step * sign * outward) / (span + step)
        return np.where(joined[:, None], slope, np.nan)


def _normal(latitude: Array, longitude: Array) -> Array:
    """(n, 3) Earth-centred direction of the ellipsoid's normal, along which heights are counted."""
    level = np.cos(latitude)
    return np.stack(
        [level * np.cos(longitude), level * np.sin(longitude), np.sin(latitude)], axis=-1
    )


def _completed(slopes: list[Array], chord: Array) -> list[Array]:
    """A slope that is not known makes the path a parabola; two, a straight line."""
    first, last = slopes
    mirrored = [2 * chord - last, 2 * chord - first]
    filled = [np.where(np.isnan(s), m, s) for s, m in zip(slopes, mirrored, strict=True)]
    return [np.where(np.isnan(s), chord, s) for s in filled]


def _hermite(
    ends: tuple[Array, Array], slopes: list[Array], step: Array, share: Array
) -> tuple[Array, Array]:
    """Value and derivative of the cubic with these ends and slopes, at a share of the step."""
    rest = 1 - share
    chord = (ends[1] - ends[0]) / step
    first, last = slopes[0] - chord, slopes[1] - chord
    bow = step * share * rest * (rest * first - share * last)
    turn = rest * (1 - 3 * share) * first + share * (3 * share - 2) * last
    return rest * ends[0] + share * ends[1] + bow, chord + turn
