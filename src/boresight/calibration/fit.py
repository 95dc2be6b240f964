"""The fit of a registration: from a robust start to the most likely terms, delays and laws."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.clusters import Solved, delay_variance, solve
from boresight.calibration.columns import MOVING, Columns, columns, thinned
from boresight.calibration.fixed_point import fixed_point
from boresight.calibration.laws import Classes, Errors, Laws, first_laws
from boresight.calibration.pairs import Pairs
from boresight.calibration.robust import classify, late_is_apart, refit
from boresight.models.systematic import TERMS

Array = Any

_FEWEST = 3  # targets, for delays to be told from a bias
_MOST = 300  # steps
_TOLERANCE = 1e-5  # of a term in standard deviations, of a law in logarithm
_START_PAIRS, _START_STEPS = 20_000, 40
_MAD = 1.4826  # standard deviation over median of the absolute, normal law
_NEARLY = 1e-3  # of the spread: residuals of the start below it weigh alike


class State(NamedTuple):
    """Where the search is.

    Attributes:
        terms: (n,).
        delay: (targets,) predicted, m.
        delay_error: (targets,) variance of their errors.
        delay_var: variance of the delays.
        laws: of noise and outliers.
    """

    terms: Array
    delay: Array
    delay_error: Array
    delay_var: float
    laws: Laws


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """The most likely terms, and what follows from them; pairs are sorted by target.

    Attributes:
        pairs: as columns.
        state: terms, delays, laws.
        errors: what is known of each pair's error.
        classes: narrow, wide, outlier.
        prior: (n,) inverse variances believed before.
        after: (k, m) residuals without terms and delays.
        converged: whether the search settled.
    """

    pairs: Columns
    state: State
    errors: Errors
    classes: Classes
    prior: Array
    after: Array
    converged: bool

    def in_order(self, values: Array) -> Array:
        """Values (m, ...) in the order in which the pairs came."""
        back = np.empty_like(values)
        back[self.pairs.order] = values
        return back

    def delay_m(self, targets: int) -> Array:
        """(targets,) predicted delays, 0 where there was no pair."""
        delay = np.zeros(targets)
        delay[self.pairs.target] = self.state.delay
        return delay

    def robust_sd(self) -> Array:
        """(k,) of what is left, outliers aside."""
        real = self.classes.outlier < 0.5
        return _spread(self.after[:, real], self.pairs.at.seen[:, real])

    def scores(self) -> Array:
        """(targets, n) sums over each target's pairs of effect times influence."""
        return self.pairs.scores(self.classes.weight * self.after, len(self.prior))

    def information(self, *, delays: bool = True) -> Array:
        """(targets, n, n) at this noise; without `delays` as if every pair erred by itself.

        The curvature is averaged over a channel's pairs: single ones can have none.
        """
        n, weight = len(self.prior), self._curved()
        total = self.pairs.normals(weight, n)
        if delays and self.pairs.ranging >= 0:
            sums = self.pairs.sums(weight, self.prior)
            kept = self.state.delay_var / (1.0 + self.state.delay_var * sums.own)
            total -= kept[:, None, None] * sums.cross[:, :, None] * sums.cross[:, None, :]
        return total

    def _curved(self) -> Array:
        weight = self.classes.weight
        total = np.maximum(weight.sum(1), np.finfo(float).tiny)
        return weight * np.maximum(self.classes.curvature.sum(1) / total, 0.0)[:, None]

    def geometry(self) -> Array:
        """(targets, n, n) information of all pairs as if none were an outlier."""
        variance = self.state.laws.variance + self.pairs.at.extra
        return self.pairs.normals(self.pairs.at.seen / variance, len(self.prior))


def fit(pairs: Pairs, terms: tuple[str, ...], *, robust: bool, delays: bool) -> Fit:
    """Find the most likely terms.

    First from some of the pairs, then from all, linearised where the first terms put the targets.
    """
    prior = np.array([TERMS[term].scale for term in terms]) ** -2.0
    few = thinned(pairs, _START_PAIRS)
    data = columns(few, terms, np.zeros(len(terms)))
    state, converged = _search(data, _start(data, prior, robust=robust), prior, delays=delays)
    if robust and not late_is_apart(_errors(data, state)[0], state.laws):
        state = state._replace(laws=state.laws.without_late())
        state, converged = _search(data, state, prior, delays=delays)
    if few is not pairs or any(term in MOVING for term in terms):
        data = columns(pairs, terms, state.terms)
        state, converged = _search(data, state, prior, delays=delays)
    errors, after = _errors(data, state)
    return Fit(
        pairs=data,
        state=state,
        errors=errors,
        classes=classify(errors, state.laws),
        prior=prior,
        after=after,
        converged=converged,
    )


def _search(data: Columns, start: State, prior: Array, *, delays: bool) -> tuple[State, bool]:
    """Expectation-maximisation to its fixed point."""
    random = delays and data.ranging >= 0 and len(data.starts) >= _FEWEST
    first, solved = _step(data, start, prior, random=random)
    sd = np.sqrt(np.diag(np.linalg.inv(solved.information)))
    packing = Packing(sd, first.laws.sd[max(data.ranging, 0)], len(first.delay), first.laws)

    def step(vector: Array) -> Array:
        return packing.pack(_step(data, packing.unpack(vector), prior, random=random)[0])

    vector, converged = fixed_point(
        step,
        packing.pack(first),
        size=lambda move: float(np.abs(move).max()),
        tolerance=_TOLERANCE,
        most=_MOST,
    )
    return packing.unpack(vector), converged


def _step(data: Columns, state: State, prior: Array, *, random: bool) -> tuple[State, Solved]:
    """One step: classes, then terms and delays, then laws."""
    errors, _ = _errors(data, state)
    classes = classify(errors, state.laws)
    sums = data.sums(classes.weight, prior)
    solved = solve(sums, state.delay_var)
    variance = delay_variance(sums, solved, state.delay_var) if random else 0.0
    laws = refit(errors, classes, state.laws)
    return State(solved.terms, solved.delay, solved.delay_var, variance, laws), solved


def _errors(data: Columns, state: State) -> tuple[Errors, Array]:
    """Expected squares of what is left, and what is left."""
    after = data.after(state.terms, state.delay)
    square = after**2
    if data.ranging >= 0:
        unsure = np.repeat(state.delay_error, data.counts)
        square[data.ranging] += data.at.seen[data.ranging] * unsure
    return Errors(after, square, data.at), after


def _start(data: Columns, prior: Array, *, robust: bool) -> State:
    """Least absolute residuals, all channels together in units of their own spread."""
    seen = data.at.seen
    terms, none = np.zeros(len(prior)), np.zeros(len(data.starts))
    for _ in range(_START_STEPS):
        left = data.after(terms, none)
        sd = _spread(left, seen)[:, None]
        weight = seen / (sd * np.maximum(np.abs(left), _NEARLY * sd))
        terms = solve(data.sums(weight, prior), 0.0).terms
    sd = _spread(data.after(terms, none), seen)
    variance = float(sd[data.ranging] ** 2) if data.ranging >= 0 else 0.0
    return State(terms, none, none, variance, first_laws(data.channels, sd, robust=robust))


def _spread(left: Array, seen: Array) -> Array:
    """(k,) robust standard deviation of residuals (k, m) where seen; 1 where nothing was."""
    rows = [np.abs(row[mask > 0.0]) for row, mask in zip(left, seen, strict=True)]
    return np.array([max(_MAD * np.median(row), 1e-9) if row.size else 1.0 for row in rows])


class Packing(NamedTuple):
    """A state as one vector whose parts compare: in standard deviations and logarithms.

    Attributes:
        terms: (n,) their standard deviations, about.
        delay: scale of delays, m.
        targets: number of delays.
        laws: whose numbers are sought.
    """

    terms: Array
    delay: float
    targets: int
    laws: Laws

    def pack(self, state: State) -> Array:
        """As a vector."""
        laws = state.laws
        return np.concatenate(
            [
                state.terms / self.terms,
                state.delay / self.delay,
                state.delay_error / self.delay**2,
                np.log(laws.sd),
                laws.tail_share,
                np.log(laws.tail_sd),
                laws.wrong,
                [np.log(laws.place_m), laws.late_s, laws.late_sd_s],
                [state.delay_var / self.delay**2],
            ]
        )

    def unpack(self, vector: Array) -> State:
        """From a vector, brought back into bounds."""
        sizes = (len(self.terms), self.targets, self.targets, *(len(self.laws.sd),) * 3)
        terms, delay, error, sd, share, wide, rest = np.split(vector, np.cumsum(sizes))
        laws = replace(
            self.laws,
            sd=np.exp(sd),
            tail_share=share,
            tail_sd=np.exp(wide),
            wrong=rest[:2],
            place_m=float(np.exp(rest[2])),
            late_s=float(rest[3]),
            late_sd_s=float(rest[4]) if self.laws.late_sd_s else 0.0,
        ).bounded()
        return State(
            terms * self.terms,
            delay * self.delay,
            np.maximum(error, 0.0) * self.delay**2,
            float(max(rest[5], 0.0)) * self.delay**2,
            laws,
        )
