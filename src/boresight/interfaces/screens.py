"""What a person sees: tables that are readable at 80 columns and use more where there is more."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

from boresight.interfaces.report.plan import title
from boresight.interfaces.report.tables import category
from boresight.interfaces.report.words import NIS_WORDS, clock, figure, gain, percent

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from boresight.tracking.result import Comparison, Gain, TrackingResult

WIDE = 100
NARROW = 80
WORST = 8


def table(heading: str, *heads: str, left: int = 1) -> "Table":
    """A table whose first `left` columns are words and whose others are figures."""
    from rich import box
    from rich.table import Table

    table = Table(title=heading, box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.title_justify, table.title_style = "left", "bold"
    table.min_width = min(len(heading), NARROW)  # or a title breaks where a table is small
    for index, head in enumerate(heads):
        side: Literal["left", "right"] = "left" if index < left else "right"
        table.add_column(head, justify=side, no_wrap=True, header_style="dim")
    return table


def text(words: str, style: str = "") -> "RenderableType":
    """Words in a style."""
    from rich.text import Text

    return Text(words, style=style)


def inspected(path: str, found: dict[str, Any]) -> "list[RenderableType]":
    """The screen of `boresight inspect`."""
    skipped = found["skipped_bytes"]
    read = f"{figure(skipped)} bytes skipped" if skipped else "all of them read"
    head = f"{found['format']}, framing {found['framing']}, {figure(found['bytes'])} bytes, {read}"
    grid = table("", "category", "edition", "sensor", "records", "first", "last", "scan", left=3)
    for row in found["categories"]:
        scan = row.get("scan_s")
        grid.add_row(
            category(row),
            row.get("edition") or "–",
            row.get("sensor") or "–",
            figure(row["records"]),
            clock(row.get("first_s")),
            clock(row.get("last_s")),
            f"{scan:.3f} s" if scan else "–",
        )
    grid.title = None
    addresses = f"{figure(found['addresses'])} different 24-bit addresses"
    return [text(path, "bold"), text(head), grid, *_damage(found), text(addresses)]


def _damage(found: dict[str, Any]) -> "list[RenderableType]":
    """Say where the file is damaged, the first few places."""
    places = found.get("damaged", [])
    lines = [f"damaged at byte {figure(each['offset'])}: {each['reason']}" for each in places[:5]]
    if len(places) > len(lines):
        lines.append(f"and {len(places) - len(lines)} more places: see --json")
    lines += [
        f"category {each['category']} is not read: {figure(each['blocks'])} blocks"
        for each in found.get("unknown_categories", [])
    ]
    return [text(line, "yellow") for line in lines]


def tracked(
    result: "TrackingResult",
    outputs: Sequence[str],
    width: int,
    truth: "Sequence[RenderableType]" = (),
) -> "list[RenderableType]":
    """The screen of `boresight track`; of `boresight demo`, with what the truth says of it."""
    head = (
        f"{figure(result.used)} of {figure(result.plots)} plots "
        f"({percent(result.used, result.plots)}) in {figure(len(result.targets))} tracks, "
        f"filter {result.filter}; {figure(result.rejected)} outside their track's gate"
    )
    parts = [text(head, "bold"), text(""), *truth, _nis(result)]
    if len(result.filters) > 1:
        parts.append(_beside(result, width))
    parts.append(_worst(result, width))
    if not result.skipped.is_empty():
        parts.append(_skipped(result))
    return [*parts, *written(outputs)]


def _nis(result: "TrackingResult") -> "RenderableType":
    heading = "NIS per degree of freedom (1 is consistent)"
    grid = table(heading, "", "mean", "median", "plots")
    for name, entry in result.nis.items():
        if not entry.get("scans"):
            continue
        words = NIS_WORDS.get(name, name.replace("_", " "))
        mean, median = (figure(entry.get(key), 3) for key in ("mean", "median"))
        grid.add_row(words, mean, median, f"{entry.get('scans', 0):,.0f}")
    return grid


def _beside(result: "TrackingResult", width: int) -> "RenderableType":
    """Filters on the same plots: how well each predicted them, and at what price."""
    heading = f"Log-likelihood per plot minus that of {result.filter}, ± its 95 % interval"
    more = ["restarts", "speed 95 %"] if width >= WIDE else []
    heads = ["filter", "all flight", "straight", "NIS/dof", "rejected", *more, "ns"]
    grid = table(heading, *heads)
    for each in result.filters:
        speed = f"{figure(each.speed_error_95_mps, 3)} m/s" if each.speeds else "–"
        optional = [figure(each.restarts), speed]
        grid.add_row(
            each.filter,
            _gain(each.gain),
            _gain(each.gain_straight),
            figure(each.nis_per_dof, 3),
            figure(each.rejected),
            *(optional if more else []),
            figure(each.ns_per_update, 2),
        )
    return grid


def _gain(value: "Gain") -> "RenderableType":
    """Green where the filter predicts better than the first, red where worse, at 95 %."""
    low, high = value.ci95
    return text(gain(value), "green" if low > 0 else "red" if high < 0 else "")


def _worst(result: "TrackingResult", width: int) -> "RenderableType":
    shown = result.targets.head(WORST).to_dicts()
    more = ["from", "to", "restarts"] if width >= WIDE else []
    heading = f"The {len(shown)} worst of {len(result.targets):,} targets"
    heads = ["target", "verdict", *more[:2], "plots", "rejected", *more[2:], "NIS/dof"]
    grid = table(heading, *heads, "95 % band", left=2)
    for row in shown:
        optional = [clock(row["first_s"]), clock(row["last_s"]), figure(row["restarts"])]
        optional = optional if more else []
        grid.add_row(
            title(row),
            row["verdict"] or "–",
            *optional[:2],
            figure(row["plots"]),
            figure(row["rejected"]),
            *optional[2:],
            figure(row["nis_per_dof"], 3),
            f"{figure(row['nis_low'], 3)} – {figure(row['nis_high'], 3)}",
        )
    return grid


def _skipped(result: "TrackingResult") -> "RenderableType":
    grid = table("Plots not used", "reason", "meaning", "plots", left=2)
    grid.columns[1].no_wrap = False
    for row in result.skipped.to_dicts():
        grid.add_row(str(row["reason"]).replace("_", " "), row["meaning"], figure(row["count"]))
    return grid


def written(outputs: Iterable[str]) -> "list[RenderableType]":
    """The files that were written."""
    return [text(f"wrote {path}", "green") for path in outputs]


def compared(heading: str, comparisons: "Sequence[Comparison]") -> "RenderableType":
    """Filters against known truth."""
    heads = ("filter", "position", "velocity", "ANEES", "95 % band", "NIS/dof", "per update")
    grid = table(heading, *heads)
    for each in comparisons:
        low, high = each.anees_bounds
        grid.add_row(
            each.filter,
            f"{figure(each.position_rmse_m, 3)} m",
            f"{figure(each.velocity_rmse_mps, 3)} m/s",
            figure(each.anees, 3),
            f"{low:.2f} – {high:.2f}",
            figure(each.nis_per_dof, 3),
            _duration(each.ns_per_update),
        )
    return grid


def _duration(ns: float) -> str:
    return f"{figure(ns / 1000, 3)} µs" if ns >= 1000 else f"{figure(ns, 3)} ns"


def cited(found: dict[str, Any]) -> "list[RenderableType]":
    """The screen of `boresight cite`: BibTeX as it is, ready to be piped into a file."""
    differs = f"Differs from it: {found['differs']}" if found["differs"] else ""
    from rich.text import Text

    bibtex = Text(found["bibtex"], no_wrap=True, overflow="ignore")
    return [bibtex, *([text(""), text(differs)] if differs else [])]
