"""Outputs summed over the lanes of a block: the same bits on every back end."""

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.lanes import Rate, Scalar, Vector, pack_states, select, to_blocks, trace
from lanes.machines import kernel_for, targets

LANES, STEPS = 24, 3


def step(state, inputs):
    """A product, which must not fuse with the additions; what does not count is not even added."""
    y = inputs["z"] * inputs["z"][::-1] * state["x"]
    counted = [select(inputs["counts"] > 0.5, each, 0.0) for each in y]
    product = state["x"] * inputs["dt"]
    results = {"y": y, "sums": np.array(counted), "product": product, "summed": product}
    return {"x": state["x"] * 1.25}, results


def summing(size):
    return trace(
        step,
        state={"x": Scalar()},
        inputs={
            "z": (Vector(size), Rate.EACH),
            "counts": (Scalar(), Rate.LANE),
            "dt": (Scalar(), Rate.STEP),
        },
        outputs={
            "y": (Vector(size), Rate.EACH),
            "sums": (Vector(size), Rate.STEP),
            "product": (Scalar(), Rate.EACH),
            "summed": (Scalar(), Rate.STEP),
        },
    )


def added(y):
    """Sums over every 8 lanes of (lanes, ...), written out."""
    a, b, c, d, e, f, g, h = (y[i::8] for i in range(8))
    return ((a + b) + (c + d)) + ((e + f) + (g + h))


@targets
@pytest.mark.parametrize("rows", [True, False], ids=["rows", "blocks"])
@pytest.mark.parametrize("size", [1, 2, 7, 8, 19])
def test_sums_over_a_block_are_one_tree_of_exact_additions(goal, rows, size):
    rng = np.random.default_rng(size)
    z, counts = rng.normal(size=(LANES, STEPS, size)), rng.integers(0, 2, LANES).astype(float)
    z[counts == 0.0] = np.nan  # what does not count must not poison its block
    program = summing(size)
    given = {"z": z, "counts": counts, "dt": rng.normal(size=STEPS)}
    if not rows:
        given |= {"z": to_blocks(z), "counts": to_blocks(counts[:, None])}
    states = pack_states(program.state, {"x": rng.normal(size=LANES)})
    kernel = kernel_for(program, goal, rows=rows)
    out = kernel.run(states, given, STEPS)[1]
    y = out["y"] if rows else np.moveaxis(out["y"], -1, 1).reshape(z.shape)
    assert np.isfinite(y).any()
    expected = added(np.where(counts[:, None, None] > 0.5, y, 0.0))
    assert np.array_equal(out["sums"], expected)
    product = out["product"] if rows else np.moveaxis(out["product"], -1, 1).reshape(LANES, STEPS)
    assert np.array_equal(out["summed"].reshape(-1, STEPS), added(product))
    again = {"sums": np.empty((LANES // 8, STEPS, size))}
    kernel.run(states, given, STEPS, threads=2, out=again)
    assert np.array_equal(again["sums"], expected)


@targets
def test_a_block_that_is_not_full_is_refused(goal):
    program = summing(2)
    given = {"z": np.zeros((9, 1, 2)), "counts": np.ones(9), "dt": np.zeros(1)}
    states = pack_states(program.state, {"x": np.zeros(9)})
    with pytest.raises(UsageError, match="summed over blocks of 8 lanes; got 9"):
        kernel_for(program, goal).run(states, given, 1)
