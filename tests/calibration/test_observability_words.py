"""What is said of terms that trade, from a covariance written by hand."""

import numpy as np
import pytest

from boresight.calibration.observability import observability

RANGING = ("range_bias_m", "range_gain_m_per_km")


def judged(terms, sd, correlation, estimate, *, told=1e12):
    """Three targets that tell everything but leave this covariance."""
    information = np.stack([told * np.eye(len(terms))] * 3)
    cov = np.array(correlation) * np.outer(sd, sd)
    return observability(terms, information, np.full(3, 10.0), cov, np.array(estimate))


def test_bias_and_gain_are_known_together_at_the_range_where_plots_are():
    found = judged(RANGING, [100.0, 1.0], [[1.0, -0.99], [-0.99, 1.0]], [50.0, 0.4])
    (direction,) = found.directions
    assert found.observable.all()
    assert direction.observable
    assert direction.correlation == pytest.approx(-0.99)
    # One unit of the first goes with -0.99 sd of the second.
    assert direction.weights == pytest.approx({"range_bias_m": 100.0, "range_gain_m_per_km": -0.99})
    # At 99 km: 50 + 99 * 0.4 = 89.6 m, known to 100 sqrt(1 - 0.99²) = 14 m.
    assert "correlation -0.99" in direction.words
    assert "is known to 100 m, and would be to 14 m" in direction.words
    assert "the range error at 99 km: 90 ± 14 m" in direction.words


def test_terms_that_trade_evenly_are_told_by_their_difference():
    terms = ("azimuth_bias_deg", "time_bias_s")
    found = judged(terms, [0.1, 0.2], [[1.0, 0.94], [0.94, 1.0]], [0.5, 0.4])
    (direction,) = found.directions
    # 0.5 - 0.47 * 0.4 = 0.312, known to 0.1 sqrt(1 - 0.94²) = 0.034.
    assert "azimuth bias - 0.47 × time bias: 0.312 ± 0.034°" in direction.words


@pytest.mark.parametrize(("correlation", "hard"), [(0.85, False), (0.88, True)])
def test_hardly_separable_is_what_keeps_less_than_a_quarter(correlation, hard):
    terms = ("azimuth_bias_deg", "time_bias_s")
    matrix = [[1.0, correlation], [correlation, 1.0]]  # 1 - 0.866² is a quarter
    assert bool(judged(terms, [0.1, 0.2], matrix, [0.5, 0.4]).directions) is hard


@pytest.mark.parametrize(("correlation", "hard"), [(-0.97, False), (-0.985, True)])
def test_bias_and_gain_may_keep_a_twenty_fifth(correlation, hard):
    matrix = [[1.0, correlation], [correlation, 1.0]]  # 1 - 0.9798² is a twenty-fifth
    assert bool(judged(RANGING, [100.0, 1.0], matrix, [5.0, 0.4]).directions) is hard


def test_a_target_counts_as_thirty_pairs_however_often_it_was_seen():
    """What thirty pairs of one target would not tell, its thousand pairs do not either."""
    terms, cov = ("azimuth_bias_deg",), np.array([[1e-6]])
    few = 30.0 / 25.0  # prior over posterior variance that thirty pairs give, of 5 degrees
    information = np.array([[[(few * 24.0 - 1.0) / 25.0]]])  # of all pairs of the one target
    assert observability(terms, information, np.array([30.0]), cov, np.zeros(1)).observable[0]
    seen_often = observability(terms, information, np.array([1_000.0]), cov, np.zeros(1))
    assert not seen_often.observable[0]
    (direction,) = seen_often.directions
    assert not direction.observable
    assert [*direction.weights] == list(terms)
