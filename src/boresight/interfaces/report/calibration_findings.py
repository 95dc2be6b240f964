"""What a calibration shows of each systematic error: one judgement for sentences, table, chart."""

import math
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration, TermFound


class Finding(StrEnum):
    """What is found of a term, in words."""

    ERROR = "error"
    NONE = "none shows itself"
    SHARED = "hardly told apart from others"
    WITHIN = "within the systematic part"
    ENDLESS = "no interval: too few targets"
    UNSEEN = "not observable: no number to use"


def findings(calibration: "Calibration") -> dict[str, Finding]:
    """Judge every term."""
    return {name: _finding(name, term, calibration) for name, term in calibration.terms.items()}


def _finding(name: str, term: "TermFound", calibration: "Calibration") -> Finding:
    low, high = term.ci95
    beyond = systematic(name, calibration)
    if not term.observable:
        return Finding.UNSEEN
    if not has_interval(term):
        return Finding.ENDLESS
    if low > beyond or high < -beyond:
        return Finding.ERROR
    if low > 0 or high < 0:
        return Finding.WITHIN
    shared = any(name in direction.weights for direction in calibration.directions)
    return Finding.SHARED if shared else Finding.NONE


def systematic(name: str, calibration: "Calibration") -> float:
    """How far off a term may be that no interval shows, in its unit; 0 if nothing is known of it.

    What aircraft send down is cut to steps, and whether rounded or truncated is not known.
    """
    known = calibration.settings.get("azimuth_systematic_deg", 0.0)
    return float(known or 0.0) if name == "azimuth_bias_deg" else 0.0


def has_interval(term: "TermFound") -> bool:
    """Whether the data told how sure a term is; else `sd` is what was believed before them."""
    return all(map(math.isfinite, term.ci95))


def shown_sd(term: "TermFound") -> float:
    """The standard deviation that says how many digits of a term are worth showing."""
    return term.sd if has_interval(term) else term.independent_sd
