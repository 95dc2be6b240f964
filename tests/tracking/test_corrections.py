"""What a calibration does to plots and to what tracks carry, worked out by hand."""

import numpy as np
import pytest

from boresight.maths.frames import Site, enu_from_geodetic
from boresight.models.systematic import SystematicErrors
from boresight.tracking.corrections import applied, carried, corrected, moved
from boresight.tracking.flight import Flights

SITE = Site(latitude_deg=48.0, longitude_deg=7.0, height_m=250.0)


def errors(sd, **estimates):
    """Estimates by term, with independent standard deviations."""
    cov = np.diag(np.square(np.asarray(sd, dtype=float)))
    return SystematicErrors(
        terms=tuple(estimates), estimate=np.array([*estimates.values()]), cov=cov
    )


def test_plots_lose_what_the_radar_added_and_were_measured_before_their_stamps():
    found = errors([1.0, 0.1, 0.2], range_bias_m=120.0, azimuth_bias_deg=0.5, time_bias_s=0.25)
    before = Flights(
        time=np.array([10.0, 14.0]),
        z=np.array([[5_120.0, 1.0, 3_000.0], [6_120.0, 0.0, np.nan]]),
        track=np.array([0, 0]),
    )
    kept = before.z.copy()
    after = corrected(before, found)
    np.testing.assert_allclose(after.time, [9.75, 13.75])
    np.testing.assert_allclose(after.z[:, 0], [5_000.0, 6_000.0])
    turned = [1.0 - np.radians(0.5), 2.0 * np.pi - np.radians(0.5)]
    np.testing.assert_allclose(after.z[:, 1], turned)
    np.testing.assert_array_equal(after.z[:, 2], kept[:, 2])
    np.testing.assert_array_equal(before.z, kept)


def test_the_antenna_is_where_the_offset_says_east_and_north():
    found = errors([1.0, 1.0], site_east_m=300.0, site_north_m=-80.0)
    place = moved(SITE, found)
    enu = enu_from_geodetic(place.latitude_deg, place.longitude_deg, place.height_m, SITE)
    np.testing.assert_allclose(enu[:2], [300.0, -80.0], atol=0.05)
    assert place.height_m == SITE.height_m
    assert moved(SITE, errors([1.0], range_bias_m=300.0)) is SITE


def test_a_targets_own_delay_is_to_its_track_a_bias_of_range():
    alone = carried(errors([0.1], azimuth_bias_deg=0.5), 30.0)
    assert alone.terms == ("azimuth_bias_deg", "range_bias_m")
    np.testing.assert_allclose(alone.cov, np.diag([0.01, 900.0]))
    both = carried(errors([40.0], range_bias_m=120.0), 30.0)
    assert np.sqrt(both.cov[0, 0]) == pytest.approx(50.0)
    assert both.value("range_bias_m") == 120.0


def test_what_no_track_sees_or_what_is_certain_is_not_carried():
    found = errors([0.3, 0.0, 0.1], elevation_bias_deg=1.0, time_bias_s=2.0, azimuth_bias_deg=3.0)
    assert carried(found).terms == ("azimuth_bias_deg",)


def test_what_was_applied_is_told_with_standard_deviations():
    found = errors([9.0, 0.0], range_bias_m=120.0, time_bias_s=0.5)
    told = applied(found, carried(found, 12.0))
    assert told["estimate"] == {"range_bias_m": 120.0, "time_bias_s": 0.5}
    assert told["sd"] == {"range_bias_m": 9.0, "time_bias_s": 0.0}
    assert told["carried"] == pytest.approx({"range_bias_m": 15.0})
