"""What errors of plots look like: two normal laws per channel, and pairs that are no measurement.

Monopulse azimuths err by a narrow and a wide normal law. Two kinds of pairs say nothing of their
target. A wrong identity or place shifts all channels together, by hundreds of metres or by hundreds
of kilometres: its displacement has a Cauchy law in as many dimensions as there are channels. A
wrong time shifts the target along its way, by so many seconds as a normal law says. Class
probabilities and laws are found by expectation-maximisation.

    [peel2000] David Peel and Geoffrey J. McLachlan, "Robust mixture modelling using the t
        distribution"

Differs from it: the normal classes are scale mixtures per channel; the wide one is held to a few
times the narrow one, so that it cannot swallow what the outliers' laws are for.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

Array = Any

_WIDEST = {
    "range_m": 2.0,
    "azimuth_rad": 4.0,
    "elevation_rad": 4.0,
}  # over narrow; pulses time well
_NEAREST = 1.5  # below it the two laws are one
_WORTH = 5.0  # plots that the belief in the widest law is worth
_OUTLIER_M, _LATE_S = 1_000.0, 2.0  # believed scales of outliers, each worth one pair
_LATEST_S = (1e-2, 1e4)  # bounds of its scale
_TOLD = 2.5  # standard deviations between no wrong time and the usual wrong time, at least
_APART = 3.0  # outliers' scales over the noise of a place, at least
_SHARES = (1e-6, 0.5)  # of outliers, and of the wide law: more is not the rarer class any more
_FINEST = 1e-9  # m or rad: a noise below it is none
_LARGEST = 700.0  # whose exponential is still a number
_SLOWEST = 1.0  # m/s: of a target at rest no wrong time shows


@dataclass(frozen=True, kw_only=True, eq=False)
class Laws:
    """Noise of every channel, and outliers.

    Attributes:
        sd: (k,) of the narrow law, m or rad.
        widest: (k,) largest ratio of the wide law to the narrow one.
        tail_share: (k,) of the wide law; 0 makes the channel normal.
        tail_sd: (k,) of the wide law.
        wrong: (2,) shares of pairs at a wrong place and at a wrong time.
        place_m: scale of the displacement at a wrong place.
        late_s, late_sd_s: mean and standard deviation of a wrong time; 0 and 0 if there is none.
    """

    sd: Array
    widest: Array
    tail_share: Array
    tail_sd: Array
    wrong: Array
    place_m: float = _OUTLIER_M
    late_s: float = 0.0
    late_sd_s: float = _LATE_S

    @property
    def robust(self) -> bool:
        """Whether there is any class but the narrow one."""
        return bool(self.tail_share.any())

    @property
    def outlier_share(self) -> float:
        """Of pairs that are no measurement of their target."""
        return float(self.wrong.sum())

    @property
    def variance(self) -> Array:
        """(k, 1) of both normal laws together."""
        share = self.tail_share
        return ((1.0 - share) * self.sd**2 + share * self.tail_sd**2)[:, None]

    def without_late(self) -> "Laws":
        """No wrong times: what they explained, noise and wrong places explain."""
        return replace(self, wrong=self.wrong * (1.0, 0.0), late_s=0.0, late_sd_s=0.0)

    def bounded(self) -> "Laws":
        """Brought back to where laws can be."""
        if not self.robust:
            return self
        return replace(
            self,
            tail_share=np.clip(self.tail_share, *_SHARES),
            tail_sd=np.clip(self.tail_sd, _NEAREST * self.sd, self.widest * self.sd),
            wrong=np.clip(self.wrong, [_SHARES[0], self.late_sd_s and _SHARES[0]], _SHARES[1] / 2),
            late_sd_s=float(np.clip(self.late_sd_s, *_LATEST_S)) if self.late_sd_s else 0.0,
        )


class Classes(NamedTuple):
    """To which class the pairs belong, and what follows for the fit.

    Attributes:
        wrong: (2, m) probability of a wrong place and of a wrong time.
        wide: (k, m) probability of the wide law, if the pair is a measurement.
        weight: (k, m) expected inverse variance; 0 where nothing was measured.
        curvature: (k, m) derivative of weight times residual, which is negative in the tails.
        late_s, late_var: (m,) mean and variance of its wrong time, if it has one.
    """

    wrong: Array
    wide: Array
    weight: Array
    curvature: Array
    late_s: Array
    late_var: Array

    @property
    def outlier(self) -> Array:
        """(m,) probability that the pair is no measurement."""
        return self.wrong.sum(0)


class Setting(NamedTuple):
    """What the laws need to know of the pairs, the same in every step.

    Attributes:
        seen: (k, m) 1 where measured, else 0.
        extra: (k, m) or (k, 1) variance that the reference adds.
        lever: (k, m) metres of displacement for one unit of residual; 0 where not measured.
        second: (k, m) what one second of wrong time adds; 0 where not measured.
        count: (m,) channels measured.
        base: (m,) log density of no displacement under a Cauchy law of scale 1 m, times
            (2 pi)^(k/2).
        typical_m: (k,) median lever.
        speed_mps: typical displacement in one second.
    """

    seen: Array
    extra: Array
    lever: Array
    second: Array
    count: Array
    base: Array
    typical_m: Array
    speed_mps: float


def setting(seen: Array, extra: Array, lever: Array, second: Array) -> Setting:
    """Gather what stays the same; `lever` and `second` (k, m) are needed where seen."""
    from scipy.special import gammaln

    count = seen.sum(0)
    units = (seen * np.log(lever)).sum(0)
    base = gammaln(0.5 * (1.0 + count)) - 0.5 * np.log(np.pi) + 0.5 * count * np.log(2.0) + units
    lever, second = seen * lever, seen * second
    speed = float(np.sqrt(np.median(((lever * second) ** 2).sum(0))))
    return Setting(seen, extra, lever, second, count, base, np.median(lever, axis=1), speed)


class Errors(NamedTuple):
    """What is known of the pairs' errors at some point of the fit.

    Attributes:
        left: (k, m) residuals, m or rad; 0 where nothing was measured.
        square: (k, m) their expected squares, what was taken out being uncertain.
        at: the pairs.
    """

    left: Array
    square: Array
    at: Setting


def first_laws(channels: tuple[str, ...], sd: Array, *, robust: bool) -> Laws:
    """Where the search for laws starts, from robust standard deviations (k,)."""
    widest = np.array([_WIDEST[channel] for channel in channels])
    return Laws(
        sd=sd,
        widest=widest,
        tail_share=np.full(len(sd), 0.1 if robust else 0.0),
        tail_sd=widest * sd,
        wrong=np.full(2, 0.03 if robust else 0.0),
    )


def classify(errors: Errors, laws: Laws) -> Classes:
    """Probabilities of the classes given the errors, and the weights they give (E step)."""
    square, at = errors.square, errors.at
    narrow = 1.0 / (laws.sd[:, None] ** 2 + at.extra)
    if not laws.robust:
        weight = at.seen * narrow
        none = np.zeros_like(weight)
        return Classes(np.zeros((2, len(at.count))), none, weight, weight, none[0], none[0])
    wide = 1.0 / (laws.tail_sd[:, None] ** 2 + at.extra)
    share = laws.tail_share[:, None]
    first = np.log1p(-share) + 0.5 * np.log(narrow) - 0.5 * narrow * square
    second = np.log(share) + 0.5 * np.log(wide) - 0.5 * wide * square
    odds = np.exp(np.minimum(second - first, _LARGEST))
    inlier = (at.seen * (first + np.log1p(odds))).sum(0) + np.log1p(-laws.outlier_share)
    late, late_s, late_var = _late(errors, laws)
    density = np.stack([_displaced(errors, laws), late, inlier])
    density[:2] += np.log(np.maximum(laws.wrong, _SHARES[0]))[:, None]
    chance = np.exp(density - density.max(0))
    wrong, tail = chance[:2] / chance.sum(0), odds / (1.0 + odds)
    belongs = (1.0 - wrong.sum(0)) * at.seen
    mean = belongs * ((1.0 - tail) * narrow + tail * wide)
    mean_square = belongs * ((1.0 - tail) * narrow**2 + tail * wide**2)
    curvature = mean - square * (mean_square - mean**2)
    return Classes(wrong, tail, mean, curvature, late_s, late_var)


def _displaced(errors: Errors, laws: Laws) -> Array:
    """(m,) log density of a wrong place, times (2 pi)^(k/2)."""
    at = errors.at
    far = np.log1p(_distance2(errors, laws))
    return at.base - at.count * np.log(laws.place_m) - 0.5 * (1.0 + at.count) * far


def _distance2(errors: Errors, laws: Laws) -> Array:
    """(m,) squared displacement over the outliers' scale."""
    return (errors.at.lever**2 * errors.square).sum(0) / laws.place_m**2


def _late(errors: Errors, laws: Laws) -> tuple[Array, Array, Array]:
    """(m,) log density of a wrong time, times (2 pi)^(k/2); mean and variance of that time."""
    at = errors.at
    if not laws.late_sd_s:
        nothing = np.zeros_like(at.count)
        return nothing - np.inf, nothing, nothing
    variance = laws.variance + at.extra
    inverse = at.seen / variance
    left = errors.left - laws.late_s * at.second
    along = at.second * inverse
    power, pull = (along * at.second).sum(0), (along * left).sum(0)
    spread = 1.0 / (1.0 / laws.late_sd_s**2 + power)
    distance = (left**2 * inverse).sum(0) - pull**2 * spread
    room = (at.seen * np.log(variance)).sum(0) + np.log1p(laws.late_sd_s**2 * power)
    return -0.5 * (room + distance), laws.late_s + spread * pull, spread


def refit(errors: Errors, classes: Classes, laws: Laws) -> Laws:
    """The laws that suit the classes best (M step)."""
    belongs = (1.0 - classes.outlier) * errors.at.seen
    far = belongs * classes.wide
    near = belongs - far
    sd2 = (near * _own(errors, laws.sd)).sum(1) / np.maximum(near.sum(1), 1.0)
    sd = np.maximum(np.sqrt(sd2), _FINEST)
    if not laws.robust:
        return replace(laws, sd=sd, tail_sd=laws.widest * sd)
    believed = _WORTH * (laws.widest * sd) ** 2
    tail2 = ((far * _own(errors, laws.tail_sd)).sum(1) + believed) / (far.sum(1) + _WORTH)
    late_s, late_sd_s = _lateness(errors, classes, laws)
    return replace(
        laws,
        sd=sd,
        tail_sd=np.sqrt(tail2),
        tail_share=far.sum(1) / np.maximum(belongs.sum(1), 1.0),
        wrong=classes.wrong.mean(1),
        place_m=_displacement(errors, classes, laws),
        late_s=late_s,
        late_sd_s=late_sd_s,
    ).bounded()


def _own(errors: Errors, sd: Array) -> Array:
    """(k, m) expected square of the plot's own error, the reference's taken off."""
    share = sd[:, None] ** 2 / (sd[:, None] ** 2 + errors.at.extra)
    return share * (share * errors.square + errors.at.extra)


def _displacement(errors: Errors, classes: Classes, laws: Laws) -> float:
    """Scale of the Cauchy law, by its own expectation-maximisation [peel2000]."""
    count, wrong, distance2 = errors.at.count, classes.wrong[0], _distance2(errors, laws)
    pull = (wrong * (1.0 + count) / (1.0 + distance2) * distance2).sum()
    found = (pull * laws.place_m**2 + _OUTLIER_M**2) / ((wrong * count).sum() + 1.0)
    return float(max(np.sqrt(found), _APART * _noise_m(errors, laws)))


def _lateness(errors: Errors, classes: Classes, laws: Laws) -> tuple[float, float]:
    """Mean and standard deviation of a wrong time."""
    if not laws.late_sd_s:
        return 0.0, 0.0
    wrong = classes.wrong[1]
    total = wrong.sum() + 1.0
    late = (wrong * classes.late_s).sum() / total
    spread = (classes.late_s - late) ** 2 + classes.late_var
    square = (wrong * spread).sum() + _LATE_S**2 + late**2
    return float(late), float(max(np.sqrt(square / total), _blur_s(errors, laws)))


def late_is_apart(errors: Errors, laws: Laws) -> bool:
    """Whether wrong times are a class of their own, and not the noise's or the reference's tail."""
    return abs(laws.late_s) > _TOLD * float(np.hypot(laws.late_sd_s, _blur_s(errors, laws)))


def _blur_s(errors: Errors, laws: Laws) -> float:
    """Noise of a place as a noise of time."""
    return _noise_m(errors, laws) / max(errors.at.speed_mps, _SLOWEST)


def _noise_m(errors: Errors, laws: Laws) -> float:
    """Noise of a place in the channel that is finest there, m."""
    metres = errors.at.typical_m * laws.sd
    return float(metres[metres > 0.0].min(initial=_OUTLIER_M))
