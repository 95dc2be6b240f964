"""Scenarios from plain numbers: through waypoints, along a recording, at random.

All are in a frame whose x is North, y East and z up at the sensor's place, as a radar with a site
has it; courses and azimuths are clockwise from North. A track begins from its first plot unless
`begin` says otherwise. Every further field of `Scenario` (`detection`, `bias`, `false_plots`, ...)
is taken as a keyword.
"""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.flight_path import at, pieces
from boresight.experiments.scenario import Scenario
from boresight.experiments.spreads import Annulus, Spread, Uniform, spread, towards
from boresight.filters.start import SPEED_MPS
from boresight.maths.frames import Site
from boresight.models.checks import as_number, positive
from boresight.models.motion import ConstantVelocity, Motion
from boresight.models.sensors import Sensor

if TYPE_CHECKING:
    from boresight.experiments.recorded_path import Source

Array = Any
TURN_MPS2 = 4.6  # an airliner that banks 25 degrees
_NEAR_M = 1_000.0  # spread of each coordinate of a given path's start, to a filter told nothing
_ANYWHERE = Uniform(0.0, 360.0)


def waypoints(
    points_m: Array,
    *,
    speed_mps: float | Sequence[float],
    accel_mps2: float = TURN_MPS2,
    dt_s: float,
    sensor: Sensor,
    scans: int | None = None,
    motion: Motion | None = None,
    name: str = "waypoints",
    **others: Any,
) -> Scenario:
    """A flight by waypoints: straight legs, joined by level turns that touch both legs.

    Args:
        points_m: (p, 2) North and East, or (p, 3) with height above the frame's plane. Heights
            change evenly along the straight of each leg.
        speed_mps: over the ground: one for the whole flight, or one at each waypoint, between which
            a straight is flown with even acceleration.
        accel_mps2: towards the centre of every turn.
        dt_s: s between scans.
        sensor: what sees the target.
        scans: how many; left out, as many as the path lasts.
        motion: how filters believe that it moves, unless told otherwise; left out, constant
            velocity disturbed by as much acceleration as a turn has.
        name: of the scenario; the cell of its random numbers.
        others: further fields of `Scenario`.

    Raises:
        UsageError: fewer than two waypoints, two at one place, a turn for which there is no room.
    """
    points = np.asarray(as_number("points_m", points_m))
    if points.ndim != 2 or len(points) < 2 or points.shape[1] not in (2, 3):
        raise UsageError(
            f"points_m has shape {points.shape}",
            why="a path needs two waypoints or more, each North and East, or with a height",
        )
    if not np.isfinite(points).all():
        raise UsageError("points_m holds what is no finite number")
    if np.ndim(speed_mps) and len(np.ravel(speed_mps)) != len(points):
        raise UsageError(
            f"{np.size(speed_mps)} speeds for {len(points)} waypoints",
            next_step="give one speed, or one at each waypoint",
        )
    speeds = np.broadcast_to(positive("speed_mps", speed_mps), len(points))
    accel, step, dims = positive("accel_mps2", accel_mps2), positive("dt_s", dt_s), points.shape[1]
    flown = pieces(np.column_stack([points, np.zeros(len(points))])[:, :3], speeds, accel)
    lasts = sum(piece.lasts for piece in flown)
    whole = int(lasts / step * (1.0 + 1e-12)) + 1
    if scans is not None and scans > whole:
        raise UsageError(
            f"scans={scans}, and the path lasts {lasts:.6g} s: {whole} scans of {step:g} s",
            next_step="give fewer scans, or another waypoint",
        )
    states = at(flown, step * np.arange(whole if scans is None else scans))
    believed = motion or ConstantVelocity(accel_mps2=accel, dims=dims)
    return _along(*states, believed, sensor=sensor, dt_s=step, name=name, **others)


def recorded(
    source: "Source",
    site: Site,
    *,
    dt_s: float,
    sensor: Sensor,
    target: str | None = None,
    scans: int | None = None,
    motion: Motion | None = None,
    name: str = "recorded",
    **others: Any,
) -> Scenario:
    """A flight that was recorded: ADS-B, system tracks, or a table of positions.

    The longest stretch without a gap is taken (over 5 s for ADS-B; a table's own rate decides, 5 to
    10 s), and the path is the local cubic through its reports (see `calibration.interpolation`).

    Args:
        source: what `calibration.references` gives or reads: a recording, a table, a frame with
            time_s, latitude_deg, longitude_deg and height_m or pressure_altitude_m.
        site: origin of the frame, where the sensor stands unless it has a pose.
        dt_s: s between scans.
        sensor: what sees the target.
        target: its name in the source: address, else Mode A code, else as the table calls it; left
            out, the one with the longest stretch.
        scans: how many from the start of the stretch; left out, as many as it lasts.
        motion: how filters believe that it moves, unless told otherwise. In two dimensions, the
            world is the plane below the target.
        name: of the scenario; the cell of its random numbers.
        others: further fields of `Scenario`.

    Raises:
        MissingInputError: there is no such file.
        DataError: it holds no positions, or no stretch of two scans.
        UsageError: there is no such target.
    """
    from boresight.experiments.recorded_path import stretch

    step = positive("dt_s", dt_s)
    states = stretch(source, site, dt_s=step, target=target, scans=scans)
    believed = motion or ConstantVelocity(accel_mps2=TURN_MPS2)
    return _along(*states, believed, sensor=sensor, dt_s=step, name=name, **others)


def random_draws(
    *,
    position: Annulus | tuple[Spread | float, Spread | float],
    speed_mps: Spread | float,
    heading_deg: Spread | float = _ANYWHERE,
    height_m: Spread | float = 0.0,
    climb_mps: Spread | float = 0.0,
    dt_s: float,
    scans: int,
    sensor: Sensor,
    motion: Motion | None = None,
    name: str = "random-draws",
    **others: Any,
) -> Scenario:
    """Targets that start anywhere, each run its own; then they move with the motion's noise.

    All spreads are independent; a plain number is always the same.

    Args:
        position: an `Annulus`, or one spread for North and one for East (a box, a normal law).
        speed_mps: over the ground.
        heading_deg: course over the ground, degrees.
        height_m: above the frame's plane; of a motion in three dimensions.
        climb_mps: upward speed; of a motion in three dimensions.
        dt_s: s between scans.
        scans: number of scans.
        sensor: what sees the target.
        motion: how targets move; further states than position and velocity start at 0. Left out,
            straight on, without noise, in three dimensions.
        name: of the scenario; the cell of its random numbers.
        others: further fields of `Scenario`; `prior_cov` is otherwise the spread of the starts.
    """
    moving = motion or ConstantVelocity(accel_mps2=0.0)
    place = position if isinstance(position, Annulus) else tuple(spread(each) for each in position)
    arrow = spread(speed_mps), spread(heading_deg)
    upward = (spread(height_m), spread(climb_mps)) if moving.dims == 3 else ()
    n = len(moving.names)
    if n < 2 * moving.dims:
        raise UsageError(
            f"a motion whose state is {', '.join(moving.names)} has no speed",
            next_step="use a motion with velocities, such as ConstantVelocity",
        )
    mean, cov = _moments(place, arrow, upward, n)
    rest = {"initial": mean, "prior_cov": cov, "begin": "one plot"} | others
    return Scenario(
        name=name,
        motion=moving,
        sensor=sensor,
        draw=partial(_drawn, place, arrow, upward),
        dt_s=positive("dt_s", dt_s),
        scans=scans,
        **rest,
    )


def _drawn(
    place: Annulus | tuple[Spread, ...],
    arrow: tuple[Spread, Spread],
    upward: tuple[Spread, ...],
    normals: Array,
) -> Array:
    """States (runs, n) of standard normals (runs, n)."""
    dims = 2 + len(upward) // 2
    states = np.zeros_like(normals)
    if isinstance(place, Annulus):
        states[:, :2] = _polar(place.of(normals[:, 0]), place.azimuth_deg.of(normals[:, 1]))
    else:
        states[:, :2] = np.stack([s.of(normals[:, i]) for i, s in enumerate(place)], axis=1)
    speed, heading = (s.of(normals[:, 2 + i]) for i, s in enumerate(arrow))
    states[:, dims : dims + 2] = _polar(speed, heading)
    for i, each in enumerate(upward):
        states[:, 2 + i * dims] = each.of(normals[:, 4 + i])
    return states


def _polar(length: Array, direction_deg: Array) -> Array:
    """(runs, 2) North and East."""
    angle = np.radians(direction_deg)
    return np.stack([length * np.cos(angle), length * np.sin(angle)], axis=1)


def _moments(
    place: Annulus | tuple[Spread, ...],
    arrow: tuple[Spread, Spread],
    upward: tuple[Spread, ...],
    n: int,
) -> tuple[Array, Array]:
    """Mean (n,) and covariance (n, n) of what `_drawn` gives, exactly."""
    dims = 2 + len(upward) // 2
    mean, cov = np.zeros(n), np.zeros((n, n))
    if isinstance(place, Annulus):
        mean[:2], cov[:2, :2] = towards(place, place.azimuth_deg)
    else:
        mean[:2] = [each.mean for each in place]
        cov[:2, :2] = np.diag([each.square - each.mean**2 for each in place])
    flat = slice(dims, dims + 2)
    mean[flat], cov[flat, flat] = towards(*arrow)
    for i, each in enumerate(upward):
        at_ = 2 + i * dims
        mean[at_], cov[at_, at_] = each.mean, each.square - each.mean**2
    return mean, cov


def _along(positions: Array, velocities: Array, motion: Motion, **others: Any) -> Scenario:
    """The scenario whose truth is given: (scans, 3) positions and velocities."""
    dims, n = motion.dims, len(motion.names)
    if n != 2 * dims:
        raise UsageError(
            f"a path tells positions and velocities, and the motion has {', '.join(motion.names)}",
            next_step="use ConstantVelocity; a filter may believe another motion",
        )
    path = np.column_stack([positions[:, :dims], velocities[:, :dims]])
    spreads = np.repeat([_NEAR_M, SPEED_MPS], dims)
    rest: dict[str, Any] = {"prior_cov": np.diag(spreads**2), "begin": "one plot"} | others
    return Scenario(motion=motion, initial=path[0], path=path, scans=len(path), **rest)
