"""Fisher information: what plots alone tell of a target that moves without noise.

[nardone1984] S. C. Nardone, A. G. Lindgren and K. F. Gong, "Fundamental Properties and Performance
of Conventional Bearings-Only Target Motion Analysis": without a manoeuvre of own ship, bearings
leave one number of four untold. [taylor1979] has the recursion.
Differs from them: which directions are told is decided after scaling every state by its own
information, so that metres and metres per second count alike; what is not told is infinite.

All plots must be linearised along one track. At a filter's estimates, each from another step, what
is not told seems to be told a little: a wrong direction of ignorance in every gradient.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from boresight.filters.formula import Formula
from boresight.filters.reversible import check_reversible, later
from boresight.lanes import Matrix, Rate, Scalar, Symmetric, Vector
from boresight.maths import gradient, jacobian, mirror, select
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any
TOLD = 1e-13  # of an information matrix with unit diagonal: rounding leaves 1e-15 in place of zero
_ASKS = 1e-12  # share of a question's square along untold directions, from which it has no answer
_GROUPS = 8  # of lanes by step: each runs no further than its own last step
POLAR = ("range_m", "bearing_rad", "course_rad", "speed_mps")


def fisher_information(
    states: Array,
    motion: Motion,
    sensor: Sensor,
    dt: Array,
    heard: Array,
    *,
    prior: Array | None = None,
) -> Array:
    """Information about the state at each step, from all plots up to it.

    [taylor1979]: J_k = A' J_{k-1} A + sum h h'/σ², with A the motion's Jacobian backwards over
    dt. With a prior, its inverse is the Cramér-Rao bound of an estimator that knows the prior.

    Args:
        states: (lanes, steps, n), tracks along which to linearise.
        motion: how targets move; without noise.
        sensor: what is measured; its numbers fixed, or by step.
        dt: (1, steps), s before each plot.
        heard: (lanes, steps, k) or (1, steps, k), whether each component was measured.
        prior: (n, n) information at the first step, before its plot; None for none.

    Returns:
        (lanes, steps, n, n). Without a prior the first are singular: see `bound`.

    Raises:
        UsageError: the motion has noise, or cannot be run backwards.
    """
    states = np.asarray(states, dtype=float)
    lanes, steps, n = states.shape
    check_reversible(motion, float(np.max(dt)))
    formula = Formula(
        step=_step,
        motion=motion,
        sensor=sensor,
        state=(("information", Symmetric(n)),),
        inputs=(
            ("dt", Scalar(), Rate.STEP),
            ("now", Vector(n), Rate.EACH),
            ("heard", Vector(len(sensor.names)), Rate.EACH),
        ),
        outputs=(("information", Matrix(n, n)),),
    )
    known = np.zeros((n, n)) if prior is None else np.asarray(prior, dtype=float)
    start = {"information": np.broadcast_to(known, (lanes, n, n))}
    told = np.broadcast_to(np.asarray(heard, dtype=float), (lanes, steps, len(sensor.names)))
    # Nothing happens before the first plot: whatever comes before it, its prior is right there.
    waits = np.concatenate([[0.0], np.ravel(dt)[1:]])
    found = formula.run(start, {"dt": waits, "now": states, "heard": told}, steps)
    return found["information"]


def _step(
    motion: Motion, sensor: Sensor, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[Any, Any]:
    """Carry the information to the next step, and add what is heard there."""
    now, dt = inputs["now"], inputs["dt"]
    _, back = jacobian(lambda x: motion.move(x, -dt), now)
    information = mirror(back.T @ state["information"] @ back)
    for component, there in zip(sensor.components(motion), inputs["heard"], strict=True):
        _, h = gradient(component.value, now)
        weight = there / (component.sigma * component.sigma)
        information = information + mirror(np.outer(weight * h, h))
    return {"information": information}, {"information": information}


def information_through(
    states: Array, at: Array, motion: Motion, sensor: Sensor, dt: Array, heard: Array
) -> Array:
    """Information about states at any steps, from all plots up to them, along tracks through them.

    The same as `fisher_information` at those steps, for tracks that need not be the same ones.

    Args:
        states: (lanes, n), each at a step of its own.
        at: (lanes,) which step.
        motion: how targets move; without noise.
        sensor: what is measured; its numbers fixed, or by step.
        dt: (1, steps), s before each plot.
        heard: (steps, k), whether each component was measured.

    Returns:
        (lanes, n, n).

    Raises:
        UsageError: the motion has noise, or cannot be run backwards.
    """
    states = np.asarray(states, dtype=float)
    if not len(states):
        return np.empty((0, *2 * states.shape[1:]))
    check_reversible(motion, float(np.max(dt)))
    at, (lanes, n) = np.asarray(at), states.shape
    times, heard = np.cumsum(np.ravel(dt)), np.asarray(heard, dtype=float)
    formula = Formula(
        step=_look_back,
        motion=motion,
        sensor=sensor,
        state=(("information", Symmetric(n)),),
        inputs=(
            ("time", Scalar(), Rate.STEP),
            ("heard", Vector(len(sensor.names)), Rate.STEP),
            ("now", Scalar(), Rate.LANE),
            ("state", Vector(n), Rate.LANE),
        ),
        outputs=(),
    )
    found = np.empty((lanes, n, n))
    for part in np.array_split(np.argsort(at, kind="stable"), min(_GROUPS, lanes)):
        steps = int(at[part].max()) + 1
        inputs = {"time": times[:steps], "heard": heard[:steps]}
        inputs |= {"now": times[at[part]], "state": states[part]}
        start = {"information": np.zeros((len(part), n, n))}
        found[part] = formula.carry(start, inputs, steps)[0]["information"]
    return found


def _look_back(
    motion: Motion, sensor: Sensor, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[Any, Any]:
    """Add what one plot told of the state, unless it is still to come."""
    ago, information = inputs["time"] - inputs["now"], state["information"]
    past = select(ago > 0.0, 0.0, 1.0)
    for component, there in zip(sensor.components(motion), inputs["heard"], strict=True):
        _, h = gradient(later(component, motion, ago), inputs["state"])
        weight = past * there / (component.sigma * component.sigma)
        information = information + mirror(np.outer(weight * h, h))
    return {"information": information}, {}


def bound(information: Array) -> Array:
    """Cramér-Rao bound: the inverse where it exists, infinite where nothing is told.

    Args:
        information: (..., n, n).

    Returns:
        (..., n, n) covariances. A state that is not told has an infinite variance; its
        covariances are NaN.
    """
    information = np.asarray(information, dtype=float)
    scale, values, vectors = _scaled(information)
    told = _told(values)
    inverse = np.where(told, 1.0 / np.where(told, values, 1.0), 0.0)
    cov = (
        (vectors * inverse[..., None, :]) @ vectors.mT / (scale[..., :, None] * scale[..., None, :])
    )
    untold = np.sum(np.where(told[..., None, :], 0.0, vectors**2), axis=-1) > _ASKS
    cov = np.where(untold[..., :, None] | untold[..., None, :], np.nan, cov)
    n = information.shape[-1]
    return np.where(untold[..., None] & np.eye(n, dtype=bool), np.inf, cov)


def rank(information: Array) -> Array:
    """How many directions are told: (...,) from (..., n, n)."""
    return np.sum(_told(_scaled(np.asarray(information, dtype=float))[1]), axis=-1)


def sd_of(information: Array, gradients: Array) -> Array:
    """Bound of functions of the state, by their gradients: infinite where it is not told.

    Args:
        information: (..., n, n).
        gradients: (..., m, n).

    Returns:
        (..., m) standard deviations. A function may be told where no state is: the bearing.
    """
    scale, values, vectors = _scaled(np.asarray(information, dtype=float))
    shares = (np.asarray(gradients) / scale[..., None, :]) @ vectors
    told = _told(values)[..., None, :]
    variance = np.sum(
        np.where(told, shares**2 / np.where(told, values[..., None, :], 1.0), 0.0), -1
    )
    asked = np.sum(np.where(told, 0.0, shares**2), axis=-1)
    return np.where(asked > _ASKS * np.sum(shares**2, axis=-1), np.inf, np.sqrt(variance))


def _scaled(information: Array) -> tuple[Array, Array, Array]:
    """Root of the diagonal, and eigenvalues and eigenvectors of what has ones there instead."""
    finite = np.isfinite(information).all((-2, -1))[..., None]
    diagonal = np.einsum("...ii->...i", information)
    scale = np.sqrt(np.where(finite & (diagonal > 0.0), diagonal, 1.0))
    even = information / (scale[..., :, None] * scale[..., None, :])
    values, vectors = np.linalg.eigh(np.where(finite[..., None], even, 0.0))
    return scale, np.where(finite, values, np.nan), vectors


def _told(values: Array) -> Array:
    """Which eigenvalues are not zero; of what is not a number nothing is said to be untold."""
    return ~(values <= TOLD)


def polar_gradients(states: Array, own_position: Array) -> Array:
    """Gradients of range, bearing, course and speed with respect to the state.

    Args:
        states: (..., 4): North, East (m), their rates (m/s).
        own_position: (..., 2): North, East of who hears, m.

    Returns:
        (..., 4, 4), rows in the order of `POLAR`; x is North and y is East. Distances are floored
        at 1 mm, speeds at 1 mm/s: at rest a course is not defined.
    """
    states = np.asarray(states, dtype=float)
    away = states[..., :2] - np.asarray(own_position)[..., :2]
    rows = np.zeros((*away.shape[:-1], 4, 4))
    for first, at, vector in ((0, slice(0, 2), away), (2, slice(2, 4), states[..., 2:4])):
        length = np.maximum(np.hypot(vector[..., 0], vector[..., 1]), 1e-3)[..., None]
        along = vector / length
        turned = np.stack([-along[..., 1], along[..., 0]], axis=-1) / length
        long, turn = (first, first + 1) if first == 0 else (first + 1, first)
        rows[..., long, at], rows[..., turn, at] = along, turned
    return rows


def polar_sd(cov: Array, states: Array, own_position: Array) -> Array:
    """Standard deviations of range, bearing, course and speed, to first order.

    Args:
        cov: (..., 4, 4) covariance of the state.
        states: (..., 4), see `polar_gradients`.
        own_position: (..., 2), m.

    Returns:
        (..., 4): m, rad, rad, m/s, in the order of `POLAR`.
    """
    G = polar_gradients(states, own_position)
    return np.sqrt(np.einsum("...mi,...ij,...mj->...m", G, cov, G))


def polar_bound(information: Array, states: Array, own_position: Array) -> Array:
    """`polar_sd` of the bound: from information that may be singular, infinite where it is.

    Args:
        information: (..., 4, 4), as from `fisher_information`.
        states: (..., 4), see `polar_gradients`.
        own_position: (..., 2), m.

    Returns:
        (..., 4): m, rad, rad, m/s, in the order of `POLAR`.
    """
    return sd_of(information, polar_gradients(states, own_position))
