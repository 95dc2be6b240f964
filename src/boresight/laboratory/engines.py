"""Engines: one function over many tasks, on threads, on processes or on a Dask cluster.

An engine takes work and any number of tasks, and yields each task with its result as it finishes,
in any order. Tasks are handed over a few at a time, so a million of them are never held at once.
Whoever stops listening closes the iterator: nothing new is begun, and no process is left behind.

The processes are not those of `multiprocessing`, which runs the caller's script again in each: a
notebook, or a script without a guard, would then fail. Each is an interpreter that talks through
its standard input and output. An interrupt of the terminal does not reach it, and it ends when its
input does, so also when its parent is killed.
"""

import os
import pickle
import subprocess
import sys
import traceback
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, suppress
from functools import partial
from io import BytesIO
from itertools import islice
from queue import SimpleQueue
from typing import Any, Literal, NoReturn, Self, get_args

from boresight.errors import BoresightError, OutputError, UsageError, unknown

EngineName = Literal["threads", "processes", "dask"]
ENGINES: tuple[EngineName, ...] = get_args(EngineName)
Work = Callable[[Any], Any]
Results = Generator[tuple[Any, Any], None, None]  # tasks with what came of them; can be closed
Engine = Callable[[Work, Iterable[Any]], Results]

_CHILD = (
    "import pickle, sys; sys.path[:] = pickle.load(sys.stdin.buffer); "
    "from boresight.laboratory.engines import serve; serve()"
)
_ALONE = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def choose(
    name: str,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    remark: Callable[[str], None] = lambda _: None,
) -> Engine:
    """The engine of a name.

    Args:
        name: `threads`, `processes` or `dask`.
        workers: number of threads or processes; every processor's, if None.
        scheduler: address of a Dask scheduler, such as tcp://host:8786.
        remark: told what a reader of the results should know.

    Raises:
        UsageError: an unknown name, or options that do not go with it.
    """
    if name not in ENGINES:
        raise unknown("engine", name, ENGINES)
    if name == "dask":
        return _dask(workers, scheduler, remark)
    if scheduler is not None:
        raise UsageError(
            f"engine {name!r} has no scheduler",
            next_step=f"add --engine dask to use {scheduler}, or leave --scheduler out",
        )
    if workers is not None and workers < 1:
        raise UsageError(f"workers={workers} is less than one", next_step="give at least 1")
    return partial(_LOCAL[name], workers=workers or processors())


def _dask(workers: int | None, scheduler: str | None, remark: Callable[[str], None]) -> Engine:
    from boresight.laboratory.cluster import dask

    if scheduler is None:
        raise UsageError(
            "engine 'dask' needs a scheduler",
            next_step="start one with `dask scheduler`, then add --scheduler tcp://HOST:8786",
        )
    if workers is not None:
        raise UsageError(
            f"workers={workers} has no meaning on a cluster, which has its own",
            next_step=f"leave --workers out; start more with `dask worker {scheduler}`",
        )
    return partial(dask, scheduler=scheduler, remark=remark)


def processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def finished(submit: Callable[[Any], "Future[Any]"], tasks: Iterable[Any], ahead: int) -> Results:
    """Each task with its result, as it comes; at most `ahead` of them are under way."""
    left = iter(tasks)
    waiting: dict[Future[Any], Any] = {}
    while True:
        for task in islice(left, ahead - len(waiting)):
            waiting[submit(task)] = task
        if not waiting:
            return
        for future in wait(waiting, return_when=FIRST_COMPLETED).done:
            yield waiting.pop(future), future.result()


def threads(work: Work, tasks: Iterable[Any], *, workers: int) -> Results:
    """Run on threads of this process; compiled kernels let one another run."""
    pool = ThreadPoolExecutor(workers, thread_name_prefix="boresight-study")
    try:
        yield from finished(lambda task: pool.submit(work, task), tasks, 2 * workers)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def processes(work: Work, tasks: Iterable[Any], *, workers: int) -> Results:
    """Run on processes of this machine: for filters in Python, which threads do not speed up.

    Raises:
        UsageError: the work cannot be sent to another process.
        OutputError: a process ended before its work did.
    """
    data = portable(work)
    with ExitStack() as stack:
        idle: SimpleQueue[_Child] = SimpleQueue()
        for _ in range(workers):
            idle.put(stack.enter_context(_Child(data)))
        yield from threads(partial(_ask, idle), tasks, workers=workers)


def portable(work: Work) -> bytes:
    """Work as bytes that another interpreter understands.

    Raises:
        UsageError: it holds something that no other interpreter could find or take.
    """
    file = BytesIO()
    try:
        _Pickler(file).dump(work)
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise _not_portable("a filter of the study", str(error)) from None
    return file.getvalue()


class _Pickler(pickle.Pickler):
    """Refuses by name what another interpreter could not import."""

    def persistent_id(self, obj: Any) -> None:
        name = getattr(obj, "__qualname__", "")
        if isinstance(name, str) and name:
            if obj.__module__ == "__main__":
                raise _not_portable(name, "it stands in the script or notebook that is run")
            if "<" in name:
                raise _not_portable(name, "it has no name that could be imported")


def _not_portable(name: str, why: str) -> UsageError:
    return UsageError(
        f"{name} cannot be sent to another process",
        why=why,
        next_step="move it to the top level of a module and import it, or use engine 'threads'",
    )


def _ask(idle: "SimpleQueue[_Child]", task: Any) -> Any:
    """Have whichever process is idle do the task; there are as many as threads that ask."""
    child = idle.get()
    try:
        return child.ask(task)
    finally:
        idle.put(child)


class _Child:
    """A process that does one task at a time."""

    def __init__(self, work: bytes) -> None:
        environment = dict.fromkeys(_ALONE, "1") | os.environ  # processes share the processors
        self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and code
            [sys.executable, "-c", _CHILD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            start_new_session=True,  # an interrupt is its parent's to handle
        )
        self._inward: Any = self._process.stdin
        self._outward: Any = self._process.stdout
        self._parts = [pickle.dumps(sys.path), work]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End it, whatever it is doing."""
        with suppress(OSError), self._process:  # what it was not told yet cannot be told any more
            self._process.kill()

    def ask(self, task: Any) -> Any:
        """What the work makes of a task; an error of the work is raised here."""
        self._parts.append(pickle.dumps(task))
        try:
            self._inward.write(b"".join(self._parts))
            self._inward.flush()
            self._parts.clear()
            is_done, answer = pickle.load(self._outward)  # noqa: S301 - of our own child
        except (OSError, EOFError, pickle.UnpicklingError):
            raise self._lost() from None
        if not is_done:
            raise answer
        return answer

    def _lost(self) -> OutputError:
        status = self._process.wait()
        how = f"signal {-status}" if status < 0 else f"exit status {status}"
        return OutputError(
            "a process ended before its work did",
            why=f"{how}; a system short of memory ends processes with signal 9",
            next_step="start again with fewer --workers, and --resume to keep what is done",
        )


def serve() -> None:
    """Do the tasks that a parent sends on standard input, until it ends: what `_CHILD` runs."""
    inward, outward = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a filter prints must not get between the answers
    try:
        work = pickle.load(inward)  # noqa: S301 - of our own parent
    except Exception as error:  # noqa: BLE001 - told where the answer is awaited
        work = partial(_fail, error)
    try:
        while True:
            task = pickle.load(inward)  # noqa: S301 - of our own parent
            outward.write(_answer(work, task))
            outward.flush()
    except (EOFError, OSError):
        os._exit(0)  # nobody listens any more


def _answer(work: Work, task: Any) -> bytes:
    try:
        return pickle.dumps((True, work(task)))
    except Exception as error:  # noqa: BLE001 - raised again by whoever asked
        if not isinstance(error, BoresightError):
            error.add_note(f"in a process of the pool:\n{traceback.format_exc()}")
        return _sendable(error)


def _sendable(error: Exception) -> bytes:
    """An error as an answer; one that does not survive the way is told in words."""
    try:
        data = pickle.dumps((False, error))
        pickle.loads(data)  # noqa: S301 - just written: some errors are pickled but not read again
    except Exception:  # noqa: BLE001 - whatever a user's own error does
        return pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))
    return data


def _fail(error: Exception, _: Any) -> NoReturn:
    raise error


_LOCAL = {"threads": threads, "processes": processes}
