"""Range, bearing, course and speed as a reader likes them: km, degrees, m/s with knots beside."""

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from boresight.maths.digits import decimals

if TYPE_CHECKING:
    from boresight.target_motion.result import Quantity

KNOT_MPS = 1852.0 / 3600.0
METRES_BELOW = 1_000.0
MANY = 3  # pieces of a region
ANY_DEG = 355.0  # an angle's region as wide as this says nothing


class Kind(NamedTuple):
    """One quantity of the answer: its stem and unit in columns, its unit here, and their ratio."""

    stem: str
    suffix: str
    unit: str
    scale: float

    @property
    def name(self) -> str:
        """Its column, and its field in the answer."""
        return f"{self.stem}_{self.suffix}"

    @property
    def sd(self) -> str:
        """The column of its standard deviation."""
        return f"{self.stem}_sd_{self.suffix}"

    @property
    def bound(self) -> str:
        """The column of its Cramér-Rao bound."""
        return f"{self.stem}_bound_{self.suffix}"

    @property
    def is_angle(self) -> bool:
        """Whether it goes round in a circle."""
        return self.unit == "°"


RANGE = Kind("range", "m", "km", 1e-3)
BEARING = Kind("bearing", "deg", "°", 1.0)
COURSE = Kind("course", "deg", "°", 1.0)
SPEED = Kind("speed", "mps", "m/s", 1.0)
METRES = Kind("range", "m", "m", 1.0)
KINDS = (RANGE, BEARING, COURSE, SPEED)


def near(kind: Kind, value: float) -> Kind:
    """Return the kind to show a value in: ranges below 1 km in metres."""
    return METRES if kind is RANGE and abs(value) < METRES_BELOW else kind


def bare(kind: Kind, value: float, sd: float) -> str:
    """Render a value to the digits that its sd is worth, without its unit: `072.4`."""
    places = decimals(sd * kind.scale)
    if kind.is_angle:
        turned = round(value % 360.0, places) % 360.0
        return f"{turned:0{places + 4 if places else 3}.{places}f}"
    return f"{value * kind.scale:,.{places}f}"


def with_unit(kind: Kind, text: str) -> str:
    """Put the unit behind a figure."""
    return text + (kind.unit if kind.is_angle else f" {kind.unit}")


def estimate(kind: Kind, found: "Quantity") -> str:
    """Render `3.71 ± 0.04 km`; a dash where nothing can be said."""
    if found.estimate is None or found.sd is None:
        return "–"
    kind = near(kind, found.estimate)
    sd = f"{found.sd * kind.scale:,.{decimals(found.sd * kind.scale)}f}"
    return with_unit(kind, f"{bare(kind, found.estimate, found.sd)} ± {sd}")


def region(kind: Kind, found: "Quantity", level: str = "90") -> str:
    """Render a credible region: `2.1 to 4.0 km or 5.5 to 9.0 km`; empty where there is none."""
    return " or ".join(_pieces(kind, found, level))


def _pieces(kind: Kind, found: "Quantity", level: str) -> list[str]:
    pieces = found.regions.get(level, ())
    width = sum(high - low for low, high in pieces)
    if kind.is_angle and width >= ANY_DEG:
        return [f"any {kind.stem}"]
    kind = near(kind, max((high for _, high in pieces), default=0.0))
    ends: list[list[str]] = []
    for piece in pieces:
        low, high = (bare(kind, end, width / 4.0 or 1.0) for end in piece)
        if ends and ends[-1][1] == low:  # a gap that the digits do not show
            ends[-1][1] = high
        else:
            ends.append([low, high])
    return [with_unit(kind, f"{low} to {high}") for low, high in ends]


def hull(kind: Kind, found: "Quantity", level: str = "90") -> str:
    """Render a region whose pieces are many by its ends: `1.1 to 10.2 km, in 5 pieces`."""
    pieces, count = found.regions.get(level, ()), len(_pieces(kind, found, level))
    if count < MANY:
        return region(kind, found, level)
    whole = replace(found, regions={level: ((pieces[0][0], pieces[-1][1]),)})
    return f"{region(kind, whole, level)}, in {count} pieces"


def knots(speed_mps: float, sd_mps: float) -> str:
    """Render a speed in knots."""
    return f"{speed_mps / KNOT_MPS:.{decimals(sd_mps / KNOT_MPS)}f} kn"


def seconds(time_s: float | None) -> str:
    """Render a time of the file's clock: `1,148 s`."""
    return "never" if time_s is None else f"{time_s:,.10g} s"
