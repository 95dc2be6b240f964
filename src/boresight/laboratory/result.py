"""What a study found: a row for each cell, comparisons within each setting, sentences."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

from boresight.laboratory.study import Study

if TYPE_CHECKING:
    import polars as pl

Array = Any


class Interval(NamedTuple):
    """An estimate and the interval that holds the truth with probability 1 - false_alarm."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Cell:
    """One contender in one setting, over all runs.

    Attributes:
        setting, contender: numbers in the study.
        label: of the contender.
        values: swept values, as written.
        runs: number of runs.
        position_rmse_m, velocity_rmse_mps: over runs and scored scans, with bootstrap intervals.
        median_rmse_m: median over runs of each run's position RMSE.
        anees: NEES per state over runs and scored scans; the interval is that of the average.
        anees_bounds: where the ANEES of a consistent filter lies with 1 - false_alarm.
        anis, anis_bounds: the same of innovations, per measured component; exact chi-square.
        pcrlb_m: root of the mean bound of position, averaged in covariance over trajectories;
            NaN where there is none.
        pcrlb_information_m: the same from the average of the information (Tichavsky).
        ratio_to_bound: position_rmse_m over pcrlb_m, or NaN.
        diverged: share of runs that diverged, Clopper-Pearson interval.
        ns_per_step: processor time of one run and scan, everything included, nanoseconds.
        extra: numbers of further metrics by name, such as `gospa_m`, `noncredibility_db`.
        per_scan: by name, (scans,) or (scans, n): means over runs of what `scores` keeps of each
            scan, and `bound_m2` where there is one.
        per_run: by name, (runs,).
        verdicts: one sentence each.
        doubts: those of them that speak against it.
    """

    setting: int
    contender: int
    label: str
    values: tuple[tuple[str, str], ...]
    runs: int
    position_rmse_m: Interval
    velocity_rmse_mps: Interval
    median_rmse_m: float
    anees: Interval
    anees_bounds: tuple[float, float]
    anis: float
    anis_bounds: tuple[float, float]
    pcrlb_m: float
    pcrlb_information_m: float
    ratio_to_bound: float
    diverged: Interval
    ns_per_step: float
    extra: Mapping[str, Any]
    per_scan: Mapping[str, Array]
    per_run: Mapping[str, Array]
    verdicts: tuple[str, ...]
    doubts: tuple[str, ...] = ()


class Comparison(NamedTuple):
    """Two contenders of one setting on the same runs.

    Attributes:
        setting: number in the study.
        better, other: labels; `better` has the smaller position RMSE.
        ratio: RMSE of `better` over that of `other`, with its paired bootstrap interval.
        is_win: whether the interval excludes 1, by more than rounding.
    """

    setting: int
    better: str
    other: str
    ratio: Interval
    is_win: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyResult:
    """What a study found.

    Attributes:
        study: what was asked.
        cells: in the order of the study's cells.
        comparisons: of every two contenders of each setting.
        digest: SHA-256 of all numbers but times: equal on every engine and for every chunk.
        remarks: what a reader should know.
    """

    study: Study
    cells: tuple[Cell, ...]
    comparisons: tuple[Comparison, ...]
    digest: str
    remarks: tuple[str, ...] = ()

    @property
    def table(self) -> "pl.DataFrame":
        """A row for each cell."""
        from boresight.laboratory.frames import cells_frame

        return cells_frame(self)

    @property
    def every_run(self) -> "pl.DataFrame":
        """A row for each run of each cell."""
        from boresight.laboratory.frames import runs_frame

        return runs_frame(self)

    @property
    def every_scan(self) -> "pl.DataFrame":
        """A row for each scan of each cell: means over runs."""
        from boresight.laboratory.frames import scans_frame

        return scans_frame(self)

    def __repr__(self) -> str:
        lines = [f"{self.study.name}: {self.study.runs:,} runs, seed {self.study.seed}"]
        return "\n".join([*lines, *map(_line, self.cells)])

    def _repr_html_(self) -> str:
        """The ranking and the errors against the bound, in a notebook."""
        from boresight.laboratory.notebook import html

        return html(self)


def _line(cell: Cell) -> str:
    """A cell in one line."""
    swept = "".join(f" {name}={value}" for name, value in cell.values)
    low, high = cell.anees_bounds
    bound = f"{cell.ratio_to_bound:.3f} of the bound, " if isfinite(cell.ratio_to_bound) else ""
    return (
        f"  {cell.label:<16}{swept} position {cell.position_rmse_m.value:.4g} m, {bound}"
        f"ANEES {cell.anees.value:.3g} ({low:.3f} to {high:.3f}), "
        f"{100 * cell.diverged.value:.2g} % diverged"
    )
