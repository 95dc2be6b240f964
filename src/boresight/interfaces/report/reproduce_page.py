"""The page of repeated papers: a verdict for every row, with the evidence, in one file.

It has no script: claims are shown by verdict with boxes that style sheets read.
"""

import json
import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any

from boresight.interfaces.report import tables
from boresight.interfaces.report.page import Report, embedded, provenance
from boresight.interfaces.report.reproduce_rows import KINDS, article, badge
from boresight.interfaces.report.words import Cell, number_cell, table, text_cell

POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'"
)
WIDEST_PX, QUALITY = 1400, 80
MEANINGS = {
    "reproduces": "a number lies in the band of single runs of ours and within 5 % of their "
    "median; a sentence is true in at least 95 % of our runs, or at 95 % of the points by three "
    "standard errors and nowhere false",
    "in band": "nothing of ours speaks against it, or not everything does; there is not more to "
    "be said from so many runs",
    "does not reproduce": "a number lies outside the band; a sentence is false in 95 % of our runs",
    "cannot be checked": "what it depends on is not printed, or is not to be had",
}
STRIPS = (
    "Where a number was printed, a strip shows it as an upright line, our median as a dot and the "
    "band of our single runs, 5 to 95 %, as a bar."
)
FOOT = (
    "This page is complete in one file: it loads nothing and runs nothing. What it says is also in "
    "it as JSON, in the element <code>boresight-report</code>; the numbers of each figure are in "
    "the CSV file of its name beside the page."
)


def page(key: str, found: Mapping[str, Any], command: str = "") -> Report:
    """Make the page.

    Args:
        key: of the paper, or `all`.
        found: what `reproduce` returned; its figures are read and put into the page.
        command: that made it.
    """
    here = files("boresight.interfaces.report")
    style = "".join((here / name).read_text("utf-8") for name in ("page.css", "reproduce.css"))
    title = f"{key}, repeated" if key != "all" else f"{_count(found)} papers, repeated"
    parts = (
        _header(title, found["claims"]),
        _nav(found),
        f"<main>{_overview(found)}",
        *(_paper(name, found) for name in found["assumed"]),
        f"{_settings(found, command)}</main>",
        f"<footer><p>{FOOT}</p></footer>",
    )
    return Report(
        '<!DOCTYPE html>\n<html lang="en" data-drawn>\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{title} · boresight</title>\n<link rel="icon" href="data:,">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n{chr(10).join(parts)}\n"
        f'<script type="application/json" id="boresight-report">{embedded(dict(found))}'
        "</script>\n</body>\n</html>\n"
    )


def _count(found: Mapping[str, Any]) -> str:
    words = ("No", "One", "Two", "Three", "Four", "Five")
    number = len(found["assumed"])
    return words[number] if number < len(words) else str(number)


def _header(title: str, claims: Sequence[Mapping[str, Any]]) -> str:
    tiles = "".join(
        f'<div class="{kind}"><dt>{mark} {verdict}</dt><dd>{_number(claims, verdict)}'
        f"<small>of {len(claims)}</small></dd></div>"
        for verdict, (kind, mark) in KINDS.items()
    )
    return (
        f'<header><p class="eyebrow">boresight reproduction report</p><h1>{escape(title)}</h1>'
        f'<dl class="tiles">{tiles}</dl></header>'
    )


def _number(claims: Sequence[Mapping[str, Any]], verdict: str) -> int:
    return sum(claim["verdict"] == verdict for claim in claims)


def _nav(found: Mapping[str, Any]) -> str:
    """Links to the papers, and a box for each verdict."""
    names = (("overview", "Overview"), *((n, n) for n in found["assumed"]), ("made", "Settings"))
    links = "".join(f'<li><a href="#{name}">{title}</a></li>' for name, title in names)
    boxes = "".join(
        f'<li><label class="{kind}"><input type="checkbox" id="show-{kind}" checked> '
        f"{mark} {verdict}</label></li>"
        for verdict, (kind, mark) in KINDS.items()
    )
    return (
        f'<nav aria-label="Contents and filter"><ul>{links}<li class="gap"></li>{boxes}</ul></nav>'
    )


def _overview(found: Mapping[str, Any]) -> str:
    """Counts by paper, a mark for every row, and what the verdicts mean."""
    counted = [
        [
            Cell(f'<a href="#{name}">{name}</a>'),
            *(number_cell(_number(rows, verdict)) for verdict in KINDS),
        ]
        for name, rows in _by_paper(found).items()
    ]
    counts = table("Verdicts by paper", ["paper", *KINDS], counted)
    chips = "".join(
        f'<p class="chips"><b>{name}</b> <span>{" ".join(map(_chip, rows))}</span></p>'
        for name, rows in _by_paper(found).items()
    )
    meanings = "".join(
        f"<div><dt>{badge(name)}</dt><dd>{each}.</dd></div>" for name, each in MEANINGS.items()
    )
    return _section(
        "overview",
        "Overview",
        f'<div class="halves"><div>{counts}<p class="how">{STRIPS}</p></div>'
        f'<dl class="meanings">{meanings}</dl></div>'
        f"<h3>Every row</h3>{chips}",
    )


def _chip(claim: Mapping[str, Any]) -> str:
    kind, mark = KINDS[claim["verdict"]]
    name, told = claim["id"], f"{claim['where']}: {claim['verdict']}"
    return f'<a class="chip {kind}" href="#{name}" title="{escape(told)}">{mark} {name[3:]}</a>'


def _by_paper(found: Mapping[str, Any]) -> dict[str, list[Mapping[str, Any]]]:
    """Claims by paper: the first two letters of an ID are those of its paper's key."""
    return {
        name: [claim for claim in found["claims"] if claim["id"][:2] == name[:2].upper()]
        for name in found["assumed"]
    }


def _section(name: str, title: str, html: str) -> str:
    return (
        f'<section id="{name}" aria-labelledby="{name}-title"><h2 id="{name}-title">{title}</h2>\n'
        f"{html}</section>"
    )


def _paper(key: str, found: Mapping[str, Any]) -> str:
    """One paper: where it is from, what was assumed, and its rows."""
    pictures = {Path(name).stem: Path(name) for name in found["figures"] if name.endswith(".png")}
    articles = []
    for claim in _by_paper(found)[key]:
        mine = [stem for stem in pictures if re.fullmatch(f"{stem}[a-z]?", claim["id"])]
        articles.append(article(claim, [_picture(pictures.pop(stem)) for stem in mine]))
    entries = [
        [
            text_cell(name),
            Cell(f"<code>{escape(json.dumps(each['value'], ensure_ascii=False))}</code>"),
            Cell(escape(each["why"])),
        ]
        for name, each in found["assumed"][key].items()
    ]
    assumed = table("", ["name", "value", "why"], entries)
    return _section(
        key,
        key,
        f"<p>{_reference(key)}</p><details><summary>What the paper leaves open, and what stands "
        f"for it here: {len(entries)}</summary>{assumed}</details>{''.join(articles)}",
    )


def _reference(key: str) -> str:
    """Authors, title and year."""
    text = (files("boresight") / "papers.bib").read_text("utf-8")
    entry = re.search(rf"^@\w+\{{{key},(.*?)^\}}", text, re.MULTILINE | re.DOTALL)
    found = dict(re.findall(r"(\w+)\s*=\s*\{(.*?)\},?\n", entry.group(1))) if entry else {}
    plain = {name: escape(re.sub(r"[{}\\]", "", each)) for name, each in found.items()}
    authors = plain.get("author", key).replace(" and ", "; ")
    return f"{authors}: <cite>{plain.get('title', '')}</cite>, {plain.get('year', '')}."


def _picture(file: Path) -> str:
    """A figure, drawn from our runs, in the page itself and smaller than its file."""
    from PIL import Image  # matplotlib, which drew it, needs it too

    picture, small = Image.open(file).convert("RGB"), BytesIO()
    picture.thumbnail((WIDEST_PX, WIDEST_PX), Image.Resampling.LANCZOS)
    picture.save(small, "webp", quality=QUALITY, method=2)
    data = b64encode(small.getvalue()).decode()
    alt = f"{file.stem}, drawn from our runs; its numbers are in {file.stem}.csv"
    return (
        f'<figure><img alt="{escape(alt)}" width="{picture.width}" height="{picture.height}" '
        f'src="data:image/webp;base64,{data}"><figcaption>{escape(alt)}</figcaption></figure>'
    )


def _settings(found: Mapping[str, Any], command: str) -> str:
    runs = "as many as each claim needs" if found["runs"] is None else found["runs"]
    told = {"runs": runs, "seed": found["seed"]} | provenance({}, command)
    return _section("made", "Settings", tables.pairs("What made this page", told))
