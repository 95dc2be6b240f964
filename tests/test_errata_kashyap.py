"""Errata K1 to K5, K10, K11, K13: what kashyap prints fails, what the package does passes.

Monte Carlo figures carry their standard error; a difference counts from five of them.
"""

import numpy as np
import pytest

from boresight.experiments.montecarlo import filtered
from boresight.experiments.scenario import lookup
from boresight.experiments.simulate import simulate
from boresight.filters import mekf
from boresight.filters.recursion import Recursion, run_recursion
from boresight.filters.steps import Updating
from boresight.maths import Gaussian, gradient
from boresight.models.conversions import convert
from boresight.models.motion import ConstantVelocity, Static
from boresight.models.polar import Given
from boresight.models.sensors import Radar
from oracles import printed, printed_conversions, quadrature, textbook

RANGE, AZIMUTH, ELEVATION = 0, 1, 2
NOISE = 0.1  # rad, of both angles
RADAR = Radar(range_m=1.0, azimuth_deg=np.degrees(NOISE), elevation_deg=np.degrees(NOISE))
DISTANCE = 1000.0


def components(position):
    return dict(zip(RADAR.names, RADAR.components(Static(dims=len(position))), strict=True))


def central_difference(f, x, step=1e-4):
    steps = step * np.eye(len(x))
    return np.array([(f(x + e) - f(x - e)) / (2 * step) for e in steps])


def polar(p):
    ground = np.hypot(p[..., 0], p[..., 1])
    r = np.hypot(ground, p[..., 2])
    return np.stack([r, np.arctan2(p[..., 1], p[..., 0]), np.arctan2(p[..., 2], ground)], axis=-1)


def tangent(elevation, sd_m, draws, seed):
    """A predicted point, truths around it across the line of sight, and plots of these."""
    generator = np.random.default_rng(seed)
    point = DISTANCE * np.array([np.cos(elevation), 0.0, np.sin(elevation)])
    across = np.array([[0.0, 1.0, 0.0], [-np.sin(elevation), 0.0, np.cos(elevation)]])
    truth = point + sd_m * generator.standard_normal((draws, 2)) @ across
    z = polar(truth) + generator.standard_normal((draws, 3)) * [0.0, NOISE, NOISE]
    cov = sd_m**2 * across.T @ across
    return point, cov, z


def ours(update, point, cov, z, outputs=("innovation",), **settings):
    method = Updating(formula=update, settings=tuple(sorted(settings.items())))
    recursion = Recursion(method, Static(dims=3), RADAR)
    return run_recursion(recursion, z[:, None], 0.0, Gaussian(point, cov), outputs=outputs)


def mean_and_error(values):
    return np.mean(values), np.std(values) / np.sqrt(len(values))


def test_k1_gradient_of_the_elevation():
    p = np.array([120.0, -80.0, 95.0])
    numeric = central_difference(lambda x: polar(x)[ELEVATION], p)
    _, row = gradient(components(p)["elevation_rad"].value, p)
    assert np.allclose(row, numeric, atol=1e-9)
    wrong = printed.elevation_row(p)
    assert np.allclose(wrong[:2], numeric[:2], atol=1e-9)
    assert abs(wrong[2] - numeric[2]) > 1e-5


def test_k2_as_printed_the_range_residual_diverges_at_once():
    world = lookup("kashyap-set-2")
    truth, plots = simulate(world, runs=20, seed=2)
    sigmas = [30.0, np.radians(1.5), np.radians(1.5)]
    start = plots.prior.mean, np.broadcast_to(plots.prior.cov, (20, 6, 6))
    with np.errstate(all="ignore"):
        wrong = printed.kashyap_filter(
            *start, plots.z, sigmas, world.dt_s, 0.25, printed_residual=True
        )
    right = filtered("mekf", world.motion, world.sensor, plots).mean

    def worst(means):
        distance = np.linalg.norm((means - truth.states)[:, 20:, :3], axis=-1)
        return np.max(np.where(np.isfinite(distance), distance, np.inf), axis=1)

    assert np.all(worst(right) < 1000.0)
    assert np.all(worst(wrong) > 1e5)


def test_k3_mean_of_the_correction_needs_the_elevation():
    """r = 1000 m, elevation 0.8 rad, 100 m across both ways: the range is 10 m longer than r."""
    point, cov, z = tangent(0.8, 100.0, 400_000, seed=3)
    right, error = mean_and_error(ours(mekf.update_block, point, cov, z).innovation[:, 0, RANGE])
    true = np.mean(z[:, RANGE]) - DISTANCE
    differences = (z - polar(point))[:, AZIMUTH], (z - polar(point))[:, ELEVATION]
    wrong = np.mean(printed.range_correction(DISTANCE, *differences, NOISE, NOISE))
    assert true == pytest.approx(9.91, abs=0.1)  # second order alone gives 10
    assert abs(right) < 0.2 + 5 * error  # fourth order is left
    assert wrong - true > 5.0


def test_k3_variance_of_the_correction_needs_the_elevation():
    """For a prior much narrower than the angles' noise."""
    point, cov, z = tangent(0.8, 1.0, 400_000, seed=4)
    z[:, RANGE] += np.random.default_rng(5).standard_normal(len(z))
    found = ours(mekf.update_block, point, cov, z, ("innovation", "variance"))
    true = np.var(found.innovation[:, 0, RANGE])
    error = np.std((found.innovation[:, 0, RANGE]) ** 2) / np.sqrt(len(z))
    claimed = found.variance[0, 0, RANGE]
    wrong = printed.range_variance(DISTANCE, 1.0, NOISE, NOISE)
    # The prior, though narrow, adds r² (cos⁴el sa² P_az + se² P_el): 2 % here.
    assert abs(claimed - true) < 0.03 * true + 5 * error
    assert wrong > 1.4 * true


@pytest.mark.parametrize(("variance", "tolerance_m"), [(9e-4, 0.02), (1e-2, 0.15)])
def test_k4_correction_belongs_to_the_point_it_was_derived_for(variance, tolerance_m):
    """Mean range residual at elevation 0; fourth order is left, hence the tolerance."""
    sd_m = DISTANCE * np.sqrt(variance)
    point, cov, z = tangent(0.0, sd_m, 400_000, seed=6)
    bias = {}
    for mu in ("printed", "predicted", "second order", "none"):
        values = ours(mekf.update, point, cov, z, mu=mu).innovation[:, 0, RANGE]
        bias[mu], error = mean_and_error(values)
        assert error < 0.04
    sigmas = (1.0, NOISE, NOISE)
    start = np.broadcast_to(point, (len(z), 3)), np.broadcast_to(cov, (len(z), 3, 3))
    wrong = printed.kashyap_sequence(*start, z, sigmas)[2]
    share = variance / (variance + NOISE**2)
    left_by_angles = DISTANCE * share * NOISE**2  # r (P+_az + P+_el) / 2
    assert np.mean(wrong) == pytest.approx(2 * left_by_angles, rel=0.05)
    assert bias["none"] == pytest.approx(left_by_angles, rel=0.05)
    assert bias["printed"] > 1.9 * bias["none"]  # the wrong sign: twice the bias of no correction
    assert abs(bias["predicted"]) < tolerance_m + 5 * 0.04
    assert abs(bias["second order"]) < tolerance_m + 5 * 0.04


def test_k4_printed_reading_is_kept_and_equals_the_paper_at_elevation_zero():
    point, cov, z = tangent(0.0, 30.0, 200, seed=7)
    start = np.broadcast_to(point, (len(z), 3)), np.broadcast_to(cov, (len(z), 3, 3))
    paper = printed.kashyap_sequence(*start, z, (1.0, NOISE, NOISE), printed_weights=False)[2]
    residual = ours(mekf.update, point, cov, z, mu="printed").innovation[:, 0, RANGE]
    assert np.allclose(residual, paper, atol=1e-6)


@pytest.mark.parametrize("mu", ["printed", "predicted", "second order", "none"])
def test_k4_every_reading_is_the_extended_filter_where_nothing_curves(mu):
    """Decimetres at a kilometre, range and angles correlated before the plot."""
    generator = np.random.default_rng(8)
    A = 0.1 * generator.standard_normal((3, 3))
    cov, mean = A @ A.T, np.array([600.0, -500.0, 620.0])
    sigmas = np.array([0.1, 1e-4, 1e-4])
    z = textbook.polar(mean) + 2 * sigmas * generator.standard_normal(3)
    expected, expected_cov = textbook.extended_update(mean, cov, z, np.diag(sigmas**2))
    radar = Radar(range_m=0.1, azimuth_deg=np.degrees(1e-4), elevation_deg=np.degrees(1e-4))
    method = Updating(formula=mekf.update, settings=(("mu", mu),))
    recursion = Recursion(method, Static(dims=3), radar)
    found = run_recursion(recursion, z[None, None], 0.0, Gaussian(mean, cov))
    sd = np.sqrt(np.diag(expected_cov))
    assert np.max(np.abs(found.mean[0, 0] - expected) / sd) < 1e-3
    assert np.max(np.abs(found.cov[0, 0] - expected_cov) / np.outer(sd, sd)) < 1e-3


def test_k5_noise_of_the_range_fades_with_twice_the_square_of_the_angle():
    """25 degrees, 30 m at 100 m: the printed factor makes the variance a tenth too large."""
    z, sigma = [100.0, 0.6], [30.0, np.radians(25.0)]
    _, exact = quadrature.Predicted(z, sigma, sigma).debiased()
    found = convert("cmkf-d-m", z, sigma).cov[0, 0]
    assert found == pytest.approx(float(exact[0, 0]), rel=1e-12)
    assert printed_conversions.debiased_by_plot(*z, *sigma, factor=2.0) == pytest.approx(found)
    assert printed_conversions.debiased_by_plot(*z, *sigma) > 1.09 * found


def test_k13_the_bias_is_taken_off_the_converted_plot():
    truth, sigma = [1000.0, -2.1], [30.0, np.radians(15.0)]
    z, weights = quadrature.normal(truth, sigma)
    plain = convert("conventional", z, sigma).mean
    found = convert("cmkf-d-t", z, sigma, Given(truth, [0.0, 0.0])).mean
    x = quadrature.cartesian(np.array(truth))
    assert np.allclose((found @ weights).astype(float), x, rtol=1e-12)
    added = plain + (plain - found)  # the other sign
    assert np.linalg.norm((added @ weights).astype(float) - x) > 60.0


def test_k10_unwrapped_differences_hurt_exactly_the_runs_that_cross_south():
    world = lookup("kashyap-set-2")
    runs = 300  # some 8 of which cross; none would once in 3,000 seeds
    truth, plots = simulate(world, runs=runs, seed=10)
    sigmas = [30.0, np.radians(1.5), np.radians(1.5)]
    start = plots.prior.mean, np.broadcast_to(plots.prior.cov, (runs, 6, 6))
    filters = {
        wrapped: printed.kashyap_filter(
            *start, plots.z, sigmas, world.dt_s, 0.25, wrapped=wrapped, printed_weights=False
        )
        for wrapped in (True, False)
    }
    error = {
        wrapped: np.sqrt(np.mean(np.sum((f - truth.states)[..., :3] ** 2, axis=-1), axis=1))
        for wrapped, f in filters.items()
    }
    package = filtered("mekf", world.motion, world.sensor, plots, settings={"mu": "printed"})
    assert np.allclose(package.mean, filters[True], rtol=1e-6, atol=1e-3)
    jumps = np.abs(np.diff(plots.z[..., AZIMUTH], axis=1)).max(axis=1) > np.pi
    hurt = np.any(filters[True] != filters[False], axis=(1, 2))
    assert hurt.any()
    assert np.all(jumps[hurt])  # a plot may also jump together with its prediction
    assert np.all(error[False][hurt] > 1.2 * error[True][hurt])
    assert np.sum(jumps & ~hurt) < np.sum(hurt)


def test_k11_azimuth_takes_its_quadrant_from_both_coordinates():
    for azimuth in np.radians([-170.0, -100.0, 100.0, 170.0]):
        p = np.array([100 * np.cos(azimuth), 100 * np.sin(azimuth), 10.0])
        assert components(p)["azimuth_rad"].value(p) == pytest.approx(azimuth, abs=1e-12)
        assert abs(np.arctan(p[1] / p[0]) - azimuth) == pytest.approx(np.pi)


def test_printed_gain_of_six_noises_is_another_model():
    """K7: with the 6 x 6 G of section 3 positions and velocities are pushed apart."""
    right = ConstantVelocity(accel_mps2=0.5).noise(1.0)
    G = np.diag([0.5, 0.5, 0.5, 1.0, 1.0, 1.0])
    as_printed = ConstantVelocity(accel_mps2=0.5, discretisation="printed").noise(1.0)
    assert np.allclose(as_printed, 0.25 * G @ G)
    assert np.linalg.matrix_rank(right) == 3
    assert np.linalg.matrix_rank(as_printed) == 6
