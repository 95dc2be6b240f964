"""The object cache: whatever happens to it, the numbers are right and nothing is lost but time."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.lanes import make_kernel, pack_states, simd
from boresight.lanes.writer import Shape
from lanes.machines import COMPILED, compiled_targets, kernel_for, record

pytestmark = pytest.mark.skipif(not COMPILED, reason="there is no compiler here")
GOAL = COMPILED[0] if COMPILED else None


def formula(x, y):
    return np.sin(x) * np.exp(-y * y) + np.arctan2(y, x)


@pytest.fixture(autouse=True)
def a_fresh_process(kernel_cache, monkeypatch):
    """Nothing loaded yet, as when a process starts; LLVM never loads one name twice."""
    monkeypatch.setattr(simd, "_LOADED", {})
    monkeypatch.setattr(simd, "_jit", fresh_jit())
    return kernel_cache


def fresh_jit():
    jit = simd._llvm().create_lljit_compiler(simd._machine(GOAL))
    return lambda: jit


def numbers(program):
    x = np.random.default_rng(1).normal(size=(9, 1, 2))
    states = pack_states(program.state, {"idle": np.zeros(9)})
    y = kernel_for(program, GOAL).run(states, {"x": x}, 1)[1]["y"][:, 0]
    np.testing.assert_allclose(y, formula(*x[:, 0].T), rtol=1e-13)
    return y


def restart(monkeypatch):
    monkeypatch.setattr(simd, "_LOADED", {})
    monkeypatch.setattr(simd, "_jit", fresh_jit())


def only_object(folder):
    (path,) = folder.glob("*.o")
    return path


def test_what_was_compiled_once_is_not_compiled_again(kernel_cache, monkeypatch):
    program = record(formula, 2)
    first = numbers(program)
    restart(monkeypatch)
    monkeypatch.setattr(simd, "_assemble", lambda *_: pytest.fail("it was compiled again"))
    np.testing.assert_array_equal(numbers(program), first)
    assert [p.suffix for p in kernel_cache.iterdir()] == [".o"]  # nothing temporary is left


DAMAGES = {
    "cut": lambda data: data[: len(data) // 2],
    "cut by one": lambda data: data[:-1],
    "empty": lambda data: b"",  # noqa: ARG005 - every damage takes the file
    "one flipped bit": lambda data: data[:100] + bytes([data[100] ^ 1]) + data[101:],
    "longer": lambda data: data + b"\0",
    "noise": lambda data: np.random.default_rng(1).bytes(len(data)),
    "text": lambda data: b"not an object",  # noqa: ARG005 - as above
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_written_again(damage, kernel_cache, monkeypatch):
    program = record(formula, 2)
    first = numbers(program)
    path = only_object(kernel_cache)
    whole = path.read_bytes()
    path.write_bytes(DAMAGES[damage](whole))
    restart(monkeypatch)
    np.testing.assert_array_equal(numbers(program), first)
    assert path.read_bytes() == whole


def test_a_folder_in_the_place_of_an_object_is_no_harm(kernel_cache, monkeypatch):
    program = record(formula, 2)
    first = numbers(program)
    path = only_object(kernel_cache)
    path.unlink()
    path.mkdir()
    restart(monkeypatch)
    np.testing.assert_array_equal(numbers(program), first)
    assert [p.name for p in kernel_cache.iterdir()] == [path.name]  # no temporary file stays


@pytest.mark.parametrize("place", ["a file", "under a file", "nowhere", "read only"])
def test_a_cache_that_cannot_be_kept_costs_only_time(place, tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("not a folder")
    shut = tmp_path / "shut"
    shut.mkdir()
    shut.chmod(stat.S_IRUSR | stat.S_IXUSR)
    folder = {
        "a file": file,
        "under a file": file / "cache",
        "nowhere": Path("/proc/self/no/such") if os.name == "posix" else file / "x" / "y",
        "read only": shut,
    }[place]
    monkeypatch.setenv("BORESIGHT_CACHE", str(folder))
    numbers(record(formula, 2))


def test_a_user_without_a_home_has_no_cache(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("BORESIGHT_CACHE")
    monkeypatch.setattr(Path, "home", staticmethod(homeless))
    assert simd.cache_folder() is None
    numbers(record(formula, 2))


def test_the_cache_is_where_the_user_says(monkeypatch, tmp_path):
    assert simd.cache_folder() == tmp_path
    monkeypatch.delenv("BORESIGHT_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    if os.name == "posix":
        assert simd.cache_folder() == tmp_path / "xdg" / "boresight" / "kernels"


def test_another_program_target_or_layout_is_another_object(kernel_cache):
    for program in (record(formula, 2), record(lambda x, y: x * y + 1.0, 2)):
        for goal in COMPILED:
            for rows in (True, False):
                simd._compile(program, Shape(goal.width, rows), goal)
    assert len(list(kernel_cache.glob("*.o"))) == 2 * len(COMPILED) * 2


def test_two_programs_with_the_same_code_share_it(kernel_cache):
    """Names of inputs are not part of the code; a loaded name cannot be loaded again."""
    from boresight.lanes import Rate, Scalar, trace

    def program(name):
        return trace(
            lambda state, inputs: ({"x": state["x"] + inputs[name]}, {}),
            state={"x": Scalar()},
            inputs={name: (Scalar(), Rate.EACH)},
            outputs={},
        )

    for name in ("first", "second", "first"):
        one = program(name)
        states = pack_states(one.state, {"x": np.zeros(2)})
        final, _ = kernel_for(one, GOAL).run(states, {name: np.ones((2, 3))}, 3)
        assert final["x"].tolist() == [3.0, 3.0]
    assert len(list(kernel_cache.glob("*.o"))) == 1


CHILD = """
import sys; sys.path[:0] = {path!r}
import numpy as np
from boresight.lanes import make_kernel, pack_states
from lanes.machines import record
from lanes.test_cache import formula
program = record(formula, 2)
x = np.linspace(-2, 2, 40).reshape(20, 1, 2)
states = pack_states(program.state, {{"idle": np.zeros(20)}})
print(make_kernel(program).run(states, {{"x": x}}, 1)[1]["y"].tobytes().hex())
"""


def child(**environment):
    return subprocess.Popen(
        [sys.executable, "-c", CHILD.format(path=[str(Path(__file__).parents[1])])],
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_two_processes_may_compile_the_same_at_once(kernel_cache):
    children = [child() for _ in range(3)]
    outputs = [process.communicate() for process in children]
    assert [process.returncode for process in children] == [0, 0, 0], outputs
    assert len({out for out, _ in outputs}) == 1
    assert [p.suffix for p in kernel_cache.iterdir()] == [".o"]


@pytest.mark.parametrize("name", [*(goal.name for goal in COMPILED), "numpy"])
def test_the_environment_chooses_the_target(name):
    process = child(BORESIGHT_TARGET=name)
    out, err = process.communicate()
    assert process.returncode == 0, err
    y = np.frombuffer(bytes.fromhex(out))
    x = np.linspace(-2, 2, 40).reshape(20, 2)
    np.testing.assert_allclose(y, formula(*x.T), rtol=1e-13)


@pytest.mark.parametrize("name", ["z80", "avx512"])
def test_a_target_that_this_machine_cannot_run_is_refused(name, monkeypatch):
    """Code for another processor would load, and die of an illegal instruction."""
    lesser = tuple(goal for goal in COMPILED if goal.name != "avx512")
    monkeypatch.setattr(simd, "available", lambda: lesser)
    monkeypatch.setenv("BORESIGHT_TARGET", name)
    with pytest.raises(UsageError, match=name):
        simd.target.__wrapped__()


def test_without_a_compiler_numpy_does_the_work(monkeypatch):
    monkeypatch.setattr(simd, "available", tuple)
    monkeypatch.delenv("BORESIGHT_TARGET", raising=False)
    assert simd.target.__wrapped__() is None


@compiled_targets
def test_kernels_travel_as_programs(goal):
    import pickle

    del goal
    kernel = make_kernel(record(formula, 2))
    again = pickle.loads(pickle.dumps(kernel))  # noqa: S301 - what is loaded was just made here
    x = np.random.default_rng(3).normal(size=(4, 1, 2))
    states = pack_states(kernel.program.state, {"idle": np.zeros(4)})
    results = [k.run(states, {"x": x}, 1)[1]["y"] for k in (kernel, again)]
    np.testing.assert_array_equal(*results)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_threads_still_run_in_a_forked_child():
    code = """
import os, sys; sys.path[:0] = {path!r}
import numpy as np, warnings
warnings.simplefilter("ignore")
from boresight.lanes import make_kernel, pack_states
from lanes.machines import record
from lanes.test_cache import formula
program = record(formula, 2)
x, idle = np.ones((64, 1, 2)), {{"idle": np.zeros(64)}}
def run():
    states = pack_states(program.state, idle)
    return make_kernel(program).run(states, {{"x": x}}, 1, threads=2)[1]["y"]
before = run()
child = os.fork()
if child == 0:
    os._exit(0 if (run() == before).all() else 3)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    done = subprocess.run(
        [sys.executable, "-c", code.format(path=[str(Path(__file__).parents[1])])],
        timeout=60,
        check=False,
    )
    assert done.returncode == 0
