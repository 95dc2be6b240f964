"""How the demo's aircraft fly: on the ellipsoid, as continuous curves.

A flight is a list of legs (turn rate, acceleration, climb rate) and one anchor: the place, track,
speed and height that it has at one instant, such as a runway's threshold at touch-down. Commands
are smoothed as an aircraft's inertia would, integrated away from the anchor both ways, and the
path is carried over the Earth's surface.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from boresight.maths import frames
from boresight.maths.frames import Site

Array = NDArray[np.float64]

# Whole quanta of I034/120 (180/2^23 degrees, 1 m), so that the recording states the site exactly.
SITE = Site(latitude_deg=47.8125, longitude_deg=1.40625, height_m=180.0)
DURATION_S = 900.0
STEP_S = 0.25  # of the integration; the truth is a cubic spline through these steps
GRAVITY = 9.80665
FOOT = 0.3048


@dataclass(frozen=True)
class Leg:
    """Commands held for a time: turn to the right in deg/s, m/s2 along the path, m/s upward."""

    seconds: float
    turn_dps: float = 0.0
    accel_mps2: float = 0.0
    climb_mps: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Flight:
    """What is planned, and who it is."""

    kind: str
    legs: tuple[Leg, ...]
    start_s: float  # when the first leg begins; the last command holds after the last leg
    anchor_s: float
    latitude_deg: float
    longitude_deg: float
    height_m: float
    track_deg: float
    speed_mps: float
    lands: bool = False
    identity: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Path:
    """What was flown: splines over [first_s, last_s] of ENU at the site, and what is on board."""

    flight: Flight
    first_s: float
    last_s: float
    enu: CubicSpline  # t -> (..., 3) m
    onboard: (
        CubicSpline  # t -> (..., 4): ground speed m/s, track rad (unwrapped), climb m/s, roll rad
    )


def turn(angle_deg: float, speed_mps: float, bank_deg: float = 25.0, climb_mps: float = 0.0) -> Leg:
    """Turn at the standard 3 deg/s or at the bank limit, whichever is slower."""
    limit = np.degrees(GRAVITY * np.tan(np.radians(bank_deg)) / speed_mps)
    rate = min(3.0, float(limit))
    return Leg(abs(angle_deg) / rate, float(np.copysign(rate, angle_deg)), 0.0, climb_mps)


def fly(flight: Flight) -> Path:
    """Integrate a flight and keep what happens during the recording."""
    margin = 8.0  # s, so that every interpolation has neighbours
    begin = min(flight.start_s, flight.anchor_s)
    end = max(DURATION_S + margin, flight.anchor_s)
    time = np.arange(np.floor(begin), end + STEP_S, STEP_S)
    turn_rate, accel, climb = _commands(flight, time)
    anchor = int(np.argmin(np.abs(time - flight.anchor_s)))
    speed = flight.speed_mps + _integral(accel, anchor)
    track = np.radians(flight.track_deg + _integral(turn_rate, anchor))
    height = flight.height_m + _integral(climb, anchor)
    latitude, longitude = _over_the_ground(flight, anchor, speed, track, height)
    roll = np.arctan(speed * np.radians(turn_rate) / GRAVITY)
    enu = frames.enu_from_geodetic(latitude, longitude, height, SITE)
    last = flight.anchor_s if flight.lands else DURATION_S + margin
    first = max(flight.start_s, -margin)
    kept = (time >= first) & (time <= last)
    onboard = np.stack([speed, track, climb, roll], axis=-1)
    return Path(
        flight=flight,
        first_s=float(time[kept][0]),
        last_s=float(time[kept][-1]),
        enu=CubicSpline(time[kept], enu[kept]),
        onboard=CubicSpline(time[kept], onboard[kept]),
    )


def ellipsoid_height(enu: Array) -> Array:
    """Height above the ellipsoid of east, north, up (..., 3) at the site."""
    return np.asarray(frames.ellipsoid_height(*np.moveaxis(enu, -1, 0), SITE))


def pressure_altitude_m(enu: Array) -> Array:
    """What a transponder says of a place: the day is warmer and denser than the standard one.

    True height is 1.02 times pressure height plus 35 m plus a weather of 12 m over 150 km.
    """
    weather = 12.0 * np.sin((enu[..., 0] + 0.6 * enu[..., 1]) / 24_000.0)
    return (ellipsoid_height(enu) - 35.0 - weather) / 1.02


def _commands(flight: Flight, time: Array) -> Array:
    """Turn rate, acceleration and climb rate (3, times), rounded off as inertia would."""
    starts = flight.start_s + np.cumsum([0.0] + [leg.seconds for leg in flight.legs[:-1]])
    now = np.maximum(np.searchsorted(starts, time, side="right") - 1, 0)
    table = np.array([[leg.turn_dps, leg.accel_mps2, leg.climb_mps] for leg in flight.legs])
    widths = ((4.0, 3.0), (6.0, 4.0), (10.0, 6.0))  # s, two averages each: roll, thrust, pitch
    return np.stack([_smooth(table[now, i], width) for i, width in enumerate(widths)])


def _smooth(command: Array, widths: tuple[float, ...]) -> Array:
    for width in widths:
        half = round(width / STEP_S / 2)
        kernel = np.full(2 * half + 1, 1 / (2 * half + 1))
        command = np.convolve(np.pad(command, half, mode="edge"), kernel, mode="valid")
    return command


def _integral(rate: Array, anchor: int) -> Array:
    """Running integral, zero at the anchor."""
    steps = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2)]) * STEP_S
    return steps - steps[anchor]


def _over_the_ground(
    flight: Flight, anchor: int, speed: Array, track: Array, height: Array
) -> tuple[Array, Array]:
    """Latitude and longitude in degrees; the radii depend on latitude, so it is refined thrice."""
    latitude = np.full_like(speed, flight.latitude_deg)
    squared = frames.FLATTENING * (2 - frames.FLATTENING)
    for _ in range(4):
        sine = np.sin(np.radians(latitude))
        normal = frames.EQUATOR_M / np.sqrt(1 - squared * sine**2)
        meridian = normal * (1 - squared) / (1 - squared * sine**2)
        northward = speed * np.cos(track) / (meridian + height)
        latitude = flight.latitude_deg + np.degrees(_integral(northward, anchor))
    eastward = speed * np.sin(track) / ((normal + height) * np.cos(np.radians(latitude)))
    return latitude, flight.longitude_deg + np.degrees(_integral(eastward, anchor))
