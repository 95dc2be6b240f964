"""How noisy the radar is and how hard its targets fly, from the plots themselves.

Noise is the scatter about cubics through nine plots in a row. Process noise, and how much the
measured noise must be widened for what a filter cannot know, are those that make the plots of
straight flight most likely (maximum likelihood on the first half of the recording).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.tracking.flight import Flights

Array = Any
WINDOW = 9
MAD_TO_SD = 1.4826
STRAIGHT_ROLL_DEG = 2.0
ROLL_REACH_S = 25.0
STEADY_MPS2 = 0.3  # acceleration below which flight counts as straight where no roll is known


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations of the plots' white noise, and of the targets' acceleration.

    Attributes:
        range_m, azimuth_deg, altitude_m: of the sensor.
        accel_mps2: root of the density of white acceleration (m²/s³).
    """

    range_m: float
    azimuth_deg: float
    altitude_m: float
    accel_mps2: float


def windows(flights: Flights, longest_gap_s: float) -> Array:
    """First rows of WINDOW plots of one track without a gap."""
    m = len(flights.time)
    if m < WINDOW:
        return np.zeros(0, dtype=int)
    same = np.zeros(m, dtype=bool)
    same[1:] = (np.diff(flights.track) == 0) & (np.diff(flights.time) <= longest_gap_s)
    joined = np.convolve(same, np.ones(WINDOW - 1), mode="full")[WINDOW - 1 :]
    return np.flatnonzero(joined[: m - WINDOW + 1] == WINDOW - 1)


def cubic_residuals(time: Array, values: Array) -> Array:
    """Residuals of cubics through windows.

    Args:
        time: (w, WINDOW).
        values: (w, WINDOW).

    Returns:
        (w, WINDOW), each scaled by its leverage so that white noise keeps its variance.
    """
    t = time - time.mean(axis=1, keepdims=True)
    t = t / np.abs(t).max(axis=1, keepdims=True)
    basis = np.stack([t**i for i in range(4)], axis=-1)
    Q, _ = np.linalg.qr(basis)
    fitted = np.einsum("wij,wkj,wk->wi", Q, Q, values)
    leverage = np.einsum("wij,wij->wi", Q, Q)
    return (values - fitted) / np.sqrt(1.0 - leverage)


def measure(flights: Flights, scan_s: float) -> Noise:
    """White noise of range, azimuth and altitude; robust, and never below the quantisation.

    Acceleration is left at 1; `choose` finds it.
    """
    first = windows(flights, 1.6 * scan_s)
    rows = first[:, None] + np.arange(WINDOW)
    azimuth = np.unwrap(flights.z[rows, 1], axis=1)
    far = flights.z[rows, 0].min(axis=1) > 5_000.0  # nearby, azimuth is not a cubic of time
    altitude = flights.z[:, 2] if flights.z.shape[1] == 3 else np.full(len(flights.time), np.nan)
    return Noise(
        range_m=_spread(flights.time[rows], flights.z[rows, 0], _quantum(flights.z[:, 0]), 30.0),
        azimuth_deg=float(
            np.degrees(
                _spread(flights.time[rows][far], azimuth[far], _quantum(flights.z[:, 1]), 1.5e-3)
            )
        ),
        altitude_m=_spread(flights.time[rows], altitude[rows], _quantum(altitude), 10.0),
        accel_mps2=1.0,
    )


def _spread(time: Array, values: Array, quantum: float, unknown: float) -> float:
    """Robust scatter about cubics, at least that of rounding to `quantum`."""
    whole = np.isfinite(values).all(axis=1)
    if np.count_nonzero(whole) < 20:
        return unknown
    residuals = cubic_residuals(time[whole], values[whole])
    spread = MAD_TO_SD * float(np.median(np.abs(residuals)))
    return float(max(spread, quantum / 12.0**0.5))


def _quantum(values: Array) -> float:
    """The step in which values come: the smallest that is common, 0 if none is."""
    finite = values[np.isfinite(values)]
    steps = np.diff(np.unique(np.round(finite, 9)))
    return float(np.min(steps[steps > 1e-6], initial=np.inf)) if len(steps) else 0.0


def straight_by_roll(flights: Flights, roll_deg: Array) -> tuple[Array, Array]:
    """Whether a plot lies in straight flight, and whether that is known.

    Known where the aircraft downlinked its roll both before and after within 25 s; straight if both
    were below 2 degrees. It looks ahead, so it can judge a filter but not drive it.
    """
    heard = np.isfinite(roll_deg)
    before = _last_heard(heard, flights.track)
    after = len(heard) - 1 - _last_heard(heard[::-1], flights.track[::-1])[::-1]
    known = (before >= 0) & (after < len(heard))
    b, a = np.clip(before, 0, None), np.clip(after, None, len(heard) - 1)
    known &= (flights.time - flights.time[b] < ROLL_REACH_S) & (
        flights.time[a] - flights.time < ROLL_REACH_S
    )
    level = np.abs(np.where(heard, roll_deg, 0.0)) < STRAIGHT_ROLL_DEG
    return known & level[b] & level[a], known


def _last_heard(heard: Array, track: Array) -> Array:
    """Row of the latest report of the same track at or before each row, -1 if there is none."""
    rows = np.where(heard, np.arange(len(heard)), -1)
    latest = np.maximum.accumulate(rows)
    other = (latest >= 0) & (track[np.clip(latest, 0, None)] != track)
    return np.where(other, -1, latest)


def steady(flights: Flights, scan_s: float) -> Array:
    """Whether a plot lies in steady flight by the plots alone: no fitted acceleration around it."""
    first = windows(flights, 1.6 * scan_s)
    result = np.zeros(len(flights.time), dtype=bool)
    if not len(first):
        return result
    rows = first[:, None] + np.arange(WINDOW)
    position = flights.z[..., 0] * np.exp(1j * flights.z[..., 1])
    t = flights.time[rows] - flights.time[rows].mean(axis=1, keepdims=True)
    basis = np.stack([np.ones_like(t), t, t * t / 2], axis=-1)
    normal = np.einsum("wij,wik->wjk", basis, basis)
    right = np.einsum("wij,wi->wj", basis, position[rows])
    acceleration = np.abs(np.linalg.solve(normal, right[..., None])[:, 2, 0])
    result[first + WINDOW // 2] = acceleration < STEADY_MPS2
    return result
