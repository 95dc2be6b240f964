"""The best that any filter could say: the exact posterior of a straight flight, by sampling.

A target in the plane flies straight on, and a radar measures range and azimuth with independent
normal errors. What a filter should say after every scan is then an integral in four dimensions,
taken here by importance sampling, for many runs; no filter is involved. A filter's errors and its
covariance are held against it in `against_posterior`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.simulate import Truth
from boresight.experiments.straight_flight import Flat, Prior, Samples
from boresight.maths import wrap
from boresight.maths.seeds import Stream, normals
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar

Array = Any
_CELL = "exact posterior"  # of the random numbers


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """Straight flights that begin at one plot, and the prior of whoever watches them.

    Before the first plot the velocity is N(0, speed_mps² I) and the position flat. A flat prior has
    no draw, so the first plot is given and the truth is drawn given it: a filter whose start means
    this prior can be consistent at every scan.

    Attributes:
        sensor: a radar at the origin of the plane that measures range and azimuth.
        range_m: of the first plot.
        azimuth_deg: of the first plot.
        speed_mps: standard deviation of each velocity.
        dt_s: s between scans.
        scans: number of scans.
        flat: coordinates in which the position's density is constant: in `polar` ones the posterior
            after the first plot is normal in range and azimuth, in `cartesian` ones it is that
            times the range.
    """

    sensor: Radar
    range_m: float
    azimuth_deg: float = 45.0
    speed_mps: float
    dt_s: float = 1.0
    scans: int
    flat: Flat = "polar"

    def __post_init__(self) -> None:
        """Other sensors are refused."""
        if self.sensor.names != ("range_m", "azimuth_rad") or self.sensor.pose is not None:
            raise UsageError("a flight is watched by a radar at the origin: range and azimuth")

    @property
    def time_s(self) -> Array:
        """(scans,), from 0."""
        return self.dt_s * np.arange(self.scans)

    @property
    def sigma(self) -> Array:
        """(2,) standard deviations of range and azimuth, m and rad."""
        return np.array([self.sensor.range_m, np.radians(self.sensor.azimuth_deg)])


class Exact(NamedTuple):
    """Exact moments of position and velocity at some scans.

    Attributes:
        mean: (runs, scans, 4), x, y, vx, vy at the time of the scan.
        cov: (runs, scans, 4, 4).
        ess: (runs, scans), effective sample size of the weights, at most the number of points.
    """

    mean: Array
    cov: Array
    ess: Array


def draw(flight: Flight, *, runs: int, seed: int) -> tuple[Truth, Array]:
    """Truths, drawn from the prior given the first plot, and their plots (runs, scans, 2).

    Args:
        flight: what is drawn.
        runs: number of runs.
        seed: run i of a seed is the same whatever `runs` is.
    """
    first = np.array([flight.range_m, np.radians(flight.azimuth_deg)])
    drawn = normals(seed, _CELL, Stream.TRUTH, (5,), runs=runs)
    if flight.flat == "cartesian":
        from scipy.special import ndtr

        # A normal density times range: the error's sign is not even any more.
        short = ndtr(drawn[:, 4]) > (1 + drawn[:, 0] * flight.sigma[0] / flight.range_m) / 2
        drawn[short, 0] *= -1
    r, azimuth = (first + drawn[:, :2] * flight.sigma).T
    position = np.column_stack([r * np.cos(azimuth), r * np.sin(azimuth)])
    start = np.hstack([position, flight.speed_mps * drawn[:, 2:4]])
    states = np.repeat(start[:, None], flight.scans, axis=1)
    states[..., :2] += flight.time_s[:, None] * states[..., 2:]
    x, y = states[..., 0], states[..., 1]
    noise = normals(seed, _CELL, Stream.NOISE, (flight.scans, 2), runs=runs) * flight.sigma
    z = np.stack([np.hypot(x, y), np.arctan2(y, x)], axis=-1) + noise
    z[:, 0] = first
    z[..., 1] = wrap(z[..., 1])
    names = ConstantVelocity(accel_mps2=0.0, dims=2).names
    return Truth(flight.time_s, states, names, start), z


def exact_posterior(
    flight: Flight, z: Array, *, at: Sequence[int], points: int = 4096, seed: int = 0
) -> Exact:
    """Mean and covariance of each run's target, given all plots up to some scans.

    Args:
        flight: the prior, the noise and the times of the plots.
        z: (runs, scans, 2) range and azimuth, the first plot included and none missing. From scan
            to scan a bearing must not seem to change by half a turn: azimuths are unwrapped.
        at: numbers of the scans, from 0.
        points: how many are drawn for each run and scan, a power of 2.
        seed: of the points; their error is independent from run to run.
    """
    z = _checked(flight, z, at, points)
    prior = Prior(flight.sigma, flight.speed_mps, flight.flat)
    net = _sobol(points)
    shifts = np.random.Generator(np.random.Philox(seed)).random((len(z), len(at), 3))
    mean, cov = np.empty((len(z), len(at), 4)), np.empty((len(z), len(at), 4, 4))
    ess = np.empty((len(z), len(at)))
    for run, j in np.ndindex(ess.shape):
        seen = slice(at[j] + 1)
        samples = Samples(prior, flight.time_s[seen], z[run, seen])
        mean[run, j], cov[run, j], ess[run, j] = samples.moments((net + shifts[run, j]) % 1.0)
    return Exact(mean, cov, ess)


def _checked(flight: Flight, z: Array, at: Sequence[int], points: int) -> Array:
    """Plots with azimuths unwrapped; UsageError where something is not what is needed."""
    z = np.array(z, dtype=float)
    if z.shape[1:] != (flight.scans, 2) or not np.all(np.isfinite(z)):
        raise UsageError(
            f"plots of shape {z.shape}, or a missing one",
            next_step=f"give (runs, {flight.scans}, 2), the first plot included",
        )
    if not all(0 <= scan < flight.scans for scan in at):
        raise UsageError(f"{at=} is not within 0 to {flight.scans - 1}")
    if points < 1 or points.bit_count() != 1:
        raise UsageError(f"{points=} is not a power of 2", next_step="use 4096")
    z[..., 1] = np.unwrap(z[..., 1], axis=1)
    return z


@lru_cache(maxsize=4)
def _sobol(points: int) -> Array:
    """(points, 3) of the unit cube, evenly spread; used shifted, so they need not be scrambled."""
    from scipy.stats import qmc

    return qmc.Sobol(3, scramble=False).random(points)
