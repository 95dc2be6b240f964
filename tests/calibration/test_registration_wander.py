"""Errors that are alike from scan to scan: their law in dense form, and a fit that knows it."""

from dataclasses import replace

import numpy as np
import pytest
from radar_worlds import SIX, TRUE, Noise, scans, wandered, world

from boresight.calibration import fit
from boresight.calibration.registration import register
from boresight.calibration.wander import Residuals, inverse, wandering

GAPS = np.array([np.inf, 1.0, 2.0, 0.5, np.inf, 1.0, 1.0, 5.0, np.inf])
WEIGHT = np.array([1.0, 2.0, 0.5, 0.0, 1.5, 1.0, 3.0, 0.7, 1.1])
VARIANCE, TIME_S = 2.0, 3.0
TARGETS, EACH, ALIKE, SLOW_M = 40, 80, 0.95, 60.0
NOISE = Noise(range_m=15.0, delay_m=30.0)


def process():
    """Covariance of what wanders, whole: targets are far apart in time."""
    t = np.cumsum(np.where(np.isinf(GAPS), 1e6, GAPS))
    return VARIANCE * np.exp(-np.abs(t[:, None] - t) / TIME_S)


def test_the_inverse_is_that_of_the_whole_covariance():
    seen = WEIGHT > 0.0
    whole = process()[np.ix_(seen, seen)] + np.diag(1.0 / WEIGHT[seen])
    values = np.random.default_rng(1).normal(size=9)
    found = inverse(WEIGHT, GAPS, VARIANCE, TIME_S)(values)
    assert np.allclose(found[seen], np.linalg.solve(whole, values[seen]), rtol=1e-12)
    assert found[~seen] == 0.0


def test_what_is_uncertain_of_the_process_is_its_conditional_variance():
    whole = np.linalg.inv(np.linalg.inv(process()) + np.diag(WEIGHT))
    own = inverse(WEIGHT, GAPS, VARIANCE, TIME_S)
    pull = np.random.default_rng(2).normal(size=9)
    assert np.allclose(own.uncertain(), np.diag(whole), rtol=1e-12)
    assert np.allclose(own.smooth(pull), whole @ pull, rtol=1e-12)


@pytest.mark.parametrize("levels", [True, False])
def test_the_loss_is_the_restricted_likelihood_of_the_whole_covariance(levels):
    """Its factor profiled, so losses of two laws differ as the dense ones do."""
    y, seen = np.random.default_rng(3).normal(size=9), WEIGHT > 0.0
    target = np.cumsum(np.isinf(GAPS))[seen]
    X = (target[:, None] == np.unique(target)).astype(float)[:, : 3 if levels else 0]

    def dense(K):
        V = K[np.ix_(seen, seen)] + np.diag(1.0 / WEIGHT[seen])
        inner = X.T @ np.linalg.solve(V, X)
        level = np.linalg.solve(inner, X.T @ np.linalg.solve(V, y[seen]))
        left = y[seen] - X @ level
        count = seen.sum() - X.shape[1]
        square = left @ np.linalg.solve(V, left)
        logs = np.linalg.slogdet(V)[1] + np.linalg.slogdet(inner)[1]
        return count * np.log(square / count) + logs

    residuals = Residuals(y, WEIGHT, GAPS, levels)
    gain = residuals.loss(VARIANCE, TIME_S)[0] - residuals.loss(0.0, 1.0)[0]
    assert gain == pytest.approx(dense(process()) - dense(0.0 * process()), rel=1e-9)


def residuals(seed, slow_m, noise_m=15.0):
    rng = np.random.default_rng(seed)
    left = wandered(rng, TARGETS, EACH, slow_m, ALIKE) + noise_m * rng.normal(size=TARGETS * EACH)
    gaps = np.tile(np.r_[np.inf, np.full(EACH - 1, 8.0)], TARGETS)
    return Residuals(left, np.full(len(left), 1.0 / noise_m**2), gaps, levels=True)


def test_a_planted_law_is_found():
    """4 standard errors: 40 flights of 640 s hold about 80 independent values of the process."""
    found = [wandering(residuals(seed, SLOW_M)) for seed in range(4)]
    for variance, time_s in found:
        assert np.sqrt(variance) == pytest.approx(SLOW_M, rel=0.4)
        slope = variance / time_s  # what is told best: how fast it wanders away
        assert slope == pytest.approx(SLOW_M**2 / (-8.0 / np.log(ALIKE)), rel=0.25)


def test_single_plots_noise_does_not_wander():
    """Twice the gain in log likelihood of two numbers: 1 in 400, so 2 of 100 once in 40 runs."""
    assert sum(wandering(residuals(seed, 0.0))[0] > 0.0 for seed in range(100)) <= 1


def planted(seed):
    return wandered(np.random.default_rng([seed, 1]), TARGETS, EACH, SLOW_M, ALIKE)


def wandering_world(seed):
    place, when = scans(np.random.default_rng(5), TARGETS, EACH)
    pairs, truth = world(seed, place=place, noise=NOISE)
    slow = planted(seed)
    return replace(pairs, time_s=when, z=pairs.z + np.column_stack([slow, 0.0 * slow])), truth


def errors(runs):
    """(errors, covered) of (runs, 6): no run is left out."""
    truth = np.array([TRUE[term] for term in SIX])
    terms = [[*register(wandering_world(seed)[0], SIX).terms.values()] for seed in range(runs)]
    error = np.array([[term.estimate for term in row] for row in terms]) - truth
    return error, np.array(
        [[t.ci95[0] <= x <= t.ci95[1] for t, x in zip(row, truth, strict=True)] for row in terms]
    )


def test_errors_that_wander_are_told_and_are_no_outliers():
    pairs, _ = wandering_world(3)
    found = register(pairs, SIX)
    slow = planted(3).reshape(TARGETS, EACH)
    about_level = (slow - slow.mean(1, keepdims=True)).std()
    assert found.noise.outlier_share < 0.005
    assert found.noise.range_m == pytest.approx(np.hypot(15.0, about_level), rel=0.15)
    assert found.noise.residual_range_m == pytest.approx(np.hypot(15.0, np.hypot(60, 30)), rel=0.2)
    assert found.noise.residual_azimuth_deg == pytest.approx(NOISE.azimuth_deg, rel=0.05)
    assert found.noise.laws["range_m"].sd == pytest.approx(np.hypot(15.0, SLOW_M), rel=0.3)
    (remark,) = [remark for remark in found.remarks if "wander" in remark]
    assert remark.startswith("Errors of range")


def test_a_fit_that_knows_of_wandering_knows_the_time_better(monkeypatch):
    pairs, _ = wandering_world(3)
    knowing = register(pairs, SIX).terms["time_bias_s"]
    monkeypatch.setattr(fit, "_ROUNDS", 0)
    unknowing = register(pairs, SIX).terms["time_bias_s"]
    assert knowing.sd < 0.6 * unknowing.sd
    # every pair by itself errs as much as before
    assert knowing.independent_sd == pytest.approx(unknowing.independent_sd, rel=0.3)
    assert abs(knowing.estimate - TRUE["time_bias_s"]) < 3.5 * knowing.sd


@pytest.mark.slow
def test_where_errors_wander_spreads_are_smaller_and_intervals_cover(monkeypatch):
    """300 runs: the standard error of a coverage is 1.3 %, of a ratio of spreads 4 to 6 %."""
    knowing, covered = errors(300)
    monkeypatch.setattr(fit, "_ROUNDS", 0)
    unknowing, _ = errors(300)
    ratio = knowing.std(0) / unknowing.std(0)
    assert (covered.mean(0) > 0.91).all(), covered.mean(0)
    assert (covered.mean(0) < 0.985).all(), covered.mean(0)
    touched = [SIX.index(term) for term in SIX if not term.startswith("azimuth")]
    assert (ratio[touched] < 0.85).all(), ratio
    assert (ratio < 1.06).all(), ratio
