"""kashyap's Figures 3 to 8, each with a verdict.

Curves are not given as numbers, so what the text says of them is judged, by the share of our runs
in which it is true.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from boresight.experiments.papers.kashyap_runs import Tracked
from boresight.experiments.papers.kashyap_study import Study
from boresight.experiments.papers.kashyap_words import comparable, leak, reasons, row, share
from boresight.experiments.verdicts import (
    Claim,
    band_of,
    part,
    together,
)

Array = Any
_BOUNDS = "bounds are 2 sqrt(H P H') of the filter itself (erratum K9)"
_TOO_WIDE = (
    "; EMEKF's are too wide, because R is that of plots as they were, and corrected plots are "
    "better (KA-E1)"
)


def figures(study: Study) -> list[Claim]:
    """KA-F3a to KA-F8."""
    found = []
    for number, one in (("3", study.first), ("4", study.second)):
        found += [_within(study, f"KA-F{number}a", one)]
        found += [_initially(study, f"KA-F{number}{'abc'[i]}", one, i) for i in (1, 2)]
        found += [_positions(study, f"KA-F{number}d", one)]
    return [
        *found,
        *_averaged(study),
        *_third(study),
        noise(study, "figures", "KA-F6"),
        _chart(study),
        blocks(study, "figures", "KA-F8"),
    ]


def _well_within(study: Study, one: Tracked, axis: int) -> Array:
    """Whether a run's errors of range or an angle are well within its bounds, (runs,)."""
    inside = np.abs(one.off[..., axis]) <= one.bounds[..., axis]
    return np.mean(inside, axis=1) >= study.assumed["well_within"]


def _within(study: Study, name: str, found: Mapping[str, Tracked]) -> Claim:
    """Figures 3(a) and 4(a)."""
    true = {method: _well_within(study, found[method], 0) for method in study.pair}
    shares = {method: share(runs) for method, runs in true.items()}
    return row(
        study,
        "figures",
        name,
        ours={f"share of runs, {method}": value for method, (value, _) in shares.items()},
        verdict=together([verdict for _, verdict in shares.values()]),
        assumption=f"{reasons(study, 'well_within')}; {_BOUNDS}"
        + (_TOO_WIDE if study.reading.correction == "same epoch" else ""),
    )


def _initially(study: Study, name: str, found: Mapping[str, Tracked], axis: int) -> Claim:
    """Figures 3(b), 3(c), 4(b) and 4(c): by either filter's bounds, for the paper names neither."""
    error, early = np.abs(found["ecmkf"].off[..., axis]), int(study.assumed["initial_scans"])
    ours, verdicts = {}, []
    for method in study.pair:
        outside = error > found[method].bounds[..., axis]
        first, later = np.mean(outside[:, :early], axis=1), np.mean(outside[:, early:], axis=1)
        allowed = 1.0 - study.assumed["well_within"]
        true, verdict = share((first > allowed) & (first > later))
        verdicts.append(verdict)
        ours[f"by the bounds of {method}"] = {
            "share of runs": true,
            "outside at first": float(np.mean(first)),
            "outside later": float(np.mean(later)),
        }
    return row(
        study,
        "figures",
        name,
        ours=ours,
        verdict=together(verdicts),
        assumption="true of a run if more of its first scans are outside than two standard "
        f"deviations allow, and more than later; {reasons(study, 'initial_scans')}. Whose bounds "
        "are drawn is not said. ECMKF's own contain nearly all its errors of angle: they are as "
        "wide as a diagonal Cartesian R makes them",
    )


def _positions(study: Study, name: str, found: Mapping[str, Tracked]) -> Claim:
    """Figures 3(d) and 4(d)."""
    ratio = found["emekf"].rsspe / found["ecmkf"].rsspe
    alike = name == "KA-F3d"
    true, verdict = share(comparable(study, ratio) if alike else ratio < 1.0)
    return row(
        study,
        "figures",
        name,
        ours={
            "EMEKF/ECMKF": float(np.median(ratio)),
            "share of runs": true,
        },
        band={"EMEKF/ECMKF": band_of(ratio)},
        verdict=verdict,
        assumption=(f"{reasons(study, 'comparable')}; " if alike else "")
        + "root sum square position error, averaged over each run. "
        + leak(study),
    )


def _averaged(study: Study) -> list[Claim]:
    """Figures 4(e) and 4(f): averages over the noises of each truth."""
    rows = []
    for name, field in (("KA-F4e", "elevation"), ("KA-F4f", "rsspe")):
        mean = {m: np.mean(getattr(one, field), axis=1) for m, one in study.many.items()}
        ratio = mean["emekf"] / mean["ecmkf"]
        true, verdict = share(ratio < 1.0)
        rows.append(
            row(
                study,
                "figures",
                name,
                ours={"EMEKF/ECMKF": float(np.median(ratio)), "share of truths": true},
                band={"EMEKF/ECMKF": band_of(ratio)},
                verdict=verdict,
                assumption=f"{study.truths} truths, each with {study.assumed['noises_per_truth']} "
                f"noises, averaged over noises and scans. {leak(study)}",
            )
        )
    return rows


def _third(study: Study) -> list[Claim]:
    """Figure 5, whose Set 3 is not to be had: what a substitute says."""
    rows = []
    for axis, letter in enumerate("abc"):
        shares = {m: share(_well_within(study, study.third[m], axis)) for m in study.pair}
        rows.append(_substituted(study, f"KA-F5{letter}", shares))
    square = {m: study.third[m].rsspe for m in ("ecmkf", "emekf", "emekf, R only", "ekf")}
    verdict = share(square["emekf"] < square["ecmkf"])
    mean = {f"{m}, m": float(np.mean(value)) for m, value in square.items()}
    return [*rows, _substituted(study, "KA-F5d", {"EMEKF the better one": verdict}, mean)]


def _substituted(
    study: Study, name: str, found: dict[str, Any], more: dict[str, float] | None = None
) -> Claim:
    """Verdicts on the substitute are parts; the figure's own cannot be had."""
    stated = study.table["figures"][name]["published"]
    why = f"share of noises; {study.stand_in}"
    return row(
        study,
        "figures",
        name,
        ours={f"share of noises, {label}": value for label, (value, _) in found.items()}
        | (more or {}),
        verdict="cannot be checked",
        assumption=f"{study.stand_in}; {reasons(study, 'set_3', 'well_within')}. {leak(study)}",
        parts=tuple(
            part(name, label, stated.replace("Set 3", "the substitute"), value, verdict, why)
            for label, (value, verdict) in found.items()
        ),
    )


def noise(study: Study, kind: str, name: str) -> Claim:
    """Figure 6 and the claim on it: run by run, R averaged over the scans."""
    true = np.ones(study.runs, dtype=bool)
    ours, bands = {}, {}
    for other in ("cmkf-d-t", "cmkf-d-m"):
        for axis, label in enumerate("xy"):
            ratio = study.noises.mean["ecmkf"][:, axis] / study.noises.mean[other][:, axis]
            ours[f"R_{label}{label} to {other}"] = float(np.median(ratio))
            bands[f"R_{label}{label} to {other}"] = band_of(ratio)
            true &= comparable(study, ratio)
    found, verdict = share(true)
    low, high = study.noises.swing
    full = study.reading.window
    window = f", once the window of {full} differences is full" if full else ""
    return row(
        study,
        kind,
        name,
        ours=ours | {"share of runs": found},
        band=bands,
        verdict=verdict,
        assumption=f"averaged over the scans of each run of Set 4{window}; "
        f"{reasons(study, 'comparable')}. It is so by construction: R is that of plots as they "
        f"were. At one scan ECMKF's R is {low:.2g} to {high:.2g} of CMKF-D-T's, 5 to 95 %",
    )


def _chart(study: Study) -> Claim:
    """Figure 7: in how many of the channels of Sets 1, 2 and 4 EMEKF is the best."""
    found = {"Set 1": study.first, "Set 2": study.second, "Set 4": study.fourth}
    wins = [
        np.all([one["emekf"].pfe[c] <= one[m].pfe[c] for m in _compared(one)], axis=0)
        for one in found.values()
        for c in one["emekf"].pfe
    ]
    best = np.mean(wins, axis=0)
    true, verdict = share(best > 0.5)
    return row(
        study,
        "figures",
        "KA-F7",
        ours={
            "share of runs in which EMEKF is best in most channels": true,
            "share of channels in which it is, median": float(np.median(best)),
        },
        verdict=verdict,
        assumption=f"of the {len(wins)} channels of Sets 1, 2 and 4, 'most of the time' being more "
        f"than half of them. {leak(study)}",
    )


def _compared(one: Mapping[str, Tracked]) -> list[str]:
    return [name for name in ("ecmkf", "cmkf-d-t", "cmkf-d-m") if name in one]


def blocks(study: Study, kind: str, name: str) -> Claim:
    """Figure 8 and the claim on it, by where R comes from."""
    parts = []
    for reading, found in study.blocks.items():
        mean = {m: np.mean(one.rsspe, axis=1) for m, one in found.items()}
        ratio = mean["sequential"] / mean["block"]
        true, verdict = share(ratio < 1.0)
        ours = {
            "sequential, m": float(np.mean(mean["sequential"])),
            "block, m": float(np.mean(mean["block"])),
            "share of truths": true,
        }
        why = "share of truths in which sequential has the lower error, averaged over noises"
        parts.append(
            part(name, reading, "sequential is slightly better", ours, verdict, why, band_of(ratio))
        )
    return row(
        study,
        kind,
        name,
        ours={each.id.removeprefix(f"{name} "): each.ours for each in parts},
        band={each.id.removeprefix(f"{name} "): each.band for each in parts},
        verdict=together([each.verdict for each in parts]),
        assumption=f"root sum square position error, {study.truths} truths with "
        f"{study.assumed['noises_per_truth']} noises each; the band is that of the ratio "
        f"sequential/block over truths. It depends on R. {reasons(study, 'mu')}. With corrected "
        "plots the angles' innovations are small, but the range correction still takes off the R "
        "of plots as they were: an offset in range that block processing has too, a little less",
        parts=tuple(parts),
    )
