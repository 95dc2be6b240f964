"""Plots that no target of the reference explains, by what they say of themselves.

Such a plot is false only if the reference has every target in reach, which hardly any reference
does. So nothing is called false here: plots are counted apart, and a reader judges.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration.bins import joined, round_edges
from boresight.calibration.pairing import Pairing
from boresight.calibration.pairs import Pairs
from boresight.formats.usable import ANONYMOUS

if TYPE_CHECKING:
    import polars as pl

Array = Any
_RANGES, _SECTOR_DEG = 20, 10.0
_PLOTS = 30  # of an interval, at least
_FASTEST_MPS = 300.0  # how much distance a difference in time is worth
_NOWHERE = 1e15
_REACH = 5.0  # median distances between a plot and its target: no further is near
_REASONS = {
    "unidentified": (*ANONYMOUS, "no target near"),
    "near_target": ("two targets", "not nearest", "inconsistent"),
    "repeated": ("two plots",),
    "unreferenced": ("not in the reference", "no report near", "shared code"),
}


def false_tables(pairing: Pairing, plots: "pl.DataFrame") -> "dict[str, pl.DataFrame]":
    """Plots by what explains them, by range and by azimuth, while the reference lasts.

    Args:
        pairing: of the plots with a reference.
        plots: of one sensor, as they were paired.

    Returns:
        `false_by_range` (range_from_m, range_to_m, ...) and `false_by_azimuth` (azimuth_from_deg,
        azimuth_to_deg, ...): paired; unidentified (no identity, and no target of the reference
        there: clutter, or an aircraft that it does not have) and how many of them a scan;
        near_target (no identity, but a target is there: a part of it, or all); repeated (one
        identity twice in a scan: at least one of the two is false); unreferenced (an identity that
        the reference does not have then: seldom false).
    """
    import polars as pl

    if pairing.due.is_empty():
        return {}
    kinds = _kinds(pairing, plots)
    time, range_m = plots["time_s"].to_numpy(), plots["range_m"].to_numpy()
    azimuth = plots["azimuth_deg"].to_numpy() % 360.0
    due = pairing.due["time_s"].to_numpy()
    first, last = float(due.min()), float(due.max())
    here = np.any(list(kinds.values()), axis=0) & np.isfinite(range_m + azimuth)
    here &= (time >= first) & (time <= last)
    if not here.any():
        return {}
    scans = max((last - first) / pairing.scan_s, 1.0)
    sectors = np.arange(0.0, 360.0 + _SECTOR_DEG, _SECTOR_DEG)
    quantities = {
        "range": ("m", range_m, round_edges(range_m[here], _RANGES)),
        "azimuth": ("deg", azimuth, sectors),
    }
    out = {}
    for name, (unit, values, edges) in quantities.items():
        one = np.zeros(int(here.sum()), dtype=int)
        bins = joined(values[here], edges, one, rows=_PLOTS, targets=1)
        columns = {f"{name}_from_{unit}": bins.low, f"{name}_to_{unit}": bins.high}
        for kind, holds in kinds.items():
            columns[kind] = np.bincount(bins.index[holds[here]], minlength=len(bins))
        columns["unidentified_per_scan"] = columns["unidentified"] / scans
        out[f"false_by_{name}"] = pl.DataFrame(columns)
    return out


def _kinds(pairing: Pairing, plots: "pl.DataFrame") -> dict[str, Array]:
    """(n,) whether a plot is of each kind."""
    reason = np.asarray(pairing.reason, dtype=str)
    kinds = {"paired": reason == ""}
    kinds |= {kind: np.isin(reason, names) for kind, names in _REASONS.items()}
    alone = np.flatnonzero(kinds["unidentified"])
    near = alone[_near_target(pairing, plots[alone])]
    kinds["unidentified"][near] = False
    kinds["near_target"][near] = True
    return kinds


def _near_target(pairing: Pairing, plots: "pl.DataFrame") -> Array:
    """Whether a target of the reference is where a plot is, within what pairs are apart."""
    from scipy.spatial import KDTree

    due, pairs = pairing.due, pairing.pairs
    if not due.height or not plots.height or not len(pairs):
        return np.zeros(plots.height, dtype=bool)
    north, east, up = (due[name].to_numpy() for name in ("north_m", "east_m", "up_m"))
    azimuth = np.arctan2(east, north)
    targets = _flat(due["time_s"], np.sqrt(north**2 + east**2 + up**2), azimuth)
    places = _flat(plots["time_s"], plots["range_m"].to_numpy(), np.radians(plots["azimuth_deg"]))
    places[~np.isfinite(places).all(axis=1)] = _NOWHERE
    apart, _ = KDTree(targets).query(places, distance_upper_bound=_REACH * _usual_distance(pairs))
    return np.asarray(np.isfinite(apart))


def _flat(time_s: Any, range_m: Array, azimuth_rad: Any) -> Array:
    """(n, 3) place as a radar shows it, and time as a distance."""
    angle = np.asarray(azimuth_rad)
    time = np.asarray(time_s) * _FASTEST_MPS
    return np.column_stack([range_m * np.cos(angle), range_m * np.sin(angle), time])


def _usual_distance(pairs: Pairs) -> float:
    """Median distance between a plot and its target."""
    at = [pairs.channels.index(name) for name in ("range_m", "azimuth_rad")]
    off, range_m = pairs.residuals()[:, at], pairs.z[:, at[0]]
    return float(np.median(np.hypot(off[:, 0], range_m * off[:, 1])))
