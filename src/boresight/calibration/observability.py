"""Which systematic errors the geometry tells apart, and which it cannot or hardly can.

Judged by where the targets flew, not by what was estimated: the information of the terms, scaled by
how large each may be, has directions along which the plots shrink what was believed, and directions
along which they do not. What a reference or a transponder does wrong it does for minutes, so a
target counts as a limited number of independent pairs, however often it was seen.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.result import Direction
from boresight.models.systematic import TERMS

Array = Any

_WORTH = 30.0  # independent pairs that a target is worth at most
_SHRUNK = 25.0  # prior variance over posterior: told if the plots shrink the sd to a fifth
_BELIEVED = 0.5  # of a term's variance: if more is believed than measured, it is not observed
_CORRELATED = 0.96  # of two terms: their sd are then 3.6 times those of either alone
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
    """Two terms each, whose errors are nearly the same error."""
    sd = np.sqrt(np.diag(cov))
    correlation = cov / np.outer(sd, sd)
    found = []
    for i in range(len(terms)):
        for j in range(i):
            if observable[i] and observable[j] and abs(correlation[i, j]) > _CORRELATED:
                pair = np.zeros(len(terms))
                pair[j], pair[i] = sd[j], np.sign(correlation[i, j]) * sd[i]
                found.append(_pair(terms, pair, j, i, cov, estimate))
    return found


def _pair(
    terms: Sequence[str], direction: Array, i: int, j: int, cov: Array, estimate: Array
) -> Direction:
    """Say what of two terms is known: the combination whose variance is least."""
    weights = _weights(terms, direction)
    lever = -cov[i, j] / cov[j, j]
    sd = np.sqrt(max(cov[i, i] + lever * cov[i, j], 0.0))
    first, second = TERMS[terms[i]], TERMS[terms[j]]
    correlation = cov[i, j] / np.sqrt(cov[i, i] * cov[j, j])
    words = (
        f"{first.words} and {second.words} are hardly separable here "
        f"(correlation {correlation:.2f}): well known is only {first.words} "
        f"{lever:+.3g} × {second.words} = {estimate[i] + lever * estimate[j]:.3g} "
        f"± {sd:.2g} {first.unit}."
    )
    return Direction(weights=weights, observable=True, correlation=float(correlation), words=words)


def _weights(terms: Sequence[str], direction: Array) -> dict[str, float]:
    """The weights that matter, compared in units of the terms' scales, largest named first."""
    size = np.abs(direction) / [TERMS[term].scale for term in terms]
    order = [int(k) for k in np.argsort(-size) if size[k] >= _PART * size.max()]
    return {terms[k]: float(direction[k]) for k in order}


def _names(weights: dict[str, float]) -> str:
    """'range bias and range gain'."""
    words = [TERMS[term].words for term in weights]
    text = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
    return text[0].upper() + text[1:]


def _sum(weights: dict[str, float]) -> str:
    """'100 m of range bias together with -2 m/km of range gain'."""
    return " together with ".join(
        f"{weight:.3g} {TERMS[term].unit} of {TERMS[term].words}"
        for term, weight in weights.items()
    )
