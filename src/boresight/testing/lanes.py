"""Laws of many steps and runs: batch, loop, stream and formula are one filter."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from boresight.filters.recursion import OUTPUTS, run_recursion
from boresight.filters.stream import Stream
from boresight.maths import Gaussian
from boresight.testing.comparing import equal, near
from boresight.testing.subjects import Subject, Whole
from boresight.testing.worlds import World

Array = Any
LANES, STEPS, DT_S = 5, 4, 2.0


@cache
def recorded(world: World, seed: int = 0) -> tuple[Gaussian, Array]:
    """Starts and plots of a few lanes; a component here and there is missing."""
    priors = [world.prior(seed + lane) for lane in range(LANES)]
    start = Gaussian(*(np.stack(part) for part in zip(*priors, strict=True)))
    z = np.stack(
        [[world.plot(m, (lane, t)) for t in range(STEPS)] for lane, m in enumerate(start.mean)]
    )
    z[np.random.default_rng(seed + 1).random(z.shape) < 0.15] = np.nan
    return start, z


def batch(subject: Subject, world: World, seed: int = 0) -> None:
    """Every run of a batch is that run by itself, step by step; of functions, to rounding."""
    start, z = recorded(world, seed)
    if isinstance(subject, Whole):
        _whole(subject, world, start, z)
        return
    recursion = subject.recursion(world)  # type: ignore[attr-defined] # what steps has one
    many = run_recursion(recursion, z, DT_S, start, outputs=OUTPUTS)
    for lane in range(LANES):
        here = slice(lane, lane + 1)
        states: Any = Gaussian(start.mean[here], start.cov[here])
        for t in range(STEPS):
            one = run_recursion(recursion, z[here, t : t + 1], DT_S, states, outputs=OUTPUTS)
            states = one.final
            for name in OUTPUTS:
                equal(_which(name, lane, t), one.others[name][0, 0], many.others[name][lane, t])
    if recursion.method.plain:
        equal("the state after the last scan", many.final["mean"], many.mean[:, -1])


def _whole(subject: Whole, world: World, start: Gaussian, z: Array) -> None:
    models, steps = (world.motion, world.sensor), np.full((1, STEPS), DT_S)
    many = subject.filter(z, steps, start, *models)
    for lane in range(LANES):
        post = subject.run(world, start.mean[lane], start.cov[lane], z[lane], DT_S)
        near(_which("mean", lane, STEPS - 1), post.mean, many.mean[lane, -1], 1e-9)
        near(_which("cov", lane, STEPS - 1), post.cov, many.cov[lane, -1], 1e-9)


def stream(subject: Subject, world: World, seed: int = 0, *, rtol: float = 1e-9) -> None:
    """One target live and all of them live agree to the bit, and with the batch to `rtol`.

    The batch writes more than a stream does and so is another program: bits may differ between
    programs. An old state stays what it was.
    """
    start, z = recorded(world, seed)
    recursion = subject.recursion(world)  # type: ignore[attr-defined] # what steps has one
    many = run_recursion(recursion, z, DT_S, start, outputs=OUTPUTS)
    alone, together = Stream(recursion), Stream(recursion, LANES)
    state = first = alone.start(Gaussian(start.mean[3], start.cov[3]))
    crowd, before = together.start(start), first.mean.copy()
    for t in range(STEPS):
        state, crowd = alone(state, z[3, t], DT_S), together(crowd, z[:, t], DT_S)
        for name in ("mean", "cov", "nis", "dof", "loglik", "status"):
            told = getattr(crowd, name)
            equal(f"{name} at scan {t} of one target", getattr(state, name), told[3])
            near(f"{name} at scan {t}", told, many.others[name][:, t], rtol)
    equal("the state that a step began from", first.mean, before)


def formula(subject: Subject, world: World, seed: int = 0) -> None:
    """Machine code over lanes is the function on floats, to 1e-9."""
    start, z = recorded(world, seed)
    recursion = subject.recursion(world)  # type: ignore[attr-defined] # what steps has one
    many = run_recursion(recursion, z, DT_S, start, outputs=OUTPUTS)
    for lane, t, results in _on_floats(recursion, start, z):
        for name in OUTPUTS:
            near(_which(name, lane, t), many.others[name][lane, t], results[name], 2e-9, least=1e-3)


def _on_floats(recursion: Any, start: Gaussian, z: Array) -> Iterator[tuple[int, int, Any]]:
    for lane in range(LANES):
        state = recursion.begin(start.mean[lane], start.cov[lane])
        for t in range(STEPS):
            state, results = recursion.step(state, {"z": z[lane, t], "dt": DT_S})
            yield lane, t, results


def _which(name: str, lane: int, step: int) -> str:
    return f"{name} of run {lane} at scan {step}"
