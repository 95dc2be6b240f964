"""Steps: the turn of the antenna at which a radar began to err otherwise.

At every plot the mean of the next plots of its target is compared with the mean of those before it.
The target's own error, and whatever the reference does slowly, cancels. Plots of one turn of the
antenna are added up, each at most so large that one or two targets alone raise no alarm: a
step of the radar shows in all its targets, a jump in one is that target's or its reference's.
The scales are those that the recording itself has, so noise that is not white widens them.
This is a generalised likelihood ratio over a moving window, for a step of unknown size.

[lai1995] T. L. Lai, "Sequential changepoint detection in quality control and dynamical systems":
window-limited likelihood ratios. Differs from it: bounded contributions, empirical scales.
"""

from typing import Any

import numpy as np

from boresight.calibration.residuals import MAD_TO_SD, medians

Array = Any
AFTER, BEFORE, LEAST_BEFORE = 5, 20, 5  # plots of a target: a step is known five turns later
_CLIP = 4.0  # standard deviations of a plot: larger is as large, for an outlier as for a step
_MOST = 3.5  # of one target, in standard deviations: two together stay below the threshold
_THRESHOLD = 5.1  # standard deviations of a turn's sum: passed once in three million turns
_LARGE = 10.0  # where a step is looked for once it is there: the bound above has no peak
_APART = AFTER + BEFORE  # turns: nearer alarms are one
_LEAST_TURNS = 30


def find(time_s: Array, target: Array, y: Array) -> Array:
    """Times at which the errors of all targets step together.

    Args:
        time_s: (m,) of the plots.
        target: (m,) number of the target, from 0.
        y: (m,) residuals; NaN is left out.

    Returns:
        (steps,) ascending: the time of the first plot after each. A recording without a step has
        one in less than 1e-5 of its turns.
    """
    here = np.flatnonzero(np.isfinite(y))
    order = here[np.lexsort((time_s[here], target[here]))]
    time_s, target, y = time_s[order], target[order], y[order]
    gap = np.diff(time_s)[(np.diff(target) == 0) & (np.diff(time_s) > 0.0)]
    if len(gap) < _LEAST_TURNS:
        return np.zeros(0)
    period = float(np.median(gap))
    when, contrast = _contrasts(time_s, target, y, period)
    if len(when) < _LEAST_TURNS:
        return np.zeros(0)
    start = float(when.min())
    turn = ((when - start) / period).astype(int)
    bounded, whole = (np.bincount(turn, np.clip(contrast, -c, c)) for c in (_MOST, _LARGE))
    near = start + period * _peaks(_scaled(bounded, np.bincount(turn)), whole)
    return np.array([_dated(time_s, target, y, t, period) for t in near])


def _contrasts(time_s: Array, target: Array, y: Array, period: float) -> tuple[Array, Array]:
    """Plots with enough around them, and mean after minus mean before in its own deviations."""
    own = y - medians(y, target, int(target[-1]) + 1)[target]
    scale = max(MAD_TO_SD * float(np.median(np.abs(own))), 1e-12)
    summed = np.concatenate([[0.0], np.cumsum(np.clip(own / scale, -_CLIP, _CLIP))])
    rows = np.arange(len(y))
    first = np.maximum.accumulate(np.where(np.diff(target, prepend=-1) != 0, rows, 0))
    end = rows + AFTER
    begin = np.maximum(rows - BEFORE, first)
    # Twice the time that these plots should take: a target that was lost meanwhile tells less.
    last = np.minimum(end, len(y)) - 1
    whole = (end <= len(y)) & (target[last] == target) & (rows - begin >= LEAST_BEFORE)
    whole &= time_s[last] - time_s[begin] < 2.0 * (AFTER + BEFORE) * period
    r, b = rows[whole], begin[whole]
    if not len(r):
        return np.zeros(0), np.zeros(0)
    after = (summed[r + AFTER] - summed[r]) / AFTER
    before = (summed[r] - summed[b]) / (r - b)
    raw = (after - before) / np.sqrt(1.0 / AFTER + 1.0 / (r - b))
    spread = max(MAD_TO_SD * float(np.median(np.abs(raw))), 1e-12)
    return time_s[r], raw / spread


def _scaled(total: Array, count: Array) -> Array:
    """(turns,) sum of each turn's contrasts in its own standard deviations.

    What all targets share widens them; that is believed if it is more than chance.
    """
    scaled = total / np.sqrt(np.maximum(count, 1))
    busy = scaled[count > 2]
    if not len(busy):
        return scaled
    wider = MAD_TO_SD * float(np.median(np.abs(busy)))
    chance = 2.4 * np.sqrt((AFTER + LEAST_BEFORE) / len(busy))  # two deviations of that number
    return scaled / (wider if wider > 1.0 + chance else 1.0)


def _peaks(sums: Array, whole: Array) -> Array:
    """Turns whose sum passes the threshold; of neighbours, that with the largest whole sum."""
    passed = np.flatnonzero(np.abs(sums) > _THRESHOLD)
    groups = np.split(passed, np.flatnonzero(np.diff(passed) > _APART) + 1)
    return np.array([group[np.argmax(np.abs(whole[group]))] for group in groups if len(group)])


def _dated(time_s: Array, target: Array, y: Array, near: float, period: float) -> float:
    """Most likely time of a step, given about where it is: that of the first plot after it."""
    turns = (time_s - near) / period
    before, after, doubtful = (
        (turns >= low) & (turns < high)
        for low, high in ((-BEFORE, -1), (1, BEFORE), (-AFTER, AFTER))
    )
    targets = int(target[-1]) + 1
    level = medians(np.where(before, y, np.nan), target, targets)
    sizes = medians(np.where(after, y, np.nan), target, targets) - level
    size = float(np.median(sizes[np.isfinite(sizes)]))
    rows = np.flatnonzero(doubtful & np.isfinite(level[target]))
    rows = rows[np.argsort(time_s[rows], kind="stable")]
    # Sum over the plots from each on of how much likelier they are after the step than before it.
    gain = np.clip((y[rows] - level[target[rows]]) / size, -1.0, 2.0) - 0.5
    return float(time_s[rows[np.argmax(np.cumsum(gain[::-1])[::-1])]])
