"""A truth from a recording: the longest stretch of a flight without a gap, as an exact path."""

from dataclasses import replace
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from boresight.calibration.interpolation import Paths
from boresight.calibration.references import Reference, from_file, from_table
from boresight.errors import DataError, unknown
from boresight.maths.frames import Site

if TYPE_CHECKING:
    import polars as pl

Array = Any
Source = Union[Reference, "pl.DataFrame", str, PathLike[str]]


def stretch(
    source: Source, site: Site, *, dt_s: float, target: str | None, scans: int | None
) -> tuple[Array, Array]:
    """Positions and velocities (scans, 3) of a target, North, East and up at a site.

    Args:
        source: a reference, or what one is read from.
        site: origin of the frame.
        dt_s: s between scans.
        target: its name; None: the one with the longest stretch.
        scans: how many; None: as many as the stretch lasts.
    """
    paths, numbers = _paths(source, site)
    if target is not None and target not in numbers:
        raise unknown("target", target, sorted(numbers))
    first, lasts, number = _longest(paths, None if target is None else numbers[target])
    whole = int(lasts / dt_s) + 1
    count = whole if scans is None else scans
    if not 2 <= count <= whole:
        raise DataError(
            f"the longest stretch of the recording lasts {lasts:.6g} s: {whole} scans of {dt_s:g} s"
            + ("" if scans is None else f", not {scans}"),
            why=f"gaps longer than {paths.longest_gap_s:g} s are not bridged",
        )
    time_s = first + dt_s * np.arange(count)
    row = paths.before(np.full(count, number), time_s)
    return paths.at(row, time_s, paths.height[row])


def _paths(source: Source, site: Site) -> tuple[Paths, dict[str, int]]:
    """Paths of all targets with one kind of height each, and the targets' numbers by name."""
    import polars as pl

    if isinstance(source, str | PathLike):
        found = from_file(fspath(source))
    else:
        found = source if isinstance(source, Reference) else from_table(source)
    geometric, pressure = (
        pl.col(name).is_not_nan() & pl.col(name).is_not_null()
        for name in ("height_m", "pressure_altitude_m")
    )
    # A path that changed from one kind of height to the other would jump by their difference.
    by_pressure = (geometric.sum() < pressure.sum()).over("target")
    height = pl.when(by_pressure).then("pressure_altitude_m").otherwise("height_m")
    table = found.table.with_columns(height_m=height).filter(
        pl.col("height_m").is_not_nan() & pl.col("height_m").is_not_null()
    )
    if not table.height:
        raise DataError(
            "no position of the recording has a height",
            next_step="name its column height_m or pressure_altitude_m",
        )
    numbers = dict(table.select("name", "target").unique(maintain_order=True).iter_rows())
    return Paths.of(replace(found, table=table), site), numbers


def _longest(paths: Paths, target: int | None) -> tuple[float, float, int]:
    """Start of the longest stretch without a gap, s, how long it lasts, s, and whose it is."""
    ends = np.flatnonzero(~paths.joined(np.arange(len(paths.time))))
    starts = np.concatenate([[0], ends[:-1] + 1])
    mine = slice(None) if target is None else paths.target[starts] == target
    starts, ends = starts[mine], ends[mine]
    lasts = paths.time[ends] - paths.time[starts]
    best = int(np.argmax(lasts))
    return paths.time[starts[best]], lasts[best], int(paths.target[starts[best]])
