"""Own-Doppler nullification in a scalar range-rate filter: acceptance 7, errata B6 and B7.

bordonaro section 4.3: 50 kHz, 150 ft/s, closing at 20 ft/s, 5 Hz, bearing uniform in 45 degrees to
either side. 10,000 runs, fixed seed; sound at 1,500 m/s is ours. At 2.5 degrees and scan 100 the
standard errors are 0.003 ft/s of a bias, 0.014 of the ANEES and 0.7 % of an error.
"""

import numpy as np
import pytest

import boresight as bs
from boresight.errors import UsageError
from boresight.maths.seeds import Stream, normals
from boresight.models.doppler import received_frequency

RUNS, SCANS, FOOT = 10_000, 100, 0.3048
SETUP = {"transmitted_hz": 50e3, "speed_mps": 150 * FOOT, "sigma_hz": 5.0}


def heard(sigma_deg, bearing_deg=None):
    """Frequencies and bearings, (runs, scans)."""
    if bearing_deg is None:
        bearing_deg = np.random.default_rng(1).uniform(-45, 45, RUNS)
    bearing = np.radians(np.broadcast_to(bearing_deg, RUNS))[:, None]
    noise = normals(1, "own doppler", Stream.NOISE, (SCANS, 2), runs=RUNS)
    closing = 20 * FOOT + SETUP["speed_mps"] * np.cos(bearing)
    received = received_frequency(closing, SETUP["transmitted_hz"], 1500.0) + 5 * noise[..., 0]
    return received, bearing + np.radians(sigma_deg) * noise[..., 1]


def judged(sigma_deg, method, bearing_deg=None, **settings):
    """Bias and root mean square error of the closing speed, ft/s, and ANEES, at scan 100."""
    found = bs.track_range_rate(
        *heard(sigma_deg, bearing_deg), **SETUP, sigma_deg=sigma_deg, method=method, **settings
    )
    error = -found.range_rate_mps[:, -1] / FOOT - 20
    consistency = np.mean(error**2 * FOOT**2 / found.variance[:, -1])
    return error.mean(), np.sqrt(np.mean(error**2)), consistency


def test_ducm_is_unbiased_consistent_and_nearer():
    bias, error, consistency = judged(2.5, "ducm")
    assert abs(bias) <= 0.01
    assert 0.95 <= consistency <= 1.05
    assert error <= 0.65 * judged(2.5, "standard")[1]
    assert error <= 0.8 * judged(2.5, "mucm")[1]


@pytest.mark.parametrize("method", ["standard", "mucm"])
def test_the_others_are_biased_and_do_not_know_it(method):
    """By more than ten times what DUCM may be; the noise of the plot is in their variances."""
    bias, _, consistency = judged(2.5, method)
    assert bias < -0.1
    assert consistency > 2.0


def test_at_small_bearings_and_large_noise_the_standard_method_is_nearer():
    """The paper's own caveat: dead ahead, 10 degrees."""
    bias, error, consistency = judged(10.0, "ducm", 0.0)
    assert abs(bias) <= 0.02
    assert error > 2.0 * judged(10.0, "standard", 0.0)[1]
    assert consistency < 0.96


def test_the_bearing_before_serves_nearly_as_well():
    bias, error, consistency = judged(2.5, "ducm", bearing="previous measurement")
    assert abs(bias) <= 0.01
    assert 1.0 < error / judged(2.5, "ducm")[1] < 1.1
    assert 1.0 < consistency < 1.2


@pytest.mark.parametrize(("drift_mps", "drift_deg"), [(0.0, 0.0), (0.4, 1.5)])
def test_one_scan_at_a_time_is_a_scalar_kalman_filter(drift_mps, drift_deg):
    """By hand: a bearing filter, DUCM's variance at its prediction (40), and a weighted mean."""
    received, bearings = (x[:3, :5] for x in heard(4.0))
    found = bs.track_range_rate(
        received, bearings, **SETUP, sigma_deg=4.0, drift_mps=drift_mps, drift_deg=drift_deg
    )
    s2, speed = np.radians(4.0) ** 2, SETUP["speed_mps"]
    closing = (received - 50e3) * 1500 / 100e3 - speed * np.cos(bearings) * np.exp(s2 / 2)
    sf2 = (5.0 * 1500 / 100e3) ** 2
    for lane in range(3):
        a, pa = bearings[lane, 0], s2
        mean, P = closing[lane, 0], found.variance[lane, 0]
        for k in range(1, 5):
            P, pa = P + drift_mps**2, pa + np.radians(drift_deg) ** 2
            c = np.cos(2 * a)
            R = sf2 + speed**2 / 2 * (
                (1 + c * np.exp(-2 * s2 - 2 * pa)) * np.exp(s2) - (1 + c * np.exp(-2 * pa))
            )
            mean, P = (mean / P + closing[lane, k] / R) / (1 / P + 1 / R), 1 / (1 / P + 1 / R)
            a, pa = (a / pa + bearings[lane, k] / s2) / (1 / pa + 1 / s2), 1 / (1 / pa + 1 / s2)
            assert found.range_rate_mps[lane, k] == pytest.approx(-mean, rel=1e-9)
            assert found.variance[lane, k] == pytest.approx(P, rel=1e-9)
            assert found.bearing_rad[lane, k] == pytest.approx(a, rel=1e-9)


def test_what_is_missing_changes_nothing_and_a_whole_turn_neither():
    received, bearings = (x[:4, :6].copy() for x in heard(2.5))
    keep = [0, 2, 3, 5]
    short = bs.track_range_rate(received[:, keep], bearings[:, keep], **SETUP, sigma_deg=2.5)
    received[:, 1], bearings[:, 4] = np.nan, np.nan
    bearings[:, 1] = np.nan
    received[:, 4] = 1e9
    bearings[:, 3] += 2 * np.pi
    long = bs.track_range_rate(received, bearings, **SETUP, sigma_deg=2.5)
    for ours, theirs in zip(long, short, strict=True):
        np.testing.assert_allclose(ours[:, keep], theirs, rtol=1e-9)
        np.testing.assert_array_equal(ours[:, [1, 4]], ours[:, [0, 3]])
    received[:] = np.nan
    assert np.isnan(bs.track_range_rate(received, bearings, **SETUP, sigma_deg=2.5)[0]).all()


def test_a_platform_that_changes_speed_is_followed():
    """Every number may change from scan to scan; the truth stays, and so does the estimate."""
    rng = np.random.default_rng(2)
    speed, bearing = rng.uniform(5, 60, (400, 50)), 0.5
    closing = 6.0 + speed * np.cos(bearing)
    received = received_frequency(closing, 50e3, 1500.0) + 5 * rng.normal(size=speed.shape)
    bearings = bearing + np.radians(2.5) * rng.normal(size=speed.shape)
    settings = SETUP | {"speed_mps": speed}
    found = bs.track_range_rate(received, bearings, **settings, sigma_deg=2.5)
    error = found.range_rate_mps[:, -1] + 6.0
    assert abs(error.mean()) < 4 * error.std() / 20
    assert np.mean(error**2 / found.variance[:, -1]) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(
    "wrong", [{"method": "dcum"}, {"bearing": "guess"}, {"bearings_rad": np.zeros((2, 4))}], ids=str
)
def test_what_means_nothing_is_refused(wrong):
    given = {"received_hz": np.ones((2, 3)), "bearings_rad": np.ones((2, 3)), "sigma_deg": 1.0}
    with pytest.raises(UsageError):
        bs.track_range_rate(**(given | SETUP | wrong))
