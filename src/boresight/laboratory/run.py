"""A study run from end to end: chunks to an engine, scores to a tally and a folder, a result."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from boresight.errors import UsageError
from boresight.filters.method import Outside
from boresight.laboratory.checkpoints import Checkpoints
from boresight.laboratory.engines import EngineName, choose, processors
from boresight.laboratory.gather import Tally
from boresight.laboratory.identity import digest, identity
from boresight.laboratory.result import StudyResult
from boresight.laboratory.scores import Scores
from boresight.laboratory.study import Study
from boresight.laboratory.summary import summarise
from boresight.laboratory.trial import run_chunk

# Steps of a chunk: some 0.1 s of a kernel; arrays of a filter outside, which holds them all.
_STEPS, _STEPS_OUTSIDE = 1 << 20, 1 << 14
# A chunk costs a millisecond by itself: with fewer steps it would show in a filter's time.
_LEAST, _LEAST_STEPS = 64, 1 << 17


class Chunk(NamedTuple):
    """Runs [first, first + runs) of a cell."""

    cell: tuple[int, int]
    first: int
    runs: int


def run_study(
    study: Study,
    *,
    engine: EngineName = "threads",
    workers: int | None = None,
    scheduler: str | None = None,
    chunk: int | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    progress: Callable[[float, float], None] = lambda _done, _total: None,
) -> StudyResult:
    """Run every cell of a study and say what was found.

    The result does not depend on the engine, the workers, the chunks or on interruptions, to the
    last bit; its `digest` shows it.

    Args:
        study: what to run.
        engine: `threads`, `processes` (for filters in Python) or `dask`.
        workers: number of threads or processes; every processor's, if None.
        scheduler: address of the Dask scheduler, tcp://host:port.
        chunk: runs that are done at a time; chosen by the size of a run, if None.
        folder: where checkpoints are kept; None: nowhere.
        resume: go on from what the folder holds.
        progress: told how many runs are done, of how many, over all cells.

    Raises:
        UsageError: options that do not fit; a folder that holds an unfinished or another study; a
            filter that cannot be sent to a process, or that fails.
        MissingExtraError: Dask is not installed.
        OutputError: the folder cannot be written; the scheduler does not answer, or is lost.
    """
    _check_whole(chunk=chunk, workers=workers)
    if resume and folder is None:
        raise UsageError("there is no folder to resume from", next_step="give it: folder=...")
    remarks: list[str] = []
    spread = choose(engine, workers=workers, scheduler=scheduler, remark=remarks.append)
    tallies = {cell: Tally(study.runs) for cell in study.cells}
    kept = _opened(study, folder, resume=resume, remark=remarks.append)
    for cell, scores in kept.read() if kept else ():
        tallies[cell].add(scores)
    done, total = sum(each.count for each in tallies.values()), study.runs * len(tallies)
    progress(done, total)
    tasks = _tasks(study, tallies, chunk, workers or processors())
    try:
        with closing(spread(partial(_work, study), tasks)) as results:
            for task, scores in results:
                tallies[task.cell].add(scores)
                if kept:
                    kept.keep(task.cell, scores)
                done += task.runs
                progress(done, total)
    finally:
        if kept:
            kept.flush()
    if kept:
        kept.finish()
    found = summarise(study, [tallies[cell].gathered() for cell in study.cells])
    return replace(found, digest=digest(found.cells), remarks=(*found.remarks, *remarks))


def _check_whole(*, chunk: int | None, workers: int | None) -> None:
    for name, value in (("chunk", chunk), ("workers", workers)):
        if value is not None and not isinstance(value, int):
            raise UsageError(f"{name}={value!r} is not a whole number")
    if chunk is not None and chunk < 1:
        raise UsageError(f"chunk={chunk} is less than one run", next_step="give at least 1")


def _opened(
    study: Study, folder: str | Path | None, *, resume: bool, remark: Callable[[str], None]
) -> Checkpoints | None:
    if folder is None:
        return None
    return Checkpoints(Path(folder), study.name, identity(study), resume=resume, remark=remark)


def _tasks(
    study: Study, tallies: Mapping[tuple[int, int], Tally], chunk: int | None, workers: int
) -> Iterator[Chunk]:
    """What is missing, cell by cell."""
    for cell, tally in tallies.items():
        for first, count in tally.missing(chunk or _usual(study, cell, workers)):
            yield Chunk(cell, first, count)


def _usual(study: Study, cell: tuple[int, int], workers: int) -> int:
    """A power of two of runs: enough to be worth the way, few enough to keep all at work."""
    setting = study.settings[cell[0]]
    is_outside = isinstance(setting.contenders[cell[1]].filter, Outside)
    fits = (_STEPS_OUTSIDE if is_outside else _STEPS) // setting.scenario.scans
    shared = study.runs * len(study.cells) // (4 * workers)
    least = _LEAST if is_outside else max(_LEAST, _LEAST_STEPS // setting.scenario.scans)
    return 1 << (max(least, min(fits, shared)).bit_length() - 1)


def _work(study: Study, task: Chunk) -> Scores:
    setting = study.settings[task.cell[0]]
    return run_chunk(study, setting, setting.contenders[task.cell[1]], task.first, task.runs)
