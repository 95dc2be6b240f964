"""Truth and plots of many runs: the filters' own formulas, run forward with drawn noise.

A step of the world is recorded once and run over all runs at once, as filters are. What is random
comes from `maths.seeds`: the truth, the plots' noise and the start of a filter each have a stream
of their own, so run 7 is the same run whatever the number of runs.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.scenario import Scenario, lookup
from boresight.filters.formula import Formula
from boresight.filters.start import on_bearing, one_plot, two_plots
from boresight.lanes import Matrix, Rate, Scalar, Vector
from boresight.maths import Gaussian, wrap
from boresight.maths.seeds import Stream, normals
from boresight.models.motion import Motion
from boresight.models.sensors import Radar, Sensor

Array = Any
_SINGULAR = 1e-12  # of a variance: less is rounding left over from the noise's other directions


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
    inputs |= {"dt": world.dt[0], "noise": draw(Stream.NOISE, world.scans, k)}
    start = np.broadcast_to(world.initial, (runs, n))
    if world.draw:
        start = world.draw(draw(Stream.ORIGIN, n))
    states, z = _run(world.motion, eye, start, inputs)
    truth = Truth(world.time_s, states, world.motion.names, start)
    return truth, _plots(world, eye, z, draw(Stream.START, n))


def _plots(world: Scenario, sensor: Sensor, z: Array, normal: Array) -> Plots:
    """The plots, with the start that the scenario asks for."""
    dt = world.dt
    if world.begin == "given":
        prior = world.prior
    elif world.begin == "random draw":
        prior = Gaussian(world.initial + normal @ root_of(world.prior_cov).T, world.prior_cov)
    elif world.begin == "one plot":
        prior = one_plot(z[:, 0], world.motion, sensor, speed_mps=world.speed_mps)
        z, dt = _spent(z, dt, 1)
    elif world.begin == "on bearing":
        prior = _on_bearing(world, sensor, z[:, 0])
        z, dt = _spent(z, dt, 1)
    else:
        prior = two_plots(z[:, 0], z[:, 1], dt[0, 1], world.motion, sensor)
        z, dt = _spent(z, dt, 2)
    return Plots(world.time_s, z, dt, prior)


def _on_bearing(world: Scenario, sensor: Sensor, z: Array) -> Gaussian:
    if not (isinstance(sensor, Radar) and {"azimuth_rad", "cone_rad"} & set(sensor.names)):
        raise UsageError(
            f"scenario {world.name!r} starts on a bearing, which {', '.join(sensor.names)} is not",
            next_step="use bs.Bearings(azimuth_deg=..., pose=...)",
        )
    known = (world.range_m, world.range_sd_m)
    return on_bearing(z, world.motion, sensor, *known, speed_mps=world.speed_mps)


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
    (scans, n, rank), k = inputs["root"].shape, len(sensor.names)
    formula = Formula(
        step=_step,
        motion=motion,
        sensor=sensor,
        state=(("state", Vector(n)),),
        inputs=(
            ("dt", Scalar(), Rate.STEP),
            ("root", Matrix(n, rank), Rate.STEP),
            ("pushes", Vector(rank), Rate.EACH),
            ("noise", Vector(k), Rate.EACH),
        ),
        outputs=(("state", Vector(n)), ("z", Vector(k))),
    )
    outputs = formula.run({"state": start}, inputs, scans)
    return outputs["state"], outputs["z"]


def _step(
    motion: Motion, sensor: Sensor, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[Any, Any]:
    """The target moves and is seen."""
    moved = motion.move(state["state"], inputs["dt"]) + inputs["root"] @ inputs["pushes"]
    seen = [
        (c, c.value(moved) + c.sigma * noise)
        for c, noise in zip(
            sensor.components(motion), sensor.coloured(inputs["noise"]), strict=True
        )
    ]
    z = np.array([wrap(value) if c.is_angle else value for c, value in seen])
    return {"state": moved}, {"state": moved, "z": z}
