"""What pradeep's filters are held against beside the bound: a batch estimate and particles.

Both begin as the bank does: on the first bearing, with the bank's ranges and velocities.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth
from boresight.filters.batch import batch_map, velocity_prior
from boresight.filters.particle import bearing_particles, particle_filter
from boresight.models.sensors import Pose, Radar

Array = Any


def batch_squares(
    world: Scenario, truth: Truth, plots: Plots, starts: Array, at: list[int]
) -> Array:
    """Squared position error, m², (runs, len(at)), of the best track for all bearings so far.

    Args:
        world: what was simulated.
        truth: of the runs.
        plots: of the runs.
        starts: (runs, scans, starts, n), where the search begins.
        at: after which scans.
    """
    found = [_batch(world, plots, starts[:, k], k + 1) for k in at]
    return np.stack([_square(mean, truth, k) for mean, k in zip(found, at, strict=True)], axis=1)


def _batch(world: Scenario, plots: Plots, starts: Array, steps: int) -> Array:
    """Tracks (runs, n) from the first plots, which are given back their first bearing."""
    z = np.array(plots.z[:, :steps])
    z[:, 0] = _first_bearing(plots)
    prior = velocity_prior(world.motion, world.speed_mps)
    sensor, dt = _until(world, steps), world.dt[:, :steps]
    return batch_map(z, world.motion, sensor, dt, prior=prior, starts=starts).mean


def _until(world: Scenario, steps: int) -> Radar:
    """The sensor on the first steps of its way."""
    assert isinstance(world.sensor, Radar)  # noqa: S101 - bearings are a radar's
    assert world.sensor.pose is not None  # noqa: S101 - own ship moves
    return replace(world.sensor, pose=Pose(position_m=world.sensor.pose.position_m[:, :steps]))


def _first_bearing(plots: Plots) -> Array:
    """(runs, 1): what the start was made of; own ship is then at the origin."""
    return np.arctan2(plots.prior.mean[:, 1], plots.prior.mean[:, 0])[:, None]


def _square(mean: Array, truth: Truth, k: int) -> Array:
    return np.sum((mean - truth.states[: len(mean), k])[:, :2] ** 2, axis=-1)


def particle_squares(
    world: Scenario, truth: Truth, plots: Plots, assumed: dict[str, Any], at: list[int], seed: int
) -> Array:
    """Squared position error, m², of particles in the first few runs, (few runs, len(at)).

    Args:
        world: what was simulated.
        truth: of the runs.
        plots: of the runs.
        assumed: cells, their limits, and how many runs and particles.
        at: after which scans.
        seed: of the particles.
    """
    few = plots.z[: int(assumed["particle_runs"])]
    cloud = bearing_particles(
        _first_bearing(plots)[: len(few)],
        world.motion,
        _until(world, world.scans),
        **{name: assumed[name] for name in ("nearest_m", "farthest_m", "cells")},
        speed_mps=world.speed_mps,
        count=int(assumed["particles"]),
        seed=seed,
    )
    mean = particle_filter(few, world.motion, world.sensor, plots.dt, cloud, seed=seed).mean
    return np.stack([_square(mean[:, k], truth, k) for k in at], axis=1)
