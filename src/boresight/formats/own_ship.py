"""Own ship in: where it was, and how it went, as far as its log tells.

The table `own ship`, sorted by time, each time once:

time_s; latitude_deg and longitude_deg, or north_m and east_m; course_deg (over ground), speed_mps,
heading_deg, axis_deg (of the array, ahead) where given, degrees true; time_utc where times were
dates; line (of the file, from 1, or the row)
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError
from boresight.formats.bearings import in_time, is_checked
from boresight.formats.recording import readable
from boresight.formats.schema import Kind, sources
from boresight.formats.tables import checked, load
from boresight.formats.times import with_seconds
from boresight.formats.towed_array import with_array

if TYPE_CHECKING:
    import polars as pl

Array = Any
_PLACES = (("north_m", "east_m"), ("latitude_deg", "longitude_deg"), ("x_m", "y_m"))
_DEGREE_M = 111_195.0
_SWIFT_MPS, _FAR_M = 50.0, 200.0  # faster than ten usual steps, and this, and further: a jump
_ALIASES = {
    "latitude_deg": ("latitude", "lat", "lat_deg", "boat_latitude"),
    "longitude_deg": ("longitude", "lon", "long", "lng", "lon_deg", "boat_longitude"),
    "course_deg": ("cog_deg", "cog", "true_track_deg"),
    "speed_mps": ("sog_mps", "ground_speed_mps"),
    "speed_kt": ("sog_kt", "sog_kn", "speed_kn", "speed_knots"),
}


def read_own_ship(
    path: str | Path, *, columns: Mapping[str, str] | None = None
) -> tuple["pl.DataFrame", tuple[str, ...]]:
    """Read own ship's track.

    Args:
        path: CSV or Parquet.
        columns: our name to the file's, in any unit: {"latitude_deg": "lat"}.

    Returns:
        The table of this module's docstring, and what a reader should know of it.

    Raises:
        MissingInputError: the file is not there or cannot be read.
        DataError: it is no track; names the line.
        UsageError: the column map names what is not there.
    """
    file = readable(path)
    raw, first_line = load(file)
    return own_ship_table(raw, file, first_line=first_line, columns=columns)


def own_ship_table(
    raw: "pl.DataFrame",
    path: Path = Path("own ship"),
    *,
    first_line: int = 1,
    columns: Mapping[str, str] | None = None,
) -> tuple["pl.DataFrame", tuple[str, ...]]:
    """Check a frame of own ship's track; errors are those of `read_own_ship`.

    Args:
        raw: any frame with the columns that a file may have.
        path: what to call it in errors.
        first_line: the line of its first row.
        columns: see `read_own_ship`.
    """
    if is_checked(raw):
        return raw, ()
    remarks: list[str] = []
    raw, wanted = with_seconds(path, raw, first_line, columns or {})
    raw = with_array(_renamed(raw, wanted), remarks)
    raw = raw.drop("line", strict=False).with_row_index("line", first_line)
    place = _place(path, raw, wanted)
    kind = Kind("own ship", ("time_s", *place), in_order=False)
    table, skipped = checked(path, raw, first_line, kind, columns=wanted)
    if skipped:
        remarks.append(f"{skipped} rows of own ship without a time or a place are skipped.")
    table = _once(path, in_time(table.drop("track", strict=False), remarks), place, remarks)
    table = _without_jumps(path, table, place, remarks)
    if table.height < 2:
        raise DataError(
            f"{path} holds own ship at one time only",
            where=f"line {table['line'][0]}",
            why="a track needs two places at least",
            next_step="give own ship's track over the time of the bearings",
        )
    return (_from_xy(table, remarks) if place == ("x_m", "y_m") else table), tuple(remarks)


def _renamed(raw: "pl.DataFrame", columns: Mapping[str, str]) -> "pl.DataFrame":
    """Columns under names that others use, under ours."""
    by_name = {name.lower(): name for name in reversed(raw.columns)}
    taken = {source.ours for source in sources(raw.columns, dict(columns))}
    renames: dict[str, str] = {}
    for ours, others in _ALIASES.items():
        theirs = next((by_name[name] for name in others if name in by_name), None)
        if theirs and not {ours, ours.replace("_kt", "_mps")} & taken:
            renames[theirs] = ours
    return raw.rename(renames)


def _place(path: Path, raw: "pl.DataFrame", columns: Mapping[str, str]) -> tuple[str, str]:
    found = {source.ours for source in sources(raw.columns, dict(columns))}
    place = next((pair for pair in _PLACES if set(pair) <= found), None)
    if place is None:
        raise DataError(
            f"{path} does not say where own ship is",
            where=f"line 1: {', '.join(each for each in raw.columns if each != 'line')}",
            why="it needs latitude_deg and longitude_deg, or north_m and east_m",
            next_step='rename them, or give a column map such as {"latitude_deg": "..."}',
        )
    return place


def _once(
    path: Path, table: "pl.DataFrame", place: tuple[str, str], remarks: list[str]
) -> "pl.DataFrame":
    """Each time once: same places merged, near ones averaged, others refused."""
    import polars as pl

    if table["time_s"].n_unique() == table.height:
        return table
    metres = _DEGREE_M if place[0] == "latitude_deg" else 1.0
    by_time = table.group_by("time_s", maintain_order=True)
    spread = by_time.agg(
        *((pl.col(name).max() - pl.col(name).min()) * metres for name in place), pl.col("line")
    )
    apart = np.hypot(*(spread[name].to_numpy() for name in place))
    usual = _usual_step_m(table, place, metres)
    if apart.max() > 10.0 + 2.0 * usual:
        row = int(apart.argmax())
        lines = spread["line"][row].to_list()
        raise DataError(
            f"{path}: own ship is at two places {apart[row]:.0f} m apart at one time",
            where=f"lines {', '.join(map(str, lines[:4]))}, time_s {spread['time_s'][row]:g}",
            why="which of them holds cannot be told",
            next_step="keep one of the lines",
        )
    again = table.height - spread.height
    how = "once each" if apart.max() == 0 else "averaged"
    remarks.append(f"Own ship's log has {again} times twice: taken {how}.")
    numbers = [pl.col(name).mean() for name in place]
    rest = [pl.col(n).first() for n in table.columns if n not in (*place, "time_s")]
    return by_time.agg(*numbers, *rest)


def _without_jumps(
    path: Path, table: "pl.DataFrame", place: tuple[str, str], remarks: list[str]
) -> "pl.DataFrame":
    """Leave out places that own ship jumps to and back from; refuse a jump that lasts."""
    import polars as pl

    jumps = _jumps(table, place)
    if not jumps.any():
        return table
    spikes = np.append(jumps, True) & np.insert(jumps, 0, True)
    kept = table.filter(pl.Series(~spikes))
    left = _jumps(kept, place)
    if left.any() or kept.height < 2:
        line = table["line"][int(jumps.argmax()) + 1]
        raise DataError(
            f"{path}: own ship jumps, and does not come back",
            where=f"line {line}, time_s {table['time_s'][int(jumps.argmax()) + 1]:g}",
            why=f"no ship goes at {_SWIFT_MPS:g} m/s and ten times as fast as it usually does",
            next_step=f"look at the log there: sed -n {line}p {path}",
        )
    remarks.append(
        f"{int(spikes.sum())} places in own ship's log cannot be, the first in line "
        f"{table['line'][int(spikes.argmax())]}: left out."
    )
    return kept


def _jumps(table: "pl.DataFrame", place: tuple[str, str]) -> Array:
    """(n - 1,) whether a step is one that no ship sails."""
    a, b = (table[name].to_numpy() for name in place)
    metres = (_DEGREE_M, _DEGREE_M * np.cos(np.radians(a[:-1]))) if "_deg" in place[0] else (1, 1)
    turn = (np.diff(b) + 540) % 360 - 180 if "_deg" in place[0] else np.diff(b)
    away = np.hypot(np.diff(a) * metres[0], turn * metres[1])
    speed = away / np.diff(table["time_s"].to_numpy())
    if not len(speed):
        return np.zeros(0, bool)
    return (away > _FAR_M) & (speed > max(10 * float(np.median(speed)), _SWIFT_MPS))


def _usual_step_m(table: "pl.DataFrame", place: tuple[str, str], metres: float) -> float:
    one = table.unique("time_s", keep="first", maintain_order=True)
    steps = np.hypot(*(np.diff(one[name].to_numpy()) for name in place)) * metres
    return float(np.median(steps)) if len(steps) else 0.0


def _from_xy(table: "pl.DataFrame", remarks: list[str]) -> "pl.DataFrame":
    """Name x and y: as course tells where there is one, else x = North as everywhere here."""
    x_is_east = _course_says_east(table)
    north, east = ("y_m", "x_m") if x_is_east else ("x_m", "y_m")
    why = "as course_deg says" if x_is_east is not None else "which nothing in the file confirms"
    remarks.append(
        f"Own ship's x_m was taken as {'East' if x_is_east else 'North'} and y_m as "
        f"{'North' if x_is_east else 'East'}, {why}; north_m and east_m leave no doubt."
    )
    return table.rename({north: "north_m", east: "east_m"})


def _course_says_east(table: "pl.DataFrame") -> bool | None:
    """Whether x is East by the course; None where there is none, or it does not decide."""
    if "course_deg" not in table.columns:
        return None
    dx, dy = (np.diff(table[name].to_numpy()) for name in ("x_m", "y_m"))
    course = np.radians(table["course_deg"].cast(float).to_numpy())[:-1]
    known = np.isfinite(course) & (np.hypot(dx, dy) > 0)
    if not known.any():
        return None
    step = dx[known] + 1j * dy[known]
    as_north = np.abs(np.sum(np.abs(step) * np.cos(np.angle(step) - course[known])))
    as_east = np.abs(np.sum(np.abs(step) * np.cos(np.pi / 2 - np.angle(step) - course[known])))
    most = np.sum(np.abs(step))
    if max(as_north, as_east) < 0.7 * most or abs(as_north - as_east) < 0.2 * most:
        return None
    return bool(as_east > as_north)
