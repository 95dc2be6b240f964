"""A Gaussian in the plane read in polar coordinates, against closed forms and plain integrals."""

import numpy as np
import pytest
from scipy import integrate, stats

from boresight.target_motion.planar import (
    Axes,
    angle_density,
    own_axes,
    quadrature,
    radius_probability,
    scattered,
    spots,
)


def axes_of(mean, long, short, turn=0.0):
    """One Gaussian (1,) whose longer axis points somewhere."""
    cos, sin = np.cos(turn), np.sin(turn)
    R = np.array([[cos, -sin], [sin, cos]])
    return own_axes(np.array([mean]), (R @ np.diag([long**2, short**2]) @ R.T)[None])


def test_own_axes_give_the_gaussian_back():
    found = axes_of((30.0, -20.0), 7.0, 2.0, turn=2.0)
    assert found.long == pytest.approx(7.0)
    assert found.short == pytest.approx(2.0)
    assert np.tan(found.turn) == pytest.approx(np.tan(2.0))
    assert np.hypot(found.along, found.across) == pytest.approx(np.hypot(30.0, 20.0))


def test_a_very_thin_one_keeps_its_width():
    found = axes_of((20_000.0, 3_000.0), 5_000.0, 1.0, turn=0.7)
    assert found.short == pytest.approx(1.0, rel=1e-7)


@pytest.mark.parametrize("away", [0.0, 0.5, 3.0, 15.0, 1_000.0])
@pytest.mark.parametrize("direction", [0.0, 0.8, 1.5, np.pi / 2, 3.0])
def test_a_round_one_has_rices_radius(away, direction):
    """Wherever the mean lies relative to the axes, which a round one has all the same."""
    sd = 10.0
    mean = away * sd * np.array([np.cos(direction), np.sin(direction)])
    axes = Axes(*np.array([[mean[0]], [mean[1]], [sd], [sd], [0.0]]))
    r = np.maximum(away + np.linspace(-4.0, 4.0, 17), 0.0)
    # Far away Rice's is normal, about the mean that curvature moves, to the third order.
    normal = stats.norm.cdf(r - away - 0.5 / max(away, 1.0))
    expected = stats.rice.cdf(r, away) if away < 100.0 else normal
    assert radius_probability(sd * r, axes)[0] == pytest.approx(expected, abs=1e-6)


def test_an_oblique_one_far_away_has_a_normal_radius():
    """Along the line of sight; across it, curvature adds its part to the mean."""
    line, away = np.radians(65.0), 1e4
    axes = axes_of(away * np.array([np.cos(line), np.sin(line)]), 10.0, 5.0)
    along, across = (
        np.hypot(10.0 * f(line), 5.0 * g(line)) for f, g in ((np.cos, np.sin), (np.sin, np.cos))
    )
    t = np.linspace(-3.0, 3.0, 13)
    found = radius_probability(away + across**2 / (2.0 * away) + along * t, axes)[0]
    assert found == pytest.approx(stats.norm.cdf(t), abs=1e-3)


def test_a_line_has_a_folded_normal_radius():
    axes = axes_of((50.0, 0.0), 40.0, 1e-3)
    r = np.linspace(0.5, 200.0, 50)
    assert radius_probability(r, axes)[0] == pytest.approx(
        stats.foldnorm.cdf(r, 50.0 / 40.0, scale=40.0), abs=1e-6
    )


def test_an_ellipse_seen_from_beside_has_the_radius_of_its_points():
    """Speed before own ship turns: known across the line of sight, unknown along it."""
    axes = axes_of((0.0, 12.0), 11.0, 0.5)
    points = np.random.default_rng(5).standard_normal((400_000, 2)) * [11.0, 0.5] + [0.0, 12.0]
    r = np.array([11.0, 11.8, 12.0, 12.5, 14.0, 18.0, 30.0])
    heard = np.mean(np.hypot(*points.T)[:, None] <= r, axis=0)
    # One in 1e6: 5 standard errors of 0.0008.
    assert radius_probability(r, axes)[0] == pytest.approx(heard, abs=4e-3)


@pytest.mark.parametrize(
    ("mean", "long", "short", "turn"),
    [
        ((0.0, 0.0), 10.0, 10.0, 0.0),
        ((0.0, 0.0), 100.0, 5.0, 0.4),
        ((30.0, 10.0), 20.0, 8.0, 2.0),
        ((4_000.0, 3_000.0), 600.0, 12.0, 0.7),
    ],
)
def test_density_of_the_angle_is_the_integral_over_the_radius(mean, long, short, turn):
    axes = axes_of(mean, long, short, turn)
    cov_axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    normal = stats.multivariate_normal(mean, cov_axes @ np.diag([long**2, short**2]) @ cov_axes.T)
    middle, width = np.arctan2(mean[1], mean[0]), min(0.5, 2.0 * short / max(np.hypot(*mean), 1.0))
    reach = np.hypot(*mean) + 9.0 * long
    for angle in middle + width * np.linspace(-1.0, 1.0, 5):
        u = np.array([np.cos(angle), np.sin(angle)])
        r = np.linspace(0.0, reach, 40_001)
        expected = integrate.simpson(r * normal.pdf(r[:, None] * u), x=r)
        assert angle_density(np.array([angle]), axes)[0, 0] == pytest.approx(expected, rel=1e-6)


def test_angles_density_holds_one_and_repeats_every_turn():
    axes = axes_of((3.0, -4.0), 6.0, 2.0, 1.1)
    grid = np.linspace(0.0, 2.0 * np.pi, 2_001)
    density = angle_density(grid, axes)[0]
    assert integrate.trapezoid(density, grid) == pytest.approx(1.0, abs=1e-9)
    assert angle_density(grid + 2.0 * np.pi, axes)[0] == pytest.approx(density)


def test_points_of_the_rule_have_a_standard_normals_moments():
    points, w = quadrature()
    assert w.sum() == pytest.approx(1.0)
    assert w @ points == pytest.approx([0.0, 0.0], abs=1e-12)
    assert points.T @ (w[:, None] * points) == pytest.approx(np.eye(2), abs=1e-12)
    assert w @ points**4 == pytest.approx([3.0, 3.0])


def test_scattered_points_leave_no_gap_along_either_axis():
    gaps = np.diff(np.sort(scattered(96), axis=0), axis=0)
    assert gaps.max() < 4.0 * 12.0 / 96.0


def test_points_lie_along_the_axes():
    x, y = spots(axes_of((3.0, 0.0), 5.0, 2.0), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, -2.0]]))
    assert x[0] == pytest.approx([3.0, 8.0, 3.0])
    assert y[0] == pytest.approx([0.0, 0.0, -4.0])
