"""Filtering tracks of unequal length as lanes: start, run, restart where a track keeps rejecting.

The inside frame is x = North, y = East, z = up at the site, so that azimuth counts from x towards y
as in the papers. The last state is pressure altitude minus height (motion `WithHeightOffset`).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from boresight.filters.consider import with_errors
from boresight.filters.recursion import Recursion, run_recursion
from boresight.filters.start import from_polar, one_plot
from boresight.maths import Gaussian
from boresight.maths.frames import Site, enu_at_height
from boresight.models.considered import Considered, ConsideredRadar, own_states
from boresight.models.motion import Motion
from boresight.tracking.gating import ManoeuvreGate

Array = Any
# What a manoeuvre may do, as a standard deviation: 3 m/s² standing (a car), 8 at 100 m/s (a light
# aircraft in a steep turn), 15.5 at 250 m/s. An airliner's turn makes a third of that, but a filter
# set for straight flight lags, and its lag must not look like a wild plot.
MANOEUVRE_MPS2 = 3.0
MANOEUVRE_RADPS = 0.05
GATE = 16.27  # 99.9 % of chi-square with three degrees of freedom
PATIENCE = 3  # rejections in a row after which a track starts anew
SPEED_MPS = 200.0  # spread of a new track's velocity, horizontal
CLIMB_MPS = 15.0  # and vertical: 3,000 feet a minute
OFFSET_M = 200.0  # spread of pressure altitude about height: pressure and temperature of the day
CELLS = 60_000  # lanes times steps of one call: bounds the memory
OUTPUTS = ("mean", "cov", "nis", "dof", "loglik", "innovation", "variance", "status", "inside")


@dataclass(frozen=True, eq=False)
class Flights:
    """Plots sorted by track and time, as plain arrays.

    Attributes:
        time: (m,) s.
        z: (m, 3) slant range m, azimuth rad, pressure altitude m (NaN where not reported); (m, 2)
            for a radar that hears no altitudes.
        track: (m,) track number, ascending.
    """

    time: Array
    z: Array
    track: Array

    def segments(self) -> Array:
        """(tracks, 2) first row and row after the last of each track."""
        cuts = np.flatnonzero(np.diff(self.track)) + 1
        edges = np.concatenate([[0], cuts, [len(self.track)]])
        return np.stack([edges[:-1], edges[1:]], axis=-1)


@dataclass(frozen=True, eq=False)
class Filtered:
    """What the filter says at every plot: arrays (m, ...) beside those of `Flights`.

    `started` marks the plots that a track started or restarted from; `inside` is 0 where the gate
    turned a plot away.
    """

    values: dict[str, Array]
    started: Array
    restarts: Array

    def __getitem__(self, name: str) -> Array:
        """An output of the filter by name."""
        return self.values[name]


def fly(flights: Flights, recursion: Recursion, site: Site) -> Filtered:
    """Filter every track; a track that rejects three plots in a row starts anew from the first.

    Args:
        flights: plots by track.
        recursion: filter, motion and sensor, without a guard.
        site: of the radar, origin of the frame.
    """
    m, n, k = len(flights.time), own_states(recursion.motion), len(recursion.sensor.names)
    shapes = {"mean": (n,), "cov": (n, n), "innovation": (k,), "variance": (k,)}
    values = {name: np.full((m, *shapes.get(name, ())), np.nan) for name in OUTPUTS}
    started, restarts = np.zeros(m, dtype=bool), np.zeros(m, dtype=bool)
    waiting = flights.segments()
    while len(waiting):
        started[waiting[:, 0]] = True
        for batch in _batches(waiting):
            _run(flights, batch, recursion, site, values)
        waiting = _broken(waiting, values["inside"])
        restarts[waiting[:, 0]] = True
    return Filtered(values, started, restarts)


def _batches(segments: Array) -> list[Array]:
    """Segments of like length together, so that padding costs little."""
    lengths = segments[:, 1] - segments[:, 0]
    ordered = segments[np.argsort(-lengths, kind="stable")]
    batches, first = [], 0
    while first < len(ordered):
        longest = int(ordered[first, 1] - ordered[first, 0])
        count = max(1, CELLS // max(longest, 1))
        batches.append(ordered[first : first + count])
        first += count
    return batches


def _broken(segments: Array, inside: Array) -> Array:
    """Rest of every segment from its first PATIENCE rejections in a row."""
    again = []
    for first, last in segments.tolist():
        out = inside[first:last] < 0.5
        out[0] = False  # a start is no rejection, even of a filter that cannot start
        streak = out.copy()
        for i in range(1, PATIENCE):
            streak[:-i] &= out[i:]
            streak[len(streak) - i :] = False
        if streak.any():
            again.append((first + int(np.argmax(streak)), last))
    return np.array(again, dtype=int).reshape(-1, 2)


def _run(
    flights: Flights, batch: Array, recursion: Recursion, site: Site, values: dict[str, Array]
) -> None:
    lengths = batch[:, 1] - batch[:, 0]
    steps = np.arange(int(lengths.max()))
    there = steps < lengths[:, None]
    rows = np.where(there, batch[:, :1] + steps, batch[:, 1:] - 1)
    z = np.where(there[..., None], flights.z[rows], np.nan)
    dt = np.diff(flights.time[rows], axis=1, prepend=flights.time[rows[:, :1]])
    start = begin(z[:, 0], recursion, site)
    z[:, 0] = np.nan  # it made the start; using it again would count it twice
    estimate = run_recursion(gated(recursion, dt), z, dt, start, outputs=OUTPUTS)
    for name in OUTPUTS:
        own = tuple(slice(size) for size in values[name].shape[1:])  # errors are not the target's
        values[name][rows[there]] = getattr(estimate, name)[there][:, *own]


def gated(recursion: Recursion, dt: Array) -> Recursion:
    """The same with the gate that every track has, for plots dt seconds apart."""
    gate = ManoeuvreGate(
        half_dt2=0.5 * dt * dt,
        accel_mps2=MANOEUVRE_MPS2,
        turn_radps=MANOEUVRE_RADPS,
        limit=GATE,
        dims=recursion.motion.dims,
    )
    return replace(recursion, guard=gate)


def begin(z: Array, recursion: Recursion, site: Site) -> Gaussian:
    """A start from one plot each: position from range, azimuth and altitude, velocity unknown.

    Args:
        z: (lanes, 2 or 3) first plots; an altitude that is missing is guessed from the range,
            widely. Without altitudes the track stays in the plane.
        recursion: for the noise of the sensor, and its errors if they are considered.
        site: of the radar.
    """
    motion, sensor = recursion.motion, recursion.sensor
    if isinstance(motion, Considered) and isinstance(sensor, ConsideredRadar):
        return with_errors(_begin(z, motion.inner, sensor.radar, site), motion, sensor)
    return _begin(z, motion, sensor, site)


def _begin(z: Array, motion: Motion, radar: Any, site: Site) -> Gaussian:
    """The target's own start."""
    if motion.dims == 2:
        return one_plot(z, motion, radar, speed_mps=SPEED_MPS)
    distance, azimuth, altitude = z.T
    known = np.isfinite(altitude)
    height = np.where(known, altitude, np.minimum(0.35 * distance, 5_000.0))
    spread = np.where(known, OFFSET_M, np.minimum(0.5 * distance, 4_000.0))
    enu = enu_at_height(distance, azimuth, height, site)
    position = np.stack([enu[:, 1], enu[:, 0], enu[:, 2]], axis=-1)
    elevation = np.arcsin(np.clip(position[:, 2] / distance, -0.999, 0.999))
    _, J = from_polar(np.stack([distance, azimuth, elevation], axis=-1))
    level = distance * np.cos(elevation)  # metres of height for a radian of elevation
    variances = np.stack(
        [
            np.full(len(z), radar.range_m**2),
            np.full(len(z), np.radians(radar.azimuth_deg) ** 2),
            (spread**2 + radar.pressure_altitude_m**2) / level**2,
        ],
        axis=-1,
    )
    n = len(motion.names)
    mean, cov = np.zeros((len(z), n)), np.zeros((len(z), n, n))
    mean[:, :3] = position
    cov[:, :3, :3] = np.einsum("bij,bj,bkj->bik", J, variances, J)
    for i, sd in ((3, SPEED_MPS), (4, SPEED_MPS), (5, CLIMB_MPS), (6, OFFSET_M)):
        cov[:, i, i] = sd**2
    # The height came from the altitude, so it errs by minus the offset.
    shared = -J[:, :, 2] * (np.where(known, OFFSET_M**2, 0.0) / level)[:, None]
    cov[:, 6, :3] = cov[:, :3, 6] = shared
    return Gaussian(mean, cov)
