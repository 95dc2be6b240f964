"""Residuals against time, range and azimuth: every one is counted, none is drawn as a dot."""

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from boresight.interfaces.report import charts
from boresight.interfaces.report.charts import Chart

if TYPE_CHECKING:
    import polars as pl

Floats: TypeAlias = NDArray[np.float64]

ROWS = 61  # odd: zero is the middle of a cell
MARGIN_SDS = 4.0
FEWEST = 8  # the middle of fewer residuals says nothing
MEDIAN_COST = 1.2533  # standard error of a median over that of a mean, of a normal law
NORMAL_95 = 1.96
MIDDLE_68 = (0.158655, 0.841345)  # one standard deviation about the median of a normal law


class Quantity(NamedTuple):
    """One kind of residual: column stem, words, unit."""

    stem: str
    words: str
    unit: str

    @property
    def columns(self) -> tuple[str, str]:
        """The columns of its residual and of the filter's own sd."""
        return f"{self.stem}_residual_{self.suffix}", f"{self.stem}_sd_{self.suffix}"

    @property
    def suffix(self) -> str:
        """The unit as column names spell it."""
        return {"°": "deg"}.get(self.unit, self.unit)


class Against(NamedTuple):
    """What residuals are drawn against: column, words, cells, and what turns SI into the axis."""

    column: str
    words: str
    cells: int
    scale: float


QUANTITIES = (
    Quantity("range", "range", "m"),
    Quantity("azimuth", "azimuth", "°"),
    Quantity("height", "height", "m"),
)
AGAINST = (
    Against("time_s", "time, UTC", 60, 1000.0),
    Against("range_m", "range, km", 40, 1e-3),
    Against("azimuth_deg", "azimuth, °", 36, 1.0),
)


class Panel(NamedTuple):
    """One chart, its name in the page and what it shows in words."""

    name: str
    chart: Chart
    alt: str


def measured(residuals: "pl.DataFrame") -> list[Quantity]:
    """The kinds of residual that this recording has."""
    return [each for each in QUANTITIES if residuals[each.columns[0]].count() > 0]


def panels(residuals: "pl.DataFrame") -> list[Panel]:
    """Draw each kind of residual against each of time, range and azimuth; only plots used."""
    used = residuals.filter(residuals["used"])
    return [_panel(used, quantity, against) for quantity in measured(used) for against in AGAINST]


def column(frame: "pl.DataFrame", name: str) -> Floats:
    """Return a column as floats, NaN where null."""
    return frame[name].cast(float).fill_null(float("nan")).to_numpy()


def edges(values: Floats, against: Against) -> Floats:
    """Return the cells' edges on the axis; azimuth always goes the whole way round."""
    if against.column == "azimuth_deg":
        return np.linspace(0.0, 360.0, against.cells + 1)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if against.column == "range_m":
        low = 0.0
    return np.linspace(low, max(high, low + 1e-6), against.cells + 1)


def cells(values: Floats, bounds: Floats) -> NDArray[np.intp]:
    """Return the cell of each value."""
    return np.clip(np.searchsorted(bounds, values, side="right") - 1, 0, len(bounds) - 2)


def _panel(used: "pl.DataFrame", quantity: Quantity, against: Against) -> Panel:
    residual, sd = (column(used, name) for name in quantity.columns)
    known = np.isfinite(residual)
    x = column(used, against.column)[known] * against.scale
    residual, sd = residual[known], sd[known]
    bounds = edges(x, against)
    reach = MARGIN_SDS * float(np.nanmedian(sd))
    count, centre = len(bounds) - 1, (bounds[1:] + bounds[:-1]) / 2
    cell = cells(x, bounds)
    stated = centres(cell, sd, count).median
    data = [
        density(cell, residual, bounds, (-reach, reach)),
        *(_spread(centre, sign * stated) for sign in (-2, 2)),
        median_line(centre, centres(cell, residual, count), quantity.unit),
    ]
    layout = _layout(quantity, against, bounds, reach)
    alt = f"{quantity.words} residual against {against.words}: density, median and twice the sd"
    name = f"residual-{quantity.stem}-{against.column.split('_')[0]}"
    return Panel(name, {"data": data, "layout": layout}, alt)


def robust_sd(values: Floats) -> float:
    """Return half the width of the middle 68.3 %: the sd of a normal law, blind to outliers.

    The median absolute deviation would fail on heights: most are repeated to the quantum.
    """
    low, high = np.quantile(values, MIDDLE_68)
    return float(high - low) / 2


class Centre(NamedTuple):
    """Of each cell (cells,): median, half its 95 % interval, plots."""

    median: Floats
    error: Floats
    number: Floats


def centres(cell: NDArray[np.intp], values: Floats, count: int) -> Centre:
    """Return where the values of each cell lie; NaN where they are too few.

    The interval takes values as independent, which those of one turning target are not.
    """
    small = cell.astype(np.int16)  # NumPy sorts these by radix, tenfold faster
    order = np.argsort(small, kind="stable")
    cuts = np.searchsorted(small[order], np.arange(1, count, dtype=np.int16))
    return Centre(*np.array(list(map(_centre, np.split(values[order], cuts)))).T)


def _centre(values: Floats) -> tuple[float, float, float]:
    values = values[np.isfinite(values)]
    number = len(values)
    if number < FEWEST:
        return np.nan, np.nan, number
    low, middle, high = np.quantile(values, (MIDDLE_68[0], 0.5, MIDDLE_68[1]))
    error = NORMAL_95 * MEDIAN_COST * (high - low) / 2 / np.sqrt(number)
    return float(middle), float(error), number


def density(
    cell: NDArray[np.intp], residual: Floats, bounds: Floats, ends: tuple[float, float]
) -> Chart:
    """Count the residuals of each cell across in rows of equal height between `ends`."""
    low, high = ends
    columns, step = len(bounds) - 1, (high - low) / ROWS
    inside = (residual >= low) & (residual <= high)
    row = np.minimum(((residual[inside] - low) / step).astype(int), ROWS - 1)
    flat = row * columns + cell[inside]
    counts = np.bincount(flat, minlength=ROWS * columns).reshape(ROWS, columns)
    share = np.where(counts > 0, np.log10(np.maximum(counts, 1)) + 0.15, np.nan)
    return {
        "type": "heatmap",
        "x0": float(bounds[0] + bounds[1]) / 2,
        "dx": float(bounds[1] - bounds[0]),
        "y0": low + step / 2,
        "dy": step,
        "z": charts.short(share, 7),
        "colorscale": charts.DENSITY,
        "showscale": False,
        "hoverinfo": "skip",
        "zmin": 0,
    }


def _spread(x: Floats, y: Floats) -> Chart:
    style = {"line": {"color": charts.INK, "width": 1.1, "dash": "dot", "shape": "hvh"}}
    return charts.line(charts.typed(x, "f8"), charts.short(y), charts.INK, hoverinfo="skip") | style


def median_line(x: Floats, found: Centre, unit: str) -> Chart:
    """Draw the median of each cell with its interval."""
    error = charts.short(found.error)
    ends = f"%{{y:.3~g}} ± %{{customdata[0]:.2~g}} {unit}"
    return charts.line(
        charts.typed(x, "f8"),
        charts.short(found.median),
        charts.ORANGE,
        mode="lines+markers",
        marker={"size": 4, "color": charts.ORANGE},
        error_y={
            "array": error,
            "color": charts.ORANGE,
            "thickness": 1.1,
            "width": 0,
        },
        customdata=charts.short(np.stack([np.nan_to_num(found.error), found.number], -1), 22),
        hovertemplate=f"median {ends}<br>%{{customdata[1]:,.0f}} plots<extra></extra>",
    )


def across(against: Against, bounds: Floats) -> Chart:
    """Return the x axis of a chart against time, range or azimuth."""
    ends = [float(bounds[0]), float(bounds[-1])]
    x = charts.axis(against.words, showgrid=False, range=ends)
    if against.column == "time_s":
        x |= {"type": "date", "tickformat": "%H:%M", "hoverformat": "%H:%M:%S", "nticks": 6}
    if against.column == "azimuth_deg":
        x |= {"dtick": 90}
    return x


def _layout(quantity: Quantity, against: Against, bounds: Floats, reach: float) -> Chart:
    title = f"{quantity.words} residual, {quantity.unit}"
    y = charts.axis(title, range=[-reach, reach], nticks=7, zeroline=True, zerolinecolor="#aab4c0")
    return charts.layout(xaxis=across(against, bounds), yaxis=y, dragmode="zoom")
