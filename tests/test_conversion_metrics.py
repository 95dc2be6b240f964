"""Metrics of conversions against sums by hand and distributions that are known."""

import numpy as np
import pytest
from scipy import stats

from boresight.errors import UsageError
from boresight.experiments.consistency import (
    bias,
    conversion_nes,
    line_of_sight_axes,
    line_of_sight_bias,
    normalised_squares,
)

ROOT = np.array([[3.0, 0.0, 0.0], [-2.0, 1.0, 0.0], [0.5, 0.7, 0.2]])
dimensions = pytest.mark.parametrize("d", [2, 3])


def polar(azimuth, elevation, radius=1.0):
    return radius * np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )


@pytest.mark.parametrize("azimuth", [0.3, 2.0, -3.1])
@pytest.mark.parametrize("elevation", [0.0, 1.2, -0.4])
def test_axes_are_where_range_azimuth_and_elevation_grow(azimuth, elevation):
    axes, h = line_of_sight_axes(polar(azimuth, elevation, 7.0)), 1e-6
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    grown = (
        polar(azimuth, elevation, 1 + h) - polar(azimuth, elevation, 1 - h),
        (polar(azimuth + h, elevation) - polar(azimuth - h, elevation)) / np.cos(elevation),
        polar(azimuth, elevation + h) - polar(azimuth, elevation - h),
    )
    np.testing.assert_allclose(axes, np.array(grown) / (2 * h), atol=1e-9)
    flat = line_of_sight_axes(polar(azimuth, 0.0)[:2])
    np.testing.assert_allclose(flat, line_of_sight_axes(polar(azimuth, 0.0))[:2, :2], atol=1e-15)


def test_straight_above_the_sensor_there_are_still_axes():
    axes = line_of_sight_axes([[0.0, 0.0, 5.0]])[0]
    np.testing.assert_allclose(axes, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)


def test_nes_by_hand():
    """Errors of (3, 4) at 90 degrees: along is y, across is -x."""
    errors = np.array([[3.0, 4.0], [1.0, 0.0]])
    covs = np.array([[[4.0, 0], [0, 9]], [[1.0, 0], [0, 16]]])
    nes = conversion_nes(errors, covs, [0.0, 50.0])
    assert nes.total.value == pytest.approx((9 / 4 + 16 / 9 + 1) / 4)
    assert [c.value for c in nes.per_component] == pytest.approx([(9 / 4 + 1) / 2, 8 / 9])
    assert nes.along.value == pytest.approx(8 / 9)
    assert nes.across.value == pytest.approx((9 / 4 + 1) / 2)
    expected = stats.chi2.ppf([0.005, 0.995], 4) / 4
    assert [nes.total.low, nes.total.high] == pytest.approx(expected)
    assert [nes.along.low, nes.across.high] == pytest.approx(stats.chi2.ppf([0.005, 0.995], 2) / 2)
    assert nes.across.standard_error == pytest.approx(abs(9 / 4 - 1) / 2)


def test_across_in_three_dimensions_is_both_directions_together():
    error, cov = np.array([1.0, -2.0, 4.0]), ROOT @ ROOT.T
    nes = conversion_nes(np.stack([error] * 2), cov, [9.0, 0.0, 0.0])  # axes are x, y, z
    expected = error[1:] @ np.linalg.inv(cov[1:, 1:]) @ error[1:] / 2
    assert nes.across.value == pytest.approx(expected)
    assert nes.total.value == pytest.approx(error @ np.linalg.inv(cov) @ error / 3)
    assert nes.along.value == pytest.approx(1.0 / cov[0, 0])


@dimensions
def test_what_is_consistent_leaves_each_band_once_in_a_hundred(d):
    """4,000 studies of 25 runs, each with positions of its own; standard error of a share 0.16 %.

    Four of them are allowed: one false alarm in 16,000 for each of the shares.
    """
    rng = np.random.default_rng(d)
    root = ROOT[:d, :d]
    studies = [
        conversion_nes(rng.normal(size=(25, d)) @ root.T, root @ root.T, rng.normal(size=(25, d)))
        for _ in range(4000)
    ]
    for pick in (
        lambda s: s.total,
        lambda s: s.per_component[-1],
        lambda s: s.along,
        lambda s: s.across,
    ):
        found = [pick(study) for study in studies]
        share = np.mean([not f.low < f.value < f.high for f in found])
        assert share == pytest.approx(0.01, abs=4 * 0.0016)


def test_a_covariance_too_large_along_the_line_of_sight_shows_there_only():
    """Twice the standard deviation along: 1/4 there; 20,000 runs, four standard errors."""
    rng = np.random.default_rng(7)
    axes = line_of_sight_axes(np.array([1.0, 2.0]))
    errors = rng.normal(size=(20_000, 2)) * [1.0, 5.0] @ axes
    nes = conversion_nes(errors, axes.T @ np.diag([4.0, 25.0]) @ axes, np.array([1.0, 2.0]))
    assert nes.along.value == pytest.approx(0.25, abs=4 * 0.25 * np.sqrt(2 / 20_000))
    assert nes.across.low < nes.across.value < nes.across.high
    assert nes.total.value == pytest.approx(0.625, abs=4 * nes.total.standard_error)
    assert nes.total.value < nes.total.low


def test_a_covariance_that_is_none_or_a_lost_run_is_infinite_and_not_dropped():
    errors, covs = np.ones((4, 2)), np.stack([np.eye(2)] * 4)
    covs[0, 1, 1], covs[1, 0, 0], errors[2, 0] = -1.0, np.nan, np.nan
    squares = normalised_squares(errors, covs)
    assert squares.tolist() == [np.inf, np.inf, np.inf, pytest.approx(2.0)]
    nes = conversion_nes(errors, covs, [1.0, 0.0])
    assert nes.total.value == nes.along.value == nes.total.standard_error == np.inf
    lost = bias(errors)
    assert lost.value.tolist() == [np.inf, 1.0]
    assert lost.significance.tolist() == [np.inf, np.inf]  # not a number; no spread at all
    directions = line_of_sight_bias(errors[:, None], [1.0, 0.0])
    assert directions.across.value.tolist() == [np.inf]


def test_significance_is_bias_over_standard_deviation():
    """Erratum B8, with the square of a normal number: mean 1, variance 2, so 0.707.

    The standard error of the ratio over 100,000 runs is below 0.003, from a repetition in parts.
    """
    squares = np.random.default_rng(8).normal(size=100_000) ** 2
    found = bias(squares)
    parts = [bias(part).significance for part in np.split(squares, 100)]
    error = np.std(parts) / 10
    assert error < 0.003
    assert found.significance == pytest.approx(np.sqrt(0.5), abs=4 * error)
    assert abs(found.significance - 0.5) > 10 * error  # as printed: over the variance
    assert found.value == pytest.approx(1.0, abs=4 * found.standard_error)
    assert found.standard_error == pytest.approx(np.sqrt(2 / 100_000), rel=0.05)
    assert bias(np.zeros(5)).significance == 0.0


def test_the_standard_error_of_a_bias_is_the_spread_of_biases():
    """5,000 studies of 30 runs: t with 29 degrees of freedom beyond its 1 % quantiles in 1 %."""
    found = bias(3.0 * np.random.default_rng(9).normal(size=(30, 5000)) + 2.0)
    t = (found.value - 2.0) / found.standard_error
    share = np.mean(np.abs(t) > stats.t.ppf(0.995, 29))
    assert share == pytest.approx(0.01, abs=4 * np.sqrt(0.01 * 0.99 / 5000))


@dimensions
def test_bias_is_found_along_and_across_at_every_scan(d):
    """Each run from its own position; planted biases come back.

    Within four standard errors: at most one false alarm in 1,700 among the nine.
    """
    rng = np.random.default_rng(10)
    positions = rng.normal(size=(2000, 3, d)) * 1000.0
    planted = np.array([[-30.0, 5.0, 2.0], [0.0, -8.0, 1.0], [10.0, 0.0, -4.0]])[:, :d]
    axes = line_of_sight_axes(positions)
    errors = np.einsum("...ij,...i->...j", axes, planted) + rng.normal(size=positions.shape)
    found = line_of_sight_bias(errors, positions)
    across = found.across.value.reshape(3, d - 1)
    np.testing.assert_allclose(found.along.value, planted[:, 0], atol=4 * 2000**-0.5)
    np.testing.assert_allclose(across, planted[:, 1:], atol=4 * 2000**-0.5)
    np.testing.assert_allclose(found.along.standard_error, 2000**-0.5, rtol=0.1)
    assert found.across.value.shape == ((3,) if d == 2 else (3, 2))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: conversion_nes(np.ones(2), np.eye(2), [1.0, 0]), r"\(2,\)"),
        (lambda: conversion_nes(np.ones((5, 2)), np.eye(3), [1.0, 0]), r"covs.*\(3, 3\)"),
        (lambda: conversion_nes(np.ones((5, 2)), np.eye(2), [1.0, 0, 0]), "positions"),
        (lambda: line_of_sight_bias(np.ones((5, 1, 4)), np.ones(4)), "2 or 3"),
        (lambda: bias(np.ones((1, 3))), "two or more"),
    ],
)
def test_what_does_not_fit_is_refused(call, said):
    with pytest.raises(UsageError, match=said):
        call()
