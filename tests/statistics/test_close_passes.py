"""Targets that pass own ship so close that the bearing jumps, and bearings that are missing.

A bearing every ten seconds and a closest approach below 50 m: between two bearings the target goes
from one side of own ship to the other.
"""

import numpy as np
import pytest

from boresight import catalogue
from boresight.filters.recursion import run_recursion
from boresight.target_motion.result import Criteria
from mixtures.heard import (
    OWN,
    RELATIVE,
    bearings_from,
    earth_fixed,
    filtered,
    relative,
    start_of,
    straight,
)
from oracles import pradeep as paper

GAP_S, STEPS, NEAREST_M = 10.0, 41, 50.0
NAMES = ("ekf", "mgekf", "modified-polar")
NAMES += ("rp-ekf", "rp-mgekf", "rp-ukf", "rp-ckf", "rp-modified-polar")


def close_passes(count, seed):
    """Own ship (steps, 2), targets (count, steps, 2), bearings (count, steps) without noise."""
    generator = np.random.default_rng(seed)
    own = paper.own_ship(paper.OWN_SHIP, round(GAP_S) * (STEPS - 1))[:: round(GAP_S)]
    found, kept = 0, []
    while found < count:
        one = _drawn(generator, own, count)
        distance = np.linalg.norm(one - own, axis=-1)
        assert np.median(distance[:, 0]) > 1_000.0
        bearing = np.arctan2(*np.moveaxis(one - own, -1, 0))
        jumps = np.abs(paper.wrap(np.diff(bearing, axis=1))).max(axis=1) > np.pi / 2
        kept.append((one[jumps], bearing[jumps]))
        found += int(np.sum(jumps))
    targets, bearing = (np.concatenate(parts)[:count] for parts in zip(*kept, strict=True))
    return own, targets, bearing


def _drawn(generator, own, count):
    """Straight tracks that are nearest, below 50 m, somewhere between two bearings."""
    step = generator.integers(8, STEPS - 8, count)
    share = generator.uniform(0.2, 0.8, (count, 1))
    velocity = 11.0 * generator.standard_normal((count, 2))
    ship = (own[step + 1] - own[step]) / GAP_S
    along = velocity - ship
    aside = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    aside *= generator.uniform(-NEAREST_M, NEAREST_M, (count, 1))
    aside /= np.linalg.norm(along, axis=1, keepdims=True)
    nearest = own[step] + share * GAP_S * ship + aside
    since = (np.arange(STEPS) - (step[:, None] + share)) * GAP_S
    return nearest[:, None] + velocity[:, None] * since[..., None]


def passed(name, count, seed):
    """Estimates of targets that pass, and where these are, North and East."""
    own, targets, bearing = close_passes(count, seed)
    z = bearing + paper.SIGMA * np.random.default_rng(seed).standard_normal(bearing.shape)
    z = paper.wrap(z)
    dt = np.full((1, STEPS), GAP_S)
    dt[0, 0] = 0.0
    recursion = catalogue.lookup(name).recursion(straight(), bearings_from(own))
    outputs = ["mean", "cov", "status", "loglik"]
    outputs += ["kept_log_weights"] if name.startswith("rp-") else []
    start = earth_fixed(*start_of(z), own)
    return run_recursion(recursion, z[..., None], dt, start, outputs=outputs), targets[..., ::-1]


def sound(name, count, seed):
    found, truth = passed(name, count, seed)
    assert np.all(np.isfinite(found.mean))
    assert np.all(np.isfinite(found.cov))
    assert np.all(np.isfinite(found.loglik))
    assert not np.any(found.status)  # finite, and positive definite
    if name.startswith("rp-"):
        assert np.all(found.kept_log_weights.max(axis=-1) == 0.0)
    return np.linalg.norm(found.mean[:, -1, :2] - truth[:, -1], axis=-1)


@pytest.mark.parametrize("name", NAMES)
def test_close_passes_leave_no_nan(name):
    sound(name, 2_000, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_hundred_thousand_close_passes_leave_no_nan(name):
    for seed in range(10, 20):
        sound(name, 10_000, seed)


def test_a_bank_bears_what_one_filter_does_not():
    """A pass of a few hundred metres a step bends most single filters, few banks."""
    bent = {name: np.mean(sound(name, 2_000, seed=3) > 1_000.0) for name in ("ekf", "rp-ekf")}
    assert bent["ekf"] > 0.5
    assert bent["rp-ekf"] < 0.2


def test_a_third_of_the_bearings_missing_delays_little():
    """Median of 300 runs of the sustained convergence: at most 1.2 times that with all."""
    z = paper.measured(RELATIVE, 300, seed=4)
    start = earth_fixed(*start_of(z), OWN)
    holes = np.random.default_rng(5).random(z.shape) < 0.3
    holes[:, 0] = False
    when = {}
    for missing in (False, True):
        heard = np.where(holes & missing, np.nan, z)
        X = relative(filtered("rp-ekf", heard, OWN, start).mean, OWN)
        ok = paper.within(X, RELATIVE, Criteria().speed_mps)
        when[missing] = np.median(paper.sustained(ok))
    assert when[False] < 160.0
    assert when[True] <= 1.2 * when[False]
