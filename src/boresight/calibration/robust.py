"""What errors of plots look like: two normal laws per channel, and pairs that are no measurement.

Monopulse azimuths err by a narrow and a wide normal law. A wrong identity, place or time makes a
pair that says nothing of its target; it shifts all channels together, by hundreds of metres or by
hundreds of kilometres, so its displacement in metres has a Cauchy law in as many dimensions as
there are channels. Class probabilities and laws are found by expectation-maximisation.

    [peel2000] David Peel and Geoffrey J. McLachlan, "Robust mixture modelling using the t
        distribution"

Differs from it: the normal classes are scale mixtures per channel; the wide one is held to a few
times the narrow one, so that it cannot swallow what the Cauchy law is for.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

Array = Any

_WIDEST = 4.0  # wide law over narrow: beyond it an error is no noise but an outlier
_NEAREST = 1.5  # below it the two laws are one
_USUAL = 3.0  # what the ratio is believed to be, worth this many plots:
_WORTH = 5.0
_OUTLIER_M = 1_000.0  # what the outliers' scale is believed to be, worth one of them
_APART = 3.0  # outliers' scale over the noise of a place, at least
_SHARES = (1e-6, 0.5)  # of outliers, and of the wide law: more is not the rarer class any more
_FINEST = 1e-9  # m or rad: a noise below it is none


@dataclass(frozen=True, kw_only=True, eq=False)
class Laws:
    """Noise of every channel, and outliers.

    Attributes:
        sd: (k,) of the narrow law, m or rad.
        tail_share: (k,) of the wide law; 0 makes the channel normal.
        tail_sd: (k,) of the wide law.
        outlier_share: of pairs that are no measurement.
        outlier_m: scale of the outliers' displacement.
    """

    sd: Array
    tail_share: Array
    tail_sd: Array
    outlier_share: float
    outlier_m: float

    @property
    def robust(self) -> bool:
        """Whether there is any class but the narrow one."""
        return self.outlier_share > 0.0

    @property
    def total_sd(self) -> Array:
        """(k,) of both laws together."""
        share = self.tail_share
        return np.sqrt((1.0 - share) * self.sd**2 + share * self.tail_sd**2)


class Classes(NamedTuple):
    """To which class the pairs belong, and what follows for the fit.

    Attributes:
        outlier: (m,) probability that the pair is no measurement.
        wide: (k, m) probability of the wide law, if it is one.
        weight: (k, m) expected inverse variance; 0 where nothing was measured.
        curvature: (k, m) derivative of weight times residual, which is negative in the tails.
    """

    outlier: Array
    wide: Array
    weight: Array
    curvature: Array


class Errors(NamedTuple):
    """What is known of the pairs' errors at some point of the fit.

    Attributes:
        square: (k, m) expected squared residual, m² or rad²; 0 where nothing was measured.
        seen: (k, m) 1 where measured, else 0.
        extra: (k, m) or (k, 1) variance that the reference adds.
        lever: (k, m) or (k, 1) metres of displacement for one unit of residual.
    """

    square: Array
    seen: Array
    extra: Array
    lever: Array


def first_laws(sd: Array, *, robust: bool) -> Laws:
    """Where the search for laws starts, from robust standard deviations (k,)."""
    some = np.full(len(sd), 0.1 if robust else 0.0)
    share = 0.05 if robust else 0.0
    return Laws(
        sd=sd, tail_share=some, tail_sd=_USUAL * sd, outlier_share=share, outlier_m=_OUTLIER_M
    )


def classify(errors: Errors, laws: Laws) -> Classes:
    """Probabilities of the classes given the errors, and the weights they give (E step)."""
    narrow = 1.0 / (laws.sd[:, None] ** 2 + errors.extra)
    if not laws.robust:
        weight = errors.seen * narrow
        none = np.zeros_like(weight)
        return Classes(none[0], none, weight, weight)
    wide = 1.0 / (laws.tail_sd[:, None] ** 2 + errors.extra)
    share = laws.tail_share[:, None]
    first = np.log1p(-share) + 0.5 * (np.log(narrow) - narrow * errors.square)
    second = np.log(share) + 0.5 * (np.log(wide) - wide * errors.square)
    odds = np.exp(np.minimum(second - first, 700.0))
    inlier = (errors.seen * (first + np.log1p(odds) - 0.5 * np.log(2.0 * np.pi))).sum(0)
    prior = np.log(laws.outlier_share) - np.log1p(-laws.outlier_share)
    out = 1.0 / (1.0 + np.exp(np.minimum(inlier - _displaced(errors, laws) - prior, 700.0)))
    belongs, tail = (1.0 - out) * errors.seen, odds / (1.0 + odds)
    mean = belongs * ((1.0 - tail) * narrow + tail * wide)
    mean_square = belongs * ((1.0 - tail) * narrow**2 + tail * wide**2)
    return Classes(out, tail, mean, mean - errors.square * (mean_square - mean**2))


def _displaced(errors: Errors, laws: Laws) -> Array:
    """(m,) log density of the channels for an outlier: a Cauchy law in metres."""
    from scipy.special import gammaln

    count = errors.seen.sum(0)
    half = 0.5 * (1.0 + count)
    metres = (errors.seen * np.log(errors.lever)).sum(0) - count * np.log(laws.outlier_m)
    return gammaln(half) - half * np.log(np.pi) + metres - half * np.log1p(_distance2(errors, laws))


def _distance2(errors: Errors, laws: Laws) -> Array:
    """(m,) squared displacement over the outliers' scale."""
    return (errors.lever**2 * errors.square).sum(0) / laws.outlier_m**2


def refit(errors: Errors, classes: Classes, laws: Laws) -> Laws:
    """The laws that suit the classes best (M step)."""
    belongs = (1.0 - classes.outlier) * errors.seen
    far = belongs * classes.wide
    near = belongs - far
    sd2 = (near * _own(errors, laws.sd)).sum(1) / np.maximum(near.sum(1), 1.0)
    sd = np.maximum(np.sqrt(sd2), _FINEST)
    if not laws.robust:
        return replace(laws, sd=sd, tail_sd=_USUAL * sd)
    believed = _WORTH * (_USUAL * sd) ** 2
    tail2 = ((far * _own(errors, laws.tail_sd)).sum(1) + believed) / (far.sum(1) + _WORTH)
    return Laws(
        sd=sd,
        tail_sd=np.clip(np.sqrt(tail2), _NEAREST * sd, _WIDEST * sd),
        tail_share=np.clip(far.sum(1) / np.maximum(belongs.sum(1), 1.0), *_SHARES),
        outlier_share=float(np.clip(classes.outlier.mean(), *_SHARES)),
        outlier_m=_outlier_scale(errors, classes, laws),
    )


def _own(errors: Errors, sd: Array) -> Array:
    """(k, m) expected square of the plot's own error, the reference's taken off."""
    share = sd[:, None] ** 2 / (sd[:, None] ** 2 + errors.extra)
    return share * (share * errors.square + errors.extra)


def _outlier_scale(errors: Errors, classes: Classes, laws: Laws) -> float:
    """Scale of the Cauchy law, by its own expectation-maximisation [peel2000]."""
    count = errors.seen.sum(0)
    distance2 = _distance2(errors, laws)
    pull = classes.outlier * (1.0 + count) / (1.0 + distance2)
    found = (pull * distance2).sum() * laws.outlier_m**2 + _OUTLIER_M**2
    place2 = (errors.lever**2 * errors.seen * laws.sd[:, None] ** 2).sum(0)
    least = _APART * np.sqrt(np.median(place2))
    return float(max(np.sqrt(found / ((classes.outlier * count).sum() + 1.0)), least))
