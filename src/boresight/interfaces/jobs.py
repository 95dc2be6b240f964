"""The commands' work: each calls the floors below and returns an answer; none of them prints."""

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.errors import DataError
from boresight.interfaces import door, screens
from boresight.interfaces.answers import Answer
from boresight.interfaces.terminal import Manner, progress

if TYPE_CHECKING:
    from boresight.formats.recording import Recording
    from boresight.interfaces.report import Report
    from boresight.maths.frames import Site
    from boresight.models.atmosphere import Atmosphere
    from boresight.tracking.result import TrackingResult

REPORT = "report.html"
TABLES = ("tracks.parquet", "tracks.csv", "tracks.geojson")
AGAINST_TRUTH = "Against the truth"
AS_SEEN = "Against the truth as this radar, with its own errors, would see it without noise"


def inspect(
    file: Path, manner: Manner, *, strict: bool, columns: Mapping[str, str] | None
) -> Answer:
    """Say what a recording holds."""
    from boresight.formats import recording

    with progress(f"Reading {file.name}", manner) as watch:
        found = recording.inspect(file, strict=strict, columns=columns, progress=watch.count)
    return Answer(
        content=found,
        screen=lambda _width: screens.inspected(str(file), found),
        remarks=found.get("notes", ()),
    )


def track(
    file: Path,
    manner: Manner,
    *,
    site: "Site | None",
    sensor: str | None,
    names: Sequence[str],
    atmosphere: "Atmosphere | None",
    strict: bool,
    columns: Mapping[str, str] | None,
    folder: Path | None,
) -> Answer:
    """Track a recording; with a folder, write tables and the report into it."""
    from boresight.formats.recording import read_recording
    from boresight.interfaces.report import report
    from boresight.tracking.tracker import track as track_plots

    (first, *others), is_all = door.filters(names)
    target = door.folder(folder) if folder else None
    with progress(f"Reading {file.name}", manner) as watch:
        read = read_recording(file, strict=strict, columns=columns, progress=watch.count)
    if read.plots.is_empty():
        raise no_plots(file, read.summary)
    source = door.sensor(sensor, sensors(read.summary)) if sensor else None
    with progress(f"Tracking with {first.name}", manner) as watch:
        result = track_plots(
            read.plots,
            site=site or own_site(read, source),
            sensor=source,
            filter=first,
            compare=others,
            leave_out=is_all,
            atmosphere=atmosphere,
            progress=watch.count,
        )
    outputs = []
    if target:
        about = read.summary | {"file": file.name, "sha256": sha256(file)}
        with progress("Writing", manner):
            page = report(result, inspection=about, command=manner.command)
            outputs = write(page, result, target)
    return Answer(
        content=tracking_content(result, outputs),
        screen=lambda width: screens.tracked(result, outputs, width),
        remarks=[*read.summary.get("notes", ()), *result.remarks],
    )


def no_plots(file: Path, summary: Mapping[str, Any]) -> DataError:
    """The error of a recording that holds anything but a radar's plots."""
    held = [f"CAT{row['category']:03d}" for row in summary["categories"] if row["category"]]
    return DataError(
        f"{file} holds no plots to track",
        why=f"it holds {', '.join(held) or 'no records'}; plots are CAT048 or CAT010",
        next_step=f"boresight inspect {shlex.quote(str(file))}",
    )


def own_site(read: "Recording", sensor: str | None) -> "Site | None":
    """Where the tracked radar says it stands (CAT034, I034/120), if it does."""
    import polars as pl

    from boresight.maths.frames import Site

    if read.sectors.is_empty():
        return None
    name = sensor or read.plots["sensor"].value_counts(sort=True)["sensor"][0]
    mine = read.sectors.filter(pl.col("sensor") == name)
    places = mine.select("latitude_deg", "longitude_deg", "height_m").drop_nulls()
    return Site(**places.row(-1, named=True)) if places.height else None


def sensors(summary: Mapping[str, Any]) -> list[str]:
    """The sensors that a recording has plots of, as `inspect` names them."""
    plots = [row for row in summary["categories"] if row["category"] in (None, 10, 48)]
    return [row["sensor"] for row in plots]


def sha256(file: Path) -> str:
    """The SHA-256 of a file, in hexadecimal."""
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def write(page: "Report", result: "TrackingResult", folder: Path) -> list[str]:
    """Write the report and the tracks into a folder; return the paths.

    GeoJSON is written where the site is known: without it a track has no place on Earth.
    """
    from boresight.formats.output import write_table

    latitudes = result.tracks["latitude_deg"].cast(float).fill_null(float("nan"))
    has_places = bool(latitudes.is_finite().any())
    names = [name for name in TABLES if has_places or not name.endswith(".geojson")]
    paths = [page.save(folder / REPORT)]
    paths += [write_table(result.tracks, folder / name, "tracks") for name in names]
    return [str(path) for path in paths]


def tracking_content(result: "TrackingResult", outputs: Sequence[str]) -> dict[str, Any]:
    """The object that `boresight track --json` prints."""
    return {
        "plots": result.plots,
        "used": result.used,
        "tracks": len(result.targets),
        "updates": int((result.tracks["status"] == "updated").sum()),
        "filter": result.filter,
        "nis_per_dof": result.nis["all"]["mean"],
        "rejected": result.rejected,
        "outputs": list(outputs),
        "nis": result.nis,
        "filters": [asdict(each) for each in result.filters],
        "skipped": result.skipped.to_dicts(),
        "settings": result.settings,
        "remarks": result.remarks,
        "targets": result.targets.to_dicts(),
    }


def demo(folder: Path, manner: Manner) -> Answer:
    """Track the recording in the package, compare with its truth, write report and tables."""
    from importlib.resources import as_file, files

    from boresight.experiments.demo import run_demo
    from boresight.interfaces.report import report

    target = door.folder(folder)
    with progress("Tracking the built-in recording", manner) as watch:
        found = run_demo(progress=watch.say)
    result = list(found.results.values())[-1]
    result = replace(result, remarks=[*found.remarks, *result.remarks])
    with as_file(files("boresight") / "demo" / "recording.ast") as file:
        about = {"file": "The built-in demo recording", "sha256": sha256(file)}
    page = report(
        result,
        found.comparisons,
        found.recording.summary | about,
        manner.command,
        as_seen=found.as_seen,
    )
    outputs = write(page, result, target)
    content = tracking_content(result, outputs) | {
        "report": outputs[0],
        "comparisons": [asdict(each) for each in found.comparisons],
        "as_seen": [asdict(each) for each in found.as_seen],
        "plot_error": found.plot_error._asdict(),
        "planted": found.facts["radar"],
    }
    return Answer(
        content=content,
        screen=lambda width: screens.tracked(
            result,
            outputs,
            width,
            [
                screens.compared(AGAINST_TRUTH, found.comparisons),
                screens.compared(AS_SEEN, found.as_seen),
            ],
        ),
        remarks=result.remarks,
    )


def reproduce(
    key: str,
    manner: Manner,
    *,
    runs: int | None,
    seed: int | None,
    assume: dict[str, Any],
    folder: Path | None,
) -> Answer:
    """Repeat a paper's tables, figures and claims."""
    from boresight.experiments.reproduce import SEED
    from boresight.experiments.reproduce import reproduce as repeat

    output = door.folder(folder) if folder else None
    with progress(f"Reproducing {key}", manner):
        seed = SEED if seed is None else seed
        found = repeat(key, runs=runs, seed=seed, output=output, assume=assume)
    return Answer(content=found, screen=lambda _width: screens.reproduced(key, found))


def cite(name: str, _manner: Manner) -> Answer:
    """Give the reference of a filter."""
    from boresight import catalogue

    found = catalogue.cite(name)
    return Answer(content=found, screen=lambda _width: screens.cited(found))
