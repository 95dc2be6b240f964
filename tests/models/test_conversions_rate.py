"""Position and range rate together, against quadrature over correlated noise."""

import numpy as np
import pytest

from boresight.maths import elimination
from boresight.models.conversions import convert
from boresight.models.conversions_rate import GivenRate, convert_with_rate, rate_moments
from boresight.models.polar import Given
from oracles import quadrature

DEG = np.pi / 180
SIGMA = [150.0, 8 * DEG, 5 * DEG]
RATE_SIGMA = 4.0
MEAN, RATE = [1e4, 0.6, 0.4], -230.0
SPREAD, RATE_SPREAD, TOGETHER = [250.0, 4 * DEG, 3 * DEG], 12.0, -0.6
CORRELATIONS = (-0.9, 0.0, 0.9)


def draws(mean, rate, sigma, rate_sigma, correlation):
    """Polar points (d, n), rates (n,) and weights: range and rate correlated; squares of both."""
    counts = [3, *[quadrature.enough(s) for s in sigma[1:]], 3]
    means, sigmas = [*mean, 0.0], [*sigma, 1.0]
    points, weights = quadrature.normal(means, sigmas, counts)
    along = (points[0] - mean[0]) / (sigma[0] or 1.0)
    rest = np.sqrt(1 - correlation**2) * points[-1]
    return points[:-1], rate + rate_sigma * (correlation * along + rest), weights


def pseudo(polar, rate, shift, sigma=None):
    """Cartesian position (unbiased if sigma is given) and the product of range and rate."""
    x = quadrature.cartesian(polar)
    if sigma is not None:
        x = x / quadrature.shortening(sigma).reshape(-1, *[1] * (x.ndim - 1))
    return np.concatenate([x, (polar[0] * rate - shift)[None]])


def predicted(d, correlation, sigma=SIGMA, spread=SPREAD):
    truth, rate, outer = draws(MEAN[:d], RATE, spread[:d], RATE_SPREAD, TOGETHER)
    noise, wind, inner = draws([0.0] * d, 0.0, sigma[:d], RATE_SIGMA, correlation)
    shift = correlation * sigma[0] * RATE_SIGMA
    plots = truth[:, :, None] + noise[:, None, :]
    measured = pseudo(plots, rate[:, None] + wind, shift, sigma[:d])
    errors = measured - pseudo(truth[:, :, None], rate[:, None], 0.0)
    given = GivenRate(
        Given(MEAN[:d], np.square(spread[:d])),
        RATE,
        RATE_SPREAD**2,
        TOGETHER * RATE_SPREAD * spread[0],
    )
    return errors, outer, inner, given


@pytest.mark.parametrize("correlation", CORRELATIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_unbiased_for_every_truth_and_its_covariance_averaged_over_the_prediction(d, correlation):
    errors, outer, inner, given = predicted(d, correlation)
    scale = np.array([1e4] * d + [1e4 * 230.0])
    assert np.all(np.abs(errors @ inner).max(-1) < 1e-13 * scale)
    weights = np.multiply.outer(outer, inner).ravel()
    exact = quadrature.second(errors.reshape(d + 1, -1), weights).astype(float)
    z = np.array([*MEAN[:d], RATE])
    found = convert_with_rate(z, [*SIGMA[:d], RATE_SIGMA], correlation, given)
    sd = np.sqrt(np.diag(exact))
    assert np.max(np.abs(found.cov - exact) / np.outer(sd, sd)) < 1e-12
    assert np.all(np.linalg.eigvalsh(found.cov / np.outer(sd, sd)) > 0)
    expected = pseudo(z[:-1, None], z[-1], correlation * SIGMA[0] * RATE_SIGMA, SIGMA[:d])[:, 0]
    assert np.allclose(found.mean, expected.astype(float), rtol=1e-13)


@pytest.mark.parametrize("correlation", CORRELATIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_a_first_scan_has_the_mean_square_error_that_the_plot_leaves_possible(d, correlation):
    noise, wind, weights = draws([0.0] * d, 0.0, SIGMA[:d], RATE_SIGMA, correlation)
    z = np.array([*MEAN[:d], RATE])
    found = convert_with_rate(z, [*SIGMA[:d], RATE_SIGMA], correlation)
    errors = found.mean[:, None] - pseudo(z[:-1, None] - noise, z[-1] - wind, 0.0)
    exact = quadrature.second(errors, weights).astype(float)
    sd = np.sqrt(np.diag(exact))
    assert np.max(np.abs(found.cov - exact) / np.outer(sd, sd)) < 1e-12


WIDTHS = [(0.01, 60.0), (0.1, 0.01), (1.0, 10.0), (10.0, 1.0), (60.0, 0.1)]  # degrees


@pytest.mark.parametrize("correlation", CORRELATIONS)
@pytest.mark.parametrize("widths", WIDTHS, ids=str)
@pytest.mark.parametrize("d", [2, 3])
def test_given_a_prediction_or_the_plot_at_any_width_of_the_angles(d, widths, correlation):
    sigma = [150.0, *(width * DEG for width in widths)]
    spread = [250.0, *(min(2.0 * width, 20.0) * DEG for width in widths)]
    z = np.array([*MEAN[:d], RATE])
    errors, outer, inner, given = predicted(d, correlation, sigma, spread)
    weights = np.multiply.outer(outer, inner).ravel()
    found = convert_with_rate(z, [*sigma[:d], RATE_SIGMA], correlation, given)
    agree(found.cov, quadrature.second(errors.reshape(d + 1, -1), weights))
    noise, wind, weights = draws([0.0] * d, 0.0, sigma[:d], RATE_SIGMA, correlation)
    first = convert_with_rate(z, [*sigma[:d], RATE_SIGMA], correlation)
    errors = first.mean[:, None] - pseudo(z[:-1, None] - noise, z[-1] - wind, 0.0)
    agree(first.cov, quadrature.second(errors, weights))


def agree(found, exact):
    """In every direction, relative to the exact covariance there: acceptance 1."""
    exact = exact.astype(float)
    sd = np.sqrt(np.diag(exact))
    L = np.linalg.cholesky(exact / np.outer(sd, sd))
    off = np.linalg.solve(L, (found - exact) / np.outer(sd, sd))
    assert np.max(np.abs(np.linalg.solve(L, off.T))) <= 1e-8


@pytest.mark.parametrize("d", [2, 3])
def test_positive_definite_in_a_million_draws(d):
    n, rng = 1_000_000, np.random.default_rng(d)

    def decades(low, high, rows=1):
        return 10.0 ** rng.uniform(np.log10(low), np.log10(high), (rows, n))

    r = decades(1.0, 1e6)
    angles = rng.uniform(-1.0, 1.0, (d - 1, n)) * np.array([np.pi, np.pi / 2])[: d - 1, None]
    z = np.concatenate([r, angles, rng.normal(scale=300.0, size=(1, n))])
    sigma = np.concatenate([r * decades(1e-6, 0.3), decades(0.01, 60, d - 1) * DEG])
    sigma = np.concatenate([sigma, decades(0.01, 30)])
    correlation, together = rng.uniform(-0.99, 0.99, (2, n))
    spread = sigma * rng.uniform(0.0, 2.0, (d + 1, n))
    place = Given(z[:-1], np.square(spread[:-1]))
    given = GivenRate(place, z[-1], spread[-1] ** 2, together * spread[-1] * spread[0])
    for condition in (given, None):
        pivots = elimination(convert_with_rate(z, sigma, correlation, condition).cov)
        assert len(pivots) == d + 1
        assert all(np.all(pivot > 0) for pivot in pivots)


@pytest.mark.parametrize("d", [2, 3])
def test_the_position_is_that_of_ducm(d):
    _, _, _, given = predicted(d, 0.5)
    for condition in (None, given):
        joint = convert_with_rate([*MEAN[:d], RATE], [*SIGMA[:d], RATE_SIGMA], 0.5, condition)
        alone = convert("ducm", MEAN[:d], SIGMA[:d], condition and condition.place)
        assert np.array_equal(joint.mean[:d], alone.mean)
        assert np.array_equal(joint.cov[:d, :d], alone.cov)


@pytest.mark.parametrize("d", [2, 3])
def test_moments_of_a_prediction_are_those_of_a_numeric_gradient(d):
    rng = np.random.default_rng(5)
    state = np.concatenate([[4e3, -7e3, 2e3][:d], [100.0, 40.0, -20.0][:d]])
    A = rng.normal(size=(2 * d, 2 * d)) * np.repeat([50.0, 5.0], d)[:, None]
    P = A @ A.T
    found = rate_moments(state[:d], state[d:], P)

    def range_and_rate(x):
        r = np.linalg.norm(x[:d])
        return np.array([r, x[:d] @ x[d:] / r])

    steps = np.diag(np.repeat([1e-1, 1e-2], d))
    columns = [
        (range_and_rate(state + e) - range_and_rate(state - e)) / (2 * e.sum()) for e in steps
    ]
    J = np.stack(columns, axis=1)
    cov = J @ P @ J.T
    assert found.rate == pytest.approx(range_and_rate(state)[1], rel=1e-13)
    assert found.place.variances[0] == pytest.approx(cov[0, 0], rel=1e-7)
    assert found.variance == pytest.approx(cov[1, 1], rel=1e-7)
    assert found.covariance == pytest.approx(cov[0, 1], rel=1e-7)
