"""The work of `boresight compare` and `boresight simulate`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from boresight.errors import UsageError
from boresight.interfaces import door, screens_study
from boresight.interfaces.answers import Answer
from boresight.interfaces.studies import prepared
from boresight.interfaces.terminal import Manner, progress, remark

if TYPE_CHECKING:
    from boresight.laboratory.result import StudyResult

REPORT = "report.html"
CELLS, RUNS, SCANS = "cells.parquet", "runs.parquet", "scans.parquet"


def compare(
    file: Path,
    manner: Manner,
    *,
    runs: int | None,
    seed: int | None,
    folder: Path | None,
    engine: Literal["local", "threads", "processes", "dask"],
    **how: Any,
) -> Answer:
    """Run a study; with a folder, keep what is done, and write the tables and the report."""
    from boresight.laboratory.run import run_study

    if how.get("resume") and not folder:
        raise UsageError(
            "--resume goes on with what a folder holds, and none is named",
            next_step=f"boresight compare {file} --resume -o DIR",
        )
    study = prepared(file, runs=runs, seed=seed)
    target = door.folder(folder) if folder else None
    name = "threads" if engine == "local" else engine
    try:
        with progress(f"Comparing, {study.name}", manner) as watch:
            result = run_study(study, engine=name, folder=target, progress=watch.count, **how)
    except KeyboardInterrupt:
        if target and not manner.is_quiet:
            again = manner.command if how.get("resume") else f"{manner.command} --resume"
            remark([f"Interrupted; what is done is kept, go on with: {again}"])
        raise
    outputs = write(result, target, manner) if target else []
    return Answer(
        content=content(result, outputs),
        screen=lambda width: screens_study.studied(result, outputs, width),
        remarks=result.remarks,
    )


def write(result: "StudyResult", folder: Path, manner: Manner) -> list[str]:
    """Write the report, and tables of cells, runs and scans; return the paths."""
    from boresight.formats.output import write_table
    from boresight.interfaces.report import report

    with progress("Writing", manner):
        page = report(study=result, command=manner.command)
        tables = {CELLS: result.table, RUNS: result.every_run, SCANS: result.every_scan}
        paths = [page.save(folder / REPORT)]
        paths += [write_table(table, folder / name, "study") for name, table in tables.items()]
    return [str(path) for path in paths]


def content(result: "StudyResult", outputs: list[str]) -> dict[str, Any]:
    """The object that `boresight compare --json` prints."""
    from boresight.laboratory.frames import row_of

    return {
        "study": result.study.name,
        "cells": [row_of(result, cell) for cell in result.cells],
        "comparisons": [
            {
                "settings": dict(result.study.settings[each.setting].values),
                "better": each.better,
                "other": each.other,
                "ratio": each.ratio.value,
                "ratio_low": each.ratio.low,
                "ratio_high": each.ratio.high,
                "win": each.is_win,
            }
            for each in result.comparisons
        ],
        "runs": result.study.runs,
        "seed": result.study.seed,
        "sha256": result.digest,
        "remarks": list(result.remarks),
        "outputs": outputs,
    }


def simulate(
    file: Path, manner: Manner, *, runs: int | None, seed: int | None, folder: Path
) -> Answer:
    """Write the truth and the plots of a study."""
    from boresight.interfaces.report.words import count
    from boresight.interfaces.screens import text, written
    from boresight.laboratory.tables import study_tables

    study = prepared(file, runs=runs, seed=seed)
    target = door.folder(folder)
    with progress(f"Simulating, {study.name}", manner) as watch:
        outputs = [str(path) for path in study_tables(study, target, progress=watch.count)]
    found = {"outputs": outputs, "runs": study.runs, "seed": study.seed}
    many = f"{count(study.runs, 'run')} of {count(len(study.settings), 'setting')}"
    head = f"{study.name}: {many}, seed {study.seed}"
    return Answer(content=found, screen=lambda _width: [text(head, "bold"), *written(outputs)])
