"""bordonaro's claims and future work, each with a verdict.

Claims are made of what its figures show, and of misprints that would decide otherwise.
"""

import numpy as np

from boresight.experiments.consistency import bias, nearer
from boresight.experiments.papers import bordonaro_doppler as doppler
from boresight.experiments.papers.bordonaro_printed import square_error
from boresight.experiments.papers.bordonaro_rows_doppler import superior, told
from boresight.experiments.papers.bordonaro_rows_tracks import rms
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.papers.bordonaro_tracks import OTHERS
from boresight.experiments.papers.bordonaro_words import (
    agree,
    at_scans,
    reasons,
    row,
    somewhere,
)
from boresight.experiments.verdicts import (
    Claim,
    less,
    of_differences,
    of_points,
    part,
    said,
    together,
)

Rows = dict[str, Claim]


def claims(study: Study, figures: Rows) -> list[Claim]:
    """BO-C1 to BO-C9."""
    return [
        _repeated(study, "BO-C1", figures["BO-F3"]),
        _less_square_error(study),
        _repeated(study, "BO-C3", figures["BO-F4"]),
        _repeated(study, "BO-C4", figures["BO-F5"], figures["BO-F6"]),
        _repeated(study, "BO-C5", figures["BO-F8"]),
        _repeated(study, "BO-C6", figures["BO-F9"]),
        _velocity(study, figures),
        _most_consistent(study, figures["BO-F12"]),
        _doppler(study, figures["BO-F14"]),
    ]


def _repeated(study: Study, name: str, *figures: Claim) -> Claim:
    """A claim that says what figures show."""
    return row(
        study,
        "claims",
        name,
        ours={f"see {figure.id}": figure.verdict for figure in figures},
        verdict=together([figure.verdict for figure in figures]),
        assumption="; ".join(figure.assumption for figure in figures),
        parts=tuple(each for figure in figures for each in figure.parts),
    )


def _less_square_error(study: Study) -> Claim:
    """MUCM below UCM, and the best factor below both; (22) as printed is no mean square."""
    found = study.square_errors
    gaps = {s: bias(one["mucm"] - one["ucm"]) for s, one in found.items()}
    value, error = (np.array([gap[i] for gap in gaps.values()]) for i in (0, 1))
    printed = study.printed("BO-S03")
    r, sr, s = printed["range_ft"], printed["sigma_range_ft"], np.radians(max(found))
    literal = float(square_error(np.exp(-s * s / 2.0), r, sr, s))
    return row(
        study,
        "claims",
        "BO-C2",
        ours={
            f"{sigma:g}°: MSE, ft²": {name.upper(): float(np.mean(e)) for name, e in one.items()}
            for sigma, one in found.items()
        },
        verdict=of_differences(value, error),
        assumption=f"{study.runs('BO-S02')} runs, paired; MMSE is the factor (23), told the range",
        parts=(
            part(
                "BO-C2",
                "(22) as printed",
                "MSE of MUCM",
                literal,
                said(literal >= 0.0),
                "a mean square is not negative (erratum B2)",
            ),
        ),
    )


def _velocity(study: Study, figures: Rows) -> Claim:
    """Section 3.1, sentence by sentence."""
    position, velocity = figures["BO-F10"], figures["BO-F11"]
    ducm = study.way["DUCM"]
    along = {"unbiased position": bias(ducm.along), "biased velocity": bias(ducm.velocity_along)}
    place, speed = (less(-np.abs(b.value), b.standard_error) for b in along.values())
    verdicts = {
        "unbiased position": of_points(~place, place),
        "biased velocity": somewhere(speed, np.False_),
    }
    shift = np.abs(along["unbiased position"].value)
    k = int(np.argmax(shift))
    return row(
        study,
        "claims",
        "BO-C7",
        ours={"see BO-F10": position.verdict, "see BO-F11": velocity.verdict} | verdicts,
        verdict=together([position.verdict, velocity.verdict, *verdicts.values()]),
        assumption=f"{velocity.assumption}. DUCM's position is biased too: at scan {k + 1} by "
        f"{shift[k]:.0f} ft of an error of {rms(ducm, 'square')[k]:.0f}",
        parts=(
            *velocity.parts,
            *(
                part("BO-C7", name, "along the line of sight", at_scans(along[name].value), verdict)
                for name, verdict in verdicts.items()
            ),
        ),
    )


def _most_consistent(study: Study, figure: Claim) -> Claim:
    """Figure 12, and the same at another sampling time."""
    found = {name: bias(one.nees) for name, one in study.seldom.items()}
    value, error = nearer(found["DUCM"], [found[name] for name in OTHERS], 1.0)
    return row(
        study,
        "claims",
        "BO-C8",
        ours={"see BO-F12": figure.verdict},
        verdict=figure.verdict,
        assumption=figure.assumption,
        parts=(
            *figure.parts,
            part(
                "BO-C8",
                f"every {study.assumed['dt_tried_s']:g} s",
                "closest to one",
                {name: at_scans(one.value) for name, one in found.items()},
                of_differences(value[:, 1:], error[:, 1:]),
                reasons(study, "dt_tried_s"),
            ),
        ),
    )


def _doppler(study: Study, figure: Claim) -> Claim:
    """Figure 14, and the last sentence of section 4.3."""
    found, standard = study.caveat, doppler.STANDARD
    worse = superior(found, standard, "DUCM") | {"bias": superior(found, "DUCM", standard)["bias"]}
    caveat = together([worse["MSE"], worse["ANEES"], worse["bias"]])
    literal, right = study.nullified
    bearing, sigma = study.assumed["caveat_bearing_deg"], study.assumed["caveat_sigma_deg"]
    return row(
        study,
        "claims",
        "BO-C9",
        ours={"see BO-F14": figure.verdict, "small bearing, large sigma": caveat},
        verdict=together([figure.verdict, caveat]),
        assumption=figure.assumption,
        parts=(
            *figure.parts,
            part(
                "BO-C9",
                "small bearing, large sigma",
                "MSE and ANEES worse, bias still better",
                told(found) | dict(worse),
                caveat,
                f"bearing {bearing:g}°, sigma {sigma:g}°; {reasons(study, 'caveat_sigma_deg')}",
            ),
            part(
                "BO-C9",
                "(37) as printed",
                "unbiased",
                {"as printed": float(literal.value), "as corrected": float(right.value)},
                said(agree(literal, 0.0)),
                "bias of single plots, ft/s; erratum B6",
            ),
        ),
    )


def future(study: Study) -> list[Claim]:
    """BO-W1 and BO-W2: what the paper leaves to others, and what we made of it."""
    space, rated, plain = study.spherical, study.with_range_rate, study.way["DUCM"]
    ratio = rms(rated, "velocity_square") / rms(plain, "velocity_square")
    return [
        row(
            study,
            "future",
            "BO-W1",
            ours={
                name: {
                    "ANEES": at_scans(np.mean(one.nees, axis=0)),
                    "bias, ft": at_scans(np.mean(one.along, axis=0)),
                }
                for name, one in space.items()
            },
            verdict="cannot be checked",
            assumption="nothing is printed; here spherical conversions of a target at rest, at "
            f"elevation {study.assumed['spherical_elevation_deg']:g}°, {study.runs('BO-S05')} runs",
        ),
        row(
            study,
            "future",
            "BO-W2",
            ours={
                "ANEES": at_scans(np.mean(rated.nees, axis=0)),
                "median NEES per state": at_scans(np.median(rated.nees, axis=0)),
                "share of runs above ten": at_scans(np.mean(rated.nees > 10.0, axis=0)),
                "velocity RMSE over that without range rate": at_scans(ratio),
            },
            verdict="cannot be checked",
            assumption="nothing is printed; here the range-rate tracker on Figure 10's targets, "
            f"range rate as good as Figure 14's, {study.runs('BO-S06')} runs; where the average is "
            "far above the median, the few runs above ten make it",
        ),
    ]
