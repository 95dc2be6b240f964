"""A robust mean of angles that were rounded, with an interval by target.

[huber1964] Peter J. Huber, "Robust Estimation of a Location Parameter"

Differs from it: each angle has a standard deviation of its own, made of the rounding and of a
stated one that is widened until the median of the angles' scatter is explained.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.clusters import sandwich
from boresight.calibration.result import TermFound
from boresight.maths import wrap

Array = Any
_HUBER = 1.5  # standard deviations within which an angle counts in full
_MEDIAN_CHI2 = 0.4549  # median of the square of a standard normal number
_ROUNDS = 50


class Pooled(NamedTuple):
    """All angles together, in degrees.

    Attributes:
        value: their mean, in (-180, 180].
        sd: its standard deviation, angles of one target taken as alike.
        half: half the width of its 95 % interval.
        independent_sd: what `sd` would be if all angles erred independently.
        left: (s,) each angle minus the mean.
        spread: (s,) standard deviation of each.
        wander: factor on the standard deviations that were stated.
        weight: (s,) by how much the mean moves with each, in sum one.
    """

    value: float
    sd: float
    half: float
    independent_sd: float
    left: Array
    spread: Array
    wander: float
    weight: Array

    def beyond(self, start: float) -> "Pooled":
        """The same if all angles were counted from `start` (degrees) and not from zero."""
        return self._replace(value=float(np.degrees(wrap(np.radians(start + self.value)))))

    def term(self) -> TermFound:
        """The mean as a systematic error is reported."""
        return TermFound(
            estimate=self.value,
            sd=self.sd,
            ci95=(self.value - self.half, self.value + self.half),
            observable=True,
            independent_sd=self.independent_sd,
        )


def pool(angle: Array, sd: Array, target: Array, step_deg: float) -> Pooled:
    """Mean of angles of any size, wherever on the circle they lie.

    Args:
        angle: (s,) rad.
        sd: (s,) of each but for the rounding, rad; right up to one factor, which is found.
        target: (s,) number of its target.
        step_deg: of the rounding, degrees.
    """
    from scipy.special import stdtrit

    about = np.angle(np.exp(1j * angle).sum())
    x = np.degrees(wrap(angle - about))
    rounding2, sd2 = step_deg**2 / 12, np.degrees(sd) ** 2
    wander = _wander((x - np.median(x)) ** 2, rounding2, sd2)
    spread = np.sqrt(rounding2 + wander**2 * sd2)
    mean, weight = _huber(x, spread)
    left = x - mean
    slope = (np.abs(left) <= _HUBER * spread) / spread**2
    score = weight * left
    by_target = sandwich(
        np.bincount(target, score)[:, None],
        np.bincount(target, slope)[:, None, None],
        np.zeros(1),
    )
    clustered = float(np.sqrt(by_target.cov[0, 0]))
    return Pooled(
        value=float(np.degrees(wrap(about + np.radians(mean)))),
        sd=clustered,
        half=clustered * float(stdtrit(by_target.freedom[0], 0.975)),
        independent_sd=float(np.sqrt((score**2).sum()) / slope.sum()),
        left=left,
        spread=spread,
        wander=wander,
        weight=slope / slope.sum(),
    )


def _huber(x: Array, spread: Array) -> tuple[float, Array]:
    """Huber's mean, and the weights (s,) that make it."""
    mean, weight = np.median(x), 1.0 / spread**2
    for _ in range(_ROUNDS):
        far = np.abs(x - mean) / (_HUBER * spread)
        weight = 1.0 / (spread**2 * np.maximum(far, 1.0))
        mean = (weight @ x) / weight.sum()
    return float(mean), weight


def _wander(left2: Array, rounding2: float, sd2: Array) -> float:
    """Factor on the stated standard deviations that explains the median scatter; 1 or more."""
    low, high = 1.0, 1_000.0
    for _ in range(_ROUNDS):
        factor = np.sqrt(low * high)
        too_small = np.median(left2 / (rounding2 + factor**2 * sd2)) > _MEDIAN_CHI2
        low, high = (factor, high) if too_small else (low, factor)
    return float(low)
