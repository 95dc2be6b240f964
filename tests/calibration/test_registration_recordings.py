"""Registration of real recordings: an en-route radar under system tracks, a surface radar.

The bands are those of an independent analysis of the same files. They guard against gross errors,
and are no evidence of accuracy.
"""

from pathlib import Path

import numpy as np
import pytest
from radar_worlds import SIX

from boresight.calibration.pairing import pair
from boresight.calibration.references import from_file
from boresight.calibration.registration import register
from boresight.formats.recording import read_recording
from boresight.maths.frames import Site

DATA = Path(__file__).parents[3] / "shared/data"
EN_ROUTE = DATA / "saenz-pena"
SURFACE = DATA / "barcelona-surface"
THREE = ("range_bias_m", "azimuth_bias_deg", "time_bias_s")
pytestmark = pytest.mark.skipif(
    not DATA.exists(), reason="the shared recordings are not beside this checkout"
)


@pytest.fixture(scope="module")
def en_route():
    plots = read_recording(EN_ROUTE / "plots-cat048.pcap").plots
    site = Site(latitude_deg=-26.750555, longitude_deg=-60.481666, height_m=90.0)
    return pair(plots, from_file(EN_ROUTE / "system-tracks-cat062.pcap"), site).pairs


@pytest.fixture(scope="module")
def surface():
    site = Site(latitude_deg=41.29561833, longitude_deg=2.09511417, height_m=50.0)
    plots = read_recording(SURFACE / "smr.ast").plots
    return pair(plots, from_file(SURFACE / "adsb.ast"), site).pairs


def near(found, term, value, band):
    return abs(found.terms[term].estimate - value) <= band


def test_three_terms_of_the_en_route_radar(en_route):
    found = register(en_route, THREE)
    assert near(found, "azimuth_bias_deg", 0.535, 0.02)
    assert near(found, "time_bias_s", 0.0, 0.15)
    assert abs(found.noise.residual_range_m - 72.0) <= 8.0
    assert abs(found.noise.residual_azimuth_deg - 0.054) <= 0.006
    assert found.noise.outlier_share < 0.06
    assert not found.directions


def test_six_terms_of_the_en_route_radar_are_hardly_separable(en_route):
    found = register(en_route, SIX)
    assert near(found, "azimuth_bias_deg", 0.51, 0.03)
    assert abs(found.noise.residual_range_m - 75.0) <= 8.0
    assert abs(found.noise.residual_azimuth_deg - 0.047) <= 0.006
    together = [set(direction.weights) for direction in found.directions]
    assert {"range_bias_m", "range_gain_m_per_km"} in together
    assert any({"azimuth_bias_deg", "azimuth_cos_deg"} <= names for names in together)
    assert sum(map(len, together)) == len(set.union(*together))  # no term is told of twice
    assert all(direction.observable for direction in found.directions)


@pytest.mark.parametrize("terms", [THREE, SIX])
def test_halves_of_the_en_route_recording_agree(en_route, terms):
    """|z| of 3 for nine numbers: false alarms are rare, and so is power with six aircraft each."""
    late = en_route.time_s > np.median(en_route.time_s)
    halves = [register(en_route.take(mask), terms).terms for mask in (late, ~late)]
    for term in terms:
        one, other = (half[term] for half in halves)
        assert abs(one.estimate - other.estimate) < 3.0 * np.hypot(one.sd, other.sd), term


def test_what_is_planted_on_the_en_route_radar_comes_back(en_route):
    from dataclasses import replace

    plain = register(en_route, THREE).terms
    moved = replace(en_route, z=en_route.z + np.array([200.0, np.radians(0.5)]))
    found = register(moved, THREE).terms
    for term, planted, within in zip(THREE, (200.0, 0.5, 0.0), (1.0, 0.002, 0.01), strict=True):
        assert abs(found[term].estimate - plain[term].estimate - planted) < within


def test_two_terms_of_the_surface_radar(surface):
    found = register(surface, THREE[:2])
    assert near(found, "range_bias_m", -2.7, 1.5)
    assert near(found, "azimuth_bias_deg", 0.29, 0.06)


def test_azimuth_time_and_position_of_the_surface_radar_are_hardly_separable(surface):
    found = register(surface, (*THREE, "site_east_m", "site_north_m"))
    named = {name for direction in found.directions for name in direction.weights}
    assert {"azimuth_bias_deg", "time_bias_s", "site_east_m", "site_north_m"} <= named
    assert all("hardly separable" in direction.words for direction in found.directions)
