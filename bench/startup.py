"""How long until there is an answer? Fresh processes, each round with a cache of its own.

    import      import boresight; then what a filter imports (NumPy, llvmlite)
    compile     record, lower, compile and link one kernel (the sequential MEKF), imports done
    cached      the same, the object file already in the cache
    first       a whole process: import, kernel, one streaming update
    help        boresight --help

Wall and CPU seconds. Targets are held to the median of the CPU times, which neighbours on the
machine do not move; on an idle machine wall and CPU time are nearly the same.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from measure import at_most, machine, publish, summary

ROUNDS = 15
TARGETS = {"compile": 0.3, "cached": 0.02, "help": 0.5}  # s

_KERNEL = """
import json, time
def clock(): return time.perf_counter(), time.process_time()
marks = [clock()]
import boresight as bs
bs.__version__; marks.append(clock())
from boresight import catalogue
from boresight.filters.recursion import Rate
from boresight.lanes.simd import target
target(); marks.append(clock())
radar = bs.Radar(range_m=30.0, azimuth_deg=0.5, elevation_deg=0.5)
recursion = catalogue.lookup("mekf").recursion(bs.ConstantVelocity(accel_mps2=0.5), radar)
rates = {name: Rate.FIXED for name in recursion.models()} | {"z": Rate.EACH, "dt": Rate.FIXED}
marks.append(clock())
recursion.kernel(rates, {"mean": Rate.EACH}); marks.append(clock())
names = ("import boresight", "import a filter", "-", "kernel")
print(json.dumps({n: [b - a for a, b in zip(x, y)] for n, x, y in zip(names, marks, marks[1:])}))
"""
_FIRST = """
import boresight as bs
radar = bs.Radar(range_m=30.0, azimuth_deg=0.5, elevation_deg=0.5)
step = bs.stream("mekf", bs.ConstantVelocity(accel_mps2=0.5), radar)
state = step(step.start([10e3, 0.5, 0.3]), [10.1e3, 0.5, 0.3], dt=4.0)
assert state.mean[0] > 0
"""


def child(arguments: list[str], cache: str) -> tuple[float, float, str]:
    """Wall seconds, CPU seconds and output of a fresh process."""
    environment = os.environ | {"BORESIGHT_CACHE": cache}
    before, start = os.times(), time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=True
    )
    wall, after = time.perf_counter() - start, os.times()
    used = after.children_user + after.children_system
    return wall, used - before.children_user - before.children_system, done.stdout


def once(taken: dict[str, list[tuple[float, float]]]) -> None:
    """One round: a new cache, each kind of process once."""
    with tempfile.TemporaryDirectory() as folder:
        for name in ("compile", "cached"):
            parts = json.loads(child(["-c", _KERNEL], str(Path(folder) / "kernels"))[2])
            taken.setdefault(name, []).append(parts["kernel"])
            for part in ("import boresight", "import a filter"):
                taken.setdefault(part, []).append(parts[part])
        for name in ("first result, cold", "first result, cached"):
            wall, used, _ = child(["-c", _FIRST], str(Path(folder) / "first"))
            taken.setdefault(name, []).append((wall, used))
        for name, arguments in (
            ("help", ["-m", "boresight", "--help"]),
            ("python alone", ["-c", "pass"]),
        ):
            wall, used, _ = child(arguments, folder)
            taken.setdefault(name, []).append((wall, used))


def main() -> None:
    taken: dict[str, list[tuple[float, float]]] = {}
    for _ in range(ROUNDS):
        once(taken)
    seconds: dict[str, Any] = {
        name: {
            "wall": summary([wall for wall, _ in values]),
            "cpu": summary([used for _, used in values]),
        }
        for name, values in taken.items()
    }
    publish(
        "startup",
        {
            "question": "seconds until there is an answer, from fresh processes",
            "machine": machine(),
            "seconds": seconds,
            "targets": {
                f"{name}, CPU s": at_most(seconds[name]["cpu"]["median"], limit)
                for name, limit in TARGETS.items()
            },
        },
    )


if __name__ == "__main__":
    main()
