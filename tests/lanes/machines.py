"""Every back end this machine can run, and formulas applied to columns of numbers on it."""

import numpy as np
import pytest

from boresight.lanes import Kernel, Rate, Scalar, Vector, pack_states, simd, trace
from boresight.lanes.writer import Shape

COMPILED = simd.available()
NUMPY = None  # a kernel without code runs its program in NumPy
EVERY = (*COMPILED, NUMPY)


def name_of(goal):
    return goal.name if goal else "numpy"


targets = pytest.mark.parametrize("goal", EVERY, ids=name_of)
compiled_targets = pytest.mark.parametrize("goal", COMPILED, ids=name_of)


def kernel_for(program, goal, *, rows=True):
    """A kernel of one back end, whatever this machine's own is."""
    if goal is None:
        return Kernel(program, rows, None)
    with simd._LOCK:
        return Kernel(program, rows, simd._compile(program, Shape(goal.width, rows), goal))


def record(formula, size):
    """The program of a formula of `size` numbers to one number."""

    def step(state, inputs):
        return {"idle": state["idle"]}, {"y": formula(*inputs["x"])}

    return trace(
        step,
        state={"idle": Scalar()},
        inputs={"x": (Vector(size), Rate.EACH)},
        outputs={"y": (Scalar(), Rate.EACH)},
    )


def evaluate(formula, goal, *columns):
    """The formula over columns (lanes,) on one back end."""
    columns = np.broadcast_arrays(*columns)
    x = np.stack(columns, axis=-1).astype(float)[:, None, :]
    program = record(formula, len(columns))
    states = pack_states(program.state, {"idle": np.zeros(len(x))})
    return kernel_for(program, goal).run(states, {"x": x}, 1)[1]["y"][:, 0]
