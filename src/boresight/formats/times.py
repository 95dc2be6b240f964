"""Times as files have them (seconds, clock times, dates) into seconds.

Dates become seconds since 1970-01-01 UTC, in a column `time_utc` beside `time_s`; a time of day
without a date becomes seconds since midnight. A date without a zone is UTC.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError
from boresight.formats.clock import DAY_S

if TYPE_CHECKING:
    import polars as pl

Array = Any
_NAMES = ("time_s", "time_utc", "time", "timestamp", "datetime", "date_time", "utc", "time_of_day")
_MISSING = ("", "nan", "null", "na", "none", "nat")
_DATES = (
    "%Y-%m-%d %H:%M:%S%.f",
    "%Y/%m/%d %H:%M:%S%.f",
    "%d-%b-%Y %H:%M:%S%.f",
    "%d %b %Y %H:%M:%S%.f",
    "%Y-%m-%d %H:%M",
)
_ZONE = r"(:\d\d(?:\.\d+)?)\s*(Z|UTC|GMT|[+-]\d\d:?\d\d)$"


def with_seconds(
    path: Path, raw: "pl.DataFrame", first_line: int, columns: Mapping[str, str]
) -> tuple["pl.DataFrame", dict[str, str]]:
    """Give a table that has dates or clock times a column `time_s`.

    Args:
        path: names the table in errors.
        raw: as `tables.load` gave it, or any frame.
        first_line: the line of its first row.
        columns: the column map.

    Returns:
        The table, and the column map without what was used.

    Raises:
        DataError: a time that is none.
    """
    import polars as pl

    name = columns.get("time_s") or _time_column(raw)
    if name is None or name not in raw.columns or _is_number(raw[name]):
        return raw, dict(columns)
    kept = {ours: theirs for ours, theirs in columns.items() if ours != "time_s"}
    cells = raw[name]
    if cells.dtype == pl.String:
        cells = _parsed(path, cells.str.strip_chars(), first_line)
    if isinstance(cells.dtype, pl.Datetime | pl.Date):
        if isinstance(cells.dtype, pl.Datetime) and cells.dtype.time_zone:
            cells = cells.dt.convert_time_zone("UTC").dt.replace_time_zone(None)
        stamps = cells.cast(pl.Datetime("us"))
        seconds = stamps.dt.epoch("us").cast(pl.Float64) / 1e6
        return raw.with_columns(time_s=seconds, time_utc=stamps), kept
    if isinstance(cells.dtype, pl.Duration):
        cells = cells.cast(pl.Duration("ns"))
    elif cells.dtype != pl.Time:
        raise _no_time(path, cells, first_line, 0)
    return raw.with_columns(time_s=cells.to_physical().cast(pl.Float64) / 1e9), kept


def over_midnight(time_s: Array, remarks: list[str]) -> Array:
    """Times of day (n,) of one recording, in the file's order, counted on over midnight.

    They are taken to pass midnight where they leave more than half a day empty and the file
    begins after it.
    """
    ordered = np.sort(time_s)
    gaps = np.diff(ordered)
    if not len(gaps) or ordered[0] < 0 or ordered[-1] > DAY_S or gaps.max() <= DAY_S / 2:
        return time_s
    late = ordered[gaps.argmax() + 1]
    if time_s[0] < late:
        return time_s
    remarks.append("The times pass midnight; those after it count on from 86400 s.")
    return np.where(time_s < late, time_s + DAY_S, time_s)


def _time_column(raw: "pl.DataFrame") -> str | None:
    by_name = {name.lower(): name for name in reversed(raw.columns)}
    return next((by_name[name] for name in _NAMES if name in by_name), None)


def _is_number(cells: "pl.Series") -> bool:
    import polars as pl

    if cells.dtype != pl.String:
        return cells.dtype.is_numeric() or cells.dtype == pl.Null
    text = cells.str.strip_chars()
    return bool(text.cast(pl.Float64, strict=False).is_not_null().any())


def _parsed(path: Path, text: "pl.Series", first_line: int) -> "pl.Series":
    """Dates as Datetime, else times of day as Time; whichever reads the most rows."""
    import polars as pl

    zone = text.str.extract(_ZONE, 2)
    plain = text.str.replace(_ZONE, "$1").str.replace(r"^(\d{4}-\d\d-\d\d)T", "$1 ")
    dates = (plain.str.to_datetime(each, strict=False, time_unit="us") for each in _DATES)
    clock = plain.str.to_time("%H:%M:%S%.f", strict=False)
    best = max([*dates, clock], key=lambda found: int(found.is_not_null().sum()))
    bad = best.is_null() & ~text.str.to_lowercase().is_in(_MISSING)
    if bad.any():
        row = int(bad.arg_max() or 0)
        raise _no_time(path, text, first_line + row, row)
    return best - _offset(zone) if isinstance(best.dtype, pl.Datetime) else best


def _offset(zone: "pl.Series") -> "pl.Series":
    """Duration that each row's zone is ahead of UTC."""
    import polars as pl

    digits = zone.str.extract_groups(r"^([+-])(\d\d):?(\d\d)$").struct
    hours, minutes = (digits.field(str(n)).cast(pl.Int64).fill_null(0) for n in (2, 3))
    sign = pl.Series((digits.field("1") == "-").fill_null(value=False)).cast(pl.Int64) * -2 + 1
    return ((hours * 60 + minutes) * sign * 60_000_000).cast(pl.Duration("us"))


def _no_time(path: Path, text: "pl.Series", line: int, row: int) -> DataError:
    return DataError(
        f"{path}: {text[row]!r} is not a time",
        where=f"line {line}, column {text.name}",
        why="times are seconds, or dates such as 2017-09-12T16:58:26.96Z or 12-Sep-2017 16:58:26; "
        "03/04/2017 could be two days",
        next_step=f"correct the line: sed -n {line}p {path}",
    )
