"""Scans at which a radar should have seen the targets of a reference, and whether it did."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration.comparing import Compared
from boresight.calibration.references import Reference
from boresight.formats.usable import column
from boresight.maths.frames import Site

if TYPE_CHECKING:
    import polars as pl

Array = Any
_SEEN = ("two plots", "overhead", "no height")  # recognised, though no pair


def due_scans(
    plots: "pl.DataFrame", reference: Reference, found: Compared, site: Site
) -> "pl.DataFrame":
    """Where each target of the reference was at every scan while the reference tells of it.

    A target's scans are counted from its own plots: between two of them lie as many as fit, before
    the first and after the last one a scan period apart. One that was never seen is due from half
    a scan after its first report.

    Returns:
        One row for each target and scan: time_s, name, north_m, east_m, up_m (at the radar),
        height_m (as the reference tells it), seen (a plot was recognised as the target's).
    """
    import polars as pl

    names, spans = _spans(reference.table)
    who, when = _events(plots, reference, found, names)
    who, when, seen = _instants(who, when, spans, found.scan_s)
    row = _rows(reference.table, names, who, when, found)
    kept = np.lexsort((when, who))
    kept = kept[row[kept] >= 0]
    who, when, seen, row = who[kept], when[kept], seen[kept], row[kept]
    height = found.paths.told_height(row, when, site)
    known = np.isfinite(height)
    position = found.paths.line(row[known], when[known], height[known])
    return pl.DataFrame(
        {
            "time_s": when[known],
            "name": names.gather(who[known]),
            "north_m": position[:, 0],
            "east_m": position[:, 1],
            "up_m": position[:, 2],
            "height_m": height[known],
            "seen": seen[known],
        }
    )


def _spans(table: "pl.DataFrame") -> "tuple[pl.Series, Array]":
    """Names, sorted, and (names, 2) first and last time of each."""
    import polars as pl

    time = pl.col("time_s")
    spans = table.group_by("name").agg(first=time.min(), last=time.max()).sort("name")
    return spans["name"], spans.select("first", "last").to_numpy()


def _events(
    plots: "pl.DataFrame", reference: Reference, found: Compared, names: "pl.Series"
) -> tuple[Array, Array]:
    """Number of the name and time of every plot that was recognised, by name and time."""
    import polars as pl

    paired = reference.table["name"].gather(found.row)
    other = np.flatnonzero(np.isin(found.reason.astype(str), _SEEN))
    keys = [pl.col(name) for name in ("address", "mode_a") if name in plots.columns]
    again = (
        plots[other].select(pl.coalesce(keys)).to_series()
        if keys
        else pl.Series([None] * len(other), dtype=pl.String)
    )
    name = pl.concat([paired, again]).to_frame("name")
    number = pl.DataFrame({"name": names, "number": np.arange(len(names))})
    numbered = name.join(number, on="name", how="left", maintain_order="left")["number"]
    who = numbered.fill_null(-1).to_numpy()
    when = column(plots, "time_s", np.nan)[np.concatenate([found.plot, other])]
    order = np.lexsort((when, who))
    order = order[who[order] >= 0]
    return who[order], when[order]


def _instants(who: Array, when: Array, spans: Array, scan_s: float) -> tuple[Array, Array, Array]:
    """Name, time and whether seen, of every scan of every name."""
    first = np.diff(who, prepend=-1) != 0
    last = np.diff(who, append=-1) != 0
    never = np.setdiff1d(np.arange(len(spans)), who)
    gap = np.where(last, 0.0, np.diff(when, append=0.0))
    between = np.where(last, 1, np.maximum(np.rint(gap / scan_s), 1)).astype(int)
    parts = [  # name, first time, step, number
        (who, when, np.where(last, 0.0, gap / between), between),
        (who[first], when[first] - scan_s, -scan_s, (when - spans[who, 0])[first] / scan_s),
        (who[last], when[last] + scan_s, scan_s, (spans[who, 1] - when)[last] / scan_s),
        (never, spans[never, 0] + scan_s / 2, scan_s, np.ptp(spans[never], axis=1) / scan_s),
    ]
    found = [_steps(*part) for part in parts]
    name, time, index = (np.concatenate(each) for each in zip(*found, strict=True))
    is_plot = np.arange(len(name)) < int(between.sum())
    return name, time, is_plot & (index == 0)


def _steps(who: Array, start: Array, step: Array, number: Array) -> tuple[Array, Array, Array]:
    """Expand arithmetic sequences: name, value and index of every member."""
    number = np.maximum(np.floor(number), 0).astype(int)
    index = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    step = np.broadcast_to(step, start.shape)
    time = np.repeat(start, number) + index * np.repeat(step, number)
    return np.repeat(who, number), time, index


def _rows(
    table: "pl.DataFrame", names: "pl.Series", who: Array, when: Array, found: Compared
) -> Array:
    """Report before each instant, on whichever path of the name is there; -1 if none is."""
    import polars as pl

    paths = table.select("name", "target").unique(maintain_order=True)
    asked = pl.DataFrame({"name": names.gather(who), "instant": np.arange(len(who))})
    asked = asked.join(paths, on="name", maintain_order="left")
    instant = asked["instant"].to_numpy()
    row = found.paths.before(asked["target"].to_numpy(), when[instant])
    best = np.full(len(who), -1)
    np.maximum.at(best, instant, row)
    return best
