"""Elementary functions of compiled code: ulps against extended precision, and special values."""

import numpy as np
import pytest

from boresight.lanes.elementary import LARGEST_ANGLE
from lanes.machines import COMPILED, compiled_targets, evaluate, targets

extended = pytest.mark.skipif(
    np.finfo(np.longdouble).nmant < 60, reason="long double is no wider than double here"
)
nan, inf = np.nan, np.inf


def ulps(got, exact):
    """Distance from the exact result in units in the last place of it."""
    unit = np.spacing(np.abs(exact.astype(float)))
    return np.max(np.abs(got.astype(np.longdouble) - exact) / unit)


def angles(largest, rng):
    """Half anywhere, half within a hair of a multiple of pi/2."""
    anywhere = rng.uniform(-largest, largest, 20_000)
    quarter = np.round(rng.uniform(-largest, largest, 20_000) / (np.pi / 2)) * (np.pi / 2)
    hair = quarter * (1 + rng.normal(size=20_000) * 10.0 ** rng.uniform(-16, -3, 20_000))
    return np.concatenate([anywhere, np.clip(hair, -largest, largest), [1e-9, 1e-300, 5e-324]])


@extended
@compiled_targets
@pytest.mark.parametrize("function", [np.sin, np.cos], ids=["sin", "cos"])
@pytest.mark.parametrize(("largest", "bound"), [(1e3, 1.5), (1e6, 2.3)])
def test_sine_and_cosine(goal, function, largest, bound):
    x = angles(largest, np.random.default_rng(1))
    assert ulps(evaluate(function, goal, x), function(x.astype(np.longdouble))) <= bound


@extended
@compiled_targets
def test_exponential(goal):
    rng = np.random.default_rng(2)
    x = np.concatenate([rng.uniform(-708, 709.78, 20_000), rng.normal(size=20_000), [0.0, 1e-300]])
    assert ulps(evaluate(np.exp, goal, x), np.exp(x.astype(np.longdouble))) <= 1.2


@extended
@compiled_targets
def test_exponential_less_one(goal):
    rng = np.random.default_rng(5)
    tiny = rng.choice([-1, 1], 20_000) * 10.0 ** rng.uniform(-25, 0, 20_000)
    x = np.concatenate(
        [rng.uniform(-708, 709.78, 20_000), rng.normal(size=20_000), tiny, [709.782]]
    )
    assert ulps(evaluate(np.expm1, goal, x), np.expm1(x.astype(np.longdouble))) <= 1.8


@extended
@compiled_targets
def test_logarithm(goal):
    rng = np.random.default_rng(3)
    powers = 10.0 ** rng.uniform(-300, 300, 20_000)
    near_one = 1 + rng.normal(size=20_000) * 10.0 ** rng.uniform(-15, -0.7, 20_000)
    x = np.abs(np.concatenate([powers, near_one, [np.sqrt(2), 0.5, 2.0, 1.0, 2.3e-308]]))
    assert ulps(evaluate(np.log, goal, x), np.log(x.astype(np.longdouble))) <= 0.8


@extended
@compiled_targets
def test_arctan2(goal):
    rng = np.random.default_rng(4)
    size = 10.0 ** rng.uniform(-140, 140, (2, 40_000))
    y, x = size * rng.choice([-1, 1], (2, 40_000))
    y[:20_000] = x[:20_000] * rng.normal(size=20_000)
    y[:2_000] = x[:2_000] * (1 + rng.normal(size=2_000) * 1e-12)  # beside the diagonal
    exact = np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble))
    assert ulps(evaluate(np.arctan2, goal, y, x), exact) <= 2.3


@targets
@pytest.mark.parametrize(
    ("function", "x", "expected"),
    [
        (np.sin, 0.0, 0.0),
        (np.sin, -0.0, -0.0),
        (np.sin, 1e-200, 1e-200),
        (np.cos, 0.0, 1.0),
        (np.cos, -0.0, 1.0),
        (np.exp, 0.0, 1.0),
        (np.exp, -0.0, 1.0),
        (np.exp, 1.0, np.e),
        (np.exp, 709.782, 1.7964120280206387e308),
        (np.exp, 709.8, inf),
        (np.exp, 1e300, inf),
        (np.exp, inf, inf),
        (np.exp, -800.0, 0.0),
        (np.exp, -inf, 0.0),
        (np.expm1, 0.0, 0.0),
        (np.expm1, -0.0, -0.0),
        (np.expm1, 1e-300, 1e-300),
        (np.expm1, 710.0, inf),
        (np.expm1, inf, inf),
        (np.expm1, -1e10, -1.0),
        (np.expm1, -inf, -1.0),
        (np.expm1, nan, nan),
        (np.log, 1.0, 0.0),
        (np.log, 0.0, -inf),
        (np.log, -0.0, -inf),
        (np.log, inf, inf),
        (np.log, -1.0, nan),
        (np.log, -inf, nan),
        (np.sqrt, -0.0, -0.0),
        (np.sqrt, -1.0, nan),
        (np.sqrt, inf, inf),
        (np.rint, 2.5, 2.0),
        (np.rint, 3.5, 4.0),
        (np.rint, -0.4, -0.0),
        (np.rint, 2.0**52 + 1, 2.0**52 + 1),
        (np.rint, 1e300, 1e300),
        (np.rint, -inf, -inf),
        (np.floor, -0.5, -1.0),
        (np.floor, -0.0, -0.0),
        (np.floor, 7.0, 7.0),
        (np.floor, -1e300, -1e300),
        (np.floor, inf, inf),
        *((f, nan, nan) for f in (np.sin, np.cos, np.exp, np.log, np.sqrt, np.rint, np.floor)),
        (np.sin, inf, nan),
        (np.cos, -inf, nan),
    ],
    ids=lambda v: getattr(v, "__name__", str(v)),
)
def test_special_values(goal, function, x, expected):
    got = evaluate(function, goal, np.array([x]))[0]
    assert got == pytest.approx(expected, rel=2e-16 if np.isfinite(expected) else 0, nan_ok=True)
    assert np.signbit(got) == np.signbit(expected) or np.isnan(expected)


@compiled_targets
def test_angles_too_large_to_reduce_are_not_a_number_rather_than_wrong(goal):
    x = np.array([LARGEST_ANGLE, -LARGEST_ANGLE, 1.001e6, 1e22, -1e300])
    assert np.isnan(evaluate(np.sin, goal, x)).tolist() == [False, False, True, True, True]
    assert np.isnan(evaluate(np.cos, goal, x)).tolist() == [False, False, True, True, True]


@targets
def test_arctan2_has_numpy_s_signs_at_zero_and_infinity(goal):
    values = [0.0, -0.0, 1.0, -1.0, 5e-324, 1e308, -1e308, inf, -inf, nan]
    y, x = (a.ravel() for a in np.meshgrid(values, values))
    both = np.isinf(y) & np.isinf(x)  # compiled code gives NaN there
    got, expected = evaluate(np.arctan2, goal, y, x)[~both], np.arctan2(y, x)[~both]
    known = ~np.isnan(expected)
    np.testing.assert_allclose(got, expected, rtol=1e-15)
    np.testing.assert_array_equal(np.copysign(1.0, got)[known], np.copysign(1.0, expected)[known])


@pytest.mark.skipif(len(COMPILED) < 2, reason="this machine has one vector unit")
def test_processors_that_fuse_agree_to_the_bit():
    x = np.random.default_rng(5).uniform(-20, 20, 5_000)
    results = [
        evaluate(lambda a: np.sin(a) + np.exp(-a * a) * np.arctan2(a, 1.0 + a * 0.5), goal, x)
        for goal in COMPILED
        if goal.name in ("avx2", "avx512")
    ]
    for other in results[1:]:
        np.testing.assert_array_equal(other, results[0])
