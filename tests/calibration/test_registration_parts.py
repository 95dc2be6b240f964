"""The pieces of a registration against dense textbook forms: delays, sandwich, classes, steps."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import minimize_scalar

from boresight.calibration.clusters import Sums, delay_variance, sandwich, solve
from boresight.calibration.fixed_point import fixed_point
from boresight.calibration.laws import Errors, first_laws, setting
from boresight.calibration.robust import classify

SIZES = (3, 7, 1, 5, 9, 4, 6)
DELAY_VAR = 2.3


@pytest.fixture
def regression():
    """(X, y, w, target): a small weighted regression in which every target has a delay."""
    rng = np.random.default_rng(3)
    target = np.repeat(np.arange(len(SIZES)), SIZES)
    X = np.column_stack([np.ones(len(target)), rng.normal(size=(len(target), 2))])
    w = rng.uniform(0.3, 3.0, len(target))
    y = X @ [1.0, -2.0, 0.5] + 1.5 * rng.normal(size=len(SIZES))[target]
    return X, y + rng.normal(size=len(target)) / np.sqrt(w), w, target


def sums(X, y, w, target, prior):
    def total(values):
        return np.array([values[target == g].sum(0) for g in range(len(SIZES))])

    weighted = X * w[:, None]
    normal = weighted.T @ X + np.diag(prior)
    return Sums(normal, weighted.T @ y, total(weighted), total(w), total(w * y))


def dense(w, target, delay_var):
    """Covariance of the observations, whole."""
    return np.diag(1.0 / w) + delay_var * (target[:, None] == target[None, :])


def test_terms_and_delays_are_those_of_the_whole_covariance(regression):
    X, y, w, target = regression
    prior = np.array([0.1, 0.2, 0.3])
    V = dense(w, target, DELAY_VAR)
    information = X.T @ np.linalg.solve(V, X) + np.diag(prior)
    terms = np.linalg.solve(information, X.T @ np.linalg.solve(V, y))
    Z = (target[:, None] == np.arange(len(SIZES))).astype(float)
    delay = DELAY_VAR * Z.T @ np.linalg.solve(V, y - X @ terms)
    found = solve(sums(X, y, w, target, prior), DELAY_VAR)
    assert np.allclose(found.information, information, rtol=1e-10)
    assert np.allclose(found.terms, terms, rtol=1e-10)
    assert np.allclose(found.delay, delay, rtol=1e-9)


def test_the_errors_of_delays_are_those_of_the_joint_normal_equations(regression):
    X, y, w, target = regression
    prior = np.array([0.1, 0.2, 0.3])
    Z = (target[:, None] == np.arange(len(SIZES))).astype(float)
    A = np.column_stack([X, Z])
    joint = A.T @ (w[:, None] * A) + np.diag([*prior, *[1.0 / DELAY_VAR] * len(SIZES)])
    found = solve(sums(X, y, w, target, prior), DELAY_VAR)
    assert np.allclose(found.delay_var, np.diag(np.linalg.inv(joint))[3:], rtol=1e-10)


def test_the_variance_of_delays_is_that_of_restricted_maximum_likelihood(regression):
    X, y, w, target = regression

    def loss(delay_var):
        V = dense(w, target, delay_var)
        information = X.T @ np.linalg.solve(V, X)
        left = y - X @ np.linalg.solve(information, X.T @ np.linalg.solve(V, y))
        logs = np.linalg.slogdet(V)[1] + np.linalg.slogdet(information)[1]
        return logs + left @ np.linalg.solve(V, left)

    best = minimize_scalar(loss, bounds=(1e-6, 50.0), method="bounded", options={"xatol": 1e-9}).x
    whole, found = sums(X, y, w, target, np.zeros(3)), 1.0
    for _ in range(200):
        found = delay_variance(whole, solve(whole, found), found)
    assert found == pytest.approx(best, rel=1e-5)


def test_the_sandwich_is_the_textbook_cr2_and_its_degrees_of_freedom(regression):
    X, y, w, target = regression
    V = dense(w, target, DELAY_VAR)
    blocks = [np.flatnonzero(target == g) for g in range(len(SIZES))]
    inverse = np.linalg.inv(np.linalg.cholesky(V))  # whitened, the textbook's identity case
    Z, e = inverse @ X, inverse @ y
    M = np.linalg.inv(Z.T @ Z)
    e = e - Z @ M @ Z.T @ e
    hat = np.eye(len(y)) - Z @ M @ Z.T
    roots = []
    for rows in blocks:
        values, vectors = np.linalg.eigh(hat[np.ix_(rows, rows)])
        roots.append(vectors / np.sqrt(values) @ vectors.T)
    arms = [M @ Z[rows].T @ root for rows, root in zip(blocks, roots, strict=True)]
    cov = sum(np.outer(a @ e[rows], a @ e[rows]) for a, rows in zip(arms, blocks, strict=True))
    freedom = []
    for term in range(3):
        P = block_diag(*[a[term][:, None] for a in arms])
        G = P.T @ hat @ P
        freedom.append(np.trace(G) ** 2 / np.sum(G**2))
    information = np.array([Z[rows].T @ Z[rows] for rows in blocks])
    scores = np.array([Z[rows].T @ e[rows] for rows in blocks])
    found = sandwich(scores, information, np.zeros(3))
    assert np.allclose(found.cov, cov, rtol=1e-9)
    assert np.allclose(found.freedom, freedom, rtol=1e-9)


def test_a_direction_that_no_pair_tells_keeps_what_was_believed(regression):
    X, _, w, target = regression
    information, scores = np.zeros((len(SIZES), 3, 3)), np.zeros((len(SIZES), 3))
    scores[:, :2] = np.random.default_rng(1).normal(size=(len(SIZES), 2))
    for g in range(len(SIZES)):
        rows = target == g
        information[g, :2, :2] = X[rows, :2].T @ (w[rows, None] * X[rows, :2])
    found = sandwich(scores, information, np.array([0.0, 0.0, 0.25]))
    assert found.cov[2, 2] == pytest.approx(4.0)
    assert np.abs(found.cov[2, :2]).max() < 1e-12
    assert found.freedom[2] == np.inf


def some_errors(rng, left):
    shape = left.shape
    lever = np.stack([np.ones(shape[1]), rng.uniform(2e4, 2e5, shape[1])])
    second = np.stack([rng.uniform(-200, 200, shape[1]), rng.uniform(-2e-3, 2e-3, shape[1])])
    at = setting(np.ones(shape), np.zeros((2, 1)), lever, second)
    return Errors(left, left**2, at)


@pytest.mark.parametrize("channel", [0, 1])
def test_the_curvature_is_the_derivative_of_the_influence(channel):
    """With a law of outliers so broad that its own slope, which is not followed, vanishes."""
    rng, sd = np.random.default_rng(8), np.array([50.0, 1e-3])
    left = sd[:, None] * rng.normal(size=(2, 500)) * rng.choice([1.0, 3.0], 500)
    laws = first_laws(("range_m", "azimuth_rad"), sd, robust=True).without_late()
    laws = replace(laws, place_m=1e6, wrong=np.array([0.5, 0.0]))
    step = np.zeros((2, 1))
    step[channel] = 1e-4 * sd[channel]
    ahead, behind, here = (
        some_errors(np.random.default_rng(9), left + sign * step) for sign in (1.0, -1.0, 0.0)
    )
    change = classify(ahead, laws).weight * ahead.left - classify(behind, laws).weight * behind.left
    slope = change[channel] / (2.0 * step[channel])
    curvature = classify(here, laws).curvature[channel]
    assert np.abs(slope - curvature).max() < 1e-5 / sd[channel] ** 2
    assert curvature.min() < -0.01 / sd[channel] ** 2


def test_a_gross_error_is_an_outlier_and_has_no_weight():
    sd = np.array([50.0, 1e-3])
    laws = first_laws(("range_m", "azimuth_rad"), sd, robust=True)
    left = np.array([[0.0, 40.0, 9e4, 2e3], [0.0, 1e-3, 0.2, 1e-3]])
    found = classify(some_errors(np.random.default_rng(2), left), laws)
    assert (found.outlier[:2] < 0.05).all()
    assert (found.outlier[2:] > 0.999).all()
    assert (found.weight[:, 2:] < 1e-3 * found.weight[:, :1]).all()


def test_a_slow_step_arrives_soon():
    """Plain steps would need 10,000 of them; the fixed point is known."""
    goal, rate = np.array([1.0, -2.0, 3.0, 0.5]), np.array([0.999, 0.9, 0.5, 0.99])
    calls = []

    def step(x):
        calls.append(1)
        return goal + rate * (x - goal)

    found, settled = fixed_point(
        step, np.zeros(4), size=lambda move: np.abs(move).max(), tolerance=1e-9, most=60
    )
    assert settled
    assert np.abs(found - goal).max() < 1e-5
    assert len(calls) < 20
