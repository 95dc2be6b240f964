"""One cell of a study: a scenario, a filter, many runs."""

from collections.abc import Sequence
from time import process_time
from typing import Any, NamedTuple

from boresight import catalogue
from boresight.experiments.scenario import Scenario, lookup
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.filters.recursion import Estimate, run_recursion
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor


class Cell(NamedTuple):
    """What was simulated and what a filter made of it.

    Attributes:
        truth, plots: what was simulated.
        estimate: mean (runs, scans, n), cov (runs, scans, n, n), and so on.
        ns_per_step: processor time of the filter, of each run and scan, nanoseconds; the first
            call of a filter includes its compilation.
    """

    truth: Truth
    plots: Plots
    estimate: Estimate
    ns_per_step: float


def run_cell(
    scenario: str | Scenario,
    name: str,
    *,
    runs: int,
    seed: int,
    first: int = 0,
    sensor: Sensor | None = None,
    settings: dict[str, Any] | None = None,
    outputs: Sequence[str] = ("mean", "cov", "nis", "dof"),
    threads: int = 1,
) -> Cell:
    """Simulate a scenario and filter it, every run a lane.

    Args:
        scenario: a `Scenario`, or the name of one.
        name: a filter of the catalogue.
        runs: number of runs.
        seed: of all that is random.
        first: number of the first run.
        sensor: what sees the target and what the filter believes, if not the scenario's own.
        settings: the filter's own.
        outputs: what to keep of the filter.
        threads: threads that share the runs; no number depends on it.
    """
    world = scenario if isinstance(scenario, Scenario) else lookup(scenario)
    eye = world.sensor if sensor is None else sensor
    truth, plots = simulate(world, eye, runs=runs, seed=seed, first=first)
    began = process_time()
    estimate = filtered(
        name, world.motion, eye, plots, settings=settings, outputs=outputs, threads=threads
    )
    return Cell(truth, plots, estimate, (process_time() - began) * 1e9 / plots.z[..., 0].size)


def filtered(
    name: str,
    motion: Motion,
    sensor: Sensor,
    plots: Plots,
    *,
    settings: dict[str, Any] | None = None,
    outputs: Sequence[str] = ("mean", "cov", "nis", "dof"),
    threads: int = 1,
) -> Estimate:
    """Run a filter of the catalogue over simulated plots, from the start that they carry."""
    recursion = catalogue.lookup(name).with_settings(**(settings or {})).recursion(motion, sensor)
    return run_recursion(
        recursion, plots.z, plots.dt, plots.prior, outputs=outputs, threads=threads
    )
