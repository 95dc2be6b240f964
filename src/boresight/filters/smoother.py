"""Rauch-Tung-Striebel smoother: what all plots say of every step, from any filter's estimates.

[rauch1965] H. E. Rauch, F. Tung and C. T. Striebel, "Maximum Likelihood Estimates of Linear
Dynamic Systems". [sarkka2008] S. Särkkä, "Unscented Rauch-Tung-Striebel Smoother".

Differs from them: the covariance is a sum of squares, positive for any gain, and directions in
which a covariance is zero are left alone; a motion that is not linear enters by its Jacobian or by
cubature points; where no estimate follows (the last step, a lane that ends) smoothing begins anew.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters import sigma
from boresight.lanes import (
    Kernel,
    Matrix,
    Rate,
    Scalar,
    Symmetric,
    Vector,
    make_kernel,
    pack_states,
    trace,
)
from boresight.maths import Gaussian, jacobian, lower_solve, mirror, select, upper_solve
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of, with_numbers

Array = Any
_ROUNDING = 3e-15  # of a variance: a pivot below it is what subtraction left of zero


class Step(NamedTuple):
    """A step of a motion as an affine one with noise: x' = moved + D u + noise, x = mean + L u.

    Attributes:
        moved: (n,) mean of x'.
        D: (n, n) what becomes of the columns of L, the Cholesky factor of the covariance of x.
        Q: (n, n) covariance of the noise, with what the motion's curvature adds to it.
    """

    moved: Array
    D: Array
    Q: Array


def tangent(mean: Array, L: Array, motion: Motion, dt: Any) -> Step:
    """The motion linearised at the mean, as `kalman.predict` does it.

    Args:
        mean: (n,).
        L: (n, n) Cholesky factor of the covariance.
        motion: how the target moves.
        dt: s.
    """
    moved, F = jacobian(lambda state: motion.move(state, dt), mean)
    return Step(moved, F @ L, motion.noise(dt))


def cubature(mean: Array, L: Array, motion: Motion, dt: Any) -> Step:
    """The motion regressed on cubature points: sarkka2008's smoother, with equal weights.

    Args:
        mean: (n,).
        L: (n, n) Cholesky factor of the covariance.
        motion: how the target moves.
        dt: s.
    """
    found = sigma.regress(
        lambda state: motion.move(state, dt), np.subtract, mean, L, sigma.CUBATURE
    )
    return Step(found.mean, found.D, motion.noise(dt) + found.rest)


LINEARISATIONS = {"jacobian": tangent, "cubature": cubature}


def backward(
    filtered: Gaussian, following: Gaussian, motion: Motion, dt: Any, linearisation: str
) -> Gaussian:
    """Smoothed estimate of one step; the formula that is recorded.

    Args:
        filtered: mean (n,), cov (n, n) of the step.
        following: smoothed mean (n,), cov (n, n) of the next step.
        motion: how the target moves.
        dt: s to the next step.
        linearisation: one of `LINEARISATIONS`.

    Returns:
        With the gain G = L D' (D D' + Q)^-1, the covariance is (L - G D)(L - G D)' +
        G (Q + Ps) G', which is rauch1965's P - G (D D' + Q - Ps) G' as a sum of squares.
    """
    L, _ = _factor(filtered.cov)
    moved, D, Q = LINEARISATIONS[linearisation](filtered.mean, L, motion, dt)
    ahead, inverse = _factor(mirror(D @ D.T + Q))
    G = upper_solve(ahead, inverse, lower_solve(ahead, inverse, D @ L.T)).T
    rest = L - G @ D
    return Gaussian(
        filtered.mean + G @ (following.mean - moved),
        mirror(rest @ rest.T + G @ (Q + following.cov) @ G.T),
    )


def _factor(A: Array) -> tuple[Array, Array]:
    """As `cholesky`, but a zero pivot has no column and no inverse: A (n, n) is semidefinite."""
    n = len(A)
    L = [[A[0, 0] * 0.0] * n for _ in range(n)]
    inverse: list[Any] = []
    with np.errstate(invalid="ignore"):
        for j in range(n):
            pivot = A[j, j] - sum(L[j][k] * L[j][k] for k in range(j))
            empty = abs(pivot) <= _ROUNDING * A[j, j]
            inverse.append(select(empty, 0.0, 1.0 / np.sqrt(select(empty, 1.0, pivot))))
            L[j][j] = pivot * inverse[j]
            for i in range(j + 1, n):
                L[i][j] = (A[i, j] - sum(L[i][k] * L[j][k] for k in range(j))) * inverse[j]
    return np.array(L), np.array(inverse)


def smooth(
    filtered: Gaussian,
    dt: Array,
    motion: Motion,
    *,
    linearisation: str = "jacobian",
    threads: int = 1,
) -> Gaussian:
    """Smooth every lane, from its last step to its first.

    Args:
        filtered: what a filter says after each step: mean (lanes, steps, n) and cov
            (lanes, steps, n, n). Steps that are NaN stay so, and what precedes them is smoothed
            with what lies before them only.
        dt: s before each step, as the filter took it: a number, (1, steps), (lanes, 1) or
            (lanes, steps). At 0 the smoothed step is the next one.
        motion: what the filter took for one; its numbers may be per lane, per step or both.
        linearisation: of the motion: "jacobian" or "cubature".
        threads: how many threads share the lanes; the result does not depend on it.

    Returns:
        Mean and cov, shaped as the filtered ones; the last step is the filtered one.

    Raises:
        UsageError: shapes that do not fit, or an unknown linearisation.
    """
    mean, cov = (np.asarray(part, dtype=float) for part in filtered)
    _check(mean, cov, motion, linearisation)
    given = {"dt": (dt, Scalar())} | numbers(motion, "motion")
    rated = {name: rate_of(name, value, leaf) for name, (value, leaf) in given.items()}
    bare: Any = with_numbers(motion, "motion", dict.fromkeys(given, 0.0))
    rates = tuple((name, rate) for name, (rate, _) in rated.items())
    kernel = _kernel(bare, linearisation, rates)
    nothing = {"mean": np.full_like(mean[:, 0], np.nan), "cov": np.full_like(cov[:, 0], np.nan)}
    inputs = {name: _of_next_step(rate, value) for name, (rate, value) in rated.items()}
    inputs |= {"mean": mean[:, ::-1], "cov": cov[:, ::-1]}
    start = pack_states(kernel.program.state, nothing)
    _, found = kernel.run(start, inputs, mean.shape[1], threads=threads)
    return Gaussian(found["mean"][:, ::-1], found["cov"][:, ::-1])


def _check(mean: Array, cov: Array, motion: Motion, linearisation: str) -> None:
    n = len(motion.names)
    if mean.ndim != 3 or mean.shape[-1] != n or cov.shape != (*mean.shape, n):
        raise UsageError(
            f"estimates with mean {mean.shape} and cov {cov.shape} cannot be smoothed",
            why=f"(lanes, steps, {n}) and (lanes, steps, {n}, {n}) are needed: the state is "
            + ", ".join(motion.names),
        )
    if linearisation not in LINEARISATIONS:
        raise UsageError(
            f"no linearisation {linearisation!r}", next_step=f"use {' or '.join(LINEARISATIONS)}"
        )


def _of_next_step(rate: Rate, value: Array) -> Array:
    """What belongs to the step after each, last step first; the last has none and gets any."""
    if not rate & Rate.STEP:
        return value
    axis = 1 if rate & Rate.LANE else 0
    return np.roll(np.flip(value, axis), 1, axis)


@lru_cache(maxsize=64)
def _kernel(bare: Any, linearisation: str, rates: tuple[tuple[str, Rate], ...]) -> Kernel:
    """The compiled step; `bare` is the motion with 0 for its numbers: one kernel serves all."""
    n, rate = len(bare.names), dict(rates)
    leaves = {"dt": Scalar()} | {name: leaf for name, (_, leaf) in numbers(bare, "motion").items()}
    each = {"mean": Vector(n), "cov": Matrix(n, n)}

    def step(state: Mapping[str, Any], inputs: Mapping[str, Any]) -> tuple[Any, Any]:
        motion = with_numbers(bare, "motion", dict(inputs))
        filtered = Gaussian(inputs["mean"], inputs["cov"])
        following = Gaussian(state["mean"], state["cov"])
        smoothed = backward(filtered, following, motion, inputs["dt"], linearisation)
        size = sum(abs(x) for x in state["mean"]) + sum(abs(x) for x in np.diag(state["cov"]))
        there = size < np.inf  # NaN fails this too
        found = {
            name: select(there, new, old)
            for name, new, old in zip(each, smoothed, filtered, strict=True)
        }
        return found, found

    return make_kernel(
        trace(
            step,
            state={"mean": Vector(n), "cov": Symmetric(n)},
            inputs={name: (leaf, rate[name]) for name, leaf in leaves.items()}
            | {name: (leaf, Rate.EACH) for name, leaf in each.items()},
            outputs={name: (leaf, Rate.EACH) for name, leaf in each.items()},
        )
    )
