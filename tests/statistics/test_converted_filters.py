"""Converted-measurement filters in bordonaro's scenarios: acceptance 4, 5 and 6.

10,000 runs, fixed seeds, all starts by the filter's own conversion of the first plot. Standard
errors at scan 100, 10 degrees, static: 0.6 % of a root mean square error, 2 of a bias, 0.011 of the
ANEES. A filter on a limit would fail half the time; each lies at least two standard errors inside,
and the seed is fixed, so the false-alarm rate of a rerun is nil.
"""

import numpy as np
import pytest

from oracles import bordonaro
from oracles.bordonaro import anees, errors, rmse, tracked

FIRST, LAST = 0, 99


def late(world, name, **settings):
    return rmse(world, tracked(world, name, **settings))[LAST]


def test_static_ducm_is_nearest_and_unbiased():
    world = bordonaro.static(10.0)
    ducm = tracked(world, "ducm")
    assert rmse(world, ducm)[LAST] <= 0.55 * late(world, "ucm")
    assert rmse(world, ducm)[LAST] <= 0.86 * late(world, "mucm")
    assert abs(errors(world, ducm)[:, LAST, 0].mean()) <= 5.0


def test_static_ducm_knows_its_errors():
    world = bordonaro.static(10.0)
    consistency = anees(world, tracked(world, "ducm"))
    assert consistency[LAST] <= 1.10
    assert consistency.max() <= 1.20
    fine = bordonaro.static(2.5)
    # 99 % of consistent filters: 2 * 10,000 degrees of freedom, 1 +- 2.576 / sqrt(10,000). At every
    # scan; estimates of one run resemble each other, so this is far less than 100 chances to fail.
    assert np.abs(anees(fine, tracked(fine, "ducm")) - 1.0).max() <= 0.0258


@pytest.mark.parametrize(("name", "least", "most"), [("ucm", 275, 295), ("mucm", -25, -5)])
def test_noise_taken_from_the_plot_biases_the_estimate(name, least, most):
    """The bias that section 2.3 is about; batch least squares has 287 and -12 in the limit."""
    world = bordonaro.static(10.0)
    found = tracked(world, name)
    assert least < errors(world, found)[:, LAST, 0].mean() < most
    assert anees(world, found)[LAST] > 2.0


def test_dynamic_ducm_is_nearest_and_knows_its_errors():
    world = bordonaro.dynamic(10.0)
    ducm = tracked(world, "ducm")
    assert rmse(world, ducm)[LAST] <= 0.76 * late(world, "ucm")
    assert rmse(world, ducm)[LAST] <= 0.87 * late(world, "mucm")
    assert anees(world, ducm)[LAST] <= 1.10


def test_velocity_of_ducm_is_worse_in_the_first_scans_and_better_at_the_end():
    """As section 3.1 says; 10,000 runs, standard errors of the ratios about 0.4 %."""
    world = bordonaro.dynamic(10.0)
    speeds = {n: rmse(world, tracked(world, n), slice(2, 4)) for n in ("ducm", "mucm", "ucm")}
    assert speeds["ducm"][9] > 1.02 * speeds["mucm"][9]
    assert speeds["ducm"][LAST] < 0.95 * speeds["mucm"][LAST]
    assert speeds["ducm"][LAST] < 0.95 * speeds["ucm"][LAST]


def test_the_covariance_as_printed_is_ten_times_too_small():
    """Errata B3 and B4, dynamic scenario: acceptance 5."""
    world = bordonaro.dynamic(10.0)
    assert anees(world, bordonaro.printed_filter(world))[LAST] > 10.0
    again = bordonaro.printed_filter(world, corrected=True)
    ours = tracked(world, "ducm")
    size = np.abs(ours.mean).max()
    np.testing.assert_allclose(again.mean, ours.mean, rtol=0, atol=1e-9 * size)


@pytest.mark.parametrize("world", [bordonaro.static, bordonaro.dynamic])
def test_scaled_output_never_feeds_back(world):
    """(31), erratum B11: what is kept is the same to the bit, whatever is told."""
    given = world(10.0)
    plain, scaled = tracked(given, "ducm"), tracked(given, "ducm", scale_output=True)
    for name in ("mean", "cov"):
        np.testing.assert_array_equal(scaled.final[name], plain.final[name])
    np.testing.assert_array_equal(scaled.cov, plain.cov)
    p, told = plain.mean[..., :2], scaled.mean[..., :2]
    r2 = np.sum(p * p, axis=-1)
    across = np.stack([-p[..., 1], p[..., 0]], axis=-1)
    spread = np.einsum("...i,...ij,...j", across, plain.cov[..., :2, :2], across) / r2**2
    np.testing.assert_allclose(told, np.exp(-spread)[..., None] * p, rtol=1e-12)


@pytest.mark.parametrize("world", [bordonaro.static, bordonaro.dynamic])
def test_scaled_output_starts_as_near_as_mucm(world):
    given = world(10.0)
    scaled = rmse(given, tracked(given, "ducm", scale_output=True))
    mucm = rmse(given, tracked(given, "mucm"))
    assert scaled[FIRST] == pytest.approx(mucm[FIRST], rel=0.01)
    assert scaled[FIRST] < rmse(given, tracked(given, "ducm"))[FIRST]


def test_the_plot_before_may_stand_for_the_prediction():
    """Unbiased as well, but the prediction knows more."""
    world = bordonaro.static(10.0)
    before = tracked(world, "ducm", conditioning="previous measurement")
    assert abs(errors(world, before)[:, LAST, 0].mean()) <= 5.0
    assert 1.03 * late(world, "ducm") < rmse(world, before)[LAST] < late(world, "mucm")
