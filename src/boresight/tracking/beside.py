"""Filters side by side on one recording: the same plots, tracks, noise and gate.

Without truth a filter is judged by what it said of each plot before it used it. The log-likelihood
of a plot is a proper scoring rule: stating more, or less, than it knows gains a filter nothing.
Differences are paired plot by plot; the plots of one track err alike, so a track is one cluster.
A plot that either filter turned away is in no difference: rejections and restarts stand beside it.
"""

from dataclasses import dataclass
from time import thread_time_ns
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import Status
from boresight.filters.recursion import Recursion, run_recursion
from boresight.maths.angles import wrap
from boresight.maths.frames import Site
from boresight.tracking.case import Case
from boresight.tracking.choose import warmed_up
from boresight.tracking.flight import Filtered, Flights, begin, gated
from boresight.tracking.result import FilterRow, Gain
from boresight.tracking.tables import nis_summary

if TYPE_CHECKING:
    import polars as pl

Array = Any
TIMED = (2048, 16)  # lanes and steps of a timing: enough to be steady, a few milliseconds
MIDDLE = (0.158655, 0.841345)  # of a normal law these quantiles are one sd from its mean


@dataclass(frozen=True, eq=False)
class Flown:
    """One filter's pass over the recording."""

    filter: str
    recursion: Recursion
    result: Filtered

    def scored(self, case: Case) -> Array:
        """(m,) whether a plot is judged: settled, finite, in the half not used for tuning."""
        result = self.result
        well = (result["dof"] > 0) & np.isfinite(result["loglik"]) & np.isfinite(result["nis"])
        held_out = case.flights.time >= case.half
        return well & held_out & warmed_up(case.flights, result.started)


def side_by_side(
    case: Case, flown: list[Flown], site: Site
) -> tuple[list[FilterRow], "pl.DataFrame"]:
    """Compare filters with the first of them.

    Args:
        case: the plots.
        flown: the filters' passes over them.
        site: of the radar.

    Returns:
        A row per filter, and the scores of every plot: see `TrackingResult`.
    """
    import polars as pl

    level = case.level()
    main = flown[0]
    rows = [_row(case, each, main, level, site) for each in flown]
    return rows, pl.concat([_scores(case, each, main, level) for each in flown])


def clustered(difference: Array, cluster: Array) -> Gain:
    """The mean of differences that are independent between clusters only.

    The interval is that of Student's t with one degree less than there are clusters, the variance
    the sum of squares of the clusters' sums (Liang and Zeger's sandwich for a mean).

    Args:
        difference: (m,).
        cluster: (m,) which cluster each belongs to.
    """
    from scipy.special import stdtrit

    m = len(difference)
    if not m:
        return Gain(mean=np.nan, ci95=(np.nan, np.nan), plots=0, tracks=0)
    mean = float(np.mean(difference))
    _, index = np.unique(cluster, return_inverse=True)
    sums = np.bincount(index, difference - mean)
    g = len(sums)
    sd = np.sqrt(np.sum(sums**2) * g / (g - 1)) / m if g > 1 else np.nan
    half = float(stdtrit(max(g - 1, 1), 0.975) * sd)
    return Gain(mean=mean, ci95=(mean - half, mean + half), plots=m, tracks=g)


def _gain(case: Case, each: Flown, main: Flown) -> Array:
    """(m,) log-likelihood minus the main filter's, NaN where either was not scored."""
    both = each.scored(case) & main.scored(case)
    return np.where(both, each.result["loglik"] - main.result["loglik"], np.nan)


def _gain_over(case: Case, each: Flown, main: Flown, rows: Array) -> Gain:
    """The mean gain over some plots; none of the main filter over itself."""
    difference = _gain(case, each, main)
    known = rows & np.isfinite(difference) & (each is not main)
    return clustered(difference[known], case.flights.track[known])


def _row(case: Case, each: Flown, main: Flown, level: Array, site: Site) -> FilterRow:
    result, scored = each.result, each.scored(case)
    inside = result["inside"] > 0.5
    failed = result["status"] != Status.OK
    nis = nis_summary(result, scored & level)
    range_sd, azimuth_sd = _scatter(case.flights, result, scored)
    speed = _speed_errors(case, result, scored)
    median, most = np.quantile(speed, [0.5, 0.95]) if len(speed) else (np.nan, np.nan)
    return FilterRow(
        filter=each.filter,
        updates=int(np.count_nonzero(inside & ~result.started)),
        rejected=int(np.count_nonzero(~inside & ~result.started)),
        restarts=int(np.count_nonzero(result.restarts)),
        failed_share=float(np.mean(failed)),
        scored=int(np.count_nonzero(scored)),
        nis_per_dof=nis["mean"],
        nis_median=nis["median"],
        loglik=float(np.mean(result["loglik"][scored])) if scored.any() else np.nan,
        gain=_gain_over(case, each, main, scored),
        gain_straight=_gain_over(case, each, main, scored & level),
        range_sd_m=range_sd,
        azimuth_sd_deg=float(np.degrees(azimuth_sd)),
        speed_error_median_mps=float(median),
        speed_error_95_mps=float(most),
        speeds=len(speed),
        ns_per_update=_ns_per_update(case, each.recursion, site),
        remark=_remark(int(np.count_nonzero(failed)), len(failed), bool(scored.any())),
    )


def _remark(failed: int, plots: int, scored: bool) -> str:  # noqa: FBT001 - one of three facts
    if failed:
        return f"its state was not finite or not positive definite after {failed} of {plots} plots"
    return "" if scored else "no plot could be scored"


def _scatter(flights: Flights, result: Filtered, rows: Array) -> tuple[float, float]:
    """Scatter of range, m, and azimuth, rad, about the position predicted from the plot before.

    Taken from the states and not from the filter's innovations: one that uses a plot's components
    one after the other has seen the azimuth when it comes to the range.
    """
    at = np.flatnonzero(rows)
    dims = flights.z.shape[1]
    before, dt = result["mean"][at - 1], flights.time[at] - flights.time[at - 1]
    place = before[:, :dims] + dt[:, None] * before[:, dims : 2 * dims]
    distance = flights.z[at, 0] - np.linalg.norm(place, axis=1)
    azimuth = wrap(flights.z[at, 1] - np.arctan2(place[:, 1], place[:, 0]))
    return _half_width(distance), _half_width(azimuth)


def _half_width(values: Array) -> float:
    low, high = np.quantile(values, MIDDLE) if len(values) else (np.nan, np.nan)
    return float(high - low) / 2


def _speed_errors(case: Case, result: Filtered, rows: Array) -> Array:
    """How far the filter's ground speed is from the one that the aircraft downlinks."""
    dims = case.flights.z.shape[1]
    told = case.column("ground_speed_mps")
    speed = np.linalg.norm(result["mean"][:, dims : dims + 2], axis=1)
    return np.abs(speed - told)[rows & np.isfinite(told)]


def _ns_per_update(case: Case, recursion: Recursion, site: Site) -> float:
    """Processor time of the compiled step on plots of the recording, nothing written but the end.

    What tracking adds to it (starts, padding, tables) is the same for every filter.
    """
    rows = np.resize(np.arange(len(case.flights.time)), TIMED)
    z, scan = case.flights.z[rows], case.found.scan_s
    start, guarded = begin(z[:, 0], recursion, site), gated(recursion, scan)
    state: Any = start
    taken = []
    for _ in range(9):  # the first compiles
        began = thread_time_ns()
        state = run_recursion(guarded, z, scan, state, outputs=("status",), last=True).final
        taken.append(thread_time_ns() - began)
    return min(taken[1:]) / rows.size


def _scores(case: Case, each: Flown, main: Flown, level: Array) -> "pl.DataFrame":
    import polars as pl

    rows, flights, result = each.scored(case), case.flights, each.result
    columns = {
        "filter": pl.repeat(each.filter, int(np.count_nonzero(rows)), dtype=pl.String, eager=True),
        "track": flights.track[rows],
        "time_s": flights.time[rows],
        "nis": result["nis"][rows],
        "dof": result["dof"][rows].astype(int),
        "loglik": result["loglik"][rows],
        "gain": _gain(case, each, main)[rows],
        "straight": level[rows],
    }
    return pl.DataFrame(columns, nan_to_null=True)
