"""The page's body: its header, contents, verdict and sections, from the parts it is made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, NamedTuple

from boresight.interfaces.report import tables
from boresight.interfaces.report.residuals import Panel
from boresight.interfaces.report.verdict import Sentence

MARKS = {"good": ("✓", "In order"), "attention": ("!", "Attention"), "note": ("i", "Note")}
NO_SCRIPT = (
    '<p class="noscript" id="no-script">The charts of this page need JavaScript. Its sentences '
    "and tables do not.</p>"
)


class Tile(NamedTuple):
    """A figure at the head of the page: its name, the figure, and what to know with it."""

    name: str
    value: str
    note: str


class Block(NamedTuple):
    """A section: its name in the page, its title and its HTML; left out if that is empty."""

    name: str
    title: str
    html: str


@dataclass(frozen=True, kw_only=True)
class Part:
    """What one subject, a tracking or a calibration, puts on the page.

    Attributes:
        kind: of subject, in a word.
        title: of the page where no file names it.
        subject: heads its verdict where the page has several.
        tiles: at the head of the page.
        sentences: of the verdict.
        remarks: below them.
        blocks: its sections.
        settings: caption and entries of the table of how it was made.
        charts: by name.
        series: what the page's script draws single targets from.
        facts: what the part says, for machines.
    """

    kind: str
    title: str
    subject: str
    tiles: Sequence[Tile]
    sentences: Sequence[Sentence]
    remarks: Sequence[str]
    blocks: Sequence[Block]
    settings: tuple[str, dict[str, Any]]
    charts: Mapping[str, Any]
    series: Mapping[str, Any] | None
    facts: dict[str, Any]


def body(parts: Sequence[Part], inspection: dict[str, Any], provenance: dict[str, Any]) -> str:
    """Return everything between the body's tags but the scripts.

    Args:
        parts: the first makes the page's head and its own sections; each further one is a section.
        inspection: what `inspect` says of the file.
        provenance: what made the page.
    """
    settings = "".join(tables.pairs(*part.settings) for part in parts)
    shown = (
        *parts[0].blocks,
        *map(_as_one, parts[1:]),
        Block("recording", "Recording", tables.recording(inspection)),
        Block("settings", "Settings", settings),
        Block("provenance", "Provenance", tables.pairs("What made this page", provenance)),
    )
    kept = [block for block in shown if block.html]
    places = {each.name for part in parts for each in part.blocks if each.html}
    places |= {each.name for each in kept}
    return "\n".join(
        [
            _header(parts[0], inspection),
            _contents(kept),
            f"<main>{NO_SCRIPT}",
            _section(
                Block(
                    "verdict",
                    "Verdict",
                    "".join(_verdict(part, places, is_alone=len(parts) == 1) for part in parts),
                )
            ),
            *map(_section, kept),
            "</main>",
            _footer(),
        ]
    )


def _as_one(part: Part) -> Block:
    """Return a part's blocks as one section."""
    html = "".join(
        f'<div class="block" id="{name}"><h3>{title}</h3>\n{html}</div>'
        for name, title, html in part.blocks
        if html
    )
    return Block(part.kind, part.kind.capitalize(), html)


def _section(block: Block) -> str:
    name, title, html = block
    return (
        f'<section id="{name}" aria-labelledby="{name}-title">'
        f'<h2 id="{name}-title">{title}</h2>\n{html}</section>'
    )


def _header(part: Part, inspection: dict[str, Any]) -> str:
    title = escape(str(inspection.get("file", part.title)))
    cells = "".join(
        f"<div><dt>{name}</dt><dd>{value}<small>{note}</small></dd></div>"
        for name, value, note in part.tiles
    )
    return (
        f'<header><p class="eyebrow">boresight {part.kind} report</p><h1>{title}</h1>'
        f'<dl class="tiles">{cells}</dl></header>'
    )


def _contents(kept: Sequence[Block]) -> str:
    entries = [("verdict", "Verdict", ""), *kept]
    links = "".join(f'<li><a href="#{name}">{title}</a></li>' for name, title, _ in entries)
    return f'<nav aria-label="Contents"><ul>{links}</ul></nav>'


def _verdict(part: Part, places: set[str], *, is_alone: bool) -> str:
    remarks = "".join(f"<li>{escape(each)}</li>" for each in part.remarks)
    head = "" if is_alone else f"<h3>{part.subject}</h3>"
    more = f"<h3>Remarks of the {part.kind}</h3><ul>{remarks}</ul>" if remarks else ""
    return f"{head}{points(part.sentences, places)}{more}"


def points(sentences: Sequence[Sentence], places: set[str]) -> str:
    """Return a verdict's sentences, each with a link to its evidence if that is in `places`."""
    items = "\n".join(_sentence(each, places) for each in sentences)
    return f'<ul class="verdict">{items}</ul>'


def _sentence(each: Sentence, places: set[str]) -> str:
    glyph, words = MARKS[each.mark]
    link = f' <a href="#{each.link}">Evidence</a>' if each.link in places else ""
    return (
        f'<li class="{each.mark}"><span class="mark" role="img" aria-label="{words}">{glyph}</span>'
        f"<p>{each.html}{link}</p></li>"
    )


def small(each: Panel) -> str:
    """Return the place of a small chart that its section explains."""
    alt = escape(each.alt)
    return f'<div class="chart small" id="{each.name}" role="img" aria-label="{alt}"></div>'


def _footer() -> str:
    return (
        "<footer><p>This page is complete in one file: it loads nothing. Its figures are also in "
        "it as JSON, in the element <code>boresight-report</code>. Charts: plotly.js (MIT).</p>"
        "</footer>"
    )
