"""Pairs as the fit reads them: by channel, sorted by target and time, linearised at a place."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.clusters import Sums
from boresight.calibration.laws import Setting, setting
from boresight.calibration.pairs import Pairs
from boresight.calibration.wander import Inverse, Wander, inverse
from boresight.models.systematic import SystematicErrors, effects

Array = Any

MOVING = ("time_bias_s", "site_east_m", "site_north_m")  # these move the place of linearisation
_NEAR_M = 1e-3  # a target at the radar still has a lever


class Columns(NamedTuple):
    """Residuals and effects.

    Attributes:
        channels: their names.
        order: (m,) rows of the pairs.
        starts: (targets,) first row of each target that has any.
        target: (targets,) their numbers in the pairs.
        gap_s: (m,) since the target's pair before, infinite at its first.
        residual: (k, m) measured minus expected at the place of linearisation; 0 if not seen.
        at: what the laws need to know.
        touch: for each channel the terms that touch it, (n_c,).
        effect: for each channel what one unit of them adds, (n_c, m).
        ranging: the channel that transponders delay; -1 if there is none.
    """

    channels: tuple[str, ...]
    order: Array
    starts: Array
    target: Array
    gap_s: Array
    residual: Array
    at: Setting
    touch: tuple[Array, ...]
    effect: tuple[Array, ...]
    ranging: int

    @property
    def counts(self) -> Array:
        """(targets,) number of pairs."""
        return np.diff(self.starts, append=len(self.order))

    def by_target(self, values: Array) -> Array:
        """(..., targets) sums of values (..., m) over each target's pairs."""
        return np.add.reduceat(values, self.starts, axis=-1)

    def after(self, terms: Array, delay: Array) -> Array:
        """(k, m) residuals without terms (n,) and delays (targets,)."""
        left = self.residual.copy()
        for channel, (touch, effect) in enumerate(zip(self.touch, self.effect, strict=True)):
            left[channel] -= terms[touch] @ effect
        if self.ranging >= 0:
            left[self.ranging] -= np.repeat(delay, self.counts)
        return self.at.seen * left

    def inverses(self, weight: Array, wander: Wander) -> tuple[Inverse, ...]:
        """Of each channel's covariance under weights (k, m), delays aside."""
        laws = zip(weight, wander.variance, wander.time_s, strict=True)
        return tuple(inverse(row, self.gap_s, *law) for row, *law in laws)

    def worth(self, inverses: tuple[Inverse, ...]) -> Array:
        """(k, m) what a pair's weight is worth: so its target tells of a level what it can."""
        worth = np.ones_like(self.residual)
        for channel, own in enumerate(inverses):
            if own.slow is not None:
                power = self.by_target(own(np.ones(len(self.order))))
                whole = np.maximum(self.by_target(own.weight), np.finfo(float).tiny)
                # a target of outliers alone has no weight but rounding: its share is void
                worth[channel] = np.repeat(np.clip(power / whole, 0.0, 1.0), self.counts)
        return worth

    def sums(self, weight: Array, prior: Array) -> Sums:
        """Normal equations under weights (k, m) and prior inverse variances (n,)."""
        n, targets = len(prior), len(self.starts)
        normal, right = np.diag(prior), np.zeros(n)
        cross, own, pull = np.zeros((targets, n)), np.zeros(targets), np.zeros(targets)
        for channel, (touch, effect) in enumerate(zip(self.touch, self.effect, strict=True)):
            weighted = effect * weight[channel]
            normal[np.ix_(touch, touch)] += weighted @ effect.T
            right[touch] += weighted @ self.residual[channel]
            if channel == self.ranging:
                cross[:, touch] = self.by_target(weighted).T
                own = self.by_target(weight[channel])
                pull = self.by_target(weight[channel] * self.residual[channel])
        return Sums(normal, right, cross, own, pull)

    def scores(self, influence: Array, n: int) -> Array:
        """(targets, n) sums of effects times influence (k, m)."""
        total = np.zeros((len(self.starts), n))
        for channel, (touch, effect) in enumerate(zip(self.touch, self.effect, strict=True)):
            total[:, touch] += self.by_target(effect * influence[channel]).T
        return total

    def normals(self, weight: Array, n: int) -> Array:
        """(targets, n, n) sums of products of effects under weights (k, m)."""
        total = np.zeros((len(self.starts), n, n))
        ends = (*self.starts[1:], len(self.order))
        for channel, (touch, effect) in enumerate(zip(self.touch, self.effect, strict=True)):
            weighted = effect * weight[channel]
            block = np.ix_(touch, touch)
            for g, (a, b) in enumerate(zip(self.starts, ends, strict=True)):
                total[g][block] += weighted[:, a:b] @ effect[:, a:b].T
        return total


def columns(pairs: Pairs, terms: tuple[str, ...], moved: Array) -> Columns:
    """Arrange pairs, linearised where the moving ones of the terms (n,) put the targets."""
    order = np.lexsort((pairs.time_s, pairs.target))
    sorted_pairs = pairs.take(order)
    target, starts = np.unique(sorted_pairs.target, return_index=True)
    gap_s = np.diff(sorted_pairs.time_s, prepend=0.0)
    gap_s[starts] = np.inf
    known = SystematicErrors(terms=terms, estimate=moved, cov=np.zeros((len(terms), len(terms))))
    placed = replace(sorted_pairs, position=_place(sorted_pairs, known))
    touch, effect = _effects(placed, terms)
    residual = placed.residuals().T
    for channel, (of, each) in enumerate(zip(touch, effect, strict=True)):
        residual[channel] += np.where(np.isin(of, _moving(terms)), moved[of], 0.0) @ each
    seen = np.isfinite(residual)
    lever = _lever(placed)
    accuracy = np.nan_to_num(placed.accuracy_m)
    extra = (accuracy / lever) ** 2 if accuracy.any() else np.zeros((len(lever), 1))
    late = effects(MOVING[0], placed.position.T, placed.velocity.T)
    second = np.array([late[channel] for channel in pairs.channels])
    return Columns(
        channels=pairs.channels,
        order=order,
        starts=starts,
        target=target,
        gap_s=gap_s,
        residual=np.where(seen, residual, 0.0),
        at=setting(seen.astype(float), extra, lever, second),
        touch=touch,
        effect=effect,
        ranging=pairs.channels.index("range_m") if "range_m" in pairs.channels else -1,
    )


def _moving(terms: tuple[str, ...]) -> list[int]:
    return [i for i, term in enumerate(terms) if term in MOVING]


def _place(pairs: Pairs, known: SystematicErrors) -> Array:
    """(m, 3) where the targets were when they were measured, seen from where the antenna is."""
    site = np.array([known.value("site_north_m"), known.value("site_east_m"), 0.0])
    return pairs.position - known.value("time_bias_s") * pairs.velocity - site


def _effects(pairs: Pairs, terms: tuple[str, ...]) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """For each channel, which terms touch it and what one unit of each adds."""
    place, speed = pairs.position.T, pairs.velocity.T
    table = [effects(term, place, speed) for term in terms]
    touch = [[i for i, row in enumerate(table) if channel in row] for channel in pairs.channels]
    effect = [
        np.array([table[i][channel] for i in of]).reshape(len(of), len(pairs))
        for of, channel in zip(touch, pairs.channels, strict=True)
    ]
    return tuple(np.array(of, dtype=int) for of in touch), tuple(effect)


def _lever(pairs: Pairs) -> Array:
    """(k, m) metres that one unit of each channel displaces."""
    ground = np.hypot(pairs.position[:, 0], pairs.position[:, 1])
    lever = {
        "range_m": np.ones(len(pairs)),
        "azimuth_rad": ground,
        "elevation_rad": np.hypot(ground, pairs.position[:, 2]),
    }
    return np.maximum(np.array([lever[channel] for channel in pairs.channels]), _NEAR_M)


def thinned(pairs: Pairs, most: int) -> Pairs:
    """About `most` pairs of them, of every target its part."""
    step = -(-len(pairs) // most)
    if step == 1:
        return pairs
    order = np.argsort(pairs.target, kind="stable")
    _, starts, counts = np.unique(pairs.target[order], return_index=True, return_counts=True)
    rank = np.arange(len(pairs)) - np.repeat(starts, counts)
    return pairs.take(order[rank % step == 0])
