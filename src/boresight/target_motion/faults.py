"""Faults that change all bearings slowly: own ship's clock, its compass, a target that manoeuvres.

[rao1948] C. R. Rao, "Large Sample Tests of Statistical Hypotheses concerning Several Parameters": a
fault is asked for by the slope of the bearings along it, at the track without it, so that nothing
has to be fitted again. What is here besides: errors of neighbours that are alike are counted as
fewer bearings, and a fault that could be seen only where no instrument is so wrong is not asked.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.maths.digits import decimals
from boresight.target_motion.fit import Fit
from boresight.target_motion.result import Test

Array = Any
ENOUGH = 30  # independent residuals; fewer do not tell how alike errors are, or how large
WORST_DEG = 30.0  # no compass is off by more: what looks like it is another fault


class Fault(NamedTuple):
    """A fault: its test, its slopes (m, k) in sigma a unit, and the mean square it leaves.

    `is_possible` says whether something of that size can be what it is called.
    """

    test: Test
    slopes: Array
    left: float
    is_possible: bool = True


class _Found(NamedTuple):
    """How large a fault seems (k,), with sd (infinite where nothing tells), its F test."""

    estimate: Array
    sd: Array
    score: float
    p: float
    left: float


def faults(fit: Fit, delays: Array, false_alarm: float) -> tuple[Fault, ...]:
    """Ask for all of them; delays (m,) are the slopes along one of own ship's clock."""
    return (
        clock(fit, delays[:, None], false_alarm),
        compass(fit, false_alarm),
        straight(fit, false_alarm),
    )


def leading(every: Sequence[Fault]) -> Fault | None:
    """The failed one that explains most: it leaves the least mean square."""
    failed = [each for each in every if not each.test.passed and each.is_possible]
    return min(failed, key=lambda each: each.left, default=None)


def _regress(fit: Fit, slopes: Array) -> _Found:
    """Regress what is left on slopes (m, k) of the bearings along a fault."""
    from scipy.stats import f

    u, s, vt = fit.free(slopes)
    k, along, whole = len(s), u.T @ fit.rest, float(fit.rest @ fit.rest)
    size = np.linalg.norm(slopes, axis=0)
    explained = float(along @ along)
    left = (whole - explained) / (fit.dof - k)
    if k == 0:
        return _Found(0.0 * size, np.full(len(size), np.inf), 0.0, 1.0, left)
    turned = vt.T / s / size[:, None]
    score = explained / k / (left * fit.stretch)
    sd = np.sqrt(left * fit.stretch * np.sum(turned**2, axis=1))
    spare = max(fit.worth - k, 1.0)
    return _Found(turned @ along, sd, score, float(f.sf(score, k, spare)), left)


def clock(fit: Fit, delays: Array, false_alarm: float) -> Fault:
    """Whether own ship's clock and that of the bearings agree."""
    found = _regress(fit, delays)
    seconds, sd = float(found.estimate[0]), float(found.sd[0])
    late = "behind" if seconds > 0.0 else "ahead of"
    test = _told(
        fit, "own ship's clock", found, false_alarm, unit=" s",
        wrong=f"Own ship's clock is {_figures(abs(seconds), sd)} s {late} that of"
        " the bearings, or the target did not hold its course.",
        well="Own ship's clock agrees with that of the bearings",
        mute="on this course of own ship a delay looks like another track of the target",
    )  # fmt: skip
    return Fault(test, delays, found.left)


def compass(fit: Fit, false_alarm: float) -> Fault:
    """Whether all bearings are turned by one angle, as by an error of own ship's compass."""
    slopes = (fit.side / fit.sigma)[:, None]
    found = _regress(fit, slopes)
    deg = found._replace(estimate=np.degrees(found.estimate), sd=np.degrees(found.sd))
    angle, sd = float(deg.estimate[0]), float(deg.sd[0])
    is_possible = abs(angle) <= WORST_DEG
    wrong = (
        f"The bearings read {_figures(abs(angle), sd)}° too {'much' if angle > 0.0 else 'little'},"
        " all alike, or the target did not hold its course."
        if is_possible
        else f"No compass error explains the bearings: it would be beyond {WORST_DEG:.0f}°."
        " Something else is wrong."
    )
    test = _told(
        fit, "compass", deg, false_alarm, unit="°",
        wrong=wrong,
        well="The bearings are not turned as a whole",
        mute="on this course of own ship such an angle looks like another track of the target",
        worst=WORST_DEG,
    )  # fmt: skip
    return Fault(test, slopes, found.left, is_possible)


def straight(fit: Fit, false_alarm: float) -> Fault:
    """Whether the target held course and speed: against a constant acceleration, North and East."""
    slopes = fit.across * ((fit.time_s - fit.time_s[-1]) ** 2 / 2.0)[:, None]
    found = _regress(fit, slopes)
    if not is_judged(fit):
        return Fault(unjudged("steady target"), slopes, found.left)
    words = "Nothing speaks against a steady course and speed of the target."
    if found.p < false_alarm:
        words = (
            "The target did not hold its course and speed, if own ship is right:"
            f" an acceleration of {np.hypot(*found.estimate):.2g} m/s² fits better."
        )
    test = Test(
        name="steady target",
        statistic=found.score,
        p_value=found.p,
        passed=found.p >= false_alarm,
        words=words,
    )
    return Fault(test, slopes, found.left)


def is_judged(fit: Fit) -> bool:
    """Whether enough independent bearings are left to ask for anything but how they scatter."""
    return not fit.alike or fit.worth >= ENOUGH


def unjudged(name: str) -> Test:
    """A test whose p-value would mean nothing."""
    return not_asked(name, "errors of neighbouring bearings are too much alike to tell")


def not_asked(name: str, why: str) -> Test:
    """A test that these bearings cannot answer."""
    words = f"Not asked: {why}."
    return Test(name=name, statistic=0.0, p_value=1.0, passed=True, words=words, asked=False)


def _figures(value: float, sd: float) -> str:
    """Render an estimate and its sd to the digits that they are worth: `1.02 ± 0.15`."""
    digits = decimals(sd)
    return f"{value:z.{digits}f} ± {sd:.{digits}f}"


_ABSURD = 10.0  # times what would be worst: a figure that says nothing


def _told(
    fit: Fit, name: str, found: _Found, false_alarm: float, *, unit: str, wrong: str, well: str,
    mute: str, worst: float = np.inf,
) -> Test:  # fmt: skip
    """A fault of one number as a test, with what could have been seen."""
    from scipy.stats import norm

    if not is_judged(fit):
        return unjudged(name)
    estimate, sd = float(found.estimate[0]), float(found.sd[0])
    seen = float(norm.isf(false_alarm / 2.0) + norm.ppf(0.9)) * sd
    if seen > _ABSURD * worst or np.isinf(sd):
        return not_asked(name, mute)
    if seen > worst:
        return not_asked(name, f"on this course less than {seen:.0f}{unit} could not be seen")
    passed = found.p >= false_alarm
    fine = (
        f"{well}: {_figures(estimate, sd)}{unit};"
        f" {seen:.{decimals(sd)}f}{unit} would be seen nine times in ten."
    )
    return Test(
        name=name,
        statistic=estimate / sd,
        p_value=found.p,
        passed=passed,
        words=fine if passed else wrong,
        estimate=estimate,
        sd=sd,
    )
