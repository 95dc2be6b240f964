"""References: where targets really were, from ADS-B, a centre's system tracks or a table.

Reports that are not fit to hold a radar against are refused, each counted with its reason; a
reference is named as what it is, since a centre's tracker is no GPS.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from boresight.errors import DataError, unknown
from boresight.formats.recording import TABLE_SUFFIXES, Recording, read_recording, readable
from boresight.formats.reference import with_jumps
from boresight.formats.schema import REFERENCE
from boresight.formats.tables import read_table

if TYPE_CHECKING:
    import polars as pl

Array = Any
Kind = Literal["adsb", "system tracks", "table"]
_RADIUS_95 = 2.4477  # of a circular normal law, in its standard deviations: sqrt(-2 ln 0.05)
_LOWEST_PA = 6  # the quality of editions 0.2x has no scale; upper codes are those of GPS
_UPDATES = 2.25  # one report may be missing, and clocks jitter
_DAY_S = 86_400.0

MEANINGS = {
    "simulated": "of a simulated target or a test",
    "no position": "without a time, a latitude or a longitude",
    "no identity": "of nobody: nothing says whose position it is",
    "another centre": "of another centre than the busiest one",
    "coasted": "extrapolated by the tracker, with no plot in them",
    "poor accuracy": "less accurate than the limit, or of an accuracy said to be unknown",
    "too old": "older than the limit when they were reported",
    "duplicate": "a second report of one target for the same time",
    "position jump": "too far from the others of their target for anything that flies",
}


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a report must keep to be used.

    Attributes:
        accuracy_m: largest standard deviation of the position in one axis.
        age_s: largest age of a position when it was reported.
        longest_gap_s: over which nothing is interpolated; None for 2.25 times the median time
            between reports of one target, 5 s at least and 10 s at most.
    """

    accuracy_m: float
    age_s: float
    longest_gap_s: float | None = None


# ADS-B: 80 m is NACp 7, 185.2 m with 95 %. System tracks: as old as a slow antenna's turn.
LIMITS: dict[str, Limits] = {
    "adsb": Limits(accuracy_m=80.0, age_s=2.0, longest_gap_s=5.0),
    "system tracks": Limits(accuracy_m=500.0, age_s=12.0),
    "table": Limits(accuracy_m=80.0, age_s=2.0),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """Where targets were.

    Attributes:
        kind: "adsb", "system tracks" or "table".
        table: one row for each report that is fit to be used, by target and time: time_s, target
            (number from 0 of what may be interpolated: one aircraft under one Mode A code),
            name (its identity: address, else code, else as the table calls it), address, mode_a
            (null where not known), latitude_deg, longitude_deg, height_m (geometric),
            pressure_altitude_m, east_mps, north_mps, accuracy_m (standard deviation of one axis),
            age_s (all NaN where not known), on_ground.
        longest_gap_s: nothing is interpolated over more.
        refused: reports that are not in the table, by reason of `MEANINGS`.
        remarks: sentences for the reader.
    """

    kind: str
    table: "pl.DataFrame"
    longest_gap_s: float
    refused: dict[str, int]
    remarks: list[str]


def from_recording(recording: Recording, kind: str, *, limits: Limits | None = None) -> Reference:
    """The ADS-B reports ("adsb") or the system tracks ("system tracks") of a recording.

    Raises:
        UsageError: no such kind.
        DataError: the recording has none of it, or none is fit to be used.
    """
    tables = {"adsb": recording.reference, "system tracks": recording.system_tracks}
    if kind not in tables:
        raise unknown("kind of reference", kind, tables)
    words = {"adsb": "ADS-B (CAT021)", "system tracks": "system tracks (CAT062)"}[kind]
    if not tables[kind].height:
        raise DataError(
            f"the recording holds no {words}",
            next_step="boresight inspect FILE says what it holds",
        )
    return _made(tables[kind], kind, limits or LIMITS[kind])


def from_file(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    limits: Limits | None = None,
) -> Reference:
    """The reference that a file holds: ASTERIX with CAT021, else CAT062; CSV or Parquet.

    Args:
        path: a recording, or a table with time_s, latitude_deg and longitude_deg in any unit, and
            address, mode_a or target where it is of more than one target.
        columns: for tables, our name to the file's.
        limits: what a report must keep; by default those of `LIMITS`.

    Raises:
        MissingInputError: there is no such file.
        DataError: it holds no reference, or none that is fit to be used.
    """
    file = readable(path)
    if file.suffix.lower() not in TABLE_SUFFIXES:
        recording = read_recording(file)
        kind = "adsb" if recording.reference.height else "system tracks"
        return from_recording(recording, kind, limits=limits)
    table, skipped = read_table(file, REFERENCE, columns=columns)
    return _made(table, "table", limits or LIMITS["table"], skipped)


def _made(raw: "pl.DataFrame", kind: str, limits: Limits, skipped: int = 0) -> Reference:
    """Name targets, refuse what is not fit, sort by target and time."""
    import polars as pl

    remarks: list[str] = []
    table = _in_order(_with_targets(_completed(raw, kind), kind), remarks)
    reason = _reasons(table, kind, limits)
    reason[(reason == "") & _again(table)] = "duplicate"
    table = table.with_columns(reason=pl.Series(reason, dtype=pl.String))
    table = _marked_jumps(table)
    counts = table.filter(pl.col("reason") != "")["reason"].value_counts(sort=True)
    refused = dict(counts.iter_rows())
    if skipped:
        refused["no position"] = refused.get("no position", 0) + skipped
    table = table.filter(pl.col("reason") == "").select(_COLUMNS)
    if not table.height:
        raise DataError(
            f"no report of the reference ({kind}) is fit to be used",
            why="; ".join(f"{count} {MEANINGS[each]}" for each, count in refused.items()),
            next_step="name another reference, or other limits",
        )
    remarks += [
        f"{count} reports of the reference were not used: {MEANINGS[each]}."
        for each, count in refused.items()
    ]
    gap = limits.longest_gap_s or _longest_gap(table)
    return Reference(kind=kind, table=table, longest_gap_s=gap, refused=refused, remarks=remarks)


_COLUMNS = (
    "time_s",
    "target",
    "name",
    "address",
    "mode_a",
    "latitude_deg",
    "longitude_deg",
    "height_m",
    "pressure_altitude_m",
    "east_mps",
    "north_mps",
    "accuracy_m",
    "age_s",
    "on_ground",
)
_NUMBERS = tuple(name for name in _COLUMNS if name.endswith(("_s", "_deg", "_m", "_mps")))
_TEXTS = ("address", "mode_a", "target", "sensor", "quality_kind")
_FLAGS = ("on_ground", "coasted", "simulated", "test")


def _completed(raw: "pl.DataFrame", kind: str) -> "pl.DataFrame":
    """All columns that are looked at, NaN or false where the source has none of it."""
    import polars as pl

    def has(name: str) -> bool:
        return name in raw.columns

    numbers = [
        pl.col(name).cast(pl.Float64, strict=False).fill_null(np.nan)
        if has(name)
        else pl.lit(np.nan).alias(name)
        for name in (*_NUMBERS, "ground_speed_mps", "true_track_deg")
    ]
    texts = [
        pl.col(name).cast(pl.String) if has(name) else pl.lit(None, pl.String).alias(name)
        for name in _TEXTS
    ]
    flags = [
        pl.col(name).cast(pl.Boolean).fill_null(value=False)
        if has(name)
        else pl.lit(value=False).alias(name)
        for name in _FLAGS
    ]
    whole = [
        pl.col(name).cast(pl.Int64) if has(name) else pl.lit(None, pl.Int64).alias(name)
        for name in ("quality", "system_track")
    ]
    table = raw.select(*numbers, *texts, *flags, *whole)
    told = pl.col("east_mps").is_nan() & pl.col("ground_speed_mps").is_not_nan()
    course = pl.col("true_track_deg").radians()
    axis = np.sqrt(2.0) if kind == "system tracks" else _RADIUS_95
    return table.with_columns(
        pl.col("accuracy_m") / axis,
        *(
            pl.when(told).then(pl.col("ground_speed_mps") * part).otherwise(name).alias(name)
            for name, part in (("east_mps", course.sin()), ("north_mps", course.cos()))
        ),
    )


def _with_targets(table: "pl.DataFrame", kind: str) -> "pl.DataFrame":
    """Number what may be interpolated: one aircraft, or one system track, under one code.

    A code that is missing from a report is that of the report before.
    """
    import polars as pl

    if kind == "system tracks":
        base = pl.col("sensor") + "#" + pl.col("system_track").cast(pl.String)
    else:
        base = pl.coalesce("address", "target", "mode_a")
        if kind == "table" and table.select(base.is_null().all()).item():
            base = pl.lit("the target")
    table = table.with_columns(base=base, line=pl.int_range(pl.len()))
    table = table.with_columns(pl.col("mode_a").forward_fill().backward_fill().over("base"))
    key = pl.struct("base", "mode_a").rank("dense").cast(pl.Int64) - 1
    return table.with_columns(
        name=pl.coalesce("address", "mode_a", "base"),
        target=pl.when(pl.col("base").is_not_null()).then(key).otherwise(-1),
    )


def _in_order(table: "pl.DataFrame", remarks: list[str]) -> "pl.DataFrame":
    """Sort by target and time; say so if a file was not in order, or ran over midnight."""
    import polars as pl

    step = pl.col("time_s").diff().over("target")
    steps = table.select("target", step=step)
    midnights = steps.filter(pl.col("step") < -_DAY_S / 2)["target"]
    if midnights.len() and midnights.is_unique().all() and (table["time_s"] < _DAY_S).all():
        days = (step < -_DAY_S / 2).fill_null(value=False).cum_sum().over("target")
        table = table.with_columns(pl.col("time_s") + days * _DAY_S)
        remarks.append("The reference's times start again at midnight; they were counted on.")
    back = int((table.select(step).to_series() < 0).sum())
    if back:
        remarks.append(
            f"{back} rows of the reference go back in time within their target; rows were sorted."
        )
    return table.sort("target", "time_s", maintain_order=True)


def _reasons(table: "pl.DataFrame", kind: str, limits: Limits) -> Array:
    """(n,) first reason why each report is not fit to be used; empty where it is."""
    import polars as pl

    place = pl.col("time_s") + pl.col("latitude_deg") + pl.col("longitude_deg")
    stated_bad = (pl.col("quality") == 0) | (
        (pl.col("quality_kind") == "pa") & (pl.col("quality") < _LOWEST_PA)
    )
    poor = stated_bad.fill_null(value=False) | (
        pl.col("accuracy_m").is_not_nan() & (pl.col("accuracy_m") > limits.accuracy_m)
    )
    found = {
        "simulated": pl.col("simulated") | pl.col("test"),
        "no position": ~place.is_finite(),
        "no identity": pl.col("target") < 0,
        "coasted": pl.col("coasted"),
        "poor accuracy": poor,
        "too old": pl.col("age_s").is_not_nan() & (pl.col("age_s").abs() > limits.age_s),
    }
    if kind == "system tracks":
        busiest = table["sensor"].mode().sort().first()
        found["another centre"] = (pl.col("sensor") != busiest).fill_null(value=True)
    names = list(found)
    holds = table.select(**found).to_numpy()
    return np.where(holds.any(axis=1), np.array(names, dtype=object)[holds.argmax(axis=1)], "")


def _again(table: "pl.DataFrame") -> Array:
    """(n,) whether the report before is of the same target and time."""
    same = (table["target"].diff() == 0) & (table["time_s"].diff() == 0)
    return same.fill_null(value=False).to_numpy()


def _marked_jumps(table: "pl.DataFrame") -> "pl.DataFrame":
    """Mark reports that place their target where it cannot be."""
    import polars as pl

    fit = pl.col("reason") == ""
    place = table.filter(fit).select(
        "line", "time_s", "latitude_deg", "longitude_deg", address="target"
    )
    jumps = with_jumps(place).filter("position_jumps")["line"]
    jumped = pl.col("line").is_in(jumps.implode())
    return table.with_columns(
        reason=pl.when(fit & jumped).then(pl.lit("position jump")).otherwise("reason")
    )


def _longest_gap(table: "pl.DataFrame") -> float:
    """2.25 times the median time between reports of one target, 5 s at least, 10 s at most."""
    import polars as pl

    step = pl.col("time_s").diff().over("target")
    median = table.select(step.median()).item()
    return float(np.clip(_UPDATES * (median or 0.0), 5.0, 10.0))
