"""The tables of target motion: every contact in a line, and one contact's quantities."""

from collections.abc import Container, Sequence
from html import escape
from typing import TYPE_CHECKING

from boresight.interfaces.report.tma_words import (
    BEARING,
    COURSE,
    KINDS,
    RANGE,
    SPEED,
    Kind,
    estimate,
    hull,
    knots,
    region,
)
from boresight.interfaces.report.words import Cell, figure, number_cell, table, text_cell

if TYPE_CHECKING:
    from boresight.target_motion.result import Quantity, Side, TargetMotion

NONE = Cell("–")


def contacts(every: "Sequence[TargetMotion]", linked: Container[int]) -> str:
    """One row for each contact, in the order of the file's answer.

    Args:
        every: the contacts.
        linked: places of those that the page shows in detail.
    """
    heads = ["contact", "bearings", "heard, s", "range", "range, 90 %", "bearing", "course"]
    heads += ["speed", "side", "good since", "what is known"]
    rows = [_contact(each, place, linked) for place, each in enumerate(every)]
    caption = f"{len(every):,} contacts, most bearings first"
    return table(caption, heads, rows, name="contacts-table", sortable=True)


def _contact(motion: "TargetMotion", place: int, linked: Container[int]) -> list[Cell]:
    name, time = escape(motion.contact.name), motion.contact.time_s
    link = f'<a href="#{stem(place)}verdict">{name}</a>' if place in linked else name
    since = motion.converged_s
    return [
        Cell(link, motion.contact.name),
        number_cell(motion.bearings),
        Cell(f"{time[0]:,.6g} to {time[-1]:,.6g}", f"{time[0]:.9g}", is_figure=True),
        _figure(RANGE, motion.range_m),
        Cell(hull(RANGE, motion.range_m) or "–", is_figure=True),
        _bearing(motion),
        *(_figure(kind, getattr(motion, kind.name)) for kind in (COURSE, SPEED)),
        text_cell(_side(motion)),
        Cell(f"{since:,.6g} s" if since is not None else "–", f"{since or ''}", is_figure=True),
        text_cell(known(motion)),
    ]


def stem(place: int) -> str:
    """Return what the names of a contact's panels begin with, among several contacts."""
    return f"c{place + 1}-"


def _figure(kind: Kind, found: "Quantity") -> Cell:
    key = "" if found.estimate is None else f"{found.estimate:.9g}"
    return Cell(estimate(kind, found), key, is_figure=True)


def _bearing(motion: "TargetMotion") -> Cell:
    """The bearing, or those of both sides while both are possible."""
    if not motion.sides or motion.decided:
        return _figure(BEARING, motion.bearing_deg)
    return Cell(" or ".join(estimate(BEARING, side.bearing_deg) for side in motion.sides))


def _side(motion: "TargetMotion") -> str:
    if not motion.sides:
        return ""
    return motion.sides[0].name if motion.decided else "either"


def known(motion: "TargetMotion") -> str:
    """Say in a few words what is known of a contact's range."""
    if motion.observable:
        return "range, course, speed" if motion.converged_s is not None else "range, roughly"
    if not motion.observability.manoeuvred:
        return "bearing only: no manoeuvre"
    return "bearing only: too small a manoeuvre"


def quantities(motion: "TargetMotion") -> str:
    """Estimates and credible regions of one contact; of each side while both are possible."""
    if motion.sides and not motion.decided:
        return "".join(map(_of_side, motion.sides))
    heads = ["quantity", "estimate", "50 %", "90 %", "99 %", "batch estimate"]
    rows = [_quantity(kind, getattr(motion, kind.name)) for kind in KINDS]
    batch = motion.batch if motion.observable else None
    for row, kind in zip(rows, KINDS, strict=True):
        row.append(NONE if batch is None else Cell(estimate(kind, getattr(batch, kind.name))))
    caption = "At the last bearing, and the shortest regions that hold so much"
    return table(caption, heads, rows)


def _of_side(side: "Side") -> str:
    heads = ["quantity", "estimate", "50 %", "90 %", "99 %"]
    caption = f"If the contact is to {side.name}: {100 * side.probability:.1f} %"
    return table(caption, heads, [_quantity(kind, getattr(side, kind.name)) for kind in KINDS])


def _quantity(kind: Kind, found: "Quantity") -> list[Cell]:
    said = estimate(kind, found)
    if kind.unit == "m/s" and found.estimate is not None and found.sd:
        said += f" ({knots(found.estimate, found.sd)})"
    levels = [Cell(_lines(region(kind, found, level))) for level in ("50", "90", "99")]
    return [text_cell(kind.stem), Cell(f"<b>{said}</b>"), *levels]


def _lines(words: str) -> str:
    """Put each piece of a region on a line of its own."""
    return words.replace(" or ", "<br>or ") or "–"


def count(number: int, word: str) -> str:
    """Render `1 bearing`, `12 bearings`."""
    return f"{figure(number)} {word}{'' if number == 1 else 's'}"
