"""Truth as few knots: a cubic through neighbouring knots is within a few centimetres of the flight.

Each knot has position and velocity, east, north, up at the site. Knots lie a power of two seconds
apart, as far as the cubic (Hermite) between two of them stays within `TOLERANCE_M` of the path.
"""

import numpy as np
import polars as pl
from scipy.interpolate import CubicHermiteSpline

from demo_flight import DURATION_S, Path

TOLERANCE_M = 0.05
STEPS_S = (32.0, 16.0, 8.0, 4.0, 2.0, 1.0, 0.5)


def truth(paths: list[Path], epoch_s: float) -> pl.DataFrame:
    """One row a knot: flight, time of day, position in whole millimetres, velocity."""
    return pl.concat([_rows(i, path, epoch_s) for i, path in enumerate(paths)])


def _rows(index: int, path: Path, epoch_s: float) -> pl.DataFrame:
    time = np.array(_knots(path))
    enu, velocity = np.round(path.enu(time), 3), path.enu(time, 1).astype(np.float32)
    identity = path.flight.identity
    names = ("east", "north", "up")
    columns = {
        "flight": np.full(len(time), index, np.int16),
        "callsign": identity["callsign"],
        "address": identity["address"],
        "kind": path.flight.kind,
        "time_s": time + epoch_s,
        **{f"{name}_m": enu[:, i] for i, name in enumerate(names)},
        **{f"{name}_mps": velocity[:, i] for i, name in enumerate(names)},
    }
    return pl.DataFrame(columns)


def _knots(path: Path) -> list[float]:
    """Times of knots, as far apart as the tolerance lets them be."""
    first, last = max(path.first_s, -2.0), min(path.last_s, DURATION_S + 2.0)
    knots = [first]
    while knots[-1] < last:
        here = knots[-1]
        step = next(
            s for s in STEPS_S if _fits(path, here, min(here + s, last)) or s == STEPS_S[-1]
        )
        knots.append(min(here + step, last))
    return knots


def _fits(path: Path, start: float, end: float) -> bool:
    ends = np.array([start, end])
    cubic = CubicHermiteSpline(ends, path.enu(ends), path.enu(ends, 1))
    inside = np.linspace(start, end, 16)
    return bool(np.abs(cubic(inside) - path.enu(inside)).max() < TOLERANCE_M)
