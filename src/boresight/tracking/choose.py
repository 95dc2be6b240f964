"""Which noise to track with: measured, then chosen by likelihood on the first half."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from boresight.filters.method import Filter
from boresight.filters.recursion import Recursion
from boresight.maths.frames import Site
from boresight.models.motion import ConstantVelocity, WithHeightOffset
from boresight.models.sensors import Radar
from boresight.tracking.flight import Flights, fly
from boresight.tracking.noise import Noise

Array = Any
ACCELERATIONS = (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.1, 1.6, 2.5, 4.0)  # m/s² per root hertz
WIDENINGS = (1.5, 2.5)
ENOUGH = 20_000  # plots to choose by: more would cost time, not certainty
WARM_UP = 8  # plots after a start until its velocity is settled


def recursion_for(chosen: Filter, noise: Noise, site: Site, dims: int) -> Recursion:
    """The filter with a radar and a motion for this noise."""
    inner = ConstantVelocity(accel_mps2=noise.accel_mps2, dims=dims, discretisation="continuous")
    if dims == 2:
        radar = Radar(range_m=noise.range_m, azimuth_deg=noise.azimuth_deg)
        return chosen.recursion(inner, radar)
    radar = Radar(
        range_m=noise.range_m,
        azimuth_deg=noise.azimuth_deg,
        pressure_altitude_m=noise.altitude_m,
        site=site,
    )
    return chosen.recursion(WithHeightOffset(inner=inner, drift_m_per_sqrt_s=0.5), radar)


def first_part(flights: Flights, until: float) -> Array:
    """Rows of whole tracks in the first half, at most ENOUGH, the longest tracks first."""
    early = flights.time < until
    track = flights.track[early]
    counts = np.bincount(track, minlength=int(flights.track.max()) + 1)
    order = np.argsort(-counts, kind="stable")
    kept = order[np.cumsum(counts[order]) - counts[order] < ENOUGH]
    return np.flatnonzero(early & np.isin(flights.track, kept))


def warmed_up(flights: Flights, started: Array) -> Array:
    """Whether a plot comes at least WARM_UP plots after its track's latest start."""
    rows = np.arange(len(flights.time))
    latest = np.maximum.accumulate(np.where(started, rows, 0))
    return rows - latest >= WARM_UP


def _peak(score: Callable[[float], float]) -> float:
    """The best of ACCELERATIONS: of every other one, then of its neighbours."""
    best = max(ACCELERATIONS[::2], key=score)
    place = ACCELERATIONS.index(best)
    return max(ACCELERATIONS[max(place - 1, 0) : place + 2], key=score)


def choose_noise(
    flights: Flights,
    straight: Array,
    measured: Noise,
    chosen: Filter,
    site: Site,
    until: float,
    *,
    held: bool = False,
) -> Noise:
    """The process noise, and widening of the measured noise, of the highest likelihood.

    Args:
        flights: plots by track.
        straight: (m,) plots in straight flight; only they are scored.
        measured: white noise of the plots.
        chosen: filter.
        site: of the radar.
        until: only plots before this time are used; the rest can then test the choice.
        held: the noise of range and azimuth is known, and not widened.
    """
    rows = first_part(flights, until)
    part = Flights(flights.time[rows], flights.z[rows], flights.track[rows])
    dims = flights.z.shape[1]

    def wide(widening: float, acceleration: float) -> Noise:
        radar = 1.0 if held else widening
        return replace(
            measured,
            range_m=measured.range_m * radar,
            azimuth_deg=measured.azimuth_deg * radar,
            altitude_m=measured.altitude_m * widening,
            accel_mps2=acceleration,
        )

    @cache
    def score(widening: float, acceleration: float) -> float:
        noise = wide(widening, acceleration)
        result = fly(part, recursion_for(chosen, noise, site, dims), site)
        scored = straight[rows] & warmed_up(part, result.started) & (result["dof"] > 0)
        mean = float(np.mean(result["loglik"][scored])) if scored.any() else -np.inf
        return mean if np.isfinite(mean) else -np.inf  # a filter that fails is never the best

    acceleration = _peak(lambda a: score(1.0, a))
    widening, best = 1.0, score(1.0, acceleration)
    for wider in WIDENINGS:  # more sensor noise asks for less process noise
        place = ACCELERATIONS.index(acceleration)
        found = max((score(wider, a), a) for a in ACCELERATIONS[max(place - 1, 0) : place + 1])
        if found[0] <= best:
            break
        widening, (best, acceleration) = wider, found
    return wide(widening, acceleration)
