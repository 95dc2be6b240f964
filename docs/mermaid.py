"""Flow charts of a page, drawn when it is built: no script, no network, no other program.

The repository's web page draws a block of `mermaid` itself. Here the part of that language that our
pages use (`flowchart LR`, boxes, circles, labels, dotted arrows, subgraphs) becomes an SVG in the
page's own colours, as in K. Sugiyama, S. Tagawa and M. Toda, "Methods for Visual Understanding of
Hierarchical System Structures": columns by longest path, long arrows through places of their own in
the columns they pass, and in every column the mean of the neighbours decides the order. A label
is such a place too, so that no two arrows lie on each other.
"""

import re
import textwrap
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxTranslator

CHARACTER, LINE, PAD, GAP, BETWEEN = 6.9, 17.0, 10.0, 16.0, 34.0
NAME = r'(\w+)(?:\["([^"]*)"\]|\(\("([^"]*)"\)\))?'
ARROW = r'\s*(-->|-\.->|--\s*"([^"]*)"\s*-->|-\.\s*"([^"]*)"\s*\.->)\s*'


@dataclass
class Place:
    """A box, a circle, a label, or nothing but a bend of an arrow."""

    lines: list[str] = field(default_factory=list)
    kind: str = "bend"
    column: int = 0
    x: float = 0.0
    y: float = 0.0

    @property
    def width(self) -> float:
        """Its own, in pixels."""
        if self.kind == "circle":
            return self.height
        room = 2 * PAD if self.kind == "box" else 8.0
        return room + CHARACTER * max(map(len, self.lines)) if self.lines else 0.0

    @property
    def height(self) -> float:
        """Its own, in pixels."""
        room = {"box": 14.0, "circle": 16.0}.get(self.kind, 0.0)
        return room + LINE * len(self.lines) if self.lines else 0.0


@dataclass
class Chart:
    """Places by name, arrows as the names they pass, and what encloses what."""

    places: dict[str, Place] = field(default_factory=dict)
    arrows: list[tuple[list[str], bool]] = field(default_factory=list)
    groups: dict[str, tuple[str, list[str]]] = field(default_factory=dict)

    @property
    def steps(self) -> list[tuple[str, str]]:
        """Every arrow's way from place to place."""
        return [each for path, _ in self.arrows for each in pairwise(path)]

    @property
    def columns(self) -> list[list[str]]:
        """Names from left to right, each column in its order."""
        last = max(place.column for place in self.places.values())
        return [[n for n, p in self.places.items() if p.column == c] for c in range(last + 1)]


def read(source: str) -> Chart:
    """Read a flow chart; ValueError names a line that is not understood."""
    first, *lines = [line.strip() for line in source.strip().splitlines()]
    if first != "flowchart LR":
        raise ValueError(f"a chart begins with `flowchart LR`, not with `{first}`")
    chart, group = Chart(), None
    for line in lines:
        opened = re.fullmatch(r"subgraph " + NAME, line)
        if opened:
            group = opened[1]
            chart.groups[group] = (opened[2] or group, [])
        elif line == "end":
            group = None
        else:
            _statement(chart, line, chart.groups[group][1] if group else [])
    return chart


def _statement(chart: Chart, line: str, group: list[str]) -> None:
    """`a["text"] -- "label" --> b --> c`."""
    found, before, arrow = re.match(NAME, line), None, None
    while found:
        name = _named(chart, found, group)
        if before and arrow:
            label = arrow[2] or arrow[3]
            if label:
                chart.places[f"{before}>{name}:{label}"] = Place(textwrap.wrap(label, 14), "label")
            way = [before, *([f"{before}>{name}:{label}"] if label else []), name]
            chart.arrows.append((way, "." in arrow[1].split('"')[0]))
        line, before = line[found.end() :], name
        arrow = re.match(ARROW, line)
        line = line[arrow.end() :] if arrow else line
        found = re.match(NAME, line) if arrow else None
    if before is None or line or arrow:
        raise ValueError(f"a chart's line is not understood: `{line}`")


def _named(chart: Chart, found: re.Match[str], group: list[str]) -> str:
    name, text, sign = found.groups()
    if text or sign or name not in chart.places:
        kind = "circle" if sign else "box"
        chart.places[name] = Place(textwrap.wrap(text or sign or name, 20), kind)
    if name not in group:
        group.append(name)
    return name


def arrange(chart: Chart) -> None:
    """Give every place its column, order and position."""
    _columns(chart)
    _bends(chart)
    names = chart.columns
    for column in names:
        _stack(chart, column, [GAP * i for i, _ in enumerate(column)])
    for sweep in range(24):
        for column in names if sweep % 2 else names[::-1]:
            wanted = {name: _mean(chart, name) for name in column}
            column.sort(key=wanted.__getitem__)
            _stack(chart, column, [wanted[name] for name in column])
    left = 0.0
    for column in names:
        wide = max(chart.places[name].width for name in column)
        for name in column:
            chart.places[name].x = left + wide / 2
        left += wide + BETWEEN


def _columns(chart: Chart) -> None:
    """By longest path; what nothing leads to stands right before what it leads to."""
    places, steps = chart.places, chart.steps
    for _ in places:
        for a, b in steps:
            places[b].column = max(places[b].column, places[a].column + 1)
    for name in places.keys() - {b for _, b in steps}:
        nexts = [places[b].column for a, b in steps if a == name]
        places[name].column = min(nexts, default=1) - 1


def _bends(chart: Chart) -> None:
    """A place in each column that an arrow passes."""
    for number, (path, _) in enumerate(chart.arrows):
        whole = [path[0]]
        for a, b in pairwise(path):
            for column in range(chart.places[a].column + 1, chart.places[b].column):
                whole.append(f"{number}:{column}")
                chart.places[whole[-1]] = Place(column=column)
            whole.append(b)
        path[:] = whole


def _mean(chart: Chart, name: str) -> float:
    """Where a place's neighbours would have it."""
    near = [a if b == name else b for a, b in chart.steps if name in (a, b)]
    return sum(chart.places[each].y for each in near) / len(near)


def _stack(chart: Chart, column: list[str], wanted: list[float]) -> None:
    """One below the other, as near to what is wanted as their sizes allow."""
    places, found = [chart.places[name] for name in column], []
    for i, (place, y) in enumerate(zip(places, wanted, strict=True)):
        room = (places[i - 1].height + place.height) / 2 + GAP if i else 0.0
        found.append(max(y, found[-1] + room) if i else y)
    shift = sum(y - f for y, f in zip(wanted, found, strict=True)) / len(found)
    for place, y in zip(places, found, strict=True):
        place.y = y + shift


def draw(source: str) -> str:
    """Return a flow chart as SVG."""
    chart = read(source)
    arrange(chart)
    places = chart.places.values()
    left, top = -6.0, min(p.y - p.height / 2 for p in places) - 34
    wide = max(p.x + p.width / 2 for p in places) + 12
    high = max(p.y + p.height / 2 for p in places) + 20 - top
    drawn = [_group(chart, *each) for each in chart.groups.values()]
    drawn += [_arrow(chart, path, dotted=dotted) for path, dotted in chart.arrows]
    drawn += [_place(place) for place in places if place.lines]
    told = "; ".join(f"{a} to {b}" for a, b in _told(chart))
    return (
        f'<div class="chart"><svg viewBox="{left:.0f} {top:.0f} {wide - left:.0f} {high:.0f}" '
        f'width="{wide - left:.0f}" style="min-width: {0.8 * (wide - left):.0f}px" '
        f'role="img" aria-label="{escape(told)}">'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto"><path class="tip" d="M0,0.5 L8,4 L0,7.5 z"/></marker>'
        f"</defs>{''.join(drawn)}</svg></div>"
    )


def _told(chart: Chart) -> list[tuple[str, str]]:
    """Every arrow in words."""
    ends = [(chart.places[path[0]], chart.places[path[-1]]) for path, _ in chart.arrows]
    return [(" ".join(a.lines), " ".join(b.lines)) for a, b in ends]


def _group(chart: Chart, title: str, names: list[str]) -> str:
    places = [chart.places[name] for name in names]
    x, y = (
        min(p.x - p.width / 2 for p in places) - 8,
        min(p.y - p.height / 2 for p in places) - 26,
    )
    wide = max(p.x + p.width / 2 for p in places) + 8 - x
    high = max(p.y + p.height / 2 for p in places) + 8 - y
    rect = f'<rect class="group" x="{x:.1f}" y="{y:.1f}" width="{wide:.1f}" height="{high:.1f}"/>'
    return f'{rect}<text class="title" x="{x + 8:.1f}" y="{y + 17:.1f}">{escape(title)}</text>'


def _arrow(chart: Chart, path: list[str], *, dotted: bool) -> str:
    """From right edge to left edge, level at every place; a label interrupts it."""
    places = [chart.places[name] for name in path]
    drawn = ""
    for a, b in pairwise(places):
        x, to = a.x + a.width / 2, b.x - b.width / 2
        bend = (to - x) / 2
        over = f" H{b.x + b.width / 2:.1f}" if b.kind == "bend" else ""
        tip = ' marker-end="url(#tip)"' if b is places[-1] else ""
        drawn += (
            f'<path class="arrow{" dotted" if dotted else ""}"{tip} d="M{x:.1f},{a.y:.1f} '
            f'C{x + bend:.1f},{a.y:.1f} {to - bend:.1f},{b.y:.1f} {to:.1f},{b.y:.1f}{over}"/>'
        )
    return drawn


def _place(place: Place) -> str:
    x, y, wide, high = place.x, place.y, place.width, place.height
    shape = ""
    if place.kind == "box":
        corner = f'x="{x - wide / 2:.1f}" y="{y - high / 2:.1f}"'
        shape = f'<rect class="box" {corner} width="{wide:.1f}" height="{high:.1f}" rx="3"/>'
    elif place.kind == "circle":
        shape = f'<circle class="box" cx="{x:.1f}" cy="{y:.1f}" r="{high / 2:.1f}"/>'
    first = y - LINE * (len(place.lines) - 1) / 2 + 4.5
    for i, line in enumerate(place.lines):
        at = f'x="{x:.1f}" y="{first + LINE * i:.1f}"'
        shape += f'<text class="{place.kind}-text" {at}>{escape(line)}</text>'
    return shape


class Drawing(nodes.literal_block):
    """A block that a page of HTML shows as a picture, and everything else as it is written."""


def _visit(self: SphinxTranslator, node: nodes.Element) -> None:
    self.body.append(draw(node.astext()))
    raise nodes.SkipNode


def _replace(_app: Sphinx, doctree: nodes.document) -> None:
    for block in list(doctree.findall(nodes.literal_block)):
        if block.get("language") == "mermaid":
            block.replace_self(Drawing(block.rawsource, block.astext(), language="text"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Tell Sphinx of the drawings."""
    app.add_node(Drawing, html=(_visit, None))
    app.connect("doctree-read", _replace)
    return {"parallel_read_safe": True}
