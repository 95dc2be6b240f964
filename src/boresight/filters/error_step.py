"""One scan of the error model for one target: the formula that is recorded.

Paper: kashyap (4), (5), (7) and (8), one channel at a time.
Differs from it: a bias may be doubted and may change, by two tests of the innovations.

[wald1945] A. Wald, "Sequential Tests of Statistical Hypotheses": whether there is a bias. Each
difference multiplies the odds for one by its density with a bias (that of the innovation) over its
density without (that of the plot's noise alone). Where there is none, the expected factor is 1, so
the odds ever reach 1 with a probability of at most 1/`odds`.

[page1954] E. S. Page, "Continuous Inspection Schemes": whether it has changed. Two sums of
normalised innovations, one for each sign, half a standard deviation allowed in each, held at 0 from
below. Without a change one of them passes `alarm` once in some exp(alarm + 1.17) references; 9,480
at 8, from the chain of its values. Then the error is as unknown as at first, and odds against a
bias are even again.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.filters.ekf import condition
from boresight.filters.error_beside import Beside, Case, back, beside
from boresight.filters.error_window import noise_of, pushed
from boresight.lanes import Leaf, Matrix, Vector
from boresight.maths import Gaussian, mirror, missing, select, wrap
from boresight.models.error_model import ErrorModel

Array = Any
_CERTAIN = 30.0  # logarithm of odds beyond which evidence is not counted
_ALLOWED = 0.5  # standard deviations: half the smallest change that is to be found quickly


class Followed(NamedTuple):
    """One channel after a scan.

    Attributes:
        prior, post: the error (and its rate) before and after the reference was used.
        there: 1 if plot and reference were there, else 0.
        known: 1 once they were, else 0: then the prior is the widest.
        evidence: logarithm of what references have made of the odds for a bias.
        sums: (2,) Page's, of innovations that have risen and fallen.
        probability: of a bias, before this scan's reference was used.
    """

    prior: Gaussian
    post: Gaussian
    there: Any
    known: Any
    evidence: Any
    sums: Sequence[Any]
    probability: Any


def layout(case: Case) -> dict[str, Leaf]:
    """What travels from scan to scan."""
    c, n = len(case.channels), 1 if case.model.state == "bias" else 2
    kept = {"error": Matrix(c, n), "cov": Matrix(c, n * n), "sums": Matrix(c, 2)}
    kept |= {"known": Vector(c), "evidence": Vector(c)}
    if case.model.window:
        kept |= {"last": Matrix(case.model.window, c), "count": Vector(c)}
    return kept


def told(case: Case) -> dict[str, Leaf]:
    """What is written at every scan."""
    c = len(case.channels)
    cov = {"error_cov": Matrix(c, c), "noise_cov": Matrix(c, c)}
    width = len(case.sensor.names) if case.polar else c
    return {"z": Vector(width), "error": Vector(c), "probability": Vector(c)} | cov


def step(
    case: Case, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """One scan of one target: what is kept, and what is told."""
    z = inputs["z"]
    pair = beside(case, z, inputs["reference"])
    found = [_follow(case, i, pair, state, inputs["dt"]) for i in range(len(case.channels))]
    window, noise = _windowed(case, pair, found, state)
    applied = [_applied(case.model, channel) for channel in found]
    error, variance = (np.array(each) for each in zip(*applied, strict=True))
    plot, spread = pair.plot + error, np.diag(variance)
    if not case.polar:  # a plot that has no place has no noise there
        gone, nothing = missing(sum(plot)), np.full(noise.shape, np.nan)
        noise, spread = (_either(gone, nothing, each) for each in (noise, spread))
    kept = window | {
        "error": np.array([channel.post.mean for channel in found]),
        "cov": np.array([channel.post.cov.ravel() for channel in found]),
        "sums": np.array([channel.sums for channel in found]),
        "known": np.array([channel.known for channel in found]),
        "evidence": np.array([channel.evidence for channel in found]),
    }
    return kept, {
        "z": back(case, z, plot) if case.polar else plot,
        "error": error,
        "error_cov": spread,
        "noise_cov": noise,
        "probability": np.array([channel.probability for channel in found]),
    }


def _follow(case: Case, i: int, pair: Beside, state: Mapping[str, Any], dt: Any) -> Followed:
    """One channel through one scan: (7) and (8)."""
    difference, known = pair.difference[i], state["known"][i]
    gone = missing(difference)
    there, off = select(gone, 0.0, 1.0), select(gone, 0.0, difference)
    prior = _predicted(case, i, state, there, dt)
    wide = _widest(case.model, pair.noise[i, i], len(prior.mean))
    prior = Gaussian(prior.mean, _either(known < 0.5, wide, prior.cov))
    r, nu = pair.noise[i, i] + pair.blur[i], off - prior.mean[0]
    nu = (wrap(nu) if case.is_angle(i) else nu) * there
    post, s = condition(prior, np.eye(len(prior.mean))[0], nu, r, there)
    known = select(gone, known, 1.0)
    evidence, sums, probability = state["evidence"][i], state["sums"][i], 1.0 + 0.0 * known
    if case.model.odds is not None:
        probability = 1.0 / (1.0 + case.model.odds * np.exp(-evidence))
        evidence = evidence + there * 0.5 * (off * off / r - nu * nu / s - np.log(s / r))
        evidence = select(evidence > _CERTAIN, _CERTAIN, evidence)
    if case.model.alarm is not None:
        changed, sums = _changed(case.model.alarm, sums, nu / np.sqrt(s), there)
        known = select(changed, 0.0, known)
        evidence = select(changed & (evidence < 0.0), 0.0, evidence)
    return Followed(prior, post, there, known, evidence, sums, probability)


def _predicted(case: Case, i: int, state: Mapping[str, Any], there: Any, dt: Any) -> Gaussian:
    """The error dt later: (4) and (7), with erratum K7 for a rate."""
    drift, mean = case.drift(i), state["error"][i]
    cov = state["cov"][i].reshape(len(mean), len(mean))
    if case.model.state == "bias":
        return Gaussian(mean, cov + drift * drift * dt)
    F = np.array([[1.0, dt], [0.0, 1.0]])
    G = np.array([dt * dt / 2.0, dt]) * drift
    moved = F @ mean
    if case.model.outage == "hold":
        moved = _either(there > 0.5, moved, mean)
    return Gaussian(moved, mirror(F @ cov @ F.T + np.outer(G, G)))


def _widest(model: ErrorModel, variance: Any, n: int) -> Array:
    """Covariance of an error that no reference has met."""
    return np.diag(np.array([s * s * variance for s in (model.spread, model.rate_spread)[:n]]))


def _either(first: Any, a: Array, b: Array) -> Array:
    """`select` for arrays of one shape."""
    pairs = zip(a.ravel(), b.ravel(), strict=True)
    return np.array([select(first, x, y) for x, y in pairs]).reshape(a.shape)


def _changed(limit: Any, sums: Array, x: Any, there: Any) -> tuple[Any, Array]:
    """Page's test: have normalised innovations lost their mean of 0, upwards or downwards?"""
    moved = [sums[0] + there * (x - _ALLOWED), sums[1] + there * (-x - _ALLOWED)]
    moved = [select(total > 0.0, total, 0.0) for total in moved]
    changed = (moved[0] > limit) | (moved[1] > limit)
    return changed, np.array([select(changed, 0.0, total) for total in moved])


def _applied(model: ErrorModel, channel: Followed) -> tuple[Any, Any]:
    """What is added to the plot, and the mean square of the error about that.

    The error is 0, or, with the probability of a bias, it is normal.
    """
    used = channel.post if model.correction == "same epoch" else channel.prior
    p, error, variance = channel.probability, used.mean[0], used.cov[0, 0]
    added = p * error
    if model.correction == "none":
        added = 0.0 * added
    elif model.outage == "zero":
        added = added * channel.there
    return added, p * (variance + error * error) - 2.0 * p * error * added + added * added


def _windowed(
    case: Case, pair: Beside, found: Sequence[Followed], state: Mapping[str, Any]
) -> tuple[dict[str, Any], Array]:
    """The window with this scan's entry, and the noise of the plot."""
    model = case.model
    if not model.window:
        return {}, pair.noise
    taken_off = {
        "difference": [0.0] * len(found),
        "innovation": [channel.prior.mean[0] for channel in found],
        "residual": [channel.post.mean[0] for channel in found],
    }[model.source]
    entries = pair.difference - np.array(taken_off)
    entries = np.array([wrap(e) if case.is_angle(i) else e for i, e in enumerate(entries)])
    before = state["last"], state["count"]
    after = pushed(*before, entries, together=model.noise == "full")
    # A correction by the prediction uses nothing of this scan; then its noise does not either.
    used = before if model.correction == "prediction" else after
    return dict(zip(("last", "count"), after, strict=True)), noise_of(model, *used, pair.noise)
