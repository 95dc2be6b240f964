"""Targets anywhere: pradeep's "all the cases considered", of which it prints one.

Truths are drawn from what the bank believes at its start, so a bank that is right is consistent
over them. Every truth has its own bound; the expectation of the information over truths would be
decided by the few that come near own ship.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.experiments.papers.pradeep_tracked import Tracked, bounds
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth, simulate

Array = Any
Track = Callable[[str, Scenario, Truth, Plots], Tracked]
FILTERS = ("RP", "MGEKF", "EKF")
BEYOND = 5.0  # times its bound: such an estimate is lost
_CHUNK = 500


@dataclass(frozen=True, eq=False)
class Truths:
    """One filter over random truths, at some scans.

    Attributes:
        square: (truths, scans) squared error of the position, m².
        range_error: (truths, scans) estimate minus truth, m.
        nees: (truths, scans), over the four states.
        bound: (truths, scans) variance of the position, m².
        closest_m: (truths,) how near the target comes.
        finite: (truths,) whether every number of the run is one.
    """

    square: Array
    range_error: Array
    nees: Array
    bound: Array
    closest_m: Array
    finite: Array

    @property
    def lost(self) -> Array:
        """(truths, scans): whether the error is beyond five times the bound."""
        return ~(self.square <= BEYOND**2 * self.bound)


def truths(
    world: Scenario, track: Track, at: list[int], number: int, seed: int
) -> dict[str, Truths]:
    """Every filter on the same random truths, some at a time to spare memory.

    Args:
        world: draws the truths.
        track: runs a filter.
        at: which scans to keep.
        number: of truths.
        seed: of all that is random.
    """
    parts = []
    for first in range(0, number, _CHUNK):
        truth, plots = simulate(world, runs=min(_CHUNK, number - first), seed=seed, first=first)
        bound = bounds(world, truth, plots)[:, at]
        variance = bound[..., 0, 0] + bound[..., 1, 1]
        found = {label: track(label, world, truth, plots) for label in FILTERS}
        parts.append({label: _kept(one, at, variance) for label, one in found.items()})
    return {
        label: Truths(*map(np.concatenate, zip(*(part[label] for part in parts), strict=True)))
        for label in FILTERS
    }


def _kept(one: Tracked, at: list[int], variance: Array) -> tuple[Array, ...]:
    """What `Truths` holds, of some truths."""
    estimate = one.estimate
    finite = np.isfinite(estimate.mean).all(axis=(1, 2))
    return (
        one.square[:, at],
        one.error[:, at, 0],
        one.nees[:, at],
        variance,
        one.polar[1][..., 0].min(axis=1),
        finite & np.isfinite(estimate.cov).all(axis=(1, 2, 3)),
    )
