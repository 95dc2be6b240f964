"""How bordonaro's words are judged, and put into rows.

Curves are not given as numbers, so words are judged: by three standard errors, point by point, as
`experiments.verdicts` says, with formulas as corrected by the errata. What is printed otherwise is
a part of its own, "as printed", and does not touch the verdict of its row.
"""

from typing import Any

import numpy as np

from boresight.experiments.consistency import Bias
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.verdicts import Claim, Verdict, less

Array = Any
SCANS = (1, 5, 20, 100)


def row(study: Study, kind: str, name: str, **found: Any) -> Claim:
    """A claim whose place and words stand in the paper's table."""
    stated = study.table[kind][name]
    return Claim(id=name, where=stated["where"], published=stated["published"], **found)


def somewhere(holds: Array, fails: Array) -> Verdict:
    """Verdict on a sentence about some points, from those where it holds and where it fails."""
    if np.any(holds):
        return "reproduces"
    return "does not reproduce" if np.all(fails) else "in band"


def at_scans(values: Array) -> dict[str, float | None]:
    """Some of the numbers (scans,), by scan; None where a run diverged without bound."""
    shown = {f"scan {k}": float(values[k - 1]) for k in SCANS if k <= len(values)}
    return {scan: value if np.isfinite(value) else None for scan, value in shown.items()}


def agree(mean: Bias, expected: float) -> bool:
    """Whether an average is what it should be, as far as three standard errors tell."""
    off = np.abs(mean.value - expected)
    return not less(-off, mean.standard_error)


def reasons(study: Study, *names: str) -> str:
    """Why some assumptions are what they are."""
    return "; ".join(study.table["why"][name] for name in names)
