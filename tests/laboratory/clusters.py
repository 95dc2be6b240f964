"""A real Dask scheduler and real workers, as a user starts them."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

HERE = str(Path(__file__).parent)
_DASK = (
    "import sys; {before}; from dask.__main__ import main; sys.argv = ['dask', *{words}]; main()"
)


def start(folder, name, words, before=""):
    """A `dask` command line in a session of its own; what it says goes to a file."""
    code = _DASK.format(before=before or "pass", words=repr(words))
    environment = os.environ | {"PYTHONPATH": HERE, "DASK_LOGGING__DISTRIBUTED": "info"}
    with (folder / f"{name}.log").open("wb") as log:
        return subprocess.Popen(
            [sys.executable, "-c", code],
            stdout=log,
            stderr=subprocess.STDOUT,
            env=environment,
            cwd=folder,
            start_new_session=True,
        )


def stop(process):
    """End a process and its children, which are the only ones of its session."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextmanager
def scheduler(folder):
    """A scheduler on a free port: its address and its process."""
    words = ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    process = start(folder, "scheduler", words)
    try:
        yield _address(folder / "scheduler.log", process), process
    finally:
        stop(process)


def worker(folder, address, name, before=""):
    """One worker process of one thread, without a nanny that would start it again."""
    words = ["worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard", "--name", name]
    words += ["--local-directory", str(folder / name), "--host", "127.0.0.1"]
    return start(folder, name, words, before)


@contextmanager
def cluster(folder, befores=("", "")):
    """A scheduler and a worker for each of `befores`, code that a worker runs first."""
    with scheduler(folder) as (address, process):
        workers = [worker(folder, address, f"w{i}", each) for i, each in enumerate(befores)]
        try:
            yield address, process, workers
        finally:
            for each in workers:
                stop(each)


def _address(log, process):
    end = time.monotonic() + 30.0
    while time.monotonic() < end and process.poll() is None:
        if found := re.search(r"Scheduler at:\s+(tcp://\S+)", log.read_text()):
            return found.group(1)
        time.sleep(0.05)
    pytest.fail(f"the scheduler did not start: {log.read_text()}")
