"""How pradeep's words are judged, and put into rows.

Claims about which filter is better are judged by averages over runs that heard the same bearings,
by three standard errors; claims about one run by the share of runs in which they are true. Where a
sentence holds for one start of a filter and not for another, both are parts of its row.
"""

from typing import Any

import numpy as np

from boresight.experiments.consistency import bias
from boresight.experiments.papers.pradeep_study import Study
from boresight.experiments.verdicts import Claim

Array = Any


def row(study: Study, kind: str, name: str, **found: Any) -> Claim:
    """A claim whose place and words stand in the paper's table."""
    stated = study.table[kind][name]
    found.setdefault("published", stated.get("published"))
    return Claim(id=name, where=stated["where"], **found)


def reasons(study: Study, *names: str) -> str:
    """Why some assumptions are what they are."""
    return "; ".join(study.table["why"][name] for name in names)


def number(value: Any) -> float | None:
    """For JSON: None where there is none."""
    return float(value) if np.isfinite(value) else None


def by_time(study: Study, values: Array) -> dict[str, float | None]:
    """Of numbers (scans,), those at the times that are shown."""
    return {f"{t:g} s": number(values[study.at(t)]) for t in study.shown_s}


def median(values: Array) -> dict[str, float | None]:
    """Median of runs (runs,), and where it lies with 95 % confidence, by order statistics."""
    ordered, half = np.sort(values), 0.98 / np.sqrt(len(values))
    low, high = np.quantile(ordered, np.clip([0.5 - half, 0.5 + half], 0.0, 1.0))
    return {"median": number(np.median(values)), "from": number(low), "to": number(high)}


def rms(error: Array) -> Array:
    """(scans,): root mean square over runs (runs, scans)."""
    return np.sqrt(np.mean(np.square(error), axis=0))


def over_bound(study: Study, label: str) -> dict[str, dict[str, float | None]]:
    """A filter's RMSE of the position over the bound, at the times that are shown."""
    at = [study.at(second) for second in study.shown_s]
    return _ratios(study, label, study.shown_s, study.tracked[label].square[:, at])


def references(study: Study) -> dict[str, dict[str, float | None]]:
    """The same of a batch estimate and of particles, once own ship has turned."""
    found: dict[str, dict[str, float | None]] = {}
    for name, square in study.references.items():
        found |= _ratios(study, f"{name}, {len(square)} runs", study.reference_s, square)
    return found


def _ratios(
    study: Study, label: str, times_s: list[float], square: Array
) -> dict[str, dict[str, float | None]]:
    """Ratios and their standard errors, by time, of squared errors (runs, times)."""
    mean, names = bias(square), [f"{second:g} s" for second in times_s]
    ratio = np.sqrt(mean.value) / study.bound_m[[study.at(second) for second in times_s]]
    error = 0.5 * ratio * mean.standard_error / mean.value
    told = {"RMSE over the bound": ratio, "standard error of that": error}
    return {
        f"{label}, {kind}": dict(zip(names, map(number, values), strict=True))
        for kind, values in told.items()
    }
