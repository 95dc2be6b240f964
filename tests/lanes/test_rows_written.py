"""Outputs of every size land where they belong, however many lanes there are."""

import numpy as np
import pytest

from boresight.lanes import Rate, Scalar, Vector, make_kernel, pack_states, select, trace


@pytest.mark.parametrize("size", [1, 2, 3, 4, 7, 8, 9, 15, 16, 20])
@pytest.mark.parametrize("rows", [True, False])
@pytest.mark.parametrize("lanes", [1, 7, 8, 19])
def test_what_goes_in_comes_out(size, rows, lanes):
    steps = 3
    program = trace(
        lambda state, given: (state, {"each": given["x"], "last": given["x"]}),
        state={"s": Scalar()},
        inputs={"x": (Vector(size), Rate.EACH)},
        outputs={"each": (Vector(size), Rate.EACH), "last": (Vector(size), Rate.LANE)},
    )
    kernel = make_kernel(program, rows)
    blocks = -(-lanes // 8)
    shape = (lanes, steps, size) if rows else (blocks, steps, size, 8)
    x = np.random.default_rng(0).standard_normal(shape)
    if not rows and lanes % 8:  # lanes that only fill a block may hold anything
        x[-1, ..., lanes % 8 :] = x[-1, ..., lanes % 8 - 1, None]
    start = pack_states(program.state, {"s": np.zeros(lanes)})
    _, found = kernel.run(start, {"x": x}, steps)
    assert np.array_equal(found["each"], x)
    assert np.array_equal(found["last"], x[:, -1])


def test_an_exponential_of_a_number_or_a_constant_is_that_of_the_number():
    def step(state, given):
        x = given["x"]
        chosen = np.exp(select(x < 0.0, -1e9, x))
        return state, {"both": np.array([np.exp(x), chosen])}

    program = trace(
        step,
        state={"s": Scalar()},
        inputs={"x": (Scalar(), Rate.EACH)},
        outputs={"both": (Vector(2), Rate.EACH)},
    )
    assert sum(op == "exp" for op, _ in program.nodes) == 1
    x = np.array([[-2.0, 0.5, 3.0]])
    start = pack_states(program.state, {"s": np.zeros(1)})
    _, found = make_kernel(program).run(start, {"x": x}, 3)
    assert np.array_equal(found["both"][0, :, 1] == 0.0, [True, False, False])
    assert np.array_equal(found["both"][0, 1:, 0], found["both"][0, 1:, 1])
