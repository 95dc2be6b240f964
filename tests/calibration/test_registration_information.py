"""What each target tells of the terms, against the covariance of all its pairs written out."""

import numpy as np
import pytest
from radar_worlds import Noise, world

from boresight.calibration.fit import fit
from boresight.calibration.wander import Residuals, wandering
from boresight.models.systematic import TERMS, design

THREE = ("range_bias_m", "range_gain_m_per_km", "azimuth_bias_deg")


@pytest.mark.parametrize("delay_m", [0.0, 60.0])
def test_the_information_of_a_target_is_that_of_its_pairs_and_their_common_delay(delay_m):
    noise = Noise(range_m=30.0, azimuth_deg=0.05, delay_m=delay_m)
    pairs, _ = world(4, pairs=400, targets=12, true={"range_bias_m": 50.0}, noise=noise)
    found = fit(pairs, THREE, robust=False, delays=True)
    sd, delay_var = found.state.laws.sd, found.state.delay_var
    assert not found.state.wander.variance.any()
    assert np.sqrt(delay_var) == pytest.approx(delay_m, abs=25.0)  # of twelve delays
    X = design(THREE, ("range_m", "azimuth_rad"), pairs.position, pairs.velocity)
    told = found.information()
    for row, target in enumerate(found.pairs.target):
        own = X[pairs.target == target]
        m = len(own)
        V = sd[0] ** 2 * np.eye(m) + delay_var
        expected = own[:, 0].T @ np.linalg.solve(V, own[:, 0])
        expected += own[:, 1].T @ own[:, 1] / sd[1] ** 2
        scale = np.sqrt(np.diag(expected) + 1e-30)
        off = (told[row] - expected) / np.outer(scale, scale)
        assert np.abs(off[:2, :2]).max() < 1e-3  # the gain is of the range that is corrected
        assert abs(off[2, 2]) < 1e-9
    prior = np.diag([TERMS[term].scale ** -2.0 for term in THREE])
    np.testing.assert_allclose(np.diag(found.prior), prior)


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_what_wanders_is_found_in_metres_whatever_the_weights_are_counted_in(factor):
    rng, targets, each, alike = np.random.default_rng(3), 20, 60, 0.9
    fresh = rng.normal(size=(targets, each)) * np.r_[1.0, np.full(each - 1, np.sqrt(1 - alike**2))]
    slow = np.zeros((targets, each))
    for i in range(each):
        slow[:, i] = (alike * slow[:, i - 1] if i else 0.0) + fresh[:, i]
    left = (60.0 * slow + 15.0 * rng.normal(size=slow.shape)).ravel()
    gaps = np.tile(np.r_[np.inf, np.full(each - 1, 8.0)], targets)
    said, other = (
        wandering(Residuals(left, np.full(left.size, weight / 15.0**2), gaps, levels=True))
        for weight in (1.0, factor)
    )
    assert other == pytest.approx(said, rel=0.02)
