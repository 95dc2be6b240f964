"""What a tracking result puts on the page, in the order in which an engineer asks."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from boresight.interfaces.report import beside, consistency, plan, residuals, tables
from boresight.interfaces.report.residuals import QUANTITIES, Panel, measured
from boresight.interfaces.report.sections import Block, Part, Tile, small
from boresight.interfaces.report.target import Series, series
from boresight.interfaces.report.verdict import sentences
from boresight.interfaces.report.words import NIS_WORDS, clock, figure, panel, percent

if TYPE_CHECKING:
    from boresight.tracking.result import Comparison, TrackingResult

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


def part(
    result: "TrackingResult",
    comparisons: "Sequence[Comparison]",
    as_seen: "Sequence[Comparison]",
    inspection: dict[str, Any],
) -> Part:
    """Return the tracking's part of the page."""
    drawn = [
        *residuals.panels(result.residuals),
        *consistency.panels(result.residuals, result.targets),
        *beside.panels(result),
    ]
    view, single = plan.plan(result), series(result)
    blocks = (
        Block("plan", "Plan view", _plan(result, view.caption, single)),
        Block("residuals", "Residuals", _residuals(result, drawn)),
        Block("consistency", "Is the stated uncertainty true?", _consistency(result, drawn)),
        Block("side-by-side", "Filters side by side", beside.section(result, drawn)),
        Block("filters", "Filters against the known truth", _filters(comparisons, as_seen)),
        Block("targets", "Targets", _targets(result)),
        Block("skipped", "What was not used", tables.skipped(result)),
    )
    return Part(
        kind="tracking",
        title="Tracked recording",
        subject="The tracks",
        tiles=_tiles(result),
        sentences=sentences(result, comparisons, as_seen, inspection),
        remarks=result.remarks,
        blocks=blocks,
        settings=("How it was tracked", result.settings),
        charts={"plan-chart": view.chart} | {each.name: each.chart for each in drawn},
        series=single.content,
        facts=_facts(result, comparisons, as_seen),
    )


def _facts(
    result: "TrackingResult", comparisons: "Sequence[Comparison]", as_seen: "Sequence[Comparison]"
) -> dict[str, Any]:
    """Return what the part says, for machines."""
    from dataclasses import asdict

    return {
        "plots": result.plots,
        "used": result.used,
        "rejected": result.rejected,
        "filter": result.filter,
        "nis": result.nis,
        "filters": [asdict(each) for each in result.filters],
        "settings": result.settings,
        "remarks": result.remarks,
        "targets": result.targets.to_dicts(),
        "skipped": result.skipped.to_dicts(),
        "comparisons": [asdict(each) for each in comparisons],
        "as_seen": [asdict(each) for each in as_seen],
    }


def _tiles(result: "TrackingResult") -> tuple[Tile, ...]:
    name = next((each for each in NIS_ORDER if result.nis.get(each, {}).get("scans")), "all")
    nis = result.nis.get(name, {})
    return (
        Tile("plots", figure(result.plots), f"{percent(result.used, result.plots)} used"),
        Tile("tracks", figure(len(result.targets)), f"filter {escape(result.filter)}"),
        Tile("NIS per degree of freedom", f"{nis.get('mean', float('nan')):.2f}", NIS_WORDS[name]),
        Tile("time", *_span(result)),
    )


def _span(result: "TrackingResult") -> tuple[str, str]:
    first, last = (
        result.residuals["time_s"].min(),
        result.residuals["time_s"].max(),
    )
    if not isinstance(first, float) or not isinstance(last, float):
        return "–", ""
    return f"{(last - first) / 60:.1f} min", f"{clock(first)} to {clock(last)} UTC"


def _plan(result: "TrackingResult", view_caption: str, single: Series) -> str:
    view = panel("plan-chart", view_caption, alt="plan view of plots and tracks")
    some = len(result.targets) - single.targets
    caption = "Residuals of one target and its NIS. Shaded: twice the filter's own sd. "
    caption += "Dotted: 95 % of NIS lie below it. Crosses: outside the gate."
    if some > 0:
        caption += f" The {some:,} best-fitting targets are left out for size."
    one = panel("target-chart", caption, alt="residuals and NIS of the chosen target over time")
    chooser = (
        '<div class="chooser"><label for="target">Target</label><select id="target"></select>'
        '<p id="target-words" aria-live="polite"></p></div>'
    )
    return f'<div class="split">{view}<div class="one">{chooser}{one}</div></div>'


def _residuals(result: "TrackingResult", drawn: Sequence[Panel]) -> str:
    used = result.residuals.filter(result.residuals["used"])
    words = (
        "<p>A residual is measured minus predicted, for plots inside the gate. It shows noise and "
        "what the motion model misses. An error common to all plots of a target, such as a "
        "constant range or azimuth bias, moves the track with it and does not appear here. The "
        "interval of a median takes residuals as independent; those of one turn are not.</p>"
    )
    missing = [each.words for each in QUANTITIES if each not in measured(used)]
    if missing:
        words += f"<p>This recording has no residual of {' or '.join(missing)}.</p>"
    mine = [each for each in drawn if each.name.startswith("residual-")]
    return f'{words}{KEY}<div class="grid">{"".join(map(small, mine))}</div>'


def _consistency(result: "TrackingResult", drawn: Sequence[Panel]) -> str:
    mine = [each for each in drawn if each.name.startswith("nis-")]
    words = (
        "<p>The normalised innovation squared (NIS) divides each squared residual by the variance "
        "the filter gives it. Over its degrees of freedom it is 1 on average if that variance is "
        "true: above 1 the filter is too confident, below 1 too cautious. The shaded band holds "
        "95 % of means if it is true.</p>"
    )
    three = "".join(map(small, mine[:3]))
    two = "".join(
        panel(each.name, caption, alt=each.alt)
        for each, caption in zip(mine[3:], NIS_CAPTIONS, strict=False)
    )
    return (
        f'{words}{NIS_KEY}<div class="grid">{three}</div><div class="halves">{two}</div>'
        f"{tables.nis(result)}"
    )


def _filters(comparisons: "Sequence[Comparison]", as_seen: "Sequence[Comparison]") -> str:
    shown = ((tables.AGAINST_TRUTH, comparisons), (tables.AS_SEEN, as_seen))
    return "".join(tables.filters(caption, rows) for caption, rows in shown if rows)


def _targets(result: "TrackingResult") -> str:
    if result.targets.is_empty():
        return "<p>No track was formed.</p>"
    return tables.targets(result)
