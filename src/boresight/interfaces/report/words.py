"""Figures as a reader likes them, and the few HTML elements that the page is made of."""

import math
from collections.abc import Iterable, Sequence
from functools import partial
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

from boresight.maths.digits import with_unit

if TYPE_CHECKING:
    from boresight.tracking.result import Gain

UNITS = {
    "_mps2": "m/s²",
    "_mps": "m/s",
    "_deg": "°",
    "_km": "km",
    "_ns": "ns",
    "_m": "m",
    "_s": "s",
}


NIS_WORDS = {
    "all": "all scans",
    "straight": "straight flight",
    "straight_first_half": "straight flight, first half",
    "straight_second_half": "straight flight, second half",
}


LARGE = 1e7


class Cell(NamedTuple):
    """One cell of a table: HTML, the key it sorts by, and whether it is a figure."""

    html: str
    key: str = ""
    is_figure: bool = False


def figure(value: float | None, digits: int = 4) -> str:
    """Render a number to `digits` significant digits, with thousands parted; a dash for none.

    What is no count and has more than seven places in front is `5.12e10`.
    """
    if value is None or not math.isfinite(value):
        return "–"
    if isinstance(value, int) or value == 0:
        return f"{value:,.0f}"
    if abs(value) >= LARGE:
        return f"{value:.{digits - 1}e}".replace("e+0", "e").replace("e+", "e")
    rounded = float(f"{value:.{digits - 1}e}")  # 0.09999999 has the places of 0.1
    places = max(digits - 1 - math.floor(math.log10(abs(rounded))), 0)
    return f"{value:,.{places}f}"


def count(number: int, word: str) -> str:
    """Render `1 bearing`, `12 bearings`."""
    return f"{figure(number)} {word}{'' if number == 1 else 's'}"


def gain(value: "Gain") -> str:
    """Render a difference of log-likelihoods: `+0.0123 ± 0.0045`; a dash for none."""
    half = value.ci95[1] - value.mean
    if not math.isfinite(half):
        return f"{value.mean:+.4f}" if math.isfinite(value.mean) else "–"
    places = min(max(1 - math.floor(math.log10(max(half, 1e-9))), 1), 4)
    return f"{value.mean:+z.{places}f} ± {half:.{places}f}"


def percent(part: float, whole: float) -> str:
    """Render a share: `99.5 %`."""
    return f"{100 * part / whole:.1f} %" if whole else "–"


def clock(time_s: float | None) -> str:
    """Render seconds since midnight as `08:15:30`; later days are counted."""
    if time_s is None or not math.isfinite(time_s):
        return "–"
    day, second = divmod(math.floor(time_s), 86_400)
    text = f"{second // 3600:02d}:{second // 60 % 60:02d}:{second % 60:02d}"
    return f"{text} +{day} d" if day else text


def label(name: str) -> tuple[str, str]:
    """Part a name from its unit: `range_sd_m` gives `("range sd", "m")`."""
    for suffix, unit in UNITS.items():
        if name.endswith(suffix):
            return name.removesuffix(suffix).replace("_", " "), unit
    return name.replace("_", " "), ""


def number_cell(value: float | None, digits: int = 4) -> Cell:
    """A right-aligned figure that sorts by its value."""
    known = value is not None and math.isfinite(value)
    return Cell(figure(value, digits), f"{value:.9g}" if known else "", is_figure=True)


def text_cell(value: Any) -> Cell:
    """A left-aligned text, escaped."""
    text = "–" if value in (None, "") else str(value)
    return Cell(escape(text), text)


def table(
    caption: str,
    heads: Sequence[str],
    rows: Iterable[Sequence[Cell]],
    *,
    name: str = "",
    sortable: bool = False,
    row_attributes: Sequence[str] = (),
) -> str:
    """Render a table; heads of a sortable one are buttons, and work where scripts do."""
    body, kinds = [], []
    for index, row in enumerate(rows):
        kinds = [cell.is_figure for cell in row]
        attributes = row_attributes[index] if row_attributes else ""
        body.append(f"<tr{attributes}>{''.join(map(_cell, row))}</tr>")
    kinds = kinds or [False] * len(heads)
    cells = "".join(map(partial(_head, sortable=sortable), heads, kinds))
    marks = (f' id="{name}"' if name else "") + (' class="sortable"' if sortable else "")
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">'
        f"<table{marks}><caption>{escape(caption)}</caption><thead><tr>{cells}</tr></thead>"
        f"<tbody>{chr(10).join(body)}</tbody></table></div>"
    )


def _head(head: str, is_figure: bool, *, sortable: bool) -> str:  # noqa: FBT001 - mapped over
    inside = f'<button type="button">{head}</button>' if sortable else head
    kind = ' class="n"' if is_figure else ""
    return f'<th scope="col"{kind}>{inside}</th>'


def _cell(cell: Cell) -> str:
    kind = ' class="n"' if cell.is_figure else ""
    key = f' data-key="{escape(cell.key)}"' if cell.key and cell.key != cell.html else ""
    return f"<td{kind}{key}>{cell.html}</td>"


def panel(name: str, caption: str, *, alt: str, height_px: int | None = None) -> str:
    """The empty place of a figure, with its caption and what it shows in words."""
    style = f' style="height:{height_px}px"' if height_px else ""
    return (
        f'<figure><div class="chart" id="{name}"{style} role="img" aria-label="{escape(alt)}">'
        f"</div><figcaption>{caption}</figcaption></figure>"
    )


def interval(ends: tuple[float, float], places: int, unit: str) -> str:
    """Render an interval: `+0.515 to +0.555°`; in words where it has no ends."""
    if not all(map(math.isfinite, ends)):
        return "no interval: too few targets"
    return f"{ends[0]:+z,.{places}f} to {with_unit(ends[1], places, unit)}"
