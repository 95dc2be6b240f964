"""Doppler: frequency and closing speed, and the platform's own share of it taken out.

Paper: bordonaro (3) and (33) to (40).
Differs from it: errata B6, B7, B12 and B13; the platform's share is its speed times the x
coordinate of a unit vector, so the conversions of position serve, in the plane and in space.

A closing speed is minus a range rate (B12). Angles count from where the platform is heading.
"""

from typing import Any

from boresight.maths import Gaussian
from boresight.models.conversions import convert, lookup
from boresight.models.polar import Given

Array = Any
NULLIFICATIONS = {"standard": "conventional", "mucm": "mucm", "ducm": "ducm"}


def closing_speed(received_hz: Any, transmitted_hz: Any, propagation_mps: Any) -> Any:
    """Closing speed, m/s, of what echoes: bordonaro (3), first term.

    The error of a received frequency times the same slope is that of the closing speed:
    `closing_speed(transmitted_hz + sigma_hz, transmitted_hz, propagation_mps)`.

    Args:
        received_hz: frequency of the echo.
        transmitted_hz: frequency sent.
        propagation_mps: speed of the wave.
    """
    return (received_hz - transmitted_hz) * propagation_mps / (2.0 * transmitted_hz)


def received_frequency(closing_mps: Any, transmitted_hz: Any, propagation_mps: Any) -> Any:
    """Frequency of the echo, Hz: the inverse of `closing_speed`."""
    return transmitted_hz * (1.0 + 2.0 * closing_mps / propagation_mps)


def nullify(
    name: str,
    closing_mps: Any,
    angles: Array,
    speed_mps: Any,
    sigma: Array,
    given: Given | None = None,
) -> Gaussian:
    """Closing speed as a platform at rest would measure it.

    Args:
        name: "standard" (36), (38) with B7; "mucm", by analogy with (14) to (18); "ducm" (37)
            with B6, (40).
        closing_mps: measured on the moving platform.
        angles: (1,) bearing, or (2,) azimuth and elevation, from the platform's heading, rad.
        speed_mps: of the platform.
        sigma: (2,) or (3,) standard deviations of `closing_mps` and of each angle.
        given: where the target is thought to be, for "ducm"; its range does not matter. Without
            one the variance is conditioned on the plot.

    Returns:
        Mean and variance, both (); the range rate is minus the mean.
    """
    if given is not None:
        given = Given([1.0, *given.mean[1:]], [0.0, *given.variances[1:]], given.direction)
    ahead = convert(lookup(name, NULLIFICATIONS), [1.0, *angles], [0.0, *sigma[1:]], given)
    variance = sigma[0] * sigma[0] + speed_mps * speed_mps * ahead.cov[0][0]
    return Gaussian(closing_mps - speed_mps * ahead.mean[0], variance)
