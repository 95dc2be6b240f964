"""Which systematic errors the geometry tells apart, and which it cannot or hardly can.

Judged by where the targets flew, not by what was estimated: the information of the terms, scaled by
how large each may be, has directions along which the plots shrink what was believed, and directions
along which they do not. What a reference or a transponder does wrong it does for minutes, so a
target counts as a limited number of independent pairs, however often it was seen.

A term that is told may still be told badly, because others can stand in for it. That is judged by
the covariance clustered by target: hardly separable is a term that keeps less than a quarter of the
information it would have if the others were known [belsley1980: variance inflation], with the terms
that its estimate is correlated with. A range gain costs a range bias more than that even where
targets are spread evenly over the area (a ninth is kept), so those two may keep a twenty-fifth.
Forty aircraft spread evenly cross these limits less than once in a hundred; the limits were set
beside two recordings on which the terms named were known to trade.

    [belsley1980] David A. Belsley, Edwin Kuh and Roy E. Welsch, "Regression Diagnostics"
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
_COST = 2.0  # of a term's sd, the others being unknown: hardly separable from there on
_COST_RANGING = 5.0  # the same of range bias and gain
_COMPANY = 0.5  # correlation from which on terms are named together
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
    limit = np.array([_COST_RANGING if term in _RANGING else _COST for term in terms])
    dear = observable & (cost >= limit)
    near = np.abs(correlation) * np.outer(observable, observable)
    found: list[Direction] = []
    for i in np.argsort(-cost / limit, kind="stable"):
        group = _company(near, dear, int(i))
        dear[group] = False
        if len(group) > 1:
            found.append(_group(terms, group, cov, estimate))
    return found


def _company(near: Array, dear: Array, i: int) -> Array:
    """A dear term, and all that are near it, directly or by way of other dear ones."""
    inside = np.arange(len(dear)) == i
    for _ in dear:
        inside = inside | (near[inside & dear] >= _COMPANY).any(0)
    order = np.argsort(-near[i], kind="stable")
    return np.array([i, *(k for k in order if inside[k] and k != i)], dtype=int)


def _group(terms: Sequence[str], group: Array, cov: Array, estimate: Array) -> Direction:
    """Terms that move together, and what is known of them nevertheless."""
    names = [terms[k] for k in group]
    if {*names} == _RANGING:
        names.sort()  # metres are what a reader knows
        group = np.array([terms.index(name) for name in names])
    inner, values = cov[np.ix_(group, group)], estimate[group]
    sd = np.sqrt(np.diag(inner))
    correlation = inner[0] / (sd[0] * sd)
    lever = np.linalg.solve(inner[1:, 1:], inner[1:, 0])
    left = float(np.sqrt(max(inner[0, 0] - inner[0, 1:] @ lever, 0.0)))
    most = correlation[1 + np.argmax(np.abs(correlation[1:]))]
    unit = TERMS[names[0]].unit
    words = (
        f"{_names(names)} are hardly separable here (correlation {most:.2f}): "
        f"{_word(names[0])} is known to {_number(sd[0], unit)}, and would be to "
        f"{_number(left, unit)} if the rest were known. Well known is {_combination(names, lever)}:"
        f" {_rounded(values[0] - lever @ values[1:], left)} ± {_number(left, unit)}."
    )
    weights = dict(zip(names, (correlation * sd).tolist(), strict=True))
    return Direction(weights=weights, observable=True, correlation=float(most), words=words)


def _number(value: float, unit: str) -> str:
    """Two digits and the unit: '120 m', '0.011°'."""
    digits = np.format_float_positional(value, precision=2, fractional=False, trim="-")
    return f"{digits}{unit}" if unit == "°" else f"{digits} {unit}"


def _rounded(value: float, sd: float) -> str:
    """A value with as many decimals as its standard deviation has in `_number`."""
    decimals = 1 - int(np.floor(np.log10(sd))) if sd > 0.0 else 3
    return f"{value:.{max(decimals, 0)}f}"


def _combination(names: Sequence[str], lever: Array) -> str:
    """The combination of terms that is known best."""
    if {*names} == _RANGING:
        return f"the range error at {-lever[0]:.0f} km"
    parts = [
        f"{'+' if factor < 0.0 else '-'} {_number(abs(factor), '').strip()} × {_word(name)}"
        for name, factor in zip(names[1:], lever, strict=True)
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
        f"{_number(weight, TERMS[term].unit)} of {_word(term)}" for term, weight in weights.items()
    )
