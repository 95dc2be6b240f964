"""Truth and plots of many runs: the filters' own formulas, run forward with drawn noise.

A step of the world is recorded once and run over all runs at once, as filters are. What is random
comes from `maths.seeds`: the truth, the plots' noise and the start of a filter each have a stream
of their own, so run 7 is the same run whatever the number of runs.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.scenario import Scenario, lookup
from boresight.filters.start import one_plot, two_plots
from boresight.lanes import Kernel, Matrix, Rate, Vector, make_kernel, pack_states, trace
from boresight.maths import Gaussian, wrap
from boresight.maths.seeds import Stream, normals
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of, structure, with_numbers
from boresight.models.sensors import Sensor

Array = Any
_SINGULAR = 1e-12  # of a variance: less is rounding left over from the noise's other directions


class Truth(NamedTuple):
    """Where targets were.

    Attributes:
        time_s: (scans,).
        states: (runs, scans, n).
        names: name of each state element, with its unit.
    """

    time_s: Array
    states: Array
    names: tuple[str, ...]


class Plots(NamedTuple):
    """What a sensor measured, and where a filter may begin.

    Attributes:
        time_s: (scans,).
        z: (runs, scans, k), in the order of the sensor's `names`, angles in radians.
        dt: (1, scans), s before each scan.
        prior: mean (runs, n), cov (n, n) or (runs, n, n), before the first plot.
    """

    time_s: Array
    z: Array
    dt: Array
    prior: Gaussian


def simulate(
    scenario: str | Scenario,
    sensor: Sensor | None = None,
    *,
    runs: int,
    seed: int,
    first: int = 0,
) -> tuple[Truth, Plots]:
    """Truth and plots of many runs of a scenario.

    Args:
        scenario: a `Scenario`, or the name of one.
        sensor: what sees the target, if not the scenario's own. Sensors with as many components
            see the same truth through the same normal numbers.
        runs: number of runs.
        seed: run i of a seed is the same whatever `runs` is.
        first: number of the first run.

    Returns:
        The truth and the plots; `bs.run` takes the plots as they are.

    Raises:
        UsageError: an unknown scenario, or a seed or number of runs out of range.
    """
    world = scenario if isinstance(scenario, Scenario) else lookup(scenario)
    eye = world.sensor if sensor is None else sensor
    root = _roots(world)
    n, k = len(world.motion.names), len(eye.names)

    def draw(stream: Stream, *shape: int) -> Array:
        return normals(seed, world.name, stream, shape, runs=runs, first=first)

    inputs = {"root": root, "pushes": draw(Stream.TRUTH, world.scans, root.shape[2])}
    inputs |= {"dt": world.dt[0, :, None], "noise": draw(Stream.NOISE, world.scans, k)}
    states, z = _run(world.motion, eye, np.broadcast_to(world.initial, (runs, n)), inputs)
    truth = Truth(world.time_s, states, world.motion.names)
    return truth, _plots(world, eye, z, draw(Stream.START, n))


def _plots(world: Scenario, sensor: Sensor, z: Array, normal: Array) -> Plots:
    """The plots, with the start that the scenario asks for."""
    dt = world.dt
    if world.begin == "given":
        prior = world.prior
    elif world.begin == "random draw":
        prior = Gaussian(world.initial + normal @ root_of(world.prior_cov).T, world.prior_cov)
    elif world.begin == "one plot":
        prior = one_plot(z[:, 0], world.motion, sensor)
        z, dt = _spent(z, dt, 1)
    elif world.begin == "two plots":
        prior = two_plots(z[:, 0], z[:, 1], dt[0, 1], world.motion, sensor)
        z, dt = _spent(z, dt, 2)
    else:
        raise UsageError(
            f"begin={world.begin!r}", next_step="use random draw, given, one plot or two plots"
        )
    return Plots(world.time_s, z, dt, prior)


def _spent(z: Array, dt: Array, plots: int) -> tuple[Array, Array]:
    """Plots that made the start are missing afterwards, and no time passes before the next."""
    z[:, :plots] = np.nan
    dt[0, :plots] = 0.0
    return z, dt


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
    return np.stack(columns or [np.zeros(len(rest))], axis=1)  # no noise: a column of zeros


def _roots(world: Scenario) -> Array:
    """(scans, n, rank): the factor of the process noise before each scan."""
    root = root_of(world.motion.noise(world.dt_s))
    return np.where(world.time_s[:, None, None] > 0.0, root, 0.0)


def _run(
    motion: Motion, sensor: Sensor, start: Array, inputs: Mapping[str, Array]
) -> tuple[Array, Array]:
    """States (runs, scans, n) and plots (runs, scans, k)."""
    rated = {
        name: rate_of(name, value, leaf)
        for name, (value, leaf) in (numbers(motion, "motion") | numbers(sensor, "sensor")).items()
    }
    rates = tuple((name, rate) for name, (rate, _) in rated.items())
    kernel = _kernel(_World(motion, sensor, inputs["root"].shape[2]), rates)
    values = dict(inputs) | {name: value for name, (_, value) in rated.items()}
    states = pack_states(kernel.program.state, {"state": start})
    _, outputs = kernel.run(states, values, inputs["root"].shape[0])
    return outputs["state"], outputs["z"]


class _World:
    """A motion and a sensor, equal when their formulas are."""

    def __init__(self, motion: Motion, sensor: Sensor, rank: int) -> None:
        self.motion, self.sensor, self.rank = motion, sensor, rank
        self._identity = (structure(motion), structure(sensor), rank)

    def __hash__(self) -> int:
        return hash(self._identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _World) and self._identity == other._identity

    def step(self, state: Mapping[str, Any], inputs: Mapping[str, Any]) -> tuple[Any, Any]:
        """The target moves and is seen: the formula that is recorded."""
        values = dict(inputs)
        motion = with_numbers(self.motion, "motion", values)
        sensor = with_numbers(self.sensor, "sensor", values)
        moved = motion.move(state["state"], inputs["dt"][0]) + inputs["root"] @ inputs["pushes"]
        seen = [
            (c, c.value(moved) + c.sigma * noise)
            for c, noise in zip(sensor.components(motion), inputs["noise"], strict=True)
        ]
        z = np.array([wrap(value) if c.is_angle else value for c, value in seen])
        return {"state": moved}, {"state": moved, "z": z}


@lru_cache(maxsize=32)
def _kernel(world: _World, rates: tuple[tuple[str, Rate], ...]) -> Kernel:
    n, k = len(world.motion.names), len(world.sensor.names)
    models = numbers(world.motion, "motion") | numbers(world.sensor, "sensor")
    rate = dict(rates)
    inputs = {"root": (Matrix(n, world.rank), Rate.STEP), "pushes": (Vector(world.rank), Rate.EACH)}
    inputs |= {"dt": (Vector(1), Rate.STEP), "noise": (Vector(k), Rate.EACH)}
    return make_kernel(
        trace(
            world.step,
            state={"state": Vector(n)},
            inputs=inputs | {name: (leaf, rate[name]) for name, (_, leaf) in models.items()},
            outputs={"state": (Vector(n), Rate.EACH), "z": (Vector(k), Rate.EACH)},
        )
    )
