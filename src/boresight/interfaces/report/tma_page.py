"""What target motion analysis puts on the page: each contact, what is known of it and what not."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, NamedTuple

from boresight.interfaces.report import (
    tma_cells,
    tma_history,
    tma_picture,
    tma_residuals,
    tma_tables,
    tma_waterfall,
)
from boresight.interfaces.report.residuals import Panel
from boresight.interfaces.report.sections import Block, Part, Tile, points
from boresight.interfaces.report.tma_facts import told
from boresight.interfaces.report.tma_tables import stem
from boresight.interfaces.report.tma_verdict import sentences, summary
from boresight.interfaces.report.tma_view import View
from boresight.interfaces.report.tma_words import KINDS, estimate, hull
from boresight.interfaces.report.words import count, figure, panel

if TYPE_CHECKING:
    from boresight.target_motion.result import TargetMotion, TmaResult

DETAILED = 12  # contacts that are drawn; more, and the page would grow past what a mail carries
TALL_PX, MIDDLE_PX, WEIGHTS_PX, ENTRY_PX = 760, 560, 300, 22
CONTACTS = (
    "<p>Where the range is not told, bearings alone cannot tell it to anyone: its 90 % region "
    "rests on what was believed before.{rest}</p>"
)
REST = (
    " The first {shown} can be opened below. Any of the others has a page of its own if the "
    "analysis is run for that one, by its name: <code>--track=NAME</code>."
)


class Drawn(NamedTuple):
    """One contact's sections and the charts in them."""

    blocks: Sequence[Block]
    panels: Sequence[Panel]


def part(result: "TmaResult") -> Part:
    """Return the part of the page about target motion: of one contact, or of many."""
    one = len(result.contacts) == 1
    drawn = _drawn(View(result.main), is_alone=True) if one else _several(result)
    said = (*result.remarks, *(result.main.contact.remarks if one else ()))
    return Part(
        kind="target motion",
        title=f"Contact {result.main.contact.name}" if one else "Contacts",
        subject="The contacts",
        tiles=_tiles(result.main) if one else _counts(result),
        sentences=sentences(result.main) if one else summary(result),
        remarks=said,
        blocks=drawn.blocks,
        settings=("How it was analysed", result.main.settings),
        charts={each.name: each.chart for each in drawn.panels},
        series=None,
        facts={"contacts": [told(each) for each in result.contacts]},
    )


def _drawn(view: View, *, is_alone: bool) -> Drawn:
    """Return the sections of one contact; its waterfall is there only if it is the page's own."""
    picture = tma_picture.panel(view)
    water = [tma_waterfall.panel([view])] if is_alone else []
    history, rest = tma_history.panels(view), tma_residuals.panels(view)
    cells = tma_cells.panels(view)
    blocks = (
        Block("picture", "Where it is", _picture(view, picture, water)),
        Block(
            "history",
            "What was known, and when",
            _pair(history, tma_history.captions(view), TALL_PX),
        ),
        Block("quantities", "Estimates and regions", tma_tables.quantities(view.motion)),
        Block("cells", "Which range fits", _cells(view, cells)),
        Block("residuals", "Residuals of the bearings", _residuals(view, rest)),
    )
    named = [each._replace(name=view.stem + each.name) for each in blocks]
    return Drawn(named, [picture, *water, *history, *cells, *rest])


def _picture(view: View, picture: Panel, water: Sequence[Panel]) -> str:
    height = TALL_PX if water else MIDDLE_PX
    left = panel(picture.name, tma_picture.caption(view), alt=picture.alt, height_px=height)
    if not water:
        return left
    said = tma_waterfall.caption([view])
    right = panel(water[0].name, said, alt=water[0].alt, height_px=height)
    return f'<div class="split">{left}{right}</div>'


def _pair(drawn: Sequence[Panel], captions: Sequence[str], height_px: int) -> str:
    both = "".join(
        panel(each.name, caption, alt=each.alt, height_px=height_px)
        for each, caption in zip(drawn, captions, strict=False)
    )
    return f'<div class="halves">{both}</div>' if both else ""


def _cells(view: View, drawn: Sequence[Panel]) -> str:
    said, entries = tma_cells.caption(view), len(view.motion.cells.range_m)
    height = max(WEIGHTS_PX, ENTRY_PX * entries)  # the legend is not cut, on paper too
    return "".join(panel(each.name, said, alt=each.alt, height_px=height) for each in drawn)


def _residuals(view: View, drawn: Sequence[Panel]) -> str:
    return tma_residuals.words(view) + _pair(drawn, tma_residuals.captions(), WEIGHTS_PX)


def _several(result: "TmaResult") -> Drawn:
    """Return one waterfall and one table of all contacts, and the first ones folded below."""
    every = result.contacts
    shown = range(min(len(every), DETAILED))
    views = [View(each) for each in every]
    water = tma_waterfall.panel(views)
    rest = REST.format(shown=len(shown)) if len(every) > len(shown) else ""
    table = CONTACTS.format(rest=rest) + tma_tables.contacts(every, shown)
    folded = [_drawn(View(every[place], stem(place)), is_alone=False) for place in shown]
    details = "".join(
        _details(every[place], place, each) for place, each in zip(shown, folded, strict=True)
    )
    blocks = (
        Block("waterfall", "All bearings", panel(
            water.name, tma_waterfall.caption(views), alt=water.alt, height_px=TALL_PX)),
        Block("contacts", "Contacts", table),
        Block("details", "Contact by contact", details),
    )  # fmt: skip
    return Drawn(blocks, [water, *(each for one in folded for each in one.panels)])


def _details(motion: "TargetMotion", place: int, drawn: Drawn) -> str:
    """Fold one contact: its charts are drawn when it is opened."""
    name = stem(place)
    said = f"{count(motion.bearings, 'bearing')}; {tma_tables.known(motion)}"
    places = {each.name for each in drawn.blocks if each.html}
    verdict = f'<div id="{name}verdict">{points(sentences(motion, name), places)}</div>'
    notes = "".join(f"<li>{escape(each)}</li>" for each in motion.contact.remarks)
    inside = "".join(
        f'<div class="block" id="{each.name}"><h3>{each.title}</h3>{each.html}</div>'
        for each in drawn.blocks
        if each.html
    )
    return (
        f"<details{' open' if place == 0 else ''}><summary>"
        f"<b>Contact {escape(motion.contact.name)}</b>: {escape(said)}</summary>{verdict}"
        f"{f'<ul>{notes}</ul>' if notes else ''}{inside}</details>"
    )


def _tiles(motion: "TargetMotion") -> tuple[Tile, ...]:
    found = []
    for kind in KINDS:
        quantity = getattr(motion, kind.name)
        within = hull(kind, quantity)
        found.append(Tile(kind.stem, estimate(kind, quantity), f"90 %: {within}" if within else ""))
    return tuple(found)


def _counts(result: "TmaResult") -> tuple[Tile, ...]:
    every = result.contacts
    known = sum(each.observable for each in every)
    good = sum(each.converged_s is not None for each in every)
    sides = sum(bool(each.sides) and not each.decided for each in every)
    return (
        Tile("contacts", figure(len(every)), count(sum(e.bearings for e in every), "bearing")),
        Tile("range told", figure(known), "by bearings alone"),
        Tile("good enough", figure(good), "to the end"),
        Tile("side open", figure(sides), "port and starboard possible"),
    )
