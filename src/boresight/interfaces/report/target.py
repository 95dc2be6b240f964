"""The residuals of every single target, for the reader who asks about one."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from boresight.interfaces.report import charts
from boresight.interfaces.report.plan import describe, title
from boresight.interfaces.report.residuals import column, measured

if TYPE_CHECKING:
    import polars as pl

    from boresight.tracking.result import TrackingResult

MOST_ROWS = 60_000  # beyond that the page would grow past what a mail carries
TAIL = 0.05


class Series(NamedTuple):
    """What the page's script draws from, and how many targets it has."""

    content: dict[str, Any]
    targets: int


def series(result: "TrackingResult") -> Series:
    """Return the residuals of the worst targets, whole, until there are `MOST_ROWS` of them."""
    import polars as pl

    counts = dict(result.residuals.group_by("track").len().iter_rows())
    rows, total, index = result.targets.to_dicts(), 0, []
    for row in rows:
        count = counts.get(row["track"], 0)
        if total + count > MOST_ROWS or not count:
            continue
        entry = {"track": row["track"], "start": total, "count": count}
        index.append(entry | {"title": title(row), "words": describe(row)})
        total += count
    order = pl.DataFrame(
        {"track": [each["track"] for each in index], "rank": range(len(index))},
        schema={"track": result.residuals.schema["track"], "rank": pl.Int64},
    )
    kept = result.residuals.join(order, on="track").sort("rank", "time_s")
    content = {"index": index, "columns": _columns(kept)} | _bounds(kept) | _style()
    return Series(content, len(index))


def _style() -> dict[str, Any]:
    clock = {"type": "date", "tickformat": "%H:%M", "hoverformat": "%H:%M:%S"}
    return {
        "layout": charts.layout(),
        "xaxis": charts.axis("time, UTC", showgrid=False, **clock),
        "yaxis": charts.axis("", nticks=6, zeroline=True, zerolinecolor="#aab4c0"),
    }


def _columns(kept: "pl.DataFrame") -> dict[str, Any]:
    found: dict[str, Any] = {
        "time": charts.typed(charts.milliseconds(column(kept, "time_s")), "f8"),
        "nis": charts.short(column(kept, "nis")),
        "dof": charts.typed(np.nan_to_num(column(kept, "dof")), "u1"),
        "used": charts.typed(kept["used"].to_numpy(), "u1"),
    }
    for quantity in measured(kept):
        residual, sd = quantity.columns
        found[quantity.stem] = charts.short(column(kept, residual))
        found[f"{quantity.stem}_sd"] = charts.short(column(kept, sd))
    return found


def _bounds(kept: "pl.DataFrame") -> dict[str, Any]:
    """Return the 95 % quantile of chi-square for each number of degrees of freedom."""
    from scipy.special import chdtri

    most = int(np.nanmax(column(kept, "dof"), initial=1))
    quantiles = [None, *(float(chdtri(dof, TAIL)) for dof in range(1, most + 1))]
    units = [[each.stem, f"{each.words} residual, {each.unit}"] for each in measured(kept)]
    return {"quantiles": quantiles, "quantities": units}
