"""bordonaro's figures of filters: Figures 6 and 8 to 12, each with a verdict on what it shows."""

from typing import Any

import numpy as np

from boresight.experiments.consistency import Bias, bias, nearer
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.papers.bordonaro_tracks import OTHERS, PRINTED, Tracked
from boresight.experiments.papers.bordonaro_words import (
    agree,
    at_scans,
    reasons,
    row,
    somewhere,
)
from boresight.experiments.verdicts import (
    Claim,
    Verdict,
    less,
    of_differences,
    of_points,
    part,
    said,
    together,
)

Array = Any
_NEGLIGIBLE = 0.1  # of another filter's bias, root mean square over the scans
_EQUAL = 0.005  # of a root mean square error: less no curve would show


def figure_6(study: Study) -> Claim:
    """Recursive bias of UCM and MUCM: how it starts and where it goes."""
    ours: dict[str, Any] = {}
    verdicts = []
    for sigma, found in study.rest.items():
        ucm, mucm = bias(found["UCM"].along), bias(found["MUCM"].along)
        shrunk = bias(found["MUCM"].along[:, 0] + np.abs(mucm.value[-1]))
        verdicts += [
            said(agree(Bias(*(each[0] for each in ucm)), 0.0)),
            of_differences(-ucm.value[-1], ucm.standard_error[-1]),
            of_differences(mucm.value[0], mucm.standard_error[0]),
            of_differences(shrunk.value, shrunk.standard_error),
        ]
        ours |= {f"UCM {sigma:g}°": at_scans(ucm.value), f"MUCM {sigma:g}°": at_scans(mucm.value)}
    return row(
        study,
        "figures",
        "BO-F6",
        ours=ours,
        verdict=together(verdicts),
        assumption=f"bias along the line of sight, ft, {study.runs('BO-S05')} runs; UCM's is none "
        "at the first scan and positive at the last, MUCM's negative at the first, and then less",
    )


def figure_8(study: Study) -> Claim:
    """DUCM's bias beside the others': root mean square over the scans."""
    found = {name: bias(one.along) for name, one in study.large.items()}
    size = {name: float(np.sqrt(np.mean(np.square(b.value)))) for name, b in found.items()}
    ducm = found["DUCM"]
    clear = int(np.sum(less(-np.abs(ducm.value), ducm.standard_error)))
    k = int(np.argmax(np.abs(ducm.value)))
    verdicts = {name: _negligible(size["DUCM"] / size[name]) for name in OTHERS}
    return row(
        study,
        "figures",
        "BO-F8",
        ours={"DUCM": at_scans(ducm.value)} | {f"{n}, rms over scans": v for n, v in size.items()},
        verdict=together(list(verdicts.values())),
        assumption=f"bias along the line of sight, ft, {study.runs('BO-S05')} runs; negligible: at "
        f"most {_NEGLIGIBLE:.0%} of another's, root mean square over scans. DUCM's is a transient, "
        f"largest at scan {k + 1}: {ducm.value[k]:.0f} ± {ducm.standard_error[k]:.0f}, "
        f"{abs(ducm.value[k] / found['UCM'].value[k]):.0%} of UCM's there; at {clear} of "
        f"{len(ducm.value)} scans it is told from zero",
        parts=(
            *(
                part("BO-F8", f"beside {name}", "negligible", size["DUCM"] / size[name], verdict)
                for name, verdict in verdicts.items()
            ),
            part(
                "BO-F8",
                "as printed, beside UCM",
                "negligible",
                size[PRINTED] / size["UCM"],
                _negligible(size[PRINTED] / size["UCM"]),
                "with (26) to (30) as printed, errata B3 to B5",
            ),
        ),
    )


def _negligible(ratio: float) -> Verdict:
    """In band: smaller, but not negligible."""
    if ratio <= _NEGLIGIBLE:
        return "reproduces"
    return "in band" if ratio < 1.0 else "does not reproduce"


def gaps(found: dict[str, Tracked], of: str) -> Bias:
    """What DUCM's mean squares are above the others', paired by run, (others, scans)."""
    pairs = [getattr(found["DUCM"], of) - getattr(found[name], of) for name in OTHERS]
    return bias(np.stack(pairs, axis=1))


def rms(one: Tracked, of: str) -> Array:
    """Root mean square error (scans,)."""
    return np.sqrt(np.mean(getattr(one, of), axis=0))


def _excess(found: dict[str, Tracked], of: str) -> Array:
    """DUCM's root mean square over another's, less 1, (others, scans)."""
    return np.array([rms(found["DUCM"], of) / rms(found[name], of) - 1.0 for name in OTHERS])


def _squares(study: Study, name: str, found: dict[str, Tracked], runs: int) -> Claim:
    """DUCM as good as the others at each scan, or better; ties are no fault, but are told."""
    gap, excess = gaps(found, "square"), _excess(found, "square")
    better = less(gap.value, gap.standard_error) & (excess < -_EQUAL)
    worse = less(-gap.value, gap.standard_error) & (excess > _EQUAL)
    tied = [int(k) + 1 for k in np.flatnonzero(np.any(~better & ~worse, axis=0))]
    return row(
        study,
        "figures",
        name,
        ours={method: at_scans(rms(one, "square")) for method, one in found.items()},
        verdict=of_points(~worse, worse),
        assumption=f"root mean square position errors, ft, {runs} runs, DUCM's after (31); equal: "
        f"not told apart, or by less than {_EQUAL:.1%}. Better than both at "
        f"{int(np.sum(np.all(better, axis=0)))} of {len(better[0])} scans, equal to one at scans "
        f"{tied}, worse by at most {max(float(np.max(excess)), 0.0):.3%}",
    )


def figure_9(study: Study) -> Claim:
    """Position MSE at rest."""
    return _squares(study, "BO-F9", study.large, study.runs("BO-S05"))


def figure_10(study: Study) -> Claim:
    """Position MSE under way."""
    return _squares(study, "BO-F10", study.way, study.runs("BO-S06"))


def figure_11(study: Study) -> Claim:
    """Velocity MSE: where DUCM is worse than one of the others, and where better than both."""
    gap, excess = gaps(study.way, "velocity_square"), _excess(study.way, "velocity_square")
    better, worse = (less(sign * gap.value, gap.standard_error) for sign in (1.0, -1.0))
    half = better.shape[1] // 2
    early = somewhere(worse[:, :half], better[:, :half])
    late = of_points(better[:, half:], worse[:, half:])
    spans = [(name, np.flatnonzero(w) + 1) for name, w in zip(OTHERS, worse, strict=True)]
    told = ", ".join(f"{name}'s at scans {s[0]} to {s[-1]}" for name, s in spans if len(s))
    return row(
        study,
        "figures",
        "BO-F11",
        ours={name: at_scans(rms(one, "velocity_square")) for name, one in study.way.items()},
        verdict=together([early, late]),
        assumption=f"root mean square velocity errors, ft/s, {study.runs('BO-S06')} runs; worse "
        f"than {told or 'none'}; 'later' is the second half",
        parts=(
            part(
                "BO-F11",
                "initial scans",
                "slightly worse",
                {name: float(np.max(e)) for name, e in zip(OTHERS, excess, strict=True)},
                early,
                "by how much at most, as a share of the other's root mean square",
            ),
            part("BO-F11", "later scans", "best", float(np.mean(better[:, half:])), late),
        ),
    )


def figure_12(study: Study) -> Claim:
    """ANEES under way: distance from one."""
    found = {name: bias(one.nees) for name, one in study.way.items()}
    others = [found[name] for name in OTHERS]
    value, error = nearer(found["DUCM"], others, 1.0)
    same = np.arange(value.shape[1]) == 0
    return row(
        study,
        "figures",
        "BO-F12",
        ours={name: at_scans(one.value) for name, one in found.items()},
        verdict=of_points(less(value, error) | same, less(-value, error) & ~same),
        assumption=f"{study.runs('BO-S06')} runs; judged by the distance from one; at the first "
        f"scan all are alike (erratum B9); {reasons(study, *study.printed('BO-S06')['open'])}",
        parts=(
            part(
                "BO-F12",
                "as printed",
                "closest to one",
                at_scans(found[PRINTED].value),
                of_differences(*nearer(found[PRINTED], others, 1.0)),
                "with (26) to (30) as printed, errata B3 to B5",
            ),
        ),
    )
