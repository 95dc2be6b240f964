"""Range rate of a target from the Doppler of its echo, the platform's own share taken out.

Paper: bordonaro section 4.3, (33) to (40).
Differs from it: errata B6, B7, B12 and B13, in `models.doppler`; the bearing that noise is taken at
comes from a bearing filter of its own, or is the one measured before; at the first scan it is the
one measured, as a first plot is converted (erratum B9). Estimates are range rates, positive when
opening, not closing speeds.

Range rate and bearing are constant but for a random walk: what a collision course makes of them.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from boresight.errors import UsageError
from boresight.lanes import Kernel, Rate, Scalar, make_kernel, pack_states, trace
from boresight.maths import Gaussian, missing, select, wrap
from boresight.models.checks import as_number, not_negative, positive, standard_deviation
from boresight.models.conversions import lookup
from boresight.models.doppler import NULLIFICATIONS, closing_speed, nullify
from boresight.models.parameters import rate_of
from boresight.models.polar import Given

Array = Any
BearingSource = Literal["filter", "previous measurement"]
_KEPT = ("closing", "variance", "bearing", "spread", "begun", "heard")
_TOLD = ("range_rate_mps", "variance", "bearing_rad", "bearing_variance")


class RangeRates(NamedTuple):
    """What is known after each scan; NaN before the first.

    Attributes:
        range_rate_mps: (lanes, scans), positive when opening.
        variance: (lanes, scans) of it.
        bearing_rad: (lanes, scans), from the platform's heading.
        bearing_variance: (lanes, scans).
    """

    range_rate_mps: Array
    variance: Array
    bearing_rad: Array
    bearing_variance: Array


def track_range_rate(
    received_hz: Array,
    bearings_rad: Array,
    *,
    transmitted_hz: Any,
    speed_mps: Any,
    sigma_hz: Any,
    sigma_deg: Any,
    propagation_mps: Any = 1500.0,
    drift_mps: Any = 0.0,
    drift_deg: Any = 0.0,
    method: str = "ducm",
    bearing: BearingSource = "filter",
) -> RangeRates:
    """Range rate of each lane's target from received frequencies and bearings.

    Every number may also be (lanes,) or (lanes, scans), each axis 1 long where it is constant.

    Args:
        received_hz: (lanes, scans), NaN where missing.
        bearings_rad: (lanes, scans) from the platform's heading; a frequency without is not used.
        transmitted_hz: frequency sent.
        speed_mps: of the platform.
        sigma_hz: standard deviation of a received frequency.
        sigma_deg: standard deviation of a bearing.
        propagation_mps: speed of the wave; in water by default.
        drift_mps: standard deviation of what the range rate changes by between scans.
        drift_deg: the same of the bearing.
        method: `standard`, `mucm` or `ducm`, see `models.doppler`.
        bearing: where `ducm` takes the noise: at the filtered bearing, or at the one before.

    Raises:
        UsageError: an unknown method or source, arrays that do not fit, or a number that cannot be.
    """
    _check(method, bearing, received_hz, bearings_rad)
    lanes, scans = np.shape(received_hz)
    settings = {
        "transmitted": positive("transmitted_hz", transmitted_hz),
        "speed": as_number("speed_mps", speed_mps),
        "sigma_hz": standard_deviation("sigma_hz", sigma_hz),
        "sigma": np.radians(standard_deviation("sigma_deg", sigma_deg)),
        "propagation": positive("propagation_mps", propagation_mps),
        "drift": not_negative("drift_mps", drift_mps),
        "turn": np.radians(not_negative("drift_deg", drift_deg)),
    }
    rated = {name: rate_of(name, value, Scalar()) for name, value in settings.items()}
    kernel = _kernel(method, bearing, tuple((name, rate) for name, (rate, _) in rated.items()))
    values = {name: value for name, (_, value) in rated.items()}
    values |= {"received": received_hz, "measured": bearings_rad}
    empty = pack_states(kernel.program.state, {name: np.zeros(lanes) for name in _KEPT})
    _, told = kernel.run(empty, values, scans)
    return RangeRates(*(told[name] for name in _TOLD))


def _check(method: str, bearing: str, received: Array, bearings: Array) -> None:
    lookup(method, NULLIFICATIONS)
    if bearing not in get_args(BearingSource):
        raise UsageError(
            f"bearing={bearing!r} is unknown",
            next_step=f"use one of {', '.join(get_args(BearingSource))}",
        )
    if np.ndim(received) != 2 or np.shape(received) != np.shape(bearings):
        raise UsageError(
            f"frequencies are {np.shape(received)} and bearings {np.shape(bearings)}",
            why="both must be (lanes, scans)",
        )


@lru_cache(maxsize=32)
def _kernel(method: str, bearing: str, rates: tuple[tuple[str, Rate], ...]) -> Kernel:
    inputs = {"received": (Scalar(), Rate.EACH), "measured": (Scalar(), Rate.EACH)}
    return make_kernel(
        trace(
            _step(method, bearing),
            state=dict.fromkeys(_KEPT, Scalar()),
            inputs=inputs | {name: (Scalar(), rate) for name, rate in rates},
            outputs=dict.fromkeys(_TOLD, (Scalar(), Rate.EACH)),
        )
    )


def _step(method: str, source: str) -> Callable[..., tuple[Any, Any]]:
    """One scan of one lane: the formula that is recorded."""

    def step(state: Mapping[str, Any], inputs: Mapping[str, Any]) -> tuple[Any, Any]:
        s2, heard, begun = inputs["sigma"] * inputs["sigma"], state["heard"], state["begun"]
        bearing = Gaussian(state["bearing"], state["spread"] + inputs["turn"] * inputs["turn"])
        closing = Gaussian(state["closing"], state["variance"] + inputs["drift"] * inputs["drift"])
        found = _nullified(method, heard, bearing, inputs)
        closing = _followed(closing, begun, found.mean - closing.mean, found.cov)
        off = wrap(inputs["measured"] - bearing.mean)
        bearing = _followed(bearing, heard if source == "filter" else 0.0, off, s2)
        begun = select(missing(found.mean), begun, 1.0)
        heard = select(missing(off), heard, 1.0)
        kept = (*closing, bearing.mean, bearing.cov, begun, heard)
        told = (-closing.mean, closing.cov, wrap(bearing.mean), bearing.cov)
        shown = [
            select(known < 0.5, np.nan, value)
            for known, value in zip((begun, begun, heard, heard), told, strict=True)
        ]
        return dict(zip(_KEPT, kept, strict=True)), dict(zip(_TOLD, shown, strict=True))

    return step


def _nullified(method: str, heard: Any, where: Gaussian, inputs: Mapping[str, Any]) -> Gaussian:
    """Closing speed of a platform at rest; NaN where frequency or bearing is missing."""
    sent, wave = inputs["transmitted"], inputs["propagation"]
    closing = closing_speed(inputs["received"], sent, wave)
    noise = closing_speed(sent + inputs["sigma_hz"], sent, wave), inputs["sigma"]
    given = Given([1.0, where.mean], [0.0, where.cov])
    known, first = (
        nullify(method, closing, [inputs["measured"]], inputs["speed"], noise, place)
        for place in (given, None)
    )
    return Gaussian(known.mean, select(heard > 0.5, known.cov, first.cov))


def _followed(before: Gaussian, known: Any, off: Any, noise: Any) -> Gaussian:
    """Scalar Kalman filter; where nothing was known the measurement is taken as it is."""
    gone = missing(off)
    gain = select(known > 0.5, before.cov / (before.cov + noise), 1.0)
    mean = before.mean + select(gone, 0.0, gain * off)
    return Gaussian(mean, select(gone, before.cov, gain * noise))
