"""Every table, figure, setting, metric and claim of kashyap, with a verdict.

Printed numbers and assumptions come from `kashyap.toml`; formulas are as corrected by errata K1 to
K13. The error model is the reading that reproduces the tables: it corrects every plot with the
reference of that plot's own epoch. Whether that is a gain is KA-E1's question, and every row that
claims one names the answer.
"""

from pathlib import Path
from typing import Any

from boresight.experiments.papers import (
    figures,
    kashyap_claims,
    kashyap_curves,
    kashyap_diagrams,
    kashyap_figures,
    kashyap_settings,
    kashyap_tables,
)
from boresight.experiments.papers.kashyap_study import Study
from boresight.experiments.verdicts import Claim


def reproduce(
    table: dict[str, Any], *, runs: int | None, seed: int, output: Path | None
) -> tuple[list[Claim], list[str]]:
    """All claims, and the files of the figures if there is a folder for them."""
    if output:
        figures.require()
    study = Study(table, runs, seed)
    claims = [
        *kashyap_settings.settings(study),
        *kashyap_tables.tables(study),
        *kashyap_diagrams.diagrams(study),
        *kashyap_curves.figures(study),
        *kashyap_settings.metrics(study),
        *kashyap_claims.claims(study),
    ]
    return claims, kashyap_figures.write(study, output) if output else []
