"""A study: worlds, the filters that compete in each, and what is measured of them.

A study is plain data, made by `study_file` from a `study.toml` or by hand. Its cells are every
contender in every setting; a cell and a run number say every random number that the run needs, so
a study can be cut into chunks of runs that any thread, process or machine does in any order.
"""

from dataclasses import dataclass
from typing import Any, Literal, get_args

from boresight.errors import UsageError
from boresight.experiments.scenario import Scenario
from boresight.filters.method import Filter, Outside
from boresight.maths import seeds
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any
Draws = Literal["each", "one"]
Metric = Literal[
    "rmse",
    "bias",
    "nees",
    "nis",
    "bound",
    "exact posterior",
    "noncredibility",
    "percent fit error",
    "rsspe",
    "convergence",
    "divergence",
    "ospa",
    "gospa",
]
METRICS: tuple[Metric, ...] = get_args(Metric)
USUAL: tuple[Metric, ...] = ("rmse", "bias", "nees", "nis", "bound", "divergence")


@dataclass(frozen=True, kw_only=True)
class Contender:
    """A filter with what it believes of the world.

    Attributes:
        label: what tables call it; no two contenders of a setting share one.
        filter: a filter of the catalogue with its settings, or a user's own.
        motion: how it believes targets move.
        sensor: what it believes of the sensor.
        gate: squared Mahalanobis distance beyond which a plot is not taken; needed where there are
            false plots, of which it takes the nearest inside. None: every plot is taken.
    """

    label: str
    filter: Filter | Outside
    motion: Motion
    sensor: Sensor
    gate: float | None = None


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One world and the filters that compete in it.

    Attributes:
        values: what is swept, as it was written: (("sensor.azimuth.sigma", "0.5 deg"),).
        scenario: the world; its name is the cell of the random numbers, so settings that share it
            share their random numbers.
        contenders: who competes, in the order of the tables.
    """

    values: tuple[tuple[str, str], ...] = ()
    scenario: Scenario
    contenders: tuple[Contender, ...]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Numbers that metrics need.

    Attributes:
        converged_m: a run has converged when its position error stays below this.
        cutoff_m: c of OSPA and GOSPA.
        order: p of OSPA and GOSPA.
        lost_m: a track whose own position standard deviation exceeds this is not shown to anybody,
            so to OSPA and GOSPA it is missed; infinite: every finite one is shown.
    """

    converged_m: float = 1000.0
    cutoff_m: float = 1000.0
    order: float = 2.0
    lost_m: float = float("inf")


@dataclass(frozen=True, kw_only=True)
class Study:
    """Everything that decides a study's numbers.

    Attributes:
        name: of the study.
        settings: a world and its contenders, one for each combination of swept values.
        runs: Monte Carlo runs of each cell.
        seed: of all that is random, 0 to 2^64 - 1.
        truth, noise: `each` run has its own, or all share the `one` of run 0.
        metrics: what is measured.
        first_scan: scans before this one are simulated and filtered but not scored; of a start
            from two plots, which is at the second, at least 1.
        limits: numbers that metrics need.
        false_alarm: of bands and intervals.
    """

    name: str
    settings: tuple[Setting, ...]
    runs: int
    seed: int
    truth: Draws = "each"
    noise: Draws = "each"
    metrics: tuple[Metric, ...] = USUAL
    first_scan: int = 0
    limits: Limits = Limits()
    false_alarm: float = 0.01

    def __post_init__(self) -> None:
        if isinstance(self.runs, int) and self.runs < 1:
            raise UsageError(
                f"runs={self.runs} is less than one", next_step="give at least one run: --runs 100"
            )
        seeds.check(self.seed, self.runs, 0)
        for setting in self.settings:
            _check_labels(setting)
            check_first_scan(self.first_scan, setting.scenario)

    @property
    def cells(self) -> tuple[tuple[int, int], ...]:
        """(setting, contender) numbers of every cell."""
        return tuple(
            (i, j) for i, each in enumerate(self.settings) for j in range(len(each.contenders))
        )


def _check_labels(setting: Setting) -> None:
    labels = [each.label for each in setting.contenders]
    twice = sorted({each for each in labels if labels.count(each) > 1})
    if twice:
        raise UsageError(
            f"two filters of the study are called {twice[0]!r}",
            next_step='give one of them another label: label = "..."',
        )


def first_known(scenario: Scenario) -> int:
    """The first scan at which filters know where the target is: the last that makes their start."""
    return max(scenario.spent - 1, 0)


def check_first_scan(first_scan: int, scenario: Scenario) -> None:
    """UsageError where scans are to be scored at which there is no track yet, or none at all."""
    known = first_known(scenario)
    if first_scan < known:
        raise UsageError(
            f"first_scan = {first_scan} is before the start from {scenario.begin}",
            next_step=f"score from scan {known}: first_scan = {known}",
        )
    if first_scan >= scenario.scans:
        raise UsageError(
            f"first_scan = {first_scan} is not before the last of {scenario.scans} scans",
            next_step="score from an earlier scan",
        )
