"""The noncredibility index of a cell: actual errors of all runs, claims of the first ones again."""

from typing import Any

import numpy as np

from boresight.experiments.credibility import credibility
from boresight.laboratory.further import scored_names
from boresight.laboratory.scores import Gathered
from boresight.laboratory.study import Contender, Setting, Study
from boresight.laboratory.trial import told_again

Array = Any
_RUNS = 2000
_STEPS = 100_000  # of all runs together: what is stored of them stays below 100 MB


def credibility_of(
    study: Study, setting: Setting, contender: Contender, gathered: Gathered
) -> dict[str, Any]:
    """Both indices in dB, averaged over scored scans, and the index of errors that fit the claims.

    The index holds every claim against the actual mean square error, which is known only after the
    last run; so the first runs are made again, 2,000 of them or as many as have 100,000 scans.
    Claims that differ from run to run differ from their average even if each is right: so the
    index is told beside that of Gaussian errors drawn from the claims.
    """
    names, scans = scored_names(setting.scenario, contender), setting.scenario.scans
    if gathered.count <= len(names):
        return {}
    runs = min(gathered.count, _RUNS, max(1, _STEPS // scans))
    truth, told = told_again(study, setting, contender, runs)
    of = [setting.scenario.motion.names.index(name) for name in names]
    at = [contender.motion.names.index(name) for name in names]
    scored = slice(study.first_scan, None)
    errors = (told["mean"][..., at] - truth[..., of])[:, scored]
    covs = told["cov"][..., at, :][..., at][:, scored]
    actual = gathered.sums["error_outer"][scored] / gathered.count
    index, inclination = credibility(np.where(np.isfinite(errors), errors, np.inf), covs, actual)
    return {
        "noncredibility_db": float(np.mean(index)),
        "inclination_db": float(np.mean(inclination)),
        "noncredibility_credible_db": _of_claims(covs),
    }


def _of_claims(covs: Array) -> float:
    """Index of Gaussian errors of covariances (runs, scans, n, n); NaN where one is none."""
    generator = np.random.Generator(np.random.Philox(len(covs)))
    try:
        roots = np.linalg.cholesky(covs)
    except np.linalg.LinAlgError:
        return np.nan
    errors = (roots @ generator.standard_normal((*covs.shape[:-1], 1)))[..., 0]
    return float(np.mean(credibility(errors, covs).index_db))
