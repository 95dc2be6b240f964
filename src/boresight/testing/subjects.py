"""A filter as the laws see it: one target, plot after plot."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from boresight import catalogue
from boresight.filters.method import Filter, FilterLike, Outside
from boresight.filters.posterior import Posterior
from boresight.filters.recursion import Recursion
from boresight.maths import Gaussian
from boresight.testing.worlds import World

Array = Any


class Subject(Protocol):
    """What laws ask of a filter; what it does not tell (NIS, likelihood) is None."""

    def update(self, world: World, mean: Array, cov: Array, z: Array) -> Posterior:
        """Condition on one plot (k,)."""

    def run(self, world: World, mean: Array, cov: Array, plots: Array, dt: float) -> Posterior:
        """Predict and update with plots (steps, k), dt s before each; as it is after the last."""


@dataclass(frozen=True)
class Stepping:
    """A filter made of a formula or a method, on floats."""

    filter: Filter

    def recursion(self, world: World) -> Recursion:
        """Predict and update in `world`."""
        return self.filter.recursion(world.motion, world.sensor)

    def update(self, world: World, mean: Array, cov: Array, z: Array) -> Posterior:
        """The formula itself."""
        method, models = self.filter.method, (world.motion, world.sensor)
        state = method.begin(Gaussian(mean, cov), *models)
        state, surprise = method.update(state, z, *models)
        return Posterior(*method.output(state, *models), *surprise)

    def run(self, world: World, mean: Array, cov: Array, plots: Array, dt: float) -> Posterior:
        """Step by step."""
        recursion = self.recursion(world)
        state, results = recursion.begin(mean, cov), dict[str, Any]()
        for z in plots:
            state, results = recursion.step(state, {"z": z, "dt": dt})
        return Posterior(**{name: results[name] for name in Posterior._fields})


@dataclass(frozen=True)
class Whole:
    """A function over whole recordings, given one run."""

    filter: Outside

    def update(self, world: World, mean: Array, cov: Array, z: Array) -> Posterior:
        """A recording of one plot, at the time of the start."""
        return self.run(world, mean, cov, z[None], 0.0)

    def run(self, world: World, mean: Array, cov: Array, plots: Array, dt: float) -> Posterior:
        """A recording of one run."""
        steps = np.full((1, len(plots)), float(dt))
        start = Gaussian(mean[None], cov[None])
        said = self.filter(plots[None], steps, start, world.motion, world.sensor)
        return Posterior(said.mean[0, -1], said.cov[0, -1], *[None] * 5)


def subject_of(given: FilterLike | Outside) -> Stepping | Whole:
    """A filter, its name or its formula as a subject."""
    found = catalogue.find(given)
    return Whole(found) if isinstance(found, Outside) else Stepping(found)
