"""Error models: what a sensor's error is taken to be, and what is made of it. Frozen data.

Paper: kashyap section 2.1, (4) and (5).
Differs from it: the paper says neither what the error's process noise is, nor which estimate
corrects a plot, nor what happens without a reference, nor how R is windowed: each is a field of
`ErrorModel`. `MODELS` names whole readings:

    kashyap              an error with a rate, Q = 0.25 in every channel's unit, corrected by the
                         estimate of the same scan, R of the last 10 differences: what comes
                         nearest to the paper's tables
    random walk          a bias that drifts, taken off as predicted and only as far as it is proven
    random walk, always  the same bias, taken off from the first reference on

What decided between them, on Set 2. Numbers are errors over those of the same filter on plots
without bias, of 400 runs.
- The estimate of the same scan contains that scan's reference, which so reaches the tracker: where
  there is no bias it leaves 0.52, half the bound of any filter that sees the radar alone.
- In 100 s without a reference that estimate runs away with its rate, to 105. A bias of 1 to 2
  standard deviations of a plot, held as it was, leaves 1.02 to 1.03.
- A bias learnt from 50 references is uncertain by 0.14 standard deviations, more than a 10 Hz
  tracker is. Taken off where none is there it leaves 1.8; against odds of 10 to 1 or 100 to 1,
  1.00. The doubt costs time where there is one: over scans 20 to 250, biases of 2, 1, 0.5
  and 0.25 standard deviations leave 1.01, 1.02, 1.07 and 1.15.
- A bias of 2 that steps in late leaves 2.5 after 200 scans if it may only drift, and 1.0 with the
  alarm.
"""

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args, get_origin

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.models.checks import as_number

_LONGEST = 200  # differences of a window: its sums are written out in the kernel


@dataclass(frozen=True, kw_only=True)
class ErrorModel:
    """What a sensor's error is taken to be, and what is made of it.

    Attributes:
        frame: of the channels: range and angles (EMEKF), or the track frame's axes (ECMKF).
        state: an error that drifts, or one whose rate drifts.
        drift_m, drift_deg: of a bias, by how much it changes in a second, as a random walk
            (standard deviation, m/√s and °/√s); of a rate, its acceleration (m/s², °/s²).
        spread: of the error before the first reference, in standard deviations of a plot.
        rate_spread: of its rate, in standard deviations of a plot each second.
        odds: against there being a bias at all. References change them, and a plot is corrected
            by the share of the error that they make probable. Where there is none, they ever
            become even in at most one of `odds` channels (without alarms). None: by all of it.
        alarm: at which sum of normalised innovations (Page's test) an error is taken to have
            changed, and is sought anew from its widest spread; positive. By mistake that is once
            in some exp(alarm + 1.17) references of a channel, 9,500 at 8. None: it only drifts.
        correction: what corrects a plot: the error as predicted, as estimated with the same scan's
            reference (which so leaks into the plot), or nothing.
        outage: what corrects where the reference is missing: the error as it was last, as its
            model moves it, or nothing. Its variance grows in any case.
        window: differences that the noise of plots is estimated from, 2 to 200; the reference's
            own noise is in them. None: it is the sensor's.
        warm_up: differences before that estimate is used; None: a full window.
        floor: share of the sensor's own covariance in the estimate, which is never below it.
        noise: whether covariances between channels are dropped or kept.
        source: what the window holds: reference minus plot, or what that is off the error as
            predicted (innovation) or as estimated (residual).
        reference_m: standard deviation of the reference, along each axis.
    """

    frame: Literal["polar", "cartesian"] = "polar"
    state: Literal["bias", "rate"] = "bias"
    drift_m: float = 0.05
    drift_deg: float = 0.0005
    spread: float = 10.0
    rate_spread: float = 0.1
    odds: float | None = 100.0
    alarm: float | None = 8.0
    correction: Literal["prediction", "same epoch", "none"] = "prediction"
    outage: Literal["hold", "coast", "zero"] = "hold"
    window: int | None = None
    warm_up: int | None = None
    floor: float = 0.0
    noise: Literal["diagonal", "full"] = "diagonal"
    source: Literal["difference", "innovation", "residual"] = "difference"
    reference_m: float = 0.0

    def __post_init__(self) -> None:
        """Numbers become floats, and what cannot be is refused."""
        for field in fields(self):
            value = getattr(self, field.name)
            if get_origin(field.type) is Literal and value not in get_args(field.type):
                raise UsageError(
                    f"{field.name}={value!r} is unknown",
                    next_step=f"use one of {', '.join(get_args(field.type))}",
                )
            if field.type is float or (field.type == float | None and value is not None):
                object.__setattr__(self, field.name, _finite(field.name, value))
        if not np.all(np.asarray(self.floor) <= 1.0):
            raise UsageError(f"floor={self.floor!r} is no share", why="it lies between 0 and 1")
        if self.alarm is not None and not np.all(np.asarray(self.alarm) > 0.0):
            raise UsageError(
                f"alarm={self.alarm!r} would be raised at every reference",
                next_step="give a positive limit, or None for no alarm",
            )
        self._check_window()

    def _check_window(self) -> None:
        for name in ("window", "warm_up"):
            value = getattr(self, name)
            if isinstance(value, np.integer):
                object.__setattr__(self, name, int(value))
            elif value is not None and (isinstance(value, bool) or not isinstance(value, int)):
                raise UsageError(f"{name}={value!r} is no whole number of differences")
            if value is not None and not 2 <= value <= _LONGEST:
                raise UsageError(
                    f"{name}={value!r} is no number of differences",
                    why=f"a covariance needs at least 2, and a window holds at most {_LONGEST}",
                )
        if self.warm_up and not (self.window and self.warm_up <= self.window):
            raise UsageError(
                f"warm_up={self.warm_up} with window={self.window}",
                why="a window holds no more differences than it is long",
            )
        if self.noise == "full" and self.frame == "polar":
            raise UsageError(
                "the noise of polar plots has no covariances here",
                why="filters take the noises of range and angles as independent",
                next_step='use noise="diagonal", or frame="cartesian"',
            )


def _finite(name: str, value: Any) -> Any:
    """The value as a float or an array of them; UsageError where one is negative or infinite."""
    number = as_number(name, value)
    if not np.all((np.asarray(number) >= 0.0) & np.isfinite(number)):
        raise UsageError(f"{name}={value!r} cannot be", why="it is finite and not negative")
    return number


_KASHYAP = ErrorModel(
    state="rate",
    drift_m=0.5,  # Q = 0.25 is its square, taken literally in every channel (erratum K7)
    drift_deg=float(np.degrees(0.5)),
    spread=1.0,
    odds=None,
    alarm=None,
    correction="same epoch",
    outage="coast",
    window=10,
)
MODELS = {
    "random walk": ErrorModel(),
    "random walk, always": ErrorModel(odds=None),
    "kashyap": _KASHYAP,
}


def lookup(name: str) -> ErrorModel:
    """The error model of that name; UsageError with the nearest valid name if there is none."""
    if name in MODELS:
        return MODELS[name]
    raise unknown("error model", name, MODELS)
