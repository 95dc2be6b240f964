"""What bearings alone tell of the range, whatever was believed before.

[nardone1984] S. C. Nardone, A. G. Lindgren and K. F. Gong, "Fundamental Properties and Performance
of Conventional Bearings-Only Target Motion Analysis": without a manoeuvre of own ship, nothing.
Differs from it: the bound is taken along every track that is still believed, and not along the
truth, which nobody has; and own ship's position is known to so many metres only. An own ship that
wanders by that much has not manoeuvred, although with perfect positions the bearings would tell.
"""

from typing import Any

import numpy as np

from boresight.filters.fisher import information_through, polar_bound
from boresight.maths.angles import wrap
from boresight.mixtures.bank import Bank
from boresight.mixtures.range_parameterised import SPEED_MPS
from boresight.models.checks import positive
from boresight.models.motion import ConstantVelocity
from boresight.target_motion.contact import Contact
from boresight.target_motion.result import Observability

Array = Any
SHARE = 0.95  # of the weight that must agree
CHECKS = 400  # steps at most that are looked at: the cost grows with steps times these
_RANGES = 16  # first ranges that are tried for what own ship's course could have told
_FITS = 3.0  # standard deviations rms, within which a track is on the bearings heard
_STRAIGHT = ConstantVelocity(accel_mps2=0.0, dims=2)


def observe(
    contact: Contact, bank: Bank, *, widest_percent: float = 50.0, position_sd_m: float = 5.0
) -> Observability:
    """Whether the bearings tell the range, since when, and whether they could have.

    At every step each cell's mean stands for a straight track through it. Along that track the
    Fisher information of all bearings so far, without any prior, bounds the range. The range is
    told when tracks that hold 95 % of the weight all have it within `widest_percent`.

    An error of own ship's position that looks like its manoeuvre goes into the range in
    proportion: the bound is widened by `position_sd_m` over the root mean square distance between
    own ship and steady straight motion.

    Args:
        contact: what was heard.
        bank: what every cell made of it.
        widest_percent: largest bound of the range, in per cent of it.
        position_sd_m: how well own ship's path is known, m.

    Raises:
        UsageError: a setting that is not above zero.
    """
    positive("widest_percent", widest_percent)
    positive("position_sd_m", position_sd_m)
    steps = len(contact.time_s)
    checked = np.unique(np.linspace(0, steps - 1, min(steps, CHECKS)).astype(int))
    off = position_sd_m / np.maximum(_wandered(contact), 1e-9)
    sd, percent = _by_cell(contact, bank, checked)
    percent = np.hypot(percent, 100.0 * off[checked, None])
    weights = np.nan_to_num(bank.weights[checked])
    told = np.sum(weights * (percent <= widest_percent), axis=1) >= SHARE
    # Between two looks it is what it was at the one before.
    latest = np.searchsorted(checked, np.arange(steps), side="right") - 1
    best = sd[np.arange(len(checked)), np.argmax(weights, axis=1)]
    grid = np.hypot(_at_best(contact, bank), 100.0 * off[-1])
    at_best = float(min(np.min(percent[-1]), grid))
    never = np.flatnonzero(~told)
    since = 0 if not len(never) else never[-1] + 1
    return Observability(
        observable=bool(told[-1]),
        since_s=float(contact.time_s[checked[since]]) if told[-1] else None,
        range_sd_m=float(best[-1]),
        at_best_percent=at_best,
        manoeuvred=at_best < 100.0,
        by_step=best[latest],
    )


def _by_cell(contact: Contact, bank: Bank, checked: Array) -> tuple[Array, Array]:
    """Bound of the range in m and in per cent of it, (checked, cells); infinite for light cells."""
    means = bank.means[checked, :, :4]
    heavy = _heavy(bank.weights[checked], means)
    which, cell = np.nonzero(heavy)
    at = checked[which]
    sd = np.full(heavy.shape, np.inf)
    sd[which, cell] = _range_bound(contact, means[which, cell], at)
    away = np.linalg.norm(means[..., :2] - contact.position_m[checked][:, None], axis=-1)
    return sd, 100.0 * sd / np.where(heavy, np.maximum(away, 1e-3), 1.0)


def _heavy(weights: Array, means: Array) -> Array:
    """Which cells (..., cells) count: all the others together have half of what may disagree."""
    light = (1.0 - SHARE) / 2.0 / weights.shape[-1]
    return (np.nan_to_num(weights) > light) & np.isfinite(means[..., :4]).all(-1)


def _range_bound(contact: Contact, states: Array, at: Array) -> Array:
    """Bound of the range (lanes,), m, along tracks through states (lanes, 4) at steps (lanes,)."""
    heard = np.isfinite(contact.plots[0])
    found = information_through(states, at, _STRAIGHT, contact.sensor, contact.dt, heard)
    return polar_bound(found, states, contact.position_m[at])[:, 0]


def _wandered(contact: Contact) -> Array:
    """(steps,) root mean square distance, m, of own ship so far from steady straight motion."""
    count = np.arange(1.0, len(contact.time_s) + 1.0)
    t = contact.time_s - contact.time_s[0]
    p = contact.position_m - contact.position_m[0]

    def about_mean(a: Array, b: Array) -> Array:
        """Sum so far of the products of two columns about their means."""
        return np.cumsum(a * b) - np.cumsum(a) * np.cumsum(b) / count

    times = np.maximum(about_mean(t, t), 1e-12)
    left = sum(about_mean(x, x) - about_mean(t, x) ** 2 / times for x in p.T)
    return np.sqrt(np.maximum(left, 0.0) / count)


def _at_best(contact: Contact, bank: Bank) -> float:
    """Smallest bound, in per cent of the range, of any straight track on the bearings heard."""
    ranges = _first_ranges(contact, bank)
    sides = [_on_bearings(contact, ranges, bearing) for bearing in _sides(contact, bank)]
    if not sum(map(len, sides)):
        return np.inf
    tracks = np.concatenate(sides)
    last = tracks.copy()
    last[:, :2] += tracks[:, 2:] * (contact.time_s[-1] - contact.time_s[0])
    sd = _range_bound(contact, last, np.full(len(last), len(contact.time_s) - 1))
    away = np.linalg.norm(last[:, :2] - contact.position_m[-1], axis=1)
    return float(100.0 * np.min(sd / np.maximum(away, 1e-3)))


def _first_ranges(contact: Contact, bank: Bank) -> Array:
    """Ranges at the first bearing that are worth trying, m: twice as wide as the bank began."""
    away = np.linalg.norm(bank.means[0, :, :2] - contact.position_m[0], axis=-1)
    away = away[np.isfinite(away) & (away > 0.0)]
    return np.geomspace(away.min() / 2.0, away.max() * 2.0, _RANGES) if len(away) else away


def _on_bearings(contact: Contact, ranges: Array, bearing: Array) -> Array:
    """(tracks, 4) at the first step: from each range there, the best velocity, if one fits.

    Bearings (steps,) are true ones, NaN where nothing was heard.
    """
    heard = np.flatnonzero(np.isfinite(bearing))
    if not len(heard):
        return np.zeros((0, 4))
    b, own, sigma = bearing[heard], contact.position_m[heard], contact.sigma_rad[heard]
    t = contact.time_s[heard] - contact.time_s[heard[0]]
    spots = own[0] + ranges[:, None] * np.array([np.cos(b[0]), np.sin(b[0])])
    # A track is on the line of sight when it is heard: across (spot + v t - own) = 0.
    across = np.stack([-np.sin(b), np.cos(b)], axis=-1) / sigma[:, None]
    offset = np.sum(across * own, axis=1) - spots @ across.T
    G = across * t[:, None]
    normal = G.T @ G + np.eye(2) * (ranges**2 / SPEED_MPS**2)[:, None, None]
    v = np.linalg.solve(normal, (offset @ G)[..., None])[..., 0]
    away = spots[:, None] + v[:, None] * t[:, None] - own
    left = wrap(b - np.arctan2(away[..., 1], away[..., 0])) / sigma
    fits = np.sqrt(np.mean(left**2, axis=1)) < _FITS
    start = spots - v * (contact.time_s[heard[0]] - contact.time_s[0])
    return np.hstack([start, v])[fits]


def _sides(contact: Contact, bank: Bank) -> list[Array]:
    """True bearings (steps,), NaN where not heard; of cones, on the sides that a cell keeps to.

    Own ship's turns bring a target from one side of the axis to the other, so that a side is a
    side at every step.
    """
    if not contact.is_conical:
        return [contact.bearing_rad]
    ago = contact.time_s - contact.time_s[-1]
    held = bank.means[-1, _heavy(bank.weights[-1], bank.means[-1]), :4]
    away = held[:, None, :2] + held[:, None, 2:] * ago[:, None] - contact.position_m
    off = wrap(np.arctan2(away[..., 1], away[..., 0]) - contact.axis_rad)
    patterns = np.unique(np.where(off < 0.0, -1.0, 1.0), axis=0)
    cones = contact.axis_rad + patterns * contact.cone_rad
    return list(np.where(np.isnan(contact.bearing_rad), cones, contact.bearing_rad))
