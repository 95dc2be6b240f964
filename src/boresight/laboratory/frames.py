"""A study's numbers as Polars frames: a row for each cell, each run, or each scan."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.filters.method import Outside
from boresight.laboratory.result import Cell, Interval, StudyResult
from boresight.laboratory.study import Contender

if TYPE_CHECKING:
    import polars as pl


def filter_name(contender: Contender) -> str:
    """The catalogue's name of a contender's filter, or the user's own."""
    return contender.filter.name


def settings_of(result: StudyResult, cell: Cell) -> dict[str, Any]:
    """What makes a cell differ: the filter's own settings, and what is swept, as written."""
    contender = result.study.settings[cell.setting].contenders[cell.contender]
    own = {} if isinstance(contender.filter, Outside) else dict(contender.filter.settings)
    return own | dict(cell.values)


def row_of(result: StudyResult, cell: Cell) -> dict[str, Any]:
    """One cell as plain data, intervals as `name_low` and `name_high`; what `--json` prints."""
    contender = result.study.settings[cell.setting].contenders[cell.contender]
    row: dict[str, Any] = {
        "filter": filter_name(contender),
        "label": cell.label,
        "settings": settings_of(result, cell),
        "runs": cell.runs,
    }
    for name in ("position_rmse_m", "velocity_rmse_mps", "anees", "diverged"):
        row |= _with_ends(name, getattr(cell, name))
    row |= {
        "median_rmse_m": cell.median_rmse_m,
        "anees_bounds": list(cell.anees_bounds),
        "anis": cell.anis,
        "anis_bounds": list(cell.anis_bounds),
        "pcrlb_m": cell.pcrlb_m,
        "pcrlb_average": "covariance, over trajectories",
        "pcrlb_information_m": cell.pcrlb_information_m,
        "ratio_to_bound": cell.ratio_to_bound,
        "ns_per_step": cell.ns_per_step,
    }
    for name, value in cell.extra.items():
        row |= _with_ends(name, value) if isinstance(value, Interval) else {name: value}
    return row | {"verdicts": list(cell.verdicts), "doubts": list(cell.doubts)}


def _with_ends(name: str, value: Interval) -> dict[str, float]:
    return {name: value.value, f"{name}_low": value.low, f"{name}_high": value.high}


def cells_frame(result: StudyResult) -> "pl.DataFrame":
    """A row for each cell; swept values are columns, lists are parted by commas."""
    import polars as pl

    rows = []
    for cell in result.cells:
        row = row_of(result, cell)
        settings = row.pop("settings")
        low, high = row.pop("anees_bounds")
        row |= {"anees_bound_low": low, "anees_bound_high": high}
        low, high = row.pop("anis_bounds")
        row |= {"anis_bound_low": low, "anis_bound_high": high}
        row |= {name: " ".join(row[name]) for name in ("verdicts", "doubts")}
        rows.append({k: str(v) for k, v in settings.items()} | _flat(row))
    return pl.DataFrame(rows, infer_schema_length=None)


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """Without what has no place in a table: arrays are left to the other frames."""
    return {k: v for k, v in row.items() if np.ndim(v) == 0 and not isinstance(v, Mapping)}


def runs_frame(result: StudyResult) -> "pl.DataFrame":
    """A row for each run of each cell."""
    import polars as pl

    parts = [
        pl.DataFrame({**_names(cell), "run": np.arange(cell.runs), **_columns(cell.per_run, ())})
        for cell in result.cells
    ]
    return pl.concat(parts, how="diagonal_relaxed")


def scans_frame(result: StudyResult) -> "pl.DataFrame":
    """A row for each scan of each cell: means over runs, vectors as columns of their own."""
    import polars as pl

    parts = []
    for cell in result.cells:
        scenario = result.study.settings[cell.setting].scenario
        columns = _columns(cell.per_scan, scenario.motion.names)
        parts.append(pl.DataFrame({**_names(cell), "time_s": scenario.time_s, **columns}))
    return pl.concat(parts, how="diagonal_relaxed")


def _names(cell: Cell) -> dict[str, Any]:
    return {**dict(cell.values), "label": cell.label}


# What is kept squared, so that it can be averaged, is told as its root.
_ROOTS = {
    "position_sq_m2": "position_rmse_m",
    "velocity_sq_m2ps2": "velocity_rmse_mps",
    "claimed_m2": "claimed_m",
    "bound_m2": "bound_m",
}


def _columns(arrays: Mapping[str, Any], states: Sequence[str]) -> dict[str, Any]:
    """Columns of numbers; a vector of the state has a column for each element."""
    found: dict[str, Any] = {}
    for name, array in arrays.items():
        values = np.asarray(array, dtype=float)
        if name in _ROOTS:
            found[_ROOTS[name]] = np.sqrt(values)
        elif values.ndim == 1:
            found[name] = values
        elif values.ndim == 2 and values.shape[1] == len(states):
            found |= {f"{name}_{state}": values[:, i] for i, state in enumerate(states)}
    return found
