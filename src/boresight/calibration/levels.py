"""Means and slopes of what is left, where each target has a level of its own.

Rows are means over plots of one target. A target's level (its transponder's delay, an error of its
reference) is a random effect: what a target tells by going from one interval to the next counts in
full, what only other targets tell counts as much as targets agree. Whatever the rows of one target
share beyond that is left to the intervals, which are clustered by target (`clusters`).
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.clusters import sandwich

Array = Any
FEWEST = 3  # targets: of fewer nobody can say how much targets differ
_MOST = 100  # clusters: targets beyond are put together, which costs nothing but degrees of freedom
_FAINT = 1e-9  # of the information: what no target tells stays wide instead of infinite


class Estimates(NamedTuple):
    """Numbers with intervals clustered by target.

    Attributes:
        value, sd: (c,).
        freedom: (c,) degrees of freedom of Student's law.
    """

    value: Array
    sd: Array
    freedom: Array

    def half_width(self, chance: float = 0.05) -> Array:
        """(c,) half the width of the intervals that miss with this chance."""
        from scipy.special import stdtrit

        return self.sd * stdtrit(self.freedom, 1.0 - chance / 2.0)

    def chance(self) -> Array:
        """(c,) how often a number would be so far from zero if the true one were zero."""
        from scipy.special import stdtr

        return 2.0 * stdtr(self.freedom, -np.abs(self.value) / self.sd)


def estimate(X: Array, y: Array, count: Array, target: Array, contrasts: Array) -> Estimates:
    """Generalised least squares with a random level of each target.

    Args:
        X: (r, p) regressors.
        y: (r,) means.
        count: (r,) number of plots in each mean.
        target: (r,) number of the target, ascending; of `FEWEST` targets at least.
        contrasts: (c, p) combinations of the coefficients that are asked for.
    """
    X, y, first = _whitened(X, y, count, target)
    ends = first[np.linspace(0, len(first), min(len(first), _MOST) + 1).astype(int)[1:-1]]
    information = np.stack([own.T @ own for own in np.split(X, ends)])
    whole = information.sum(axis=0)
    faint = _FAINT * (np.diag(whole) + np.trace(whole) / len(whole))
    beta = np.linalg.solve(whole + np.diag(faint), X.T @ y)
    scores = np.add.reduceat(X * (y - X @ beta)[:, None], np.concatenate([[0], ends]))
    spread = sandwich(scores, information, faint, contrasts)
    sd = np.sqrt(np.diag(spread.cov))
    return Estimates(contrasts @ beta, sd, np.maximum(spread.freedom, 1.0))


def _whitened(X: Array, y: Array, count: Array, target: Array) -> tuple[Array, Array, Array]:
    """Rows as if they were independent, of variance one; and the first row of each target."""
    first = np.flatnonzero(np.diff(target, prepend=-1))
    who = np.repeat(np.arange(len(first)), np.diff(first, append=len(target)))
    total = np.add.reduceat(count, first)
    rows = np.column_stack([X, y])
    mean = np.add.reduceat(rows * count[:, None], first) / total[:, None]
    within, between = _variances(X, y, count, first, who)
    lost = 1.0 - np.sqrt(within / (within + total * between))
    rows = np.sqrt(count / within)[:, None] * (rows - (lost[:, None] * mean)[who])
    return rows[:, :-1], rows[:, -1], first


def _variances(X: Array, y: Array, count: Array, first: Array, who: Array) -> tuple[float, float]:
    """Of one plot about its target's level, and of the levels; by moments, of plain residuals."""
    root = np.sqrt(count)
    beta = np.linalg.lstsq(X * root[:, None], y * root, rcond=None)[0]
    left = y - X @ beta
    total = np.add.reduceat(count, first)
    level = np.add.reduceat(left * count, first) / total
    within = float(count @ (left - level[who]) ** 2) / max(len(y) - len(first), 1)
    between = float(np.var(level)) - within * float(np.mean(1.0 / total))
    least = np.finfo(float).eps * (float(count @ y**2) + 1.0)
    return max(within, least), max(between, 0.0)
