"""Which reports of a reference are fit to hold a radar against, and whose they are."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.formats.clock import DAY_S
from boresight.formats.reference import with_jumps

if TYPE_CHECKING:
    import polars as pl

Array = Any
_RADIUS_95 = 2.4477  # of a circular normal law, in its standard deviations: sqrt(-2 ln 0.05)
_LOWEST_PA = 6  # the quality of editions 0.2x has no scale; upper codes are those of GPS
_MOST = 0.5  # of the reports
_UPDATES = 2.25  # one report may be missing, and clocks jitter

MEANINGS = {
    "simulated": "of a simulated target or a test",
    "no position": "without a time, a latitude or a longitude",
    "no identity": "of nobody: nothing says whose position it is",
    "another centre": "of another centre than the busiest one",
    "coasted": "extrapolated by the tracker, with no plot in them",
    "poor accuracy": "of an accuracy that is unknown, or worse than the limit of one axis",
    "too old": "older when they were reported than the limit",
    "time unknown": "of unknown time: others say when their position applied, these do not",
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


def screened(raw: "pl.DataFrame", kind: str, limits: Limits) -> "tuple[pl.DataFrame, list[str]]":
    """Reports by target and time, with the columns of `Reference.table`, line and reason.

    Args:
        raw: as `formats` reads it, in the order of the file.
        kind: "adsb", "system tracks" or "table".
        limits: what a report must keep to be fit.

    Returns:
        The table, `reason` empty where a report is fit; and remarks about its order.
    """
    import polars as pl

    remarks: list[str] = []
    table = _with_base(_completed(raw, kind), kind)
    table = _with_targets(_in_order(table, remarks))
    reason = _reasons(table, kind, limits)
    reason[(reason == "") & _again(table)] = "duplicate"
    table = table.with_columns(reason=pl.Series(reason, dtype=pl.String))
    return _marked_jumps(table), remarks


COLUMNS = (
    "time_s",
    "target",
    "name",
    "address",
    "mode_a",
    "latitude_deg",
    "longitude_deg",
    "height_m",
    "pressure_altitude_m",
    "accuracy_m",
    "age_s",
    "on_ground",
)
_NUMBERS = tuple(name for name in COLUMNS if name.endswith(("_s", "_deg", "_m", "_mps")))
_TEXTS = ("address", "mode_a", "target", "sensor", "quality_kind", "time_kind")
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
        for name in _NUMBERS
    ]
    texts = [
        pl.col(name).cast(pl.String) if has(name) else pl.lit(None, pl.String).alias(name)
        for name in _TEXTS
    ]
    flags = [
        pl.col(name).fill_null(value=False)
        if has(name) and raw[name].dtype == pl.Boolean
        else pl.lit(value=False).alias(name)
        for name in _FLAGS
    ]
    whole = [
        pl.col(name).cast(pl.Int64, strict=False)
        if has(name)
        else pl.lit(None, pl.Int64).alias(name)
        for name in ("quality", "system_track")
    ]
    table = raw.select(*numbers, *texts, *flags, *whole)
    axis = np.sqrt(2.0) if kind == "system tracks" else _RADIUS_95
    return table.with_columns(pl.col("accuracy_m") / axis)


def _with_base(table: "pl.DataFrame", kind: str) -> "pl.DataFrame":
    """Say whose each report is: an aircraft's, or a system track's; null where nothing tells."""
    import polars as pl

    if kind == "system tracks":
        base = pl.col("sensor") + "#" + pl.col("system_track").cast(pl.String)
    else:
        base = pl.coalesce("address", "target", "mode_a")
        if kind == "table" and table.select(base.is_null().all()).item():
            base = pl.lit("the target")
    return table.with_columns(base=base, line=pl.int_range(pl.len()))


def _in_order(table: "pl.DataFrame", remarks: list[str]) -> "pl.DataFrame":
    """Sort by target and time; say so if a file was not in order, or ran over midnight."""
    import polars as pl

    step = pl.col("time_s").diff().over("base")
    start = _start_of_the_day(table)
    if start is not None:
        days = (pl.col("time_s") < start).cast(pl.Int64)
        table = table.with_columns(pl.col("time_s") + days * DAY_S)
        remarks.append("The reference's times start again at midnight; they were counted on.")
    back = int((table.select(step).to_series() < 0).sum())
    if back:
        remarks.append(
            f"{back} rows of the reference go back in time within their target; rows were sorted."
        )
    return table.sort("base", "time_s", maintain_order=True)


def _start_of_the_day(table: "pl.DataFrame") -> float | None:
    """The first time of a table whose times of day start again at midnight, if they do.

    They do if a target's, or all in the file's order, step back by most of a day, once. What begins
    after midnight steps back nowhere, so the longest pause of the day parts first from last.
    """
    import polars as pl

    time = table["time_s"].drop_nans()
    if not len(time) or float(time.max()) >= DAY_S or float(time.min()) < 0.0:  # type: ignore[arg-type]
        return None
    own = pl.col("time_s").diff().over("base") < -DAY_S / 2
    wraps = table.select("base", wraps=own).filter("wraps")["base"]
    steps = time.diff().drop_nulls()
    once = bool((steps < -DAY_S / 2).sum() == 1 and (steps < 0).sum() == 1)
    if not once and not (wraps.len() and wraps.is_unique().all()):
        return None
    ordered = time.unique().sort().to_numpy()
    pauses = np.diff(ordered)
    return float(ordered[1:][np.argmax(pauses)]) if len(pauses) else None


def _with_targets(table: "pl.DataFrame") -> "pl.DataFrame":
    """Number what may be interpolated: one aircraft, or one system track, under one code.

    A code that is missing from a report is that of the report before.
    """
    import polars as pl

    table = table.with_columns(pl.col("mode_a").forward_fill().backward_fill().over("base"))
    key = pl.struct("base", "mode_a").rank("dense").cast(pl.Int64) - 1
    table = table.with_columns(
        name=pl.coalesce("address", "mode_a", "base"),
        target=pl.when(pl.col("base").is_not_null()).then(key).otherwise(-1),
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
        "time unknown": _late(table),
    }
    if kind == "system tracks":
        busiest = table["sensor"].mode().sort().first()
        found["another centre"] = (pl.col("sensor") != busiest).fill_null(value=True)
    names = list(found)
    holds = table.select(**found).to_numpy()
    return np.where(holds.any(axis=1), np.array(names, dtype=object)[holds.argmax(axis=1)], "")


def _late(table: "pl.DataFrame") -> "pl.Expr":
    """Reports that only say when they were received, where most say when their position applied.

    Their positions are older than that by what nobody knows, and would pass for a bias of time.
    """
    import polars as pl

    applied = (pl.col("time_kind") == "applicability").fill_null(value=False)
    most = bool(table.select(applied.mean() > _MOST).item())
    return ~applied if most else pl.lit(value=False)


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


def longest_gap(table: "pl.DataFrame") -> float:
    """2.25 times the median time between reports of one target, 5 s at least, 10 s at most."""
    import polars as pl

    step = pl.col("time_s").diff().over("target")
    median = table.select(step.median()).item()
    return float(np.clip(_UPDATES * (median or 0.0), 5.0, 10.0))
