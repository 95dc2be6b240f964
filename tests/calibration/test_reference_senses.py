"""Signs of a site, senses of azimuth, half hours and radians: each is named and nothing else is."""

from dataclasses import replace

import polars as pl
import pytest
from flown import SITE, reference, sky

from boresight.calibration.pairing import pair
from boresight.errors import DataError


def refused(plots, reports, folder, site=SITE):
    with pytest.raises(DataError) as caught:
        pair(plots, reference(folder, reports), site)
    return caught.value.what


@pytest.fixture
def flown():
    fleet, plots = sky()
    return plots, pl.concat([each.reports() for each in fleet])


@pytest.mark.parametrize(
    ("name", "sense"), [("longitude", "east is positive"), ("latitude", "north is positive")]
)
def test_a_site_of_the_other_sign_is_named(tmp_path, flown, name, sense):
    other = replace(SITE, **{f"{name}_deg": -getattr(SITE, f"{name}_deg")})
    said = refused(*flown, tmp_path, other)
    assert f"{name} of the site has the wrong sign ({sense})" in said


@pytest.mark.parametrize(
    ("azimuth", "sense"),
    [
        (-pl.col("azimuth_deg"), "are counted against the clock"),
        (90.0 - pl.col("azimuth_deg"), "are counted from east, against the clock"),
        (pl.col("azimuth_deg") - 90.0, "are counted from east, not from north"),
        (pl.col("azimuth_deg") - 180.0, "are counted from south, not from north"),
    ],
)
def test_azimuths_of_another_sense_are_named(tmp_path, flown, azimuth, sense):
    plots, reports = flown
    said = refused(plots.with_columns(azimuth_deg=azimuth % 360.0), reports, tmp_path)
    assert f"the azimuths {sense}" in said


@pytest.mark.parametrize(("half_hours", "way"), [(11, "ahead of"), (-9, "behind")])
def test_clocks_of_half_hours_are_named(tmp_path, flown, half_hours, way):
    plots, reports = flown
    off = reports.with_columns(pl.col("time_s") + 1_800.0 * half_hours)
    said = refused(plots, off, tmp_path)
    assert f"clock is {1_800 * abs(half_hours)} s {way} the plots'" in said


def test_a_reference_in_radians_is_named(tmp_path, flown):
    plots, reports = flown
    radians = reports.with_columns(pl.col("latitude_deg", "longitude_deg").radians())
    said = refused(plots, radians, tmp_path)
    assert "latitude and longitude of the reference are in radians" in said
