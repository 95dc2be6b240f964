"""Synthetic pairs whose systematic errors, noise and outliers are known, with an own formula.

Plots are made the long way round (place at the true time, from the true site, then errors added
one by one in degrees and metres), never from the table of effects that the estimator uses.
"""

from dataclasses import dataclass

import numpy as np

from boresight.calibration.pairs import Pairs

SIX = (
    "range_bias_m",
    "range_gain_m_per_km",
    "azimuth_bias_deg",
    "azimuth_cos_deg",
    "azimuth_sin_deg",
    "time_bias_s",
)
TRUE = {
    "range_bias_m": 120.0,
    "range_gain_m_per_km": 0.4,
    "azimuth_bias_deg": 0.5,
    "azimuth_cos_deg": -0.06,
    "azimuth_sin_deg": 0.04,
    "time_bias_s": 0.15,
}
NM = 1852.0


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations of plots; a tail is (share, times the narrow one)."""

    range_m: float = 70.0
    azimuth_deg: float = 0.08
    azimuth_tail: tuple[float, float] = (0.0, 1.0)
    delay_m: float = 0.0
    wrong_share: float = 0.0


def flights(rng, pairs, targets, *, near_m=10e3, far_m=250e3):
    """(target, position, velocity): straight flights through places spread evenly over the area."""
    target = np.sort(rng.integers(0, targets, pairs))
    reach = np.sqrt(rng.uniform(near_m**2, far_m**2, targets))
    angle, heading = rng.uniform(0.0, 2.0 * np.pi, (2, targets))
    speed, height = rng.uniform(120.0, 260.0, targets), rng.uniform(3e3, 11e3, targets)
    middle = np.stack([reach * np.cos(angle), reach * np.sin(angle), height])
    way = np.stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(targets)])
    when = rng.uniform(-300.0, 300.0, pairs)
    return target, (middle[:, target] + way[:, target] * when).T, way[:, target].T


def scans(rng, targets, each, *, scan_s=8.0, far_m=250e3):
    """(target, position, velocity), (times): straight flights seen at every scan of a radar."""
    reach, angle = rng.uniform(30e3, far_m, targets), rng.uniform(0.0, 2.0 * np.pi, targets)
    heading, speed = rng.uniform(0.0, 2.0 * np.pi, targets), rng.uniform(120.0, 260.0, targets)
    middle = np.stack(
        [reach * np.cos(angle), reach * np.sin(angle), rng.uniform(3e3, 11e3, targets)]
    )
    way = np.stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(targets)])
    target, when = np.repeat(np.arange(targets), each), scan_s * np.tile(np.arange(each), targets)
    where = middle[:, target] + way[:, target] * (when - 0.5 * scan_s * each)
    return (target, where.T, way[:, target].T), when


def wandered(rng, targets, each, sd, alike):
    """(targets x each,) errors that are alike from scan to scan: first-order autoregression."""
    out = np.empty((targets, each))
    out[:, 0] = sd * rng.normal(size=targets)
    for scan in range(1, each):
        fresh = sd * np.sqrt(1.0 - alike**2) * rng.normal(size=targets)
        out[:, scan] = alike * out[:, scan - 1] + fresh
    return out.ravel()


def scattered(rng, pairs, *, near_m=10e3, far_m=250e3):
    """As `flights`, but every pair is a target of its own."""
    return flights(rng, pairs, pairs, near_m=near_m, far_m=far_m)


def polar(p):
    """(range m, azimuth deg) of places (m, 3)."""
    return np.linalg.norm(p, axis=1), np.degrees(np.arctan2(p[:, 1], p[:, 0]))


def measured(rng, true, target, position, velocity, noise):
    """Plots (range m, azimuth deg) of targets that the reference puts at `position`."""
    site = np.array([true.get("site_north_m", 0.0), true.get("site_east_m", 0.0), 0.0])
    r, azimuth = polar(position - true.get("time_bias_s", 0.0) * velocity - site)
    delay = noise.delay_m * rng.normal(size=target.max() + 1)
    share, times = noise.azimuth_tail
    spread = noise.azimuth_deg * np.where(rng.random(len(r)) < share, times, 1.0)
    error_r = true.get("range_bias_m", 0.0) + true.get("range_gain_m_per_km", 0.0) * r / 1e3
    error_a = true.get("azimuth_bias_deg", 0.0) + spread * rng.normal(size=len(r))
    error_a += true.get("azimuth_cos_deg", 0.0) * np.cos(np.radians(azimuth))
    error_a += true.get("azimuth_sin_deg", 0.0) * np.sin(np.radians(azimuth))
    return (
        r + error_r + delay[target] + noise.range_m * rng.normal(size=len(r)),
        azimuth + error_a,
        delay,
    )


def spoil(rng, position, velocity, share):
    """(position, spoilt): some references belong to another, are 1 NM off, or 2 s late."""
    m = len(position)
    kind = np.where(rng.random(m) < share, rng.integers(1, 4, m), 0)
    angle = rng.uniform(0.0, 2.0 * np.pi, m)
    aside = NM * np.stack([np.cos(angle), np.sin(angle), np.zeros(m)], axis=1)
    other = position[rng.integers(0, m, m)]
    late = position - 2.0 * velocity
    choices = np.stack([position, other, position + aside, late])
    return choices[kind, np.arange(m)], kind > 0


def world(seed, pairs=10_000, targets=None, *, true=None, noise=None, place=None):
    """(pairs, truth): `truth` has the terms, the delays and which references are wrong.

    Args:
        seed: of this world.
        pairs: their number.
        targets: number of aircraft; None makes every pair one of its own.
        true: terms; `TRUE` if None.
        noise: of the plots.
        place: (target, position, velocity) instead of flights over the whole area.
    """
    rng = np.random.default_rng(seed)
    true, noise = TRUE if true is None else true, noise or Noise()
    if place is None:
        place = flights(rng, pairs, pairs if targets is None else targets)
    target, position, velocity = place
    r, azimuth, delay = measured(rng, true, target, position, velocity, noise)
    said, wrong = spoil(rng, position, velocity, noise.wrong_share)
    m = len(r)
    made = Pairs(
        time_s=np.arange(m, dtype=float),
        target=target,
        names=tuple(str(i) for i in range(int(target.max()) + 1)),
        channels=("range_m", "azimuth_rad"),
        z=np.stack([r, np.radians(azimuth)], axis=1),
        position=said,
        velocity=velocity,
        height_m=said[:, 2],
        accuracy_m=np.full(m, np.nan),
        row=np.arange(m),
    )
    return made, {"terms": true, "delay_m": delay, "wrong": wrong}
