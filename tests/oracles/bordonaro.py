"""bordonaro's two scenarios, 10,000 runs, and its filter with any covariance, in NumPy over runs.

Lengths and speeds are feet in the paper; no formula minds. T = 1 s and 0.1 of acceleration are
ours: the paper does not say (erratum B13).
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from boresight import catalogue
from boresight.filters.recursion import run_recursion
from boresight.maths.seeds import Stream, normals
from boresight.models.motion import ConstantVelocity, Static
from boresight.models.sensors import Radar
from oracles import printed_conversions as printed

RUNS, SCANS = 10_000, 100
DISTANCE, SIGMA_R, SPEED = 1e4, 100.0, 30.0


class World(NamedTuple):
    """Models, truth (runs, scans, n) and plots (runs, scans, 2)."""

    motion: Any
    sensor: Any
    truth: np.ndarray
    z: np.ndarray


def seen(motion, truth, sigma_deg, seed):
    noise = normals(seed, "bordonaro", Stream.NOISE, (SCANS, 2), runs=RUNS)
    x, y = truth[..., 0], truth[..., 1]
    z = np.stack([np.hypot(x, y), np.arctan2(y, x)], axis=-1)
    z += noise * [SIGMA_R, np.radians(sigma_deg)]
    return World(motion, Radar(range_m=SIGMA_R, azimuth_deg=sigma_deg), truth, z)


@cache
def static(sigma_deg, seed=1):
    """Section 2.3: a target that rests at a range of 10,000, bearing 0; position is estimated."""
    truth = np.broadcast_to([DISTANCE, 0.0], (RUNS, SCANS, 2))
    return seen(Static(dims=2), truth, sigma_deg, seed)


@cache
def dynamic(sigma_deg, seed=1):
    """Section 3: constant velocity from near (10,000, 10,000), speed 40 and any heading."""
    draw = normals(seed, "bordonaro", Stream.TRUTH, (5,), runs=RUNS)
    heading = np.arctan2(draw[:, 3], draw[:, 4])
    v = (40 + 10 * draw[:, 2:3]) * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    p = DISTANCE + 100 * draw[:, None, :2] + np.arange(SCANS)[:, None] * v[:, None]
    truth = np.concatenate([p, np.broadcast_to(v[:, None], p.shape)], axis=-1)
    return seen(ConstantVelocity(accel_mps2=0.1, dims=2), truth, sigma_deg, seed)


def tracked(world, name, **settings):
    """The filter from its own start, and its mean and cov after every scan."""
    chosen = catalogue.lookup(name).with_settings(**settings)
    start = chosen.method.start(world.z[:, 0], world.motion, world.sensor, speed_mps=SPEED)
    z, dt = world.z.copy(), np.ones((1, SCANS))
    z[:, 0], dt[0, 0] = np.nan, 0.0
    recursion = chosen.recursion(world.motion, world.sensor)
    return run_recursion(recursion, z, dt, start, outputs=("mean", "cov"))


def errors(world, estimate):
    return estimate.mean - world.truth


def rmse(world, estimate, of=slice(0, 2)):
    """(scans,)"""
    return np.sqrt(np.mean(np.sum(errors(world, estimate)[..., of] ** 2, axis=-1), axis=0))


def anees(world, estimate):
    """(scans,), 1 for a filter that knows its errors."""
    e = errors(world, estimate)[..., None]
    return np.mean(e.mT @ np.linalg.solve(estimate.cov, e), axis=(0, 2, 3)) / e.shape[2]


def printed_filter(world, *, corrected=False):
    """DUCM with (26) to (28) as printed, or with errata B3 and B4 corrected.

    All else is as it should be: the start by erratum B9, the variance of range by B5.
    """
    sa = np.radians(world.sensor.azimuth_deg)
    start = catalogue.lookup("ducm").method.start(
        world.z[:, 0], world.motion, world.sensor, speed_mps=SPEED
    )
    mean, cov, n = start.mean, start.cov, world.truth.shape[-1]
    F = np.eye(n) + (np.eye(n, k=2) if n == 4 else 0.0)
    Q, H = world.motion.noise(1.0), np.eye(2, n)
    means, covs = [mean], [cov]
    for k in range(1, SCANS):
        mean, cov = mean @ F.T, F @ cov @ F.T + Q
        (x, y), r2 = mean[:, :2].T, np.sum(mean[:, :2] ** 2, axis=1)
        xx, xy, yy = cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1]
        sa_track = np.sqrt(xx * y**2 - 2 * xy * x * y + yy * x**2) / r2
        sr_track = np.sqrt((xx * x**2 + 2 * xy * x * y + yy * y**2) / r2)
        r, a = world.z[:, k].T
        track, distance = (np.arctan2(y, x), sr_track, sa_track), np.sqrt(r2) if corrected else r
        fade = sa_track if corrected else None
        R = printed.ducm(distance, distance, track, SIGMA_R, sa, fade=fade)
        point = np.exp(sa**2 / 2) * r[:, None] * np.stack([np.cos(a), np.sin(a)], axis=-1)
        gain = np.linalg.solve(H @ cov @ H.T + R, H @ cov).mT
        mean = mean + np.einsum("rij,rj->ri", gain, point - mean[:, :2])
        cov = cov - gain @ (H @ cov)
        means.append(mean)
        covs.append(cov)
    return Printed(np.stack(means, axis=1), np.stack(covs, axis=1))


class Printed(NamedTuple):
    """As an estimate: mean (runs, scans, n), cov (runs, scans, n, n)."""

    mean: np.ndarray
    cov: np.ndarray
