"""Where the search of a registration is, and how its states are mixed."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from boresight.calibration.laws import Laws
from boresight.calibration.wander import MOST, Wander

Array = Any


class Slow(NamedTuple):
    """What is known of errors that wander along their target.

    Attributes:
        mean: (k, m) expected.
        error: (k, m) variance around it, the delay being known.
        left: (m,) of an error of the delay that the wandering does not take up.
    """

    mean: Array
    error: Array
    left: Array


class State(NamedTuple):
    """Where the search is.

    Attributes:
        terms: (n,).
        delay: (targets,) predicted, m.
        delay_error: (targets,) variance of their errors.
        delay_var: variance of the delays.
        laws: of noise and outliers.
        wander: how errors wander along a target.
        slow: where they did; None if they do not.
    """

    terms: Array
    delay: Array
    delay_error: Array
    delay_var: float
    laws: Laws
    wander: Wander
    slow: Slow | None = None


class Packing(NamedTuple):
    """A state as one vector whose parts compare: in standard deviations and logarithms.

    Attributes:
        terms: (n,) their standard deviations, about.
        delay: scale of delays, m.
        model: a state whose shapes, and whose numbers that are not sought, all others have.
    """

    terms: Array
    delay: float
    model: State

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
        """From a vector, brought back into bounds: mixed steps may leave them."""
        model, targets = self.model.laws, len(self.model.delay)
        sizes = (len(self.terms), targets, targets, *(len(model.sd),) * 3)
        terms, delay, error, sd, share, wide, rest = np.split(vector, np.cumsum(sizes))
        laws = replace(
            model,
            sd=np.exp(sd),
            tail_share=share,
            tail_sd=np.exp(wide),
            wrong=rest[:2],
            place_m=float(np.exp(rest[2])),
            late_s=float(rest[3]),
            late_sd_s=float(rest[4]) if model.late_sd_s else 0.0,
        ).no_finer(np.sqrt(self.model.wander.variance / MOST))
        return self.model._replace(
            terms=terms * self.terms,
            delay=delay * self.delay,
            delay_error=np.maximum(error, 0.0) * self.delay**2,
            delay_var=float(max(rest[5], 0.0)) * self.delay**2,
            laws=laws,
        )
