"""Engines: the same work, few tasks at a time, clear failures, nothing left behind."""

import os
import socket
import subprocess
import sys
import time
from contextlib import closing
from functools import partial
from itertools import count
from pathlib import Path

import clusters
import engine_study
import engine_work
import pytest

from boresight.errors import MissingExtraError, OutputError, UsageError
from boresight.laboratory import cluster
from boresight.laboratory.engines import choose
from boresight.laboratory.run import run_study

LOCAL = ("threads", "processes")


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    """Address of a scheduler with two workers."""
    with clusters.cluster(tmp_path_factory.mktemp("dask")) as (address, _, _):
        yield address


@pytest.fixture(scope="module")
def one_thread():
    """The digest of the small study on one thread."""
    return run_study(engine_study.make(), workers=1).digest


def is_alive(pid):
    """Whether a process runs; one that has ended but was not asked for yet does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


# one digest


CHUNKS = [pytest.param(1, marks=pytest.mark.slow), 7, pytest.param(100, marks=pytest.mark.slow)]


@pytest.mark.parametrize("chunk", [*CHUNKS, None])
@pytest.mark.parametrize("engine", LOCAL)
def test_digest_does_not_depend_on_engine_and_chunk(engine, chunk, one_thread):
    found = run_study(engine_study.make(), engine=engine, workers=2, chunk=chunk)
    assert found.digest == one_thread


@pytest.mark.parametrize("chunk", CHUNKS)
def test_digest_is_the_same_on_a_cluster(chunk, dask, one_thread):
    found = run_study(engine_study.make(), engine="dask", scheduler=dask, chunk=chunk)
    assert found.digest == one_thread


def test_another_seed_has_another_digest(one_thread):
    assert run_study(engine_study.make(seed=6)).digest != one_thread


# what every engine does


@pytest.mark.parametrize("engine", LOCAL)
def test_every_task_comes_back_with_its_result(engine):
    found = dict(choose(engine, workers=3)(engine_work.square, range(500)))
    assert found == {i: i * i for i in range(500)}


def test_cluster_brings_every_task_back(dask):
    found = dict(choose("dask", scheduler=dask)(engine_work.square, range(100)))
    assert found == {i: i * i for i in range(100)}


@pytest.mark.parametrize("engine", LOCAL)
def test_few_tasks_are_under_way(engine):
    taken = []
    tasks = (taken.append(i) or i for i in count())
    with closing(choose(engine, workers=2)(engine_work.square, tasks)) as results:
        for _ in range(10):
            next(results)
    assert len(taken) <= 10 + 2 * 2


def test_few_tasks_are_under_way_on_a_cluster(dask):
    taken = []
    tasks = (taken.append(i) or i for i in count())
    with closing(choose("dask", scheduler=dask)(engine_work.square, tasks)) as results:
        for _ in range(10):
            next(results)
    assert len(taken) <= 10 + 64


def test_processes_and_workers_share_the_work(dask):
    for engine in (choose("processes", workers=2), choose("dask", scheduler=dask)):
        found = dict(engine(engine_work.whose, range(40)))
        assert len({pid for _, pid in found.values()} - {os.getpid()}) == 2


@pytest.mark.parametrize("engine", LOCAL)
def test_an_error_of_the_work_comes_up(engine):
    with pytest.raises(ValueError, match="three is wrong"):
        dict(choose(engine, workers=2)(engine_work.fragile, range(10)))


def test_an_error_of_the_work_comes_up_from_a_cluster(dask):
    with pytest.raises(ValueError, match="three is wrong"):
        dict(choose("dask", scheduler=dask)(engine_work.fragile, range(10)))


# processes


def test_what_a_filter_prints_is_not_in_the_way(capfd):
    assert len(dict(choose("processes", workers=2)(engine_work.chatty, range(20)))) == 20
    assert "what a filter prints" in capfd.readouterr().err


def test_an_error_that_cannot_travel_is_told_in_words():
    with pytest.raises(RuntimeError, match="OddError: strange"):
        dict(choose("processes", workers=1)(engine_work.odd, range(2)))


def test_a_killed_process_is_said():
    with pytest.raises(OutputError, match="signal 9") as caught:
        dict(choose("processes", workers=2)(engine_work.dies, range(10)))
    assert caught.value.exit_code == 74


@pytest.mark.parametrize("work", [lambda x: x, partial(lambda x: x)], ids=["lambda", "partial"])
def test_a_lambda_is_refused_with_the_way_out(work):
    with pytest.raises(UsageError, match=r"lambda.*cannot be sent") as caught:
        dict(choose("processes", workers=1)(work, range(2)))
    assert "module" in caught.value.next_step


def test_a_function_of_the_script_is_refused(monkeypatch):
    monkeypatch.setattr(engine_work.square, "__module__", "__main__")
    with pytest.raises(UsageError, match="square cannot be sent"):
        dict(choose("processes", workers=1)(engine_work.square, range(2)))


def test_what_cannot_be_pickled_is_refused():
    with socket.socket() as held, pytest.raises(UsageError, match="cannot be sent"):
        dict(choose("processes", workers=1)(partial(engine_work.square, held), range(2)))


def test_a_script_without_a_guard_may_use_processes(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "from boresight.laboratory.engines import choose\nimport engine_work\n"
        "print(sum(r for _, r in choose('processes', workers=2)(engine_work.square, range(9))))\n"
    )
    environment = os.environ | {"PYTHONPATH": clusters.HERE}
    done = subprocess.run(
        [sys.executable, script], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("204\n", "")


def test_an_interrupt_of_the_terminal_does_not_reach_processes():
    found = dict(choose("processes", workers=2)(engine_work.group, range(4)))
    assert os.getpgrp() not in found.values()


@pytest.mark.parametrize("how", ["closed", "killed"])
def test_no_process_outlives_its_parent(how, tmp_path):
    if how == "closed":
        engine = choose("processes", workers=2)
        results = engine(partial(engine_work.ever_longer, tmp_path), count())
        next(results)
        begun = time.monotonic()
        results.close()
        assert time.monotonic() - begun < 10.0  # and not the minute that a task takes by now
    else:
        code = (
            "from functools import partial; from itertools import count; import engine_work\n"
            "from boresight.laboratory.engines import choose\n"
            f"work = partial(engine_work.leaves_name, {str(tmp_path)!r})\n"
            "for _ in choose('processes', workers=2)(work, count()): pass"
        )
        environment = os.environ | {"PYTHONPATH": clusters.HERE}
        parent = subprocess.Popen([sys.executable, "-c", code], env=environment)
        until(lambda: len([*tmp_path.iterdir()]) == 2)
        parent.kill()
        parent.wait()
    pids = [int(each.name) for each in tmp_path.iterdir()]
    assert pids
    until(lambda: not any(map(is_alive, pids)))


def until(condition, seconds=20.0):
    """Wait for something that must come true."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come true"
        time.sleep(0.02)


# options


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"name": "thread"}, "did you mean 'threads'"),
        ({"name": "threads", "workers": 0}, "workers=0"),
        ({"name": "threads", "scheduler": "tcp://a:1"}, "has no scheduler"),
        ({"name": "dask"}, "needs a scheduler"),
        ({"name": "dask", "scheduler": "tcp://a:1", "workers": 2}, "workers=2"),
    ],
)
def test_options_that_do_not_fit_are_refused(given, words):
    with pytest.raises(UsageError, match=words) as caught:
        choose(**given)
    assert caught.value.next_step


# clusters that fail


def message(engine, work=engine_work.square, tasks=range(20)):
    """The error of an engine, and how long it took."""
    begun = time.monotonic()
    with pytest.raises((OutputError, UsageError)) as caught:
        dict(engine(work, tasks))
    return caught.value, time.monotonic() - begun


@pytest.mark.parametrize("listens", [False, True])
def test_a_scheduler_that_does_not_answer(listens, capfd, monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE_S", 2.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        if not listens:
            silent.close()
        error, seconds = message(choose("dask", scheduler=f"tcp://127.0.0.1:{port}"))
    assert error.exit_code == 74
    assert f"dask scheduler --port {port}" in error.next_step
    assert seconds < 8.0
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("address", ["nonsense", "tcp://", "http://localhost:80", "localhost:1"])
def test_what_is_no_address_is_refused(address):
    error, _ = message(choose("dask", scheduler=address))
    assert error.exit_code == 2
    assert "tcp://HOST:8786" in error.next_step


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError) as caught:
        dict(choose("dask", scheduler="tcp://127.0.0.1:1")(engine_work.square, range(2)))
    assert caught.value.exit_code == 69
    assert caught.value.next_step == "pip install 'boresight[dask]'"


@pytest.mark.slow
def test_a_scheduler_without_workers_and_one_that_is_lost(tmp_path, capfd):
    with clusters.cluster(tmp_path, ()) as (address, process, workers):
        error, _ = message(choose("dask", scheduler=address))
        assert error.exit_code == 74
        assert f"dask worker {address}" in error.next_step
        workers.append(clusters.worker(tmp_path, address, "w"))
        results = choose("dask", scheduler=address)(engine_work.whose, count())
        next(results)
        process.kill()
        with pytest.raises(OutputError, match="was lost") as caught:
            for _ in results:
                pass
    assert "--resume" in caught.value.next_step
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_lost_worker_s_tasks_are_done_again(tmp_path):
    with clusters.cluster(tmp_path) as (address, _, _):
        work = partial(engine_work.dies_once, str(tmp_path / "died"))
        found = dict(choose("dask", scheduler=address)(work, range(50)))
    assert (tmp_path / "died").exists()
    assert found == {i: i for i in range(50)}


_NO_BORESIGHT = "sys.modules['boresight'] = None"
_OLD = (
    "import importlib.metadata as m; real = m.version; "
    "m.version = lambda name: '0.0.7' if name == 'boresight' else real(name)"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("befores", "words"),
    [
        ((_NO_BORESIGHT,), "boresight is not installed on a worker"),
        (("", _NO_BORESIGHT), "boresight is not installed on a worker"),
        (("", _OLD), "a worker has boresight 0.0.7"),
    ],
    ids=["none", "one without", "one older"],
)
def test_workers_that_are_not_like_us_are_said(befores, words, tmp_path):
    with clusters.cluster(tmp_path, befores) as (address, _, workers):
        engine = choose("dask", scheduler=address)
        until(lambda: all("Registered to" in _log(tmp_path, i) for i in range(len(workers))))
        error, _ = message(engine, engine_work.whose, range(200))
    assert words in str(error)
    assert "pip install boresight" in error.next_step


def _log(folder, i):
    return (folder / f"w{i}.log").read_text()


@pytest.mark.slow
def test_another_kind_of_processor_is_remarked(tmp_path):
    remarks = []
    before = "import os; os.environ['BORESIGHT_TARGET'] = 'numpy'"
    with clusters.cluster(tmp_path, (before,)) as (address, _, _):
        dict(choose("dask", scheduler=address, remark=remarks.append)(engine_work.square, [1]))
    assert len(remarks) == 1
    assert "level numpy" in remarks[0]
