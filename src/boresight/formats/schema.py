"""The columns that tables of each kind have, their units at the door and what is possible."""

from dataclasses import dataclass
from typing import NamedTuple

FOOT_M = 0.3048
NAUTICAL_MILE_M = 1852.0
DEGREE = 57.29577951308232

_LENGTHS = {"m": 1.0, "km": 1000.0, "nm": NAUTICAL_MILE_M, "ft": FOOT_M}
_HEIGHTS = {"m": 1.0, "km": 1000.0, "ft": FOOT_M, "fl": 100 * FOOT_M}
_ANGLES = {"deg": 1.0, "rad": DEGREE}
_SPEEDS = {"mps": 1.0, "kt": NAUTICAL_MILE_M / 3600, "kmh": 1 / 3.6}
_TIMES = {"s": 1.0, "ms": 1e-3}


class Quantity(NamedTuple):
    """A number with a unit: our column's unit first, and what the others are in it."""

    units: dict[str, float]
    low: float
    high: float


# Stem of the column's name -> units and bounds in the first of them.
QUANTITIES: dict[str, Quantity] = {
    "time": Quantity(_TIMES, -1e12, 1e12),
    "range": Quantity(_LENGTHS, 0.0, 1e9),
    "azimuth": Quantity(_ANGLES, 0.0, 360.0),
    "elevation": Quantity(_ANGLES, -90.0, 90.0),
    "range_rate": Quantity(_SPEEDS, -1e5, 1e5),
    "pressure_altitude": Quantity(_HEIGHTS, -1_000.0, 50_000.0),
    "height": Quantity(_HEIGHTS, -12_000.0, 1e8),
    "ground_speed": Quantity(_SPEEDS, 0.0, 1e5),
    "true_track": Quantity(_ANGLES, 0.0, 360.0),
    "roll": Quantity(_ANGLES, -180.0, 180.0),
    "latitude": Quantity(_ANGLES, -90.0, 90.0),
    "longitude": Quantity(_ANGLES, -180.0, 360.0),
    "bearing": Quantity(_ANGLES, -720.0, 720.0),
    "bearing_magnetic": Quantity(_ANGLES, -720.0, 720.0),
    "bearing_relative": Quantity(_ANGLES, -720.0, 720.0),
    "tdoa": Quantity(_TIMES, -100.0, 100.0),
    "course": Quantity(_ANGLES, -720.0, 720.0),
    "heading": Quantity(_ANGLES, -720.0, 720.0),
    "axis": Quantity(_ANGLES, -720.0, 720.0),
    "speed": Quantity(_SPEEDS, 0.0, 1e4),
    "north": Quantity(_LENGTHS, -1e9, 1e9),
    "east": Quantity(_LENGTHS, -1e9, 1e9),
    "x": Quantity(_LENGTHS, -1e9, 1e9),
    "y": Quantity(_LENGTHS, -1e9, 1e9),
    "accuracy": Quantity(_LENGTHS, 0.0, 1e9),
    "age": Quantity(_TIMES, -1e6, 1e6),
    "sigma_range": Quantity(_LENGTHS, 0.0, 1e9),
    "sigma_azimuth": Quantity(_ANGLES, 0.0, 360.0),
    "sigma_elevation": Quantity(_ANGLES, 0.0, 360.0),
    "sigma": Quantity(_ANGLES, 0.0, 360.0),
    "sigma_tdoa": Quantity(_TIMES, 0.0, 100.0),
    "array_spacing": Quantity(_LENGTHS, 0.0, 1e5),
    "sound_speed": Quantity(_SPEEDS, 1.0, 1e4),
}
OUR_NAMES = {stem: f"{stem}_{next(iter(q.units))}" for stem, q in QUANTITIES.items()}

TEXTS = ("sensor", "address", "mode_a", "aircraft_id", "report_type", "target")
FLAGS = (
    "altitude_valid",
    "mode_a_valid",
    "simulated",
    "test",
    "fixed_transponder",
    "conical",
    "magnetic",
    "on_ground",
)


@dataclass(frozen=True, slots=True)
class Kind:
    """What a table of one kind must have, and whether its times must not decrease."""

    name: str
    required: tuple[str, ...]
    in_order: bool = True


PLOTS = Kind("plots", ("time_s", "range_m", "azimuth_deg"))
REFERENCE = Kind("reference", ("time_s", "latitude_deg", "longitude_deg"), in_order=False)
BEARINGS = Kind("bearings", ("time_s", "bearing_deg"), in_order=False)
OWN_SHIP = Kind("own ship", ("time_s", "latitude_deg", "longitude_deg"), in_order=False)


class Source(NamedTuple):
    """The file's column that holds one of ours, and what makes our unit of it."""

    ours: str
    theirs: str
    factor: float


def sources(names: list[str], wanted: dict[str, str]) -> list[Source]:
    """Find our quantities among a file's columns.

    Args:
        names: the file's columns.
        wanted: our name, in any unit, to the file's: {"range_nm": "rng"}.

    Returns:
        One entry for each quantity found: by the map, by our own name, or by its name in another
        unit (range_nm, azimuth_rad), in this order.
    """
    by_name = {name: name for name in names} | wanted
    found = []
    for stem, quantity in QUANTITIES.items():
        spellings = {f"{stem}_{unit}": factor for unit, factor in quantity.units.items()}
        for spelling in sorted(spellings, key=lambda name: name not in wanted):
            if spelling in by_name:
                found.append(Source(OUR_NAMES[stem], by_name[spelling], spellings[spelling]))
                break
    return found


def is_our_name(name: str) -> bool:
    """Tell whether a column map may name this column."""
    stem, _, unit = name.rpartition("_")
    return name in TEXTS or name in FLAGS or unit in QUANTITIES.get(stem, _NOTHING).units


_NOTHING = Quantity({}, 0.0, 0.0)
