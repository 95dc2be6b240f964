"""What the air alone makes of range: a line fitted to its delay, worked out apart."""

from dataclasses import replace

import numpy as np
import pytest
from turning_radar import record

from boresight.calibration.air import air_gain_m_per_km
from boresight.calibration.pairs import Pairs
from boresight.maths.frames import Site

SITE = Site(latitude_deg=41.3, longitude_deg=2.1, height_m=0.0)


def level_flight(range_m, height_m):
    """Pairs over a flat Earth on which the height is that of a sphere, at every azimuth."""
    m = len(range_m)
    rise = (height_m**2 - range_m**2) / (2 * 6_371_000.0) + height_m
    ground, angle = np.sqrt(range_m**2 - rise**2), np.linspace(0.0, 6.0, m)
    position = np.stack([ground * np.cos(angle), ground * np.sin(angle), rise], axis=1)
    return Pairs(
        time_s=np.arange(m, dtype=float),
        target=np.arange(m),
        names=tuple(map(str, range(m))),
        channels=("range_m",),
        z=range_m[:, None],
        position=position,
        velocity=np.zeros((m, 3)),
        height_m=np.broadcast_to(height_m, m),
        accuracy_m=np.full(m, np.nan),
        row=np.arange(m),
    )


def delay_by_steps(range_m, height_m):
    """Integral of the refractivity along a straight ray from the sea, in 20,000 steps."""
    earth = 6_371_000.0
    sine = (height_m + (height_m**2 - range_m**2) / (2 * earth)) / range_m
    s = (np.arange(20_000) + 0.5) / 20_000 * range_m
    height = np.sqrt(earth**2 + s**2 + 2 * earth * s * sine) - earth
    return np.mean(315e-6 * np.exp(-height / 7_350.0)) * range_m


def test_it_is_the_slope_of_the_delay_over_range():
    range_m, height = np.linspace(15e3, 60e3, 60), 9_000.0
    delay = [delay_by_steps(r, height) for r in range_m]
    slope, _ = np.polyfit(range_m / 1e3, delay, 1)
    found = air_gain_m_per_km(level_flight(range_m, height), SITE)
    assert found == pytest.approx(slope, rel=2e-3)  # its ray is not bent upward


@pytest.mark.parametrize("up_m", [1_000.0, 3_000.0])
def test_a_radar_and_its_targets_higher_up_have_thinner_air(up_m):
    """Refractivity falls by e in 7,350 m; that the Earth is larger up there does not matter."""
    range_m, height = np.linspace(15e3, 60e3, 60), 5_000.0
    low = level_flight(range_m, height)
    high = replace(low, height_m=low.height_m + up_m)
    found = air_gain_m_per_km(high, replace(SITE, height_m=up_m))
    assert found == pytest.approx(air_gain_m_per_km(low, SITE) * np.exp(-up_m / 7_350.0), rel=2e-3)


def test_many_pairs_give_what_a_part_of_them_gives():
    pairs = record(1, targets=100, turns=400).pairs
    few = pairs.take(np.arange(15_000))
    assert len(pairs) == 40_000
    # Another part of the same flights: the gain of the air varies little among them.
    assert air_gain_m_per_km(pairs, SITE) == pytest.approx(air_gain_m_per_km(few, SITE), rel=0.01)


def test_a_ring_or_too_few_pairs_have_no_slope():
    assert np.isnan(air_gain_m_per_km(level_flight(np.full(50, 80e3), 9_000.0), SITE))
    assert np.isnan(air_gain_m_per_km(level_flight(np.array([80e3]), 9_000.0), SITE))
    assert np.isnan(air_gain_m_per_km(level_flight(np.zeros(0), 9_000.0), SITE))
