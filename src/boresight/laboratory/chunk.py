"""The batches of one chunk: how large they are, where their lanes begin, how they are run.

A batch of lanes is simulated, filtered and scored in one kernel, which writes nothing but sums over
runs; long recordings are cut into stretches, so that these sums stay in the processor's cache. The
same pieces run one after the other where one kernel would be too large, or the filter is no
formula.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import FormulaError
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import begin, starts
from boresight.filters.method import Outside
from boresight.filters.recursion import spread
from boresight.filters.start import SPEED_MPS, SPREADS
from boresight.laboratory.batches import Batch, batches
from boresight.laboratory.study import Contender, Draws, Setting, Study
from boresight.laboratory.trial_kernels import (
    TOLD,
    Trial,
    filter_kernel,
    fused_kernel,
    score_kernel,
    world_kernel,
)
from boresight.lanes import BLOCK, Kernel, Leaf, Rate, States, pack_states
from boresight.lanes.program import Slot
from boresight.maths import Gaussian
from boresight.models.motion import Motion

Array = Any
Values = Mapping[str, Array]  # inputs of kernels
_SUMS = 2**18  # numbers that a kernel writes at a time: 2 MiB
_STORED = 2**21  # numbers that lie between kernels: 16 MiB
_BEGUN: set[tuple[int, int]] = set()  # cells of this process whose lanes have begun before


class Lanes(NamedTuple):
    """Lanes after some scans.

    Attributes:
        world, filtered, kept: what travels on; in one kernel all of it is in `kept`. What is
            `filtered` of a function over whole recordings is the Gaussian where it begins.
    """

    world: States
    filtered: Any
    kept: States


@dataclass(frozen=True, eq=False)
class Chunk:
    """What all batches share.

    Attributes:
        study, setting, contender: of the cell.
        trial: their formulas.
    """

    study: Study
    setting: Setting
    contender: Contender
    trial: Trial

    @cached_property
    def fused(self) -> Kernel | None:
        """All in one kernel, or None where there can be none."""
        if self._is_outside:
            return None
        try:
            return fused_kernel(self.trial)
        except FormulaError:  # too large; what is wrong by itself is told by its own kernel again
            return None

    @property
    def _is_outside(self) -> bool:
        return isinstance(self.contender.filter, Outside)

    @cached_property
    def _world(self) -> Kernel:
        return world_kernel(self.trial)

    @cached_property
    def _score(self) -> Kernel:
        return score_kernel(self.trial)

    def prepare(self) -> None:
        """Make what is made once, which no run must seem to take."""
        if self.fused is None or self.setting.scenario.spent:
            _ = self._world
        if self.fused is None:
            _ = self._score
        place = id(self.setting), id(self.contender)
        if place not in _BEGUN:
            _BEGUN.add(place)
            self.begun(next(batches(0, 1, self.lanes)))  # small kernels, and imports

    @cached_property
    def lanes(self) -> int:
        """How many lanes a batch has at most: a power of two, enough to be worth a call."""
        least, most = (256, 2048) if self.fused else (BLOCK if self._is_outside else 64, 1024)
        room = np.clip(self._room // self.setting.scenario.scans, least, most)
        return 1 << int(room).bit_length() - 1

    @cached_property
    def _room(self) -> int:
        """Lanes times scans that fit into the memory of a batch."""
        if self.fused:
            return _SUMS // self.trial.results["sums"][0].size * BLOCK
        n, k = self.trial.recursion.size
        return _STORED // (len(self.trial.score.truth) + n + n * n + 2 * k)

    def run(self, batch: Batch) -> tuple[Array, dict[str, Array]]:
        """Sums (nodes, scans, size) over runs, and numbers of each run that counts."""
        score, scans = self.trial.score, self.setting.scenario.scans
        lanes, values = self.begun(batch)
        go = self._apart if self.fused is None else self._at_once
        stretch = scans if self._is_outside else max(1, self._room // len(batch.runs))
        totals = []
        for first in range(0, scans, stretch):
            lanes, out = go(lanes, self._during(values, slice(first, first + stretch)))
            totals.append(batch.totals(out["sums"]))
        kept = {name: lanes.kept[f"kept.{name}"][batch.counts] for name in score.layout}
        final_m, scored = out["final_m"][batch.counts], scans - self.study.first_scan
        return np.concatenate(totals, axis=1), score.of_runs(kept, final_m, scored)

    def begun(self, batch: Batch) -> tuple[Lanes, Values]:
        """Lanes before the first scan, and all inputs of kernels."""
        study, world, lanes = self.study, self.trial.world, len(batch.runs)
        runs = [batch.runs * (draws == "each") for draws in (study.truth, study.noise)]
        values = world.values(study.seed, *runs) | self._scans | {"counts": batch.counts}
        values |= {name: value for name, (_, _, value) in self.trial.beliefs.items()}
        origin = _drawn(study.truth, batch, partial(world.origins, study.seed))
        moving = pack_states(_slots(world.state), {"truth": origin})
        start = self._start(batch, values, moving)
        slots = _slots({f"kept.{name}": leaf for name, leaf in self.trial.score.layout.items()})
        kept = pack_states(slots, {slot.name: np.zeros(lanes) for slot in slots})
        if self._is_outside:
            return Lanes(moving, Gaussian(*spread(start, lanes)), kept), values
        filtered = self.trial.recursion.states(start, lanes)
        if self.fused:
            blocks = np.concatenate([each.data for each in (moving, filtered, kept)], axis=1)
            kept = States(self.fused.program.state, blocks, lanes)
        return Lanes(moving, filtered, kept), values

    @cached_property
    def _scans(self) -> dict[str, Array]:
        """What changes with the scan, by the names of inputs."""
        scene = self.setting.scenario
        number = np.arange(scene.scans)
        taken = number >= scene.spent
        return {
            "scan": number,
            "scored": number >= self.study.first_scan,
            "taken": taken,
            "dt": np.where(taken, scene.dt[0], 0.0),  # a start from plots is where the last is
        }

    @cached_property
    def _rates(self) -> dict[str, Rate]:
        """How often inputs of kernels change."""
        world = {name: rate for name, (_, rate) in self.trial.world.inputs.items()}
        beliefs = {name: rate for name, (_, rate, _) in self.trial.beliefs.items()}
        return world | beliefs | dict.fromkeys(self._scans, Rate.STEP) | {"counts": Rate.LANE}

    def _during(self, values: Values, part: slice) -> Values:
        """The inputs of a stretch of scans."""
        return {n: v[part] if self._rates[n] is Rate.STEP else v for n, v in values.items()}

    def _start(self, batch: Batch, values: Values, moving: States) -> Gaussian:
        """Where the contender begins on each lane."""
        study, scene, believed = self.study, self.setting.scenario, self.contender.motion
        lanes, n = len(batch.runs), len(scene.motion.names)
        own, normal = np.empty((lanes, 0, 0)), np.empty((lanes, n))
        if scene.spent:
            first = self._during(values, slice(scene.spent))
            own = self._world.run(moving, first, scene.spent)[1]["own"]
        elif scene.begin == "random draw":
            normal = _drawn(study.noise, batch, partial(_starts, scene, study.seed))
        prior = begin(scene, believed, self.contender.sensor, own, normal)
        return prior if scene.spent else _widened(prior, scene.motion, believed)

    def _at_once(self, lanes: Lanes, values: Values) -> tuple[Lanes, dict[str, Array]]:
        """World, filter and score in one kernel."""
        kept, out = self.fused.run(lanes.kept, values, len(values["scan"]))  # type: ignore[union-attr]
        return lanes._replace(kept=kept), out

    def _apart(self, lanes: Lanes, values: Values) -> tuple[Lanes, dict[str, Array]]:
        """World, filter and score one after the other."""
        lanes, told = self.told(lanes, values)
        kept, out = self._score.run(lanes.kept, {**values, **told}, len(values["scan"]))
        return lanes._replace(kept=kept), out

    def told(self, lanes: Lanes, values: Values) -> tuple[Lanes, dict[str, Array]]:
        """World and filter: `truth` (lanes, scans, n), and what the filter says, by name."""
        scans = len(values["scan"])
        world, scene = self._world.run(lanes.world, values, scans)
        if isinstance(self.contender.filter, Outside):
            models = self.contender.motion, self.contender.sensor
            said = self.contender.filter(scene["z"], values["dt"][None], lanes.filtered, *models)
            nothing = np.zeros((len(said.mean), scans))
            told = said._asdict() | {"nis": nothing, "dof": nothing}
            return lanes._replace(world=world), {"truth": scene["truth"], **told}
        kernel = filter_kernel(self.trial)
        filtered, told = kernel.run(lanes.filtered, {**values, "z": scene["z"]}, scans)
        lanes = lanes._replace(world=world, filtered=filtered)
        return lanes, {"truth": scene["truth"], **{name: told[name] for name in TOLD}}


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
