"""What the bearings say against the best straight track: noise, outliers, clock, compass, course.

Every test is one of a linear regression: residuals in standard deviations, with what the track's
own four numbers could still explain taken off. [durbin1950] J. Durbin and G. S. Watson, "Testing
for Serial Correlation in Least Squares Regression": moments of the correlation of neighbours.
[cook1982] R. D. Cook and S. Weisberg, "Residuals and Influence in Regression": a bearing against
the fit of all others.

Tests but the first compare with the scatter that is there, not with the one that was stated. Where
neighbouring errors are alike and no fault explains that, all others count fewer bearings.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.target_motion.contact import Contact
from boresight.target_motion.faults import faults, is_judged, leading, unjudged
from boresight.target_motion.fit import Fit, delay_slopes, fitted
from boresight.target_motion.result import Residuals, Test

if TYPE_CHECKING:
    from boresight.filters.batch import BatchEstimate

Array = Any
FALSE_ALARM = 0.01
_LEAST = 5  # residuals more than the track has numbers, below which nothing is asked


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
            found = _judged(fit, delay_slopes(fit, contact, heard), false_alarm)
    return Residuals(deg=np.degrees(one), tests=found, false_alarm=false_alarm)


def _judged(fit: Fit, delays: Array, false_alarm: float) -> tuple[Test, ...]:
    """All tests, each with the fault that it may follow from."""
    fit = fit._replace(alike=_alike(fit, delays, false_alarm))
    found = _asked(fit, delays, false_alarm)
    lead = leading(faults(fit, delays, false_alarm))
    if lead is None:
        return found
    again = _asked(fit.without(lead.slopes), delays, false_alarm)
    name = lead.test.name
    return tuple(
        replace(test, follows=name)
        if not test.passed and other.passed and test.name != name
        else test
        for test, other in zip(found, again, strict=True)
    )


def _alike(fit: Fit, delays: Array, false_alarm: float) -> float:
    """Correlation of neighbouring errors that is there without the fault that explains most."""
    lead = leading(faults(fit, delays, false_alarm))
    found = whiteness(fit if lead is None else fit.without(lead.slopes), false_alarm)
    r = found.estimate or 0.0
    return 0.0 if found.passed else min(max(r, 0.0), 1.0 - 1e-9)


def _asked(fit: Fit, delays: Array, false_alarm: float) -> tuple[Test, ...]:
    """All tests of one fit."""
    asked = (noise_level, whiteness, outliers)
    found = tuple(ask(fit, false_alarm) for ask in asked)
    return found + tuple(each.test for each in faults(fit, delays, false_alarm))


def noise_level(fit: Fit, false_alarm: float) -> Test:
    """Whether the bearings scatter as much as was stated: a chi-square, both ways.

    Of errors that are alike the track takes the slow part for its own: only too many tell.
    """
    from scipy.stats import chi2

    mean = float(fit.rest @ fit.rest) / fit.dof
    dof = fit.dof * (1.0 - fit.alike**2) / (1.0 + fit.alike**2)  # as the scatter itself scatters
    less, more = float(chi2.cdf(mean * dof, dof)), float(chi2.sf(mean * dof, dof))
    p = more if fit.alike else min(1.0, 2.0 * min(less, more))
    ratio = float(np.sqrt(mean))
    stated = float(np.degrees(np.sqrt(np.mean(fit.sigma**2))))
    scatter = f"The bearings scatter by {ratio * stated:.3g}°"
    if p >= false_alarm:
        fits = "which errors so alike do not contradict" if fit.alike else "and fits"
        words = f"{scatter}; {stated:.3g}° is stated, {fits}."
    else:
        way = "more" if ratio > 1.0 else "less"
        words = (
            f"{scatter}, {way} than the {stated:.3g}° that is stated:"
            f" a standard deviation {ratio:.2f} times as large would fit."
        )
    return Test(
        name="noise level",
        statistic=ratio,
        p_value=p,
        passed=p >= false_alarm,
        words=words,
        estimate=ratio * stated,
        sd=ratio * stated / float(np.sqrt(2.0 * dof)),
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
    sd = float(np.sqrt(2.0 * (d * second - first**2) / (d * d * (d + 2.0))))
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
    if fit.alike and not is_judged(fit):
        words += (
            f". In such errors {len(e):,} bearings are worth about {max(fit.worth, 1.0):.0f}:"
            " clock, compass, course and single bearings cannot be judged"
        )
    return Test(
        name="whiteness", statistic=score, p_value=p, passed=p >= false_alarm, words=words + ".",
        estimate=r, sd=sd,
    )  # fmt: skip


def outliers(fit: Fit, false_alarm: float) -> Test:
    """Whether single bearings lie off the fit of all others, [cook1982]: the farthest of all."""
    from scipy.stats import t as student

    if not is_judged(fit):
        return unjudged("outliers")
    e, m, d = fit.rest, len(fit.rest), fit.dof
    free = np.maximum(1.0 - np.sum(fit.basis**2, axis=1), 1e-9)
    others = np.maximum(e @ e - e**2 / free, 1e-300) / (d - 1)
    score = np.abs(e) / np.sqrt(free * others)
    worst = int(np.argmax(score))
    each = 2.0 * student.sf(score[worst], d - 1)
    p = float(-np.expm1(m * np.log1p(-each)))
    limit = student.isf(-np.expm1(np.log1p(-false_alarm) / m) / 2.0, d - 1)
    count = int(np.sum(score > limit))
    far = f"The bearing at {fit.time_s[worst]:,.10g} s lies {score[worst]:.1f} standard deviations"
    words = f"{far} off, the farthest of {m:,}: chance alone gives up to {limit:.1f}."
    if p < false_alarm:
        words = f"{far} off; {count} of {m:,} lie beyond the {limit:.1f} that chance gives."
    return Test(
        name="outliers", statistic=float(score[worst]), p_value=p, passed=p >= false_alarm,
        words=words,
    )  # fmt: skip
