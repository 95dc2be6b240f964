"""The air's effect is put into plots by its own model, and taken out again by the radar."""

import numpy as np
import polars as pl
import pytest

import boresight as bs
from boresight.errors import UsageError
from boresight.models.atmosphere import ExponentialAtmosphere
from boresight.models.sensors import Radar

SITE = bs.Site(latitude_deg=47.0, longitude_deg=8.0, height_m=500.0)
AIR = ExponentialAtmosphere()


def test_delay_and_bending_are_taken_out_to_a_centimetre_and_a_microradian():
    radar = Radar(range_m=10, azimuth_deg=0.1, elevation_deg=0.1, site=SITE, atmosphere=AIR)
    r, el = np.array([20e3, 150e3, 300e3]), np.radians([30.0, 3.0, 1.0])
    start = 6_371e3 + SITE.height_m  # a sphere, as the air's own model has it
    height = np.sqrt(start**2 + r**2 + 2 * r * start * np.sin(el)) - 6_371e3
    seen = np.stack(
        [
            r + AIR.excess_range(r, height, SITE.height_m),
            np.zeros(3),
            el + AIR.bending(r, height, SITE.height_m),
        ],
        axis=-1,
    )
    assert np.all(seen[:, 0] - r > 1.0)
    clear = radar.without_air(seen)
    assert np.abs(clear[:, 0] - r).max() < 0.01
    assert np.abs(clear[:, 2] - el).max() < 1e-6


def test_without_an_atmosphere_plots_stay_as_they_are():
    radar = Radar(range_m=10, azimuth_deg=0.1)
    z = np.array([[1e5, 0.3]])
    assert radar.without_air(z) is z


def test_a_plot_that_tells_no_height_keeps_its_range():
    radar = Radar(range_m=10, azimuth_deg=0.1, site=SITE, atmosphere=AIR)
    z = np.array([[1e5, 0.3]])
    assert np.array_equal(radar.without_air(z), z)


def test_air_needs_a_site():
    with pytest.raises(UsageError, match="needs a site"):
        Radar(range_m=10, azimuth_deg=0.1, atmosphere=AIR)


def test_tracks_move_by_the_delay(request):
    plots = request.getfixturevalue("sky_plots")
    vacuum = bs.track(plots, site=SITE, filter="ekf")
    aired = bs.track(plots, site=SITE, filter="ekf", atmosphere=AIR)
    assert "Exponential" in aired.settings["atmosphere"]
    far = [np.hypot(t.tracks["east_m"], t.tracks["north_m"]).mean() for t in (vacuum, aired)]
    expected = AIR.excess_range(plots["range_m"].mean(), 9_100.0, SITE.height_m)
    assert far[0] - far[1] == pytest.approx(float(expected), rel=0.2)


@pytest.fixture
def sky_plots():
    """A straight flight at 100 km, noise-free."""
    t = 4.0 * np.arange(100)
    return pl.DataFrame(
        {
            "time_s": t,
            "sensor": "1/2",
            "range_m": np.hypot(100e3, 150.0 * (t - 200.0)),
            "azimuth_deg": 90.0 + np.degrees(np.arctan2(150.0 * (t - 200.0), 100e3)),
            "pressure_altitude_m": 9_100.0,
            "altitude_valid": True,
            "address": "F00001",
            "report_type": "mode-s",
        }
    )
