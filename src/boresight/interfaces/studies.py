"""The verb `compare`: a study, from a file or made in Python, run and judged."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from boresight.errors import UsageError
from boresight.filters.method import Filter, Outside
from boresight.laboratory.study import Contender, Study

if TYPE_CHECKING:
    from boresight.laboratory.result import StudyResult

Engine = Literal["threads", "processes", "dask"]


def compare(
    study: "str | PathLike[str] | Mapping[str, Any] | Study",
    *,
    filters: "Sequence[str | Filter | Outside] | None" = None,
    runs: int | None = None,
    seed: int | None = None,
    engine: Engine = "threads",
    workers: int | None = None,
    scheduler: str | None = None,
    chunk: int | None = None,
    folder: str | PathLike[str] | None = None,
    resume: bool = False,
) -> "StudyResult":
    """Run a study and judge it: errors against the bound, consistency, who is better than whom.

    Args:
        study: a `study.toml`, the same as a dictionary, or a `Study`.
        filters: who competes, instead of or beside what the study says: names of the catalogue, a
            `bs.Filter`, or a `bs.Outside`. They believe what the study's first filter believes of
            the world.
        runs: of each cell, instead of the study's.
        seed: instead of the study's.
        engine: `threads` of this process, `processes` of this machine, or a `dask` cluster. The
            numbers are the same to the last bit, on one kind of processor.
        workers: how many threads or processes; left out, as many as there are cores.
        scheduler: of the Dask cluster, tcp://host:port.
        chunk: runs done at once; the numbers do not depend on it.
        folder: where finished chunks are kept.
        resume: go on with what the folder holds.

    Returns:
        The result; `.table`, `.every_run` and `.every_scan` are Polars frames, `bs.report(result)`
        is its page, and a notebook shows it.

    Raises:
        UsageError: every mistake of the study at once.
        OutputError: the folder cannot be written; the scheduler does not answer.
    """
    from boresight.laboratory.run import run_study

    return run_study(
        prepared(study, filters=filters, runs=runs, seed=seed),
        engine=engine,
        workers=workers,
        scheduler=scheduler,
        chunk=chunk,
        folder=None if folder is None else Path(folder),
        resume=resume,
    )


def prepared(
    study: "str | PathLike[str] | Mapping[str, Any] | Study",
    *,
    filters: "Sequence[str | Filter | Outside] | None" = None,
    runs: int | None = None,
    seed: int | None = None,
) -> Study:
    """A study that is ready to run, whatever it was given as."""
    from boresight.laboratory.study_file import read_study, study_from, with_draws

    if isinstance(study, Study):
        found = study
    elif isinstance(study, Mapping):
        found = study_from(study)
    elif isinstance(study, str | PathLike):
        found = read_study(Path(fspath(study)))
    else:
        raise UsageError(
            f"a {type(study).__name__} is no study",
            next_step='give a study.toml, or {"scenario": "kashyap-set-2", "filter": ["ekf"]}',
        )
    found = with_draws(found, runs=runs, seed=seed)
    return found if filters is None else _with_filters(found, filters)


def _with_filters(study: Study, filters: "Sequence[str | Filter | Outside]") -> Study:
    """The study with these competing too; one of a name that competes already takes its place."""
    from boresight import catalogue

    named = [filters] if isinstance(filters, str | Filter | Outside) else filters
    wanted = [catalogue.lookup(each) if isinstance(each, str) else each for each in named]
    for each in wanted:
        if not isinstance(each, Filter | Outside):
            raise UsageError(
                f"a {type(each).__name__} is no filter",
                next_step='give a name such as "ekf", a bs.Filter or a bs.Outside',
            )
    settings = []
    for setting in study.settings:
        first = setting.contenders[0]
        added = [
            Contender(
                label=each.name,
                filter=each,
                motion=first.motion,
                sensor=first.sensor,
                gate=first.gate,
            )
            for each in wanted
        ]
        names = {each.label for each in added}
        kept = [each for each in setting.contenders if each.label not in names]
        settings.append(replace(setting, contenders=(*kept, *added)))
    return replace(study, settings=tuple(settings))
