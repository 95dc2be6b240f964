"""Position and range rate together, against quadrature over correlated noise."""

import numpy as np
import pytest

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


def predicted(d, correlation):
    truth, rate, outer = draws(MEAN[:d], RATE, SPREAD[:d], RATE_SPREAD, TOGETHER)
    noise, wind, inner = draws([0.0] * d, 0.0, SIGMA[:d], RATE_SIGMA, correlation)
    shift = correlation * SIGMA[0] * RATE_SIGMA
    plots = truth[:, :, None] + noise[:, None, :]
    measured = pseudo(plots, rate[:, None] + wind, shift, SIGMA[:d])
    errors = measured - pseudo(truth[:, :, None], rate[:, None], 0.0)
    given = GivenRate(
        Given(MEAN[:d], np.square(SPREAD[:d])),
        RATE,
        RATE_SPREAD**2,
        TOGETHER * RATE_SPREAD * SPREAD[0],
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
