"""Laws of one step: what must not matter does not matter. Each holds for a world and a seed."""

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.models.components import Component
from boresight.models.coordinates import CartesianPlots
from boresight.models.motion import Motion
from boresight.models.sensors import Pose, Sensor
from boresight.testing import textbook
from boresight.testing.comparing import BrokenLawError, alike, equal, near
from boresight.testing.subjects import Stepping, Subject
from boresight.testing.worlds import World, turned

Array = Any
ANGLES = ("azimuth_rad", "cone_rad")


def some_plots(world: World, mean: Array, seed: int) -> Array:
    """Three plots; about one component in four is missing, and in the last plot one is there."""
    rng = np.random.default_rng((seed, 2))
    seen = mean[: len(world.sensor.names)]
    plots = seen + rng.normal(scale=90.0, size=(3, len(seen)))
    plots[rng.random(plots.shape) < 0.25] = np.nan
    plots[-1, 0] = mean[0]
    return plots


def matrices(world: World) -> tuple[Array, Array]:
    """H and R of a sensor that measures the first coordinates."""
    names = world.sensor.names
    H = np.eye(len(names), len(world.motion.names))
    if isinstance(world.sensor, CartesianPlots):
        return H, world.sensor.cov
    return H, np.diag([getattr(world.sensor, name) ** 2 for name in names])


def kalman(subject: Subject, world: World, seed: int, *, dt: float = 2.0) -> None:
    """Mean, covariance, NIS and likelihood are the textbook's, with plots missing."""
    mean, cov = world.prior(seed)
    plots = some_plots(world, mean, seed)
    post = subject.run(world, mean, cov, plots, dt)
    H, R = matrices(world)
    accel: Any = world.motion.accel_mps2  # type: ignore[attr-defined] # a linear world's is constant velocity
    F, Q = textbook.discrete_velocity(dt, accel, world.motion.dims)
    nis = loglik = 0.0
    for z in plots:
        mean, cov = textbook.predict(mean, cov, F, Q)
        mean, cov, nis, loglik = textbook.joint_update(mean, cov, z, H, R)
    near("the mean", post.mean, mean, 2e-9)
    near("the covariance", post.cov, cov, 2e-9)
    if post.nis is not None:
        near("the NIS", post.nis, nis, 2e-9)
        near("the log-likelihood", post.loglik, loglik, 2e-9)
        equal("dof", post.dof, np.sum(~np.isnan(plots[-1])))


@dataclass(frozen=True)
class _Reordered:
    """A sensor whose components come in another order."""

    inner: Sensor
    order: tuple[int, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.inner.names[i] for i in self.order)

    def components(self, motion: Motion) -> tuple[Component, ...]:
        parts = self.inner.components(motion)
        return tuple(parts[i] for i in self.order)

    def independent(self, z: Array, motion: Motion) -> tuple[Array, tuple[Component, ...]]:
        return z, self.components(motion)


def order(subject: Subject, world: World, seed: int) -> None:
    """The last component first, and so on: the same posterior."""
    mean, cov = world.prior(seed)
    plots = some_plots(world, mean, seed)
    back = tuple(reversed(range(plots.shape[1])))
    there = World(world.motion, _Reordered(world.sensor, back))  # type: ignore[arg-type] # laws draw nothing from it
    ours = subject.run(there, mean, cov, plots[:, back], 2.0)
    alike(ours, subject.run(world, mean, cov, plots, 2.0))


def whole_turn(subject: Subject, world: World, seed: int, *, turns: int = 1) -> None:
    """An azimuth of so many turns more is the same azimuth."""
    mean, cov, z = world.case(seed)
    further = z.copy()
    further[[name in ANGLES for name in world.sensor.names]] += turns * 2 * np.pi
    alike(subject.update(world, mean, cov, further), subject.update(world, mean, cov, z))


def rotation(subject: Subject, world: World, seed: int, *, angle: float | None = None) -> None:
    """World turned about the vertical by `angle` rad (from the seed): the answer turned by it."""
    mean, cov, z = world.case(seed)
    if angle is None:
        angle = float(np.random.default_rng((seed, 4)).uniform(-np.pi, np.pi))
    R = np.kron(np.eye(len(mean) // world.motion.dims), turned(angle, world.motion.dims))
    further = z.copy()
    further[[name in ANGLES for name in world.sensor.names]] += angle
    straight = subject.update(world, mean, cov, z)
    there = subject.update(world, R @ mean, R @ cov @ R.T, further)
    alike(there, straight._replace(mean=R @ straight.mean, cov=R @ straight.cov @ R.T))


def half_turn(subject: Subject, world: World, seed: int) -> None:
    """As `rotation`, by half a turn."""
    rotation(subject, world, seed, angle=np.pi)


def elsewhere(
    subject: Subject,
    world: World,
    seed: int,
    *,
    angle: float = np.pi,
    shift: Any = (9e3, -3e3, 40.0),
) -> None:
    """World and sensor turned by `angle` rad and moved by `shift` (3,) m: the answer with them."""
    mean, cov, z = world.case(seed)
    before = world.sensor.pose  # type: ignore[attr-defined] # the worlds of this law have one
    T, dims = turned(angle), world.motion.dims
    pose = Pose(
        position_m=T @ before.position_m + shift,
        rotation=before.rotation @ T.T,
        velocity_mps=T @ before.velocity_mps,
    )
    there = World(world.motion, replace(world.sensor, pose=pose))  # type: ignore[type-var]
    R = np.kron(np.eye(2), T[:dims, :dims])
    moved = np.concatenate([shift[:dims], np.zeros(dims)])
    here = subject.update(world, mean, cov, z)
    after = subject.update(there, R @ mean + moved, R @ cov @ R.T, z)
    alike(after, here._replace(mean=R @ here.mean + moved, cov=R @ here.cov @ R.T))


def missing_component(subject: Subject, world: World, seed: int, *, at: int | None = None) -> None:
    """NaN is a sensor that lacks the component; component number `at`, or every one in turn."""
    mean, cov, z = world.case(seed)
    for i, name in enumerate(world.sensor.names):
        reduced = without(world, name)
        if reduced is None or at not in (None, i):
            continue
        gap = z.copy()
        gap[i] = np.nan
        try:
            lacking = subject.update(reduced, mean, cov, np.delete(z, i))
        except UsageError:
            continue  # a filter may need it
        alike(subject.update(world, mean, cov, gap), lacking)


def without(world: World, name: str) -> World | None:
    """The world whose sensor lacks a component; None if nothing is left, or it cannot lack it."""
    gone: dict[str, Any] = {name.replace("_rad", "_deg"): None}
    if name.startswith("range"):  # what is left is correlated with nothing
        gone["range_rate_correlation"] = None
    if not is_dataclass(world.sensor) or len(world.sensor.names) == 1:
        return None
    known = {field.name for field in fields(world.sensor)}
    try:
        sensor = replace(world.sensor, **{key: gone[key] for key in gone if key in known})
        return World(world.motion, sensor) if len(sensor.names) < len(world.sensor.names) else None
    except UsageError:
        return None


def missing_plot(subject: Subject, world: World, seed: int, *, told: bool | None = None) -> None:
    """All NaN: what is kept stays as it is; `told`: what is told is what was given, to the bit."""
    mean, cov, z = world.case(seed)
    nothing, models = np.full(len(z), np.nan), (world.motion, world.sensor)
    if isinstance(subject, Stepping):
        recursion = subject.recursion(world)
        kept = recursion.begin(mean, cov)
        after, _ = recursion.method.update(kept, nothing, *models)
        if after.keys() != kept.keys():
            raise BrokenLawError(f"it keeps {', '.join(after)} instead of {', '.join(kept)}")
        for name, leaf in kept.items():
            near(f"what is kept as {name!r}", after[name], leaf, 2e-12)
            if name in ("mean", "means"):
                equal("the mean", after[name], leaf)
        told = recursion.method.plain if told is None else told
    post = subject.update(world, mean, cov, nothing)
    if told is None or told:
        near("the mean", post.mean, mean, 0.0)
        near("the covariance", post.cov, cov, 2e-12)
    if post.nis is not None:
        equal("NIS, dof or log-likelihood", [post.nis, post.dof, post.loglik], np.zeros(3))


def covariance(subject: Subject, world: World, seed: int, *, dt: float = 4.0) -> None:
    """After a plot with a component missing: symmetric, positive definite."""
    mean, cov, z = world.case(seed)
    z[seed % len(z)] = np.nan
    told = subject.run(world, mean, cov, z[None], dt).cov
    near(
        "the covariance's other half", told, told.T, 0.0 if isinstance(subject, Stepping) else 1e-12
    )
    if not np.isfinite(told).all() or np.any(np.diag(told) <= 0):
        raise BrokenLawError("a variance is not a positive number")
    smallest = np.linalg.eigvalsh(told / np.outer(*2 * [np.sqrt(np.diag(told))]))[0]
    if smallest <= 0:
        raise BrokenLawError(f"an eigenvalue of the correlation matrix is {smallest:.2g}")


def inputs(subject: Subject, world: World, seed: int, *, dt: float = 4.0) -> None:
    """Mean, covariance and plot that were given are as they were."""
    mean, cov, z = world.case(seed)
    z[seed % len(z)] = np.nan
    before = [array.copy() for array in (mean, cov, z)]
    subject.run(world, mean, cov, z[None], dt)
    subject.update(world, mean, cov, z)
    for what, array, copy in zip(
        ("the mean", "the covariance", "the plot"), (mean, cov, z), before, strict=True
    ):
        equal(f"{what} that was given", array, copy)
