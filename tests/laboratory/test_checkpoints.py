"""Checkpoints: whatever stops a study, and whatever befalls its files, it ends with one digest."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import engine_study
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import OutputError, UsageError
from boresight.laboratory import checkpoints, run
from boresight.laboratory.identity import differences, digest, identity
from boresight.laboratory.run import run_study

STUDY = engine_study.make(runs=40)


@pytest.fixture(scope="module")
def whole():
    """The digest of the small study, never stopped."""
    return run_study(STUDY).digest


class Stopped(KeyboardInterrupt):
    """What a user's Ctrl-C raises, at a chosen moment."""


@contextmanager
def counted(monkeypatch, stop_after=None):
    """How many runs are computed; Ctrl-C after so many chunks."""
    done = []

    def chunk(study, setting, contender, first, count):
        done.append(count)
        if len(done) == stop_after:
            raise Stopped
        return real(study, setting, contender, first, count)

    real = run.run_chunk
    with monkeypatch.context() as patch:
        patch.setattr(run, "run_chunk", chunk)
        yield done


def stopped(folder, monkeypatch, study=STUDY, chunk=3, after=12):
    """A folder of a study that was stopped."""
    with counted(monkeypatch, after), pytest.raises(Stopped):
        run_study(study, folder=folder, chunk=chunk, workers=1)
    return folder


# going on


@pytest.mark.parametrize("chunk", [1, 7, 100])
def test_only_what_is_missing_is_done(chunk, tmp_path, monkeypatch, whole):
    stopped(tmp_path, monkeypatch)
    told = []
    with counted(monkeypatch) as done:
        found = run_study(
            STUDY, folder=tmp_path, resume=True, chunk=chunk, progress=lambda *at: told.append(at)
        )
    assert found.digest == whole
    assert told[0] == (80 - sum(done), 80)
    assert told[-1] == (80, 80)
    assert 30 <= told[0][0] < 80  # eleven chunks of three came before the stop


def test_a_study_goes_on_with_more_runs_and_with_fewer(tmp_path, monkeypatch, whole):
    run_study(engine_study.make(runs=24), folder=tmp_path)
    with counted(monkeypatch) as done:
        assert run_study(STUDY, folder=tmp_path, resume=True).digest == whole
    assert sum(done) == 2 * (40 - 24)
    fewer = engine_study.make(runs=30)
    assert run_study(fewer, folder=tmp_path, resume=True).digest == run_study(fewer).digest


def test_nothing_to_resume_is_remarked(tmp_path, whole):
    found = run_study(STUDY, folder=tmp_path / "new", resume=True)
    assert found.digest == whole
    assert "nothing to resume" in found.remarks[-1]


def test_small_chunks_do_not_make_many_files(tmp_path):
    run_study(STUDY, folder=tmp_path, chunk=1)
    assert len([*tmp_path.iterdir()]) < 10


# not losing what is there


def test_an_unfinished_study_is_not_overwritten(tmp_path, monkeypatch):
    stopped(tmp_path, monkeypatch)
    before = {each.name: each.read_bytes() for each in tmp_path.iterdir()}
    with pytest.raises(UsageError, match="not finished") as caught:
        run_study(STUDY, folder=tmp_path)
    assert "--resume" in caught.value.next_step
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == before


def test_a_finished_study_may_be_followed_by_another(tmp_path, whole):
    other = engine_study.make(seed=9)
    run_study(other, folder=tmp_path)
    (tmp_path / "mine.txt").write_text("a user's own")
    assert run_study(STUDY, folder=tmp_path).digest == whole
    assert (tmp_path / "mine.txt").exists()
    assert run_study(STUDY, folder=tmp_path, resume=True).digest == whole


def test_another_study_is_refused_and_what_differs_is_said(tmp_path, monkeypatch):
    stopped(tmp_path, monkeypatch)
    with pytest.raises(UsageError, match="another study") as caught:
        run_study(engine_study.make(seed=6), folder=tmp_path, resume=True)
    assert caught.value.why == "seed is 5 there, 6 here"


def test_a_file_of_another_study_is_ignored(tmp_path, monkeypatch, whole):
    stopped(tmp_path / "one", monkeypatch)
    stopped(tmp_path / "other", monkeypatch, engine_study.make(runs=40, seed=6))
    for each in (tmp_path / "other").glob("runs-*.npz"):
        shutil.copy(each, tmp_path / "one")
    found = run_study(STUDY, folder=tmp_path / "one", resume=True)
    assert found.digest == whole
    assert "another study" in found.remarks[-1]


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written"):
        run_study(STUDY, folder=tmp_path / "file" / "below")


@pytest.mark.parametrize(
    ("given", "words"), [({"resume": True}, "no folder"), ({"chunk": 0}, "chunk=0")]
)
def test_options_that_do_not_fit_are_refused(given, words):
    with pytest.raises(UsageError, match=words):
        run_study(STUDY, **given)


# damaged files


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The files of a stopped study, by name: several of runs, and what it says of itself."""
    folder = tmp_path_factory.mktemp("stopped")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(checkpoints, "_MOST_BYTES", 1)  # every chunk a file
        stopped(folder, patch, chunk=8, after=7)
    found = {each.name: each.read_bytes() for each in sorted(folder.iterdir())}
    assert len(found) >= 5
    return found


@given(st.data())
def test_no_damage_gives_another_digest(tmp_path_factory, files, whole, data):
    folder = tmp_path_factory.mktemp("damaged")
    for name, content in files.items():
        (folder / name).write_bytes(content)
    for name in data.draw(st.sets(st.sampled_from(sorted(files)), min_size=1)):
        (folder / name).write_bytes(damaged(files[name], data))
    assert run_study(STUDY, folder=folder, resume=True).digest == whole


def damaged(content, data):
    """Cut somewhere, or with bits turned over, or with bytes of its own in another place."""
    at = data.draw(st.integers(0, len(content) - 1))
    how = data.draw(st.sampled_from(["cut", "flip", "shift"]))
    if how == "cut":
        return content[:at]
    if how == "flip":
        return (
            content[:at] + bytes([content[at] ^ data.draw(st.integers(1, 255))]) + content[at + 1 :]
        )
    return content[:at] + content[at : at + 64] + content[at:]


def test_a_file_that_is_there_twice_counts_once(tmp_path, files, whole):
    for twice in (name for name in files if name.startswith("runs-")):
        folder = tmp_path / twice
        folder.mkdir()
        for name, content in files.items():
            (folder / name).write_bytes(content)
        shutil.copy(folder / twice, folder / "runs-again.npz")
        assert run_study(STUDY, folder=folder, resume=True).digest == whole


def test_damage_is_remarked(tmp_path, files, whole):
    for name, content in files.items():
        (tmp_path / name).write_bytes(content[:-1] if name.startswith("runs") else content)
    found = run_study(STUDY, folder=tmp_path, resume=True)
    assert found.digest == whole
    assert f"{len(files) - 1} files" in found.remarks[-1]


# stopped from outside


def begin(folder, **given):
    """A process that runs the slow study in a folder."""
    words = json.dumps({"folder": str(folder), **given})
    code = "import engine_study; engine_study.main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path(engine_study.__file__).parent)},
        start_new_session=True,
    )


def end(process):
    """What a process printed, once it ends."""
    said, complained = process.communicate(timeout=120)
    return json.loads(said) if said else None, complained.decode()


def killed(folder, delay_s):
    """Kill a study so long after its first chunk, then go on: how much was kept, and the digest."""
    process = begin(folder)
    for _ in range(2):
        process.stderr.readline()
    time.sleep(delay_s)
    process.kill()
    end(process)
    kept, complained = end(begin(folder, resume=True))
    assert "Traceback" not in complained
    return kept


def slow_digest():
    """The digest of what the processes run, never stopped."""
    return run_study(engine_study.make(function=engine_study.slow_hold)).digest


def test_killed_and_resumed(tmp_path):
    kept = killed(tmp_path, 0.4)
    assert kept["digest"] == slow_digest()
    assert 0 < kept["began"] < 200


@pytest.mark.slow
def test_killed_at_twenty_instants_and_resumed(tmp_path):
    instants = np.random.default_rng(1)
    wanted, began = slow_digest(), []
    for i in range(20):
        kept = killed(tmp_path / str(i), instants.uniform(0.0, 0.8))
        assert kept["digest"] == wanted
        began.append(kept["began"])
    assert len(set(began)) > 5  # instants that differ, most of them with something kept


@pytest.mark.parametrize("engine", ["threads", "processes"])
def test_interrupted_and_resumed(engine, tmp_path):
    process = begin(tmp_path, engine=engine)
    for _ in range(12):
        process.stderr.readline()
    begun = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: its children too
    _, complained = end(process)
    assert time.monotonic() - begun < 10.0  # 0.2 s, where nothing else runs
    assert process.returncode == 130
    assert "Traceback" not in complained
    kept, _ = end(begin(tmp_path, resume=True, engine=engine))
    assert kept["digest"] == slow_digest()
    assert kept["began"] >= 20  # eleven chunks of two were told


# what decides the numbers


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"seed": 6}, "seed"),
        ({"first_scan": 3}, "first_scan"),
        ({"metrics": ("rmse", "nees")}, "metrics"),
        ({"limits": replace(STUDY.limits, lost_m=5.0)}, "limits.lost_m"),
        ({"noise": "one"}, "noise"),
    ],
)
def test_what_decides_numbers_is_in_the_identity(change, place):
    found = differences(identity(replace(STUDY, **change)), identity(STUDY))
    assert found[0].startswith(f"{place} is ")


def test_models_and_filters_are_in_the_identity():
    setting = STUDY.settings[0]
    first, outside = setting.contenders
    bigger = replace(first, motion=replace(first.motion, accel_mps2=0.7))
    other = replace(outside, filter=replace(outside.filter, function=engine_study.slow_hold))
    turned = replace(setting.scenario, initial=-setting.scenario.initial)
    for change in ({"contenders": (bigger, outside)}, {"contenders": (first, other)}):
        changed = replace(STUDY, settings=(replace(setting, **change),))
        assert len(differences(identity(changed), identity(STUDY))) == 1
    changed = replace(STUDY, settings=(replace(setting, scenario=turned),))
    assert "scenario.initial" in differences(identity(changed), identity(STUDY))[0]


def test_what_a_function_holds_is_in_the_identity():
    def made(gain):
        return lambda z, *_: gain * z

    one, two = (identity(engine_study.make(function=made(gain))) for gain in (1.0, 2.0))
    assert len(differences(one, two)) == 1


def test_names_and_the_number_of_runs_are_not_in_the_identity():
    first, other = STUDY.settings[0].contenders
    setting = replace(STUDY.settings[0], contenders=(replace(first, label="mine"), other))
    changed = replace(STUDY, name="other", runs=7, false_alarm=0.05, settings=(setting,))
    assert identity(changed) == identity(STUDY)


def test_the_digest_is_of_every_number_but_times():
    cell = run_study(STUDY).cells[0]
    assert digest([replace(cell, ns_per_step=1.0, label="other")]) == digest([cell])
    for name in ("median_rmse_m", "anis"):
        nudged = np.nextafter(getattr(cell, name), np.inf)
        assert digest([replace(cell, **{name: nudged})]) != digest([cell])
    for each in ("per_run", "per_scan"):
        values = {k: np.array(v, dtype=float) for k, v in getattr(cell, each).items()}
        next(iter(values.values())).flat[-1] += 1e-9
        assert digest([replace(cell, **{each: values})]) != digest([cell])


def test_every_nan_is_alike():
    cell = run_study(STUDY).cells[0]
    other = np.array([0xFFF8000000000001], dtype=np.uint64).view(float)[0]
    one, two = (digest([replace(cell, anis=each)]) for each in (np.nan, other))
    assert np.isnan(other)
    assert one == two
