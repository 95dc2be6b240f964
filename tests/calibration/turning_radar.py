"""Pairs of a radar that turns for a while, each with its time, and a stand-in for their fit.

Every target flies straight and is plotted once a turn; each has a delay of its own in range. What
is planted in the residuals is added by hand, so that nothing under test had a part in it.
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.pairs import Pairs

TURN_S = 4.0
RANGE_M, AZIMUTH_DEG, DELAY_M = 15.0, 0.05, 30.0


class Fit(NamedTuple):
    """What of a registration the tables need."""

    after: Any
    outlier: Any
    delay_m: Any


class Recording(NamedTuple):
    """Pairs and what is left of them when the terms are taken out, m and degrees."""

    pairs: Pairs
    left: Any
    delay_m: Any

    def plus(self, range_m=0.0, azimuth_deg=0.0):
        """The same with an error planted, one number or one for each pair."""
        m = len(self.pairs)
        planted = np.stack([np.broadcast_to(x, m) for x in (range_m, azimuth_deg)], axis=1)
        return self._replace(left=self.left + planted)

    def fit(self):
        """As a robust registration leaves it: the middle of each channel at zero."""
        left = self.left - np.median(self.left, axis=0)
        after = left * np.array([1.0, np.pi / 180.0])
        return Fit(after, np.zeros(len(self.pairs)), self.delay_m)


def record(seed, *, targets=40, turns=250, arrive_s=1_800.0):
    """A recording of targets that arrive over `arrive_s` and are each seen for `turns` turns."""
    rng = np.random.default_rng(seed)
    come = rng.uniform(0.0, arrive_s, targets)
    reach, angle = 120e3 * np.sqrt(rng.uniform(0.05, 1.0, targets)), rng.uniform(0.0, 7.0, targets)
    speed, heading = rng.uniform(120.0, 260.0, targets), rng.uniform(0.0, 7.0, targets)
    height = rng.uniform(3e3, 11e3, targets)
    flown = TURN_S * np.tile(np.arange(turns) - turns / 2, targets)
    target = np.repeat(np.arange(targets), turns)
    way = np.stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(targets)], axis=1)
    middle = np.stack([reach * np.cos(angle), reach * np.sin(angle), height], axis=1)
    position = middle[target] + way[target] * flown[:, None]
    delay = DELAY_M * rng.normal(size=targets)
    noise = rng.normal(size=(len(target), 2)) * [RANGE_M, AZIMUTH_DEG]
    m = len(target)
    pairs = Pairs(
        time_s=come[target] + flown + TURN_S * turns / 2,
        target=target,
        names=tuple(f"T{i}" for i in range(targets)),
        channels=("range_m", "azimuth_rad"),
        z=np.zeros((m, 2)),
        position=position,
        velocity=way[target],
        height_m=position[:, 2],
        accuracy_m=np.full(m, np.nan),
        row=np.arange(m),
    )
    left = noise + np.stack([delay[target], np.zeros(m)], axis=1)
    order = rng.permutation(m)  # no order may be needed
    return Recording(pairs.take(order), left[order], delay)
