"""kashyap's Table 4 and Figure 5, whose Set 3 is not to be had: what a substitute says."""

from typing import Any

import numpy as np

from boresight.experiments.papers.kashyap_curves import well_within
from boresight.experiments.papers.kashyap_study import Study
from boresight.experiments.papers.kashyap_tables import printed
from boresight.experiments.papers.kashyap_words import LEAK, part, ratios, reasons, row, share
from boresight.experiments.verdicts import Claim, band_of

Array = Any
_OPEN = ("set_3", "set_3_sigma", "set_3_accel_mps2")


def table(study: Study) -> Claim:
    """KA-T4."""
    methods = printed(study.table["tables"]["KA-T4"])
    found = {method: study.third[method].pfe for method in methods}
    stated, ours = ratios(methods, "ecmkf", "emekf"), ratios(found, "ecmkf", "emekf")
    return row(
        study,
        "tables",
        "KA-T4",
        published=methods,
        ours={m: {c: float(np.median(v)) for c, v in pfe.items()} for m, pfe in found.items()},
        band={m: {c: band_of(v) for c, v in pfe.items()} for m, pfe in found.items()},
        verdict="cannot be checked",
        assumption=f"{_stand_in(study)}; {reasons(study, *_OPEN)}",
        parts=tuple(
            part(
                "KA-T4",
                name,
                value,
                float(np.median(ours[name])),
                "cannot be checked",
                "of another flight",
                band_of(ours[name]),
            )
            for name, value in stated.items()
        ),
    )


def _stand_in(study: Study) -> str:
    world, _ = study.flight
    noises = len(study.third["emekf"].square)
    return f"in its place: {world.source}, {world.scans} scans, {noises} noises"


def figures(study: Study) -> list[Claim]:
    """KA-F5a to KA-F5d."""
    rows = []
    for axis, letter in enumerate("abc"):
        shares = {m: share(well_within(study, study.third[m], axis)) for m in study.pair}
        rows.append(_shown(study, f"KA-F5{letter}", shares))
    square = {m: study.third[m].rsspe for m in ("ecmkf", "emekf", "emekf, R only", "ekf")}
    verdict = share(square["emekf"] < square["ecmkf"])
    mean = {f"{m}, m": float(np.mean(value)) for m, value in square.items()}
    return [*rows, _shown(study, "KA-F5d", {"EMEKF the better one": verdict}, mean)]


def _shown(
    study: Study, name: str, found: dict[str, Any], more: dict[str, float] | None = None
) -> Claim:
    """Verdicts on the substitute are parts; the figure's own cannot be had."""
    stated = study.table["figures"][name]["published"]
    why = f"share of noises; {_stand_in(study)}"
    return row(
        study,
        "figures",
        name,
        ours={f"share of noises, {label}": value for label, (value, _) in found.items()}
        | (more or {}),
        verdict="cannot be checked",
        assumption=f"{_stand_in(study)}; {reasons(study, 'set_3', 'well_within')}. {LEAK}",
        parts=tuple(
            part(name, label, stated.replace("Set 3", "the substitute"), value, verdict, why)
            for label, (value, verdict) in found.items()
        ),
    )
