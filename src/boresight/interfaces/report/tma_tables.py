"""The tables of target motion: every contact in a line, and one contact's quantities."""

from collections.abc import Callable, Container, Sequence
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
from boresight.interfaces.report.words import Cell, number_cell, table, text_cell

if TYPE_CHECKING:
    from boresight.target_motion.result import Quantity, Side, TargetMotion

NONE = Cell("–")


def contacts(every: "Sequence[TargetMotion]", linked: Container[int]) -> str:
    """One row for each contact, in the order of the file's answer.

    Args:
        every: the contacts.
        linked: places of those that the page shows in detail.
    """
    columns = [(name, [cell(each) for each in every]) for name, cell in COLUMNS.items()]
    links = [
        Cell(_link(each, place, linked), each.contact.name) for place, each in enumerate(every)
    ]
    shown = [("contact", links)]
    shown += [
        (head, cells) for head, cells in columns if any(each.html != NONE.html for each in cells)
    ]
    caption = f"{len(every):,} contacts, most bearings first"
    heads, cells = zip(*shown, strict=True)
    return table(caption, heads, zip(*cells, strict=True), name="contacts-table", sortable=True)


def _link(motion: "TargetMotion", place: int, linked: Container[int]) -> str:
    name = escape(motion.contact.name)
    return f'<a href="#{stem(place)}verdict">{name}</a>' if place in linked else name


def _since(motion: "TargetMotion") -> Cell:
    since = motion.converged_s
    return NONE if since is None else Cell(f"{since:,.6g} s", f"{since}", is_figure=True)


def _time(motion: "TargetMotion", place: int) -> Cell:
    time = motion.contact.time_s[place]
    return Cell(f"{time:,.7g}", f"{time:.9g}", is_figure=True)


def _within(motion: "TargetMotion") -> Cell:
    """The range's region; it sorts by its far end, which is what little knowledge leaves open."""
    pieces = motion.range_m.regions.get("90", ())
    key = f"{pieces[-1][1]:.9g}" if pieces else ""
    return Cell(hull(RANGE, motion.range_m) or NONE.html, key, is_figure=True)


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
    both = " or ".join(estimate(BEARING, side.bearing_deg) for side in motion.sides)
    first = motion.sides[0].bearing_deg.estimate
    return Cell(both, "" if first is None else f"{first:.9g}")


def _side(motion: "TargetMotion") -> Cell:
    if not motion.sides:
        return NONE
    return text_cell(motion.sides[0].name if motion.decided else "either")


def failures(motion: "TargetMotion") -> list[str]:
    """Names of the failed tests of the residuals, without those that follow from another."""
    tests = motion.residuals.tests if motion.residuals else ()
    return [test.name for test in tests if not test.passed and not test.follows]


def _residuals(motion: "TargetMotion") -> Cell:
    if motion.residuals is None:
        return Cell("no track fits")
    if not motion.residuals.tests:
        return Cell("too few")
    failed = ", ".join(map(escape, failures(motion)))
    return Cell(f"fails: {failed}" if failed else "in order")


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


COLUMNS: "dict[str, Callable[[TargetMotion], Cell]]" = {
    "bearings": lambda motion: number_cell(motion.bearings),
    "from, s": lambda motion: _time(motion, 0),
    "to, s": lambda motion: _time(motion, -1),
    "what is known": lambda motion: text_cell(known(motion)),
    "range": lambda motion: _figure(RANGE, motion.range_m),
    "range, 90 %": _within,
    "bearing": _bearing,
    "side": _side,
    "course": lambda motion: _figure(COURSE, motion.course_deg),
    "speed": lambda motion: _figure(SPEED, motion.speed_mps),
    "good since": _since,
    "residuals": _residuals,
}
