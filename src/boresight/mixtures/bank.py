"""A bank with every cell written down: cells are run as lanes, and weighted in a pass afterwards.

[pradeep] section 2.2: the filters are independent, so this is the bank of `range_parameterised`,
with all that its moments hide. Any filter is a bank of one cell.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.filters.recursion import Recursion, run_recursion
from boresight.filters.steps import Method
from boresight.maths import Gaussian
from boresight.mixtures.range_parameterised import RangeParameterised, starts
from boresight.mixtures.weights import weights_over_time
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any


@dataclass(frozen=True, eq=False)
class Bank:
    """What every cell says after every step, and how much it counts.

    Attributes:
        weights: (steps, cells), summing to one.
        means: (steps, cells, n).
        covs: (steps, cells, n, n).
        loglik: (steps, cells).
        innovation, variance: (steps, cells, k).
        side: (cells,) -1 left of the sensor's axis, 1 right of it; 0 where sides are known.
    """

    weights: Array
    means: Array
    covs: Array
    loglik: Array
    innovation: Array
    variance: Array
    side: Array


def run_bank(
    method: Method, motion: Motion, sensor: Sensor, z: Array, dt: Array, start: Gaussian
) -> Bank:
    """Filter one target's plots with every cell of a bank.

    Args:
        method: a `RangeParameterised`, or any filter.
        motion: how the target moves.
        sensor: what hears it; its numbers fixed or by step.
        z: (1, steps, k) plots, NaN where missing.
        dt: (1, steps), s before each plot.
        start: mean (n,), cov (n, n), before the first plot.
    """
    if isinstance(method, RangeParameterised):
        cells, side = starts(method, start, motion, sensor)
        member, prune = method.filter, method.prune
    else:
        cells, side, member, prune = [start], np.zeros(1), method, 0.0
    first = Gaussian(np.stack([c.mean for c in cells]), np.stack([c.cov for c in cells]))
    found = run_recursion(
        Recursion(member, motion, sensor),
        np.repeat(z, len(cells), axis=0),
        dt,
        first,
        outputs=("mean", "cov", "loglik", "innovation", "variance"),
    )
    loglik = np.moveaxis(found.loglik, 0, 1)
    return Bank(
        weights=weights_over_time(loglik, prune=prune),
        means=np.moveaxis(found.mean, 0, 1),
        covs=np.moveaxis(found.cov, 0, 1),
        loglik=loglik,
        innovation=np.moveaxis(found.innovation, 0, 1),
        variance=np.moveaxis(found.variance, 0, 1),
        side=side,
    )
