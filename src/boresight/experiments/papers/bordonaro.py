"""Every setting, figure, metric and claim of bordonaro, with a verdict.

Printed numbers and assumptions come from `bordonaro.toml`. Formulas are as corrected by errata B1
to B13; where a misprint would decide a claim it is run as well. How words are judged is said in
`bordonaro_words`.
"""

from pathlib import Path
from typing import Any

from boresight.experiments.papers import (
    bordonaro_bounds,
    bordonaro_claims,
    bordonaro_figures,
    bordonaro_metrics,
    figures,
)
from boresight.experiments.papers import bordonaro_rows_doppler as doppler
from boresight.experiments.papers import bordonaro_rows_plots as plots
from boresight.experiments.papers import bordonaro_rows_tracks as tracks
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.verdicts import Claim

_FIGURES = (
    plots.figure_1,
    plots.figure_2,
    plots.figure_3,
    plots.figure_4,
    plots.figure_5,
    tracks.figure_6,
    plots.figure_7,
    tracks.figure_8,
    tracks.figure_9,
    tracks.figure_10,
    tracks.figure_11,
    tracks.figure_12,
    doppler.figure_13,
    doppler.figure_14,
)


def reproduce(
    table: dict[str, Any], *, runs: int | None, seed: int, output: Path | None
) -> tuple[list[Claim], list[str]]:
    """All claims, and the files of the figures if there is a folder for them."""
    if output:
        figures.require()
    study = Study(table, runs, seed)
    shown = {claim.id: claim for claim in (figure(study) for figure in _FIGURES)}
    claims = [
        *bordonaro_metrics.settings(study),
        *shown.values(),
        bordonaro_bounds.bounds(study),
        *bordonaro_metrics.metrics(study),
        *bordonaro_claims.claims(study, shown),
        *bordonaro_claims.future(study),
    ]
    return claims, bordonaro_figures.write(study, output) if output else []
