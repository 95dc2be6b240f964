"""A world for one target and one scan: it moves, is seen or missed, and stands among false plots.

`World.step` is a formula: recorded once, run over all runs, by itself (`simulate`) or in front of a
filter in one kernel. Its random numbers are made inside it, from the numbers of the run whose truth
and of the run whose noise a lane has. What it takes and gives is all named `world.`, so that a
filter's own numbers can stand beside them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments import false_plots
from boresight.experiments.scenario import Scenario
from boresight.lanes import Leaf, Rate, Scalar, Vector
from boresight.maths import random, seeds, select, wrap
from boresight.maths.seeds import Stream
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of, structure, with_numbers
from boresight.models.sensors import Sensor

Array = Any
_SINGULAR = 1e-12  # of a variance: less is rounding left over from the noise's other directions
_MOTION, _SENSOR = "world.motion", "world.sensor"
_RUNS = {
    "world.key": (Vector(2), Rate.FIXED),
    "world.truth_run": (Scalar(), Rate.LANE),
    "world.noise_run": (Scalar(), Rate.LANE),
}


class Seen(NamedTuple):
    """One scan of one target.

    Attributes:
        truth: (n,) where it is.
        z: (k,) its own plot, NaN where it was missed.
        candidates: (m, k) all plots of the scan, its own among them; None without false plots.
    """

    truth: Array
    z: Array
    candidates: Array | None


@dataclass(frozen=True, eq=False)
class World:
    """A scenario, and the sensor that sees it; equal worlds record the same program.

    Attributes:
        scenario: what happens.
        sensor: what sees it.

    Raises:
        UsageError: a bias of what the sensor does not measure, too many false plots.
    """

    scenario: Scenario
    sensor: Sensor

    def __post_init__(self) -> None:
        unseen = sorted(set(self.scenario.bias) - set(self.sensor.names))
        if unseen:
            raise UsageError(
                f"scenario {self.scenario.name!r} has a bias of {unseen[0]}",
                why=f"the sensor measures {', '.join(self.sensor.names)}",
            )
        false_plots.candidates(self.scenario)

    @property
    def state(self) -> dict[str, Leaf]:
        """What travels from scan to scan."""
        return {"truth": Vector(len(self.scenario.motion.names))}

    @property
    def inputs(self) -> dict[str, tuple[Leaf, Rate]]:
        """What `step` takes, and how often it changes."""
        return {name: (leaf, rate) for name, (leaf, rate, _) in self._given.items()} | _RUNS

    @property
    def candidates(self) -> int:
        """How many plots a scan can hold; 0 where there are no false ones."""
        return false_plots.candidates(self.scenario)

    def values(self, seed: int, truth_runs: Array, noise_runs: Array) -> dict[str, Array]:
        """The inputs of a kernel.

        Args:
            seed: of all that is random.
            truth_runs: (lanes,) number of the run whose truth each lane has.
            noise_runs: (lanes,) that of the run whose noise, detection and false plots it has.
        """
        return {name: value for name, (_, _, value) in self._given.items()} | {
            "world.key": np.array(random.key(seed, self.scenario.name)),
            "world.truth_run": truth_runs,
            "world.noise_run": noise_runs,
        }

    def origins(self, seed: int, first: int, runs: int) -> Array:
        """(runs, n) states in which runs [first, first + runs) start, at time 0."""
        scenario, n = self.scenario, len(self.scenario.motion.names)
        if scenario.path is not None:
            return np.broadcast_to(scenario.path[0], (runs, n))
        if scenario.draw is None:
            return np.broadcast_to(scenario.initial, (runs, n))
        drawn = seeds.normals(seed, scenario.name, Stream.ORIGIN, (n,), runs=runs, first=first)
        return scenario.draw(drawn)

    def step(
        self, state: Mapping[str, Any], inputs: Mapping[str, Any]
    ) -> tuple[dict[str, Array], Seen]:
        """One scan; the formula that is recorded.

        Args:
            state: `truth` (n,) at the scan before.
            inputs: those of `inputs`; others are left alone.
        """
        given = dict(inputs)
        motion = with_numbers(self.scenario.motion, _MOTION, given)
        sensor = with_numbers(self.sensor, _SENSOR, given)
        truth = self._moved(motion, state["truth"], given)
        z = _measured(sensor, motion, truth, given)
        among = None
        if self.candidates:
            count = 2 + self.candidates * len(z)
            drawn = random.uniforms(*_counter(given), Stream.FALSE_PLOTS, count)
            among = false_plots.among(z, drawn, given)
        return {"truth": truth}, Seen(truth, z, among)

    def _moved(self, motion: Motion, state: Array, inputs: Mapping[str, Any]) -> Array:
        """Where the target is at this scan."""
        if "world.path" in inputs:
            return inputs["world.path"]
        moved = [*motion.move(state, inputs["world.dt"])]
        counter = inputs["world.key"], inputs["world.truth_run"], inputs["world.scan"]
        pushes = random.normals(*counter, Stream.TRUTH, self._root.shape[1])
        for weight, i, j in zip(inputs["world.root"], *np.nonzero(self._root), strict=True):
            moved[i] = moved[i] + weight * pushes[j]
        return np.array(moved)

    @cached_property
    def _root(self) -> Array:
        """(n, rank) factor of the process noise of a whole step."""
        return root_of(self.scenario.motion.noise(self.scenario.dt_s))

    @cached_property
    def _given(self) -> dict[str, tuple[Leaf, Rate, Array]]:
        """Leaf, rate and value of every input but key and runs."""
        world, names = self.scenario, self.sensor.names
        models = numbers(world.motion, _MOTION) | numbers(self.sensor, _SENSOR)
        found = {
            name: (leaf, *rate_of(name, value, leaf)) for name, (value, leaf) in models.items()
        }
        found["world.scan"] = Scalar(), Rate.STEP, np.arange(world.scans, dtype=float)
        if world.path is not None:
            found["world.path"] = Vector(len(world.initial)), Rate.STEP, world.path
        else:
            weights = self._root[np.nonzero(self._root)]
            moves = world.time_s > 0.0
            found["world.dt"] = Scalar(), Rate.STEP, world.dt[0]
            found["world.root"] = Vector(len(weights)), Rate.STEP, np.outer(moves, weights)
        if world.bias:
            bias = np.array([world.bias.get(name, 0.0) for name in names])
            found["world.bias"] = Vector(len(names)), Rate.FIXED, bias
        if world.detection < 1.0:
            certain = np.arange(world.scans) < world.spent
            chance = np.where(certain, 1.0, world.detection)
            found["world.detection"] = Scalar(), Rate.STEP, chance
        return found | false_plots.inputs(world, names)

    @property
    def _identity(self) -> tuple[Any, ...]:
        models = structure(self.scenario.motion), structure(self.sensor)
        pattern = tuple(map(tuple, np.nonzero(self._root)))
        return (*models, tuple(self.inputs.items()), pattern)

    def __hash__(self) -> int:
        return hash(self._identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, World) and self._identity == other._identity


def _counter(inputs: Mapping[str, Any]) -> tuple[Any, Any, Any]:
    """Key, run and scan of what is random about plots."""
    return inputs["world.key"], inputs["world.noise_run"], inputs["world.scan"]


def _measured(sensor: Sensor, motion: Motion, truth: Array, inputs: Mapping[str, Any]) -> Array:
    """The target's own plot (k,), NaN where it was missed."""
    parts = sensor.components(motion)
    noise = sensor.coloured(random.normals(*_counter(inputs), Stream.NOISE, len(parts)))
    bias = inputs.get("world.bias", np.zeros(len(parts)))
    told = [c.value(truth) + c.sigma * e + b for c, e, b in zip(parts, noise, bias, strict=True)]
    z = np.array([wrap(v) if c.is_angle else v for c, v in zip(parts, told, strict=True)])
    if "world.detection" not in inputs:
        return z
    chance = random.uniforms(*_counter(inputs), Stream.DETECTION, 1)[0]
    return np.array([select(chance < inputs["world.detection"], v, np.nan) for v in z])


def root_of(cov: Array) -> Array:
    """A factor B (n, rank) with B B' = cov: Cholesky's, without its empty columns.

    For a singular G Q G' it is G itself times the noise's standard deviation: what is drawn is the
    acceleration, and the truth never leaves the directions in which noise can push it.

    Args:
        cov: (n, n), symmetric, positive semidefinite.
    """
    rest, columns = np.array(cov, dtype=float), []
    for j in range(len(rest)):
        if rest[j, j] > _SINGULAR * cov[j, j]:
            column = rest[:, j] / np.sqrt(rest[j, j])
            columns.append(column)
            rest = rest - np.outer(column, column)
    return np.stack(columns, axis=1) if columns else np.zeros((len(rest), 0))
