"""Comparisons that say in words what differs, and by how much."""

from typing import Any

import numpy as np

from boresight.filters.posterior import Posterior

Array = Any


class BrokenLawError(AssertionError):
    """A law that a filter does not keep; the message says by how much."""


def near(what: str, found: Array, expected: Array, rtol: float, *, least: float = 0.0) -> None:
    """Numbers agree to `rtol` of the largest of their kind; NaN only where NaN is expected.

    Args:
        what: a sentence's subject.
        found: what a filter says.
        expected: of the same shape.
        rtol: allowed difference over the largest expected number.
        least: what that number counts as at least.
    """
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    if found.shape != expected.shape:
        raise BrokenLawError(f"{what} has shape {found.shape} instead of {expected.shape}")
    gone = np.isnan(expected)
    size = np.max(np.abs(expected), initial=least, where=~gone) or 1.0
    gap = np.max(np.abs(found - expected), initial=0.0, where=~gone)
    if not gap <= rtol * size or np.any(np.isnan(found) != gone):
        raise BrokenLawError(
            f"{what} differs by {gap / size:.2g} of its largest number; {rtol:.0e} is allowed"
        )


def equal(what: str, found: Array, expected: Array) -> None:
    """Numbers are the same to the last bit."""
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    if not np.array_equal(found, expected, equal_nan=True):
        with np.errstate(invalid="ignore"):
            gap = np.max(np.abs(found - expected)) if found.shape == expected.shape else np.inf
        raise BrokenLawError(f"{what} differs by {gap:.2g}; every bit must be the same")


def alike(one: Posterior, other: Posterior, rtol: float = 1e-9) -> None:
    """Two posteriors agree; what both do not tell is not compared."""
    near("the mean", one.mean, other.mean, rtol)
    near("the covariance", one.cov, other.cov, rtol)
    if one.nis is None:
        return
    near("the NIS", one.nis, other.nis, max(rtol, 1e-7))
    near("the log-likelihood", one.loglik, other.loglik, max(rtol, 1e-7))
    equal("dof", one.dof, other.dof)
