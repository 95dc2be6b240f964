"""Least squares where the pairs of one target err together: sums by target, and honest intervals.

Each target may have a delay of its own (a transponder's), normal with a variance found by
restricted maximum likelihood; it is eliminated target by target, so nothing is larger than targets
by terms. The covariance of the terms is the sandwich by target with the bias-reducing correction
CR2, its degrees of freedom after Satterthwaite: with twelve targets an interval is wide, as it
should be.

    [bell2002] Robert M. Bell and Daniel F. McCaffrey, "Bias Reduction in Standard Errors for Linear
        Regression with Multi-Stage Samples"
    [pustejovsky2018] James E. Pustejovsky and Elizabeth Tipton, "Small-Sample Methods for
        Cluster-Robust Variance Estimation and Hypothesis Testing in Fixed Effects Models"

Differs from them: the correction is moved from the pairs to the terms, Z' f(Z M^-1 Z') =
f(Z'Z M^-1) Z', so it costs one small eigenvalue problem for each target; the prior is one more
cluster whose law is known.
"""

from typing import Any, NamedTuple

import numpy as np

Array = Any

_CERTAIN = 1e-15  # of a variance: what is uncertain of it below this is rounding
_LEVERAGE = 1.0 - 1e-9  # of a target that alone tells a direction: its correction stays finite


class Sums(NamedTuple):
    """Weighted sums that the normal equations are made of.

    Attributes:
        normal: (n, n) of products of columns, the prior included.
        right: (n,) of columns times residuals.
        cross: (targets, n) of the columns that a delay shares its channel with.
        own: (targets,) of weights in that channel.
        pull: (targets,) of weighted residuals there.
    """

    normal: Array
    right: Array
    cross: Array
    own: Array
    pull: Array


class Solved(NamedTuple):
    """Terms and delays.

    Attributes:
        terms: (n,).
        information: (n, n) of the terms, delays eliminated.
        delay: (targets,) predicted.
        delay_var: (targets,) of their errors.
    """

    terms: Array
    information: Array
    delay: Array
    delay_var: Array


def solve(sums: Sums, delay_var: float) -> Solved:
    """Generalised least squares with a random delay for each target.

    Args:
        sums: weighted sums.
        delay_var: variance of the delays; 0 for none.
    """
    kept = delay_var / (1.0 + delay_var * sums.own)
    information = sums.normal - (sums.cross * kept[:, None]).T @ sums.cross
    terms = np.linalg.solve(information, sums.right - sums.cross.T @ (kept * sums.pull))
    spread = np.einsum("gi,ij,gj->g", sums.cross, np.linalg.inv(information), sums.cross)
    delay = kept * (sums.pull - sums.cross @ terms)
    return Solved(terms, information, delay, kept + kept**2 * spread)


def delay_variance(sums: Sums, solved: Solved, delay_var: float) -> float:
    """One scoring step of restricted maximum likelihood for the variance of the delays."""
    left = 1.0 / (1.0 + delay_var * sums.own)
    score = left * (sums.pull - sums.cross @ solved.terms)
    spread = np.einsum("gi,ij,gj->g", sums.cross, np.linalg.inv(solved.information), sums.cross)
    power = left * sums.own - left**2 * spread
    scale = (power**2).sum()
    if scale <= 1e-12 * (sums.own**2).sum():
        return 0.0
    return float(max(delay_var + ((score**2).sum() - power.sum()) / scale, 0.0))


class Sandwich(NamedTuple):
    """Covariance of terms by target, and how many degrees of freedom it has.

    Attributes:
        cov: (n, n).
        freedom: (n,) for each term.
    """

    cov: Array
    freedom: Array


def sandwich(
    scores: Array, information: Array, prior: Array, contrasts: Array | None = None
) -> Sandwich:
    """Covariance of an estimate whose scores are independent from target to target.

    Args:
        scores: (targets, n) sum over its pairs of column times influence; zero in sum but for the
            prior.
        information: (targets, n, n) of each target, delays eliminated.
        prior: (n,) inverse variances believed of the terms before any pair.
        contrasts: (c, n) combinations to be told of instead of the terms.

    Returns:
        CR2 covariance [bell2002] and Satterthwaite degrees of freedom [pustejovsky2018, (13)].
    """
    total = information.sum(0) + np.diag(prior)
    root = _inverse_root(total)
    share = root.T @ information @ root
    values, vectors = np.linalg.eigh(share)
    values = np.clip(values, 0.0, _LEVERAGE)
    lifted = (vectors / np.sqrt(1.0 - values)[:, None, :]) @ vectors.mT
    corrected = np.einsum("gij,gj->gi", lifted, scores @ root)
    known = root.T @ np.diag(prior) @ root
    axes = root if contrasts is None else contrasts @ root
    cov = axes @ (corrected.T @ corrected + known) @ axes.T
    freedom = [_freedom(axis, lifted, share, axis @ known @ axis) for axis in axes]
    return Sandwich(0.5 * (cov + cov.T), np.array(freedom))


def _freedom(axis: Array, lifted: Array, share: Array, known: float) -> float:
    """Degrees of freedom of the variance along an axis, as if the information were right."""
    arm = lifted @ axis
    lever = np.einsum("gij,gj->gi", share, arm)
    own = np.einsum("gi,gi->g", arm, lever)
    length2 = (lever**2).sum(1)
    trace = (own - length2).sum()
    square = (own**2).sum() - 2.0 * (own * length2).sum() + ((lever.T @ lever) ** 2).sum()
    whole = (trace + known) ** 2
    return float(whole / square) if square > _CERTAIN * whole else np.inf


def _inverse_root(symmetric: Array) -> Array:
    """R with R R' the inverse; terms are brought to one scale before."""
    scale = 1.0 / np.sqrt(np.diag(symmetric))
    values, vectors = np.linalg.eigh(symmetric * np.outer(scale, scale))
    return scale[:, None] * vectors / np.sqrt(values)
