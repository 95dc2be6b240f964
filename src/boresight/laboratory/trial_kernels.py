"""The formulas of a trial as kernels: all in one, or world and score apart.

In one kernel a scan is drawn, happens, is seen, filtered and scored, and nothing of it is stored
but sums. Where that is too large to record, or the filter is no formula, the same pieces run one
after the other over arrays.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from boresight.experiments.world import Seen, World
from boresight.filters.recursion import Recursion
from boresight.laboratory.score import Score
from boresight.lanes import (
    Kernel,
    Leaf,
    Rate,
    Scalar,
    Symmetric,
    Vector,
    make_kernel,
    select,
    trace,
)
from boresight.models.parameters import rate_of, structure

Array = Any
Inputs = Mapping[str, Any]
TOLD = ("mean", "cov", "nis", "dof")  # what a filter says that is scored
_SCORING = {
    "counts": (Scalar(), Rate.LANE),  # 1; or 0 for a lane that only fills its block
    "scan": (Scalar(), Rate.STEP),
    "scored": (Scalar(), Rate.STEP),
}


@dataclass(frozen=True)
class Trial:
    """A contender in a world; equal trials record the same programs.

    Attributes:
        world: what happens.
        recursion: what filters it; of a filter that is no formula, one without a method.
        score: what is measured.
        measured: which numbers of a plot the contender takes, in its sensor's order.
    """

    world: World
    recursion: Recursion
    score: Score
    measured: tuple[int, ...]

    @property
    def _identity(self) -> tuple[Any, ...]:
        own = self.recursion
        models = [structure(m) for m in (own.motion, own.sensor, own.guard) if m is not None]
        rates = tuple((name, leaf, rate) for name, (leaf, rate, _) in self.beliefs.items())
        return (self.world, own.method, *models, rates, self.score, self.measured)

    def __hash__(self) -> int:
        return hash(self._identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Trial) and self._identity == other._identity

    @cached_property
    def beliefs(self) -> dict[str, tuple[Leaf, Rate, Array]]:
        """Leaf, rate and value of the numbers of what the contender believes."""
        models = self.recursion.models()
        return {name: (leaf, *rate_of(name, value, leaf)) for name, (value, leaf) in models.items()}

    def plots(self, scene: Seen, taken: Any) -> Array:
        """What the contender is given of a scan: NaN where the plot was used for the start."""
        seen = scene.z if scene.candidates is None else scene.candidates
        numbers = seen[..., list(self.measured)].ravel()
        shown = [select(taken > 0.5, number, np.nan) for number in numbers]
        return np.array(shown).reshape(self.recursion.plot.shape)

    def fused(self, state: Inputs, inputs: Inputs) -> tuple[Any, Any]:
        """A scan from its random numbers to its score."""
        moved, scene = self.world.step(_part(state, "world."), inputs)
        seen = {"z": self.plots(scene, inputs["taken"])}
        post, told = self.recursion.step(_part(state, "filter."), dict(inputs) | seen)
        kept, results = self.scored(_part(state, "kept."), scene.truth, told, inputs)
        return _named("world.", moved) | _named("filter.", post) | _named("kept.", kept), results

    def scored(
        self, kept: Inputs, truth: Array, told: Inputs, inputs: Inputs
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """What is kept of a run, and what of it is summed over runs."""
        columns = self.score.measure(truth, told)
        flat = [x for name, leaf in self.score.columns.items() for x in leaf.flatten(columns[name])]
        sums = np.array([select(inputs["counts"] > 0.5, x, 0.0) for x in flat])
        new = self.score.keep(kept, columns, inputs["scan"], inputs["scored"])
        return dict(new), {"sums": sums, "final_m": columns["distance_m"]}

    @property
    def results(self) -> dict[str, tuple[Leaf, Rate]]:
        """What a scoring kernel writes."""
        size = sum(leaf.size for leaf in self.score.columns.values())
        return {"sums": (Vector(size), Rate.STEP), "final_m": (Scalar(), Rate.LANE)}


@lru_cache(maxsize=64)
def fused_kernel(trial: Trial) -> Kernel:
    """Draws, truth, plots, filter and score in one; FormulaError where that is too large."""
    filtering = {"dt": (Scalar(), Rate.STEP), "taken": (Scalar(), Rate.STEP)}
    beliefs = {name: (leaf, rate) for name, (leaf, rate, _) in trial.beliefs.items()}
    layouts = {"world.": trial.world.state, "filter.": trial.recursion.layout}
    layouts |= {"kept.": trial.score.layout}
    return make_kernel(
        trace(
            trial.fused,
            state={
                prefix + name: leaf for prefix, of in layouts.items() for name, leaf in of.items()
            },
            inputs=trial.world.inputs | beliefs | filtering | _SCORING,
            outputs=trial.results,
        )
    )


@lru_cache(maxsize=64)
def world_kernel(trial: Trial) -> Kernel:
    """Truth and plots by themselves."""

    def step(state: dict[str, Any], inputs: dict[str, Any]) -> tuple[Any, Any]:
        moved, scene = trial.world.step(state, inputs)
        own = scene.z[list(trial.measured)]
        results = {"truth": scene.truth, "own": own, "z": trial.plots(scene, inputs["taken"])}
        return moved, results

    return make_kernel(
        trace(
            step,
            state=trial.world.state,
            inputs=trial.world.inputs | {"taken": (Scalar(), Rate.STEP)},
            outputs={
                "truth": (trial.world.state["truth"], Rate.EACH),
                "own": (Vector(len(trial.measured)), Rate.EACH),
                "z": (trial.recursion.plot, Rate.EACH),
            },
        )
    )


def filter_kernel(trial: Trial) -> Kernel:
    """The filter by itself, that says everything of every scan."""
    rates = {name: rate for name, (_, rate, _) in trial.beliefs.items()}
    rates |= {"dt": Rate.STEP, "z": Rate.EACH}
    return trial.recursion.kernel(rates, dict.fromkeys(TOLD, Rate.EACH))


@lru_cache(maxsize=64)
def score_kernel(trial: Trial) -> Kernel:
    """The score of what a filter has said."""
    n = len(trial.score.estimate)

    def step(state: dict[str, Any], inputs: dict[str, Any]) -> tuple[Any, Any]:
        kept, results = trial.scored(_part(state, "kept."), inputs["truth"], inputs, inputs)
        return _named("kept.", kept), results

    return make_kernel(
        trace(
            step,
            state=_named("kept.", trial.score.layout),
            inputs={
                "truth": (Vector(len(trial.score.truth)), Rate.EACH),
                "mean": (Vector(n), Rate.EACH),
                "cov": (Symmetric(n), Rate.EACH),
                "nis": (Scalar(), Rate.EACH),
                "dof": (Scalar(), Rate.EACH),
            }
            | _SCORING,
            outputs=trial.results,
        )
    )


def _part(state: Inputs, prefix: str) -> dict[str, Any]:
    return {name[len(prefix) :]: x for name, x in state.items() if name.startswith(prefix)}


def _named(prefix: str, values: Inputs) -> dict[str, Any]:
    return {prefix + name: value for name, value in values.items()}
