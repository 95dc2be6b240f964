"""What a person sees of papers that were repeated: how many verdicts, the claims, all verdicts.

A paper's claims are a block each; those of all papers a line each, for the page has the rest.
"""

from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Any

from boresight.interfaces.report.reproduce_rows import KINDS, LONG, value
from boresight.interfaces.screens import text, written

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

STYLES = {"reproduces": "green", "in band": "cyan", "does not reproduce": "red"}
DIGITS = 3  # of figures that stand beside each other
_LABEL = 24  # characters that the names of rows need beside their figures
_VERDICT = max(map(len, STYLES))


def reproduced(key: str, found: dict[str, Any], width: int) -> "list[RenderableType]":
    """The screen of `boresight reproduce`."""
    claims = found["claims"]
    several = len(found["assumed"]) > 1
    body = _lines(claims) if several else [part for each in claims for part in _block(each, width)]
    return [
        text(f"{key}, {len(claims)} rows: {_counts(claims)}", "bold"),
        text(""),
        *body,
        *([_by_paper(found)] if several else [_verdicts(claims)]),
        text(""),
        text(_more(found), "dim"),
        *written([found["report"]] if "report" in found else []),
    ]


def _more(found: dict[str, Any]) -> str:
    """Where the rest is."""
    runs = f"{found['runs']} runs" if found["runs"] else "as many runs as each claim needs"
    where = "" if "report" in found else "; -o DIR writes a page with figures"
    return f"seed {found['seed']}, {runs}{where}; --json has all"


def _counts(claims: list[dict[str, Any]]) -> str:
    names = _by_verdict(claims)
    return ", ".join(f"{verdict} {len(names.get(verdict, ()))}" for verdict in KINDS)


def _lines(claims: list[dict[str, Any]]) -> "list[RenderableType]":
    """A line for each claim, cut where the screen ends; a gap between papers."""
    from rich.table import Table

    tables: list[RenderableType] = []
    for _, group in groupby(claims, key=lambda each: each["id"][:2]):
        grid = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False, expand=True)
        grid.add_column(no_wrap=True, width=max(len(each["id"]) for each in claims))
        grid.add_column(no_wrap=True, width=_VERDICT + 2)
        grid.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
        for each in group:
            said = f": {each['published']}" if isinstance(each["published"], str) else ""
            verdict = f"{KINDS[each['verdict']][1]} {each['verdict']}"
            style = STYLES.get(each["verdict"], "yellow")
            grid.add_row(each["id"], text(verdict, style), text(each["where"] + said))
        tables += [grid, text("")]
    return tables


def _by_paper(found: dict[str, Any]) -> "Table":
    """How many verdicts of each kind each paper has."""
    grid = _grid("", *KINDS)
    for name in found["assumed"]:
        mine = [each for each in found["claims"] if each["id"][:2] == name[:2].upper()]
        names = _by_verdict(mine)
        grid.add_row(name, *(str(len(names.get(verdict, ()))) for verdict in KINDS))
    return grid


def _block(each: dict[str, Any], width: int) -> "Iterable[RenderableType]":
    yield from _claim(each, width)
    yield text("")


def _claim(each: dict[str, Any], width: int) -> "Iterable[RenderableType]":
    """Its verdict and words, printed numbers beside ours, and parts where they are not alike."""
    from rich.padding import Padding
    from rich.text import Text

    where = f"  {each['where']}" if each["where"] else ""
    verdict = (each["verdict"], STYLES.get(each["verdict"], "yellow"))
    yield Text.assemble((each["id"], "bold"), "  ", verdict, (where, "dim"))
    if isinstance(each["published"], str):
        yield Padding(Text(each["published"]), (0, 0, 0, 2))
    for grid in _grids(each, width - 2):
        yield Padding(grid, (0, 0, 0, 2))
    if len({part["verdict"] for part in each.get("parts", ())}) > 1:
        yield Padding(_parts(each), (0, 0, 0, 2))


def _grids(each: dict[str, Any], width: int) -> "Iterable[Table]":
    """Numbers beside each other where their names allow it."""
    theirs, band = (each[k] if isinstance(each[k], Mapping) else {} for k in ("published", "band"))
    ours = each["ours"] if isinstance(each["ours"], Mapping) else {"ours": each["ours"]}
    single = {name: value for name, value in ours.items() if not _is_row(value)}
    rows = [(name, value) for name, value in ours.items() if _is_row(value)]
    if rows and tuple(rows[0][1]) == tuple(theirs):
        rows, theirs = [("published", theirs), *rows], {}
    if single or theirs:
        yield _beside(theirs, single, {name: band[name] for name in single if name in band})
    for heads, group in groupby(rows, key=lambda row: tuple(row[1])):
        yield _rows(heads, list(group), width)


def _is_row(value: Any) -> bool:
    """Several numbers with names of their own."""
    return isinstance(value, Mapping) and len(value) > 1


def _beside(
    published: Mapping[str, Any], ours: Mapping[str, Any], band: Mapping[str, Any]
) -> "Table":
    """What has one value each: printed, ours, and the band of ours."""
    named = {"published": published, "ours": ours, "band of ours": band}
    columns = {head: values for head, values in named.items() if values}
    if tuple(columns) == ("ours",):
        columns = {"": ours}
    grid = _grid("", *columns, folds=True)
    for name in dict.fromkeys((*published, *ours)):
        grid.add_row(name, *(value(values[name]) if name in values else ""
                             for values in columns.values()))  # fmt: skip
    return grid


def _rows(heads: tuple[str, ...], rows: list[tuple[str, Mapping[str, Any]]], width: int) -> "Table":
    """A column for each name, or a row where these are too wide, or a line of all each."""
    lines = [(name, *(value(each, DIGITS) for each in row.values())) for name, row in rows]
    upright: list[tuple[str, ...]] = [("", *heads), *lines]
    lying = list(zip(*upright, strict=True))
    for table, columns in ((upright, lying), (lying, upright)):
        needed = sum(2 + max(map(len, column)) for column in columns[1:])
        if needed <= width - _LABEL:
            grid = _grid(*table[0])
            for line in table[1:]:
                grid.add_row(*line)
            return grid
    return _beside({}, dict(rows), {})


def _grid(*heads: str, folds: bool = False) -> "Table":
    """Rows of figures without lines; the first column has their names."""
    from rich.table import Table

    grid = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=any(heads))
    for head in heads:
        first = head == heads[0]
        grid.add_column(head, justify="left" if first or folds else "right",
                        no_wrap=not (first or folds), header_style="dim")  # fmt: skip
    return grid


def _parts(each: dict[str, Any]) -> "Table":
    """Parts by verdict, where they are not all alike."""
    grid = _grid("", "", folds=True)
    for verdict, names in _by_verdict(each["parts"]).items():
        short = [name.removeprefix(f"{each['id']} ") for name in names]
        told = "; ".join(short) if len(short) <= LONG else f"{len(short)} of {len(each['parts'])}"
        grid.add_row(text(verdict, STYLES.get(verdict, "yellow")), told)
    return grid


def _verdicts(claims: list[dict[str, Any]]) -> "Table":
    """Which claims have which verdict."""
    grid = _grid("", "", "", folds=True)
    for verdict, names in _by_verdict(claims).items():
        grid.add_row(text(verdict, STYLES.get(verdict, "yellow")), str(len(names)), " ".join(names))
    return grid


def _by_verdict(claims: Iterable[dict[str, Any]]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for each in claims:
        found.setdefault(each["verdict"], []).append(each["id"])
    return found
