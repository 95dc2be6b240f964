"""What is said of a contact to machines: the same on standard output and in the page."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from boresight.target_motion.result import Batch, Residuals, TargetMotion

STATE = ("north_m", "east_m", "north_mps", "east_mps")
QUANTITIES = ("range_m", "bearing_deg", "course_deg", "speed_mps")


def told(one: "TargetMotion") -> dict[str, Any]:
    """One contact's answer, as `boresight tma --json` prints it and the report carries it."""
    seen = asdict(one.observability)
    del seen["by_step"], seen["observable"]
    return {
        "track": one.contact.name,
        "filter": one.filter,
        "bearings": one.bearings,
        "first_s": float(one.contact.time_s[0]),
        "last_s": float(one.contact.time_s[-1]),
        "observable": one.observable,
        "observability": seen,
        "converged_s": one.converged_s,
        "convergence": asdict(one.convergence),
        "criteria": asdict(one.criteria),
        **{name: asdict(getattr(one, name)) for name in QUANTITIES},
        "state": {"names": STATE, "mean": one.mean, "cov": one.cov} if one.observable else None,
        "plane": asdict(one.contact.site) if one.contact.site else None,
        "sides": [asdict(each) for each in one.sides],
        "side_decided": one.decided,
        "cells": {
            "range_m": one.cells.range_m,
            "side": one.cells.side,
            "weights": one.cells.weights[-1],
            "mean": one.cells.mean,
        },
        "batch": _batch(one.batch) if one.batch and one.observable else None,
        "residuals": _residuals(one.residuals) if one.residuals else None,
        "settings": one.settings,
        "remarks": [*one.contact.remarks, *one.remarks],
    }


def _batch(batch: "Batch") -> dict[str, Any]:
    told = {name: asdict(getattr(batch, name)) for name in QUANTITIES}
    return {"cost": batch.cost, "settled": batch.converged, **told}


def _residuals(residuals: "Residuals") -> dict[str, Any]:
    tests = [asdict(each) for each in residuals.tests]
    return {"false_alarm": residuals.false_alarm, "tests": tests}
