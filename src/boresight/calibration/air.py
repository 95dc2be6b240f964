"""What the air alone would make a calibration find: group delay looks like a range gain."""

from typing import Any

import numpy as np

from boresight.calibration.pairs import Pairs
from boresight.maths.frames import Site
from boresight.models.atmosphere import ExponentialAtmosphere

Array = Any
_MOST = 20_000  # pairs looked at: the delay is a smooth curve, and more change no printed digit
_LEAST_SPREAD = 0.01  # of range, in its mean: a ring of targets has no slope over range


def air_gain_m_per_km(pairs: Pairs, site: Site) -> float:
    """Range gain that the delay of a standard exponential atmosphere has over these pairs.

    Delay is regressed on range with a bias beside the gain, as in the fit of a registration, so the
    two gains may be compared. A registration whose plots had the air taken out should find none.

    Args:
        pairs: their places and heights count, what was measured does not.
        site: of the radar.

    Returns:
        Metres per kilometre; NaN if the ranges of the pairs spread too little for a slope.
    """
    rows = np.arange(len(pairs))
    if len(rows) > _MOST:  # drawn, because every nth plot may be that of one target
        rows = np.sort(np.random.default_rng(0).choice(rows, _MOST, replace=False))
    range_m = np.linalg.norm(pairs.position[rows], axis=-1)
    if len(rows) < 2 or np.std(range_m) < _LEAST_SPREAD * np.mean(range_m):
        return float("nan")
    delay = ExponentialAtmosphere().excess_range(range_m, pairs.height_m[rows], site.height_m)
    from_middle = range_m - range_m.mean()
    return float(1_000.0 * (from_middle @ delay) / (from_middle @ from_middle))
