"""Bearings and own ship on one clock; and what to say where they do not meet."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError

if TYPE_CHECKING:
    import polars as pl

Array = Any
_DAY_S, _HOUR_S = 86_400.0, 3_600.0
_UNIX_S = 1e8  # seconds that large count from 1970


def one_clock(
    bearings: "pl.DataFrame", own_ship: "pl.DataFrame", remarks: list[str]
) -> tuple["pl.DataFrame", "pl.DataFrame"]:
    """Times that were dates become seconds since midnight UTC of the bearings' first day."""
    import polars as pl

    dated = next((t for t in (bearings, own_ship) if "time_utc" in t.columns), None)
    if dated is None:
        return bearings, own_ship
    midnight = float(np.floor(dated["time_s"][0] / _DAY_S) * _DAY_S)
    day = dated["time_utc"][0].date()
    remarks.append(f"Times are seconds since midnight UTC of {day}.")

    def moved(table: "pl.DataFrame") -> "pl.DataFrame":
        """The table with seconds since that midnight."""
        time = pl.col("time_s")
        return table.with_columns(
            pl.when(time > _UNIX_S).then((time - midnight).round(6)).otherwise(time)
        )

    return moved(bearings), moved(own_ship)


def inside(time_s: Array, own_s: Array, remarks: list[str]) -> Array:
    """(n,) which bearings own ship's log covers; counts the others.

    Raises:
        DataError: it covers none; says which shift of a clock would explain it.
    """
    low, high = own_s[0], own_s[-1]
    covered = (time_s >= low) & (time_s <= high)
    if not covered.any():
        raise _apart(time_s, own_s)
    out = len(time_s) - int(covered.sum())
    if out:
        remarks.append(
            f"{out} of {len(time_s)} bearings are outside own ship's log "
            f"({low:.1f} to {high:.1f} s) and are left out."
        )
    return covered


def _apart(time_s: Array, own_s: Array) -> DataError:
    shift, meaning = _shift(time_s, own_s)
    told = (
        f"own ship's clock moved by {shift:+.10g} s ({meaning}) would cover them"
        if meaning
        else "no whole hour, day or epoch explains it"
    )
    return DataError(
        "own ship's log and the bearings have no time in common",
        where=f"bearings {_span(time_s)}, own ship {_span(own_s)}",
        why=told,
        next_step=f"give --own-ship-clock {shift:.10g}"
        if meaning
        else "take own ship's log of that time, or shift its clock with --own-ship-clock",
    )


def _span(time_s: Array) -> str:
    return f"{time_s.min():.1f} to {time_s.max():.1f} s"


def _shift(time_s: Array, own_s: Array) -> tuple[float, str]:
    """A shift of own ship's clock that covers nine bearings of ten, and what it could mean."""
    apart = float(np.median(time_s) - (own_s[0] + own_s[-1]) / 2)
    hours = np.rint(2 * apart / _HOUR_S) / 2
    days = np.rint(apart / _DAY_S)
    candidates = [
        (_DAY_S * days, "another day" if abs(days) < 1000 else "another epoch"),
        (_HOUR_S * hours, f"{abs(hours):g} h, a time zone"),
        (float(time_s.min() - own_s[0]), "both begin together"),
    ]
    for shift, meaning in candidates:
        moved = own_s + shift
        covers = ((time_s >= moved[0]) & (time_s <= moved[-1])).mean()
        is_zone = "zone" in meaning
        if shift and covers >= 0.9 and not (is_zone and abs(hours) > 14):
            return shift, meaning
    return 0.0, ""
