"""What the bearings say against the best straight track: noise, outliers, clock, compass, course.

Every test is one of a linear regression: residuals in standard deviations, with what the track's
own four numbers could still explain taken off. [rao1948] C. R. Rao, "Large Sample Tests of
Statistical Hypotheses concerning Several Parameters": a fault is asked for by the slope of the
bearings along it, at the track without it, so that nothing has to be fitted again. [durbin1950]
J. Durbin and G. S. Watson, "Testing for Serial Correlation in Least Squares Regression": moments
of the correlation of neighbours. [cook1982] R. D. Cook and S. Weisberg, "Residuals and Influence
in Regression": a bearing against the fit of all others.
Tests but the first compare with the scatter that is there, not with the one that was stated.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from boresight.target_motion.contact import Contact
from boresight.target_motion.fit import Fit, delay_slopes, fitted
from boresight.target_motion.result import Residuals, Test

if TYPE_CHECKING:
    from boresight.filters.batch import BatchEstimate

Array = Any
FALSE_ALARM = 0.01
_LEAST = 5  # residuals more than the track has numbers, below which nothing is asked
_NOTHING = 1e-6  # of a fault's size: what is left of it when the track explains all of it


def judge(
    contact: Contact, batch: "BatchEstimate", *, false_alarm: float = FALSE_ALARM
) -> Residuals:
    """Ask the residuals of the best track whether something is wrong with the recording.

    Args:
        contact: what was heard.
        batch: the best track of `contact.plots`, with its residuals, in the first lane.
        false_alarm: chance that a good recording fails one test.

    Returns:
        Residuals, and their tests; none with fewer than five residuals to spare.
    """
    residual = np.asarray(batch.residual[0], dtype=float)
    heard = np.isfinite(residual).any(axis=-1)
    one = np.where(heard, np.nansum(residual, axis=-1), np.nan)
    found: tuple[Test, ...] = ()
    if heard.any():
        fit = fitted(contact, batch.mean[0], one)
        if fit.dof >= _LEAST:
            asked = (noise_level, whiteness, outliers)
            found = tuple(ask(fit, false_alarm) for ask in asked)
            found += (
                clock(fit, contact, heard, false_alarm),
                compass(fit, false_alarm),
                straight(fit, false_alarm),
            )
    return Residuals(deg=np.degrees(one), tests=found, false_alarm=false_alarm)


def noise_level(fit: Fit, false_alarm: float) -> Test:
    """Whether the bearings scatter as much as was stated: a chi-square, both ways."""
    from scipy.stats import chi2

    square = float(fit.rest @ fit.rest)
    p = min(1.0, 2.0 * float(min(chi2.cdf(square, fit.dof), chi2.sf(square, fit.dof))))
    ratio = float(np.sqrt(square / fit.dof))
    stated = float(np.degrees(np.sqrt(np.mean(fit.sigma**2))))
    scatter = f"The bearings scatter by {ratio * stated:.3g}°"
    if p >= false_alarm:
        words = f"{scatter}; {stated:.3g}° is stated, and fits."
    else:
        more = "more" if ratio > 1.0 else "less"
        words = (
            f"{scatter}, {more} than the {stated:.3g}° that is stated:"
            f" a standard deviation {ratio:.2f} times as large would fit."
        )
    return Test(
        name="noise level",
        statistic=ratio,
        p_value=p,
        passed=p >= false_alarm,
        words=words,
        estimate=ratio * stated,
        sd=ratio * stated / float(np.sqrt(2.0 * fit.dof)),
    )


def whiteness(fit: Fit, false_alarm: float) -> Test:
    """Whether errors of neighbouring bearings are alike: their correlation, [durbin1950]."""
    from scipy.stats import norm

    e, Q, d = fit.rest, fit.basis, fit.dof
    near = np.zeros_like(Q)  # the average of both neighbours, of every column
    near[1:] += Q[:-1] / 2.0
    near[:-1] += Q[1:] / 2.0
    inner = Q.T @ near
    first = -np.trace(inner)
    second = (len(e) - 1) / 2.0 - 2.0 * np.sum(near**2) + np.sum(inner * inner.T)
    r = float(e[1:] @ e[:-1] / (e @ e))
    sd = np.sqrt(2.0 * (d * second - first**2) / (d * d * (d + 2.0)))
    score = float((r - first / d) / sd)
    p = float(2.0 * norm.sf(abs(score)))
    limit = float(norm.isf(false_alarm / 2.0) * sd)
    words = (
        f"Errors of neighbouring bearings have a correlation of {r:.2f};"
        f" chance alone gives up to {limit:.2f}"
    )
    if p < false_alarm:
        alike = "the track is not straight, or the bearings were smoothed"
        words += f": {alike if score > 0.0 else 'each bearing corrects the one before it'}"
    return Test(
        name="whiteness", statistic=score, p_value=p, passed=p >= false_alarm, words=words + "."
    )


def outliers(fit: Fit, false_alarm: float) -> Test:
    """Whether single bearings lie off the fit of all others, [cook1982]: the farthest of all."""
    from scipy.stats import t as student

    e, m, d = fit.rest, len(fit.rest), fit.dof
    free = np.maximum(1.0 - np.sum(fit.basis**2, axis=1), 1e-9)
    others = np.maximum(e @ e - e**2 / free, 1e-300) / (d - 1)
    score = np.abs(e) / np.sqrt(free * others)
    worst = int(np.argmax(score))
    each = 2.0 * student.sf(score[worst], d - 1)
    p = float(-np.expm1(m * np.log1p(-each)))
    limit = student.isf(-np.expm1(np.log1p(-false_alarm) / m) / 2.0, d - 1)
    count = int(np.sum(score > limit))
    far = f"The bearing at {fit.time_s[worst]:.10g} s lies {score[worst]:.1f} standard deviations"
    words = f"{far} off, the farthest of {m}: chance alone gives up to {limit:.1f}."
    if p < false_alarm:
        words = f"{far} off; {count} of {m} lie beyond the {limit:.1f} that chance gives."
    return Test(
        name="outliers", statistic=float(score[worst]), p_value=p, passed=p >= false_alarm,
        words=words,
    )  # fmt: skip


class _Fault(NamedTuple):
    """A fault of one number: how large it seems (infinite sd where nothing tells), and a test."""

    estimate: float
    sd: float
    score: float
    p: float


def _fault(fit: Fit, slopes: Array) -> _Fault:
    """Regress what is left on the slopes (m,) of the bearings along a fault, in sigma a unit."""
    from scipy.stats import t as student

    left = slopes - fit.basis @ (fit.basis.T @ slopes)
    size = float(left @ left)
    if size <= _NOTHING**2 * float(slopes @ slopes):
        return _Fault(0.0, np.inf, 0.0, 1.0)
    estimate = float(left @ fit.rest) / size
    rest = fit.rest - estimate * left
    sd = float(np.sqrt(rest @ rest / (fit.dof - 1) / size))
    return _Fault(
        estimate, sd, estimate / sd, float(2.0 * student.sf(abs(estimate / sd), fit.dof - 1))
    )


def clock(fit: Fit, contact: Contact, heard: Array, false_alarm: float) -> Test:
    """Whether own ship's clock and that of the bearings agree."""
    fault = _fault(fit, delay_slopes(fit, contact, heard))
    late = "behind" if fault.estimate > 0.0 else "ahead of"
    return _told(
        "own ship's clock",
        fault,
        false_alarm,
        unit=" s",
        wrong=f"Own ship's clock is {abs(fault.estimate):.2g} ± {fault.sd:.2g} s {late} that of"
        " the bearings, or the target did not hold its course.",
        well="Own ship's clock agrees with that of the bearings",
        mute="on this course of own ship a delay looks like another track of the target",
    )


def compass(fit: Fit, false_alarm: float) -> Test:
    """Whether all bearings are turned by one angle, as by an error of own ship's compass."""
    fault = _fault(fit, fit.side / fit.sigma)
    fault = fault._replace(
        estimate=float(np.degrees(fault.estimate)), sd=float(np.degrees(fault.sd))
    )
    way = "much" if fault.estimate > 0.0 else "little"
    return _told(
        "compass",
        fault,
        false_alarm,
        unit="°",
        wrong=f"The bearings read {abs(fault.estimate):.2g} ± {fault.sd:.2g}° too {way}, all alike,"
        " or the target did not hold its course.",
        well="The bearings are not turned as a whole",
        mute="on this course of own ship such an angle looks like another track of the target",
    )


def straight(fit: Fit, false_alarm: float) -> Test:
    """Whether the target held course and speed: against a constant acceleration, North and East."""
    from scipy.stats import f

    slopes = fit.across * ((fit.time_s - fit.time_s[-1]) ** 2 / 2.0)[:, None]
    left = slopes - fit.basis @ (fit.basis.T @ slopes)
    size = np.linalg.norm(slopes, axis=0)
    acceleration, _, k, _ = np.linalg.lstsq(left / size, fit.rest, rcond=_NOTHING)
    rest = fit.rest - left / size @ acceleration
    kept, whole = float(rest @ rest), float(fit.rest @ fit.rest)
    score = (whole - kept) / max(k, 1) / (kept / (fit.dof - k))
    p = float(f.sf(score, k, fit.dof - k)) if k else 1.0
    strength = float(np.hypot(*(acceleration / size)))
    words = "Nothing speaks against a steady course and speed of the target."
    if p < false_alarm:
        words = (
            "The target did not hold its course and speed, if own ship is right:"
            f" an acceleration of {strength:.2g} m/s² fits better."
        )
    return Test(
        name="steady target", statistic=score, p_value=p, passed=p >= false_alarm, words=words
    )


def _told(
    name: str, fault: _Fault, false_alarm: float, *, unit: str, wrong: str, well: str, mute: str
) -> Test:
    """A fault of one number as a test, with what could have been seen."""
    from scipy.stats import norm

    passed = fault.p >= false_alarm
    if np.isinf(fault.sd):
        return Test(name=name, statistic=0.0, p_value=1.0, passed=True, words=f"Not asked: {mute}.")
    seen = float(norm.isf(false_alarm / 2.0) + norm.ppf(0.9)) * fault.sd
    fine = (
        f"{well}: {fault.estimate:.2g} ± {fault.sd:.2g}{unit};"
        f" {seen:.2g}{unit} would be seen nine times in ten."
    )
    return Test(
        name=name,
        statistic=fault.score,
        p_value=fault.p,
        passed=passed,
        words=fine if passed else wrong,
        estimate=fault.estimate,
        sd=fault.sd,
    )
