"""Systematic errors of a radar: what each does to a plot, and an estimate of them all.

Every error is measured minus true. A term is linear in its own number, so one table of effects
serves the fit (`calibration`), the correction of plots, and a filter that carries what is left of
the errors' uncertainty. Positions are relative to the radar, in its own frame (x = North, y = East,
z = up); effects run on floats, on arrays (component first) and on symbols.

    range_bias_m         added to every slant range
    range_gain_m_per_km  added per kilometre of slant range
    azimuth_bias_deg     added to every azimuth
    azimuth_cos_deg      eccentricity of the encoder: times the cosine of the azimuth,
    azimuth_sin_deg      and times its sine
    time_bias_s          the plot's time minus the time at which it was measured
    elevation_bias_deg   added to every elevation
    site_east_m, site_north_m   where the antenna really is minus where it is said to be
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.maths import select, wrap

Array = Any
CHANNELS = ("range_m", "azimuth_rad", "elevation_rad")
_DEGREE, _TURN = np.pi / 180.0, 2.0 * np.pi
_FLOOR = 1e-6  # m²: a target at the radar, or right above it, still has finite effects
_ROUNDS = 3  # of taking the errors out at the corrected place: each leaves a hundredth or less


class Term(NamedTuple):
    """A kind of systematic error.

    Attributes:
        words: for a reader.
        unit: for a reader.
        scale: as large as it may be in a radar that works, in its unit: the standard deviation of
            what is believed of it before any plot is seen.
    """

    words: str
    unit: str
    scale: float


TERMS: dict[str, Term] = {
    "range_bias_m": Term("range bias", "m", 1_000.0),
    "range_gain_m_per_km": Term("range gain", "m/km", 10.0),
    "azimuth_bias_deg": Term("azimuth bias", "°", 5.0),
    "azimuth_cos_deg": Term("azimuth eccentricity, cosine", "°", 1.0),
    "azimuth_sin_deg": Term("azimuth eccentricity, sine", "°", 1.0),
    "time_bias_s": Term("time bias", "s", 10.0),
    "elevation_bias_deg": Term("elevation bias", "°", 5.0),
    "site_east_m": Term("site offset, east", "m", 1_000.0),
    "site_north_m": Term("site offset, north", "m", 1_000.0),
}


def effects(term: str, p: Array, v: Array) -> dict[str, Any]:
    """What one unit of a term adds to each channel of a plot.

    Args:
        term: of `TERMS`.
        p: (3, ...) position relative to the radar: north, east, up, m.
        v: (3, ...) velocity, m/s.

    Returns:
        By channel, in m or rad; a channel that the term does not touch is absent.
    """
    ground2 = p[0] * p[0] + p[1] * p[1]
    ground2 = select(ground2 < _FLOOR, _FLOOR, ground2)
    ground, r = np.sqrt(ground2), np.sqrt(ground2 + p[2] * p[2])
    if term == "range_bias_m":
        return {"range_m": r * 0.0 + 1.0}
    if term == "range_gain_m_per_km":
        return {"range_m": r / 1_000.0}
    if term == "azimuth_bias_deg":
        return {"azimuth_rad": ground * 0.0 + _DEGREE}
    if term == "azimuth_cos_deg":
        return {"azimuth_rad": _DEGREE * p[0] / ground}
    if term == "azimuth_sin_deg":
        return {"azimuth_rad": _DEGREE * p[1] / ground}
    if term == "elevation_bias_deg":
        return {"elevation_rad": ground * 0.0 + _DEGREE}
    if term in _MOVES:
        moved = _MOVES[term](v)
        return _moved(moved, p, ground, ground2, r)
    raise unknown("term of systematic error", term, TERMS)


# What one unit of a term moves the target by, as the radar sees it (north, east, up).
_MOVES = {
    "time_bias_s": lambda v: (-v[0], -v[1], -v[2]),
    "site_east_m": lambda v: (v[0] * 0.0, v[1] * 0.0 - 1.0, v[2] * 0.0),
    "site_north_m": lambda v: (v[0] * 0.0 - 1.0, v[1] * 0.0, v[2] * 0.0),
}


def _moved(step: Sequence[Any], p: Array, ground: Any, ground2: Any, r: Any) -> dict[str, Any]:
    """First-order change of each channel when the target moves by `step`."""
    outward = (p[0] * step[0] + p[1] * step[1]) / ground
    return {
        "range_m": (p[0] * step[0] + p[1] * step[1] + p[2] * step[2]) / r,
        "azimuth_rad": (p[0] * step[1] - p[1] * step[0]) / ground2,
        "elevation_rad": (ground * step[2] - p[2] * outward) / (r * r),
    }


def design(terms: Sequence[str], channels: Sequence[str], p: Array, v: Array) -> Array:
    """Effect of every term on every channel.

    Args:
        terms: of `TERMS`.
        channels: of `CHANNELS`.
        p: (m, 3) positions relative to the radar, m: north, east, up.
        v: (m, 3) velocities, m/s.

    Returns:
        (m, channels, terms).
    """
    place, speed = np.moveaxis(p, -1, 0), np.moveaxis(v, -1, 0)
    rows = [effects(term, place, speed) for term in terms]
    zero = np.zeros(place.shape[1:])
    return np.stack(
        [np.stack([row.get(channel, zero) for row in rows], axis=-1) for channel in channels],
        axis=-2,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class SystematicErrors:
    """An estimate of a radar's systematic errors.

    Attributes:
        terms: (n names) of `TERMS`.
        estimate: (n,) in the terms' units.
        cov: (n, n) joint covariance.
    """

    terms: tuple[str, ...]
    estimate: Array
    cov: Array

    def __post_init__(self) -> None:
        """Terms must be known and named once, numbers finite and of their shape."""
        for term in self.terms:
            if term not in TERMS:
                raise unknown("term of systematic error", term, TERMS)
        n = len(self.terms)
        if len({*self.terms}) < n:
            raise UsageError(f"a term of systematic error comes twice: {', '.join(self.terms)}")
        for name, shape in (("estimate", (n,)), ("cov", (n, n))):
            array = np.asarray(getattr(self, name), dtype=float)
            if array.shape != shape or not np.isfinite(array).all():
                raise UsageError(
                    f"{name} of systematic errors has shape {array.shape} or holds what is no "
                    "number",
                    why=f"its terms are {', '.join(self.terms)}",
                )
            object.__setattr__(self, name, array)

    def value(self, term: str) -> float:
        """Estimate of a term; 0 if it was not estimated."""
        return float(self.estimate[self.terms.index(term)]) if term in self.terms else 0.0

    def corrected(self, z: Mapping[str, Array]) -> dict[str, Array]:
        """Plots without the errors of range, azimuth and elevation.

        Time and site are not a plot's to correct: subtract `value("time_bias_s")` from its time,
        and add the site offset to the site.

        Args:
            z: by channel of `CHANNELS`, arrays (m,) in m and rad.

        Returns:
            The same channels; azimuths in [0, 2 pi).
        """
        clean = {name: np.asarray(value, dtype=float) for name, value in z.items()}
        if "range_m" in clean:
            gain = 1.0 + self.value("range_gain_m_per_km") / 1_000.0
            clean["range_m"] = (clean["range_m"] - self.value("range_bias_m")) / gain
        if "azimuth_rad" in clean:
            clean["azimuth_rad"] = self._azimuth(clean["azimuth_rad"])
        if "elevation_rad" in clean:
            bias = self.value("elevation_bias_deg") * _DEGREE
            clean["elevation_rad"] = wrap(clean["elevation_rad"] - bias)
        return clean

    def _azimuth(self, measured: Array) -> Array:
        """True azimuths: the eccentricity belongs to the true one, so it is found in rounds."""
        bias, cosine, sine = (self.value(f"azimuth_{name}_deg") for name in ("bias", "cos", "sin"))
        true = measured
        for _ in range(_ROUNDS):
            error = bias + cosine * np.cos(true) + sine * np.sin(true)
            true = measured - error * _DEGREE
        turned = true % _TURN
        return np.where(turned == _TURN, 0.0, turned)  # of a hair below zero the rest is a turn
