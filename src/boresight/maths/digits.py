"""As many digits of an estimate as its standard deviation is worth."""

import math


def decimals(sd: float) -> int:
    """Digits after the point that are worth showing: two of an sd up to 35, else one."""
    known = math.isfinite(sd) and sd > 0
    return min(max(math.ceil(-math.log10(sd / 3.5)), 0), 6) if known else 3


def with_unit(value: float, places: int, unit: str) -> str:
    """Render a signed number to so many places, its unit after it: `+0.250°`, `-3.1 m`."""
    return f"{value:+z,.{places}f}" + (unit if unit == "°" else f" {unit}")


def rounded(value: float) -> str:
    """Render a size to two digits, thousands parted: `79`, `1,300`."""
    places = 1 - math.floor(math.log10(abs(value))) if math.isfinite(value) and value else 0
    return f"{round(value, places):,.{max(places, 0)}f}"
