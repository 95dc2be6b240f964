"""How often the radar sees what it should, by range and by azimuth.

A scan is due where a target of the reference was in reach: before the radio horizon, and no further
away than the furthest pair. Scans of one target are alike (its transponder, its aspect), so the
exact binomial interval is taken for fewer scans: as many as would scatter as much from target to
target if they were independent.

[korn1998] E. L. Korn, B. I. Graubard, "Confidence intervals for proportions with small expected
number of positive counts estimated from survey data". Differs from it: one correlation within
targets for all intervals together, so that an interval in which all was seen is wider for it too.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration.bins import Bins, joined, round_edges
from boresight.calibration.false_plots import false_tables
from boresight.calibration.pairing import Pairing
from boresight.maths.frames import Site, polar_from_enu
from boresight.models.atmosphere import EARTH_M

if TYPE_CHECKING:
    import polars as pl

Array = Any
_RANGES, _SECTOR_DEG = 20, 10.0
_DUE = 30  # scans of an interval, at least
_EFFECTIVE = 4 / 3  # of the Earth's radius, for the radio horizon
_LOWEST_M = 10.0  # of an antenna or a target above what is around it
_CHANCE = 0.05


def detection_tables(
    pairing: Pairing, plots: "pl.DataFrame", site: Site
) -> "dict[str, pl.DataFrame]":
    """Probability of detection, and plots that no target explains, by range and by azimuth.

    Args:
        pairing: of the plots with a reference.
        plots: of one sensor, as they were paired.
        site: of the radar; its height makes the horizon.

    Returns:
        `detection_by_range` (range_from_m, range_to_m, ...) and `detection_by_azimuth`
        (azimuth_from_deg, azimuth_to_deg, ...): due (scans of targets in reach), seen, targets,
        probability, low and high (95 %, clustered by target); `false_by_range` and
        `false_by_azimuth`, see `false_plots`.
    """
    return _by_place(pairing, site) | false_tables(pairing, plots)


def detection_remarks(tables: "dict[str, pl.DataFrame]") -> list[str]:
    """What a reader must know of the tables, in sentences."""
    said = []
    if "detection_by_range" in tables:
        due, seen = (int(tables["detection_by_range"][name].sum()) for name in ("due", "seen"))
        share = f"{100.0 * seen / due:.1f} %"
        said.append(
            f"In {seen:,} of {due:,} scans at which a target of the reference was in reach it has "
            f"its plot ({share}); a target that does not answer this radar counts as missed."
        )
    if "false_by_range" in tables:
        counts = tables["false_by_range"]
        alone, repeated = (int(counts[name].sum()) for name in ("unidentified", "repeated"))
        if alone:
            said.append(
                f"{alone:,} plots without an identity lie where the reference has no target; they "
                "are false only as far as the reference has every target."
            )
        if repeated:
            said.append(f"{repeated:,} plots have an identity that is twice in their scan.")
    return said


def _by_place(pairing: Pairing, site: Site) -> "dict[str, pl.DataFrame]":
    due = pairing.due
    enu = due.select("east_m", "north_m", "up_m").to_numpy()
    where = polar_from_enu(enu)
    seen = due["seen"].to_numpy()
    in_reach = _before_horizon(enu, due["height_m"].to_numpy(), site)
    in_reach &= where.range_m <= where.range_m[seen].max(initial=0.0)
    if not in_reach.any():
        return {}
    target = due["name"].rank("dense").to_numpy().astype(int) - 1
    azimuth = np.degrees(where.azimuth)
    sectors = np.arange(0.0, 360.0 + _SECTOR_DEG, _SECTOR_DEG)
    quantities = {
        "range": ("m", where.range_m, round_edges(where.range_m[in_reach], _RANGES)),
        "azimuth": ("deg", azimuth, sectors),
    }
    out = {}
    for name, (unit, values, edges) in quantities.items():
        bins = joined(values[in_reach], edges, target[in_reach], rows=_DUE, targets=1)
        out[f"detection_by_{name}"] = _proportions(
            f"{name}_{{}}_{unit}", bins, target[in_reach], seen[in_reach]
        )
    return out


def _before_horizon(enu: Array, height_m: Array, site: Site) -> Array:
    """Whether a ray over an Earth of 4/3 its radius reaches the target."""
    heights = np.maximum(height_m, _LOWEST_M), max(site.height_m, _LOWEST_M)
    reach = sum(np.sqrt(2.0 * _EFFECTIVE * EARTH_M * height) for height in heights)
    return np.asarray(np.hypot(enu[:, 0], enu[:, 1]) <= reach)


def _proportions(names: str, bins: Bins, target: Array, seen: Array) -> "pl.DataFrame":
    """Share of due scans with a plot, in each interval."""
    import polars as pl

    inside = bins.index >= 0
    width = int(target.max()) + 1
    cell = bins.index[inside] * width + target[inside]
    cells, where = np.unique(cell, return_inverse=True)
    due = np.bincount(where).astype(float)
    hits = np.bincount(where, weights=seen[inside])
    low, high = proportion_intervals(cells // width, due, hits)
    total = np.bincount(cells // width, weights=due)
    found = np.bincount(cells // width, weights=hits)
    return pl.DataFrame(
        {
            names.format("from"): bins.low,
            names.format("to"): bins.high,
            "due": total.astype(int),
            "seen": found.astype(int),
            "targets": np.bincount(cells // width),
            "probability": found / total,
            "low": low,
            "high": high,
        }
    )


def proportion_intervals(group: Array, due: Array, hits: Array) -> tuple[Array, Array]:
    """95 % intervals of shares whose trials are alike within each row.

    Args:
        group: (r,) which share, from 0, each of them with a row.
        due: (r,) trials of one target.
        hits: (r,) successes among them.

    Returns:
        (groups,) lower and upper ends.
    """
    from scipy.special import betaincinv

    total, found = np.bincount(group, weights=due), np.bincount(group, weights=hits)
    share = found / total
    alike = _correlation(group, due, hits / due, total, share)
    extra = np.bincount(group, weights=due**2) / total - 1.0
    trials = total / (1.0 + alike * extra)
    successes = share * trials
    failures = trials - successes
    tail = np.full(len(total), _CHANCE / 2.0)
    none, all_ = successes <= 0.0, failures <= 0.0
    low = betaincinv(np.where(none, 1.0, successes), failures + 1.0, tail)
    high = betaincinv(successes + 1.0, np.where(all_, 1.0, failures), 1.0 - tail)
    return np.where(none, 0.0, low), np.where(all_, 1.0, high)


def _correlation(group: Array, due: Array, own: Array, total: Array, share: Array) -> float:
    """Of two scans of one target within an interval, by analysis of variance; 0 to 1."""
    variance = (share * (1.0 - share))[group]
    told = variance > 0.0
    part = due * (1.0 - due / total[group])  # of each row in the expected sum of squares
    scatter = (due * (own - share[group]) ** 2)[told] / variance[told]
    alone = (part / due)[told].sum()
    alike = (part / due * (due - 1.0))[told].sum()
    return float(np.clip((scatter.sum() - alone) / alike, 0.0, 1.0)) if alike > 0.0 else 0.0
