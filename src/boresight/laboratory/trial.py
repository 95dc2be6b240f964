"""One chunk of a cell: runs [first, first + count) of a contender in a setting, scored.

Every run is a lane, with random numbers of its own: what becomes of it does not depend on which
others are done with it.
"""

import time
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.world import World
from boresight.filters.method import Outside
from boresight.filters.nearest import nearest
from boresight.filters.recursion import Recursion
from boresight.laboratory.batches import batches
from boresight.laboratory.chunk import Chunk
from boresight.laboratory.score import Score
from boresight.laboratory.scores import Scores
from boresight.laboratory.study import Contender, Setting, Study
from boresight.laboratory.sums import Tree
from boresight.laboratory.trial_kernels import Trial
from boresight.maths.seeds import check

Array = Any


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
        UsageError: the contender needs what the setting's sensor does not measure, or a gate; a
            seed or runs out of range.
    """
    chunk = Chunk(study, setting, contender, trial_of(study, setting, contender))
    check(study.seed, count, first)
    chunk.prepare()
    begun, tree, runs = time.thread_time(), Tree(), []
    for batch in batches(first, count, chunk.lanes):
        totals, of_runs = chunk.run(batch)
        runs.append(of_runs)
        tree.add(batch.nodes(totals, chunk.trial.score.columns))
    each = {name: np.concatenate([part[name] for part in runs]) for name in runs[0]}
    return Scores(first, count, each, tree.nodes, time.thread_time() - begun)


def told_again(
    study: Study, setting: Setting, contender: Contender, runs: int
) -> tuple[Array, dict[str, Array]]:
    """The first runs again, with all that the filter said at every scan.

    Returns:
        The truth (runs, scans, n), and `mean`, `cov`, `nis` and `dof` by name.
    """
    chunk = Chunk(study, setting, contender, trial_of(study, setting, contender))
    parts = []
    for batch in batches(0, runs, chunk.lanes):
        _, told = chunk.told(*chunk.begun(batch))
        parts.append({name: each[batch.counts] for name, each in told.items()})
    named = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return named.pop("truth"), named


def trial_of(study: Study, setting: Setting, contender: Contender) -> Trial:
    """The formulas of a cell."""
    world = World(setting.scenario, setting.scenario.sensor)
    names = world.sensor.names
    unknown = [name for name in contender.sensor.names if name not in names]
    if unknown:
        raise UsageError(
            f"{contender.label!r} needs {unknown[0]}",
            why=f"the sensor of scenario {setting.scenario.name!r} measures {', '.join(names)}",
        )
    states = world.scenario.motion.names, contender.motion.names
    score = Score(*states, study.metrics, study.limits, world.scenario.metre)
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
