"""Every setting, table, figure, limit and claim of pradeep, with a verdict.

Printed numbers and assumptions come from `pradeep.toml`. Formulas are as corrected by errata P1 to
P10; speeds are in m/s, as Table 5.1 has them. How words are judged is said in `pradeep_words`.
"""

from pathlib import Path
from typing import Any

from boresight.experiments.papers import (
    figures,
    pradeep_claims,
    pradeep_curves,
    pradeep_figures,
    pradeep_tables,
)
from boresight.experiments.papers.pradeep_study import Study
from boresight.experiments.verdicts import Claim


def reproduce(
    table: dict[str, Any], *, runs: int | None, seed: int, output: Path | None
) -> tuple[list[Claim], list[str]]:
    """All claims, and the files of the figures if there is a folder for them."""
    if output:
        figures.require()
    study = Study(table, runs, seed)
    claims = [
        *pradeep_tables.settings(study),
        *pradeep_tables.tables(study),
        *pradeep_curves.figures(study),
        *pradeep_curves.limits(study),
        *pradeep_claims.claims(study),
    ]
    return claims, pradeep_figures.write(study, output) if output else []
