"""The fit of a registration: from a robust start to the most likely terms, delays and laws."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.calibration.clusters import Solved, delay_variance, solve
from boresight.calibration.columns import MOVING, Columns, columns, thinned
from boresight.calibration.fixed_point import fixed_point
from boresight.calibration.laws import Classes, Errors, first_laws
from boresight.calibration.pairs import Pairs
from boresight.calibration.robust import classify, late_is_apart, refit
from boresight.calibration.state import Packing, Slow, State
from boresight.calibration.wander import MOST, Inverse, Residuals, Wander, wandering
from boresight.models.systematic import TERMS

Array = Any

_FEWEST = 3  # targets, for delays to be told from a bias
_MOST = 300  # steps
_TOLERANCE = 1e-5  # of a term in standard deviations, of a law in logarithm
_START_PAIRS, _START_STEPS = 20_000, 40
_MAD = 1.4826  # standard deviation over median of the absolute, normal law
_OUTLIER = 0.5  # probability from which a pair counts as none
_ROUNDS = 3  # of laws of wandering and all else in turn
_WANDER_PAIRS = 50_000  # about as many tell how errors wander
_NEARLY = 1e-3  # of the spread: residuals of the start below it weigh alike


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """The most likely terms, and what follows from them; pairs are sorted by target.

    Attributes:
        pairs: as columns.
        state: terms, delays, laws.
        errors: what is known of each pair's error.
        classes: narrow, wide, outlier.
        worth: (k, m) factors of weights, below 1 where errors of one target are alike.
        prior: (n,) inverse variances believed before.
        after: (k, m) residuals without terms, delays, and what wanders.
        converged: whether the search settled.
    """

    pairs: Columns
    state: State
    errors: Errors
    classes: Classes
    worth: Array
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

    def level(self) -> Array:
        """(k, m) residuals without terms and delays; what wanders is in."""
        slow = self.state.slow
        return self.after if slow is None else self.after + self.pairs.at.seen * slow.mean

    def whole(self) -> Array:
        """(k, m) residuals without terms; delays are in too."""
        left = self.level().copy()
        if self.pairs.ranging >= 0:
            delay = np.repeat(self.state.delay, self.pairs.counts)
            left[self.pairs.ranging] += self.pairs.at.seen[self.pairs.ranging] * delay
        return left

    def robust_sd(self, left: Array) -> Array:
        """(k,) of residuals (k, m), outliers aside."""
        real = self.classes.outlier < _OUTLIER
        return spread(left[:, real], self.pairs.at.seen[:, real])

    def scores(self) -> Array:
        """(targets, n) sums over each target's pairs of effect times influence."""
        weight = self.worth * self.classes.weight
        return self.pairs.scores(weight * self.level(), len(self.prior))

    def information(self) -> Array:
        """(targets, n, n) at this noise."""
        n, weight = len(self.prior), self.worth * self._curved()
        total = self.pairs.normals(weight, n)
        if self.pairs.ranging >= 0:
            sums = self.pairs.sums(weight, self.prior)
            kept = self.state.delay_var / (1.0 + self.state.delay_var * sums.own)
            total -= kept[:, None, None] * sums.cross[:, :, None] * sums.cross[:, None, :]
        return total

    def alone(self) -> Array:
        """(n, n) information as if every pair erred by itself."""
        weight = self._curved()
        weight /= 1.0 + self.state.wander.variance[:, None] * weight
        return self.pairs.normals(weight, len(self.prior)).sum(0)

    def _curved(self) -> Array:
        """(k, m) weights with the curvature of the law, averaged: single pairs can have none."""
        weight = self.classes.weight
        total = np.maximum(weight.sum(1), np.finfo(float).tiny)
        return weight * np.maximum(self.classes.curvature.sum(1) / total, 0.0)[:, None]

    def geometry(self) -> Array:
        """(targets, n, n) information as if no pair were an outlier, and each erred by itself."""
        variance = self.state.laws.variance + self.state.wander.variance[:, None]
        weight = self.pairs.at.seen / (variance + self.pairs.at.extra)
        return self.pairs.normals(weight, len(self.prior))


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
    for _ in range(_ROUNDS if delays else 0):
        wander = _wander(data, state)
        if not wander.variance.any():
            break
        state, converged = _search(data, state._replace(wander=wander), prior, delays=delays)
    errors, after = _errors(data, state)
    classes = classify(errors, state.laws)
    return Fit(
        pairs=data,
        state=state,
        errors=errors,
        classes=classes,
        worth=data.worth(data.inverses(classes.weight, state.wander)),
        prior=prior,
        after=after,
        converged=converged,
    )


def _wander(data: Columns, state: State) -> Wander:
    """How errors wander, outliers aside; of some of the targets where there are many pairs."""
    errors, left = _errors(data, state)
    if state.slow is not None:
        left = left + data.at.seen * state.slow.mean
    classes = classify(errors, state.laws)
    weight = classes.weight * (classes.outlier < _OUTLIER)
    step = -(-left.shape[1] // _WANDER_PAIRS)
    some = np.repeat(np.arange(len(data.starts)) % step == 0, data.counts)
    laws = [
        wandering(Residuals(y[some], w[some], data.gap_s[some], channel == data.ranging))
        for channel, (y, w) in enumerate(zip(left, weight, strict=True))
    ]
    variance, time_s = np.array(laws).T
    return Wander(variance, time_s)


def _search(data: Columns, start: State, prior: Array, *, delays: bool) -> tuple[State, bool]:
    """Expectation-maximisation to its fixed point."""
    random = delays and data.ranging >= 0 and len(data.starts) >= _FEWEST
    first, solved = _step(data, start, prior, random=random)
    sd = np.sqrt(np.diag(np.linalg.inv(solved.information)))
    packing = Packing(sd, first.laws.sd[max(data.ranging, 0)], first)
    reached = [first]

    def step(vector: Array) -> Array:
        # what wanders is one number for each pair: too many to mix, it goes on from the last step
        state = packing.unpack(vector)._replace(slow=reached[0].slow)
        reached[0], _ = _step(data, state, prior, random=random)
        return packing.pack(reached[0])

    vector, converged = fixed_point(
        step,
        packing.pack(first),
        size=lambda move: float(np.abs(move).max()),
        tolerance=_TOLERANCE,
        most=_MOST,
    )
    return packing.unpack(vector)._replace(slow=reached[0].slow), converged


def _step(data: Columns, state: State, prior: Array, *, random: bool) -> tuple[State, Solved]:
    """One step: classes, then terms and delays, then laws."""
    errors, _ = _errors(data, state)
    classes = classify(errors, state.laws)
    inverses = data.inverses(classes.weight, state.wander)
    sums = data.sums(data.worth(inverses) * classes.weight, prior)
    solved = solve(sums, state.delay_var)
    variance = delay_variance(sums, solved, state.delay_var) if random else 0.0
    laws = refit(errors, classes, state.laws).no_finer(np.sqrt(state.wander.variance / MOST))
    slow = _slow(data, inverses, solved) if state.wander.variance.any() else None
    moved = state._replace(
        terms=solved.terms, delay=solved.delay, delay_error=solved.delay_var, delay_var=variance
    )
    return moved._replace(laws=laws, slow=slow), solved


def _slow(data: Columns, inverses: tuple[Inverse, ...], solved: Solved) -> Slow:
    """Where errors have wandered."""
    left = data.after(solved.terms, solved.delay)
    mean, error, kept = np.zeros_like(left), np.zeros_like(left), np.ones(left.shape[1])
    for channel, own in enumerate(inverses):
        mean[channel], error[channel] = own.smooth(own.weight * left[channel]), own.uncertain()
        if channel == data.ranging:
            kept -= own.smooth(own.weight)
    return Slow(mean, error, kept)


def _errors(data: Columns, state: State) -> tuple[Errors, Array]:
    """Expected squares of what is left, and what is left."""
    after, slow = data.after(state.terms, state.delay), state.slow
    unsure = np.repeat(state.delay_error, data.counts)
    if slow is not None:
        after -= data.at.seen * slow.mean
        unsure *= slow.left**2
    square = after**2
    if data.ranging >= 0:
        square[data.ranging] += data.at.seen[data.ranging] * unsure
    if slow is not None:
        square += data.at.seen * slow.error
    return Errors(after, square, data.at), after


def _start(data: Columns, prior: Array, *, robust: bool) -> State:
    """Least absolute residuals, all channels together in units of their own spread."""
    seen = data.at.seen
    terms, none = np.zeros(len(prior)), np.zeros(len(data.starts))
    for _ in range(_START_STEPS):
        left = data.after(terms, none)
        sd = spread(left, seen)[:, None]
        weight = seen / (sd * np.maximum(np.abs(left), _NEARLY * sd))
        terms = solve(data.sums(weight, prior), 0.0).terms
    sd = spread(data.after(terms, none), seen)
    variance = float(sd[data.ranging] ** 2) if data.ranging >= 0 else 0.0
    laws = first_laws(data.channels, sd, robust=robust)
    return State(terms, none, none, variance, laws, Wander(0.0 * sd, 0.0 * sd))


def spread(left: Array, seen: Array) -> Array:
    """(k,) robust standard deviation of residuals (k, m) where seen; 1 where nothing was."""
    rows = [np.abs(row[mask > 0.0]) for row, mask in zip(left, seen, strict=True)]
    return np.array([max(_MAD * np.median(row), 1e-9) if row.size else 1.0 for row in rows])
