"""Numbers with units, as a study file has them: "0.5 deg", "100 ft", "2 m/s^2", "3 NM", "5 %".

Each kind of quantity has one unit that the models take. The others become it by exact factors and
one rounding, so that "3.6 km/h" is 1 m/s; only a radian is no rational number of degrees.
"""

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

_NUMBER = r"[+-]?(?:[0-9][0-9_]*(?:\.[0-9_]*)?|\.[0-9][0-9_]*)(?:[eE][+-]?[0-9]{1,3})?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*([^\s0-9].*?)?\s*", re.DOTALL)
_LONGEST = 60  # characters; more digits are no measurement, and would be slow to take exactly
_SPELLINGS = {"kt": "kn", "nmi": "NM", "nm": "NM", "°": "deg", "sec": "s"}

_ONE, _FOOT, _RADIAN = Fraction(1), Fraction("0.3048"), Fraction(math.degrees(1.0))
_MILE = Fraction(1852)  # international nautical mile
_GRAVITY = Fraction("9.80665")  # standard: 3rd General Conference on Weights and Measures, 1901


@dataclass(frozen=True)
class Kind:
    """A kind of quantity.

    Attributes:
        name: with its article.
        example: of one.
        units: what each is of the first, which the models take.
    """

    name: str
    example: str
    units: dict[str, Fraction]

    @property
    def unit(self) -> str:
        """The unit that the models take."""
        return next(iter(self.units))

    @property
    def offer(self) -> str:
        """What a user may write."""
        return f'give it in {", ".join(self.units)}, such as "{self.example}"'


LENGTH = Kind(
    "a length",
    "30 m",
    {"m": _ONE, "km": Fraction(1000), "ft": _FOOT, "yd": 3 * _FOOT, "NM": _MILE},
)
ANGLE = Kind("an angle", "0.5 deg", {"deg": _ONE, "rad": _RADIAN, "mrad": _RADIAN / 1000})
TIME = Kind(
    "a time",
    "4 s",
    {"s": _ONE, "ms": Fraction(1, 1000), "min": Fraction(60), "h": Fraction(3600)},
)
SPEED = Kind(
    "a speed",
    "450 kn",
    {
        "m/s": _ONE,
        "km/h": Fraction(1000, 3600),
        "kn": _MILE / 3600,
        "ft/s": _FOOT,
        "ft/min": _FOOT / 60,
    },
)
ACCELERATION = Kind("an acceleration", "2 m/s^2", {"m/s^2": _ONE, "ft/s^2": _FOOT, "g": _GRAVITY})
JERK = Kind("a jerk", "0.1 m/s^3", {"m/s^3": _ONE})
TURN_RATE = Kind("a rate of turn", "3 deg/s", {"deg/s": _ONE, "rad/s": _RADIAN})
TURN_ACCELERATION = Kind(
    "a change of turn rate", "0.1 deg/s^2", {"deg/s^2": _ONE, "rad/s^2": _RADIAN}
)
DRIFT = Kind("a random walk", "1 m/s^0.5", {"m/s^0.5": _ONE, "ft/s^0.5": _FOOT})
SHARE = Kind("a share", "90 %", {"of 1": _ONE, "%": Fraction(1, 100)})
KINDS = (LENGTH, ANGLE, TIME, SPEED, ACCELERATION, JERK, TURN_RATE, TURN_ACCELERATION, DRIFT, SHARE)


def quantity(value: Any, kind: Kind) -> float:
    """The number, in the unit that the models take.

    Args:
        value: text, a number and its unit; of a share a plain number too.
        kind: what it must be.

    Raises:
        ValueError: it is something else; says what, and what is possible.
    """
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind is SHARE and is_number:
        value = f"{value} of 1"
    if is_number and kind is not SHARE:
        raise ValueError("has no unit", kind.offer)
    found = _QUANTITY.fullmatch(value) if isinstance(value, str) and len(value) < _LONGEST else None
    if found is None:
        raise ValueError(f"is not {kind.name}", kind.offer)
    number, unit = found.groups()
    return _rounded(Fraction(number) * _factor(unit, kind), kind)


def _factor(spelled: str | None, kind: Kind) -> Fraction:
    """What the unit is of the models' own."""
    if spelled is None:
        raise ValueError("has no unit", kind.offer)
    unit = spelled.replace("²", "^2").replace("³", "^3").replace("**", "^")
    unit = _SPELLINGS.get(unit, unit)
    if unit in kind.units:
        return kind.units[unit]
    other = next((each.name for each in KINDS if unit in each.units), None)
    if other is None:
        raise ValueError("has a unit that is not known here", kind.offer)
    raise ValueError(f"is {other}, not {kind.name}", kind.offer)


def _rounded(exact: Fraction, kind: Kind) -> float:
    try:
        return float(exact)
    except OverflowError:
        raise ValueError(f"is too large for {kind.name}", "give a finite number") from None
