"""Weights of the members of a bank, in the log domain: step by step, or in one pass afterwards.

[pradeep] (xi), (xii). Differs from it, by erratum P8: the exponential stands in the numerator, and
the forecast's own variance is in the likelihood. Weights are logarithms of which the largest is 0.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import prod
from typing import Any

import numpy as np

from boresight.lanes import Kernel, Rate, Vector, make_kernel, pack_states, trace
from boresight.maths import select
from boresight.maths.mixing import greatest, weigh

Array = Any
GONE = -1e9  # logarithm of a weight that is no more: its exponential is exactly zero


def reweigh(logs: Sequence[Any], likelihoods: Sequence[Any], prune: float) -> list[Any]:
    """Weights after one measurement: pradeep (xi), then pruning.

    A likelihood that is not finite is that of a member that has diverged: it goes. Where none is
    left the weights stay as they were. Numbers, arrays and symbols alike.

    Args:
        logs: logarithms of the weights before it.
        likelihoods: log-likelihood of the measurement, given each member.
        prune: a member whose share is below this is no longer in use; the greatest never goes.
    """
    heard = [select(abs(each) < np.inf, each, GONE) for each in likelihoods]
    both = [log + each for log, each in zip(logs, heard, strict=True)]
    usable = greatest(both) > 0.5 * GONE
    raw = [select(usable, new, log) for log, new in zip(logs, both, strict=True)]
    top = greatest(raw)
    level = [log - top for log in raw]
    shares = [np.exp(log) for log in level]
    floor = prune * sum(shares)
    gone = [
        (s < floor) & (log < 0.0) | (log < 0.5 * GONE) for s, log in zip(shares, level, strict=True)
    ]
    return [select(g, GONE, log) for g, log in zip(gone, level, strict=True)]


def weights_over_time(likelihoods: Array, *, prune: float = 1e-3) -> Array:
    """Weights after each step, from likelihoods that were written down while filtering.

    Members do not know of each other, so weighting them afterwards is the same as weighting them
    step by step.

    Args:
        likelihoods: (..., steps, members) log-likelihoods, 0 where nothing was heard.
        prune: as in `reweigh`.

    Returns:
        (..., steps, members), summing to one over the members.
    """
    likelihoods = np.asarray(likelihoods, dtype=float)
    *lanes, steps, members = likelihoods.shape
    kernel = _pass(members, float(prune))
    start = pack_states(kernel.program.state, {"logs": np.zeros((prod(lanes), members))})
    flat = likelihoods.reshape(-1, steps, members)
    return kernel.run(start, {"heard": flat}, steps)[1]["shares"].reshape(likelihoods.shape)


@lru_cache(maxsize=32)
def _pass(members: int, prune: float) -> Kernel:
    """The step of weights alone, compiled."""

    def step(state: dict[str, Any], inputs: dict[str, Any]) -> tuple[Any, Any]:
        logs = np.array(reweigh(list(state["logs"]), list(inputs["heard"]), prune))
        return {"logs": logs}, {"shares": np.array(weigh(list(logs)))}

    several = Vector(members)
    return make_kernel(
        trace(
            step,
            state={"logs": several},
            inputs={"heard": (several, Rate.EACH)},
            outputs={"shares": (several, Rate.EACH)},
        )
    )
