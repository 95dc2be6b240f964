"""A recording, whatever its format: read into tables, or inspected."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.errors import DataError, MissingInputError
from boresight.formats import plots, reference, services
from boresight.formats.asterix import Records
from boresight.formats.clock import Clock
from boresight.formats.columns import Stamp, stamp
from boresight.formats.decoding import Account
from boresight.formats.stream import Progress, stream
from boresight.formats.summary import Summary

if TYPE_CHECKING:
    import polars as pl

_TABLES: dict[int, tuple[str, Callable[[Records, Stamp], "pl.DataFrame"]]] = {
    10: ("plots", plots.plots),
    21: ("reference", reference.reference),
    34: ("sectors", services.sectors),
    48: ("plots", plots.plots),
    62: ("system_tracks", services.system_tracks),
}
TABLE_SUFFIXES = frozenset({".csv", ".parquet"})


@dataclass(frozen=True, kw_only=True)
class Recording:
    """What a recording holds, by time; a table is empty, without columns, if there is none of it.

    Attributes:
        plots: target reports, see `boresight.formats.plots`.
        reference: ADS-B, see `boresight.formats.reference`.
        system_tracks: tracks of a centre, see `boresight.formats.services`.
        sectors: radar service messages, see `boresight.formats.services`.
        summary: as `inspect` returns it.
    """

    plots: "pl.DataFrame"
    reference: "pl.DataFrame"
    system_tracks: "pl.DataFrame"
    sectors: "pl.DataFrame"
    summary: dict[str, Any]


def read_recording(
    path: str | Path,
    *,
    strict: bool = False,
    columns: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Read an ASTERIX recording, or a table of plots as CSV or Parquet.

    Args:
        path: the file; what it is, is found out.
        strict: stop at the first damage instead of skipping and counting it.
        columns: for tables, our name to the file's: {"range_m": "rng"}.
        progress: called with octets read and their total.

    Raises:
        MissingInputError: there is no such file, or it cannot be read.
        DataError: it is no recording; or, with `strict`, it is damaged.
    """
    import polars as pl

    file = readable(path)
    if file.suffix.lower() in TABLE_SUFFIXES:
        return _from_table(file, columns, strict=strict)
    found: dict[str, list[pl.DataFrame]] = {name: [] for name, _ in _TABLES.values()}
    account, summary = Account(), Summary()
    for records, when in _stamped(file, account, strict=strict, progress=progress):
        summary.add(records, when)
        name, make = _TABLES[records.edition.category]
        found[name].append(make(records, when))
    tables = {
        name: pl.concat(parts).sort("time_s", maintain_order=True, nulls_last=True)
        if parts
        else pl.DataFrame()
        for name, parts in found.items()
    }
    report = summary.report(account)
    if tables["reference"].height:
        tables["reference"] = reference.with_jumps(tables["reference"])
        report["notes"] += _jump_notes(tables["reference"])
    return Recording(**tables, summary=report)


def _jump_notes(table: "pl.DataFrame") -> list[str]:
    jumps = int(table["position_jumps"].sum())
    if not jumps:
        return []
    told = f"{jumps} of {table.height} ADS-B reports place their aircraft where it cannot be"
    return [f"{told}: kept as recorded, marked position_jumps."]


def damage(file: Path, summary: Mapping[str, Any]) -> list[str]:
    """A sentence if part of a recording was skipped, from what `inspect` says of it."""
    if not summary["skipped_bytes"]:
        return []
    lost = f"{summary['skipped_bytes']:,} of {summary['bytes']:,} bytes of {file.name}"
    places = [f"{each['reason']} at byte {each['offset']:,}" for each in summary["damaged"][:1]]
    return [f"{lost} were skipped as damaged; {places[0] if places else 'see inspect'}."]


def inspect(
    path: str | Path,
    *,
    strict: bool = False,
    columns: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Say what is in a recording; arguments and errors are those of `read_recording`.

    Returns:
        `format`, `framing`, `bytes`, `skipped_bytes`, `categories` (each `category`, `edition`,
        `records`, `sensor`, `first_s`, `last_s`, `scan_s`), `addresses`, `damaged` (each `offset`,
        `reason`), `unknown_categories` (each `category`, `blocks`) and `notes`.
    """
    file = readable(path)
    if file.suffix.lower() in TABLE_SUFFIXES:
        return _from_table(file, columns, strict=strict).summary
    account, summary = Account(), Summary()
    for records, when in _stamped(file, account, strict=strict, progress=progress):
        summary.add(records, when)
    return summary.report(account)


def readable(path: str | Path) -> Path:
    """Return the path of a file that can be opened.

    Raises:
        MissingInputError: it is not there, is a folder, or may not be read.
        DataError: it is empty.
    """
    file = Path(path)
    try:
        with file.open("rb") as opened:
            if not opened.read(1):
                raise DataError(
                    f"{file} is empty",
                    where="byte offset 0",
                    next_step="record again, or name another file",
                )
    except FileNotFoundError:
        raise MissingInputError(
            f"there is no file {file}", next_step=f"list what is there: ls {file.parent}"
        ) from None
    except IsADirectoryError:
        raise MissingInputError(
            f"{file} is a folder", next_step=f"name a file in it: ls {file}"
        ) from None
    except PermissionError:
        raise MissingInputError(
            f"{file} may not be read", next_step=f"allow it: chmod u+r {file}"
        ) from None
    except OSError as error:
        raise MissingInputError(
            f"{file} cannot be read",
            why=str(error.strerror or error),
            next_step=f"look at the path: ls -l {file}",
        ) from None
    return file


def _stamped(
    file: Path, account: Account, *, strict: bool, progress: Progress | None
) -> Iterator[tuple[Records, Stamp]]:
    clock = Clock()
    for batch in stream(file, account, strict=strict, progress=progress):
        yield batch.records, stamp(batch, clock)


def _from_table(file: Path, columns: Mapping[str, str] | None, *, strict: bool) -> Recording:
    import polars as pl

    from boresight.formats.tables import read_plots, summarize

    table, skipped = read_plots(file, columns=columns, strict=strict)
    empty = pl.DataFrame()
    return Recording(
        plots=table,
        reference=empty,
        system_tracks=empty,
        sectors=empty,
        summary=summarize(file, table, skipped),
    )
