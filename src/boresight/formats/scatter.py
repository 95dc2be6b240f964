"""How much a series scatters about its own smooth course, without a model of that course."""

from typing import Any

import numpy as np

Array = Any
_NORMAL = 0.6744897501960817  # median of |x| for a standard normal


def deviations(time_s: Array, values: Array) -> Array:
    """(n - 3,) what is left of values (n,) when quadratics are taken out, with their own sd.

    Of every four neighbours, that one combination which vanishes on every quadratic, of unit
    norm: third divided differences. Times increase; whatever their steps.
    """
    t = np.lib.stride_tricks.sliding_window_view(np.asarray(time_s, dtype=float), 4)
    v = np.lib.stride_tricks.sliding_window_view(np.asarray(values, dtype=float), 4)
    gaps = t[:, :, None] - t[:, None, :] + np.eye(4)
    weights = 1.0 / gaps.prod(axis=-1)
    return np.sum(weights * (v - v[:, :1]), axis=1) / np.sqrt(np.sum(weights**2, axis=1))


def robust_sd(normals: Array) -> float:
    """Standard deviation that half of the values agree on; outliers do not move it."""
    return float(np.median(np.abs(normals)) / _NORMAL)
