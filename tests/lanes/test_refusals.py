"""What cannot be recorded is refused where it stands: file, line, cure; never a wrong program."""

# Formulas here take (s, v, A) whether they use them or not, and are bad style on purpose.
# ruff: noqa: ARG001, ARG005, FURB110, FURB192, PLR0124, RUF015

import copy
import inspect
import math
import operator
import pickle
from pathlib import Path

import numpy as np
import pytest

from boresight.errors import FormulaError
from boresight.lanes import Matrix, Rate, Scalar, Vector, gradient, isnan, select, trace

HERE = Path(__file__)


def assign_to_floats(s, v, A):
    F = np.eye(6)
    F[0, 3] = s
    return F[0, 3]


def add_to_floats(s, v, A):
    total = np.zeros(3)
    total += v
    return total[0]


ILLEGAL = {
    "if": lambda s, v, A: 1.0 if s < 0 else s,
    "if number": lambda s, v, A: 1.0 if s else s,
    "and": lambda s, v, A: s < 0 and s,
    "or": lambda s, v, A: s < 0 or s,
    "not": lambda s, v, A: not s,
    "chained comparison": lambda s, v, A: select(0 < s < 1, s, 0.0),
    "min": lambda s, v, A: min(s, 0.0),
    "max": lambda s, v, A: max(v[0], v[1]),
    "sorted": lambda s, v, A: sorted(v)[0],
    "equals": lambda s, v, A: select(s == 0, 1.0, s),
    "differs": lambda s, v, A: select(s != 0, 1.0, s),
    "array equals": lambda s, v, A: (v == v)[0],
    "in": lambda s, v, A: s in [0.0, 1.0],
    "modulo": lambda s, v, A: s % 1.0,
    "reflected modulo": lambda s, v, A: 7.0 % s,
    "floor division": lambda s, v, A: s // 2,
    "divmod": lambda s, v, A: divmod(s, 2)[0],
    "round": lambda s, v, A: round(s),
    "power 1.5": lambda s, v, A: s**1.5,
    "power of numbers": lambda s, v, A: 2.0**s,
    "power of two symbols": lambda s, v, A: s**s,
    "np.power": lambda s, v, A: np.power(v, 0.25)[0],
    "float": lambda s, v, A: float(s),
    "int": lambda s, v, A: int(s),
    "complex": lambda s, v, A: complex(s),
    "index": lambda s, v, A: v[s],
    "range": lambda s, v, A: sum(range(s)),
    "operator.index": lambda s, v, A: operator.index(s),
    "math.sqrt": lambda s, v, A: math.sqrt(s),
    "math.atan2": lambda s, v, A: math.atan2(s, 1.0),
    "math.hypot": lambda s, v, A: math.hypot(*v),
    "math.trunc": lambda s, v, A: math.trunc(s),
    "math.ceil": lambda s, v, A: math.ceil(s),
    "iterate": lambda s, v, A: list(s)[0],
    "unpack": lambda s, v, A: [*s][0],
    "item": lambda s, v, A: s[0],
    "len": lambda s, v, A: len(s),
    "np.where": lambda s, v, A: np.where(v < 0, 0.0, v)[0],
    "np.where scalar": lambda s, v, A: np.where(s < 0, 0.0, s),
    "np.select": lambda s, v, A: np.select([v < 0], [v], 0.0)[0],
    "np.maximum": lambda s, v, A: np.maximum(v, 0.0)[0],
    "np.fmin": lambda s, v, A: np.fmin(v, 0.0)[0],
    "np.clip": lambda s, v, A: np.clip(v, 0.0, 1.0)[0],
    "np.sign": lambda s, v, A: np.sign(v)[0],
    "np.max": lambda s, v, A: np.max(v),
    "np.argmax": lambda s, v, A: v[np.argmax(v)],
    "np.sort": lambda s, v, A: np.sort(v)[0],
    "np.median": lambda s, v, A: np.median(v),
    "np.any": lambda s, v, A: np.any(v < 0),
    "np.all": lambda s, v, A: np.all(v < 0),
    "np.count_nonzero": lambda s, v, A: np.count_nonzero(v) * s,
    "np.isnan": lambda s, v, A: select(np.isnan(v), 0.0, v)[0],
    "np.isfinite": lambda s, v, A: np.isfinite(v)[0],
    "np.signbit": lambda s, v, A: np.signbit(s),
    "np.copysign": lambda s, v, A: np.copysign(1.0, s),
    "np.nansum": lambda s, v, A: np.nansum(v),
    "np.nanmax": lambda s, v, A: np.nanmax(v),
    "np.tan": lambda s, v, A: np.tan(s),
    "np.arcsin": lambda s, v, A: np.arcsin(s),
    "np.tanh": lambda s, v, A: np.tanh(v)[0],
    "np.log10": lambda s, v, A: np.log10(s),
    "np.log1p": lambda s, v, A: np.log1p(s),
    "np.exp2": lambda s, v, A: np.exp2(s),
    "np.cbrt": lambda s, v, A: np.cbrt(s),
    "np.ceil": lambda s, v, A: np.ceil(s),
    "np.trunc": lambda s, v, A: np.trunc(s),
    "np.deg2rad": lambda s, v, A: np.deg2rad(s),
    "np.radians": lambda s, v, A: np.radians(v)[0],
    "np.mod": lambda s, v, A: np.mod(v, 1.0)[0],
    "np.unwrap": lambda s, v, A: np.unwrap(v)[0],
    "np.interp": lambda s, v, A: np.interp(s, [0, 1], [0, 1]),
    "np.sinc": lambda s, v, A: np.sinc(v)[0],
    "np.allclose": lambda s, v, A: np.allclose(v, v) * s,
    "np.array_equal": lambda s, v, A: np.array_equal(v, v) * s,
    "np.unique": lambda s, v, A: np.unique(v)[0],
    "cholesky": lambda s, v, A: np.linalg.cholesky(A)[0, 0],
    "inv": lambda s, v, A: np.linalg.inv(A)[0, 0],
    "solve": lambda s, v, A: np.linalg.solve(A, v)[0],
    "det": lambda s, v, A: np.linalg.det(A),
    "eigh": lambda s, v, A: np.linalg.eigh(A)[0][0],
    "mixed sqrt": lambda s, v, A: np.sqrt(np.array([s, 4.0]))[0],
    "mixed arctan2": lambda s, v, A: np.arctan2(1.0, s),
    "float array": lambda s, v, A: np.array([s, 1.0], dtype=float)[0],
    "astype": lambda s, v, A: v.astype(float)[0],
    "assignment": assign_to_floats,
    "in-place": add_to_floats,
    "np.float64": lambda s, v, A: np.float64(s),
    "copy": lambda s, v, A: copy.copy(s),
    "deepcopy": lambda s, v, A: copy.deepcopy(v)[0],
    "pickle": lambda s, v, A: pickle.dumps(s),
    "hash": lambda s, v, A: {s: 1}[s],
    "set": lambda s, v, A: len({*v}),
    "format": lambda s, v, A: f"{s:.3f}",
    "string": lambda s, v, A: s + "m",
    "complex product": lambda s, v, A: s * 1j,
    "arithmetic on a condition": lambda s, v, A: (s < 0) * 2.0,
    "sum of conditions": lambda s, v, A: np.sum(v < 0),
    "a number as a condition": lambda s, v, A: select(s, 1.0, 2.0),
    "logic on numbers": lambda s, v, A: select(s & v[0], 1.0, 2.0),
    "inverted number": lambda s, v, A: select(~s, 1.0, 2.0),
    "condition as result": lambda s, v, A: s < 0,
    "selected conditions": lambda s, v, A: select(s < 0, v[0] < 0, v[1] < 0),
    "nothing as result": lambda s, v, A: None,
    "text as result": lambda s, v, A: "one",
    "wrong shape": lambda s, v, A: v,
    "gradient, if": lambda s, v, A: gradient(lambda x: x[0] if x[0] else x[1], v)[0],
    "gradient, equals": lambda s, v, A: gradient(lambda x: select(x[0] == 0, x[0], x[1]), v)[0],
    "gradient, power 1.5": lambda s, v, A: gradient(lambda x: x[0] ** 1.5, v)[0],
    "gradient, float": lambda s, v, A: gradient(lambda x: math.sqrt(x[0]), v)[0],
    "gradient, modulo": lambda s, v, A: gradient(lambda x: x[0] % 1.0, v)[0],
    "gradient, tan": lambda s, v, A: gradient(lambda x: np.tan(x[0]), v)[0],
}


def record(formula):
    def step(state, inputs):
        y = formula(inputs["s"], inputs["v"], inputs["A"])
        return {"idle": state["idle"]}, {"y": y}

    return trace(
        step,
        state={"idle": Scalar()},
        inputs={
            "s": (Scalar(), Rate.EACH),
            "v": (Vector(3), Rate.EACH),
            "A": (Matrix(3, 3), Rate.EACH),
        },
        outputs={"y": (Scalar(), Rate.EACH)},
    )


@pytest.mark.parametrize("name", ILLEGAL)
def test_an_illegal_formula_is_refused_at_its_own_line(name):
    formula = ILLEGAL[name]
    with pytest.raises(FormulaError) as caught:
        record(formula)
    assert caught.value.next_step
    if name.endswith(("result", "shape")):  # noticed when the formula has returned
        assert "'y'" in caught.value.what or "shape" in caught.value.what
        return
    lines, first = inspect.getsourcelines(formula)
    file, line = caught.value.where.rsplit(", line ", 1)
    assert Path(file) == HERE
    assert first <= int(line) < first + len(lines)


def test_a_symbol_kept_from_another_trace_is_refused():
    kept = []
    record(lambda s, v, A: kept.append(s) or s)
    for use in (
        lambda s, v, A: s + kept[0],
        lambda s, v, A: select(s < 0, kept[0], s),
        lambda s, v, A: np.arctan2(s, kept[0]),
        lambda s, v, A: kept[0],
        lambda s, v, A: gradient(lambda x: x[0] * kept[0], v)[0],
    ):
        with pytest.raises(FormulaError, match="two traces"):
            record(use)


LEGAL = {
    "sums": lambda s, v, A: np.sum(A @ v) + v @ A @ v + np.trace(A) + np.prod(v),
    "einsum": lambda s, v, A: np.einsum("i,ij,j->", v, A, v, optimize=True),
    "kron": lambda s, v, A: np.kron(A, v[:, None])[4, 1] + np.outer(v, v)[2, 1],
    "block": lambda s, v, A: np.block([[A, v[:, None]], [v[None], np.array([[s]])]])[3, 0],
    "powers": lambda s, v, A: s**2 + s**3.0 + s**-2 + s**0 + abs(s) ** 0.5 + np.square(s),
    "scaled identity": lambda s, v, A: ((np.eye(3) * s + A) @ np.ones(3))[1],
    "select": lambda s, v, A: select((s < 0) & ~(v[0] >= 1) | (v[1] > 2), s, v[2]),
    "isnan": lambda s, v, A: select(isnan(s), 0.0, s) + np.sum(select(isnan(v), 0.0, v)),
    "elementary": lambda s, v, A: np.hypot(np.sin(s), np.cos(s)) + np.arctan2(v[0], v[1]),
    "rounding": lambda s, v, A: np.rint(v[0] * 7) + np.floor(v[1] * 7) + math.floor(s * 9),
    "mean": lambda s, v, A: np.mean(v) + np.var(v) + np.linalg.norm(v) + np.cumsum(v)[-1],
    "gradient": lambda s, v, A: gradient(lambda x: x[0] ** 3 * s / x[1] - np.exp(x[2]), v)[1][0],
}


@pytest.mark.parametrize("name", LEGAL)
def test_a_legal_formula_gives_what_it_gives_on_floats(name):
    from boresight.lanes import pack_states
    from lanes.machines import EVERY, kernel_for

    rng = np.random.default_rng(1)
    s, v, A = rng.normal(size=9), rng.normal(size=(9, 3)), rng.normal(size=(9, 3, 3))
    expected = [LEGAL[name](*lane) for lane in zip(s, v, A, strict=True)]
    program = record(LEGAL[name])
    states = pack_states(program.state, {"idle": np.zeros(9)})
    inputs = {"s": s[:, None], "v": v[:, None], "A": A[:, None]}
    for goal in EVERY:
        y = kernel_for(program, goal).run(states, inputs, 1)[1]["y"][:, 0]
        np.testing.assert_allclose(y, expected, rtol=1e-12, atol=1e-13)


def test_what_touches_no_symbol_cannot_be_noticed_and_shows_as_nan():
    """The documented gap: `np.nan_to_num` gives objects back as they are."""
    from lanes.machines import evaluate

    y = evaluate(lambda x: np.nan_to_num(np.array([x]))[0] + 1.0, None, np.array([np.nan, 2.0]))
    np.testing.assert_array_equal(y, [np.nan, 3.0])


def test_gradients_refuse_on_floats_what_they_refuse_on_symbols():
    """Outside a trace too: a dual number that were always true would take one branch in silence."""
    x = np.array([2.0, 3.0])
    for h in (
        lambda q: q[0] if q[0] else q[1],
        lambda q: select(q[0] == 0.0, q[0], q[1]),
        lambda q: q[0] ** 1.5,
        lambda q: float(q[0]),
        lambda q: q[0] % 2.0,
    ):
        with pytest.raises(FormulaError):
            gradient(h, x)
