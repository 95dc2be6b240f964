"""Registration: the systematic errors of a radar from plots whose targets' places are known.

residual = effects of the terms + delay of the target's transponder (range)
               + what wanders along the target + noise

The noise is a narrow and a wide normal law per channel; some pairs are no measurement at all. All
of it is found together by expectation-maximisation with a random effect for each target, from a
start that a fifth of gross errors does not move. What is believed of a term before (`TERMS.scale`)
keeps what the geometry does not tell finite and wide. Residuals are linearised again at the places
that the time bias and the site offset lead to.

    [bell2002] Robert M. Bell and Daniel F. McCaffrey, "Bias Reduction in Standard Errors for Linear
        Regression with Multi-Stage Samples"
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.calibration.clusters import Sandwich, sandwich
from boresight.calibration.fit import Fit, fit
from boresight.calibration.observability import observability
from boresight.calibration.pairs import Pairs
from boresight.calibration.result import Direction, Law, NoiseFound, TermFound
from boresight.errors import DataError, unknown
from boresight.models.systematic import TERMS, SystematicErrors

Array = Any

_FEWEST = 3  # targets: of fewer nobody can say how much targets differ
_DOOR = {"range_m": 1.0, "azimuth_rad": 180.0 / np.pi, "elevation_rad": 180.0 / np.pi}


@dataclass(frozen=True, kw_only=True, eq=False)
class Registration:
    """What the pairs say of the radar.

    Attributes:
        errors: estimate and joint covariance, clustered by target.
        terms: each on its own.
        directions: what cannot be told apart, or hardly.
        noise: of the plots.
        outlier: (m,) probability that a pair is no measurement of its target.
        delay_m: (targets,) predicted delay of each transponder; 0 for a target without pairs.
        after: (m, k) residuals without systematic errors, m and rad; delays, and what wanders, are
            still in.
        remarks: sentences for the reader.
    """

    errors: SystematicErrors
    terms: dict[str, TermFound]
    directions: tuple[Direction, ...]
    noise: NoiseFound
    outlier: Array
    delay_m: Array
    after: Array
    remarks: tuple[str, ...] = ()


def register(
    pairs: Pairs, terms: tuple[str, ...], *, robust: bool = True, delays: bool = True
) -> Registration:
    """Estimate systematic errors, noise and outliers together.

    Args:
        pairs: plots beside where their targets were.
        terms: of `TERMS`, to be estimated; all others are taken as zero.
        robust: heavy tails and outliers; without it every channel is normal.
        delays: a random delay of range for each target, and errors that wander along it; without
            it every pair errs by itself.

    Raises:
        DataError: no pairs.
        UsageError: unknown term.
    """
    if not len(pairs):
        raise DataError("no pair of a plot with a reference", next_step="see what was dropped")
    for term in terms:
        if term not in TERMS:
            raise unknown("term of systematic error", term, TERMS)
    found = fit(pairs, terms, robust=robust, delays=delays)
    estimate = found.state.terms
    spread = _spread(found, terms)
    geometry = observability(terms, found.geometry(), found.pairs.counts, spread.cov, estimate)
    return Registration(
        errors=SystematicErrors(terms=terms, estimate=estimate, cov=spread.cov),
        terms=_each(found, terms, spread, geometry.observable),
        directions=geometry.directions,
        noise=_noise(found, pairs.channels),
        outlier=found.in_order(found.classes.outlier),
        delay_m=found.delay_m(len(pairs.names)),
        after=np.where(np.isnan(pairs.z), np.nan, found.in_order(found.whole().T)),
        remarks=_remarks(found),
    )


def _spread(found: Fit, terms: tuple[str, ...]) -> Sandwich:
    """Covariance by target; what was believed before where targets are too few to tell."""
    if len(found.pairs.starts) >= _FEWEST:
        return sandwich(found.scores(), found.information(), found.prior)
    scale = np.array([TERMS[term].scale for term in terms])
    return Sandwich(np.diag(scale**2), np.zeros(len(terms)))


def _each(
    found: Fit, terms: tuple[str, ...], spread: Sandwich, observable: Array
) -> dict[str, TermFound]:
    """Every term with its interval; infinite where there are no degrees of freedom."""
    from scipy.stats import t

    alone = found.alone() + np.diag(found.prior)
    independent = np.sqrt(np.diag(np.linalg.inv(alone)))
    sd = np.sqrt(np.diag(spread.cov))
    half = np.array(
        [s * t.ppf(0.975, f) if f > 0 else np.inf for s, f in zip(sd, spread.freedom, strict=True)]
    )
    return {
        term: TermFound(
            estimate=float(value),
            sd=float(sd[i]),
            ci95=(float(value - half[i]), float(value + half[i])),
            observable=bool(observable[i]),
            independent_sd=float(independent[i]),
        )
        for i, (term, value) in enumerate(zip(terms, found.state.terms, strict=True))
    }


def _noise(found: Fit, channels: tuple[str, ...]) -> NoiseFound:
    """Laws in the units of the door."""
    laws, known = found.state.laws, len(found.pairs.starts) >= _FEWEST
    level, whole = found.robust_sd(found.level()), found.robust_sd(found.whole())
    slow = np.sqrt(found.state.wander.variance)
    single: dict[str, float] = {}
    left: dict[str, float] = {}
    by_door = {}
    for i, channel in enumerate(channels):
        if not found.pairs.at.seen[i].any():
            continue
        door, unit = channel.replace("_rad", "_deg"), _DOOR[channel]
        narrow, wide = (float(np.hypot(sd[i], slow[i]) * unit) for sd in (laws.sd, laws.tail_sd))
        by_door[door] = Law(narrow, float(laws.tail_share[i]), wide)
        single[door], left[door] = float(level[i] * unit), float(whole[i] * unit)
    nothing = float("nan")
    return NoiseFound(
        range_m=single.get("range_m", nothing),
        azimuth_deg=single.get("azimuth_deg", nothing),
        elevation_deg=single.get("elevation_deg"),
        target_range_m=float(np.sqrt(found.state.delay_var)) if known else nothing,
        outlier_share=laws.outlier_share if laws.robust else 0.0,
        laws=by_door,
        residual_range_m=left.get("range_m", nothing),
        residual_azimuth_deg=left.get("azimuth_deg", nothing),
    )


def _remarks(found: Fit) -> tuple[str, ...]:
    """What a reader must know of the fit."""
    remarks = []
    if len(found.pairs.starts) < _FEWEST:
        remarks.append(
            f"{len(found.pairs.starts)} target(s): how much targets differ cannot be told, so no "
            "interval is given; the covariance is what was believed before"
        )
    remarks += _wandering(found)
    if not found.converged:
        remarks.append("the fit had not settled when it was stopped")
    return tuple(remarks)


def _wandering(found: Fit) -> list[str]:
    """Whose errors are alike from plot to plot, and for how long."""
    wander = found.state.wander
    said = []
    for channel, variance, time_s in zip(found.pairs.channels, *wander, strict=True):
        name, unit = channel.split("_")[0], "m" if channel == "range_m" else "deg"
        if variance:
            size = float(np.sqrt(variance) * _DOOR[channel])
            said.append(
                f"Errors of {name} wander along a target, by {_two(size)} {unit}, and stay alike "
                f"for about {_two(time_s)} s: many plots of one target are worth few."
            )
    return said


def _two(value: float) -> str:
    """Two digits: '130', '0.036'."""
    return np.format_float_positional(value, precision=2, fractional=False, trim="-")
