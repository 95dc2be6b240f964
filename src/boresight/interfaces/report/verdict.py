"""The verdict: what a reader must know, in sentences with figures, each with its evidence."""

import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from boresight.interfaces.report.beside import sentence
from boresight.interfaces.report.consistency import chi_square_median
from boresight.interfaces.report.plan import classes, title
from boresight.interfaces.report.residuals import column, measured, robust_sd
from boresight.interfaces.report.words import figure, percent

if TYPE_CHECKING:
    from boresight.tracking.result import Comparison, TrackingResult

NIS_LOW, NIS_HIGH = 0.8, 1.25  # beyond these the stated sd is off by more than 12 %
ENOUGH_USED = 0.95
SCATTER_OFF = 1.15
TAIL = 0.7  # of chi-square's median; a lower one means outliers


class Sentence(NamedTuple):
    """One finding: its mark (`good`, `attention`, `note`), HTML text and the panel behind it."""

    mark: str
    html: str
    link: str


def sentences(
    result: "TrackingResult",
    comparisons: "Sequence[Comparison]" = (),
    as_seen: "Sequence[Comparison]" = (),
    inspection: dict[str, Any] | None = None,
) -> list[Sentence]:
    """Return the verdict of a result, most important first."""
    parts = (
        _against_truth(comparisons, as_seen),
        _straight(result),
        _turns(result),
        _beside(result),
        _scatter(result),
        _use(result),
        _targets(result),
        _fixed(result),
        damage(inspection or {}),
    )
    return [sentence for part in parts for sentence in part]


def _against_truth(
    comparisons: "Sequence[Comparison]", as_seen: "Sequence[Comparison]"
) -> Iterator[Sentence]:
    if not comparisons:
        return
    best = min(comparisons, key=lambda each: each.position_rmse_m)
    text = (
        f"Against the known truth the smallest position error is that of {escape(best.filter)}: "
        f"{figure(best.position_rmse_m, 3)} m, with {figure(best.velocity_rmse_mps, 3)} m/s in "
        f"velocity (root mean square). ANEES, 1 if consistent, is {_consistencies(comparisons)}."
    )
    yield Sentence("good" if all(map(_is_inside, comparisons)) else "attention", text, "filters")
    if as_seen:
        least = min(each.position_rmse_m for each in as_seen)
        text = (
            "Against the truth as this sensor sees it, its systematic errors left in, that error "
            f"is {figure(least, 3)} m, and ANEES is {_consistencies(as_seen)}. The difference is "
            "the sensor's, not the filter's: it is what a calibration is worth."
        )
        yield Sentence("good" if all(map(_is_inside, as_seen)) else "attention", text, "filters")


def _is_inside(each: "Comparison") -> bool:
    return each.anees_bounds[0] <= each.anees <= each.anees_bounds[1]


def _consistencies(comparisons: "Sequence[Comparison]") -> str:
    return ", ".join(f"{escape(each.filter)} {_consistency(each)}" for each in comparisons)


def _consistency(each: "Comparison") -> str:
    low, high = each.anees_bounds
    word = "above" if each.anees > high else "below" if each.anees < low else "inside"
    return f"{each.anees:.2f} ({word} the 95 % band {low:.2f} to {high:.2f})"


def _straight(result: "TrackingResult") -> Iterator[Sentence]:
    half, straight = (result.nis.get(name, {}) for name in ("straight_second_half", "straight"))
    nis, where = half, "On straight flight, in the half of the recording not used for tuning, "
    if not _is_known(nis):
        nis, where = straight, "On straight flight "
    if not _is_known(nis):
        nis, where = result.nis.get("all", {}), "Over all scans "
    if not _is_known(nis):
        yield Sentence("note", "No plot was compared with a prediction.", "consistency")
        return
    mean, tail = nis["mean"], _tail(nis)
    yield Sentence(
        "good" if NIS_LOW <= mean <= NIS_HIGH and not tail else "attention",
        f"{where}NIS per degree of freedom is {mean:.2f} on average (median "
        f"{nis['median']:.2f}; {nis['scans']:,.0f} plots): {_meaning(mean)}{tail}.",
        "consistency",
    )


def _is_known(nis: dict[str, float]) -> bool:
    return bool(nis.get("scans")) and math.isfinite(nis.get("mean", math.nan))


def _meaning(mean: float) -> str:
    ratio = math.sqrt(mean)
    if mean > NIS_HIGH:
        return f"errors are {ratio:.2f} times what the filter states, it is too confident"
    if mean < NIS_LOW:
        return f"errors are {ratio:.2f} times what the filter states, it is too cautious"
    return f"errors are {ratio:.2f} times what the filter states"


def _tail(nis: dict[str, float]) -> str:
    """Say so where a few large errors hide behind a mean that looks right."""
    expected = chi_square_median(nis)
    if nis["median"] > TAIL * expected:
        return ""
    return (
        f". But the median of a chi-square law would be {expected:.2f}: most errors are smaller, "
        "and a few much larger, than stated"
    )


def _turns(result: "TrackingResult") -> Iterator[Sentence]:
    every, straight = result.nis.get("all", {}), result.nis.get("straight", {})
    if _is_known(every) and _is_known(straight) and every["mean"] > 1.1 * straight["mean"]:
        yield Sentence(
            "attention",
            f"Over all scans, turns included, NIS per degree of freedom is {every['mean']:.2f} "
            f"(median {every['median']:.2f}): a filter that assumes constant velocity lags behind "
            "a turn, and its covariance does not show it.",
            "consistency",
        )


def _beside(result: "TrackingResult") -> Iterator[Sentence]:
    if len(result.filters) > 1:
        yield Sentence("note", sentence(result), "side-by-side")
    failed = [f"{each.filter}: {each.remark}" for each in result.filters if each.remark]
    if failed:
        yield Sentence("attention", f"{escape('; '.join(failed))}.", "side-by-side")


def _scatter(result: "TrackingResult") -> Iterator[Sentence]:
    used = result.residuals.filter(result.residuals["used"])
    parts, ratios = [], []
    for quantity in measured(used):
        residual, sd = (column(used, name) for name in quantity.columns)
        measured_sd = robust_sd(residual[np.isfinite(residual)])
        stated = float(np.nanmedian(sd))
        parts.append(
            f"{quantity.words} {_sized(measured_sd, quantity.unit)} "
            f"(the filter expects {_sized(stated, quantity.unit)})"
        )
        ratios.append(measured_sd / stated if stated else math.nan)
    if parts:
        is_good = all(1 / SCATTER_OFF < ratio < SCATTER_OFF for ratio in ratios)
        html = (
            f"Residuals scatter by {'; '.join(parts)}. Scatter is half the width of the middle "
            "68 %, which outliers do not sway."
        )
        yield Sentence("good" if is_good else "attention", html, "residuals")


def _sized(value: float, unit: str) -> str:
    return figure(value, 3) + ("°" if unit == "°" else f" {unit}")


def _use(result: "TrackingResult") -> Iterator[Sentence]:
    share = result.used / result.plots if result.plots else 0.0
    unused = int(result.skipped["count"].sum() or 0)
    yield Sentence(
        "good" if share >= ENOUGH_USED else "attention",
        f"{figure(result.used)} of {figure(result.plots)} plots "
        f"({percent(result.used, result.plots)}) belong to {figure(len(result.targets))} tracks; "
        f"{figure(result.rejected)} lay outside their track's gate. Why {figure(unused)} were not "
        "used is listed.",
        "skipped",
    )


def _targets(result: "TrackingResult") -> Iterator[Sentence]:
    if result.targets.is_empty():
        return
    kinds, worst = classes(result.targets), result.targets.row(0, named=True)
    above, expected = int((kinds == 1).sum()), 0.025 * len(kinds)
    yield Sentence(
        "good" if above <= max(3 * expected, 1) else "attention",
        f"{above} of {len(kinds)} targets lie above their own 95 % band of NIS, where chance "
        f"alone would put {figure(expected, 2)}. The worst is {escape(title(worst))}.",
        "targets",
    )


def _fixed(result: "TrackingResult") -> Iterator[Sentence]:
    for row in result.targets.filter(result.targets["fixed"].fill_null(value=False)).to_dicts():
        yield Sentence(
            "note",
            f"{escape(_full_title(row))} does not move: over {figure(row['plots'])} plots its sd "
            f"is {figure(row['range_sd_m'], 3)} m in range and {figure(row['azimuth_sd_deg'], 3)}° "
            "in azimuth. That is the sensor's own noise on one strong reply, and less than an "
            "aircraft's.",
            "targets",
        )


def _full_title(row: dict[str, Any]) -> str:
    name, address = title(row), row["address"]
    return f"{address} ({name})" if address and address != name else name


def damage(inspection: dict[str, Any]) -> Iterator[Sentence]:
    """Say how many bytes of the file could not be read."""
    if "skipped_bytes" not in inspection:
        return
    skipped, whole = inspection["skipped_bytes"], inspection.get("bytes", 0)
    if skipped:
        text = f"{figure(skipped)} of {figure(whole)} bytes could not be read and were skipped."
        yield Sentence("attention", text, "recording")
    else:
        yield Sentence("good", f"All {figure(whole)} bytes of the file were read.", "recording")
