"""Plots and reference on one day: times of day have no date, and midnights may lie between."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from boresight.calibration.references import Reference
from boresight.formats.clock import DAY_S
from boresight.formats.usable import column

if TYPE_CHECKING:
    import polars as pl


def same_day(plots: "pl.DataFrame", reference: Reference) -> tuple[Reference, list[str]]:
    """The reference on the day of the plots, if either clock counts from a midnight.

    Times of day have no date, and each file's count from its own first midnight.
    """
    import polars as pl

    ours, theirs = (span(table) for table in (plots, reference.table))
    if not any(-DAY_S < start < 2 * DAY_S for start in (ours[0], theirs[0])):
        return reference, []
    middle = np.rint((np.mean(ours) - np.mean(theirs)) / DAY_S)
    days = min(
        (middle - 1, middle, middle + 1, 0.0), key=lambda n: (-overlap(ours, theirs, n), abs(n))
    )
    around = _around(ours, reference)
    if around is not None and _during(ours, around) > _during(ours, reference, days):
        said = "The reference's times start again at midnight; each was put on the plots' day."
        return around, [said]
    if days == 0:
        return reference, []
    table = reference.table.with_columns(pl.col("time_s") + days * DAY_S)
    said = f"The reference's times were moved by {days:+.0f} days: it counts from another midnight."
    return replace(reference, table=table), [said]


def _around(ours: tuple[float, float], reference: Reference) -> Reference | None:
    """Times of day whose order tells no midnight, each put as near the plots' as can be."""
    import polars as pl

    first, last = span(reference.table)
    if first < 0 or last >= DAY_S or last - first < DAY_S / 2:
        return None
    days = ((float(np.mean(ours)) - pl.col("time_s")) / DAY_S).round()
    table = reference.table.with_columns(pl.col("time_s") + days * DAY_S)
    return replace(reference, table=table.sort("target", "time_s", maintain_order=True))


def _during(ours: tuple[float, float], reference: Reference, days: float = 0.0) -> int:
    """Number of reports while the plots last, if the reference is moved by so many days."""
    return int((reference.table["time_s"] + days * DAY_S).is_between(*ours).sum())


def span(table: "pl.DataFrame") -> tuple[float, float]:
    """First and last time of a table, s; zeros where it has none."""
    time = column(table, "time_s", np.nan)
    time = time[np.isfinite(time)]
    return (float(time.min()), float(time.max())) if len(time) else (0.0, 0.0)


def overlap(ours: tuple[float, float], theirs: tuple[float, float], days: float) -> float:
    """Seconds that both last at once; below zero, what lies between them."""
    shift = days * DAY_S
    return min(ours[1], theirs[1] + shift) - max(ours[0], theirs[0] + shift)
