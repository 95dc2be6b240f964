"""The body of the page, section by section, in the order in which an engineer asks."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from boresight.interfaces.report import beside, tables
from boresight.interfaces.report.residuals import QUANTITIES, Panel, measured
from boresight.interfaces.report.target import Series
from boresight.interfaces.report.verdict import Sentence, sentences
from boresight.interfaces.report.words import NIS_WORDS, clock, figure, panel, percent

if TYPE_CHECKING:
    from boresight.tracking.result import Comparison, TrackingResult

MARKS = {"good": ("✓", "In order"), "attention": ("!", "Attention"), "note": ("i", "Note")}
NIS_KEY = """<ul class="key" aria-label="Key of the three charts">
<li><span class="swatch all"></span>all scans</li>
<li><span class="swatch straight"></span>straight flight, where roll is known</li>
<li><span class="swatch band"></span>95 % chi-square band of the mean</li></ul>"""
KEY = """<ul class="key" aria-label="Key of the nine charts">
<li><span class="swatch density"></span>plots in the cell, few to many (logarithmic)</li>
<li><span class="swatch mean"></span>median with its 95 % interval</li>
<li><span class="swatch spread"></span>twice the filter's own sd</li></ul>"""

NIS_ORDER = ("straight_second_half", "straight", "all")
LAW_CAPTION = (
    "Share of plots whose NIS lies above a value, inside the gate. Above the dotted line: "
    "larger errors than the noise model allows."
)
TARGETS_CAPTION = "Each target beside its own 95 % band. Choose one to see its residuals."
NIS_CAPTIONS = (LAW_CAPTION, TARGETS_CAPTION)


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Everything the body is made of."""

    result: "TrackingResult"
    comparisons: "Sequence[Comparison]"
    as_seen: "Sequence[Comparison]"
    inspection: dict[str, Any]
    provenance: dict[str, Any]
    plan_caption: str
    panels: Sequence[Panel]
    series: Series


def body(parts: Parts) -> str:
    """Return everything between the body's tags but the scripts."""
    shown = [
        ("plan", "Plan view", _plan(parts)),
        ("residuals", "Residuals", _residuals(parts)),
        ("consistency", "Is the stated uncertainty true?", _consistency(parts)),
        ("side-by-side", "Filters side by side", beside.section(parts.result, parts.panels)),
        ("filters", "Filters against the known truth", _filters(parts)),
        ("targets", "Targets", _targets(parts)),
        ("skipped", "What was not used", tables.skipped(parts.result)),
        ("recording", "Recording", tables.recording(parts.inspection)),
        ("settings", "Settings", tables.pairs("How it was tracked", parts.result.settings)),
        ("provenance", "Provenance", tables.pairs("What made this page", parts.provenance)),
    ]
    kept = [(name, title, html) for name, title, html in shown if html]
    return "\n".join(
        [
            _header(parts),
            _contents(kept),
            "<main>",
            _verdict(parts),
            *(_section(*each) for each in kept),
            "</main>",
            _footer(),
        ]
    )


def _section(name: str, title: str, html: str) -> str:
    return (
        f'<section id="{name}" aria-labelledby="{name}-title">'
        f'<h2 id="{name}-title">{title}</h2>\n{html}</section>'
    )


def _header(parts: Parts) -> str:
    result, inspection = parts.result, parts.inspection
    title = escape(str(inspection.get("file", "Tracked recording")))
    name = next((each for each in NIS_ORDER if result.nis.get(each, {}).get("scans")), "all")
    nis = result.nis.get(name, {})
    tiles = (
        ("plots", figure(result.plots), f"{percent(result.used, result.plots)} used"),
        ("tracks", figure(len(result.targets)), f"filter {escape(result.filter)}"),
        ("NIS per degree of freedom", f"{nis.get('mean', float('nan')):.2f}", NIS_WORDS[name]),
        ("time", *_span(result)),
    )
    cells = "".join(
        f"<div><dt>{name}</dt><dd>{value}<small>{note}</small></dd></div>"
        for name, value, note in tiles
    )
    return (
        f'<header><p class="eyebrow">boresight tracking report</p><h1>{title}</h1>'
        f'<dl class="tiles">{cells}</dl></header>'
    )


def _span(result: "TrackingResult") -> tuple[str, str]:
    first, last = (
        result.residuals["time_s"].min(),
        result.residuals["time_s"].max(),
    )
    if not isinstance(first, float) or not isinstance(last, float):
        return "–", ""
    return f"{(last - first) / 60:.1f} min", f"{clock(first)} to {clock(last)} UTC"


def _contents(kept: Sequence[tuple[str, str, str]]) -> str:
    entries = [("verdict", "Verdict", ""), *kept]
    links = "".join(f'<li><a href="#{name}">{title}</a></li>' for name, title, _ in entries)
    return f'<nav aria-label="Contents"><ul>{links}</ul></nav>'


def _verdict(parts: Parts) -> str:
    found = sentences(parts.result, parts.comparisons, parts.as_seen, parts.inspection)
    items = "\n".join(map(_sentence, found))
    remarks = "".join(f"<li>{escape(each)}</li>" for each in parts.result.remarks)
    more = f"<h3>Remarks of the tracker</h3><ul>{remarks}</ul>" if remarks else ""
    return _section("verdict", "Verdict", f'<ul class="verdict">{items}</ul>{more}')


def _sentence(each: Sentence) -> str:
    glyph, words = MARKS[each.mark]
    return (
        f'<li class="{each.mark}"><span class="mark" role="img" aria-label="{words}">{glyph}</span>'
        f'<p>{each.html} <a href="#{each.link}">Evidence</a></p></li>'
    )


def _plan(parts: Parts) -> str:
    nothing = (
        '<p class="noscript" id="no-script">The charts of this page need JavaScript. Its sentences '
        "and tables do not.</p>"
    )
    view = panel("plan-chart", parts.plan_caption, alt="plan view of plots and tracks")
    some = len(parts.result.targets) - parts.series.targets
    caption = "Residuals of one target and its NIS. Shaded: twice the filter's own sd. "
    caption += "Dotted: 95 % of NIS lie below it. Crosses: outside the gate."
    if some > 0:
        caption += f" The {some:,} best-fitting targets are left out for size."
    one = panel("target-chart", caption, alt="residuals and NIS of the chosen target over time")
    chooser = (
        '<div class="chooser"><label for="target">Target</label><select id="target"></select>'
        '<p id="target-words" aria-live="polite"></p></div>'
    )
    return f'{nothing}<div class="split">{view}<div class="one">{chooser}{one}</div></div>'


def _residuals(parts: Parts) -> str:
    used = parts.result.residuals.filter(parts.result.residuals["used"])
    words = (
        "<p>A residual is measured minus predicted, for plots inside the gate. It shows noise and "
        "what the motion model misses. An error common to all plots of a target, such as a "
        "constant range or azimuth bias, moves the track with it and does not appear here. The "
        "interval of a median takes residuals as independent; those of one turn are not.</p>"
    )
    missing = [each.words for each in QUANTITIES if each not in measured(used)]
    if missing:
        words += f"<p>This recording has no residual of {' or '.join(missing)}.</p>"
    mine = [each for each in parts.panels if each.name.startswith("residual-")]
    return f'{words}{KEY}<div class="grid">{"".join(map(_small, mine))}</div>'


def _small(each: Panel) -> str:
    alt = escape(each.alt)
    return f'<div class="chart small" id="{each.name}" role="img" aria-label="{alt}"></div>'


def _consistency(parts: Parts) -> str:
    mine = [each for each in parts.panels if each.name.startswith("nis-")]
    words = (
        "<p>The normalised innovation squared (NIS) divides each squared residual by the variance "
        "the filter gives it. Over its degrees of freedom it is 1 on average if that variance is "
        "true: above 1 the filter is too confident, below 1 too cautious. The shaded band holds "
        "95 % of means if it is true.</p>"
    )
    three = "".join(map(_small, mine[:3]))
    two = "".join(
        panel(each.name, caption, alt=each.alt)
        for each, caption in zip(mine[3:], NIS_CAPTIONS, strict=False)
    )
    return (
        f'{words}{NIS_KEY}<div class="grid">{three}</div><div class="halves">{two}</div>'
        f"{tables.nis(parts.result)}"
    )


def _filters(parts: Parts) -> str:
    shown = ((tables.AGAINST_TRUTH, parts.comparisons), (tables.AS_SEEN, parts.as_seen))
    return "".join(tables.filters(caption, rows) for caption, rows in shown if rows)


def _targets(parts: Parts) -> str:
    if parts.result.targets.is_empty():
        return "<p>No track was formed.</p>"
    return tables.targets(parts.result)


def _footer() -> str:
    return (
        "<footer><p>This page is complete in one file: it loads nothing. Its figures are also in "
        "it as JSON, in the element <code>boresight-report</code>. Charts: plotly.js (MIT).</p>"
        "</footer>"
    )
