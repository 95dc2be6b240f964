"""Regularised particle filter: slow, bound to no Gaussian, what the other filters are held against.

[musso2001] C. Musso, N. Oudjane, F. Le Gland, "Improving Regularised Particle Filters";
[ristic2004] B. Ristic, S. Arulampalam, N. Gordon, "Beyond the Kalman Filter", chapter 3;
[liu2001] J. Liu, M. West, "Combined Parameter and State Estimation in Simulation-Based Filtering".
Particles move as the motion says and are weighted by the sensor's own formulas, so it serves every
motion and every sensor. Differs from the first two: particles are drawn towards their mean before
the kernel spreads them (the third), so that mean and covariance stay what they were.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters.start import on_bearing
from boresight.lanes import Rate, Scalar, Vector, make_kernel, pack_states, trace
from boresight.maths import missing, select
from boresight.maths.seeds import Stream, generator
from boresight.models.motion import Motion
from boresight.models.parameters import numbers, rate_of, with_numbers
from boresight.models.sensors import Radar, Sensor

Array = Any
_LOG_2PI = np.log(2.0 * np.pi)


@dataclass(frozen=True, eq=False)
class ParticleEstimate:
    """What the particles say after every plot.

    Attributes:
        mean: (runs, steps, n).
        cov: (runs, steps, n, n).
        effective: (runs, steps) effective number of particles, before they are renewed.
        loglik: (runs, steps) logarithm of the plot's likelihood; 0 where nothing was heard.
    """

    mean: Array
    cov: Array
    effective: Array
    loglik: Array


def particle_filter(
    z: Array,
    motion: Motion,
    sensor: Sensor,
    dt: Array,
    particles: Array,
    *,
    seed: int,
    fraction: float = 0.25,
    bandwidth: float = 0.75,
) -> ParticleEstimate:
    """Filter every run with particles of its own.

    How many: on pradeep's bearings, which tell of the range only after minutes, covariances are
    honest with 5,000 and a fifth too small with 2,000.

    Args:
        z: (runs, steps, k) plots, SI units and radians, NaN where missing.
        motion: how the target moves.
        sensor: what measured the plots; its numbers fixed, by run, by step, or both.
        dt: seconds before each step: a number, (1, steps), (runs, 1) or (runs, steps).
        particles: (count, n) or (runs, count, n), equally likely states before the first plot.
            What they were drawn from must not be heard again: after `bearing_particles` make the
            first plot NaN.
        seed: of the random numbers; a run's do not depend on how many runs there are.
        fraction: of the particles: with fewer effective ones than that they are renewed.
        bandwidth: of the kernel that spreads renewed particles, as a share of what is best for a
            normal density; 0 is the plain bootstrap filter.

    Raises:
        UsageError: particles, dt or plots that do not fit.
    """
    z, clouds = np.asarray(z, dtype=float), np.asarray(particles, dtype=float)
    runs, n, k = len(z), len(motion.names), len(sensor.names)
    if clouds.ndim == 2:
        clouds = np.broadcast_to(clouds, (runs, *clouds.shape))
    fits = z.ndim == 3 and clouds.ndim == 3 and z.shape[2] == k
    if not fits or (len(clouds), clouds.shape[2]) != (runs, n):
        raise UsageError(
            f"plots of shape {z.shape} with particles of shape {np.shape(particles)}",
            why=f"(runs, steps, {k}) and (runs, count, {n}) are needed",
        )
    world, renewal = _World(motion, sensor, z, dt), _Renewal(fraction, bandwidth)
    found = [
        _run(world, run, clouds[run], renewal, generator(seed, "particles", Stream.PARTICLES, run))
        for run in range(runs)
    ]
    return ParticleEstimate(*(np.stack(part) for part in zip(*found, strict=True)))


def bearing_particles(
    z: Array,
    motion: Motion,
    sensor: Radar,
    *,
    nearest_m: float = 1_000.0,
    farthest_m: float = 20_000.0,
    cells: int = 6,
    speed_mps: float,
    count: int,
    seed: int,
) -> Array:
    """Particles on a first bearing, with the prior of a range-parameterised bank.

    The range lies in each cell equally likely, anywhere in it; of a cone, on either side.

    Args:
        z: (runs, k) first plots, radians.
        motion: in the plane.
        sensor: bearings, true or off an axis.
        nearest_m: least range, m.
        farthest_m: greatest range, m.
        cells: how many; their limits grow geometrically.
        speed_mps: spread of each velocity.
        count: particles of a run.
        seed: of the random numbers.

    Returns:
        (runs, count, n).
    """
    heard = np.isfinite(np.asarray(z, dtype=float)).any(axis=-1)
    if not heard.all():
        raise UsageError(
            f"nothing was heard in the first plot of run {np.flatnonzero(~heard)[0]}",
            why="particles are drawn on a bearing",
        )
    edges, borders = np.geomspace(nearest_m, farthest_m, cells + 1), np.linspace(0, 1, cells + 1)
    cone = np.array([name == "cone_rad" for name in sensor.names])
    degrees = [getattr(sensor, name.replace("_rad", "_deg")) for name in sensor.names]
    first = [np.asarray(d)[..., 0] if np.ndim(d) == 2 else d for d in degrees]
    sigma = np.stack([np.broadcast_to(np.radians(d), len(z)) for d in first], axis=-1)
    clouds = []
    for run, plot in enumerate(np.asarray(z, dtype=float)):
        random = generator(seed, "particles", Stream.START, run)
        ranges = np.interp((np.arange(count) + random.random(count)) / count, borders, edges)
        angles = plot + sigma[run] * random.standard_normal((count, len(plot)))
        angles[random.random(count) < 0.5] *= np.where(cone, -1.0, 1.0)
        start = on_bearing(angles, motion, sensor, ranges, 0.0, speed_mps=speed_mps)
        spread = np.sqrt(np.diagonal(start.cov, axis1=1, axis2=2))
        spread[:, :2] = 0.0  # the place is drawn already
        clouds.append(start.mean + spread * random.standard_normal(spread.shape))
    return np.stack(clouds)


class _World:
    """Both models, their numbers at every run and step, and the kernel that takes a step."""

    def __init__(self, motion: Motion, sensor: Sensor, z: Array, dt: Array) -> None:
        self.motion, self.sensor, (runs, self.steps, _) = motion, sensor, z.shape
        found = numbers(motion, "motion") | numbers(sensor, "sensor")
        given = found | {"dt": (dt, Scalar()), "z": (z, Vector(z.shape[2]))}
        self.rated = {name: rate_of(name, *pair) for name, pair in given.items()}
        leading = {Rate.FIXED: (), Rate.LANE: (runs,), Rate.STEP: (self.steps,)}
        for name, (rate, value) in self.rated.items():
            lead = leading.get(rate, (runs, self.steps))
            if value.shape[: len(lead)] != lead:
                raise UsageError(
                    f"{name} has shape {value.shape}",
                    why=f"the plots have {runs} runs and {self.steps} steps",
                )
        leaf = Vector(len(motion.names))
        inputs = {name: (shape, Rate.FIXED) for name, (_, shape) in given.items()}
        program = trace(
            self._step,
            state={"place": leaf},
            inputs=inputs | {"noise": (leaf, Rate.LANE)},
            outputs={"loglik": (Scalar(), Rate.LANE)},
        )
        self.slots, self.kernel = program.state, make_kernel(program)
        self.roots: dict[float, Array] = {}

    def _step(self, state: Mapping[str, Any], inputs: Any) -> tuple[Any, Any]:
        """One particle: it moves, and says how likely the plot is."""
        motion = with_numbers(self.motion, "motion", inputs)
        sensor = with_numbers(self.sensor, "sensor", inputs)
        place = motion.move(state["place"], inputs["dt"]) + inputs["noise"]
        z, components = sensor.independent(inputs["z"], motion)
        loglik = 0.0
        for measured, part in zip(z, components, strict=True):
            off = part.residual(measured, part.value(place)) / part.sigma
            log = -0.5 * (off * off + _LOG_2PI) - np.log(part.sigma)
            loglik = loglik + select(missing(measured), 0.0, log)
        return {"place": place}, {"loglik": loglik}

    def at(self, run: int, step: int) -> dict[str, Array]:
        """Every number of one run and step."""
        where: dict[Rate, Any] = {Rate.FIXED: (), Rate.LANE: run, Rate.STEP: step}
        return {
            name: value[where.get(rate, (run, step))] for name, (rate, value) in self.rated.items()
        }

    def noise(self, dt: float, count: int, random: np.random.Generator) -> Array:
        """What the motion leaves out in dt seconds, (count, n)."""
        if dt not in self.roots:
            self.roots[dt] = _root(np.asarray(self.motion.noise(dt), dtype=float))
        root = self.roots[dt]
        if not root.any():
            return np.broadcast_to(0.0, (count, len(root)))
        return random.standard_normal((count, len(root))) @ root.T


@dataclass(frozen=True)
class _Renewal:
    """When particles are renewed, and how."""

    fraction: float
    bandwidth: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value <= 1.0:
                raise UsageError(f"{name}={value!r} is not a share, from 0 to 1")

    def __call__(self, places: Array, weights: Array, random: np.random.Generator) -> Array:
        """Equally likely particles (n, count) with the mean and covariance of the weighted ones.

        Systematic resampling; then [liu2001], with h the bandwidth: drawn to the mean by
        sqrt(1 - h^2), and spread by a normal kernel of h^2 times the covariance.
        """
        n, count = places.shape
        edges = np.cumsum(weights)
        marks = (np.arange(count) + random.random()) * (edges[-1] / count)
        chosen = places[:, np.minimum(np.searchsorted(edges, marks), count - 1)]
        h = self.bandwidth * (4.0 / (n + 2.0) / count) ** (1.0 / (n + 4.0))
        mean, cov = _moments(places, weights)
        kernel = _root(cov) @ random.standard_normal((n, count))
        return mean[:, None] + np.sqrt(1.0 - h * h) * (chosen - mean[:, None]) + h * kernel


def _run(
    world: _World, run: int, cloud: Array, renewal: _Renewal, random: np.random.Generator
) -> tuple[Array, Array, Array, Array]:
    """Mean, cov, effective number and log-likelihood of one run after every step."""
    count, n = cloud.shape
    means, covs = np.empty((world.steps, n)), np.empty((world.steps, n, n))
    effective, loglik = np.empty(world.steps), np.empty(world.steps)
    states, logs = pack_states(world.slots, {"place": cloud}), np.full(count, -np.log(count))
    for k in range(world.steps):
        given = world.at(run, k)
        given["noise"] = world.noise(float(given["dt"]), count, random)
        states, told = world.kernel.run(states, given, 1)
        loglik[k], logs, weights = _reweigh(logs, told["loglik"])
        places = np.moveaxis(states.data, 1, 0).reshape(n, -1)[:, :count]
        means[k], covs[k] = _moments(places, weights)
        effective[k] = 1.0 / (weights @ weights)
        if effective[k] < renewal.fraction * count:
            renewed = renewal(places, weights, random)
            states = pack_states(world.slots, {"place": renewed.T})
            logs = np.full(count, -np.log(count))
    return means, covs, effective, loglik


def _reweigh(logs: Array, likelihoods: Array) -> tuple[float, Array, Array]:
    """Log-likelihood of a plot, and the weights after it: their logarithms, and themselves.

    A plot that no particle explains has likelihood zero, and changes no weight.
    """
    new = logs + likelihoods
    top = new.max()
    if top == -np.inf:
        return top, logs, np.exp(logs)
    weights = np.exp(new - top)
    total = weights.sum()
    level = top + np.log(total)
    return level, new - level, weights / total


def _moments(places: Array, weights: Array) -> tuple[Array, Array]:
    """Mean (n,) and cov (n, n) of weighted particles (n, count)."""
    mean = places @ weights
    apart = places - mean[:, None]
    return mean, (apart * weights) @ apart.T


def _root(cov: Array) -> Array:
    """A root (n, n) of a covariance, which may be singular: elements are scaled alike first."""
    scale = np.sqrt(np.diagonal(cov))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(cov / np.outer(safe, safe))
    return safe[:, None] * vectors * np.sqrt(np.clip(values, 0.0, None))
