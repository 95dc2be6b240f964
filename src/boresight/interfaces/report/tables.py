"""The tables of the report, rendered here so that they need no script to be read."""

import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from boresight.interfaces.report.consistency import chi_square_median
from boresight.interfaces.report.plan import CLASSES, classes
from boresight.interfaces.report.words import (
    NIS_WORDS,
    Cell,
    clock,
    figure,
    label,
    number_cell,
    percent,
    table,
    text_cell,
)

if TYPE_CHECKING:
    from boresight.tracking.result import Comparison, TrackingResult

AGAINST_TRUTH = "Errors against the truth, horizontal; ANEES of a consistent filter is 1"
AS_SEEN = "Errors against the truth as this sensor, with its own systematic errors, would see it"
GLYPHS = ("●", "▲", "▼")
METER_DECADES = 1.0  # the little meter runs from 0.1 to 10, logarithmically


def targets(result: "TrackingResult") -> str:
    """Every target, worst first, with a meter of its NIS beside its own band."""
    rows = result.targets.to_dicts()
    kinds = classes(result.targets).tolist()
    heads = ["track", "address", "mode A", "identification", "from", "to", "plots"]
    heads += ["rejected", "restarts", "NIS/dof", "95 % band", "0.1 – 1 – 10", "verdict"]
    cells = [_target(row, kind) for row, kind in zip(rows, kinds, strict=True)]
    marks = [f' data-track="{row["track"]}"' for row in rows]
    caption = f"{len(rows):,} targets, worst first"
    return table(caption, heads, cells, name="target-table", sortable=True, row_attributes=marks)


def _target(row: dict[str, Any], kind: int) -> list[Cell]:
    cells = [number_cell(row["track"])]
    cells += [text_cell(row[name]) for name in ("address", "mode_a", "aircraft_id")]
    cells += [
        Cell(clock(row[name]), f"{row[name]:.3f}", is_figure=True) for name in ("first_s", "last_s")
    ]
    cells += [number_cell(row[name]) for name in ("plots", "rejected", "restarts")]
    band = f"{figure(row['nis_low'], 3)} – {figure(row['nis_high'], 3)}"
    cells += [
        number_cell(row["nis_per_dof"], 3),
        Cell(band, is_figure=True),
        Cell(_meter(row, kind)),
    ]
    return [*cells, _verdict(row, kind)]


def _verdict(row: dict[str, Any], kind: int) -> Cell:
    name, color, _ = CLASSES[kind]
    said = (row["verdict"] or name) + _scatter(row)
    glyph = f'<span style="color:{color}" aria-hidden="true">{GLYPHS[kind]}</span>'
    return Cell(f"{glyph} {escape(str(said))}", str(said))


def _scatter(row: dict[str, Any]) -> str:
    """Say how a target that does not move scatters."""
    if not row.get("fixed"):
        return ""
    return f"; fixed, sd {figure(row['range_sd_m'], 3)} m, {figure(row['azimuth_sd_deg'], 3)}°"


def _place(value: float | None) -> float:
    """Return where a value lies on the meter, 0 to 100."""
    if value is None or not math.isfinite(value) or value <= 0:
        return 0.0
    return min(max(50 + 50 * math.log10(value) / METER_DECADES, 0.0), 100.0)


def _meter(row: dict[str, Any], kind: int) -> str:
    low, high, here = (_place(row[name]) for name in ("nis_low", "nis_high", "nis_per_dof"))
    return (
        '<svg class="meter" viewBox="0 0 100 12" aria-hidden="true"><path d="M0 6H100M50 1V11"/>'
        f'<rect x="{low:.1f}" y="3" width="{max(high - low, 1.5):.1f}" height="6"/>'
        f'<circle cx="{here:.1f}" cy="6" r="3.2" fill="{CLASSES[kind][1]}"/></svg>'
    )


def filters(caption: str, comparisons: "Sequence[Comparison]") -> str:
    """The filters against known truth."""
    heads = ["filter", "position RMSE, m", "velocity RMSE, m/s", "ANEES", "95 % band", "verdict"]
    heads += ["NIS/dof", "updates", "ns per update"]
    return table(caption, heads, map(_filter, comparisons))


def _filter(each: "Comparison") -> list[Cell]:
    low, high = each.anees_bounds
    kind = 1 if each.anees > high else 2 if each.anees < low else 0
    cells = [text_cell(each.filter), number_cell(each.position_rmse_m, 3)]
    cells += [number_cell(each.velocity_rmse_mps, 3), number_cell(each.anees, 3)]
    cells += [Cell(f"{low:.3f} – {high:.3f}", is_figure=True), _verdict({"verdict": ""}, kind)]
    cells += [number_cell(each.nis_per_dof, 3), number_cell(each.updates)]
    return [*cells, number_cell(each.ns_per_update, 3)]


def nis(result: "TrackingResult") -> str:
    """NIS per degree of freedom for each selection of scans."""
    heads = ["scans", "mean", "median", "median of chi-square", "degrees of freedom", "plots"]
    rows = [
        [text_cell(NIS_WORDS.get(name, name.replace("_", " ")))]
        + [number_cell(entry.get(key), 3) for key in ("mean", "median")]
        + [number_cell(chi_square_median(entry), 3)]
        + [Cell(f"{entry.get(key, 0):,.0f}", is_figure=True) for key in ("dof", "scans")]
        for name, entry in result.nis.items()
        if entry.get("scans")
    ]
    return table("NIS per degree of freedom; 1 is consistent", heads, rows)


def skipped(result: "TrackingResult") -> str:
    """What was not used, and why."""
    if result.skipped.is_empty():
        return "<p>Every plot of the recording was used.</p>"
    rows = [
        [
            text_cell(str(row["reason"]).replace("_", " ")),
            number_cell(row["count"]),
            Cell(percent(row["count"], result.plots), is_figure=True),
            text_cell(row["meaning"]),
        ]
        for row in result.skipped.to_dicts()
    ]
    return table("Plots not used", ["reason", "plots", "share", "meaning"], rows)


def recording(inspection: dict[str, Any]) -> str:
    """What the file holds, category by category."""
    heads = ["category", "edition", "sensor", "records", "first", "last", "scan, s"]
    rows = [
        [
            text_cell(category(row)),
            text_cell(row.get("edition")),
            text_cell(row.get("sensor")),
            number_cell(row.get("records")),
            *(Cell(clock(row.get(name)), is_figure=True) for name in ("first_s", "last_s")),
            number_cell(row.get("scan_s"), 4),
        ]
        for row in inspection.get("categories", [])
    ]
    return table("What the recording holds", heads, rows) if rows else ""


def category(row: dict[str, Any]) -> str:
    """Name a category as the field does; a table has none."""
    return f"CAT{row['category']:03d}" if row.get("category") is not None else "table"


def pairs(caption: str, entries: dict[str, Any]) -> str:
    """A table of names and values, nested names joined."""
    rows = [_pair(name, value) for name, value in _flat(entries)]
    return table(caption, ["setting", "value"], rows)


def _pair(name: str, value: Any) -> list[Cell]:
    words, unit = label(name)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return [text_cell(words), Cell(f"{_exact(value)} {unit}".rstrip())]
    return [text_cell(words), text_cell(value)]


def _exact(value: float) -> str:
    return f"{value:.9g}" if isinstance(value, float) else f"{value:,}"


def _flat(entries: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in entries.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}: ")
        elif isinstance(value, (list, tuple)):
            yield prefix + name, ", ".join(map(str, value))
        else:
            yield prefix + name, value
