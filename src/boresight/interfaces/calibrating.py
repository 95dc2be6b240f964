"""The work of `boresight calibrate`: read, calibrate, write down, answer."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.interfaces import door, screens_calibration
from boresight.interfaces.answers import Answer
from boresight.interfaces.calibration import calibrated
from boresight.interfaces.reading import own_site
from boresight.interfaces.recordings import no_plots, sensors, sha256
from boresight.interfaces.terminal import Manner, progress

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration
    from boresight.maths.frames import Site
    from boresight.models.atmosphere import Atmosphere

REPORT, TOML, RESIDUALS = "report.html", "calibration.toml", "residuals.parquet"
REQUIRED = ("pairs", "targets", "terms", "noise", "air_gain_m_per_km")  # of the demo's answer too
NOT_ESTIMATED = {"estimate": None, "sd": None, "ci95": None, "observable": False}


def calibrate(
    file: Path,
    manner: Manner,
    *,
    reference: str,
    site: "Site | None",
    sensor: str | None,
    terms: tuple[str, ...] | None,
    atmosphere: "Atmosphere | None",
    gate_m: float | None,
    strict: bool,
    columns: Mapping[str, str] | None,
    reference_columns: Mapping[str, str] | None,
    folder: Path | None,
) -> Answer:
    """Find what is wrong with a recording's radar; with a folder, write it down."""
    from boresight.formats.recording import damage, read_recording

    target = door.folder(folder) if folder else None
    with progress(f"Reading {file.name}", manner) as watch:
        read = read_recording(file, strict=strict, columns=columns, progress=watch.count)
    if read.plots.is_empty():
        raise no_plots(file, read.summary)
    source = door.sensor(sensor, sensors(read.summary)) if sensor else None
    with progress("Calibrating", manner):
        found = calibrated(
            read,
            reference,
            site=site or own_site(read, source),
            sensor=source,
            terms=terms,
            atmosphere=atmosphere,
            gate_m=gate_m,
            columns=reference_columns,
        )
    found = replace(found, remarks=[*damage(file, read.summary), *found.remarks])
    about = read.summary | {"file": file.name, "sha256": sha256(file)}
    outputs = write(found, target, about, manner) if target else []
    return Answer(
        content=content(found, outputs),
        screen=lambda width: screens_calibration.calibrated(found, outputs, width),
        remarks=[*read.summary.get("notes", ()), *found.remarks],
    )


def write(
    found: "Calibration", folder: Path, about: Mapping[str, Any], manner: Manner
) -> list[str]:
    """Write the report, the calibration and its residuals into a folder; return the paths."""
    from boresight.interfaces.report import report

    with progress("Writing", manner):
        page = report(calibration=found, inspection=dict(about), command=manner.command)
        return [str(page.save(folder / REPORT)), *keep(found, folder)]


def keep(found: "Calibration", folder: Path) -> list[str]:
    """Write the calibration and its residuals into a folder; return the paths."""
    from boresight.calibration.file import write_calibration
    from boresight.formats.output import write_table

    toml = write_calibration(found, folder / TOML)
    return [str(toml), str(write_table(found.residuals, folder / RESIDUALS, "residuals"))]


def content(found: "Calibration", outputs: list[str]) -> dict[str, Any]:
    """The object that `boresight calibrate --json` prints; usual terms are there, asked or not."""
    from boresight.calibration.calibrate import USUAL

    terms = {name: dict(NOT_ESTIMATED) for name in USUAL}
    terms |= {name: asdict(term) for name, term in found.terms.items()}
    return {
        "pairs": found.pairs,
        "targets": found.targets,
        "terms": terms,
        "noise": asdict(found.noise),
        "air_gain_m_per_km": found.air_gain_m_per_km,
        "directions": [asdict(each) for each in found.directions],
        "covariance": {"terms": found.errors.terms, "rows": found.errors.cov},
        "reference": found.reference,
        "sensor": found.sensor,
        "site": asdict(found.site) if found.site else None,
        "atmosphere": found.atmosphere,
        "dropped": found.dropped,
        "tables": {name: table.to_dicts() for name, table in found.tables.items()},
        "settings": found.settings,
        "remarks": found.remarks,
        "outputs": outputs,
    }
