"""Frames against pyproj, and where maps go wrong: poles, antimeridian, straight overhead."""

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import UsageError
from boresight.lanes import gradient
from boresight.maths import frames
from boresight.maths.frames import Site

km, mm, um, NM = 1e3, 1e-3, 1e-6, 1852.0
arcsecond = np.pi / 648_000

SITES = {
    "plain": Site(latitude_deg=47.8, longitude_deg=1.4, height_m=180.0),
    "antimeridian": Site(latitude_deg=-33.0, longitude_deg=180.0, height_m=20.0),
    "equator": Site(latitude_deg=0.0, longitude_deg=-78.0, height_m=2_800.0),
    "near the pole": Site(latitude_deg=89.99, longitude_deg=170.0, height_m=0.0),
    "pole": Site(latitude_deg=-90.0, longitude_deg=0.0, height_m=2_835.0),
}
each_site = pytest.mark.parametrize("site", SITES.values(), ids=SITES.keys())
to_ecef = pyproj.Transformer.from_crs(4979, 4978, always_xy=True).transform

latitudes, longitudes = st.floats(-90, 90), st.floats(-180, 180)
heights = st.floats(-1 * km, 30 * km)
azimuths = st.floats(0, 2 * np.pi, exclude_max=True)
sites = st.builds(Site, latitude_deg=latitudes, longitude_deg=longitudes, height_m=heights)


def pyproj_enu(site):
    place = f"+lat_0={site.latitude_deg} +lon_0={site.longitude_deg} +h_0={site.height_m}"
    chain = f"+proj=pipeline +step +proj=cart +step +proj=topocentric {place}"
    return pyproj.Transformer.from_pipeline(chain).transform


def places(count=2_000):
    rng = np.random.default_rng(3)
    latitude, longitude = rng.uniform(-90, 90, count), rng.uniform(-180, 180, count)
    return latitude, longitude, rng.uniform(-1 * km, 30 * km, count)


def around(site, count=2_000):
    """Points out to 500 km of a site whose geodetic coordinates pyproj knows exactly."""
    rng = np.random.default_rng(4)
    reach = np.degrees(500 * km / frames.EQUATOR_M) / np.sqrt(2)
    latitude = np.clip(site.latitude_deg + rng.uniform(-reach, reach, count), -90, 90)
    longitude = site.longitude_deg + rng.uniform(-reach, reach, count)
    return latitude, longitude, rng.uniform(-1 * km, 30 * km, count)


def test_ecef_agrees_with_pyproj():
    latitude, longitude, height = places()
    ours = frames.ecef_from_geodetic(latitude, longitude, height)
    np.testing.assert_allclose(ours, np.stack(to_ecef(longitude, latitude, height), -1), atol=um)


def test_geodetic_undoes_pyprojs_ecef():
    latitude, longitude, height = places()
    ours = frames.geodetic_from_ecef(np.stack(to_ecef(longitude, latitude, height), -1))
    np.testing.assert_allclose(ours.latitude_deg, latitude, atol=1e-13, rtol=1e-14)
    np.testing.assert_allclose(ours.longitude_deg, longitude, atol=1e-13, rtol=1e-14)
    np.testing.assert_allclose(ours.height_m, height, atol=um)


@each_site
def test_enu_agrees_with_pyproj(site):
    latitude, longitude, height = around(site)
    ours = frames.enu_from_geodetic(latitude, longitude, height, site)
    theirs = pyproj_enu(site)(longitude, latitude, height)
    np.testing.assert_allclose(ours, np.stack(theirs, -1), atol=um)


@each_site
def test_ellipsoid_height_is_the_height_the_point_was_placed_at(site):
    latitude, longitude, height = around(site)
    east, north, up = pyproj_enu(site)(longitude, latitude, height)
    np.testing.assert_allclose(
        frames.ellipsoid_height(east, north, up, site), height, atol=um, rtol=0
    )


def test_ellipsoid_height_of_one_point_is_a_plain_number():
    height = frames.ellipsoid_height(10 * km, -20 * km, 5 * km, SITES["plain"])
    assert np.ndim(height) == 0
    assert 5_180 < height < 5_180 + (22.4 * km) ** 2 / frames.EQUATOR_M


@pytest.mark.parametrize("azimuth_deg", [0, 77, 180, 301])
def test_the_earth_drops_16_8_km_below_the_tangent_plane_at_250_nautical_miles(azimuth_deg):
    azimuth = np.radians(azimuth_deg)
    east, north = 250 * NM * np.sin(azimuth), 250 * NM * np.cos(azimuth)
    sea_site = Site(latitude_deg=47.8, longitude_deg=1.4, height_m=0.0)
    assert frames.ellipsoid_height(east, north, 0.0, sea_site) == pytest.approx(16.8e3, abs=60)


@given(sites, st.floats(1, 500 * km), azimuths, st.floats(-1.5, 1.5))
def test_polar_round_trip(site, range_m, azimuth, elevation):
    enu = frames.enu_from_polar(range_m, azimuth, elevation)
    again = frames.enu_from_ecef(frames.ecef_from_enu(enu, site), site)
    np.testing.assert_allclose(again, enu, atol=um)
    back = frames.polar_from_enu(enu)
    assert back.range_m == pytest.approx(range_m, rel=1e-14)
    assert back.elevation == pytest.approx(elevation, abs=1e-6 * arcsecond)
    assert np.exp(1j * back.azimuth) == pytest.approx(np.exp(1j * azimuth), abs=1e-12)
    assert 0 <= back.azimuth < 2 * np.pi


@given(latitudes, longitudes, st.floats(-500, 30 * km))
def test_geodetic_round_trip_through_a_site(latitude, longitude, height):
    site = SITES["antimeridian"]
    enu = frames.enu_from_geodetic(latitude, longitude, height, site)
    back = frames.geodetic_from_enu(enu, site)
    again = frames.enu_from_geodetic(*back, site)
    np.testing.assert_allclose(again, enu, atol=um)
    assert back.height_m == pytest.approx(height, abs=um)


def test_azimuth_is_clockwise_from_north_and_elevation_upward():
    enu = [[0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0], [0, 1, 1], [0, 0, 1]]
    polar = frames.polar_from_enu(np.array(enu, dtype=float))
    np.testing.assert_allclose(np.degrees(polar.azimuth), [0, 90, 180, 270, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.degrees(polar.elevation), [0, 0, 0, 0, 45, 90], atol=1e-12)


def test_crossing_the_antimeridian_moves_a_target_by_metres_not_round_the_earth():
    enu = frames.enu_from_geodetic([-33, -33], [179.99, -179.99], [0, 0], SITES["antimeridian"])
    np.testing.assert_allclose(enu[0], enu[1] * [-1, 1, 1], atol=um)
    assert 0 < enu[1, 0] < 1 * km


@each_site
def test_a_plot_with_height_lands_where_the_target_is(site):
    latitude, longitude, height = around(site)
    enu = np.stack(pyproj_enu(site)(longitude, latitude, height), -1)
    polar = frames.polar_from_enu(enu)
    ours = frames.enu_at_height(polar.range_m, polar.azimuth, height, site)
    # Range and height together fix a place only where a step outward changes the range.
    np.testing.assert_allclose(ours[:, 2], enu[:, 2], atol=0.01 * mm)
    outside = np.abs(polar.elevation) < np.radians(80)
    np.testing.assert_allclose(ours[outside], enu[outside], atol=0.1 * mm)


def test_a_range_too_short_for_the_height_is_put_straight_overhead():
    enu = frames.enu_at_height(np.array([9 * km, 1 * km]), 1.0, [11 * km, -9 * km], SITES["plain"])
    np.testing.assert_allclose(enu, [[0, 0, 9 * km], [0, 0, -1 * km]], atol=mm)


def test_a_pose_takes_one_site_to_another():
    sensor, centre = SITES["plain"], Site(latitude_deg=49.0, longitude_deg=3.0, height_m=90.0)
    rotation, offset = frames.pose(sensor, centre)
    enu = np.array([[10 * km, -80 * km, 9 * km], [0, 0, 0]])
    through_earth = frames.enu_from_ecef(frames.ecef_from_enu(enu, sensor), centre)
    np.testing.assert_allclose(enu @ rotation.T + offset, through_earth, atol=um)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize("wrong", [{"latitude_deg": 91}, {"height_m": 1e6}, {"longitude_deg": 400}])
def test_a_site_that_is_nowhere_is_refused(wrong):
    place = {"latitude_deg": 1.0, "longitude_deg": 2.0, "height_m": 3.0}
    with pytest.raises(UsageError, match="not a place on Earth"):
        Site(**(place | wrong))
    with pytest.raises(UsageError):
        Site(**(place | {"latitude_deg": float("nan")}))


@each_site
def test_the_gradient_of_height_is_the_vertical_at_the_target(site):
    """Recorded and differentiated as a formula: up at the target, in the site's frame."""
    enu = np.array([120 * km, -80 * km, 6 * km])
    place = frames.geodetic_from_enu(enu, site)
    higher = frames.enu_from_geodetic(
        place.latitude_deg, place.longitude_deg, place.height_m + 1 * km, site
    )
    height, vertical = gradient(lambda p: frames.ellipsoid_height(p[0], p[1], p[2], site), enu)
    assert height == pytest.approx(place.height_m, abs=um)
    np.testing.assert_allclose(vertical, (higher - enu) / km, atol=1e-11)
