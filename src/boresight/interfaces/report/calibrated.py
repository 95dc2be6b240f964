"""What a calibration puts on the page: what is wrong with the sensor, and how sure that is."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from boresight.interfaces.report import (
    calibration_bins,
    calibration_charts,
    calibration_laws,
    calibration_residuals,
    calibration_tables,
)
from boresight.interfaces.report.calibration_findings import shown_sd
from boresight.interfaces.report.calibration_scale import Typical, typical
from boresight.interfaces.report.calibration_verdict import sentences
from boresight.interfaces.report.calibration_words import NAMES, unit
from boresight.interfaces.report.residuals import Panel
from boresight.interfaces.report.sections import Block, Part, Tile, small
from boresight.interfaces.report.words import figure, interval, panel
from boresight.maths.digits import decimals, with_unit
from boresight.models.systematic import TERMS

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration

ROW_PX, ROOM_PX = 40, 100  # of the chart of terms: each row, and axis and legend
TERMS_CAPTION = (
    "How far each error moves a plot. Dots: estimates. Whiskers: 95 % intervals, the errors of one "
    "target taken as alike. Thick and pale: how narrow they would look if all pairs were "
    "independent. Shaded: the noise of one plot."
)
CORRELATION_CAPTION = (
    "Correlation of the estimates. Near one or minus one, two errors are hardly told apart here: "
    "their sum or difference is known, each alone is not."
)
KEY = """<ul class="key" aria-label="Key of the charts of residuals">
<li><span class="swatch density"></span>pairs in the cell, few to many (logarithmic)</li>
<li><span class="swatch mean"></span>median with its 95 % interval, clustered by target; none
for fewer than three</li></ul>"""
LAW_KEY = """<ul class="key" aria-label="Key of the charts of the law">
<li><span class="swatch density"></span>residuals</li>
<li><span class="swatch mean"></span>the fitted law</li>
<li><span class="swatch part"></span>its narrow and its wide part</li>
<li><span class="swatch spread"></span>a single normal law of the same middle</li>
<li><span class="swatch band"></span>95 % of quantiles, if the law is true</li></ul>"""
BEFORE_AFTER = (
    "<p>Measured minus reference, above as the radar gave it, below with the errors of the table "
    "taken out. A shape that is left below is an error that these terms do not have.{left_out}</p>"
)
LAW_WORDS = (
    "<p>What is left, against the law that was fitted to it: two normal laws of mean zero, one "
    "narrow and one wide. In the quantile charts the law is the diagonal. Their band takes plots "
    "as independent, which those of one target are not.</p>"
)
STABLE_WORDS = (
    "<p>Mean errors that are left, by direction and over time, against the mean over all. Bars are "
    "95 % intervals clustered by target; among so many, one in twenty misses zero by chance.</p>"
)
DETECTION_WORDS = (
    "<p>A target of the reference in reach is due once a scan; detected, if a plot is paired with "
    "it. Bars are 95 % intervals, the scans of one target taken as alike. Unidentified are plots "
    "without an identity where the reference has no target: false ones, and true ones of targets "
    "that it does not carry.</p>"
)


def part(calibration: "Calibration", inspection: dict[str, Any]) -> Part:
    """Return the calibration's part of the page."""
    at = typical(calibration.residuals)
    drawn = [
        *calibration_charts.panels(calibration, at),
        *calibration_residuals.panels(calibration.residuals),
        *calibration_laws.panels(calibration),
        *calibration_bins.panels(calibration.tables),
    ]
    blocks = (
        Block("bias", "What is wrong with the sensor", _bias(calibration, at, drawn)),
        Block("separable", "What cannot be told apart", _separable(calibration, drawn)),
        Block("before-after", "Residuals before and after", _residuals(calibration, drawn)),
        Block("noise", "Noise of one plot", _noise(drawn)),
        Block("stability", "Is it stable?", _stability(calibration, drawn)),
        Block("detection", "Detection and false plots", _detection(calibration, drawn)),
        Block("pairs", "Pairs and reference", calibration_tables.dropped(calibration)),
    )
    return Part(
        kind="calibration",
        title=f"Radar {calibration.sensor}".rstrip(),
        subject="The sensor",
        tiles=_tiles(calibration),
        sentences=sentences(calibration, at, inspection),
        remarks=calibration.remarks,
        blocks=blocks,
        settings=("How it was calibrated", calibration.settings),
        charts={each.name: each.chart for each in drawn},
        series=None,
        facts={"calibration": facts(calibration)},
    )


def facts(calibration: "Calibration") -> dict[str, Any]:
    """Return what the part says, for machines."""
    from dataclasses import asdict

    plain = "pairs targets dropped reference sensor atmosphere air_gain_m_per_km settings remarks"
    return {name: getattr(calibration, name) for name in plain.split()} | {
        "terms": {name: asdict(each) for name, each in calibration.terms.items()},
        "covariance": {"terms": calibration.errors.terms, "rows": calibration.errors.cov},
        "directions": [asdict(each) for each in calibration.directions],
        "noise": asdict(calibration.noise),
        "site": None if calibration.site is None else asdict(calibration.site),
        "tables": {name: frame.to_dicts() for name, frame in calibration.tables.items()},
    }


def _tiles(calibration: "Calibration") -> tuple[Tile, ...]:
    reference = NAMES.get(calibration.reference, escape(calibration.reference))
    sensor = f"radar {escape(calibration.sensor)} " if calibration.sensor else ""
    return (
        Tile(unit(calibration), figure(calibration.pairs), f"{sensor}against {reference}"),
        Tile("targets", figure(calibration.targets), "each one cluster of errors"),
        _tile(calibration, "azimuth_bias_deg"),
        _tile(calibration, "range_bias_m"),
    )


def _tile(calibration: "Calibration", name: str) -> Tile:
    kind, term = TERMS[name], calibration.terms.get(name)
    if term is None:
        return Tile(kind.words, "–", "not estimated")
    if not term.observable:
        return Tile(kind.words, "–", "not observable here")
    places = decimals(shown_sd(term))
    said = interval(term.ci95, places, kind.unit)
    return Tile(kind.words, with_unit(term.estimate, places, kind.unit), said)


def _mine(drawn: Sequence[Panel], *stems: str) -> str:
    return "".join(small(each) for each in drawn if each.name.startswith(stems))


def _captioned(drawn: Sequence[Panel], name: str, caption: str) -> str:
    return "".join(panel(name, caption, alt=each.alt) for each in drawn if each.name == name)


def _bias(calibration: "Calibration", at: Typical, drawn: Sequence[Panel]) -> str:
    rows = len(calibration.terms)
    chart = "".join(
        panel(each.name, TERMS_CAPTION, alt=each.alt, height_px=ROOM_PX + ROW_PX * rows)
        for each in drawn
        if each.name == "bias-terms"
    )
    return chart + calibration_tables.terms(calibration, at)


def _separable(calibration: "Calibration", drawn: Sequence[Panel]) -> str:
    if len(calibration.terms) < 2:
        return ""
    heat = _captioned(drawn, "bias-correlation", CORRELATION_CAPTION)
    said = calibration_tables.directions(calibration)
    return f'{said}<div class="halves">{heat}</div>'


def _residuals(calibration: "Calibration", drawn: Sequence[Panel]) -> str:
    left_out = len(calibration.residuals) - len(
        calibration_residuals.inliers(calibration.residuals)
    )
    more = f" {figure(left_out)} pairs that are no measurement are left out." if left_out else ""
    charts = _mine(drawn, "before-after-")
    words = BEFORE_AFTER.format(left_out=more)
    return f'{words}{KEY}<div class="quarters">{charts}</div>' if charts else ""


def _noise(drawn: Sequence[Panel]) -> str:
    laws, spread = _mine(drawn, "noise-"), _mine(drawn, "spread-")
    words = f'{LAW_WORDS}{LAW_KEY}<div class="quarters">{laws}</div>' if laws else ""
    return words + (f'<div class="quarters">{spread}</div>' if spread else "")


def _stability(calibration: "Calibration", drawn: Sequence[Panel]) -> str:
    charts, tables = _mine(drawn, "left-"), calibration.tables
    if not charts:
        return ""
    changes = calibration_tables.drift(tables.get("drift"))
    changes += calibration_tables.steps(tables.get("steps"))
    return f'{STABLE_WORDS}<div class="quarters">{charts}</div>{changes}'


def _detection(calibration: "Calibration", drawn: Sequence[Panel]) -> str:
    charts = _mine(drawn, "detection-", "false-")
    counts = calibration_tables.explained(calibration.tables.get("false_by_range"))
    return f'{DETECTION_WORDS}<div class="quarters">{charts}</div>{counts}' if charts else ""
