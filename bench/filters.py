"""What does each filter cost? Every filter of the catalogue beside the EKF, in the same run.

Means and covariances of every step go out. Times are CPU nanoseconds per run and step, one thread;
a cold compile is recording, optimising and loading with an empty cache, in processor seconds.
"""

import os
import tempfile
import time
from collections.abc import Callable
from typing import Any

os.environ["BORESIGHT_CACHE"] = tempfile.mkdtemp()  # every compile is cold

import numpy as np

from boresight import catalogue
from boresight.errors import UsageError
from boresight.filters.recursion import Recursion
from boresight.lanes import Rate, make_kernel, to_blocks
from boresight.models.parameters import rate_of
from measure import at_most, interleaved, machine, publish
from scenario import DT, FLAT, PLANAR, RADAR, SPATIAL, Scenario, planar, straight

Array = Any
RUNS, STEPS, ROUNDS = 1000, 200, 9
WORLDS = {"plane": (PLANAR, FLAT), "space": (SPATIAL, RADAR)}
SETTINGS: dict[str, tuple[dict[str, Any], ...]] = {
    "line-of-sight": ({"components": 1}, {"components": 3}, {"components": 5}),
    "ducm": ({}, {"conditioning": "previous measurement"}),
}
TIMES_EKF = {"plane ducm": 2.0, "plane line-of-sight, components 5": 8.0}
COMPILE_S = 1.0


def recursions(world: str) -> dict[str, Recursion]:
    """Every filter that can take the world's plots, by name and settings."""
    found = {}
    for name in catalogue.names():
        for settings in SETTINGS.get(name, ({},)):
            chosen = catalogue.lookup(name).with_settings(**settings)
            label = ", ".join([name, *(f"{key} {value}" for key, value in settings.items())])
            found[label] = chosen.recursion(*WORLDS[world])
    return found


def prepared(recursion: Recursion, given: Scenario) -> tuple[Callable[[], Any], float, int]:
    """A task that filters all runs, its cold compile in CPU seconds, and its operations."""
    rated = {name: rate_of(name, *pair) for name, pair in recursion.models().items()}
    rates = {name: rate for name, (rate, _) in rated.items()} | {"z": Rate.EACH, "dt": Rate.FIXED}
    began = time.process_time()
    program = recursion.kernel(rates, dict.fromkeys(("mean", "cov"), Rate.EACH)).program
    compiled = time.process_time() - began
    kernel = make_kernel(program, rows=False)
    values = {name: value for name, (_, value) in rated.items()}
    inputs = values | {"dt": np.float64(DT), "z": to_blocks(given.z[:, :STEPS])}
    states = recursion.states(given.start, RUNS)
    kept = kernel.run(states, inputs, STEPS)[1]
    return lambda: kernel.run(states, inputs, STEPS, out=kept), compiled, program.operations


def world_costs(world: str, given: Scenario) -> dict[str, dict[str, Any]]:
    """Time, ratio to the EKF, operations and compile time of every filter in one world."""
    ready = {}
    for label, recursion in recursions(world).items():
        try:
            ready[label] = prepared(recursion, given)
        except UsageError:  # the linear filter has no use for angles
            continue
    tasks = {label: task for label, (task, _, _) in ready.items()}
    times = interleaved(tasks, rounds=ROUNDS, per=RUNS * STEPS * 1e-9)
    ekf = times["ekf"]["median"]
    return {
        label: {
            "ns_per_step": times[label],
            "times_ekf": times[label]["median"] / ekf,
            "operations": operations,
            "compile_s": compiled,
        }
        for label, (_, compiled, operations) in ready.items()
    }


def main() -> None:
    space = straight(RUNS, STEPS)
    costs = {
        "plane": world_costs("plane", planar(space)),
        "space": world_costs("space", space),
    }
    each = {f"{world} {label}": row for world, rows in costs.items() for label, row in rows.items()}
    slowest = max(each, key=lambda name: each[name]["compile_s"])
    targets = {
        f"{name}, times the EKF": at_most(each[name]["times_ekf"], limit)
        for name, limit in TIMES_EKF.items()
    }
    targets[f"slowest cold compile, CPU s ({slowest})"] = at_most(
        each[slowest]["compile_s"], COMPILE_S
    )
    publish(
        "filters",
        {
            "question": "CPU ns per run and step of every filter, means and covariances out",
            "machine": machine(),
            "runs": RUNS,
            "steps": STEPS,
            "worlds": costs,
            "targets": targets,
        },
    )


if __name__ == "__main__":
    main()
