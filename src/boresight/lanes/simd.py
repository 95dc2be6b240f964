"""Programs to machine code: targets, compilation, and a cache that survives what disks do.

Objects are kept in the user's cache folder under a name that says everything they depend on:
the code itself, the processor level, the optimisation level and LLVM's version. A file is written
beside its final name and moved into place, so two processes can write it at once; it ends with its
own checksum, so a cut or corrupt file is a miss and is written again.
"""

import contextlib
import ctypes
import hashlib
import os
import struct
import tempfile
import threading
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from boresight.errors import UsageError
from boresight.lanes.elementary import lower
from boresight.lanes.ir import write_ir
from boresight.lanes.places import BLOCK
from boresight.lanes.program import Program
from boresight.lanes.writer import Shape

FORMAT = 3  # of the calling convention; part of every cached object's name
_LOCK = threading.RLock()  # LLVM's contexts are not made for several threads
_LOADED: dict[str, Any] = {}  # code by name: LLVM never frees a name, nor loads it twice


@dataclass(frozen=True)
class Target:
    """A processor level: what LLVM calls it, and how many lanes one instruction does."""

    name: str
    cpu: str
    features: str
    width: int
    rounding: bool = True
    attributes: str = ""


_AVX512 = ("avx512f", "avx512dq", "avx512vl", "avx512bw", "avx512cd")
_WIDE = '"prefer-vector-width"="512" "min-legal-vector-width"="512"'
TARGETS = {
    "avx512": Target("avx512", "x86-64-v4", "-prefer-256-bit", 8, attributes=_WIDE),
    "avx2": Target("avx2", "x86-64-v3", "", 8),
    "sse2": Target("sse2", "x86-64", "", 2, rounding=False),
    "generic": Target("generic", "", "", 2),  # ARM and others: two lanes, as NEON has
}


@cache
def _llvm() -> Any:
    """LLVM's binding, or None where llvmlite is not there or does not know this processor."""
    try:
        import llvmlite.binding as llvm

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
    except (ImportError, OSError, RuntimeError):
        return None
    return llvm


@cache
def available() -> tuple[Target, ...]:
    """The levels this machine can run, best first; none where there is no compiler."""
    llvm = _llvm()
    if llvm is None:
        return ()
    has = llvm.get_host_cpu_features()
    x86 = llvm.get_process_triple().startswith("x86_64")
    needs = {"avx512": _AVX512, "avx2": ("avx2", "fma"), "sse2": ()}
    vectors = [n for n, features in needs.items() if x86 and all(has.get(f) for f in features)]
    return tuple(TARGETS[name] for name in (*vectors, "generic"))


@cache
def target() -> Target | None:
    """The best level of this machine, or what BORESIGHT_TARGET says; None means NumPy."""
    wanted = os.environ.get("BORESIGHT_TARGET", "")
    if wanted == "numpy" or not available():
        return None
    if not wanted:
        return available()[0]
    for goal in available():
        if goal.name == wanted:
            return goal
    raise UsageError(
        f"BORESIGHT_TARGET={wanted!r} is not a target of this machine",
        next_step=f"use one of {', '.join((*(goal.name for goal in available()), 'numpy'))}",
    )


@cache
def _machine(goal: Target) -> Any:
    llvm = _llvm()
    triple = llvm.Target.from_triple(llvm.get_process_triple())
    cpu = goal.cpu or llvm.get_host_cpu_name()
    return triple.create_target_machine(cpu=cpu, features=goal.features, opt=1, jit=True)


def _assemble(text: str, goal: Target) -> bytes:
    """LLVM text to an object file."""
    llvm, machine = _llvm(), _machine(goal)
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = llvm.get_process_triple(), str(machine.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=1)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))


def cache_folder() -> Path | None:
    """Where compiled objects are kept: BORESIGHT_CACHE, else the user's cache folder, if any."""
    if own := os.environ.get("BORESIGHT_CACHE"):
        return Path(own)
    try:
        home = Path.home()
    except RuntimeError:  # an account without a home
        return None
    usual = home / "AppData" / "Local" if os.name == "nt" else home / ".cache"
    base = os.environ.get("LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME") or usual
    return Path(base) / "boresight" / "kernels"


def _read(path: Path) -> bytes | None:
    """A cached object, or None if it is not there, cut or corrupt."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    code, checksum = data[:-32], data[-32:]
    return code if code and hashlib.sha256(code).digest() == checksum else None


def _write(path: Path, data: bytes) -> None:
    """Keep an object; a folder that cannot be written to only costs time."""
    name = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            file.write(data + hashlib.sha256(data).digest())
        os.replace(name, path)  # noqa: PTH105 - the name is a string from mkstemp
    except OSError:
        if name is not None:
            with contextlib.suppress(OSError):
                os.unlink(name)  # noqa: PTH108 - as above


def _object(text: str, name: str, goal: Target) -> bytes:
    folder = cache_folder()
    if folder is None:
        return _assemble(text, goal)
    path = folder / f"{name}.o"
    data = _read(path)
    if data is None:
        data = _assemble(text, goal)
        _write(path, data)
    return data


@cache
def _jit() -> Any:
    return _llvm().create_lljit_compiler(_machine(target() or TARGETS["generic"]))


@dataclass(frozen=True)
class Code:
    """Machine code of one program; `call` takes one packed `frame`: arguments are what is slow."""

    program: Program
    shape: Shape
    goal: Target
    call: Any
    resources: Any  # owns the code: must outlive `call`

    @property
    def frame(self) -> struct.Struct:
        """What describes a call.

        First chunk and the one after the last, steps, lanes; addresses of the old and the new
        state, the outputs and the inputs.
        """
        return struct.Struct(f"{6 + len(self.program.inputs) + len(self.program.outputs)}q")

    def chunks(self, lanes: int) -> int:
        """Number of chunks that hold `lanes`."""
        return -(-lanes // BLOCK) * (BLOCK // self.shape.width)


@lru_cache(maxsize=256)
def compile_program(program: Program, *, rows: bool) -> Code | None:
    """Machine code for this processor, from the cache where it can be.

    Args:
        program: what to compile.
        rows: whether inputs and outputs are plain rows rather than blocks.

    Returns:
        The code, or None where there is no compiler and NumPy has to do.
    """
    goal = target()
    if goal is None:
        return None
    with _LOCK:
        return _compile(program, Shape(goal.width, rows), goal)


def _compile(program: Program, shape: Shape, goal: Target) -> Code:
    llvm = _llvm()
    text = write_ir(lower(program, rounding=goal.rounding), shape, "kernel", "#0")
    text += f"\nattributes #0 = {{ nounwind {goal.attributes} }}\n"
    version = ".".join(map(str, llvm.llvm_version_info))
    cpu = goal.cpu or llvm.get_host_cpu_name()
    identity = f"{FORMAT} {version} {cpu} {goal.features} O1\n{text}"
    name = "k" + hashlib.sha256(identity.encode()).hexdigest()[:40]
    resources = _LOADED.get(name)
    if resources is None:  # two programs may share their code
        data = _object(text.replace("@kernel(", f"@{name}(", 1), name, goal)
        library = llvm.JITLibraryBuilder().add_object_img(data).export_symbol(name)
        resources = _LOADED[name] = library.link(_jit(), name)
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
    return Code(program, shape, goal, kind(resources[name]), resources)
