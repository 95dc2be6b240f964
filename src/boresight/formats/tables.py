"""Tables in: CSV and Parquet, with the user's column names and units, every number looked at.

Rows without a time or a measurement are skipped and counted; anything else that is wrong is one
error that names the file, the line, the column and the value.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError, UsageError
from boresight.formats.schema import (
    FLAGS,
    OUR_NAMES,
    PLOTS,
    QUANTITIES,
    TEXTS,
    Kind,
    Source,
    is_our_name,
    sources,
)

if TYPE_CHECKING:
    import polars as pl

_MISSING = ("", "nan", "null", "na", "none")
_TRUE = ("true", "1", "t", "yes")


def read_plots(
    path: Path, *, columns: Mapping[str, str] | None = None, strict: bool = False
) -> tuple["pl.DataFrame", int]:
    """Read a table of plots; see `read_table`. Without `sensor` it is of one, its file name."""
    import polars as pl

    table, skipped = read_table(path, PLOTS, columns=columns, strict=strict)
    if "sensor" not in table.columns:
        table = table.with_columns(sensor=pl.lit(path.stem))
    return table, skipped


def read_table(
    path: Path, kind: Kind, *, columns: Mapping[str, str] | None = None, strict: bool = False
) -> tuple["pl.DataFrame", int]:
    """Read and check a table.

    Args:
        path: a CSV (with a header; lines that begin with # are remarks) or Parquet file.
        kind: what it must hold.
        columns: our name to the file's, in any unit we know: {"range_nm": "rng"}.
        strict: a row without a required value is an error too.

    Returns:
        The table in our names and units, further columns as they are; and the number of rows
        skipped because a required value was missing.

    Raises:
        DataError: a column is missing, or a value is text, out of range or back in time.
        UsageError: the column map names what is not there.
    """
    raw, first_line = load(path)
    return checked(path, raw, first_line, kind, columns=columns, strict=strict)


def checked(
    path: Path,
    raw: "pl.DataFrame",
    first_line: int,
    kind: Kind,
    *,
    columns: Mapping[str, str] | None = None,
    strict: bool = False,
) -> tuple["pl.DataFrame", int]:
    """Check a table that is already in memory; `path` names it in errors, see `read_table`."""
    wanted = _check_map(path, raw, dict(columns or {}))
    found = sources(raw.columns, wanted)
    _require(path, raw, kind, found)
    table = _rename_texts(raw, wanted)
    for source in found:
        table = _convert(path, table, raw, source, first_line)
    table, lines, skipped = _drop_incomplete(path, table, kind, first_line, strict=strict)
    for source in found:
        _check_bounds(path, table, source.ours, lines)
    if kind.in_order:
        _check_order(path, table, lines)
    return table, skipped


def summarize(path: Path, table: "pl.DataFrame", skipped: int) -> dict[str, Any]:
    """Return what `boresight inspect --json` says of a table of plots."""
    names = table["sensor"].unique(maintain_order=True).to_list()
    notes = [f"{skipped} rows without a required value are skipped."] if skipped else []
    known = table["address"].n_unique() if "address" in table.columns else 0
    absent = int("address" in table.columns and table["address"].null_count() > 0)
    return {
        "format": path.suffix.lower().lstrip("."),
        "framing": "none",
        "bytes": path.stat().st_size,
        "skipped_bytes": 0,
        "skipped_rows": skipped,
        "categories": [_sensor_summary(table, name) for name in names],
        "addresses": known - absent,
        "damaged": [],
        "unknown_categories": [],
        "notes": notes,
    }


def _sensor_summary(table: "pl.DataFrame", name: str) -> dict[str, Any]:
    rows = table.filter(table["sensor"] == name)
    return {
        "category": None,
        "edition": None,
        "records": rows.height,
        "sensor": name,
        "first_s": rows["time_s"].min(),
        "last_s": rows["time_s"].max(),
        "scan_s": _scan(rows),
    }


def _scan(rows: "pl.DataFrame") -> float | None:
    """Return the median time from one plot of a target to its next, where targets are told."""
    import polars as pl

    key = next((name for name in ("address", "mode_a", "target") if name in rows.columns), None)
    if key is None:
        return None
    step = pl.col("time_s").diff().over(key)
    value = rows.drop_nulls(key).select(step.filter(step > 0.3).median()).item()
    return None if value is None else round(float(value), 4)


def load(path: Path) -> tuple["pl.DataFrame", int]:
    """Return the file's cells (text if CSV) and the line of the first row.

    Raises:
        DataError: it is no table.
    """
    import polars as pl

    try:
        if path.suffix.lower() == ".parquet":
            return pl.read_parquet(path), 1
        remarks = 0
        with path.open("rb") as file:
            while (header := file.readline()).startswith(b"#"):
                remarks += 1
        _check_commas(path, header, remarks + 1)
        return pl.read_csv(path, infer_schema=False, comment_prefix="#"), remarks + 2
    except (pl.exceptions.PolarsError, UnicodeDecodeError) as error:
        raise DataError(
            f"{path} is no {path.suffix.lstrip('.').upper()} table",
            why=str(error).partition("\n")[0],
            next_step=f"look at its first lines: head {path}",
        ) from None


def _check_commas(path: Path, header: bytes, line: int) -> None:
    """Refuse a table whose columns something else parts."""
    for mark, name in ((b";", "semicolons"), (b"\t", "tabs")):
        if mark in header and b"," not in header and b"\0" not in header:
            raise DataError(
                f"{path}: {name} part its columns",
                where=f"line {line}",
                why="a CSV table has commas between columns and points in numbers",
                next_step="save it with commas, or as Parquet",
            )


def _check_map(path: Path, raw: "pl.DataFrame", wanted: dict[str, str]) -> dict[str, str]:
    for ours, theirs in wanted.items():
        if theirs not in raw.columns:
            raise UsageError(
                f"{path} has no column {theirs!r} to take {ours} from",
                why=f"its columns: {', '.join(each for each in raw.columns if each != 'line')}",
                next_step="correct the column map",
            )
        if not is_our_name(ours):
            raise UsageError(
                f"the column map names {ours!r}, which no table has",
                why=f"known: {', '.join([*OUR_NAMES.values(), *TEXTS, *FLAGS])}",
                next_step="correct the column map",
            )
    return wanted


def _require(path: Path, raw: "pl.DataFrame", kind: Kind, found: list[Source]) -> None:
    missing = [name for name in kind.required if name not in {source.ours for source in found}]
    if missing:
        raise DataError(
            f"{path} has no column {', '.join(missing)}",
            where=f"line 1: {', '.join(raw.columns)}",
            why=f"a table of {kind.name} needs {', '.join(kind.required)}, in any unit",
            next_step=f'rename it, or give a column map such as {{"{missing[0]}": "..."}}',
        )


def _rename_texts(raw: "pl.DataFrame", wanted: dict[str, str]) -> "pl.DataFrame":
    """Give text and yes/no columns our names and types."""
    import polars as pl

    table = raw.rename({wanted[name]: name for name in (*TEXTS, *FLAGS) if name in wanted})
    texts = [pl.col(name).cast(pl.String) for name in TEXTS if name in table.columns]
    flags = [
        pl.col(name).cast(pl.String).str.to_lowercase().is_in(_TRUE)
        for name in FLAGS
        if name in table.columns and table[name].dtype == pl.String
    ]
    return table.with_columns(*texts, *flags)


def _convert(
    path: Path, table: "pl.DataFrame", raw: "pl.DataFrame", source: Source, first_line: int
) -> "pl.DataFrame":
    """Replace the file's column by ours, as numbers in our unit."""
    import polars as pl

    cells = raw[source.theirs]
    numbers = cells.cast(pl.Float64, strict=False)
    if cells.dtype == pl.String:
        text = cells.str.strip_chars()
        numbers = text.cast(pl.Float64, strict=False)
        is_text = (numbers.is_null() & ~text.str.to_lowercase().is_in(_MISSING)).fill_null(
            value=False
        )
        if is_text.any():
            raise wrong(path, raw, source.theirs, first_line, int(is_text.arg_max() or 0), "text")
    ours = (numbers * source.factor).fill_nan(None).alias(source.ours)
    kept = table.drop(source.theirs) if source.theirs in table.columns else table
    return kept.with_columns(ours)


def _drop_incomplete(
    path: Path, table: "pl.DataFrame", kind: Kind, first_line: int, *, strict: bool
) -> tuple["pl.DataFrame", "np.ndarray[Any, np.dtype[np.int64]]", int]:
    """Skip rows without a required value; return the rest, their lines and how many went."""
    import polars as pl

    whole = table.select(
        pl.all_horizontal(pl.col(name).is_not_null() for name in kind.required)
    ).to_series()
    lines = np.arange(table.height) + first_line
    skipped = int((~whole).sum())
    if strict and skipped:
        row = int((~whole).arg_max() or 0)
        name = next(name for name in kind.required if table[name][row] is None)
        raise wrong(path, table, name, first_line, row, "missing")
    if skipped == table.height:
        raise DataError(
            f"{path} has no row with {', '.join(kind.required)}",
            where=f"{table.height} rows",
            next_step=f"look at it: head {path}",
        )
    return table.filter(whole), lines[whole.to_numpy()], skipped


def _check_bounds(path: Path, table: "pl.DataFrame", name: str, lines: Any) -> None:
    stem = name.rpartition("_")[0]
    low, high = QUANTITIES[stem].low, QUANTITIES[stem].high
    outside = ((table[name] < low) | (table[name] > high)).fill_null(value=False)
    if outside.any():
        row = int(outside.arg_max() or 0)
        raise DataError(
            f"{path}: {name} is {table[name][row]:g}",
            where=f"line {lines[row]}, column {name}",
            why=f"it must be {low:g} to {high:g}",
            next_step=f"correct the line, or its unit: sed -n {lines[row]}p {path}",
        )


def _check_order(path: Path, table: "pl.DataFrame", lines: Any) -> None:
    """Refuse a time that is before the last one of the same sensor."""
    import polars as pl

    step = pl.col("time_s").diff()
    steps = table.select(step.over("sensor") if "sensor" in table.columns else step).to_series()
    back = (steps < 0).fill_null(value=False)
    if back.any():
        row = int(back.arg_max() or 0)
        raise DataError(
            f"{path}: time_s goes back by {-steps[row]:g} s to {table['time_s'][row]:.3f}",
            where=f"line {lines[row]}, column time_s",
            why="the times of a sensor must not decrease, and count on over midnight",
            next_step="sort the table by time_s, or add 86400 to the times after midnight",
        )


def wrong(
    path: Path, table: "pl.DataFrame", name: str, first_line: int, row: int, what: str
) -> DataError:
    """Return the error for a cell that is not the number it should be."""
    line = first_line + row
    value = table[name][row]
    return DataError(
        f"{path}: {name} is {what}" + ("" if value is None else f": {value!r}"),
        where=f"line {line}, column {name}",
        why="a number is needed there",
        next_step=f"correct the line: sed -n {line}p {path}",
    )
