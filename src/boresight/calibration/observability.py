"""Which systematic errors the geometry tells apart, and which it cannot or hardly can.

Judged by where the targets flew, not by what was estimated: the information of the terms, scaled by
how large each may be, has directions along which the plots shrink what was believed, and directions
along which they do not. What a reference or a transponder does wrong it does for minutes, so a
target counts as a limited number of independent pairs, however often it was seen.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.result import Direction
from boresight.models.systematic import TERMS

Array = Any

_WORTH = 30.0  # independent pairs that a target is worth at most
_SHRUNK = 25.0  # prior variance over posterior: told if the plots shrink the sd to a fifth
_BELIEVED = 0.5  # of a term's variance: if more is believed than measured, it is not observed
_COST = 3.0  # of a term's sd, the others being unknown: hardly separable from there on
_COST_RANGING = 4.5  # a gain costs a bias 3.0 even where targets are spread evenly over the area
_COMPANY = 0.55  # of a term's largest correlation: others below it are not named with it
_RANGING = {"range_bias_m", "range_gain_m_per_km"}
_PART = 0.15  # of a direction's largest weight: terms below it are not named


class Observability(NamedTuple):
    """What the geometry tells.

    Attributes:
        observable: (n,) by term.
        directions: what is not told, then what is hardly.
    """

    observable: Array
    directions: tuple[Direction, ...]


def observability(
    terms: Sequence[str], information: Array, pairs: Array, cov: Array, estimate: Array
) -> Observability:
    """Judge each term and direction.

    Args:
        terms: (n names) of `TERMS`.
        information: (targets, n, n) of each target, without prior.
        pairs: (targets,) their number.
        cov: (n, n) of the estimate, clustered.
        estimate: (n,) in the terms' units.
    """
    scale = np.array([TERMS[term].scale for term in terms])
    worth = np.minimum(1.0, _WORTH / np.maximum(pairs, 1.0))
    scaled = np.einsum("g,gij->ij", worth, information) * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    left = 1.0 / (1.0 + np.maximum(values, 0.0))
    hidden = left * _SHRUNK > 1.0
    variance = vectors**2 * left
    observable = variance[:, hidden].sum(1) <= _BELIEVED * variance.sum(1)
    unseen = [_unseen(terms, scale * vectors[:, k]) for k in np.flatnonzero(hidden)]
    return Observability(observable, (*unseen, *_hardly(terms, observable, cov, estimate)))


def _unseen(terms: Sequence[str], direction: Array) -> Direction:
    """A direction along which the plots say nothing."""
    weights = _weights(terms, direction)
    words = (
        f"{_names(weights)} cannot be told from the geometry of these pairs: "
        f"adding {_sum(weights)} changes no plot by more than the noise hides."
    )
    if len(weights) == 1:
        words = f"{_names(weights)} cannot be told from these pairs: no plot would show it."
    return Direction(weights=weights, observable=False, correlation=float("nan"), words=words)


def _hardly(
    terms: Sequence[str], observable: Array, cov: Array, estimate: Array
) -> list[Direction]:
    """Terms that lose most of what would be known of them if the others were known."""
    sd = np.sqrt(np.diag(cov))
    correlation = cov / np.outer(sd, sd)
    cost = np.sqrt(np.diag(np.linalg.inv(correlation)))
    found: list[Direction] = []
    for i in np.argsort(-cost, kind="stable"):
        limit = _COST_RANGING if terms[i] in _RANGING else _COST
        if cost[i] < limit or not observable[i]:
            continue
        size = np.where(observable, np.abs(correlation[i]), 0.0)
        size[i] = 0.0
        others = np.flatnonzero(size >= _COMPANY * size.max())
        named = {terms[i], *(terms[j] for j in others)}
        if size.any() and not any(named <= direction.weights.keys() for direction in found):
            found.append(_group(terms, int(i), others, cov, estimate))
    return found


def _group(terms: Sequence[str], i: int, others: Array, cov: Array, estimate: Array) -> Direction:
    """Terms that move together, and what is known of them nevertheless."""
    sd = np.sqrt(np.diag(cov))
    correlation = cov[i, others] / (sd[i] * sd[others])
    order = np.argsort(-np.abs(correlation))
    others, correlation = others[order], correlation[order]
    if {terms[i], *(terms[j] for j in others)} == _RANGING and terms[i] != "range_bias_m":
        i, others = int(others[0]), np.array([i])  # metres are what a reader knows
    lever = np.linalg.solve(cov[np.ix_(others, others)], cov[others, i])
    left = np.sqrt(max(cov[i, i] - cov[i, others] @ lever, 0.0))
    known = estimate[i] - lever @ estimate[others]
    names, unit = [terms[i], *(terms[j] for j in others)], TERMS[terms[i]].unit
    combination = _combination(names, lever)
    words = (
        f"{_names(names)} are hardly separable here (correlation {correlation[0]:.2f}): "
        f"{_word(terms[i])} has a standard deviation of {sd[i]:.2g} {unit}, and "
        f"would have {left:.2g} {unit} if the others were known. Well known is "
        f"{combination}: {known:.4g} ± {left:.2g} {unit}."
    )
    weights = dict(zip(names, (sd[i], *(correlation * sd[others])), strict=True))
    return Direction(
        weights={name: float(weight) for name, weight in weights.items()},
        observable=True,
        correlation=float(correlation[0]),
        words=words,
    )


def _combination(names: Sequence[str], lever: Array) -> str:
    """The combination of terms that is known best."""
    if {*names} == _RANGING:
        return f"the range error at {-lever[0]:.0f} km"
    parts = [
        f"{factor:+.3g} × {_word(name)}" for name, factor in zip(names[1:], -lever, strict=True)
    ]
    return " ".join([_word(names[0]), *parts])


def _weights(terms: Sequence[str], direction: Array) -> dict[str, float]:
    """The weights that matter, compared in units of the terms' scales, largest named first."""
    size = np.abs(direction) / [TERMS[term].scale for term in terms]
    order = [int(k) for k in np.argsort(-size) if size[k] >= _PART * size.max()]
    return {terms[k]: float(direction[k]) for k in order}


def _names(terms: Iterable[str]) -> str:
    """'range bias and range gain'."""
    words = [_word(term) for term in terms]
    text = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
    return text[0].upper() + text[1:]


def _word(term: str) -> str:
    """A term inside a list, where its own comma would mislead."""
    return TERMS[term].words.replace(",", "")


def _sum(weights: dict[str, float]) -> str:
    """'100 m of range bias together with -2 m/km of range gain'."""
    return " together with ".join(
        f"{weight:.3g} {TERMS[term].unit} of {_word(term)}" for term, weight in weights.items()
    )
