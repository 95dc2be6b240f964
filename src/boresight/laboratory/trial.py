"""One chunk of a cell: runs [first, first + count) of a contender in a setting, scored.

Every run is a lane. A batch of lanes is simulated, filtered and scored in one kernel, which writes
nothing but sums over runs; a batch is so large that these stay in the processor's cache. The same
pieces run one after the other where one kernel would be too large, or the filter is no formula.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from boresight.errors import FormulaError, UsageError
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import begin, starts
from boresight.experiments.world import World
from boresight.filters.method import Outside
from boresight.filters.nearest import nearest
from boresight.filters.recursion import Recursion, run_recursion, spread
from boresight.filters.start import SPEED_MPS, SPREADS
from boresight.laboratory.batches import Batch, batches
from boresight.laboratory.score import Score
from boresight.laboratory.scores import Scores
from boresight.laboratory.study import Contender, Draws, Setting, Study
from boresight.laboratory.sums import Tree
from boresight.laboratory.trial_kernels import Trial, fused_kernel, score_kernel, world_kernel
from boresight.lanes import BLOCK, Kernel, Leaf, Rate, States, pack_states
from boresight.lanes.program import Slot
from boresight.maths import Gaussian
from boresight.models.motion import Motion

Array = Any
_SUMS = 2**18  # numbers that a batch writes: 2 MiB
_STORED = 2**21  # numbers that a batch has between its kernels: 16 MiB
_LANES = 1024  # of a batch at most
_TOLD = ("mean", "cov", "nis", "dof")


def run_chunk(
    study: Study, setting: Setting, contender: Contender, first: int, count: int
) -> Scores:
    """Simulate, filter and score runs [first, first + count) of a contender in a setting.

    Args:
        study: says seed, metrics and limits.
        setting: the world.
        contender: the filter with what it believes.
        first: number of the first run.
        count: how many.

    Returns:
        The scores. Those of a run, and of a node, are the same to the last bit in every chunk.

    Raises:
        UsageError: the contender needs what the setting's sensor does not measure, or a gate; no
            scan is scored.
    """
    begun = time.thread_time()
    chunk = _Chunk(study, setting, contender)
    tree, runs = Tree(), []
    for batch in batches(first, count, chunk.lanes):
        final, out = chunk.run(batch)
        runs.append(chunk.of_runs(final, out["final_m"], batch.counts))
        tree.add(batch.nodes(out["sums"], chunk.trial.score.columns))
    each = {name: np.concatenate([part[name] for part in runs]) for name in runs[0]}
    return Scores(first, count, each, tree.nodes, time.thread_time() - begun)


def told_again(
    study: Study, setting: Setting, contender: Contender, runs: int
) -> tuple[Array, dict[str, Array]]:
    """The first runs again, with all that the filter said at every scan.

    Returns:
        The truth (runs, scans, n), and `mean`, `cov`, `nis` and `dof` by name.
    """
    chunk, truths, parts = _Chunk(study, setting, contender), [], []
    for batch in batches(0, runs, chunk.lanes):
        truth, told = chunk.told(*chunk.begun(batch))
        truths.append(truth[batch.counts])
        parts.append({name: each[batch.counts] for name, each in told.items()})
    named = {name: np.concatenate([part[name] for part in parts]) for name in _TOLD}
    return np.concatenate(truths), named


def trial_of(study: Study, setting: Setting, contender: Contender) -> Trial:
    """The formulas of a cell."""
    world = World(setting.scenario, setting.scenario.sensor)
    names, scans = world.sensor.names, world.scenario.scans
    if not 0 <= study.first_scan < scans:
        raise UsageError(f"first_scan={study.first_scan} leaves none of {scans} scans to be scored")
    unknown = [name for name in contender.sensor.names if name not in names]
    if unknown:
        raise UsageError(
            f"{contender.label!r} needs {unknown[0]}",
            why=f"the sensor of scenario {setting.scenario.name!r} measures {', '.join(names)}",
        )
    score = Score(world.scenario.motion.names, contender.motion.names, study.metrics, study.limits)
    measured = tuple(names.index(name) for name in contender.sensor.names)
    return Trial(world, _recursion(contender, world.candidates), score, measured)


def _recursion(contender: Contender, candidates: int) -> Recursion:
    """The filter, with a gate where it has one; that of an `Outside` has no method."""
    outside = isinstance(contender.filter, Outside)
    if candidates and (outside or contender.gate is None):
        raise UsageError(
            f"{contender.label!r} cannot tell the target's plot from false ones",
            why="a function over whole recordings takes one plot a scan" if outside else "",
            next_step="give it a gate: gate = 16" if not outside else "leave false plots out",
        )
    if isinstance(contender.filter, Outside):
        return Recursion(None, contender.motion, contender.sensor)  # type: ignore[arg-type]
    guard = None
    if contender.gate is not None:
        guard = nearest(contender.sensor, contender.gate, max(1, candidates))
    method = contender.filter.method
    return Recursion(method, contender.motion, contender.sensor, guard)


@dataclass(frozen=True, eq=False)
class _Chunk:
    """What the batches of a chunk share."""

    study: Study
    setting: Setting
    contender: Contender

    @cached_property
    def trial(self) -> Trial:
        return trial_of(self.study, self.setting, self.contender)

    @cached_property
    def fused(self) -> Kernel | None:
        """All in one kernel, or None where there can be none."""
        if isinstance(self.contender.filter, Outside):
            return None
        try:
            return fused_kernel(self.trial)
        except FormulaError:  # too large; what is wrong by itself is told by its own kernel again
            return None

    @cached_property
    def lanes(self) -> int:
        """How many lanes a batch has at most: a power of two."""
        scans, (n, k) = self.setting.scenario.scans, self.trial.recursion.size
        room = _SUMS // (scans * self.trial.results["sums"][0].size) * BLOCK
        if self.fused is None:
            room = _STORED // (scans * (len(self.trial.score.truth) + n + n * n + 2 * k))
        return 1 << int(np.clip(room, BLOCK, _LANES)).bit_length() - 1

    @cached_property
    def scans(self) -> dict[str, Array]:
        """What changes with the scan, by the names of inputs."""
        scene = self.setting.scenario
        number, dt = np.arange(scene.scans), scene.dt[0]
        taken = number >= scene.spent
        return {
            "scan": number,
            "scored": number >= self.study.first_scan,
            "taken": taken,
            "dt": np.where(taken, dt, 0.0),  # a start from plots is where the last of them is
        }

    def of_runs(self, final: States, final_m: Array, counts: Array) -> dict[str, Array]:
        """Numbers of each run that counts."""
        score, scans = self.trial.score, self.setting.scenario.scans
        kept = {name: final[f"kept.{name}"][counts] for name in score.layout}
        return score.of_runs(kept, final_m[counts], scans, scans - self.study.first_scan)

    def begun(self, batch: Batch) -> tuple[dict[str, Array], Array, Gaussian]:
        """Numbers of the world, where each truth starts, and where each filter does."""
        study, world = self.study, self.trial.world
        runs = [batch.runs * (draws == "each") for draws in (study.truth, study.noise)]
        values = world.values(study.seed, *runs) | self.scans | {"counts": batch.counts}
        origin = _drawn(study.truth, batch, partial(world.origins, study.seed))
        return values, origin, self._start(batch, values, origin)

    def run(self, batch: Batch) -> tuple[States, dict[str, Array]]:
        """What is kept of each lane in the end, `sums` over blocks, and each lane's `final_m`."""
        values, origin, start = self.begun(batch)
        if self.fused is None:
            return self._apart(values, origin, start)
        lanes = len(batch.runs)
        parts = (
            pack_states(_slots(self.trial.world.state), {"truth": origin}),
            self.trial.recursion.states(start, lanes),
            self._nothing(lanes),
        )
        blocks = np.concatenate([part.data for part in parts], axis=1)
        states = States(self.fused.program.state, blocks, lanes)
        beliefs = {name: value for name, (_, _, value) in self.trial.beliefs.items()}
        return self.fused.run(states, values | beliefs, self.setting.scenario.scans)

    def _nothing(self, lanes: int) -> States:
        """What is kept of runs that have not begun."""
        kept = _slots({f"kept.{name}": leaf for name, leaf in self.trial.score.layout.items()})
        return pack_states(kept, {slot.name: np.zeros(lanes) for slot in kept})

    def _start(self, batch: Batch, values: Mapping[str, Array], origin: Array) -> Gaussian:
        """Where the contender begins on each lane."""
        study, scene, believed = self.study, self.setting.scenario, self.contender.motion
        lanes, n = len(batch.runs), len(scene.motion.names)
        own, normal = np.empty((lanes, 0, 0)), np.empty((lanes, n))
        if scene.spent:
            own = self._world(values, origin, scene.spent)["own"]
        elif scene.begin == "random draw":
            normal = _drawn(study.noise, batch, partial(_starts, scene, study.seed))
        prior = begin(scene, believed, self.contender.sensor, own, normal)
        return prior if scene.spent else _widened(prior, scene.motion, believed)

    def _world(self, values: Mapping[str, Array], origin: Array, scans: int) -> dict[str, Array]:
        """The first scans of the world: `truth`, `own` plots, and the plots `z` to be filtered."""
        kernel = world_kernel(self.trial)
        first = {
            slot.name: values[slot.name][:scans] if slot.rate is Rate.STEP else values[slot.name]
            for slot in kernel.program.inputs
        }
        return kernel.run(pack_states(kernel.program.state, {"truth": origin}), first, scans)[1]

    def _apart(
        self, values: Mapping[str, Array], origin: Array, start: Gaussian
    ) -> tuple[States, dict[str, Array]]:
        """World, filter and score one after the other."""
        truth, told = self.told(values, origin, start)
        given = {**values, **told, "truth": truth}
        return score_kernel(self.trial).run(
            self._nothing(len(truth)), given, self.setting.scenario.scans
        )

    def told(
        self, values: Mapping[str, Array], origin: Array, start: Gaussian
    ) -> tuple[Array, dict[str, Array]]:
        """The truth, and what the filter says of it: world and filter one after the other."""
        filtered = self.contender.filter
        scene = self._world(values, origin, self.setting.scenario.scans)
        z, dt = scene["z"], self.scans["dt"][None]
        if isinstance(filtered, Outside):
            models = self.contender.motion, self.contender.sensor
            mean, cov = filtered(z, dt, Gaussian(*spread(start, len(z))), *models)
            nothing = np.zeros(z.shape[:2])
            return scene["truth"], {"mean": mean, "cov": cov, "nis": nothing, "dof": nothing}
        told = run_recursion(self.trial.recursion, z, dt, start, outputs=_TOLD).others
        return scene["truth"], told


def _slots(layout: Mapping[str, Leaf]) -> tuple[Slot, ...]:
    return tuple(Slot(name, leaf) for name, leaf in layout.items())


def _drawn(draws: Draws, batch: Batch, draw: Callable[[int, int], Array]) -> Array:
    """What (first, count) draws of each run, for each lane; or what it draws of run 0, for all."""
    if draws == "one":
        return np.repeat(draw(0, 1), len(batch.runs), axis=0)
    first = int(batch.runs[0])
    return draw(first, int(batch.runs[-1]) - first + 1)[batch.runs - first]


def _starts(scenario: Scenario, seed: int, first: int, count: int) -> Array:
    return starts(scenario, seed, (first, count), count)


def _widened(prior: Gaussian, known: Motion, believed: Motion) -> Gaussian:
    """A prior of the world's states as one of the contender's: what it lacks is about zero."""
    if known.names == believed.names:
        return prior
    shared = [name for name in believed.names if name in known.names]
    to = [believed.names.index(name) for name in shared]
    of = [known.names.index(name) for name in shared]
    n, lead = len(believed.names), np.shape(prior.mean)[:-1]
    spreads = [SPREADS.get(name.rsplit("_", 1)[-1], SPEED_MPS) for name in believed.names]
    mean, cov = np.zeros((*lead, n)), np.diag(np.square(spreads))
    mean[..., to] = np.asarray(prior.mean)[..., of]
    cov[np.ix_(to, to)] = np.asarray(prior.cov)[np.ix_(of, of)]
    return Gaussian(mean, cov)
