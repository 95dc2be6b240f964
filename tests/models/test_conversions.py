"""Conversions against quadrature of what defines them, in long double, and in a million draws."""

from functools import cache

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.lanes import Matrix, Rate, Scalar, Vector, make_kernel, pack_states, trace
from boresight.maths import elimination
from boresight.models.conversions import CONVERSIONS, convert
from boresight.models.polar import Given, polar_moments
from oracles import quadrature

DISTANCE = 1e4
TIGHT = 1e-13 if np.finfo(np.longdouble).nmant >= 60 else 1e-8  # what the quadrature itself holds
DEG = np.pi / 180
ANGLES = (0.01, 0.1, 1.0, 10.0, 60.0)  # degrees, standard deviation
RANGES = (1e-6, 1e-3, 0.3)  # of the distance
AIMS = ((0.6, 0.4), (-2.5, 0.0), (np.pi / 2, -1.5))  # azimuth and elevation, rad
SPREADS = (0.0, 0.3, 2.0)  # of a prediction, in standard deviations of the plot


def cases():
    """(place, sigma): every angle in the plane, pairs of unequal angles in space."""
    for i, wide in enumerate(ANGLES):
        for j, narrow in enumerate(RANGES):
            aim = AIMS[(i + j) % 3]
            other = ANGLES[(2 * i + j) % 5]
            yield pytest.param([DISTANCE, aim[0]], [narrow * DISTANCE, wide * DEG])
            space = [DISTANCE, *aim], [narrow * DISTANCE, wide * DEG, other * DEG]
            # Quadrature of both at 60 degrees, over noise and prediction, has millions of points.
            yield pytest.param(*space, marks=[pytest.mark.slow] if wide + other > 100 else [])


every_case = pytest.mark.parametrize(("mean", "sigma"), list(cases()), ids=str)


def agree(found, exact):
    """Covariances equal as quadratic forms: relative to the exact one in every direction."""
    exact = np.asarray(exact, dtype=float)
    L = np.linalg.inv(np.linalg.cholesky(exact))
    assert np.max(np.abs(L @ (found - exact) @ L.T)) <= 1e-8
    agree_by_entry(found, exact)


def agree_by_entry(found, exact):
    exact = np.asarray(exact, dtype=float)
    sd = np.sqrt(np.diag(exact))
    assert np.max(np.abs(found - exact) / np.outer(sd, sd)) <= TIGHT


def near(found, exact):
    assert np.max(np.abs(found - np.asarray(exact, dtype=float))) <= 1e-13 * DISTANCE


def spread_of(sigma, ratio):
    """At most 60 degrees, so that one quadrature of a hundred thousand points is exact."""
    return [ratio * sigma[0], *[min(ratio * s, 60 * DEG) for s in sigma[1:]]]


@every_case
@pytest.mark.parametrize("ratio", SPREADS)
def test_conversions_given_a_truth_or_a_prediction(mean, sigma, ratio):
    spread = spread_of(sigma, ratio)
    given = Given(mean, np.square(spread))
    exact = quadrature.Predicted(mean, spread, sigma)
    found = convert("ducm", mean, sigma, given)
    near(found.mean, quadrature.cartesian(np.array(mean)) / quadrature.shortening(sigma))
    agree(found.cov, exact.unbiased())

    found = convert("cmkf-d-t", mean, sigma, given)
    bias, cov = exact.debiased()
    near(found.mean, quadrature.cartesian(np.array(mean)) - bias)
    agree(found.cov, cov)

    found = convert("mmse", mean, sigma, given)
    eta, mean_square = exact.least_square()
    near(found.mean, eta * quadrature.cartesian(np.array(mean)))
    agree(found.cov, mean_square)


@every_case
def test_conversions_given_the_plot(mean, sigma):
    exact = quadrature.Measured(mean, sigma)
    for name, (expected, cov) in {"mucm": exact.posterior(), "ucm": exact.unbiased()}.items():
        found = convert(name, mean, sigma)
        near(found.mean, expected)
        agree(found.cov, cov)
    found = convert("conventional", mean, sigma)
    near(found.mean, quadrature.cartesian(np.array(mean)))
    # Its axes may be 1 and 1e-6 long: entries in double precision do not tell the short one well.
    agree_by_entry(found.cov, quadrature.linear(mean, sigma))


@every_case
def test_what_cmkf_d_m_takes_the_truth_for_is_what_the_plot_leaves_possible(mean, sigma):
    bias, cov = quadrature.Predicted(mean, sigma, sigma).debiased()
    found = convert("cmkf-d-m", mean, sigma)
    near(found.mean, quadrature.cartesian(np.array(mean)) - bias)
    agree(found.cov, cov)


def test_quadrature_is_exact_at_sixty_degrees():
    for nodes in (quadrature.enough(60 * DEG), 60):
        x, w = quadrature.normal([0, 0.7], [0, 60 * DEG], [1, nodes])
        expected = np.cos(1.4) * np.exp(-2 * (60 * DEG) ** 2)
        assert w @ np.cos(2 * x[1]) == pytest.approx(expected, abs=1e-15)


@cache
def drawn(n, d, seed):
    """Plots, standard deviations and places (d, n), over many decades."""
    rng = np.random.default_rng(seed)

    def decades(low, high, rows):
        return 10.0 ** rng.uniform(np.log10(low), np.log10(high), (rows, n))

    r = decades(1.0, 1e6, 1)
    half = [np.pi, np.pi / 2][: d - 1]
    angles = np.stack([rng.uniform(-h, h, n) for h in half])
    sigma = np.concatenate([r * decades(1e-6, 0.3, 1), decades(0.01, 60, d - 1) * DEG])
    spread = np.concatenate([r * decades(1e-7, 1.0, 1), decades(0.001, 90, d - 1) * DEG])
    z = np.concatenate([r, angles])
    return z, sigma, Given(z + spread * rng.normal(size=(d, n)), spread**2)


@pytest.mark.parametrize("name", CONVERSIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_positive_definite_in_a_million_draws(name, d):
    z, sigma, given = drawn(1_000_000, d, seed=d)
    for part in np.split(np.arange(1_000_000), 20):  # what fits into the processor's cache
        place = Given(given.mean[:, part], given.variances[:, part])
        pivots = elimination(convert(name, z[:, part], sigma[:, part], place).cov)
        assert len(pivots) == d
        assert all(np.all(pivot > 0) for pivot in pivots)


@pytest.mark.parametrize(
    ("name", "conditioned"),
    [(name, told) for name in CONVERSIONS for told in (True, False) if told or name != "cmkf-d-t"],
)
def test_space_without_height_is_the_plane(name, conditioned):
    z, sigma, given = drawn(10_000, 2, seed=7)
    level = np.zeros((1, z.shape[1]))
    raised = Given(*[np.concatenate([each, level]) for each in given[:2]])
    plane = convert(name, z, sigma, given if conditioned else None)
    space = convert(
        name,
        np.concatenate([z, level]),
        np.concatenate([sigma, level]),
        raised if conditioned else None,
    )
    assert np.allclose(space.mean[:2], plane.mean, rtol=1e-12, atol=0)
    scale = np.sqrt(plane.cov[0, 0] * plane.cov[1, 1])
    assert np.all(np.abs(space.cov[:2, :2] - plane.cov) <= 1e-12 * np.abs(plane.cov).max((0, 1)))
    assert np.all(np.abs(space.cov[2]) <= 1e-12 * scale)
    assert np.all(space.mean[2] == 0.0)


@pytest.mark.parametrize("name", CONVERSIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_without_angular_noise_every_conversion_is_the_conventional(name, d):
    """What is left is of the order of s² r: second order in the angle's noise."""
    z, sigma = [DISTANCE, 0.7, 0.3][:d], [1.0, 1e-5, 2e-5][:d]
    plain = convert("conventional", z, sigma)
    found = convert(name, z, sigma, Given(z, [0.0] * d))
    assert np.max(np.abs(found.mean - plain.mean)) < 2e-4
    agree_to_second_order = np.linalg.solve(plain.cov, found.cov)
    assert np.allclose(agree_to_second_order, np.eye(d), atol=1e-7)


def compiled(name, d, *, conditioned=True):
    """The conversion as a kernel over lanes, the noise fixed."""

    def step(state, inputs):
        given = Given(inputs["mean"], inputs["variances"]) if conditioned else None
        found = convert(name, inputs["z"], inputs["sigma"], given)
        return {"idle": state["idle"]}, {"x": found.mean, "cov": found.cov}

    program = trace(
        step,
        state={"idle": Scalar()},
        inputs={
            "z": (Vector(d), Rate.EACH),
            "sigma": (Vector(d), Rate.FIXED),
            "mean": (Vector(d), Rate.EACH),
            "variances": (Vector(d), Rate.EACH),
        },
        outputs={"x": (Vector(d), Rate.EACH), "cov": (Matrix(d, d), Rate.EACH)},
    )
    return program, make_kernel(program)


@pytest.mark.parametrize("name", CONVERSIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_a_kernel_gives_what_the_formula_gives_on_floats(name, d):
    z, _, given = drawn(200, d, seed=9)
    sigma = np.array([30.0, 0.02, 0.03][:d])
    program, kernel = compiled(name, d)
    states = pack_states(program.state, {"idle": np.zeros(200)})
    inputs = {"z": z, "mean": given.mean, "variances": given.variances}
    each = {key: value.T[:, None] for key, value in inputs.items()}
    _, out = kernel.run(states, {**each, "sigma": sigma}, 1)
    lanes = [
        convert(name, *each, Given(*place))
        for each, place in zip(
            ((row, sigma) for row in z.T),
            zip(given.mean.T, given.variances.T, strict=True),
            strict=True,
        )
    ]
    assert np.allclose(out["x"][:, 0], [lane.mean for lane in lanes], rtol=1e-12, atol=1e-12)
    for found, lane in zip(out["cov"][:, 0], lanes, strict=True):
        sd = np.sqrt(np.diag(lane.cov))
        assert np.max(np.abs(found - lane.cov) / np.outer(sd, sd)) < 1e-12


def test_fixed_noise_costs_nothing_at_each_step():
    """Exponentials of the noise are worked out once: a plot costs a sine, a cosine, the track."""
    for name, most in {"ducm": 60, "ucm": 45, "conventional": 40}.items():
        program, _ = compiled(name, 2)
        assert program.operations <= most, name


def test_arrays_and_floats_agree_bit_for_bit():
    z, sigma, given = drawn(50, 3, seed=3)
    for name in CONVERSIONS:
        together = convert(name, z, sigma, given)
        for i in range(50):
            alone = convert(
                name, z[:, i], sigma[:, i], Given(given.mean[:, i], given.variances[:, i])
            )
            assert np.allclose(together.mean[:, i], alone.mean, rtol=1e-14, atol=0)
            assert np.allclose(together.cov[..., i], alone.cov, rtol=1e-13, atol=0)


@pytest.mark.parametrize("d", [2, 3])
def test_moments_of_a_prediction_are_those_of_a_numeric_gradient(d):
    rng = np.random.default_rng(5)
    p = np.array([4e3, -7e3, 2e3][:d])
    A = rng.normal(size=(d, d)) * 50
    P = A @ A.T
    found = polar_moments(p, P)
    steps = 1e-2 * np.eye(d)

    def polar(x):
        ground = np.hypot(x[0], x[1])
        angles = [np.arctan2(x[1], x[0]), *([np.arctan2(x[2], ground)] if d == 3 else [])]
        return np.array([np.linalg.norm(x), *angles])

    J = np.stack([(polar(p + e) - polar(p - e)) / 2e-2 for e in steps], axis=1)
    assert np.allclose(found.mean, polar(p), rtol=1e-14)
    assert np.allclose(found.variances, np.diag(J @ P @ J.T), rtol=1e-7)
    cos = [f(a) for a in polar(p)[1:] for f in (np.cos, np.sin)]
    assert np.allclose(found.direction, cos, rtol=1e-14)


@pytest.mark.parametrize(
    "p", [[0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 5e3], [0.0, -1e-9, -5e3], [1e-200, 0.0]], ids=str
)
def test_a_target_at_the_sensor_or_overhead_stays_finite(p):
    d = len(p)
    given = polar_moments(np.array(p), np.diag([100.0, 200.0, 300.0][:d]))
    for name in CONVERSIONS:
        found = convert(name, [5e3, 0.3, 1.5][:d], [30.0, 0.02, 0.02][:d], given)
        assert np.all(np.isfinite(found.mean))
        assert np.all(np.linalg.eigvalsh(found.cov) > 0)


def test_unknown_names_and_a_missing_truth_are_told():
    with pytest.raises(UsageError, match="did you mean 'ducm'"):
        convert("ducn", [1.0, 0.0], [1.0, 0.1])
    with pytest.raises(UsageError, match="needs to be given the truth"):
        convert("cmkf-d-t", [1.0, 0.0], [1.0, 0.1])
