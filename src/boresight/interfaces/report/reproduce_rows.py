"""A repeated claim as HTML: printed numbers and ours side by side, with their band and verdict."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import groupby
from math import isfinite, log
from typing import Any

from boresight.interfaces.report.words import Cell, figure, table, text_cell

Claim = Mapping[str, Any]
KINDS = {
    "reproduces": ("good", "✓"),
    "in band": ("near", "≈"),
    "does not reproduce": ("bad", "✗"),
    "cannot be checked": ("open", "?"),
}
HEADS = ("published", "ours", "band of ours", "", "verdict")
LONG = 4  # values of a list that are all shown
FOLDED = 12  # parts from which on they are folded away
STRIP_PX, STRIP_MARGIN = 150, 0.06
TOO_WIDE_RATIO = 20.0  # a strip of positive numbers this far apart is logarithmic


def badge(verdict: str) -> str:
    """A verdict as a coloured word with a mark that needs no colour."""
    kind, mark = KINDS[verdict]
    return f'<span class="badge {kind}"><span aria-hidden="true">{mark}</span> {verdict}</span>'


def value(found: Any, digits: int = 4) -> str:
    """A number, a list of them, or words, as a reader likes them."""
    if isinstance(found, bool):
        return "yes" if found else "no"
    if isinstance(found, (int, float)):
        return figure(found, digits)
    if isinstance(found, (list, tuple)):
        if not found:
            return "none"
        if len(found) > LONG:
            return f"{value(found[0])}, {value(found[1])}, ... {value(found[-1])}"
        return (" to " if _is_band(found) else ", ").join(map(value, found))
    if isinstance(found, Mapping):
        return ", ".join(f"{name} {value(each)}" for name, each in found.items())
    return "–" if found is None else str(found)


def article(claim: Claim, pictures: Iterable[str] = ()) -> str:
    """Everything that is known of a claim, with an anchor that is its ID."""
    name, (kind, _) = claim["id"], KINDS[claim["verdict"]]
    return (
        f'<article class="claim {kind}" id="{name}"><div class="head">'
        f'<h3><a href="#{name}">{name}</a></h3>{badge(claim["verdict"])}'
        f'<span class="where">{escape(claim["where"])}</span></div>'
        f"{_beside(claim)}{''.join(pictures)}{_parts(claim)}"
        f'<p class="how">{escape(claim["assumption"])}</p></article>\n'
    )


def _beside(claim: Claim) -> str:
    """Words on the left of our numbers; numbers in one table with ours."""
    said, ours = claim["published"], _numbers(claim)
    if not isinstance(said, str):
        return ours
    return (
        f'<div class="beside"><div><h4>Published</h4><p>{escape(said)}</p></div>'
        f"<div><h4>Ours</h4>{ours}</div></div>"
    )


def _numbers(claim: Claim) -> str:
    """Tables of what has one value each, and of what has several."""
    theirs, band = (_mapping(claim[key]) for key in ("published", "band"))
    ours = claim["ours"] if isinstance(claim["ours"], Mapping) else {"": claim["ours"]}
    several, single = _several(ours), {name: one for name, one in ours.items() if not _is_row(one)}
    verdicts = {_own_name(claim, part): part["verdict"] for part in claim.get("parts", ())}
    if several and tuple(several[0][1]) == tuple(theirs):
        several, theirs = [("published", theirs), *several], {}
    if _is_band(claim["band"]):
        band = {"": claim["band"]}
        single |= {"": None} if "" not in single else {}
    html = _single(theirs, single, band, verdicts) if single or theirs else ""
    several += [(f"{name}, published", each) for name, each in _several(theirs)]
    several += [(f"{name}, band of ours", each) for name, each in _several(band)]
    for heads, group in groupby(several, key=lambda row: tuple(row[1])):
        html += _matrix(heads, list(group))
    return html


def _several(found: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """Rows of what has several values; of rows in rows each is one."""
    rows: list[tuple[str, Mapping[str, Any]]] = []
    for name, each in found.items():
        if _is_row(each) and all(map(_is_row, each.values())):
            rows += [(f"{name}, {inner}", values) for inner, values in each.items()]
        elif _is_row(each):
            rows.append((name, each))
    return rows


def _mapping(found: Any) -> Mapping[str, Any]:
    return found if isinstance(found, Mapping) else {}


def _is_row(found: Any) -> bool:
    return isinstance(found, Mapping) and len(found) > 1


def _own_name(claim: Claim, part: Claim) -> str:
    return str(part["id"]).removeprefix(f"{claim['id']} ")


def _single(
    theirs: Mapping[str, Any],
    ours: Mapping[str, Any],
    band: Mapping[str, Any],
    verdicts: Mapping[str, str],
) -> str:
    """A row for each name; columns in which nothing stands are left out."""
    names = [name for name in dict.fromkeys((*theirs, *ours)) if not _is_row(theirs.get(name))]
    rows = [
        [
            text_cell(name or ("value" if ours.get(name) is not None else "band")),
            *(_cell(each.get(name)) for each in (theirs, ours, band)),
            Cell(_strip(theirs.get(name), ours.get(name), band.get(name))),
            Cell(badge(verdicts[name]) if name in verdicts else ""),
        ]
        for name in names
    ]
    kept = [0, *(i for i in range(1, len(HEADS) + 1) if any(row[i].html for row in rows))]
    heads = [("", *HEADS)[i] for i in kept]
    return table("", heads, [[row[i] for i in kept] for row in rows])


def _cell(found: Any) -> Cell:
    """Numbers to the right, nothing for none."""
    if found is None:
        return Cell("", is_figure=True)
    is_figure = isinstance(found, (int, float)) and not isinstance(found, bool)
    return Cell(escape(value(found)), is_figure=is_figure or _is_band(found))


def _is_band(found: Any) -> bool:
    return isinstance(found, tuple) and len(found) == 2


def _matrix(heads: tuple[str, ...], rows: Sequence[tuple[str, Mapping[str, Any]]]) -> str:
    """Names down and across; turned where that is the narrower way."""
    if len(heads) > len(rows) and len(heads) > LONG + 2:
        names = tuple(name for name, _ in rows)
        turned = [(head, {name: each[head] for name, each in rows}) for head in heads]
        heads, rows = names, turned
    cells = [[text_cell(name), *(_cell(each[head]) for head in heads)] for name, each in rows]
    return table("", ["", *map(escape, heads)], cells)


def _strip(theirs: Any, ours: Any, band: Any) -> str:
    """Where the printed number and ours lie beside the band, drawn."""
    if not (_is_band(band) and all(map(_is_number, (theirs, *band)))):
        return ""
    shown = [theirs, *band, *([ours] if _is_number(ours) else [])]
    lowest, highest = min(shown), max(shown)
    if lowest > 0 and highest / lowest > TOO_WIDE_RATIO:
        lowest, highest, *shown = (log(each) for each in (lowest, highest, *shown))
    if highest == lowest:
        return ""
    at = [_place((each - lowest) / (highest - lowest)) for each in shown]
    dot = f'<circle cx="{at[3]}" cy="8" r="3.5"/>' if len(at) > 3 else ""
    return (
        f'<svg class="strip" viewBox="0 0 {STRIP_PX} 16" role="img" '
        f'aria-label="published {value(theirs)}, band {value(band)}">'
        f'<rect x="{at[1]}" y="4" width="{max(at[2] - at[1], 1):.1f}" height="8"/>{dot}'
        f'<path d="M{at[0]} 0V16"/></svg>'
    )


def _place(share: float) -> float:
    return round(STRIP_PX * (STRIP_MARGIN + (1.0 - 2.0 * STRIP_MARGIN) * share), 1)


def _is_number(found: Any) -> bool:
    return isinstance(found, (int, float)) and not isinstance(found, bool) and isfinite(found)


def _parts(claim: Claim) -> str:
    """What a claim is made of: one table of single numbers, a block of each of the others."""
    shown = set(_mapping(claim["published"])) & set(_mapping(claim["ours"]))
    rest = [part for part in claim.get("parts", ()) if _own_name(claim, part) not in shown]
    plain = [part for part in rest if not isinstance(part["ours"], Mapping)]
    blocks = [_block(claim, part) for part in rest if isinstance(part["ours"], Mapping)]
    html = (_plain(claim, plain) if plain else "") + "".join(blocks)
    if not html:
        return ""
    is_open = " open" if len(rest) <= FOLDED else ""
    return f"<details{is_open}><summary>{len(rest)} parts</summary>{html}</details>"


def _plain(claim: Claim, parts: list[Claim]) -> str:
    rows = [
        [
            text_cell(_own_name(claim, part)),
            _cell(part["published"]),
            _cell(part["ours"]),
            _cell(part["band"]),
            Cell(_strip(part["published"], part["ours"], part["band"])),
            Cell(badge(part["verdict"])),
            Cell(escape(part["assumption"])),
        ]
        for part in parts
    ]
    kept = [0, *(i for i in range(1, 7) if any(row[i].html for row in rows))]
    heads = [("", *HEADS, "how")[i] for i in kept]
    return table("", heads, [[row[i] for i in kept] for row in rows])


def _block(claim: Claim, part: Claim) -> str:
    how = f'<p class="how">{escape(part["assumption"])}</p>' if part["assumption"] else ""
    return (
        f'<div class="part"><div class="head"><h4>{escape(_own_name(claim, part))}</h4>'
        f"{badge(part['verdict'])}</div>{_beside(part)}{how}</div>"
    )
