"""Truth and plots of many runs: a world's formula, run over all of them at once.

What is random is a function of the seed, the scenario's name, the run and what it is for (see
`maths.random`): the truth, the plots' noise, detection, false plots and the start of a filter each
have a stream of their own, so run 7 is the same run whatever the number of runs.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.scenario import Scenario, lookup
from boresight.experiments.world import World, root_of
from boresight.filters.start import on_bearing, one_plot, two_plots
from boresight.lanes import Kernel, Leaf, Matrix, Rate, Vector, make_kernel, pack_states, trace
from boresight.maths import Gaussian
from boresight.maths.seeds import Stream, check, normals
from boresight.models.motion import Motion
from boresight.models.sensors import Radar, Sensor

Array = Any


class Truth(NamedTuple):
    """Where targets were.

    Attributes:
        time_s: (scans,).
        states: (runs, scans, n).
        names: name of each state element, with its unit.
        start: (runs, n), at time 0: that of the first scan, or one step before it.
    """

    time_s: Array
    states: Array
    names: tuple[str, ...]
    start: Array


class Plots(NamedTuple):
    """What a sensor measured, and where a filter may begin.

    Attributes:
        time_s: (scans,).
        z: (runs, scans, k), in the order of the sensor's `names`, angles in radians; NaN where the
            target was not seen, or its plot was used for the start.
        dt: (1, scans), s before each scan.
        prior: mean (runs, n), cov (n, n) or (runs, n, n), before the first plot.
        candidates: (runs, scans, m, k), all plots of each scan in no order, the target's among
            them, NaN where there is none; None where there are no false plots.
    """

    time_s: Array
    z: Array
    dt: Array
    prior: Gaussian
    candidates: Array | None = None


def simulate(
    scenario: str | Scenario,
    sensor: Sensor | None = None,
    *,
    runs: int,
    seed: int,
    first: int = 0,
    truth_run: int | None = None,
    noise_run: int | None = None,
    whole: bool = False,
) -> tuple[Truth, Plots]:
    """Truth and plots of many runs of a scenario.

    Args:
        scenario: a `Scenario`, or the name of one.
        sensor: what sees the target, if not the scenario's own. Sensors with as many components
            see the same truth through the same normal numbers.
        runs: number of runs.
        seed: run i of a seed is the same whatever `runs` is.
        first: number of the first run.
        truth_run: number of the run whose truth all have; None: each has its own.
        noise_run: number of the run whose plots' noise, detection, false plots and start all have;
            None: each has its own.
        whole: keep the plots that make the start, as a recording has them; they are otherwise
            missing, so that no filter uses them twice.

    Returns:
        The truth and the plots; `bs.run` takes the plots as they are.

    Raises:
        UsageError: an unknown scenario, a seed or number of runs out of range, a bias of what the
            sensor does not measure, too many false plots.
    """
    scene = scenario if isinstance(scenario, Scenario) else lookup(scenario)
    world = World(scene, scene.sensor if sensor is None else sensor)
    moving, noisy = ((first, runs) if one is None else (one, 1) for one in (truth_run, noise_run))
    for start, count in ((first, runs), moving, noisy):
        check(seed, count, start)

    def of(part: tuple[int, int]) -> Array:
        return np.broadcast_to(part[0] + np.arange(part[1], dtype=float), runs)

    origin = np.broadcast_to(world.origins(seed, *moving), (runs, len(scene.motion.names)))
    kernel, values = _kernel(world), world.values(seed, of(moving), of(noisy))
    _, out = kernel.run(pack_states(kernel.program.state, {"truth": origin}), values, scene.scans)
    truth = Truth(scene.time_s, out["truth"], scene.motion.names, origin)
    begun = begin(scene, scene.motion, world.sensor, out["z"], starts(scene, seed, noisy, runs))
    if whole:
        return truth, Plots(scene.time_s, out["z"], scene.dt, begun, out.get("candidates"))
    return truth, _plots(scene, out["z"], out.get("candidates"), begun)


def starts(scenario: Scenario, seed: int, part: tuple[int, int], runs: int) -> Array:
    """(runs, n) standard normals of filters' starts: of runs (first, count), or one for all."""
    n = len(scenario.motion.names)
    drawn = normals(seed, scenario.name, Stream.START, (n,), first=part[0], runs=part[1])
    return np.broadcast_to(drawn, (runs, n))


def begin(scenario: Scenario, motion: Motion, sensor: Sensor, z: Array, normal: Array) -> Gaussian:
    """Where filters begin, as the scenario asks for.

    Args:
        scenario: says how.
        motion: how filters believe that targets move.
        sensor: what they believe of the sensor.
        z: (runs, scans, k) the target's own plots; the first `scenario.spent` are looked at.
        normal: (runs, n) standard normals, for a random draw.

    Returns:
        mean (n,) or (runs, n), cov (n, n) or (runs, n, n).
    """
    how, first = scenario.begin, z[:, : scenario.spent]
    if how == "given":
        return scenario.prior
    if how == "random draw":
        root = root_of(scenario.prior_cov)
        offset = normal[:, : root.shape[1]] @ root.T
        return Gaussian(scenario.initial + offset, scenario.prior_cov)
    if how == "one plot":
        return one_plot(first[:, 0], motion, sensor, speed_mps=scenario.speed_mps)
    if how == "two plots":
        return two_plots(first[:, 0], first[:, 1], scenario.dt[0, 1], motion, sensor)
    return _on_bearing(scenario, motion, sensor, first[:, 0])


def _on_bearing(scenario: Scenario, motion: Motion, sensor: Sensor, z: Array) -> Gaussian:
    if not (isinstance(sensor, Radar) and {"azimuth_rad", "cone_rad"} & set(sensor.names)):
        raise UsageError(
            f"scenario {scenario.name!r} starts on a bearing, which {', '.join(sensor.names)} is "
            "not",
            next_step="use bs.Bearings(azimuth_deg=..., pose=...)",
        )
    known = (scenario.range_m, scenario.range_sd_m)
    return on_bearing(z, motion, sensor, *known, speed_mps=scenario.speed_mps)


def _plots(scenario: Scenario, z: Array, candidates: Array | None, prior: Gaussian) -> Plots:
    """Plots that made the start are missing afterwards, and no time passes before the next."""
    dt, spent = scenario.dt, scenario.spent
    for each in (z,) if candidates is None else (z, candidates):
        each[:, :spent] = np.nan
    dt[0, :spent] = 0.0
    return Plots(scenario.time_s, z, dt, prior, candidates)


@lru_cache(maxsize=64)
def _kernel(world: World) -> Kernel:
    """The world by itself, all that happens in it written down."""
    k, many = len(world.sensor.names), world.candidates
    leaves: dict[str, Leaf] = {"truth": world.state["truth"], "z": Vector(k)}
    leaves |= {"candidates": Matrix(many, k)} if many else {}

    def step(state: dict[str, Any], inputs: dict[str, Any]) -> tuple[Any, Any]:
        new, scene = world.step(state, inputs)
        return new, scene._asdict()

    return make_kernel(
        trace(
            step,
            state=world.state,
            inputs=world.inputs,
            outputs={name: (leaf, Rate.EACH) for name, leaf in leaves.items()},
        )
    )
