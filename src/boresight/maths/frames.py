"""Where things are: geodetic (WGS-84), Earth-centred (ECEF), east-north-up at a site, and polar.

Cartesian positions are arrays (..., 3): leading axes are rows of a table. Azimuth is clockwise from
North and elevation upward from the tangent plane, both in radians; latitude and longitude are in
degrees, as every table and every map has them. Heights are above the ellipsoid, never above the
sea and never the tangent plane's z: 250 NM out the Earth has dropped 16.8 km below that plane.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.maths.gaussian import Array

# WGS-84, defining constants: NIMA TR8350.2, table 3.1.
EQUATOR_M = 6_378_137.0
FLATTENING = 1 / 298.257223563

POLE_M = EQUATOR_M * (1 - FLATTENING)
_E2 = FLATTENING * (2 - FLATTENING)  # first eccentricity squared
_E2_POLE = _E2 / (1 - _E2)  # second eccentricity squared
_RADIANS = np.pi / 180  # a factor, not np.radians, so that a symbol can be multiplied by it


@dataclass(frozen=True, kw_only=True)
class Site:
    """A fixed place, origin of an east-north-up frame; height above the WGS-84 ellipsoid."""

    latitude_deg: float
    longitude_deg: float
    height_m: float

    def __post_init__(self) -> None:
        """Refuse a place that is not on Earth, most often latitude and longitude exchanged."""
        lowest, highest = -1_000, 30_000
        if not (
            abs(self.latitude_deg) <= 90
            and abs(self.longitude_deg) <= 360
            and lowest <= self.height_m <= highest
        ):
            raise UsageError(
                f"{self} is not a place on Earth",
                why=f"latitude must lie within 90, longitude within 360 degrees, height within "
                f"{lowest} to {highest} m above the ellipsoid",
                next_step="give the site as LATITUDE,LONGITUDE,HEIGHT in degrees and metres",
            )


class Geodetic(NamedTuple):
    """Latitude and longitude in degrees, height above the ellipsoid in metres, each (...)."""

    latitude_deg: Array
    longitude_deg: Array
    height_m: Array


class Polar(NamedTuple):
    """Slant range in metres, azimuth in [0, 2 pi) and elevation in radians, each (...)."""

    range_m: Array
    azimuth: Array
    elevation: Array


def ecef_from_geodetic(latitude_deg: Array, longitude_deg: Array, height_m: Array) -> Array:
    """Earth-centred position (..., 3) of geodetic coordinates that broadcast together."""
    latitude, longitude = np.radians(latitude_deg), np.radians(longitude_deg)
    rho, z = _meridian(np.cos(latitude), np.sin(latitude), height_m)
    x, y = rho * np.cos(longitude), rho * np.sin(longitude)
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def geodetic_from_ecef(ecef: Array) -> Geodetic:
    """Geodetic coordinates of Earth-centred positions (..., 3), longitude in (-180, 180].

    Bowring's step, taken twice, is exact to rounding (some nm) from the sea bed to satellites. A
    pole has longitude 0.
    """
    x, y, z = np.moveaxis(np.asarray(ecef, dtype=float), -1, 0)
    rho = np.hypot(x, y)
    cos, sin = _normal(rho, z, *_normal(rho, z, *_start(rho, z)))
    latitude, longitude = np.arctan2(sin, cos), np.arctan2(y, x)
    return Geodetic(np.degrees(latitude), np.degrees(longitude), _height(rho, z, cos, sin))


def enu_axes(site: Site) -> Array:
    """Rotation (3, 3) that takes an Earth-centred direction to east, north and up at the site."""
    latitude, longitude = site.latitude_deg * _RADIANS, site.longitude_deg * _RADIANS
    cos, sin = np.cos(latitude), np.sin(latitude)
    cos_l, sin_l = np.cos(longitude), np.sin(longitude)
    return np.array(
        [
            [-sin_l, cos_l, 0.0],
            [-sin * cos_l, -sin * sin_l, cos],
            [cos * cos_l, cos * sin_l, sin],
        ]
    )


def enu_from_ecef(ecef: Array, site: Site) -> Array:
    """East, north, up (..., 3) at the site, of Earth-centred positions (..., 3)."""
    return (np.asarray(ecef) - _origin(site)) @ enu_axes(site).T


def ecef_from_enu(enu: Array, site: Site) -> Array:
    """Earth-centred positions (..., 3) of east, north, up (..., 3) at the site."""
    return np.asarray(enu) @ enu_axes(site) + _origin(site)


def enu_from_geodetic(
    latitude_deg: Array, longitude_deg: Array, height_m: Array, site: Site
) -> Array:
    """East, north, up (..., 3) at the site, of geodetic coordinates that broadcast together."""
    return enu_from_ecef(ecef_from_geodetic(latitude_deg, longitude_deg, height_m), site)


def geodetic_from_enu(enu: Array, site: Site) -> Geodetic:
    """Geodetic coordinates of east, north, up (..., 3) at the site."""
    return geodetic_from_ecef(ecef_from_enu(enu, site))


def pose(sensor: Site, centre: Site) -> tuple[Array, Array]:
    """Rotation (3, 3) and offset (3,) that take ENU at `sensor` to ENU at `centre`.

    `centre_enu = rotation @ sensor_enu + offset`, exact through the Earth's centre.
    """
    return enu_axes(centre) @ enu_axes(sensor).T, enu_from_ecef(_origin(sensor), centre)


def polar_from_enu(enu: Array) -> Polar:
    """Slant range, azimuth and elevation of east, north, up (..., 3). Overhead, azimuth is 0."""
    east, north, up = np.moveaxis(np.asarray(enu, dtype=float), -1, 0)
    ground = np.hypot(east, north)
    azimuth = np.arctan2(east, north) % (2 * np.pi)
    return Polar(np.hypot(ground, up), azimuth, np.arctan2(up, ground))


def enu_from_polar(range_m: Array, azimuth: Array, elevation: Array) -> Array:
    """East, north, up (..., 3) of slant range, azimuth and elevation that broadcast together."""
    ground = range_m * np.cos(elevation)
    east, north = ground * np.sin(azimuth), ground * np.cos(azimuth)
    return np.stack(np.broadcast_arrays(east, north, range_m * np.sin(elevation)), axis=-1)


def enu_at_height(range_m: Array, azimuth: Array, height_m: Array, site: Site) -> Array:
    """East, north, up (..., 3) of a target whose slant range, azimuth and height are known.

    `height_m` is above the ellipsoid. On a sphere `up` follows from range and height without a
    root, so it is that sphere's answer that is corrected by what the ellipsoid says; four rounds
    leave less than 1 um out to 500 km. A range too short to reach the height gives the point
    straight above (or below) the site, at that range.
    """
    range_m, azimuth, height_m = np.broadcast_arrays(range_m, azimuth, height_m)
    centre = EQUATOR_M + site.height_m
    up = height_m - site.height_m + ((height_m - site.height_m) ** 2 - range_m**2) / (2 * centre)
    for _ in range(5):
        up = np.clip(up, -range_m, range_m)
        ground = np.sqrt(range_m**2 - up**2)
        east, north = ground * np.sin(azimuth), ground * np.cos(azimuth)
        enu = np.stack([east, north, up], axis=-1)
        up = up + height_m - ellipsoid_height(east, north, up, site)
    return enu


def ellipsoid_height(east: Array, north: Array, up: Array, site: Site) -> Array:
    """Height above the ellipsoid of a point in the site's frame, to better than 1 um near Earth.

    Branch-free, operators and square roots only: runs on floats, arrays and symbols, and may stand
    in a compiled formula. By symmetry the site's longitude does not matter. `site` may be anything
    that has `latitude_deg` and `height_m`, symbols included.
    """
    latitude = site.latitude_deg * _RADIANS
    cos, sin = np.cos(latitude), np.sin(latitude)
    rho_site, z_site = _meridian(cos, sin, site.height_m)
    outward = rho_site - sin * north + cos * up  # in the site's meridian plane, east beside it
    rho, z = np.sqrt(outward * outward + east * east), z_site + cos * north + sin * up
    return _height(rho, z, *_normal(rho, z, *_start(rho, z)))


def _origin(site: Site) -> Array:
    return ecef_from_geodetic(site.latitude_deg, site.longitude_deg, site.height_m)


def _meridian(cos: Array, sin: Array, height: Array) -> tuple[Array, Array]:
    """Distance from the axis, and from the equator's plane, of a point at a geodetic latitude."""
    radius = EQUATOR_M / np.sqrt(1 - _E2 * sin * sin)
    return (radius + height) * cos, (radius * (1 - _E2) + height) * sin


def _start(rho: Array, z: Array) -> tuple[Array, Array]:
    """A direction (any length) along the normal of a point that lies on the ellipsoid."""
    return rho * (1 - _E2), z


def _normal(rho: Array, z: Array, along: Array, across: Array) -> tuple[Array, Array]:
    """Cosine and sine of latitude, by Bowring (1976), from a good guess of the normal."""
    cos_b, sin_b = _unit(along, across * (1 - FLATTENING))  # of the reduced latitude
    return _unit(
        rho - _E2 * EQUATOR_M * cos_b * cos_b * cos_b,
        z + _E2_POLE * POLE_M * sin_b * sin_b * sin_b,
    )


def _unit(along: Array, across: Array) -> tuple[Array, Array]:
    length = np.sqrt(along * along + across * across)
    return along / length, across / length


def _height(rho: Array, z: Array, cos: Array, sin: Array) -> Array:
    """Height along the normal; an error of the latitude enters it only squared."""
    return rho * cos + z * sin - EQUATOR_M * np.sqrt(1 - _E2 * sin * sin)
