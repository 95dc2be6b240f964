"""aditya's scenario, run by both of its filters: what its verdicts are read off."""

from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from boresight.experiments.metrics import rmse_per_run
from boresight.experiments.montecarlo import filtered
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.experiments.verdicts import share_interval
from boresight.filters.recursion import Estimate
from boresight.maths import gradient, jacobian

Array = Any
FILTERS = {"ekf": "ekf", "mekf": "mekf-block"}


@dataclass(frozen=True)
class Study:
    """One reading of Table 2, of one length, simulated and filtered by both filters."""

    world: Scenario
    truth: Truth
    plots: Plots
    estimates: dict[str, Estimate]

    @property
    def name(self) -> str:
        """Reading and length."""
        return f"{self.world.name}, {self.world.scans} steps"

    @cached_property
    def rmse(self) -> dict[str, Array]:
        """By filter: (runs, 6), of each run and state."""
        names = self.truth.names
        return {
            name: np.stack([rmse_per_run(e, self.truth, of=state) for state in names], axis=-1)
            for name, e in self.estimates.items()
        }

    def column(self, name: str, state: str) -> Array:
        """RMSE of every run (runs,) of one filter and state."""
        return self.rmse[name][:, self.truth.names.index(state)]

    @cached_property
    def below(self) -> Array:
        """(runs, 6): whether the MEKF's error is the smaller one."""
        return self.rmse["mekf"] < self.rmse["ekf"]

    @cached_property
    def all_six(self) -> tuple[float, tuple[float, float]]:
        """Share of runs in which all six are, and its 95 % confidence interval."""
        true = np.all(self.below, axis=1)
        return float(np.mean(true)), share_interval(int(np.sum(true)), len(true))


def study(world: Scenario, runs: int, seed: int) -> Study:
    """Simulate a reading and filter it by both filters, on the same plots."""
    truth, plots = simulate(world, runs=runs, seed=seed)
    found = {
        name: filtered(entry, world.motion, world.sensor, plots) for name, entry in FILTERS.items()
    }
    return Study(world, truth, plots, found)


def told_by_plots(one: Study, states: list[int]) -> float:
    """Share of the variance of some states that plots take away, at the last scan."""
    world = one.world
    blind = filtered(
        FILTERS["mekf"], world.motion, world.sensor, one.plots._replace(z=one.plots.z * np.nan)
    )
    left, all_of_it = (e.cov[:, -1, states, states].sum() for e in (one.estimates["mekf"], blind))
    return float(1.0 - left / all_of_it)


def observability(world: Scenario) -> Array:
    """(scans * k, n): how each measurement depends on the first state, along the noiseless path."""
    x, through, rows = world.initial, np.eye(len(world.initial)), []
    for dt in world.dt[0]:
        x, step = jacobian(partial(world.motion.move, dt=dt), x)
        through = step @ through
        rows += [
            gradient(component.value, x)[1] / component.sigma @ through
            for component in world.sensor.components(world.motion)
        ]
    return np.array(rows)
