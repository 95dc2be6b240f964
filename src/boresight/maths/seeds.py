"""Random numbers that depend on what they are for, and on nothing else.

The numbers are those of `maths.random`, functions of a key (the user's seed and the name of a
cell: a scenario, a cell of a study), of the run, of the step and of what they are for. So run 7 of
10 has the numbers of run 7 of 1,000, in any chunk, thread or process; truth and noise can be
redrawn apart; two filters, or two sensors, that share a cell share its numbers; and what a kernel
makes inside itself, `normals` makes again.

[salmon2011] J. K. Salmon et al., "Parallel Random Numbers: As Easy as 1, 2, 3".
"""

import hashlib
import math
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.lanes import Kernel, Rate, Scalar, Vector, make_kernel, pack_states, trace
from boresight.maths import random
from boresight.maths.gaussian import Array

_WORD = 2**64


class Stream(IntEnum):
    """What the numbers are for; streams of one run never overlap."""

    TRUTH = 0
    NOISE = 1
    START = 2
    ORIGIN = 3
    PARTICLES = 4
    DETECTION = 5
    FALSE_PLOTS = 6


def normals(
    seed: int, cell: str, stream: Stream, shape: tuple[int, ...], *, runs: int, first: int = 0
) -> Array:
    """Standard normal numbers of many runs.

    Args:
        seed: the user's seed, 0 to 2^64 - 1.
        cell: name of the scenario or cell.
        stream: what the numbers are for.
        shape: of one run: (steps, ...), or (count,) of step 0.
        runs: number of runs.
        first: number of the first run, so that chunks of runs can be made apart.

    Returns:
        (runs, *shape).

    Raises:
        UsageError: a seed or a number of runs that is out of range.
    """
    check(seed, runs, first)
    if 0 in shape:
        return np.zeros((runs, *shape))
    steps, count = (shape[0], math.prod(shape[1:])) if len(shape) > 1 else (1, math.prod(shape))
    step, pair = np.indices((steps, (count + 1) // 2)).reshape(2, -1)  # a kernel's step is a pair
    kernel = _kernel()
    start = pack_states(kernel.program.state, {"run": first + np.arange(runs)})
    inputs = {"key": random.key(seed, cell), "stream": stream, "step": step, "pair": pair}
    drawn = kernel.run(start, inputs, len(step))[1]["normals"].reshape(runs, steps, -1)
    return np.ascontiguousarray(drawn[..., :count]).reshape(runs, *shape)


@cache
def _kernel() -> Kernel:
    """A pair of normal numbers."""

    def step(state: dict[str, Any], inputs: dict[str, Any]) -> tuple[Any, Any]:
        counter = (state["run"], inputs["step"], inputs["stream"], inputs["pair"])
        drawn = random.normal_pair(*random.pair(inputs["key"], *counter))
        return state, {"normals": np.array(drawn)}

    program = trace(
        step,
        state={"run": Scalar()},
        inputs={
            "key": (Vector(2), Rate.FIXED),
            "stream": (Scalar(), Rate.FIXED),
            "step": (Scalar(), Rate.STEP),
            "pair": (Scalar(), Rate.STEP),
        },
        outputs={"normals": (Vector(2), Rate.EACH)},
    )
    return make_kernel(program)


def generator(seed: int, cell: str, stream: Stream, run: int) -> np.random.Generator:
    """Numbers of any kind and any count for one run, as particles need them.

    NumPy's own Philox, of 64-bit words, under a key of its own: not the numbers of `normals`.
    """
    check(seed, 1, run)
    key = np.array([seed, _hash(cell)], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(counter=[0, 0, run, stream], key=key))


def check(seed: int, runs: int, first: int) -> None:
    """UsageError where a seed, a number of runs or the first one's number is out of range."""
    for name, value in (("seed", seed), ("runs", runs), ("first", first)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer):
            raise UsageError(f"{name}={value!r} is not a whole number")
    if not 0 <= seed < _WORD:
        raise UsageError(f"seed={seed} is outside 0 to 2^64 - 1", next_step="give another seed")
    if runs < 1 or first < 0:
        raise UsageError(f"runs={runs}, first={first}: at least one run is needed, from 0 up")
    if first + runs - 1 > random.LARGEST:
        raise UsageError(
            f"runs={runs}, first={first}: the last run's number is above 2^32 - 1",
            next_step="give another seed instead",
        )


def _hash(cell: str) -> int:
    """The same in every process, unlike Python's own hash of a string."""
    return int.from_bytes(hashlib.blake2b(cell.encode(), digest_size=8).digest(), "little")
