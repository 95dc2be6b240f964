"""Registration of synthetic radars whose errors are known, and laws that any of them must keep."""

from dataclasses import fields, replace

import numpy as np
import pytest
from radar_worlds import SIX, TRUE, Noise, flights, world

from boresight.calibration.registration import register
from boresight.errors import DataError, UsageError

FINE = Noise(range_m=0.01, azimuth_deg=1e-6)
ROUGH = Noise(azimuth_tail=(0.15, 3.0), delay_m=30.0)


@pytest.fixture(scope="module")
def rough():
    made, _ = world(11, pairs=3_000, targets=30, noise=replace(ROUGH, wrong_share=0.1))
    return made, register(made, SIX)


def estimates(found):
    return np.array([term.estimate for term in found.terms.values()])


def apart(one, other):
    """Largest difference of two registrations' terms in standard deviations."""
    sd = np.array([term.sd for term in one.terms.values()])
    return float(np.abs((estimates(one) - estimates(other)) / sd).max())


@pytest.mark.parametrize("robust", [True, False])
def test_plots_of_a_fine_radar_give_its_errors_back(robust):
    """Far beyond first order: 30 m of moving and 50 m of offset are fitted where they lead to."""
    true = TRUE | {"site_east_m": 40.0, "site_north_m": -30.0}
    pairs, _ = world(1, pairs=2_000, targets=30, true=true, noise=FINE)
    found = register(pairs, tuple(true), robust=robust)
    for term, value in true.items():
        assert abs(found.terms[term].estimate - value) < 1e-4 * abs(value), term


def test_without_tails_and_delays_it_is_weighted_least_squares():
    pairs, _ = world(2, pairs=2_000, targets=25)
    found = register(pairs, SIX, robust=False, delays=False)
    laws = found.noise.laws
    sd = np.array([laws["range_m"].sd, np.radians(laws["azimuth_deg"].sd)])
    X = (pairs.design(SIX) / sd[:, None]).reshape(-1, len(SIX))
    oracle, _, _, _ = np.linalg.lstsq(X, (pairs.residuals() / sd).ravel())
    # the time bias of 30 m is of first order in the oracle: a hundredth of a standard deviation
    alone = np.array([term.independent_sd for term in found.terms.values()])
    assert np.abs((estimates(found) - oracle) / alone).max() < 0.02
    assert np.allclose(alone, np.sqrt(np.diag(np.linalg.inv(X.T @ X))), rtol=1e-3)


def test_the_order_of_pairs_means_nothing(rough):
    pairs, found = rough
    shuffled = np.random.default_rng(4).permutation(len(pairs))
    again = register(pairs.take(shuffled), SIX)
    assert apart(found, again) < 1e-4
    assert np.allclose(again.outlier, found.outlier[shuffled], atol=1e-4)
    assert np.allclose(again.after, found.after[shuffled], rtol=1e-4, atol=1e-3)


def test_whole_turns_names_and_other_days_mean_nothing(rough):
    pairs, found = rough
    turned = pairs.z + np.array([0.0, 2.0 * np.pi])
    moved = replace(pairs, z=turned, time_s=pairs.time_s + 86_400.0)
    assert apart(found, register(moved, SIX)) < 1e-4
    renamed = replace(pairs, target=pairs.target + 5, names=("none",) * 5 + pairs.names)
    again = register(renamed, SIX)
    assert apart(found, again) == 0.0
    assert np.array_equal(again.delay_m[5:], found.delay_m)
    assert not again.delay_m[:5].any()


def test_an_error_planted_on_top_comes_back_on_top(rough):
    pairs, found = rough
    more = register(replace(pairs, z=pairs.z + np.array([200.0, np.radians(0.5)])), SIX)
    change = estimates(more) - estimates(found)
    assert abs(change[SIX.index("range_bias_m")] - 200.0) < 0.05
    assert abs(change[SIX.index("azimuth_bias_deg")] - 0.5) < 1e-4


def test_the_inputs_are_left_as_they_were(rough):
    pairs, _ = rough
    before = {f.name: np.copy(getattr(pairs, f.name)) for f in fields(pairs)}
    register(pairs, SIX)
    for name, value in before.items():
        assert np.array_equal(getattr(pairs, name), value, equal_nan=name in {"z", "accuracy_m"})


def test_delays_outliers_and_what_is_left_are_told(rough):
    pairs, found = rough
    _, truth = world(11, pairs=3_000, targets=30, noise=replace(ROUGH, wrong_share=0.1))
    # a mean over 90 plots, and what all delays share is no delay but the bias
    wrong = found.delay_m - truth["delay_m"]
    assert np.std(wrong) < 15.0
    assert np.mean((found.outlier > 0.5) == truth["wrong"]) > 0.98
    left = found.after[:, 0] - found.delay_m[pairs.target]  # delays are still in
    assert np.std(left[~truth["wrong"]]) == pytest.approx(70.0, rel=0.05)
    assert 20.0 < found.noise.target_range_m < 40.0
    tail = found.noise.laws["azimuth_deg"]
    assert tail.sd == pytest.approx(0.08, rel=0.1)
    assert tail.tail_sd == pytest.approx(0.24, rel=0.25)


def test_a_channel_that_is_missing_takes_nothing_away_from_the_other():
    pairs, _ = world(5, pairs=3_000, targets=30)
    gaps = pairs.z.copy()
    gaps[::3, 1] = np.nan
    found = register(replace(pairs, z=gaps), SIX)
    assert np.isnan(found.after[::3, 1]).all()
    assert np.isfinite(found.after[1::3]).all()
    for term in SIX:
        assert abs(found.terms[term].estimate - TRUE[term]) < 4.5 * found.terms[term].sd


def test_a_reference_that_says_it_is_poor_is_believed():
    """Half the pairs 500 m off, and saying so: as good as without them, and no outliers."""
    noise = Noise(range_m=10.0, azimuth_deg=0.02)
    pairs, _ = world(6, pairs=4_000, targets=40, noise=noise)
    poor = np.arange(4_000) % 2 == 0
    aside = 500.0 * np.random.default_rng(3).normal(size=(4_000, 3)) * [1.0, 1.0, 0.0]
    said = replace(
        pairs,
        position=pairs.position + np.where(poor[:, None], aside, 0.0),
        accuracy_m=np.where(poor, 500.0, 0.0),
    )
    found, good = register(said, SIX), register(pairs.take(~poor), SIX)
    assert found.noise.outlier_share < 0.01
    assert found.noise.laws["range_m"].sd == pytest.approx(10.0, rel=0.1)
    for term in SIX:
        assert found.terms[term].sd < 1.2 * good.terms[term].sd


@pytest.mark.parametrize("targets", [1, 2])
def test_of_one_or_two_targets_no_interval_is_given(targets):
    pairs, _ = world(7, pairs=1_000, targets=targets)
    found = register(pairs, SIX)
    assert all(term.ci95 == (-np.inf, np.inf) for term in found.terms.values())
    assert np.isnan(found.noise.target_range_m)
    assert any("target" in remark for remark in found.remarks)


def test_no_pairs_and_unknown_terms_are_refused():
    pairs, _ = world(8, pairs=50, targets=5)
    with pytest.raises(DataError, match="no pair"):
        register(pairs.take(slice(0, 0)), SIX)
    with pytest.raises(UsageError, match="range_bias_m"):
        register(pairs, ("range_bias",))


def test_the_elevation_bias_is_found_where_elevation_is_measured():
    pairs, _ = world(9, pairs=1_000, targets=20)
    up = np.arctan2(pairs.position[:, 2], np.hypot(pairs.position[:, 0], pairs.position[:, 1]))
    up += np.radians(0.3) + np.radians(0.1) * np.random.default_rng(2).normal(size=1_000)
    channels = (*pairs.channels, "elevation_rad")
    found = register(
        replace(pairs, z=np.column_stack([pairs.z, up]), channels=channels),
        (*SIX[:3], "elevation_bias_deg"),
    )
    term = found.terms["elevation_bias_deg"]
    assert abs(term.estimate - 0.3) < 4.5 * term.sd < 0.02
    assert found.noise.elevation_deg == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize("range_m", [30.0, 70.0])
def test_a_fifth_of_wrong_references_costs_little(range_m):
    """Wrong identity, 1 NM aside or 2 s late; azimuths of two normal laws."""
    noise = Noise(range_m=range_m, azimuth_tail=(0.15, 3.0))
    place = flights(np.random.default_rng(20), 10_000, 100)
    clean = register(world(21, place=place, noise=noise)[0], SIX)
    pairs, truth = world(21, place=place, noise=replace(noise, wrong_share=0.2))
    found = register(pairs, SIX)
    assert abs(found.noise.outlier_share - truth["wrong"].mean()) < 0.02
    assert clean.noise.outlier_share < 0.002
    for term in SIX:
        assert found.terms[term].independent_sd < 1.3 * clean.terms[term].independent_sd, term
        allowed = 3.5 * clean.terms[term].independent_sd  # late references would move the time by 7
        assert abs(found.terms[term].estimate - TRUE[term]) < allowed, term
