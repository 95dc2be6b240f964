"""Does our compiler keep up with gcc? The stop rule: within 1.3 times on MEKF, DUCM and UKF.

Every rival runs the same arithmetic in the same order on the same blocked data through the same
`Kernel.run`: only the machine code differs. Times are CPU nanoseconds per run and step, one thread.
"""

import shutil
import subprocess
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import boresight as bs
from boresight import Radar, catalogue
from boresight.lanes import (
    Kernel,
    Leaf,
    Program,
    Rate,
    States,
    Vector,
    make_kernel,
    pack_states,
    to_blocks,
    trace,
)
from boresight.lanes.elementary import lower
from boresight.models.motion import Motion
from c_code import COMMON, FLAGS, FORMS, gcc_kernel
from measure import at_most, interleaved, machine, publish
from scenario import DT, FLAT, PLANAR, RADAR, SPATIAL, Scenario, planar, straight

Array = Any
RUNS, STEPS, ROUNDS = 1000, 500, 9
LIMIT, AGREEMENT = 1.3, 1e-12


def recorded(
    name: str, motion: Motion = SPATIAL, radar: Radar = RADAR
) -> tuple[Program, dict[str, Any]]:
    """A filter of the catalogue with the means of every step out, and its numbers."""
    recursion = catalogue.lookup(name).recursion(motion, radar)
    models = recursion.models()
    n, k = recursion.size
    shapes = {"z": (Vector(k), Rate.EACH), "dt": (Leaf(), Rate.FIXED)}
    program = trace(
        recursion.step,
        state=recursion.layout,
        inputs=shapes | {name: (leaf, Rate.FIXED) for name, (_, leaf) in models.items()},
        outputs={"mean": (Vector(n), Rate.EACH)},
    )
    return program, {name: value for name, (value, _) in models.items()}


def started(program: Program, given: Scenario) -> States:
    """Every run at the scenario's start."""
    leaves = given.start._asdict()
    return pack_states(
        program.state, {name: np.broadcast_to(v, (RUNS, *v.shape)) for name, v in leaves.items()}
    )


def problems() -> dict[str, tuple[Program, dict[str, Any], Scenario]]:
    """Program, fixed inputs and plots of each kernel."""
    space = straight(RUNS, STEPS)
    return {
        "mekf": (*recorded("mekf"), space),
        "ducm": (*recorded("ducm", PLANAR, FLAT), planar(space)),
        "ukf": (*recorded("ukf"), space),
    }


def rivals(kernel: Kernel) -> dict[str, Kernel]:
    """Gcc's kernels by form and flags; empty without gcc or on another processor."""
    if shutil.which("g++") is None or kernel.code is None:
        return {}
    return {
        f"gcc {form} {name}": gcc_kernel(kernel, form, flags)
        for form in FORMS
        for name, flags in FLAGS.items()
    }


def compare(program: Program, values: Mapping[str, Any], given: Scenario) -> dict[str, Any]:
    """Our kernel in both layouts against all of gcc's, and how far the results lie apart."""
    states = started(program, given)
    rows = dict(values) | {"dt": DT, "z": given.z}
    blocks = rows | {"z": to_blocks(given.z)}
    ours = make_kernel(program, rows=False)
    kernels = {"ours blocks": ours} | rivals(ours)
    means = {name: k.run(states, blocks, STEPS)[1]["mean"] for name, k in kernels.items()}
    size = np.abs(means["ours blocks"]).max()
    apart = {name: np.abs(m - means["ours blocks"]).max() / size for name, m in means.items()}
    kept = {"mean": means["ours blocks"]}  # all write into one array: no page is new to anyone
    tasks: dict[str, Callable[[], Any]] = {
        name: lambda k=k: k.run(states, blocks, STEPS, out=kept) for name, k in kernels.items()
    }
    plain = make_kernel(program, rows=True)
    flat = {"mean": plain.run(states, rows, STEPS)[1]["mean"]}
    tasks["ours rows"] = lambda: plain.run(states, rows, STEPS, out=flat)
    times = interleaved(tasks, rounds=ROUNDS, per=RUNS * STEPS * 1e-9)
    return verdict(times, apart) | {
        "operations": lower(program, rounding=True).operations,
        "ns_per_step": times,
        "largest_difference": apart,
    }


def verdict(times: Mapping[str, dict[str, float]], apart: Mapping[str, float]) -> dict[str, Any]:
    """Our time over that of gcc's fastest variant whose results agree with ours."""
    agreeing = [n for n in times if n.startswith("gcc") and apart[n] <= AGREEMENT]
    if not agreeing:
        return {"skipped": "no gcc"}
    best = min(agreeing, key=lambda name: times[name]["median"])
    strict = [n for n in agreeing if n.endswith("plain")]
    ratio = times["ours blocks"]["median"] / times[best]["median"]
    return {
        "best_gcc": best,
        "ratio": ratio,
        "ratio_of_minima": times["ours blocks"]["min"] / times[best]["min"],
        "ratio_to_gcc_without_fast_math": times["ours blocks"]["median"]
        / min(times[n]["median"] for n in strict),
    }


def layouts() -> dict[str, Any]:
    """What packing costs: one step of 1,000 tracks, and the public calls around the kernel."""
    space = straight(RUNS, STEPS)
    program, values = recorded("mekf")
    states = started(program, space)
    one = dict(values) | {"dt": DT, "z": np.ascontiguousarray(space.z[:, :1])}
    blocked = one | {"z": to_blocks(one["z"])}
    rows, blocks = make_kernel(program, rows=True), make_kernel(program, rows=False)
    live = bs.stream("mekf", SPATIAL, RADAR, targets=RUNS)
    state, plot = live.start(space.start), space.z[:, 0].copy()

    def repeat(task: Callable[[], Any]) -> Callable[[], None]:
        def run() -> None:
            for _ in range(200):
                task()

        return run

    one_step = {
        "Kernel.run blocks": repeat(lambda: blocks.run(states, blocked, 1)),
        "Kernel.run rows": repeat(lambda: rows.run(states, one, 1)),
        "NumPy packs, Kernel.run blocks": repeat(
            lambda: blocks.run(states, one | {"z": to_blocks(one["z"])}, 1)
        ),
        "boresight.stream": repeat(lambda: live(state, plot, DT)),
    }
    run = {
        "boresight.run mean": lambda: bs.run(
            "mekf", SPATIAL, RADAR, space.z, dt=DT, start=space.start, outputs=("mean",)
        ),
        "boresight.run mean, last": lambda: bs.run(
            "mekf", SPATIAL, RADAR, space.z, dt=DT, start=space.start, outputs=("mean",), last=True
        ),
    }
    return {
        "microseconds_one_step_of_1000_tracks": interleaved(one_step, rounds=ROUNDS, per=200e-6),
        "ns_per_step_public": interleaved(run, rounds=ROUNDS, per=RUNS * STEPS * 1e-9),
    }


def gcc_version() -> str | None:
    """First line of gcc --version."""
    if shutil.which("g++") is None:
        return None
    told = subprocess.run(["g++", "--version"], capture_output=True, text=True, check=True)  # noqa: S607 - the user's compiler
    return told.stdout.splitlines()[0]


def main() -> None:
    results = {name: compare(*problem) for name, problem in problems().items()}
    publish(
        "kernels",
        {
            "question": "CPU ns per run and step: our kernels against gcc on the same arithmetic",
            "machine": machine(),
            "gcc": gcc_version(),
            "flags": {"all": COMMON} | FLAGS,
            "runs": RUNS,
            "steps": STEPS,
            "kernels": results,
            "layouts": layouts(),
            "targets": {
                f"{name}, our time over that of gcc's fastest": at_most(result["ratio"], LIMIT)
                for name, result in results.items()
                if "ratio" in result
            },
        },
    )


if __name__ == "__main__":
    main()
