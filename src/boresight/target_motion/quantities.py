"""What a bank's mixture says of range, bearing, course and speed.

[pradeep] section 3 reads the state's mean. Differs from it: moments and credible regions are those
of the quantity itself over the whole mixture, as before own ship turns the state's mean is the
truth of no target. Polar columns everywhere: range (m), bearing, course (degrees true), speed
(m/s).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.mixtures.bank import Bank
from boresight.target_motion.contact import Contact
from boresight.target_motion.moments import (
    Cells,
    cell_moments,
    mixed,
    mixture_moments,
    planes,
    polar_moments,
)
from boresight.target_motion.planar import Axes
from boresight.target_motion.regions import angle_regions, normal_ends, radius_regions
from boresight.target_motion.result import Quantity, Side

Array = Any
QUANTITIES = ("range_m", "bearing_deg", "course_deg", "speed_mps")
NEGLIGIBLE = 1e-6  # of the weight: what a region does not look at
DECIDED = 0.99  # of the weight on one side of the array
_DRAWN = 120  # times at which the ends of the region are found
_SIDES = {-1.0: "port", 1.0: "starboard"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """What a mixture says after one bearing; as in `TargetMotion`."""

    range_m: Quantity
    bearing_deg: Quantity
    course_deg: Quantity
    speed_mps: Quantity
    mean: Array
    cov: Array
    sides: tuple[Side, ...]
    decided: bool


def as_polar(states: Array, position: Array) -> Array:
    """Polar columns (..., 4) of states (..., 4) as heard from (..., 2); angles from 0 to 360."""
    states = np.asarray(states, dtype=float)
    x, v = states[..., :2] - position, states[..., 2:4]
    bearing, course = (np.degrees(np.arctan2(p[..., 1], p[..., 0])) % 360.0 for p in (x, v))
    return np.stack([np.hypot(*_xy(x)), bearing, course, np.hypot(*_xy(v))], axis=-1)


def regions(weights: Array, means: Array, covs: Array, position: Array) -> dict[str, Any]:
    """Credible regions of one mixture: by quantity, then by level in per cent.

    Args:
        weights: (cells,), summing to one; a cell without weight may hold anything.
        means: (cells, n).
        covs: (cells, n, n).
        position: (2,).
    """
    alive = weights > NEGLIGIBLE
    axes = planes(means[alive], covs[alive], np.asarray(position)[None])
    place, velocity = (Axes(*(each[:, i] for each in axes)) for i in (0, 1))
    w = weights[alive]
    return {
        "range_m": radius_regions(w, place),
        "bearing_deg": angle_regions(w, place),
        "course_deg": angle_regions(w, velocity),
        "speed_mps": radius_regions(w, velocity),
    }


def describe(bank: Bank, contact: Contact, step: int = -1, *, observable: bool) -> Answer:
    """What is known after one bearing.

    Args:
        bank: every cell, by step.
        contact: what was heard, and from where.
        step: which bearing; the last one unless told.
        observable: whether the bearings tell the range: without, range, course and speed have
            regions and no estimate.

    Once a side of the array is decided, all but `sides` is said of that side alone; before that
    bearing and course have no estimate, since between the sides there is nothing.
    """
    weights, here = bank.weights[step], contact.position_m[step]
    parts = [(_SIDES[s], *_one_side(weights, bank.side, s)) for s in _SIDES]
    parts = sorted((p for p in parts if p[1] > 0.0), key=lambda p: -p[1])
    means, covs = bank.means[step], bank.covs[step]
    told = dict.fromkeys(QUANTITIES, observable) | {"bearing_deg": True}
    sides = tuple(
        Side(name=name, probability=share, **_say(w, means, covs, here, told))
        for name, share, w in parts
    )
    decided = not sides or sides[0].probability >= DECIDED
    if sides and decided:
        weights = parts[0][2]
    if not decided:
        told |= {"bearing_deg": False, "course_deg": False}
    mean, cov = _moments(weights, means, covs)
    said = _say(weights, means, covs, here, told)
    return Answer(mean=mean, cov=cov, sides=sides, decided=decided, **said)


def history(bank: Bank, contact: Contact) -> dict[str, Array]:
    """What was known after each bearing, of the side that is the heavier at the end.

    Returns:
        (steps,) each: mean and spread of the four quantities (`range_m`, `range_sd_m`, ...), the
        mean's `north_m` and `east_m`, `range_low_m` and `range_high_m` (ends of the 90 % region,
        each cell's range taken as normal), `innovation_deg`, `innovation_sd_deg` and `nis` of the
        mixture's forecast (NaN where nothing was heard), and `side_probability` (1 for true
        bearings).
    """
    weights, probability = _heavier_side(bank)
    cells = cell_moments(weights, bank.means, bank.covs, contact.position_m)
    estimate, sd = mixture_moments(weights, cells)
    inside = weights[..., None] > 0.0
    place = np.sum(weights[..., None] * np.where(inside, bank.means, 0.0), axis=1)
    low, high = _range_ends(weights, cells, contact.time_s)
    nu, variance = _forecast(weights, bank)
    found = {name: estimate[:, i] for i, name in enumerate(QUANTITIES)}
    found |= {_sd(name): sd[:, i] for i, name in enumerate(QUANTITIES)}
    return found | {
        "north_m": place[:, 0],
        "east_m": place[:, 1],
        "range_low_m": low,
        "range_high_m": high,
        "innovation_deg": np.degrees(nu),
        "innovation_sd_deg": np.degrees(np.sqrt(variance)),
        "nis": nu * nu / variance,
        "side_probability": probability,
    }


def _moments(weights: Array, means: Array, covs: Array) -> tuple[Array, Array]:
    """Mean (n,) and covariance (n, n) of one mixture."""
    alive = weights > 0.0
    w, means, covs = weights[alive], means[alive], covs[alive]
    mean = w @ means
    apart = means - mean
    return mean, np.einsum("c,cij->ij", w, covs + apart[:, :, None] * apart[:, None, :])


def _say(w: Array, means: Array, covs: Array, here: Array, told: dict[str, bool]) -> dict[str, Any]:
    """The four quantities of one mixture, with estimates of those that are told."""
    estimate, sd = polar_moments(w, means, covs, here)
    found = regions(w, means, covs, here)
    return {
        name: Quantity(
            estimate=float(estimate[i]) if told[name] else None,
            sd=float(sd[i]) if told[name] else None,
            regions=found[name],
        )
        for i, name in enumerate(QUANTITIES)
    }


def _one_side(weights: Array, side: Array, which: float) -> tuple[float, Array]:
    """Probability of one side, and the weights (cells,) given that."""
    kept = np.where(side == which, weights, 0.0)
    share = float(kept.sum())
    return share, kept / share if share > 0.0 else kept


def _heavier_side(bank: Bank) -> tuple[Array, Array]:
    """Weights (steps, cells) given the side that is the heavier at the end, and its probability."""
    if not bank.side.any():
        return bank.weights, np.ones(len(bank.weights))
    lean = bank.weights[-1] @ bank.side
    kept = np.where(bank.side == (1.0 if lean > 0.0 else -1.0), bank.weights, 0.0)
    share = kept.sum(axis=1)
    return kept / share[:, None], share


def _range_ends(weights: Array, cells: Cells, time_s: Array) -> tuple[Array, Array]:
    """(steps,) ends of the 90 % region of the range, at some times and straight between."""
    some = np.unique(np.linspace(0, len(time_s) - 1, _DRAWN).astype(int))
    middle, sd = cells.radius[some, :, 0], np.sqrt(cells.radius_var[some, :, 0])
    ends = normal_ends(weights[some], middle, sd, 90)
    low, high = (np.interp(time_s, time_s[some], end) for end in ends)
    return np.maximum(low, 0.0), high


def _forecast(weights: Array, bank: Bank) -> tuple[Array, Array]:
    """(steps,) innovation, rad, of the forecast by the mixture before each bearing; variance.

    Of a step at which both a bearing and a cone were heard, the bearing's.
    """
    before = np.concatenate([weights[:1], weights[:-1]])[..., None]
    used = (before > 0.0) & np.isfinite(bank.variance)
    share = np.where(used, before, 0.0)
    total = share.sum(axis=1)
    share /= np.where(total > 0.0, total, np.nan)[:, None]
    nu, sd = mixed(share, np.where(used, bank.innovation, 0.0), np.where(used, bank.variance, 0.0))
    first = np.argmax(np.isfinite(nu), axis=-1)[:, None]
    chosen = (np.take_along_axis(each, first, axis=-1)[:, 0] for each in (nu, sd))
    return next(chosen), next(chosen) ** 2


def _sd(name: str) -> str:
    """`range_m` to `range_sd_m`."""
    stem, unit = name.rsplit("_", 1)
    return f"{stem}_sd_{unit}"


def _xy(pairs: Array) -> tuple[Array, Array]:
    return pairs[..., 0], pairs[..., 1]
