"""Noise with tails, and pairs that are no measurement: their classes, and the laws of these.

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

from dataclasses import replace
from typing import Any

import numpy as np

from boresight.calibration.laws import LATE_S, OUTLIER_M, SHARES, Classes, Errors, Laws

Array = Any

_WORTH = 5.0  # plots that the belief in the widest law is worth
_TOLD = 2.5  # standard deviations between no wrong time and the usual wrong time, at least
_APART = 3.0  # outliers' scales over the noise of a place, at least
_BLOCK = 8_192  # pairs whose classes are found at once: what fits into a processor's cache
_FINEST = 1e-9  # m or rad: a noise below it is none
_LARGEST = 700.0  # whose exponential is still a number
_SLOWEST = 1.0  # m/s: of a target at rest no wrong time shows


def classify(errors: Errors, laws: Laws) -> Classes:
    """Probabilities of the classes given the errors, and the weights they give (E step)."""
    m = errors.left.shape[1]
    parts = [_classify(errors.part(slice(i, i + _BLOCK)), laws) for i in range(0, m, _BLOCK)]
    return Classes(*(np.concatenate(values, axis=-1) for values in zip(*parts, strict=True)))


def _classify(errors: Errors, laws: Laws) -> Classes:
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
    density[:2] += np.log(np.maximum(laws.wrong, SHARES[0]))[:, None]
    chance = np.exp(density - density.max(0))
    wrong, tail = chance[:2] / chance.sum(0), odds / (1.0 + odds)
    belongs = np.maximum(1.0 - wrong.sum(0), 0.0) * at.seen
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
    found = (pull * laws.place_m**2 + OUTLIER_M**2) / ((wrong * count).sum() + 1.0)
    return float(max(np.sqrt(found), _APART * _noise_m(errors, laws)))


def _lateness(errors: Errors, classes: Classes, laws: Laws) -> tuple[float, float]:
    """Mean and standard deviation of a wrong time."""
    if not laws.late_sd_s:
        return 0.0, 0.0
    wrong = classes.wrong[1]
    total = wrong.sum() + 1.0
    late = (wrong * classes.late_s).sum() / total
    spread = (classes.late_s - late) ** 2 + classes.late_var
    square = (wrong * spread).sum() + LATE_S**2 + late**2
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
    return float(metres[metres > 0.0].min(initial=OUTLIER_M))
