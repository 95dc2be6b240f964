"""A path over the ground through waypoints: straight legs joined by circular turns.

A corner is cut by the circle that touches both legs: the target flies by a waypoint, not over it.
Positions and velocities are exact at every instant, not integrated.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError

Array = Any
_BACK = np.pi - 1e-6  # rad: a turn by more has a tangent of no length


class Piece(NamedTuple):
    """A straight or a circle's arc, on which the square of the speed changes evenly with distance.

    Attributes:
        start: (2,) m.
        course: at the start, rad from x towards y.
        length: over the ground, m.
        bend: 1/radius, 1/m, positive from x towards y; 0 of a straight.
        speeds: over the ground, at the start and at the end, m/s.
        heights: at the start and at the end, m.
    """

    start: Array
    course: Any
    length: Any
    bend: Any
    speeds: Array
    heights: Array

    @property
    def lasts(self) -> Any:
        """Seconds."""
        return 2.0 * self.length / sum(self.speeds)


def pieces(points: Array, speeds: Array, accel_mps2: float) -> list[Piece]:
    """Legs and turns through waypoints.

    Args:
        points: (p, 3) m.
        speeds: (p,) over the ground at each waypoint, m/s; a turn is flown at its waypoint's.
        accel_mps2: towards the centre of every turn.

    Raises:
        UsageError: two neighbours at one place, a turn straight back, no room for a turn.
    """
    legs = np.diff(points[:, :2], axis=0)
    lengths, courses = np.hypot(*legs.T), np.arctan2(legs[:, 1], legs[:, 0])
    if not lengths.all():
        i = int(np.argmin(lengths))
        raise UsageError(f"waypoints {i + 1} and {i + 2} are at one place on the ground")
    turns = np.concatenate([[0.0], (np.diff(courses) + np.pi) % (2.0 * np.pi) - np.pi, [0.0]])
    if np.any(np.abs(turns) > _BACK):
        i = int(np.argmax(np.abs(turns)))
        raise UsageError(
            f"the path turns straight back at waypoint {i + 1}",
            next_step="put two waypoints there, a turn's diameter apart",
        )
    radii = speeds**2 / accel_mps2
    cut = radii * np.tan(np.abs(turns) / 2.0)
    _check_room(cut, lengths)
    return [*_pieces(points, speeds, courses, turns, radii, cut)]


def _check_room(cut: Array, lengths: Array) -> None:
    """The turns at both ends of a leg leave some of it, or just nothing."""
    lacking = cut[:-1] + cut[1:] - lengths
    if np.any(lacking > 0.0):
        i = int(np.argmax(lacking))
        raise UsageError(
            f"no room for the turns on the leg from waypoint {i + 1} to {i + 2}",
            why=f"they need {cut[i] + cut[i + 1]:.0f} m, and it is {lengths[i]:.0f} m long",
            next_step="fly slower, turn harder (accel_mps2=...), or put the waypoints further "
            "apart",
        )


def _pieces(
    points: Array, speeds: Array, courses: Array, turns: Array, radii: Array, cut: Array
) -> Iterator[Piece]:
    """In the order in which they are flown; a straight of no length is left out."""
    for i, course in enumerate(courses):
        along = np.array([np.cos(course), np.sin(course)])
        first, last = points[i, :2] + cut[i] * along, points[i + 1, :2] - cut[i + 1] * along
        length = (last - first) @ along
        if length > 0.0:
            ends = slice(i, i + 2)
            yield Piece(first, course, length, 0.0, speeds[ends], points[ends, 2])
        turn, radius, both = turns[i + 1], radii[i + 1], [i + 1, i + 1]
        if turn:
            bend = np.copysign(1.0 / radius, turn)
            yield Piece(last, course, radius * abs(turn), bend, speeds[both], points[both, 2])


def at(flown: Sequence[Piece], time_s: Array) -> tuple[Array, Array]:
    """Where a target is, and how fast.

    Args:
        flown: pieces one after the other, from time 0.
        time_s: (scans,) s.

    Returns:
        Positions (scans, 3), m, and velocities (scans, 3), m/s.
    """
    ends = np.cumsum([piece.lasts for piece in flown])
    which = np.minimum(np.searchsorted(ends, time_s, side="right"), len(flown) - 1)
    each = Piece(*(np.array(column)[which] for column in zip(*flown, strict=True)))
    since = time_s - np.concatenate([[0.0], ends])[which]
    (begins, becomes), (low, high) = each.speeds.T, each.heights.T
    gain = (becomes**2 - begins**2) / (2.0 * each.length)
    gone, speed = begins * since + gain * since**2 / 2.0, begins + gain * since
    half, climb = each.bend * gone / 2.0, (high - low) / each.length
    # The chord of an arc: shorter than it by sin(h)/h, and turned by half its angle.
    chord = gone * np.sinc(half / np.pi)
    ground = each.start + (chord * _unit(each.course + half)).T
    velocity = (speed * _unit(each.course + 2.0 * half)).T
    return (
        np.column_stack([ground, low + climb * gone]),
        np.column_stack([velocity, climb * speed]),
    )


def _unit(course: Array) -> Array:
    return np.array([np.cos(course), np.sin(course)])
