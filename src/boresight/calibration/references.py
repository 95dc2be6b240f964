"""References: where targets really were, from ADS-B, a centre's system tracks or a table.

Reports that are not fit to hold a radar against are refused, each counted with its reason; a
reference is named as what it is, since a centre's tracker is no GPS.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from boresight.calibration.screening import COLUMNS, LIMITS, MEANINGS, Limits, longest_gap, screened
from boresight.errors import DataError, unknown
from boresight.formats.recording import (
    TABLE_SUFFIXES,
    Recording,
    damage,
    read_recording,
    readable,
)
from boresight.formats.schema import REFERENCE
from boresight.formats.tables import read_table

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """Where targets were.

    Attributes:
        kind: "adsb", "system tracks" or "table".
        table: one row for each report that is fit to be used, by target and time: time_s, target
            (number from 0 of what may be interpolated: one aircraft under one Mode A code),
            name (its identity: address, else code, else as the table calls it), address, mode_a
            (null where not known), latitude_deg, longitude_deg, height_m (geometric),
            pressure_altitude_m, accuracy_m (standard deviation of one axis), age_s (all NaN where
            not known), on_ground.
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
        found = from_recording(recording, kind, limits=limits)
        return replace(found, remarks=[*damage(file, recording.summary), *found.remarks])
    table, skipped = read_table(file, REFERENCE, columns=columns)
    return _made(table, "table", limits or LIMITS["table"], skipped)


def from_table(raw: "pl.DataFrame", *, limits: Limits | None = None) -> Reference:
    """The reference that a frame holds, in our names and units (see `formats.schema`).

    Raises:
        DataError: a required column is missing, or no report is fit to be used.
    """
    lacking = [name for name in REFERENCE.required if name not in raw.columns]
    if lacking:
        raise DataError(
            f"the reference has no column {lacking[0]!r}",
            why=f"its columns are {', '.join(raw.columns)}",
            next_step=f"name its columns {', '.join(REFERENCE.required)}",
        )
    return _made(raw, "table", limits or LIMITS["table"])


def _made(raw: "pl.DataFrame", kind: str, limits: Limits, skipped: int = 0) -> Reference:
    """Name targets, refuse what is not fit, sort by target and time."""
    import polars as pl

    table, remarks = screened(raw, kind, limits)
    counts = table.filter(pl.col("reason") != "")["reason"].value_counts(sort=True)
    refused = dict(counts.iter_rows())
    if skipped:
        refused["no position"] = refused.get("no position", 0) + skipped
    table = table.filter(pl.col("reason") == "").select(COLUMNS)
    if not table.height:
        raise DataError(
            f"no report of the reference ({kind}) is fit to be used",
            why="; ".join(f"{count} {MEANINGS[each]}" for each, count in refused.items()),
            next_step="name another reference, or other limits",
        )
    remarks += [_refusal(count, each, limits) for each, count in refused.items()]
    if "time_kind" in raw.columns and "time unknown" not in refused:
        kinds = raw["time_kind"].drop_nulls().unique().sort().to_list()
        if kinds != ["applicability"]:
            remarks.append(
                f"The reference's times are times of {' and '.join(kinds)}, not of its positions: "
                "how old these are then nobody says, and it is part of the time bias."
            )
    gap = limits.longest_gap_s or longest_gap(table)
    return Reference(kind=kind, table=table, longest_gap_s=gap, refused=refused, remarks=remarks)


def _refusal(count: int, reason: str, limits: Limits) -> str:
    """One sentence: how many reports were refused, why, and by which limit."""
    many = "1 report" if count == 1 else f"{count:,} reports"
    verb = "was" if count == 1 else "were"
    limit = {"poor accuracy": f" ({limits.accuracy_m:g} m)", "too old": f" ({limits.age_s:g} s)"}
    return f"{many} of the reference {verb} not used: {MEANINGS[reason]}{limit.get(reason, '')}."
