"""bordonaro's figures of single plots, 1 to 5 and 7, each with a verdict on what it shows."""

import numpy as np

from boresight.experiments.consistency import Bias, bias
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.papers.bordonaro_tracks import OTHERS
from boresight.experiments.papers.bordonaro_words import agree, reasons, row
from boresight.experiments.verdicts import (
    Claim,
    less,
    of_differences,
    of_points,
    of_share,
    part,
    said,
    together,
)
from boresight.models.motion import Static
from boresight.models.sensors import Pose, Radar

_RARE = 0.001  # chance of calling an unbiased conversion biased


def figure_1(study: Study) -> Claim:
    """(2) through a pose: the drawing has no numbers, its equation has."""
    turn, offset, seen = 0.7, np.array([31.0, -17.0]), np.array([42.0, 9.0])
    c, s = np.cos(turn), np.sin(turn)
    reference = np.array([[c, -s], [s, c]]) @ seen + offset  # (2)
    rows = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    pose = Pose(position_m=np.array([*offset, 0.0]), rotation=rows)
    back, _ = Radar(range_m=1.0, azimuth_deg=1.0, pose=pose).relative(
        reference, Static(dims=2).dims
    )
    return row(
        study,
        "figures",
        "BO-F1",
        ours={"(2) is what a sensor's pose undoes": bool(np.allclose(back, seen, rtol=1e-12))},
        verdict="cannot be checked",
        assumption="a drawing without numbers",
    )


def figure_2(study: Study) -> Claim:
    """The plain conversion's bias, and its printed size (erratum B1)."""
    printed = study.printed("BO-S01")
    r, s2 = printed["range_ft"], np.radians(printed["sigma_bearing_deg"][0]) ** 2
    shown, many = bias(study.few[:, 0] - r), Bias(*(each[0] for each in study.many))
    sizes = {
        "as printed": float(r * np.expm1(s2 / 2.0)),
        "as corrected": float(-r * np.expm1(-s2 / 2.0)),
    }
    return row(
        study,
        "figures",
        "BO-F2",
        ours=_size(shown),
        verdict=of_differences(shown.value, shown.standard_error),
        assumption=f"{len(study.few)} runs; negative is toward the sensor",
        parts=tuple(
            part("BO-F2", f"magnitude {name}", size, _size(many), said(agree(many, -size)), why)
            for (name, size), why in zip(
                sizes.items(), ("r(e^(s²/2) - 1)", "r(1 - e^(-s²/2)), erratum B1"), strict=True
            )
        ),
    )


def _size(mean: Bias) -> dict[str, float]:
    return {"bias, ft": float(mean.value), "standard error": float(mean.standard_error)}


def figure_3(study: Study) -> Claim:
    """UCM unbiased at all bearings: Hotelling's test of each mean error, Fisher's of them all.

    With covariances from n runs, (n - 2) log(1 + T²/(n - 1)) of a mean error in the plane is a
    chi-square of two degrees of freedom; with many runs it is T² itself.
    """
    from scipy.special import chdtri

    clouds, runs = study.clouds, study.runs("BO-S02")
    squares = np.array(
        [c.mean.value @ np.linalg.pinv(c.cov) @ c.mean.value for c in clouds.values()]
    )
    statistic = float(np.sum((runs - 2) * np.log1p(squares / max(runs - 1, 1))))
    limit = float(chdtri(2 * len(clouds), _RARE))
    errors = {f"{b:g}°: x, y, ft": [float(e) for e in c.mean.value] for b, c in clouds.items()}
    return row(
        study,
        "figures",
        "BO-F3",
        ours=errors | {"chi-square of all": statistic},
        band={"chi-square of all": (0.0, limit)},
        verdict=said(statistic <= limit),
        assumption=f"mean errors of {runs} runs a bearing; an unbiased conversion "
        f"passes in 999 of 1,000; {reasons(study, 'histogram_bearings_deg')}",
    )


def figure_4(study: Study) -> Claim:
    """NES of UCM and MUCM."""
    return _consistency(study, "BO-F4", OTHERS)


def figure_7(study: Study) -> Claim:
    """NES of DUCM."""
    return _consistency(study, "BO-F7", ("DUCM",), "nes_scans")


def _consistency(study: Study, name: str, methods: tuple[str, ...], *assumed: str) -> Claim:
    cells = {key: nes for key, nes in study.cells.items() if key[0] in methods}
    groups = {
        f"{m} {s:g}°": [nes for k, nes in cells.items() if k[:2] == (m, s)] for m, s, _ in cells
    }
    inside = np.mean([n.total.low <= n.total.value <= n.total.high for n in cells.values()])
    modest = [np.mean([n.along.value < n.along.low for n in group]) for group in groups.values()]
    total, along = of_share(float(inside)), of_share(float(max(modest)))
    low, high = next(iter(cells.values())).total[1:3]
    return row(
        study,
        "figures",
        name,
        ours={
            group: {
                "total": float(np.mean([n.total.value for n in found])),
                "along the true bearing": float(np.mean([n.along.value for n in found])),
            }
            for group, found in groups.items()
        },
        band={"total": (low, high)},
        verdict=together([total, along]),
        assumption=f"averages over bearings, of {study.runs('BO-S03')} runs each; the bounds are "
        f"exact for normal errors only; {reasons(study, 'nes_bearings_deg', *assumed)}",
        parts=(
            part(name, "total", "inside the bounds", {"share of points": float(inside)}, total),
            part(
                name,
                "along the true bearing",
                "below the bounds",
                {group: float(share) for group, share in zip(groups, modest, strict=True)},
                along,
                "share of bearings; judged at the noise that shows it best",
            ),
        ),
    )


def figure_5(study: Study) -> Claim:
    """Batch least squares, judged where UCM's bias is more than chance."""
    sigmas, batches = study.assumed["batch_sigma_bearing_deg"], study.batches.values()
    ucm, mucm = (np.array([batch[name] for batch in batches]) for name in ("ucm", "mucm"))
    clear = less(-np.abs(ucm[..., 0]), ucm[..., 1])
    smaller = (np.abs(mucm) < np.abs(ucm))[..., 0][clear]
    r = study.printed("BO-S02")["range_ft"]
    at = int(np.argmin(np.abs(np.array(sigmas) - study.printed("BO-S02")["sigma_bearing_deg"][0])))
    return row(
        study,
        "figures",
        "BO-F5",
        ours={name.upper(): float(values[at, 0]) for name, values in study.batches[r].items()},
        verdict=of_points(smaller, ~smaller) if len(smaller) else "in band",
        assumption=f"bias, ft, at {r:g} ft and {sigmas[at]:g}°, of one batch, as printed, and so "
        f"with its chance error; UCM's is more than that at {len(smaller)} of {clear.size} points, "
        f"MUCM's smaller at {int(np.sum(smaller))} of these; DUCM is conditioned on the true "
        f"place; {reasons(study, 'batch_sigma_bearing_deg')}",
    )
