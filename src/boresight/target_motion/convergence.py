"""When an answer is good enough: by the truth, by what the answer says itself, by the bound.

[pradeep] section 3 calls the solution converged when the errors of range, bearing, course and speed
are all within limits. Differs from it: the last time at which that begins to hold for good is told
beside the first (before own ship turns, errors fall within limits by chance); and without the
truth, the rule is that each quantity is within its limit with a stated confidence.

Polar columns everywhere: range (m), bearing, course (degrees true), speed (m/s).
"""

from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.target_motion.result import Convergence, Criteria

Array = Any


def check_criteria(criteria: Criteria) -> None:
    """Refuse limits that are not positive, and a confidence that is none."""
    for name in ("range_percent", "bearing_deg", "course_deg", "speed_mps"):
        limit = getattr(criteria, name)
        if not 0.0 < limit < np.inf:
            raise UsageError(f"{name}={limit!r} is no limit of an error, above zero and finite")
    if not 0.0 < criteria.confidence < 1.0:
        raise UsageError(f"confidence={criteria.confidence!r} is not between 0 and 1")


def errors_inside(estimate: Array, truth: Array, criteria: Criteria) -> Array:
    """Whether all four errors are within their limits: pradeep section 3.

    Args:
        estimate: (..., 4) polar columns.
        truth: (..., 4), likewise.
        criteria: limits; that of the range is a share of the true range.

    Returns:
        (...) bool; False where an estimate is NaN.
    """
    error = np.asarray(estimate, dtype=float) - truth
    error[..., 1:3] = (error[..., 1:3] + 180.0) % 360.0 - 180.0
    return np.all(np.abs(error) <= _limits(np.asarray(truth)[..., 0], criteria), axis=-1)


def sure(estimate: Array, sd: Array, criteria: Criteria) -> Array:
    """Whether each quantity is within its limit of the estimate with the stated confidence.

    Args:
        estimate: (..., 4) polar columns; only the range is used.
        sd: (..., 4) their standard deviations.
        criteria: limits and confidence.

    Returns:
        (...) bool; False where something is NaN.
    """
    from scipy.special import ndtri

    half = ndtri((1.0 + criteria.confidence) / 2.0) * np.asarray(sd, dtype=float)
    return np.all(half <= _limits(np.asarray(estimate)[..., 0], criteria), axis=-1)


def first_and_sustained(inside: Array, time_s: Array) -> tuple[Array, Array]:
    """When it first held, and since when it held up to the end.

    Args:
        inside: (..., steps) bool.
        time_s: (steps,).

    Returns:
        Two of (...), s; NaN for never.
    """
    inside, time_s = np.asarray(inside, dtype=bool), np.asarray(time_s, dtype=float)
    steps = inside.shape[-1]
    tail = np.argmin(inside[..., ::-1], axis=-1)  # how many of the last steps hold
    tail = np.where(inside.all(axis=-1), steps, tail)
    times = np.append(time_s, np.nan)
    first = np.where(inside.any(axis=-1), np.argmax(inside, axis=-1), steps)
    return times[first], times[steps - tail]


def permitted(bound_sd: Array, range_m: Array, criteria: Criteria, time_s: Array) -> Array:
    """The earliest time from which on the bound is sure for good.

    Args:
        bound_sd: (..., steps, 4) Cramér-Rao bound of each polar column; infinite where nothing
            is known.
        range_m: (..., steps).
        criteria: limits and confidence.
        time_s: (steps,).

    Returns:
        (...) s, NaN for never.
    """
    found = np.broadcast_to(np.asarray(range_m, dtype=float)[..., None], np.shape(bound_sd))
    return first_and_sustained(sure(found, bound_sd, criteria), time_s)[1]


def converge(
    estimate: Array,
    sd: Array,
    observable: Array,
    bound_sd: Array,
    criteria: Criteria,
    time_s: Array,
) -> Convergence:
    """When the answer of one contact met the criteria.

    Args:
        estimate: (steps, 4) polar columns.
        sd: (steps, 4) their standard deviations.
        observable: (steps,) bool: before that, small spreads are only what was believed before.
        bound_sd: (steps, 4) Cramér-Rao bound of each polar column.
        criteria: limits and confidence.
        time_s: (steps,).

    Raises:
        UsageError: criteria that are none.
    """
    check_criteria(criteria)
    held = sure(estimate, sd, criteria) & np.asarray(observable, dtype=bool)
    first, sustained = first_and_sustained(held, time_s)
    allowed = permitted(bound_sd, np.asarray(estimate)[..., 0], criteria, time_s)
    return Convergence(
        first_s=_or_none(first), sustained_s=_or_none(sustained), permitted_s=_or_none(allowed)
    )


def _limits(range_m: Array, criteria: Criteria) -> Array:
    """(..., 4) what each error may be."""
    range_m = np.asarray(range_m, dtype=float)
    limits = np.empty((*range_m.shape, 4))
    limits[..., 0] = criteria.range_percent / 100.0 * range_m
    limits[..., 1:] = criteria.bearing_deg, criteria.course_deg, criteria.speed_mps
    return limits


def _or_none(time_s: Any) -> float | None:
    return None if np.isnan(time_s) else float(time_s)
