"""Is a registration as good as the Cramér-Rao bound, and do its intervals cover what they say?

The bound is taken from the worlds' own formula by differences, not from the estimator's design.
"""

import numpy as np
import pytest
from radar_worlds import SIX, TRUE, Noise, flights, measured, world

from boresight.calibration.registration import register

STEPS = np.array([1.0, 0.01, 1e-3, 1e-3, 1e-3, 0.01])
TRUTH = np.array([TRUE[term] for term in SIX])


def bound(place, noise):
    """(6,) standard deviations of the Cramér-Rao bound for plots at these places."""

    def plots(terms):
        quiet = Noise(range_m=0.0, azimuth_deg=0.0)
        true = dict(zip(SIX, terms, strict=True))
        r, azimuth, _ = measured(np.random.default_rng(0), true, *place, quiet)
        return np.concatenate([r / noise.range_m, azimuth / noise.azimuth_deg])

    pairs = zip(STEPS, np.diag(STEPS), strict=True)
    J = np.stack([(plots(TRUTH + d) - plots(TRUTH - d)) / (2.0 * h) for h, d in pairs], axis=1)
    return np.sqrt(np.diag(np.linalg.inv(J.T @ J)))


def repeated(runs, place, noise, seed):
    """(errors, covered, covered by the naive interval), each (runs, 6): no run is left out."""
    errors, covered, naive = [], [], []
    for run in range(runs):
        pairs, _ = world(seed + run, place=place, noise=noise)
        terms = [*register(pairs, SIX).terms.values()]
        error = np.array([term.estimate for term in terms]) - TRUTH
        alone = np.array([term.independent_sd for term in terms])
        errors.append(error)
        naive.append(np.abs(error) <= 1.96 * alone)
        covered.append([t.ci95[0] <= x <= t.ci95[1] for t, x in zip(terms, TRUTH, strict=True)])
    return np.array(errors), np.array(covered), np.array(naive)


def test_a_few_registrations_are_near_the_bound():
    """Bands of 3.3 standard errors at 40 runs: a false alarm in a hundred, of twelve figures."""
    noise, place = Noise(), flights(np.random.default_rng(7), 1_000, 60)
    errors, covered, _ = repeated(40, place, noise, seed=3_000)
    ratio = np.sqrt((errors**2).mean(0)) / bound(place, noise)
    assert (ratio > 0.63).all()
    assert (ratio < 1.42).all()
    assert (covered.mean(0) > 0.82).all()


def test_the_naive_interval_fails_where_transponders_differ():
    """40 aircraft and 30 m; at 25 runs naive coverage of 50 % passes 80 % once in 500."""
    noise = Noise(delay_m=30.0)
    place = flights(np.random.default_rng(7), 2_000, 40)
    _, covered, naive = repeated(25, place, noise, seed=5_000)
    assert (covered.mean(0) > 0.75).all()
    assert naive[:, 0].mean() < 0.8


@pytest.mark.slow
def test_six_parameters_meet_the_bound():
    """1,000 runs of 10,000 pairs: the standard error of a ratio is 2.2 %, of coverage 0.7 %."""
    noise, place = Noise(), flights(np.random.default_rng(7), 10_000, 200)
    errors, covered, _ = repeated(1_000, place, noise, seed=1_000)
    ratio = errors.std(0) / bound(place, noise)
    assert (ratio > 0.95).all(), ratio
    assert (ratio < 1.06).all(), ratio
    assert (np.abs(covered.mean(0) - 0.95) < 0.018).all(), covered.mean(0)


@pytest.mark.slow
def test_intervals_of_forty_aircraft_with_delays_cover():
    noise, place = Noise(delay_m=30.0), flights(np.random.default_rng(7), 10_000, 40)
    _, covered, naive = repeated(1_000, place, noise, seed=1_000)
    assert (covered.mean(0) > 0.92).all(), covered.mean(0)
    assert (covered.mean(0) < 0.975).all(), covered.mean(0)
    assert naive[:, 0].mean() < 0.8


@pytest.mark.slow
@pytest.mark.parametrize("range_m", [30.0, 70.0])
def test_wrong_references_cost_at_most_a_third(range_m):
    """100 runs each: the standard error of one ratio is a tenth, so their mean is held."""
    noise = {"range_m": range_m, "azimuth_tail": (0.15, 3.0)}
    place = flights(np.random.default_rng(20), 10_000, 100)
    clean, _, _ = repeated(100, place, Noise(**noise), seed=7_000)
    spoilt, _, _ = repeated(100, place, Noise(**noise, wrong_share=0.2), seed=7_000)
    assert np.mean(spoilt.std(0) / clean.std(0)) < 1.3
