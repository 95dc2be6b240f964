"""The engine that runs on the user's Dask cluster.

Dask does what it does well: it shares tasks out, does again what a lost worker had, and takes
workers that come later. Here is only what makes its failures readable, and what makes sure that
every number was made by the same boresight.
"""

import asyncio
import logging
import pickle
import re
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from importlib.metadata import version
from typing import Any

from boresight.errors import MissingExtraError, OutputError, UsageError
from boresight.laboratory.engines import Results, Work, finished

_PATIENCE_S = 5.0  # for a scheduler, or a first worker, to answer
# Dask loses a worker that cannot import what a message names, and the client is never told. So a
# message names nothing of ours, and what fails on a worker fails inside a task.
_ON_WORKER = "__import__('pickle').loads(work)(task)"
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^/\s]+:\d+")
_AHEAD = 4  # tasks for each thread of the cluster: the way there and back must not show


def dask(
    work: Work, tasks: Iterable[Any], *, scheduler: str, remark: Callable[[str], None]
) -> Results:
    """Run on the workers of a scheduler.

    Args:
        work: what each task is given to.
        tasks: any number.
        scheduler: its address, such as tcp://host:8786.
        remark: told what a reader of the results should know.

    Raises:
        MissingExtraError: Dask is not installed.
        OutputError: the scheduler does not answer, is lost, or has no workers; a worker has no
            boresight.
        UsageError: the address is none; a worker has another boresight.
    """
    with ExitStack() as stack:
        distributed = _distributed()
        stack.enter_context(_quiet())
        client = _connected(distributed, scheduler)
        stack.callback(client.close)
        ahead = max(64, _AHEAD * _threads(client, scheduler))
        try:
            sent = client.submit(bytes, _packed(partial(_on_worker, version("boresight"), work)))
            pool = client.get_executor(pure=False)
            stack.callback(pool.shutdown, wait=False)

            def submit(task: Any) -> "Future[Any]":
                given = {"work": sent, "task": pickle.dumps(task)}
                future: Future[Any] = pool.submit(eval, _ON_WORKER, given)
                return future

            levels = set()
            for task, (level, result) in finished(submit, tasks, ahead):
                levels.add(level)
                yield task, result
        except (Exception, CancelledError) as error:  # noqa: BLE001 - raised again, or explained
            raise _explained(error, scheduler) or error from None
        for sentence in _compared(levels):
            remark(sentence)


def _on_worker(wanted: str, work: Work, task: bytes) -> tuple[str, Any]:
    """Do a task on a worker: the level of its processor, and the result."""
    from boresight.laboratory.identity import processor

    if version("boresight") != wanted:
        raise UsageError(
            f"a worker has boresight {version('boresight')}, and {wanted} is here",
            why="two versions may give two answers",
            next_step=f"on every worker: pip install boresight=={wanted}",
        )
    return processor(), work(pickle.loads(task))  # noqa: S301 - of our own client


def _compared(levels: set[str]) -> Iterator[str]:
    """What to say of workers whose processors are of another kind than this one."""
    from boresight.laboratory.identity import processor

    if others := sorted(levels - {processor()}):
        yield (
            f"workers compute at level {', '.join(others)}, this machine at {processor()}: the "
            "last digits may differ from those of a run here, unless BORESIGHT_TARGET is set alike"
        )


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise MissingExtraError(
            "engine 'dask' needs Dask, which is not installed",
            next_step="pip install 'boresight[dask]'",
        ) from None
    return distributed


@contextmanager
def _quiet() -> Iterator[None]:
    """Dask's own log says on the terminal what is said here as one error."""
    names = [each for each in logging.root.manager.loggerDict if each.startswith("distributed")]
    loggers = [logging.getLogger(each) for each in (*names, "tornado.application")]
    levels = [each.level for each in loggers]
    for each in loggers:
        each.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for each, level in zip(loggers, levels, strict=True):
            each.setLevel(level)


def _connected(distributed: Any, scheduler: str) -> Any:
    """A client of the scheduler."""
    if not _ADDRESS.fullmatch(scheduler):
        raise UsageError(
            f"{scheduler!r} is no address of a scheduler",
            next_step="write it as --scheduler tcp://HOST:8786",
        )
    try:
        with ThreadPoolExecutor(1) as pool:  # a notebook's own thread has a loop already
            pool.submit(asyncio.run, _greeted(distributed, scheduler)).result()
        return distributed.Client(scheduler, timeout=_PATIENCE_S, set_as_default=False)
    except Exception as error:  # noqa: BLE001 - sockets, time-outs, foreign protocols
        raise OutputError(
            f"the scheduler at {scheduler} does not answer",
            why=_first_line(error),
            next_step=f"start it: dask scheduler --port {scheduler.rpartition(':')[2]}; "
            "or use --engine threads",
        ) from None


async def _greeted(distributed: Any, scheduler: str) -> None:
    """Whatever listens there answers as Dask does; a client would wait for that for ever."""
    arguments = distributed.Security().get_connection_args("client")
    try:
        async with asyncio.timeout(_PATIENCE_S):
            comm = await distributed.comm.connect(scheduler, timeout=_PATIENCE_S - 1.0, **arguments)
    except TimeoutError:
        raise OSError("what listens there does not speak as Dask does") from None
    await comm.close()


def _threads(client: Any, scheduler: str) -> int:
    """Number of threads of all workers, once there is a worker."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE_S)
    except TimeoutError:
        raise OutputError(
            f"the scheduler at {scheduler} has no workers",
            next_step=f"start one on each machine: dask worker {scheduler}",
        ) from None
    return sum(client.nthreads().values())


def _packed(work: Work) -> bytes:
    """Work as bytes; what cannot be imported elsewhere, such as a notebook's filter, by value."""
    from distributed.protocol.pickle import dumps

    try:
        data: bytes = dumps(work)  # type: ignore[no-untyped-call]
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise UsageError(
            "a filter of the study cannot be sent to the cluster",
            why=str(error),
            next_step="make its function use only what can be pickled",
        ) from None
    return data


def _explained(error: BaseException, scheduler: str) -> OutputError | None:
    """What befell the cluster; None for an error of the work itself."""
    from distributed import KilledWorker

    if isinstance(error, CancelledError):
        return OutputError(
            f"the scheduler at {scheduler} was lost",
            next_step="start it and its workers again, then repeat the command with --resume",
        )
    if isinstance(error, KilledWorker):
        return OutputError(
            "one task has ended several workers",
            why="a system short of memory ends processes; so does a fault in compiled code",
            next_step="look at the workers' output; then repeat the command with --resume",
        )
    if isinstance(error, ModuleNotFoundError):
        name = str(error.name).split(".")[0]
        return OutputError(
            f"{name} is not installed on a worker of {scheduler}",
            next_step=f"on every worker: pip install {name}; then repeat the command",
        )
    return None


def _first_line(error: BaseException) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
