"""Classes of pairs by Bayes' rule, with the densities of SciPy; and noise beside a known error."""

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import multivariate_t, norm

from boresight.calibration.laws import Errors, Laws, first_laws, setting
from boresight.calibration.robust import classify, refit

LAWS = Laws(
    sd=np.array([50.0, 1e-3]),
    widest=np.array([2.0, 4.0]),
    tail_share=np.array([0.1, 0.2]),
    tail_sd=np.array([90.0, 3e-3]),
    wrong=np.array([0.02, 0.03]),
    place_m=800.0,
    late_s=1.5,
    late_sd_s=0.7,
)
EXTRA = np.array([[400.0], [4e-8]])


@pytest.fixture
def drawn():
    """Residuals (2, m), metres of a unit of each, and what a second of wrong time adds."""
    rng, m = np.random.default_rng(5), 300
    scale = np.array([[50.0], [1e-3]]) * rng.choice([0.5, 2.0, 8.0, 40.0], m)
    lever = np.stack([np.ones(m), rng.uniform(2e4, 2e5, m)])
    second = np.stack([rng.uniform(-200, 200, m), rng.uniform(-2e-3, 2e-3, m)])
    return scale * rng.normal(size=(2, m)), lever, second


def bayes(left, lever, second, channels):
    """Weighed densities (3, m) of a wrong place, a wrong time and a measurement."""
    m, k = left.shape[1], len(channels)
    narrow = LAWS.sd[channels, None] ** 2 + EXTRA[channels]
    wide = LAWS.tail_sd[channels, None] ** 2 + EXTRA[channels]
    share = LAWS.tail_share[channels, None]
    laws = (1 - share) * norm.pdf(left, scale=np.sqrt(narrow)) + share * norm.pdf(
        left, scale=np.sqrt(wide)
    )
    displaced = multivariate_t(np.zeros(k), 800.0**2 * np.eye(k), df=1.0)
    place = displaced.pdf((lever * left).T) * lever.prod(0)
    both = (1 - share) * LAWS.sd[channels, None] ** 2 + share * LAWS.tail_sd[channels, None] ** 2
    late = np.empty(m)
    for i in range(m):
        cov = np.diag((both + EXTRA[channels])[:, 0]) + 0.7**2 * np.outer(
            second[:, i], second[:, i]
        )
        off = left[:, i] - 1.5 * second[:, i]
        late[i] = np.exp(-0.5 * off @ np.linalg.solve(cov, off))
        late[i] /= np.sqrt(np.linalg.det(2.0 * np.pi * cov))
    return np.stack([0.02 * place, 0.03 * late, 0.95 * laws.prod(0)]), narrow, wide


@pytest.mark.parametrize("channels", [[0], [0, 1]])
def test_classes_are_those_of_bayes_rule(drawn, channels):
    left, lever, second = (values[channels] for values in drawn)
    density, narrow, wide = bayes(left, lever, second, channels)
    some = {
        name: getattr(LAWS, name)[channels] for name in ("sd", "widest", "tail_share", "tail_sd")
    }
    laws = Laws(**some, wrong=LAWS.wrong, place_m=800.0, late_s=1.5, late_sd_s=0.7)
    at = setting(np.ones(left.shape), EXTRA[channels], lever, second)
    found = classify(Errors(left, left**2, at), laws)
    wrong = density[:2] / density.sum(0)
    np.testing.assert_allclose(found.wrong, wrong, rtol=1e-7, atol=1e-12)
    share = laws.tail_share[:, None]
    odds = np.log(share) + norm.logpdf(left, scale=np.sqrt(wide))
    odds -= np.log(1 - share) + norm.logpdf(left, scale=np.sqrt(narrow))
    tail = expit(odds)
    np.testing.assert_allclose(found.wide, tail, rtol=1e-7)
    weight = (1 - wrong.sum(0)) * ((1 - tail) / narrow + tail / wide)
    np.testing.assert_allclose(found.weight * narrow, weight * narrow, rtol=1e-6, atol=1e-12)
    assert (found.outlier > 0.5).any()
    assert (found.outlier < 0.1).any()


def test_a_wrong_time_is_what_was_believed_and_what_the_residual_tells(drawn):
    left, lever, second = (values[:1] for values in drawn)
    laws = Laws(
        sd=LAWS.sd[:1],
        widest=LAWS.widest[:1],
        tail_share=LAWS.tail_share[:1],
        tail_sd=LAWS.tail_sd[:1],
        wrong=LAWS.wrong,
        late_s=1.5,
        late_sd_s=0.7,
    )
    at = setting(np.ones(left.shape), EXTRA[:1], lever, second)
    found = classify(Errors(left, left**2, at), laws)
    noise = 0.9 * 50.0**2 + 0.1 * 90.0**2 + 400.0
    variance = 1.0 / (1.0 / 0.7**2 + second[0] ** 2 / noise)
    np.testing.assert_allclose(found.late_var, variance, rtol=1e-9)
    mean = variance * (1.5 / 0.7**2 + second[0] * left[0] / noise)
    np.testing.assert_allclose(found.late_s, mean, rtol=1e-9)


@pytest.mark.parametrize("robust", [True, False])
def test_noise_is_found_beside_what_the_reference_errs_by(robust):
    """Plots of 50 m against references that err by 30 or 90 m and say so; 20,000 of them."""
    rng, m = np.random.default_rng(6), 20_000
    known = rng.choice([30.0, 90.0], m)
    left = (50.0 * rng.normal(size=m) + known * rng.normal(size=m))[None]
    lever, second = np.ones((1, m)), rng.uniform(-200, 200, (1, m))
    errors = Errors(left, left**2, setting(np.ones((1, m)), known[None] ** 2, lever, second))
    laws = first_laws(("range_m",), np.array([100.0]), robust=robust)
    for _ in range(300):
        laws = refit(errors, classify(errors, laws), laws)
    # Its standard deviation is 0.9 % of itself; a wide law of a twentieth may take a little of it.
    assert np.sqrt(laws.variance[0, 0]) == pytest.approx(50.0, rel=0.04)
    assert laws.outlier_share < 0.003
