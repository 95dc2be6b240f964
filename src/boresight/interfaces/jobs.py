"""The commands' work: each calls the floors below and returns an answer; none of them prints."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.interfaces import calibrating, door, screens, screens_calibration, screens_reproduce
from boresight.interfaces.answers import Answer
from boresight.interfaces.applying import applied
from boresight.interfaces.reading import own_site
from boresight.interfaces.recordings import no_plots, sensors, sha256
from boresight.interfaces.terminal import Manner, progress

if TYPE_CHECKING:
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
    calibration: Path | None,
    atmosphere: "Atmosphere | None",
    strict: bool,
    columns: Mapping[str, str] | None,
    folder: Path | None,
) -> Answer:
    """Track a recording; with a folder, write tables and the report into it."""
    from boresight.formats.recording import damage, read_recording
    from boresight.interfaces.report import report
    from boresight.tracking.tracker import track as track_plots

    (first, *others), is_all = door.filters(names)
    target = door.folder(folder) if folder else None
    with progress(f"Reading {file.name}", manner) as watch:
        read = read_recording(file, strict=strict, columns=columns, progress=watch.count)
    if read.plots.is_empty():
        raise no_plots(file, read.summary)
    source = door.sensor(sensor, sensors(read.summary)) if sensor else None
    place = site or own_site(read, source)
    using = applied(calibration, read.plots, site=place, sensor=source, atmosphere=atmosphere)
    with progress(f"Tracking with {first.name}", manner) as watch:
        result = track_plots(
            read.plots,
            filter=first,
            compare=others,
            leave_out=is_all,
            progress=watch.count,
            **using.arguments,
        )
    told = [*damage(file, read.summary), *using.remarks, *result.remarks]
    result = replace(result, remarks=told)
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
        "by_target": result.targets.to_dicts(),
    }


def demo(folder: Path, manner: Manner) -> Answer:
    """Calibrate and track the recording in the package, compare with its truth, write it down."""
    from importlib.resources import as_file, files

    from boresight.experiments.demo import run_demo
    from boresight.interfaces.report import report

    target = door.folder(folder)
    with progress("The built-in recording", manner) as watch:
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
        calibration=found.calibration,
    )
    outputs = [*write(page, result, target), *calibrating.keep(found.calibration, target)]
    calibration = calibrating.content(found.calibration, outputs)
    content = tracking_content(result, outputs) | {
        "report": outputs[0],
        "calibration": calibration,
        **{name: calibration[name] for name in calibrating.REQUIRED},
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
                screens_calibration.planted(found.calibration, found.facts["radar"]),
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
    """Repeat a paper's tables, figures and claims; with a folder, write the report into it."""
    from boresight.experiments.reproduce import SEED
    from boresight.experiments.reproduce import reproduce as repeat

    output = door.folder(folder) if folder else None
    with progress(f"Reproducing {key}", manner) as watch:
        found = repeat(
            key,
            runs=runs,
            seed=SEED if seed is None else seed,
            output=output,
            assume=assume,
            progress=lambda name: watch.say(f"reproducing {name}"),
        )
        if output:
            from boresight.interfaces.report import reproduce_page

            watch.say("writing the report")
            page = reproduce_page.page(key, found, manner.command)
            found["report"] = str(page.save(output / REPORT))
    return Answer(
        content=found, screen=lambda width: screens_reproduce.reproduced(key, found, width)
    )


def cite(name: str, _manner: Manner) -> Answer:
    """Give the reference of a filter."""
    from boresight import catalogue

    found = catalogue.cite(name)
    return Answer(content=found, screen=lambda _width: screens.cited(found))
