"""What a user types, turned into what the floors below take; a mistake is named with its cure."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.errors import OutputError, UsageError, unknown

if TYPE_CHECKING:
    from boresight.filters.method import Filter, FilterLike
    from boresight.maths.frames import Site
    from boresight.models.atmosphere import Atmosphere
    from boresight.target_motion.result import Criteria


def site(text: str) -> "Site":
    """Read `LAT,LON,H`: degrees, degrees, metres above the ellipsoid.

    Raises:
        UsageError: not three numbers, or no place on Earth.
    """
    from boresight.maths.frames import Site

    try:
        latitude, longitude, height = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(
            f"--site {text!r} is not three numbers parted by commas",
            next_step="give degrees, degrees and metres above the ellipsoid, north and east "
            "positive: --site 41.3007,2.1021,27.3",
        ) from None
    return Site(latitude_deg=latitude, longitude_deg=longitude, height_m=height)


def place(given: "Site | tuple[float, float, float] | None") -> "Site | None":
    """A site, or latitude, longitude (degrees) and height (m) as one.

    Raises:
        UsageError: not three numbers, or no place on Earth.
    """
    from boresight.maths.frames import Site

    if given is None or isinstance(given, Site):
        return given
    try:
        latitude, longitude, height = (float(each) for each in given)
    except (TypeError, ValueError):
        raise UsageError(
            f"the site {given!r} is not three numbers",
            next_step="give (latitude_deg, longitude_deg, height_m), north and east positive",
        ) from None
    return Site(latitude_deg=latitude, longitude_deg=longitude, height_m=height)


def atmosphere(given: "str | Atmosphere | None") -> "Atmosphere | None":
    """The air of that name, None for none; or the air itself.

    Raises:
        UsageError: no such air.
    """
    from boresight.models.atmosphere import atmosphere as named

    return named(given) if isinstance(given, str) else given


# What a user may write for terms of systematic error, beside their full names.
SHORT_TERMS = {
    "range": ("range_bias_m",),
    "gain": ("range_gain_m_per_km",),
    "azimuth": ("azimuth_bias_deg",),
    "eccentricity": ("azimuth_cos_deg", "azimuth_sin_deg"),
    "time": ("time_bias_s",),
    "elevation": ("elevation_bias_deg",),
    "site": ("site_east_m", "site_north_m"),
}


def terms(text: str) -> tuple[str, ...]:
    """Read terms of systematic error, parted by commas: `range,azimuth,time`.

    Raises:
        UsageError: no such term, or one named twice.
    """
    from boresight.models.systematic import TERMS

    found: list[str] = []
    for name in (part.strip() for part in text.split(",")):
        if name not in SHORT_TERMS and name not in TERMS:
            raise unknown("term of systematic error", name, [*SHORT_TERMS, *TERMS])
        found += SHORT_TERMS.get(name, (name,))
    if len(set(found)) < len(found):
        raise UsageError(f"--terms {text!r} names a term twice", next_step="name each once")
    return tuple(found)


def sensor(text: str, known: Sequence[str]) -> str:
    """Find the sensor a user means among those of a recording: `20/129`, or `020/129`.

    Raises:
        UsageError: the recording has no such sensor.
    """
    parts = text.split("/")
    is_code = len(parts) == 2 and all(part.isdecimal() for part in parts)
    name = "/".join(str(int(part)) for part in parts) if is_code else text
    if name not in known:
        raise UsageError(
            f"no plot is from sensor {text!r}",
            why=f"the recording has {', '.join(known) or 'none'}",
            next_step=f"--sensor {known[0]}" if known else "boresight inspect FILE",
        )
    return name


FILTER, ALL = "mekf", "all"


def filters(given: "Sequence[FilterLike]") -> "tuple[list[Filter], bool]":
    """Read filters, or their names, one or several parted by commas, `all` among them or not.

    Returns:
        The filters in the order they were given, the first to be tracked with, and whether `all`
        was said: the rest of our own then follows, as far as it can take the plots.

    Raises:
        UsageError: a name that the catalogue does not have, or has been said before.
    """
    from boresight import catalogue

    said: list[Any] = []
    for each in given:
        said += [name.strip() for name in each.split(",")] if isinstance(each, str) else [each]
    chosen = [catalogue.lookup(each) for each in said if each != ALL]
    named = [each.name for each in chosen]
    twice = next((name for i, name in enumerate(named) if name in named[:i]), None)
    if twice:
        raise UsageError(
            f"the filter {twice!r} is named twice",
            next_step=f"--filter {','.join(dict.fromkeys(named))}",
        )
    if ALL in said:
        chosen = chosen or [catalogue.lookup(FILTER)]
        named = [each.name for each in chosen]
        chosen += [catalogue.lookup(name) for name in catalogue.OWN if name not in named]
    return chosen, ALL in said


def columns(text: str, option: str = "--columns") -> dict[str, str]:
    """Read `OURS=THEIRS,...`: which column of a table holds what.

    Raises:
        UsageError: a part without an equals sign.
    """
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(ours.strip() and theirs.strip() for ours, _, theirs in pairs):
        raise UsageError(
            f"{option} {text!r} is not OURS=THEIRS, parted by commas",
            next_step=f"for example: {option} time_s=t,range_m=rng,azimuth_deg=az"
            if option == "--columns"
            else f"for example: {option} time_s=t,latitude_deg=lat,longitude_deg=lon",
        )
    return {ours.strip(): theirs.strip() for ours, _, theirs in pairs}


def assumptions(texts: Sequence[str]) -> dict[str, Any]:
    """Read `NAME=VALUE`, the value a number, a list in brackets or a text.

    Raises:
        UsageError: no equals sign.
    """
    pairs = [text.partition("=") for text in texts]
    for text, (name, _, value) in zip(texts, pairs, strict=True):
        if not (name.strip() and value.strip()):
            raise UsageError(
                f"--assume {text!r} is not NAME=VALUE", next_step="for example: --assume dt_s=2"
            )
    return {name.strip(): _value(value.strip()) for name, _, value in pairs}


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def folder(path: Path) -> Path:
    """Make a folder for results, before any work is done for them.

    Raises:
        OutputError: it cannot be made, or nothing can be written into it.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".boresight-probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"results cannot be written to {path}",
            why=error.strerror or str(error),
            next_step="name a folder you may write to, with -o DIR",
        ) from error
    return path


def ranges(text: str) -> tuple[float, float]:
    """Read `NEAREST,FARTHEST`, in metres.

    Raises:
        UsageError: not two numbers.
    """
    try:
        nearest, farthest = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(
            f"--ranges {text!r} is not two numbers parted by a comma",
            next_step="give metres, the nearest first: --ranges 500,30000",
        ) from None
    return nearest, farthest


# What a user writes for the limits of convergence, and their names.
LIMITS = {
    "range": "range_percent",
    "bearing": "bearing_deg",
    "course": "course_deg",
    "speed": "speed_mps",
    "confidence": "confidence",
}


def limits(text: str) -> "Criteria":
    """Read when an answer has converged: `range=10,bearing=0.5`; the rest stays as usual.

    Raises:
        UsageError: an unknown name, or what is no number or out of range.
    """
    from boresight.target_motion.result import Criteria

    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (each.strip() for each in part.partition("="))
        if name not in LIMITS:
            raise unknown("limit", name, LIMITS)
        try:
            found[LIMITS[name]] = float(value)
        except ValueError:
            raise UsageError(
                f"--limits: {name}={value!r} is not a number",
                next_step="for example: --limits range=10,course=5",
            ) from None
    return Criteria(**found)
