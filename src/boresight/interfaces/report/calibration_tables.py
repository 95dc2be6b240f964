"""The tables of a calibration: terms, directions, drift, steps, and plots without a pair."""

from typing import TYPE_CHECKING

from boresight.interfaces.report.calibration_findings import (
    Finding,
    findings,
    has_interval,
    shown_sd,
)
from boresight.interfaces.report.calibration_scale import Typical
from boresight.interfaces.report.calibration_words import meaning
from boresight.interfaces.report.words import (
    Cell,
    clock,
    figure,
    interval,
    number_cell,
    percent,
    table,
    text_cell,
)
from boresight.maths.digits import decimals, with_unit
from boresight.models.systematic import TERMS

if TYPE_CHECKING:
    import polars as pl

    from boresight.calibration.result import Calibration, TermFound

UNITS = {"range_m": "m", "azimuth_deg": "°", "elevation_deg": "°"}
NOTHING = Cell("–", is_figure=True)


def terms(calibration: "Calibration", typical: Typical) -> str:
    """Every term; one that is not observable has no figure at all."""
    heads = ["error", "estimate", "95 % interval", "sd", "sd if independent"]
    heads += ["moves a plot by", "finding"]
    found = findings(calibration)
    rows = [
        _term(name, each, typical.metres(name), found[name])
        for name, each in calibration.terms.items()
    ]
    marks = ["" if each.observable else ' class="unseen"' for each in calibration.terms.values()]
    caption = (
        "Systematic errors, measured minus true, and how far each moves the plot of a target at "
    )
    caption += typical.words(*calibration.terms)
    return table(caption, heads, rows, name="bias-table", row_attributes=marks)


def _term(name: str, term: "TermFound", metres: float, finding: Finding) -> list[Cell]:
    kind, places = TERMS[name], decimals(shown_sd(term))
    if finding is Finding.UNSEEN:
        return [text_cell(kind.words), *[NOTHING] * 5, Cell(finding)]
    estimate, is_error = with_unit(term.estimate, places, kind.unit), finding is Finding.ERROR
    cells = [
        Cell(f"<b>{estimate}</b>" if is_error else estimate, is_figure=True),
        Cell(interval(term.ci95, places, kind.unit), is_figure=True),
        Cell(_sd(term.sd), is_figure=True) if has_interval(term) else NOTHING,
        Cell(_sd(term.independent_sd), is_figure=True),
        Cell(
            with_unit(term.estimate * metres, decimals(shown_sd(term) * metres), "m"),
            is_figure=True,
        ),
    ]
    said = f"<b>{finding}</b>" if is_error else str(finding)
    return [text_cell(kind.words), *cells, Cell(said)]


def _sd(value: float) -> str:
    return figure(value, 2)


def directions(calibration: "Calibration") -> str:
    """The combinations that cannot be told apart."""
    if not calibration.directions:
        return "<p>Every error is told apart from every other.</p>"
    rows = [
        [
            Cell("hardly told" if each.observable else "<b>not told</b>"),
            number_cell(each.correlation, 2),
            Cell("<br>".join(_weight(*one) for one in each.weights.items())),
            text_cell(each.words),
        ]
        for each in calibration.directions
    ]
    heads = ["", "correlation", "together change hardly a plot", "in words"]
    return table("What these pairs cannot tell apart", heads, rows, name="direction-table")


def _weight(name: str, weight: float) -> str:
    unit = TERMS[name].unit
    value = ("+" if weight > 0 else "-") + figure(abs(weight), 2)
    return f"{TERMS[name].words} {value}{'' if unit == '°' else ' '}{unit}"


def drift(frame: "pl.DataFrame | None") -> str:
    """How fast the errors change, with intervals."""
    if frame is None or frame.is_empty():
        return ""
    rows = [
        [
            text_cell(row["channel"].rsplit("_", 1)[0]),
            *_change(row["per_hour"], row, UNITS.get(row["channel"], "") + "/h"),
        ]
        for row in frame.to_dicts()
    ]
    return table("Drift", ["channel", "per hour", "95 % interval", "finding"], rows)


def steps(frame: "pl.DataFrame | None") -> str:
    """Where the errors change at once."""
    if frame is None or frame.is_empty():
        return ""
    rows = [
        [
            text_cell(row["channel"].rsplit("_", 1)[0]),
            Cell(clock(row["time_s"]), is_figure=True),
            *_change(row["size"], row, UNITS.get(row["channel"], "")),
        ]
        for row in frame.to_dicts()
    ]
    return table("Steps", ["channel", "at, UTC", "size", "95 % interval", "finding"], rows)


def _change(value: float, row: dict[str, float], unit: str) -> list[Cell]:
    places, ends = decimals(row["sd"]), (row["low"], row["high"])
    is_proven = ends[0] > 0 or ends[1] < 0
    return [
        Cell(with_unit(value, places, unit), is_figure=True),
        Cell(interval(ends, places, unit), is_figure=True),
        Cell("interval without zero" if is_proven else "none shows itself"),
    ]


EXPLAINED = {
    "paired": "paired with a target of the reference",
    "unidentified": "no identity, and no target of the reference is there",
    "near_target": "no identity, but a target of the reference is there",
    "repeated": "one identity more than once in a scan: at least one is false",
    "unreferenced": "an identity that the reference does not have then: seldom false",
}


def explained(frame: "pl.DataFrame | None") -> str:
    """How many plots the reference explains, and what the others are."""
    if frame is None or frame.is_empty():
        return ""
    counts = {name: int(frame[name].sum()) for name in EXPLAINED if name in frame.columns}
    rows = [
        [
            text_cell(name.replace("_", " ")),
            number_cell(each),
            Cell(percent(each, sum(counts.values())), is_figure=True),
            text_cell(EXPLAINED[name]),
        ]
        for name, each in counts.items()
    ]
    return table("Plots by what explains them", ["", "plots", "share", "meaning"], rows)


def dropped(calibration: "Calibration") -> str:
    """Plots that made no pair, by reason, most first."""
    counts = {name: each for name, each in calibration.dropped.items() if each}
    if not counts:
        return "<p>Every plot made a pair.</p>"
    total = calibration.pairs + sum(counts.values())
    rows = [
        [
            text_cell(name.replace("_", " ")),
            number_cell(each),
            Cell(percent(each, total), is_figure=True),
            text_cell(meaning(calibration, name)),
        ]
        for name, each in sorted(counts.items(), key=lambda item: -item[1])
    ]
    caption = f"Plots and reports that made no pair, beside {figure(calibration.pairs)} pairs"
    heads = ["reason", "number", "share", "meaning"]
    return table(caption, heads, rows, name="dropped-table")
