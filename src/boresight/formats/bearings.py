"""Bearings in: which column they are in, of what kind, and whether their unit can be believed.

The table `bearings`, one row a bearing, sorted by time:

time_s; one of bearing_deg (true), bearing_magnetic_deg, bearing_relative_deg (off own ship's
heading), tdoa_s (between the ends of an array, positive when the forward end hears first);
conical (the angle is off the array's axis, 0 ahead to 180 astern), magnetic; sigma_deg,
sigma_tdoa_s, array_spacing_m, sound_speed_mps where given; track, where there are several
contacts; time_utc where times were dates; line (of the file, from 1, or the row)
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError
from boresight.formats.recording import readable
from boresight.formats.scatter import deviations, robust_sd
from boresight.formats.schema import Kind, sources
from boresight.formats.tables import checked, load
from boresight.formats.times import over_midnight, with_seconds

if TYPE_CHECKING:
    import polars as pl

Array = Any
MEASURED = ("bearing_deg", "bearing_magnetic_deg", "bearing_relative_deg", "tdoa_s")
_SHORT = {"bearing_mag_deg": "bearing_magnetic_deg", "bearing_mag_rad": "bearing_magnetic_rad"}
_TRACKS = ("track", "contact")
_FLAGS = ("conical", "magnetic")
_TRUE, _FALSE = ("true", "1", "t", "yes", "y"), ("false", "0", "f", "no", "n", "")
_FINEST_DEG = 0.03  # no sonar's bearings scatter less
_FEWEST = 8  # bearings that show how they scatter


def read_bearings(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    strict: bool = False,
    degrees: bool = False,
) -> tuple["pl.DataFrame", tuple[str, ...]]:
    """Read a file of bearings.

    Args:
        path: CSV or Parquet; or the time-difference tracks (.mat) of a two-element towed array.
        columns: our name to the file's, in any unit: {"bearing_rad": "brg", "track": "id"}.
        strict: a row without time or bearing is an error.
        degrees: bearings are in degrees even where they look like radians.

    Returns:
        The table of this module's docstring, and what a reader should know of it.

    Raises:
        MissingInputError: the file is not there or cannot be read.
        DataError: it is no table of bearings; names the line.
        UsageError: the column map names what is not there.
    """
    file = readable(path)
    if file.suffix.lower() == ".mat":
        from boresight.formats.towed_array import tracks

        return tracks(file)
    raw, first_line = load(file)
    return bearings_table(
        raw, file, first_line=first_line, columns=columns, strict=strict, degrees=degrees
    )


def bearings_table(
    raw: "pl.DataFrame",
    path: Path = Path("bearings"),
    *,
    first_line: int = 1,
    columns: Mapping[str, str] | None = None,
    strict: bool = False,
    degrees: bool = False,
) -> tuple["pl.DataFrame", tuple[str, ...]]:
    """Check a frame of bearings; arguments and errors are those of `read_bearings`.

    Args:
        raw: any frame with the columns that a file may have.
        path: what to call it in errors.
        first_line: the line of its first row.
        columns: see `read_bearings`.
        strict: see `read_bearings`.
        degrees: see `read_bearings`.
    """
    if is_checked(raw):
        return raw, ()
    remarks: list[str] = []
    raw, left = with_seconds(path, raw, first_line, columns or {})
    raw = _named(
        path, raw.drop("line", strict=False).with_row_index("line", first_line), left, first_line
    )
    wanted = {ours: theirs for ours, theirs in left.items() if ours not in _TRACKS}
    measured = _measured(path, raw, wanted)
    kind = Kind("bearings", ("time_s", measured), in_order=False)
    table, skipped = checked(path, raw, first_line, kind, columns=wanted, strict=strict)
    if skipped:
        remarks.append(f"{skipped} rows without a time or a bearing are skipped.")
    _check_sigma(path, table)
    if not degrees and _is_in_degrees(raw, wanted, measured):
        _check_unit(path, table, measured, remarks)
    _check_cone(path, table, measured)
    return in_time(table, remarks), tuple(remarks)


def is_checked(table: "pl.DataFrame") -> bool:
    """Whether a frame was read here: its `line` then has the type that only we give it."""
    import polars as pl

    return "line" in table.columns and table["line"].dtype == pl.UInt32


def in_time(table: "pl.DataFrame", remarks: list[str]) -> "pl.DataFrame":
    """The rows by time, counted on over midnight; says so where the file's order was another."""
    import polars as pl

    if "time_utc" not in table.columns:
        table = table.with_columns(
            time_s=pl.Series(over_midnight(table["time_s"].to_numpy(), remarks))
        )
    step = pl.col("time_s").diff()
    back = table.select((step.over("track") if "track" in table.columns else step) < 0)
    unsorted = int(back.to_series().sum())
    if unsorted:
        remarks.append(f"The rows were not in order of time ({unsorted} go back): sorted.")
    return table.sort("time_s", maintain_order=True)


def _named(
    path: Path, raw: "pl.DataFrame", columns: Mapping[str, str], first_line: int
) -> "pl.DataFrame":
    """Give the contact's column and the flags our names and types."""
    import polars as pl

    by_name = {name.lower(): name for name in raw.columns} | dict(columns)
    renames = {by_name[a]: b for a, b in _SHORT.items() if a in by_name and b not in raw.columns}
    raw = raw.rename(renames)
    track = next((by_name[name] for name in _TRACKS if name in by_name), None)
    if track is not None and track in raw.columns:
        name = pl.col(track).cast(pl.String).str.strip_chars().fill_null("")
        raw = raw.with_columns(track=name)
    for flag in _FLAGS:
        told = columns.get(flag, flag)
        if told in raw.columns:
            raw = raw.with_columns(_flag(path, raw[told], first_line).alias(flag))
    return raw


def _flag(path: Path, cells: "pl.Series", first_line: int) -> "pl.Series":
    import polars as pl

    text = cells.cast(pl.String).fill_null("").str.strip_chars().str.to_lowercase()
    text = text.str.replace(r"\.0$", "")
    odd = ~text.is_in([*_TRUE, *_FALSE])
    if odd.any():
        row = int(odd.arg_max() or 0)
        raise DataError(
            f"{path}: {cells.name} is {cells[row]!r}",
            where=f"line {first_line + row}, column {cells.name}",
            why="it must be true or false",
            next_step=f"correct the line: sed -n {first_line + row}p {path}",
        )
    return text.is_in(_TRUE)


def _measured(path: Path, raw: "pl.DataFrame", columns: Mapping[str, str]) -> str:
    """Which of the things that may be measured this table has; a true bearing before others."""
    found = {source.ours for source in sources(raw.columns, dict(columns))}
    name = next((each for each in MEASURED if each in found), None)
    if name is not None:
        return name
    looks_own = {"latitude_deg", "north_m"} & found or "Boat_Latitude" in raw.columns
    raise DataError(
        f"{path} has no column of bearings",
        where=f"line 1: {', '.join(each for each in raw.columns if each != 'line')}",
        why="it looks like own ship's track"
        if looks_own
        else f"a table of bearings needs time_s and one of {', '.join(MEASURED)}, in any unit",
        next_step="give the file of bearings first, and own ship's with --own-ship"
        if looks_own
        else 'rename it, or give a column map such as {"bearing_deg": "..."}',
    )


def _check_sigma(path: Path, table: "pl.DataFrame") -> None:
    for name in ("sigma_deg", "sigma_tdoa_s"):
        if name in table.columns and (table[name] == 0).any():
            line = table.filter(table[name] == 0)["line"][0]
            raise DataError(
                f"{path}: {name} is 0",
                where=f"line {line}, column {name}",
                why="a bearing without error would outweigh all others",
                next_step="give the standard deviation, or leave the cell empty",
            )


def _check_cone(path: Path, table: "pl.DataFrame", measured: str) -> None:
    if "conical" not in table.columns or measured == "tdoa_s":
        return
    outside = table.filter(
        table["conical"] & ~table[measured].is_between(0.0, 180.0) & table[measured].is_finite()
    )
    if outside.height:
        row = outside.row(0, named=True)
        raise DataError(
            f"{path}: a conical bearing of {row[measured]:g} degrees",
            where=f"line {row['line']}, column {measured}",
            why="it is the angle off the array's axis: 0 ahead to 180 astern, never more; the "
            "array does not tell the sides apart",
            next_step="give angles off the axis, or conical = false for true bearings",
        )


def _is_in_degrees(raw: "pl.DataFrame", columns: Mapping[str, str], measured: str) -> bool:
    each = next(s for s in sources(raw.columns, dict(columns)) if s.ours == measured)
    return measured != "tdoa_s" and each.factor == 1.0


def _check_unit(path: Path, table: "pl.DataFrame", measured: str, remarks: list[str]) -> None:
    """Degrees that all lie within a turn of radians: refuse those that only radians explain."""
    values = table[measured].to_numpy()
    is_coarse = np.allclose(10 * values, np.rint(10 * values))  # nobody writes radians so
    if np.abs(values).max() > 2 * np.pi or len(values) < _FEWEST or is_coarse:
        return
    sd, jumps = _scatter(table, measured)
    reasons = []
    if jumps:
        reasons.append(f"{jumps} times two neighbours differ by about 6.28, a turn in radians")
    if sd < _FINEST_DEG:
        reasons.append(f"as degrees they would scatter by {sd:.4f}, which no sonar does")
    if reasons:
        raise DataError(
            f"{path}: {measured} looks like radians, not degrees",
            where=f"column {measured}: {values.min():g} to {values.max():g}",
            why=f"all lie within 6.28; {' and '.join(reasons)}",
            next_step=f"name the column {measured.removesuffix('_deg')}_rad, or affirm degrees "
            "with --degrees",
        )
    remarks.append(
        f"All bearings lie within 6.28 of zero and scatter by {sd:.2f}: taken as degrees, as the "
        "column says. Were they radians, name the column so."
    )


def _scatter(table: "pl.DataFrame", measured: str) -> tuple[float, int]:
    """Robust scatter of all contacts together, and the steps of about a turn in radians."""
    groups = table.sort("time_s").unique(
        ["time_s", *_key(table)], keep="first", maintain_order=True
    )
    parts, jumps = [], 0
    for one in groups.partition_by(_key(table)) if _key(table) else [groups]:
        values = one[measured].to_numpy()
        jumps += int((np.abs(np.abs(np.diff(values)) - 2 * np.pi) < 0.3).sum())
        if one.height >= 4:
            turned = np.unwrap(values, period=2 * np.pi) if jumps else values
            parts.append(deviations(one["time_s"].to_numpy(), turned))
    return (robust_sd(np.concatenate(parts)) if parts else np.inf), jumps


def _key(table: "pl.DataFrame") -> list[str]:
    return [name for name in ("track",) if name in table.columns]
