"""The demo's sky: flights of our own invention, flown on the ellipsoid as continuous curves.

A flight is a list of legs (turn rate, acceleration, climb rate) and one anchor: the place, track,
speed and height that it has at one instant, such as a runway's threshold at touch-down. Commands
are smoothed as an aircraft's inertia would, integrated away from the anchor both ways, and the
path is carried over the Earth's surface. No route, address or callsign is anybody's.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

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
CODE_CHANGE_S = 450.0  # when one departure is given another Mode A code
GRAVITY = 9.80665
FOOT = 0.3048


@dataclass(frozen=True)
class Runway:
    """A threshold and the direction in which aircraft land and take off."""

    latitude_deg: float
    longitude_deg: float
    track_deg: float
    height_m: float = 165.0


NEAR = Runway(47.905, 1.62, 236.0)  # 10 NM from the radar
FAR = Runway(47.30, 0.72, 21.0)  # 41 NM from it
HOLD_FIX = (48.25, 2.05)


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


def sky(seed: int) -> list[Path]:
    """Every flight of the demo, in a fixed order, with its identity."""
    rng = np.random.Generator(np.random.Philox(key=[seed, 1]))
    flights = [
        *_overflights(rng),
        *(_arrival(rng, NEAR, land_s) for land_s in (150, 290, 430, 570, 720, 880, 1_040, 1_210)),
        *(_arrival(rng, FAR, land_s) for land_s in (330, 760, 1_100)),
        *(_departure(rng, NEAR, at_s) for at_s in (-260, -60, 75, 215, 360, 505, 650, 800)),
        *(_departure(rng, FAR, at_s) for at_s in (-140, 260, 560)),
        *_holding(rng),
        *_light(rng),
        *_fast(),
    ]
    return [fly(flight) for flight in _named(flights)]


def _named(flights: list[Flight]) -> Iterator[Flight]:
    """Give each flight an address of the range F00000 on, a callsign BOR, and a Mode A code."""
    shared, shares, changes = 4, 24, 30  # an overflight and an arrival; a departure
    for i, flight in enumerate(flights):
        code = f"{0o2101 + 0o11 * (shared if i == shares else i):04o}"
        identity = {"address": f"{0xF00000 + i:06X}", "callsign": f"BOR{i + 1:03d}", "mode_a": code}
        identity |= {"later_mode_a": "6543"} if i == changes else {}
        yield replace(flight, identity=identity | flight.identity)


def _overflights(rng: np.random.Generator) -> Iterator[Flight]:
    """Cruise: straight, or bending at a waypoint, or changing level; the first passes overhead."""
    count = 18
    for i in range(count):
        speed = rng.uniform(205, 255)
        level = round(rng.uniform(285, 405) / 10) * 10 * 100 * FOOT
        bend = turn(rng.choice([-1, 1]) * rng.uniform(12, 55), speed)
        change = rng.choice([-1, 1]) * rng.uniform(4, 9)
        climb = Leg(2_000 * FOOT / abs(change), climb_mps=change)
        middle = ((), (bend,), (climb,))[i % 3]
        before = Leg(rng.uniform(250, 650))
        away = 0.5e3 if i == 0 else rng.uniform(0, 95e3)
        bearing = rng.uniform(0, 2 * np.pi)
        offset = np.array([away * np.sin(bearing), away * np.cos(bearing), 0.0])
        place = frames.geodetic_from_enu(offset, SITE)
        yield Flight(
            kind="overflight", legs=(before, *middle, Leg(900.0)), start_s=-20.0,
            anchor_s=rng.uniform(250, 650), latitude_deg=float(place.latitude_deg),
            longitude_deg=float(place.longitude_deg), height_m=1.02 * level + 35.0,
            track_deg=rng.uniform(0, 360), speed_mps=speed,
        )  # fmt: skip


def _arrival(rng: np.random.Generator, runway: Runway, land_s: float) -> Flight:
    """Descend in steps, slow down, downwind, base, final at three degrees, touch down."""
    side = rng.choice([-1, 1])
    legs = (
        Leg(rng.uniform(150, 400)),
        Leg(420, climb_mps=-rng.uniform(9, 12)),
        turn(side * rng.uniform(-50, 50), 190, climb_mps=-7.0),
        Leg(rng.uniform(50, 110), accel_mps2=-0.55),
        Leg(150, climb_mps=-rng.uniform(7, 9)),
        Leg(rng.uniform(40, 90)),
        Leg(60, accel_mps2=-0.6, climb_mps=-4.0),
        turn(side * 90, 105),
        Leg(rng.uniform(45, 100), climb_mps=-3.5),
        turn(side * 90, 105),
        Leg(55, accel_mps2=-0.5),
        Leg(125, climb_mps=-3.8),
    )
    total = sum(leg.seconds for leg in legs)
    return Flight(
        kind="arrival", legs=legs, start_s=land_s - total, anchor_s=land_s, lands=True,
        latitude_deg=runway.latitude_deg, longitude_deg=runway.longitude_deg,
        height_m=runway.height_m + 15.0, track_deg=runway.track_deg, speed_mps=70.0,
    )  # fmt: skip


def _departure(rng: np.random.Generator, runway: Runway, at_s: float) -> Flight:
    """Lift off, turn onto course, climb with a level-off on the way, reach cruise."""
    side = rng.choice([-1, 1])
    legs = (
        Leg(50, accel_mps2=0.5, climb_mps=11.0),
        Leg(rng.uniform(10, 40), accel_mps2=0.4, climb_mps=10.0),
        turn(side * rng.uniform(30, 150), 115, climb_mps=8.0),
        Leg(110, accel_mps2=0.5, climb_mps=rng.uniform(9, 12)),
        Leg(rng.uniform(40, 110)),
        turn(side * rng.uniform(-60, 20), 170, climb_mps=6.0),
        Leg(150, accel_mps2=0.3, climb_mps=rng.uniform(9, 13)),
        Leg(rng.uniform(200, 330), climb_mps=rng.uniform(6, 9)),
        Leg(900.0),
    )
    return Flight(
        kind="departure", legs=legs, start_s=at_s, anchor_s=at_s,
        latitude_deg=runway.latitude_deg, longitude_deg=runway.longitude_deg,
        height_m=runway.height_m + 10.0, track_deg=runway.track_deg, speed_mps=78.0,
    )  # fmt: skip


def _holding(rng: np.random.Generator) -> Iterator[Flight]:
    """Four in one stack a thousand feet apart: right turns, minute legs, a step down."""
    for floor in range(4):
        speed = 108.0 + 3 * floor
        down = Leg(60.0, climb_mps=-1_000 * FOOT / 60.0)
        around = (turn(180, speed), Leg(60.0), turn(180, speed), Leg(60.0))
        lower = (turn(180, speed), down, turn(180, speed), Leg(60.0))
        legs = (Leg(rng.uniform(60, 120)), *around, *lower, *around, *around)
        yield Flight(
            kind="holding", legs=legs, start_s=-60.0 - 40.0 * floor, anchor_s=30.0 + 10.0 * floor,
            latitude_deg=HOLD_FIX[0], longitude_deg=HOLD_FIX[1], track_deg=265.0,
            height_m=(8_000 + 1_000 * floor) * FOOT * 1.02 + 35.0, speed_mps=speed,
        )  # fmt: skip


def _light(rng: np.random.Generator) -> Iterator[Flight]:
    """Slow and low, wandering; the second flies survey lines, the last has no Mode S."""
    starts = ((47.70, 1.20), (48.02, 1.10), (47.62, 1.75), (47.95, 1.95), (47.55, 1.25))
    for i, (latitude, longitude) in enumerate(starts):
        speed = rng.uniform(45, 62)
        lines = (Leg(110), turn(180, speed), Leg(110), turn(-180, speed)) * 3
        wander = tuple(
            leg
            for _ in range(6)
            for leg in (
                Leg(rng.uniform(60, 150), climb_mps=rng.uniform(-0.6, 0.6)),
                turn(rng.uniform(-140, 140), speed),
            )
        )
        yield Flight(
            kind="light", legs=(*(lines if i == 1 else wander), Leg(900.0)), start_s=-20.0,
            anchor_s=100.0, latitude_deg=latitude, longitude_deg=longitude,
            height_m=rng.uniform(650, 1_100), track_deg=rng.uniform(0, 360), speed_mps=speed,
            identity={"address": ""} if i == len(starts) - 1 else {},
        )  # fmt: skip


def _fast() -> Iterator[Flight]:
    """Two that turn as hard as 45 degrees of bank allow."""
    for i, (latitude, longitude) in enumerate(((47.25, 2.1), (48.45, 0.85))):
        speed = 185.0 + 20 * i
        hard = tuple(
            leg
            for angle in (95, -170, 60, 200, -120, 90)
            for leg in (
                Leg(70.0, climb_mps=8.0 * (-1) ** i),
                turn(angle, speed, bank_deg=45.0),
                Leg(30.0),
            )
        )
        yield Flight(
            kind="fast", legs=(*hard, Leg(900.0)), start_s=-20.0, anchor_s=0.0,
            latitude_deg=latitude, longitude_deg=longitude, height_m=4_000.0 + 2_500.0 * i,
            track_deg=80.0 + 60.0 * i, speed_mps=speed,
        )  # fmt: skip
