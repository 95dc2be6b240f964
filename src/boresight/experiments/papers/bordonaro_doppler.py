"""bordonaro's own Doppler: how much of its error is bias, and the range-rate estimator.

Paper: bordonaro section 4; Figures 13 and 14.
Differs from it: the significance is bias over standard deviation (erratum B8). Speeds are feet a
second, closing speeds positive (erratum B12).
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.experiments.scenario import FOOT_M
from boresight.filters.own_doppler import track_range_rate
from boresight.maths import Gaussian
from boresight.maths.seeds import Stream, normals
from boresight.models.checks import positive
from boresight.models.doppler import closing_speed, received_frequency

Array = Any
STANDARD, STANDARD_PRINTED = "standard", "standard as printed"


class RangeRates(NamedTuple):
    """What the estimator makes of one conversion, (runs, scans) each.

    Attributes:
        error: of the closing speed, ft/s.
        nees: error squared over the variance it claims.
    """

    error: Array
    nees: Array


class Echo(NamedTuple):
    """A platform's speed ft/s, and standard deviations of closing speed ft/s and bearing rad."""

    speed: Any
    sigma: Any
    sigma_bearing: Any


def echo(
    printed: dict[str, Any],
    assumed: dict[str, Any],
    sigma_deg: Any,
    *,
    speed: Any = None,
    sigma_hz: Any = None,
) -> Echo:
    """A figure's sonar, its speed or its frequency noise changed."""
    f, c = _sound(printed, assumed)
    hertz = printed["sigma_hz"] if sigma_hz is None else sigma_hz
    fast = printed["speed_ftps"] if speed is None else speed
    return Echo(fast, closing_speed(f + hertz, f, c / FOOT_M), np.radians(sigma_deg))


def _sound(printed: dict[str, Any], assumed: dict[str, Any]) -> tuple[float, float]:
    """Frequency sent, Hz, and speed of the wave, m/s."""
    return printed["transmitted_hz"], positive("propagation_mps", assumed["propagation_mps"])


def significance(seen: Echo, bearing: Any) -> Any:
    """Bias (34) of the standard conversion over its standard deviation, (35) less the bias squared.

    Args:
        seen: the sonar.
        bearing: from the platform's heading, rad.
    """
    s2, cos = seen.sigma_bearing**2, np.cos(bearing)
    biased = seen.speed * cos * -np.expm1(-s2 / 2.0)
    spread = 0.5 * (1.0 + np.cos(2.0 * bearing) * np.exp(-2.0 * s2)) - cos**2 * np.exp(-s2)
    return biased / np.sqrt(seen.sigma**2 + seen.speed**2 * spread)


def significances(printed: dict[str, Any], assumed: dict[str, Any]) -> dict[str, dict[str, Array]]:
    """Figure 13: by what varies and its value, at each of the assumed bearing noises."""
    sigma = np.array(assumed["significance_sigma_deg"], dtype=float)
    ahead = np.radians(printed["bearing_deg"])
    usual = echo(printed, assumed, sigma)
    return {
        "bearing": {
            f"{b:g}°": significance(usual, np.radians(b))
            for b in assumed["significance_bearings_deg"]
        },
        "platform velocity": {
            f"{v:g} ft/s": significance(echo(printed, assumed, sigma, speed=v), ahead)
            for v in assumed["significance_speeds_ftps"]
        },
        "frequency accuracy": {
            f"{h:g} Hz": significance(echo(printed, assumed, sigma, sigma_hz=h), ahead)
            for h in assumed["significance_sigmas_hz"]
        },
    }


class Pings(NamedTuple):
    """What a sonar on a collision course measures, (runs, scans) each; true bearings (runs, 1)."""

    closing: Array
    bearing: Array
    truth: Array


def pings(
    printed: dict[str, Any], assumed: dict[str, Any], seen: Echo, runs: int, seed: int
) -> Pings:
    """Runs of Figure 14: bearing and closing speed are constant, the bearing drawn."""
    from scipy.special import ndtr

    cell = f"bordonaro doppler {printed['bearings_deg']} {seen.sigma_bearing}"
    drawn = normals(seed, cell, Stream.TRUTH, (1,), runs=runs)
    low, high = np.radians(printed["bearings_deg"])
    bearing = low + (high - low) * ndtr(drawn)
    noise = normals(seed, cell, Stream.NOISE, (int(assumed["doppler_scans"]), 2), runs=runs)
    closing = printed["closing_ftps"] + seen.speed * np.cos(bearing) + seen.sigma * noise[..., 0]
    return Pings(closing, bearing + seen.sigma_bearing * noise[..., 1], bearing)


def range_rates(
    printed: dict[str, Any], assumed: dict[str, Any], seen: Echo, runs: int, seed: int
) -> dict[str, RangeRates]:
    """Every conversion's estimates of the same runs."""
    heard, f, c = pings(printed, assumed, seen, runs, seed), *_sound(printed, assumed)
    found = {}
    for name in (STANDARD, "MUCM", "DUCM"):
        told = track_range_rate(
            received_frequency(heard.closing, f, c / FOOT_M),
            heard.bearing,
            transmitted_hz=f,
            speed_mps=FOOT_M * seen.speed,
            sigma_hz=printed["sigma_hz"],
            sigma_deg=np.degrees(seen.sigma_bearing),
            propagation_mps=c,
            method=name.lower(),
            bearing=assumed["doppler_bearing"],
        )
        closing = Gaussian(-told.range_rate_mps / FOOT_M, told.variance / FOOT_M**2)
        found[name] = _errors(closing, printed)
    literal = _constant(nullified(heard, seen), printed_variance(seen, heard.bearing))
    return found | {STANDARD_PRINTED: _errors(literal, printed)}


def nullified(heard: Pings, seen: Echo, factor: float = 1.0) -> Array:
    """(36); with e^(-s²/2) as factor (37) as printed, with e^(s²/2) as corrected (erratum B6)."""
    return heard.closing - seen.speed * np.cos(heard.bearing) * factor


def printed_variance(seen: Echo, bearing: Array) -> Array:
    """(38), erratum B7."""
    return seen.sigma**2 + seen.speed**2 * np.sin(bearing) ** 2


def _constant(plots: Array, variance: Array) -> Gaussian:
    """The Kalman filter of a constant, from its first plot on: information adds up."""
    information = np.cumsum(1.0 / variance, axis=1)
    return Gaussian(np.cumsum(plots / variance, axis=1) / information, 1.0 / information)


def _errors(closing: Gaussian, printed: dict[str, Any]) -> RangeRates:
    error = closing.mean - printed["closing_ftps"]
    return RangeRates(error, error**2 / closing.cov)
