"""The straight-line program: what is folded, shared and hoisted, what it prints, how large."""

# Formulas here take (a, b, c) whether they use them or not.
# ruff: noqa: ARG005, B002

import math

import numpy as np
import pytest

from boresight.errors import FormulaError, UsageError
from boresight.lanes import (
    Rate,
    Scalar,
    Symmetric,
    Vector,
    copysign,
    gradient,
    jacobian,
    make_kernel,
    pack_states,
    select,
    trace,
)
from boresight.lanes.program import LARGEST
from lanes.machines import EVERY, kernel_for, record


def operations(formula, size=3):
    return record(formula, size).operations


FOLDED = {
    "zero times anything": (lambda a, b, c: a * 0.0 + b, 0),
    "times one": (lambda a, b, c: 1.0 * a * 1, 0),
    "times minus one": (lambda a, b, c: a * -1.0, 1),
    "plus zero": (lambda a, b, c: 0.0 + a + 0, 0),
    "minus zero": (lambda a, b, c: a - 0.0, 0),
    "zero minus": (lambda a, b, c: 0.0 - a, 1),
    "over one": (lambda a, b, c: a / 1.0, 0),
    "zero over": (lambda a, b, c: 0.0 / a + b, 0),
    "minus minus": (lambda a, b, c: -(-a), 0),
    "constants": (lambda a, b, c: np.sqrt(a * 0.0 + 4.0) * a, 1),
    "identity matrix": (lambda a, b, c: (np.eye(3) @ np.array([a, b, c]))[1], 0),
    "same both ways": (lambda a, b, c: select(a < 0.0, b, b), 0),
    "shared": (lambda a, b, c: np.sin(a + b) * np.sin(b + a), 3),
    "shared product": (lambda a, b, c: (a * b + c) - (b * a + c), 3),
    "not x - x": (lambda a, b, c: a - a, 1),
    "not x / x": (lambda a, b, c: a / a, 1),
    "not reassociated": (lambda a, b, c: (a + 1.0) - 1.0, 2),
}


@pytest.mark.parametrize("name", FOLDED)
def test_structure_is_folded_and_arithmetic_is_not(name):
    formula, expected = FOLDED[name]
    assert operations(formula) == expected


def test_zeros_of_either_sign_and_nan_are_constants_of_their_own():
    program = record(lambda a: select(a < 0.0, -0.0, 0.0) + select(a < 1.0, math.nan, 2.0), 1)
    constants = [args[0] for op, args in program.nodes if op == "const"]
    assert len(constants) == len(set(constants)) == 5


def test_a_gradient_s_structural_zeros_cost_nothing():
    def one(a, b, c):
        return gradient(lambda x: x[0] * x[1] + x[2] * 0.0, np.array([a, b, c]))[1][1]

    assert operations(one) == 0  # it is simply a


def step_with_every_rate(state, inputs):
    fixed = np.sin(inputs["q"]) + 3.0
    lane = np.exp(inputs["bias"] * fixed)
    step = np.sqrt(inputs["dt"] * fixed)
    x = state["x"] + lane * step + inputs["z"][0] * inputs["z"][1]
    return {"x": x}, {"y": x * fixed, "dt": inputs["dt"], "last": inputs["bias"] + x}


def every_rate(outputs=("y", "dt"), last=("last",)):
    return trace(
        step_with_every_rate,
        state={"x": Scalar()},
        inputs={
            "q": (Scalar(), Rate.FIXED),
            "bias": (Scalar(), Rate.LANE),
            "dt": (Scalar(), Rate.STEP),
            "z": (Vector(2), Rate.EACH),
        },
        outputs={name: (Scalar(), Rate.EACH) for name in outputs}
        | {name: (Scalar(), Rate.LANE) for name in last},
    )


def test_work_is_done_as_rarely_as_its_inputs_change():
    program = every_rate()
    by_operation = {}
    for (op, _), rate in zip(program.nodes, program.rates, strict=True):
        by_operation.setdefault(op, set()).add(rate)
    assert by_operation["sin"] == {Rate.FIXED}
    assert by_operation["exp"] == {Rate.LANE}
    assert by_operation["sqrt"] == {Rate.STEP}
    assert program.operations == 6  # lane * step, two sums, z z, x fixed, bias + x


def test_hoisted_work_stands_outside_the_loop_of_the_compiled_code():
    from boresight.lanes.elementary import lower
    from boresight.lanes.ir import write_ir
    from boresight.lanes.writer import Shape

    text = write_ir(lower(every_rate(), rounding=True), Shape(8, True), "kernel", "")
    entry, rest = text.split("\nchunks:")
    chunk, loop = rest.split("\nstep:")
    loop = loop.split("\ndone:")[0]
    assert entry.count(" fmul contract double ") > 10  # sin of the fixed number, as scalars
    assert chunk.count(" fmul contract <8 x double> ") > 10  # exp of the lane's number
    assert loop.count("@llvm.sqrt.f64") == 1  # once a step, for all lanes
    assert loop.count(" <8 x double> ") < 20


@pytest.mark.parametrize("goal", EVERY, ids=lambda g: g.name if g else "numpy")
@pytest.mark.parametrize("rows", [True, False], ids=["rows", "blocks"])
def test_every_rate_arrives_where_it_belongs(goal, rows):
    from boresight.lanes import from_blocks, to_blocks

    lanes, steps, rng = 11, 5, np.random.default_rng(1)
    inputs = {
        "q": 0.3,
        "bias": rng.normal(size=lanes),
        "dt": rng.uniform(1, 2, steps),
        "z": rng.normal(size=(lanes, steps, 2)),
    }
    x = rng.normal(size=lanes)
    expected = []
    for lane in range(lanes):
        state = {"x": x[lane]}
        for t in range(steps):
            one = {"q": 0.3, "bias": inputs["bias"][lane], "dt": inputs["dt"][t]}
            state, out = step_with_every_rate(state, one | {"z": inputs["z"][lane, t]})
            expected.append([out["y"], out["dt"], out["last"]])
    expected = np.reshape(expected, (lanes, steps, 3))
    program = every_rate()
    given = dict(inputs)
    if not rows:
        given |= {"bias": to_blocks(inputs["bias"][:, None]), "z": to_blocks(inputs["z"])}
    states = pack_states(program.state, {"x": x})
    final, out = kernel_for(program, goal, rows=rows).run(states, given, steps)
    if not rows:
        out = {k: from_blocks(v, lanes)[..., 0] for k, v in out.items()}
    np.testing.assert_allclose(out["y"], expected[..., 0], rtol=1e-13)
    np.testing.assert_array_equal(out["dt"], expected[..., 1])
    np.testing.assert_allclose(out["last"], expected[:, -1, 2], rtol=1e-13)
    np.testing.assert_allclose(final["x"], out["last"] - inputs["bias"], rtol=1e-12)


def test_a_program_prints_itself():
    program = every_rate()
    lines = str(program).splitlines()
    assert lines[:2] == ["%0 = state.x[0]  # EACH", "%1 = q[0]  # FIXED"]
    assert any(line.startswith("%") and "= exp %" in line and "# LANE" in line for line in lines)
    assert any("= 3.0  # FIXED" in line for line in lines)
    assert [line.split(" = ")[0] for line in lines[-4:]] == ["state.x", "y", "dt", "last"]


def test_only_what_is_wanted_is_computed():
    assert every_rate(outputs=(), last=()).operations < every_rate().operations
    assert [slot.name for slot in every_rate(outputs=("y",), last=()).outputs] == ["y"]
    with pytest.raises(UsageError, match="nothing"):
        every_rate(outputs=("nothing",))


def test_equal_formulas_have_equal_digests_and_others_do_not():
    first, again = record(lambda a: np.sin(a) + 1.0, 1), record(lambda a: np.sin(a) + 1.0, 1)
    other = record(lambda a: np.sin(a) + 2.0, 1)
    assert first.digest == again.digest != other.digest
    assert first == again


def test_a_program_that_is_too_large_is_refused_with_a_sentence():
    def endless(a):
        for _ in range(LARGEST + 1):
            a = np.sqrt(a)
        return a

    with pytest.raises(FormulaError, match=f"at most {LARGEST}"):
        record(endless, 1)
    assert record(np.sqrt, 1).operations == 1


@pytest.mark.parametrize("goal", EVERY, ids=lambda g: g.name if g else "numpy")
def test_states_that_trade_places_do_not_overwrite_each_other(goal):
    def swap(state, inputs):
        del inputs
        return {"a": state["b"], "b": state["a"], "c": state["c"]}, {}

    program = trace(
        swap, state={"a": Vector(2), "b": Vector(2), "c": Symmetric(2)}, inputs={}, outputs={}
    )
    values = {"a": np.arange(6.0).reshape(3, 2), "b": -np.ones((3, 2)), "c": np.ones((3, 2, 2))}
    final, _ = kernel_for(program, goal).run(pack_states(program.state, values), {}, 3)
    np.testing.assert_array_equal(final["a"], values["b"])
    np.testing.assert_array_equal(final["b"], values["a"])
    np.testing.assert_array_equal(final["c"], values["c"])


@pytest.mark.parametrize("goal", EVERY, ids=lambda g: g.name if g else "numpy")
def test_constants_and_inputs_may_be_results(goal):
    def step(state, inputs):
        return {"x": inputs["dt"]}, {"one": 1.0, "same": state["x"], "fixed": inputs["q"] * 2.0}

    program = trace(
        step,
        state={"x": Scalar()},
        inputs={"dt": (Scalar(), Rate.STEP), "q": (Scalar(), Rate.FIXED)},
        outputs={n: (Scalar(), Rate.EACH) for n in ("one", "same", "fixed")},
    )
    start = pack_states(program.state, {"x": np.array([7.0, 8.0])})
    final, out = kernel_for(program, goal).run(start, {"dt": np.array([1.0, 2.0]), "q": 4.0}, 2)
    assert final["x"].tolist() == [2.0, 2.0]
    assert out["one"].tolist() == [[1.0, 1.0]] * 2
    assert out["same"].tolist() == [[7.0, 1.0], [8.0, 1.0]]
    assert out["fixed"].tolist() == [[8.0, 8.0]] * 2


def test_a_kernel_refuses_what_would_make_it_read_past_its_memory():
    program = every_rate()
    kernel, lanes, steps = make_kernel(program), 3, 2
    states = pack_states(program.state, {"x": np.zeros(lanes)})
    good = {
        "q": 0.3,
        "bias": np.zeros(lanes),
        "dt": np.ones(steps),
        "z": np.zeros((lanes, steps, 2)),
    }
    kernel.run(states, good, steps)
    wrong = [
        good | {"q": np.zeros(2)},
        good | {"bias": np.zeros(lanes - 1)},
        good | {"dt": np.ones(steps - 1)},
        good | {"z": np.zeros((lanes, steps, 1))},
        good | {"z": np.zeros((lanes, steps - 1, 2))},
        {k: v for k, v in good.items() if k != "dt"},
    ]
    for inputs in wrong:
        with pytest.raises(UsageError):
            kernel.run(states, inputs, steps)
    for steps_, threads in ((0, 1), (2, 0), (-1, 1)):
        with pytest.raises(UsageError):
            kernel.run(states, good, steps_, threads=threads)
    blocked = make_kernel(program, rows=False)
    with pytest.raises(UsageError):
        blocked.run(states, good, steps)
    other = pack_states(program.state, {"x": np.zeros(lanes)})
    with pytest.raises(UsageError):
        kernel.run(type(other)(other.slots, other.data[:, :0], lanes), good, steps)


def test_jacobians_of_vector_formulas():
    """Against the derivative on paper of (x y, x² / y, |x - y|, rint(x) y, hypot)."""
    x, y = 3.2, -1.7

    def f(v):
        a, b = v
        return np.array([a * b, a**2 / b, abs(a - b), np.rint(a) * b, np.hypot(a, b), a * 0.0])

    value, J = jacobian(f, np.array([x, y]))
    r = np.hypot(x, y)
    np.testing.assert_allclose(value, [x * y, x * x / y, x - y, 3 * y, r, 0], rtol=1e-15)
    expected = [[y, x], [2 * x / y, -x * x / y**2], [1, -1], [0, 3], [x / r, y / r], [0, 0]]
    np.testing.assert_allclose(J, expected, rtol=1e-15)


def test_gradients_of_elementary_functions():
    """Against the derivatives in any table, at a point where no two of them agree."""
    x, y = 0.7, 1.9

    def f(v):
        a, b = v
        return np.array(
            [
                np.sin(a) + b,
                np.cos(a) - b,
                np.exp(a) * b,
                np.expm1(a) * b,
                np.log(a) / b,
                np.sqrt(a) - b,
                np.arctan2(a, b),
                np.arctan2(a, np.array(2.0)[()] + 0.0 * b),
                1.0 / a,
                2.0 - a,
                -a,
                a**3,
                a**-2,
                a**0.5,
                np.floor(a) + b,
                select(a < b, a * b, a),
                copysign(b, -a) * 1.0,
            ]
        )

    slopes = [
        [np.cos(x), 1],
        [-np.sin(x), -1],
        [np.exp(x) * y, np.exp(x)],
        [np.exp(x) * y, np.exp(x) - 1],
        [1 / (x * y), -np.log(x) / y**2],
        [0.5 / np.sqrt(x), -1],
        [y / (x**2 + y**2), -x / (x**2 + y**2)],
        [2.0 / (x**2 + 4), 0],
        [-1 / x**2, 0],
        [-1, 0],
        [-1, 0],
        [3 * x**2, 0],
        [-2 / x**3, 0],
        [0.5 / np.sqrt(x), 0],
        [0, 1],
        [y, x],
        [0, -1],
    ]
    value, J = jacobian(f, np.array([x, y]))
    np.testing.assert_allclose(value, f(np.array([x, y])), rtol=1e-15)
    np.testing.assert_allclose(J, slopes, rtol=1e-14)


def test_a_recorded_number_beside_a_dual_one_is_a_constant():
    """d/db of the angle and the hypotenuse, the other leg being recorded and held."""

    def step(state, inputs):
        a, b = inputs["x"]
        _, angle = gradient(lambda v: np.arctan2(a, v[0]), np.array([b]))
        _, hypotenuse = gradient(lambda v: np.hypot(a, v[0]), np.array([b]))
        return state, {"slopes": np.concatenate([angle, hypotenuse])}

    program = trace(
        step,
        state={"none": Scalar()},
        inputs={"x": (Vector(2), Rate.EACH)},
        outputs={"slopes": (Vector(2), Rate.EACH)},
    )
    x = np.array([[[3.2, -1.7]]])
    states = pack_states(program.state, {"none": np.zeros(1)})
    _, results = make_kernel(program).run(states, {"x": x}, 1)
    square = 3.2**2 + 1.7**2
    expected = [-3.2 / square, -1.7 / np.sqrt(square)]
    np.testing.assert_allclose(results["slopes"][0, 0], expected, rtol=1e-14)
