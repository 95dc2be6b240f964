"""The air against a ray traced step by step, and against what P.834 says in words."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from boresight.models.atmosphere import (
    EARTH_M,
    EffectiveEarth,
    ExponentialAtmosphere,
    NoAtmosphere,
)

km, cm = 1e3, 1e-2
AIR = ExponentialAtmosphere(surface_refractivity=315.0, scale_height_m=7_350.0)

# Slant range, target height, site height: from overhead to the horizon at 250 NM.
TARGETS = [
    (12 * km, 12 * km, 0.0),
    (20 * km, 0.3 * km, 0.1 * km),
    (60 * km, 9 * km, 0.2 * km),
    (110 * km, 3 * km, 0.5 * km),
    (200 * km, 11 * km, 0.0),
    (300 * km, 10 * km, 1.0 * km),
    (460 * km, 13 * km, 0.2 * km),
]


def shoot(elevation, ground, site_height):
    """Trace a ray in polar coordinates until it stands over `ground`; height and optical length."""

    def refractivity(radius):
        return 315e-6 * np.exp(-(radius - EARTH_M) / 7_350.0)

    def advance(_angle, state):
        radius, slope, _ = state  # Euler's equations, with the angle at the Earth's centre as time
        step = radius / np.cos(slope)
        gradient = -refractivity(radius) / 7_350.0 / (1 + refractivity(radius))
        turn = 1 + gradient * radius
        return [radius * np.tan(slope), turn, (1 + refractivity(radius)) * step]

    start = [EARTH_M + site_height, elevation, 0.0]
    path = solve_ivp(advance, (0, ground / EARTH_M), start, "DOP853", rtol=1e-12, atol=1e-9)
    radius, _, optical = path.y[:, -1]
    return radius - EARTH_M, optical


def traced(range_m, height, site_height):
    """Excess range and bending of the one ray that hits the target."""
    a, b = EARTH_M + site_height, EARTH_M + height
    ground = EARTH_M * np.arccos((a**2 + b**2 - range_m**2) / (2 * a * b))
    straight = np.arctan2(b * np.cos(ground / EARTH_M) - a, b * np.sin(ground / EARTH_M))
    hit = brentq(
        lambda bend: shoot(straight + bend, ground, site_height)[0] - height, 0, 0.02, xtol=1e-13
    )
    return shoot(straight + hit, ground, site_height)[1] - range_m, hit


@pytest.mark.parametrize("target", TARGETS[1:])
def test_delay_and_bending_are_those_of_a_traced_ray(target):
    delay, bend = traced(*target)
    assert AIR.excess_range(*target) == pytest.approx(delay, abs=0.6 * cm)
    assert AIR.bending(*target) == pytest.approx(bend, rel=4e-4)


def test_straight_up_the_delay_is_the_integral_of_the_profile_and_nothing_bends():
    expected = 315e-6 * 7_350.0 * (1 - np.exp(-12_000 / 7_350.0))
    assert AIR.excess_range(12 * km, 12 * km, 0.0) == pytest.approx(expected, abs=0.01 * cm)
    assert AIR.bending(12 * km, 12 * km, 0.0) == pytest.approx(0, abs=1e-12)


def test_group_delay_is_16_to_30_m_per_100_km_at_the_ranges_of_air_traffic():
    range_m = np.array([50, 100, 150, 200]) * km
    for height_m in (3 * km, 11 * km):
        gain = AIR.excess_range(range_m, height_m, 0.1 * km) / range_m * 100 * km
        assert np.all((gain > 16) & (gain < 31))


def test_effective_earth_lowers_the_horizon_as_an_earth_four_thirds_as_large():
    range_m, height_m, site_m = 200 * km, 3 * km, 0.1 * km
    big = 4 / 3 * EARTH_M
    angle = np.arccos(
        ((big + site_m) ** 2 + (big + height_m) ** 2 - range_m**2)
        / (2 * (big + site_m) * (big + height_m))
    )
    apparent = np.arctan2(
        (big + height_m) * np.cos(angle) - big - site_m, (big + height_m) * np.sin(angle)
    )
    a, b = EARTH_M + site_m, EARTH_M + height_m
    true = np.arcsin((b**2 - a**2 - range_m**2) / (2 * range_m * a))
    bend = EffectiveEarth().bending(range_m, height_m, site_m)
    assert bend == pytest.approx(apparent - true, abs=1e-9)
    assert bend == pytest.approx(range_m / (8 * EARTH_M), rel=0.01)  # curvature R/4 over half a ray


def test_near_the_ground_the_exponential_bends_as_its_own_effective_earth():
    gradient = 315e-6 / 7_350.0
    factor = 1 / (1 - EARTH_M * gradient)
    place = (15 * km, 60.0, 30.0)
    own = EffectiveEarth(factor=factor).bending(*place)
    assert AIR.bending(*place) == pytest.approx(own, rel=0.02)


def test_a_vacuum_does_nothing():
    nothing = np.zeros((2, 3))
    place = (np.full((2, 1), 9 * km), np.full(3, 2 * km), 0.0)
    np.testing.assert_array_equal(NoAtmosphere().excess_range(*place), nothing)
    np.testing.assert_array_equal(NoAtmosphere().bending(*place), nothing)
    np.testing.assert_array_equal(EffectiveEarth().excess_range(*place), nothing)
    np.testing.assert_allclose(EffectiveEarth(factor=1.0).bending(*place), nothing, atol=1e-15)


@pytest.mark.parametrize("air", [NoAtmosphere(), EffectiveEarth(), AIR])
@pytest.mark.parametrize("question", ["excess_range", "bending"])
def test_a_table_of_targets_is_answered_as_each_target_is(air, question):
    columns = np.array(TARGETS).T
    together = getattr(air, question)(*columns)
    one_by_one = [getattr(air, question)(*target) for target in TARGETS]
    assert together.shape == (len(TARGETS),)
    np.testing.assert_allclose(together, one_by_one, rtol=1e-12, atol=1e-15)
