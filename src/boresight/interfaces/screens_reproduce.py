"""What a person sees of a paper that was repeated: a block for each claim, then all verdicts."""

from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Any

from boresight.interfaces.report.words import figure
from boresight.interfaces.screens import text

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

STYLES = {"reproduces": "green", "in band": "green", "does not reproduce": "red"}
LONG = 4  # values of a list that are all shown
DIGITS = 3  # of figures that stand beside each other
_LABEL = 24  # characters that the names of rows need beside their figures
_VERDICT = max(map(len, STYLES))


def reproduced(key: str, found: dict[str, Any], width: int) -> "list[RenderableType]":
    """The screen of `boresight reproduce`."""
    claims = found["claims"]
    blocks = [part for each in claims for part in (*_claim(each, width), text(""))]
    more = f"seed {found['seed']}; --json adds bands, assumptions and the parts of each claim"
    return [
        text(f"{key}: {len(claims)} claims", "bold"),
        text(""),
        *blocks,
        _verdicts(claims),
        text(more, "dim"),
    ]


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
        grid.add_row(name, *(_value(values[name]) if name in values else ""
                             for values in columns.values()))  # fmt: skip
    return grid


def _rows(heads: tuple[str, ...], rows: list[tuple[str, Mapping[str, Any]]], width: int) -> "Table":
    """A column for each name, or a row where these are too wide, or a line of all each."""
    lines = [(name, *(_value(value, DIGITS) for value in row.values())) for name, row in rows]
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


def _value(value: Any, digits: int = 4) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return figure(value, digits)
    if isinstance(value, (list, tuple)):
        if len(value) > LONG:
            return f"{_value(value[0])}, {_value(value[1])}, ... {_value(value[-1])}"
        if isinstance(value, tuple) and len(value) == 2:
            return " to ".join(map(_value, value))
        return ", ".join(map(_value, value))
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_value(each)}" for name, each in value.items())
    return "–" if value is None else str(value)
