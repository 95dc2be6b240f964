"""The demo's sky: fifty-one flights of our own invention around an invented radar.

Overflights, arrivals and departures at two airports, a stack that holds, light aircraft and two
that turn hard. No route, airport, address or callsign is anybody's.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from boresight.maths import frames
from demo_flight import FOOT, SITE, Flight, Leg, Path, fly, turn

CODE_CHANGE_S = 450.0  # when one departure is given another Mode A code


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
