"""Least squares over targets: each adds an error of its own, and intervals are by target.

Rows are means of a target's plots. A target's own level (its transponder's delay, an error of its
reference) is a random effect, so what a target tells by moving from one cell to the next counts in
full and what only other targets tell counts as much as targets agree. Whatever the rows of one
target share beyond that is left to the standard deviations: they come from the estimates that leave
one target out at a time.

[bell2002] R. M. Bell, D. F. McCaffrey, "Bias reduction in standard errors for linear regression
with multi-stage samples": the jackknife over clusters, and degrees of freedom from a working model.
Differs from it: the working model holds the random effect, and one degree is taken for the mean.
"""

from typing import Any, NamedTuple

import numpy as np

Array = Any
_RIDGE = 1e-9  # of the information: what a single target tells alone is left wide, not infinite


class Estimates(NamedTuple):
    """Numbers with standard deviations clustered by target.

    Attributes:
        value, sd, dof: (c,) each; dof are those of Student's law, from how evenly targets count.
    """

    value: Array
    sd: Array
    dof: Array

    def half_width(self, chance: float = 0.05) -> Array:
        """Half the width of the interval that misses with this chance."""
        from scipy.special import stdtrit

        return self.sd * stdtrit(self.dof, 1.0 - chance / 2.0)

    def p(self) -> Array:
        """Chance of a value as far from zero if the true one is zero."""
        from scipy.special import stdtr

        with np.errstate(invalid="ignore", divide="ignore"):
            t = np.where(self.value == 0.0, 0.0, np.abs(self.value) / self.sd)
        return 2.0 * stdtr(self.dof, -t)


def estimate(X: Array, y: Array, count: Array, target: Array, contrasts: Array) -> Estimates:
    """Generalised least squares with a level of each target.

    Args:
        X: (r, p) regressors of each row.
        y: (r,) means.
        count: (r,) how many plots each is the mean of.
        target: (r,) number of the target.
        contrasts: (c, p) which combinations of the p coefficients are asked for.
    """
    _, who = np.unique(target, return_inverse=True)
    shrink = _shrink(X, y, count, who)
    root = np.sqrt(count)[:, None]
    whole = np.column_stack([X, y])
    mean = _sums(whole * count[:, None], who) / _sums(count[:, None], who)
    whole = root * (whole - shrink[who, None] * mean[who])
    return _jackknife(whole[:, :-1], whole[:, -1], who, contrasts)


def _jackknife(X: Array, y: Array, who: Array, contrasts: Array) -> Estimates:
    """Ordinary least squares of rows already whitened; deviations from leaving targets out."""
    targets = int(who.max()) + 1
    A_own = _sums((X[:, :, None] * X[:, None, :]).reshape(len(X), -1), who)
    A_own = A_own.reshape(targets, X.shape[1], X.shape[1])
    A = A_own.sum(axis=0)
    A = A + _RIDGE * np.diag(np.diag(A))
    beta = np.linalg.solve(A, X.T @ y)
    score = _sums(X * (y - X @ beta)[:, None], who)
    # What leaving a target out changes, as one row for each contrast: c (A - A_g)⁻¹.
    row = np.linalg.solve(A - A_own, np.broadcast_to(contrasts.T, (targets, *contrasts.T.shape)))
    change = np.einsum("gpc,gp->cg", row, score)
    expected = A_own - A_own @ np.linalg.solve(A, A_own)
    q = np.einsum("gpc,gpq,gqc->cg", row, expected, row)
    share = (targets - 1.0) / targets
    sd = np.sqrt(share * (change**2).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        dof = q.sum(axis=1) ** 2 / (q**2).sum(axis=1) - 1.0
    alone = ~(dof > 0.5)
    return Estimates(contrasts @ beta, np.where(alone, np.inf, sd), np.where(alone, 1.0, dof))


def _shrink(X: Array, y: Array, count: Array, who: Array) -> Array:
    """(targets,) share of its mean that each target's rows lose: 0 if targets agree, 1 if not."""
    root = np.sqrt(count)
    beta = np.linalg.lstsq(X * root[:, None], y * root, rcond=None)[0]
    left = y - X @ beta
    total = _sums(count[:, None], who)[:, 0]
    level = _sums((left * count)[:, None], who)[:, 0] / total
    degrees = len(y) - len(total)
    within = float(count @ (left - level[who]) ** 2) / degrees if degrees > 0 else 0.0
    between = max(float(np.var(level)) - within * float(np.mean(1.0 / total)), 0.0)
    if within <= 0.0:
        return np.zeros(len(total))
    return 1.0 - np.sqrt(within / (within + total * between))


def _sums(rows: Array, who: Array) -> Array:
    """(targets, ...) sums of the rows of each target."""
    out = np.zeros((int(who.max()) + 1, rows.shape[1]))
    np.add.at(out, who, rows)
    return out
