"""Which plot is of which reference target: by identity, or by position where there is none.

Nothing is guessed: what could be of two targets, or of none for certain, is left out with a reason.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration.interpolation import Paths
from boresight.calibration.nearby import near
from boresight.formats import usable

if TYPE_CHECKING:
    import polars as pl

Array = Any
# Codes that many aircraft use at a time: they say what a flight does, not who it is.
CONSPICUITY = ("0000", "1000", "1200", "2000", "7000", "7500", "7600", "7700")
FEWEST_HITS = 15  # plots of one radar track near one target, and the share of the track's
SHARE = 0.8
_CLOSE_SCANS = 0.5  # two plots of one identity closer than this are of one scan
_SHORTEST_S = 0.3  # no antenna turns faster

MEANINGS = usable.MEANINGS | {
    "no time": "the time is missing",
    "zero range": "the range is zero or less",
    "repeated": "the same plot again: identity, time, range and azimuth",
    "shared code": "a Mode A code that many aircraft use at a time",
    "not in the reference": "the reference never tells of this identity",
    "no report near": "the reference tells of this identity, but not around this time",
    "two targets": "the reference has more than one target that it could be of",
    "two plots": "one identity twice in one scan",
    "no target near": "no target of the reference within the gate",
    "not nearest": "another plot of the scan is nearer to the target",
    "inconsistent": "its radar track does not stay with one target of the reference",
    "no height": "neither the plot nor the reference tells a height",
    "overhead": "so high above the radar that azimuth means nothing",
}


@dataclass(frozen=True, eq=False)
class Matched:
    """Plots and the reports before them.

    Attributes:
        plot: (m,) rows of plots, ascending.
        row: (m,) of `Paths`: the report before the plot; it and the next are of one target.
    """

    plot: Array
    row: Array


def by_identity(
    plots: "pl.DataFrame", reference: "pl.DataFrame", paths: Paths, reason: Array, scan_s: float
) -> Matched:
    """Match by 24-bit address; by Mode A code and time where a plot has no address.

    A plot that has an address is matched by its code only if no target of the reference has one.

    Args:
        plots: of one sensor, with a row for each reason.
        reference: `Reference.table`.
        paths: of the reference, on the plots' clock.
        reason: (n,) why a plot is not used, empty so far where it may be; filled in place.
        scan_s: of the radar.
    """
    import polars as pl

    address, code = pl.lit("#") + pl.col("address"), pl.lit("A") + pl.col("mode_a")
    plots = _with_texts(plots)
    targets = reference.select("target", "address", "mode_a").unique(maintain_order=True)
    targets = pl.concat([targets.select("target", key=each) for each in (address, code)])
    targets = targets.drop_nulls()
    valid = pl.when(pl.Series(usable.column(plots, "mode_a_valid", True).astype(bool))).then(code)
    own = pl.coalesce(address, valid) if reference["address"].count() else valid
    keyed = plots.select(row=pl.int_range(pl.len()), key=own).filter(reason == "")
    named = keyed["row"].to_numpy()
    common = _is_in(keyed["key"], [f"A{each}" for each in CONSPICUITY])
    reason[named[common]] = "shared code"
    known = _is_in(keyed["key"], targets["key"].to_list())
    reason[named[~known & ~common]] = "not in the reference"
    _mark_twice(keyed, plots, reason, scan_s)
    possible = keyed.filter(reason[named] == "").join(targets, on="key", maintain_order="left")
    plot, target = possible["row"].to_numpy(), possible["target"].to_numpy()
    row = paths.before(target, plots["time_s"].to_numpy()[plot])
    plot, row = plot[row >= 0], row[row >= 0]
    count = np.bincount(plot, minlength=plots.height)
    waiting = reason == ""
    reason[waiting & (count == 0)] = "no report near"
    reason[waiting & (count > 1)] = "two targets"
    alone = count[plot] == 1
    return Matched(plot[alone], row[alone])


def _with_texts(plots: "pl.DataFrame") -> "pl.DataFrame":
    """The plots, with both columns of identity, null where they had none."""
    import polars as pl

    absent = [name for name in ("address", "mode_a") if name not in plots.columns]
    return plots.with_columns(pl.lit(None, pl.String).alias(name) for name in absent)


def _is_in(values: "pl.Series", some: list[str]) -> Array:
    return values.is_in(some).fill_null(value=False).to_numpy()


def _mark_twice(keyed: "pl.DataFrame", plots: "pl.DataFrame", reason: Array, scan_s: float) -> None:
    """Two plots of one identity in one scan: nobody knows which of them is the target."""
    key = keyed["key"].rank("dense").fill_null(0).to_numpy()
    row = keyed["row"].to_numpy()
    time = plots["time_s"].to_numpy()[row]
    order = np.lexsort((time, key))
    order = order[reason[row[order]] == ""]
    close = (np.diff(key[order]) == 0) & (np.diff(time[order]) < _CLOSE_SCANS * scan_s)
    reason[row[order[:-1][close]]] = "two plots"
    reason[row[order[1:][close]]] = "two plots"


def by_position(
    plots: "pl.DataFrame",
    paths: Paths,
    where: Array,
    reason: Array,
    *,
    scan_s: float,
    gate_m: float,
) -> Matched:
    """Match each plot to the only target within the gate, whose nearest plot of the scan it is.

    Then a radar track must stay with one target: 15 plots of it at least, and 80 % of them.

    Args:
        plots: of one sensor; `radar_track`, else an identity, says which belong together.
        paths: of the reference, on the plots' clock.
        where: (n,) complex, each report as the radar would see it without errors: its slant range
            at its azimuth, north + i east, m.
        reason: (n,) why a plot is not used; filled in place.
        scan_s: of the radar.
        gate_m: greatest distance between plot and target.
    """
    usable = np.flatnonzero(reason == "")
    time = plots["time_s"].to_numpy()
    place = plots["range_m"].to_numpy() * np.exp(1j * np.radians(plots["azimuth_deg"].to_numpy()))
    plot, row, distance = near(time[usable], place[usable], paths, where, gate_m)
    plot = usable[plot]
    count = np.bincount(plot, minlength=plots.height)
    waiting = reason == ""
    reason[waiting & (count == 0)] = "no target near"
    reason[waiting & (count > 1)] = "two targets"
    alone = count[plot] == 1
    plot, row, distance = plot[alone], row[alone], distance[alone]
    nearest = _nearest(paths.target[row], time[plot], distance, scan_s)
    reason[plot[~nearest]] = "not nearest"
    plot, row = plot[nearest], row[nearest]
    steady = _steady(threads(plots)[plot], paths.target[row])
    reason[plot[~steady]] = "inconsistent"
    order = np.argsort(plot[steady], kind="stable")
    return Matched(plot[steady][order], row[steady][order])


def _nearest(target: Array, time: Array, distance: Array, scan_s: float) -> Array:
    """(m,) whether a plot is the nearest to its target within a scan."""
    order = np.lexsort((time, target))
    new = np.ones(len(order), dtype=bool)
    new[1:] = (np.diff(target[order]) != 0) | (np.diff(time[order]) >= _CLOSE_SCANS * scan_s)
    group = np.cumsum(new) - 1
    least = np.full(group[-1] + 1 if len(group) else 0, np.inf)
    np.minimum.at(least, group, distance[order])
    nearest = np.zeros(len(order), dtype=bool)
    nearest[order] = distance[order] == least[group]
    return nearest


def scan(plots: "pl.DataFrame", reason: Array) -> float:
    """Median time from one plot to the next of what the radar takes for one target; 4 s if none."""
    some = np.flatnonzero(reason == "")
    thread, time = threads(plots)[some], plots["time_s"].to_numpy()[some]
    order = np.lexsort((time, thread))
    step = np.diff(time[order])
    step = step[(np.diff(thread[order]) == 0) & (thread[order[1:]] >= 0) & (step > _SHORTEST_S)]
    return float(np.median(step)) if len(step) else 4.0


def threads(plots: "pl.DataFrame") -> Array:
    """(n,) number of what the radar itself takes for one target; -1 where it does not say."""
    import polars as pl

    names = [name for name in ("radar_track", "address", "mode_a") if name in plots.columns]
    if not names:
        return np.full(plots.height, -1)
    key = pl.coalesce(pl.col(name).cast(pl.String) for name in names)
    return plots.select(key.rank("dense").fill_null(0)).to_series().to_numpy().astype(int) - 1


def _steady(thread: Array, target: Array) -> Array:
    """(m,) whether a plot's radar track stays with the plot's target; true if it is of none."""
    both = thread * (target.max(initial=0) + 1) + target
    _, which, hits = np.unique(both, return_inverse=True, return_counts=True)
    total = np.bincount(thread + 1)[thread + 1]
    hits = hits[which]
    return (thread < 0) | ((hits >= FEWEST_HITS) & (hits >= SHARE * total))
