"""All that pradeep's verdicts and figures are read off, each computed when it is first asked for.

Filters of one comparison hear the same bearings. The bound is that of a filter which knows where
to linearise, and has the single filters' spread of range and velocity before the first bearing.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.experiments.montecarlo import filtered
from boresight.experiments.papers.pradeep_references import batch_squares, particle_squares
from boresight.experiments.papers.pradeep_tracked import Tracked, bounds, own_ship, with_range
from boresight.experiments.papers.pradeep_truths import Truths, truths
from boresight.experiments.scenario import SPEEDS_MPS, Scenario, build
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.filters.fisher import polar_sd
from boresight.maths import Gaussian
from boresight.mixtures.range_parameterised import range_cells
from boresight.target_motion.result import Criteria

Array = Any
NEAR = "MGEKF started near"
_FILTERS = {  # entry of the catalogue, and whether it starts knowing the range roughly
    "RP": ("rp-{member}", False),
    "RP of MGEKFs": ("rp-mgekf", False),
    "MGEKF": ("mgekf", False),
    "EKF": ("ekf", False),
    NEAR: ("mgekf", True),
    "EKF started near": ("ekf", True),
}
_SETTINGS = {
    "bank": ("cells", "nearest_m", "farthest_m", "prune"),
    "mgekf": ("may_grow",),
    "ekf": (),
}
_LEAST = {"truths": 2, "particles": 100, "particle_runs": 2, "speed_sd_mps": 0.1}


@dataclass(frozen=True)
class Study:
    """The paper's runs.

    Attributes:
        table: `papers/pradeep.toml`, assumptions changed or not.
        asked: number of runs instead of the assumed ones; None for those.
        seed: of all that is random.
    """

    table: dict[str, Any]
    asked: int | None
    seed: int

    def __post_init__(self) -> None:
        """Assumptions that no model would refuse by itself."""
        for name, least in _LEAST.items():
            if not self.assumed[name] >= least:
                raise UsageError(f"{name}={self.assumed[name]} is less than {least:g}")

    @property
    def assumed(self) -> dict[str, Any]:
        """What the paper leaves open."""
        return self.table["assumed"]  # type: ignore[no-any-return]

    @property
    def runs(self) -> int:
        """How many runs of the paper's target."""
        return self.asked or int(self.assumed["runs"])

    @cached_property
    def worlds(self) -> dict[str, Scenario]:
        """The scenarios."""
        return build("pradeep", self.table)

    @property
    def world(self) -> Scenario:
        """The paper's."""
        return self.worlds["pradeep"]

    @cached_property
    def criteria(self) -> Criteria:
        """The limits, in SI units."""
        limits, unit = self.table["metrics"]["PR-X1"], self.assumed["speed_limit_unit"]
        if unit not in SPEEDS_MPS:
            raise unknown("speed_limit_unit", unit, SPEEDS_MPS)
        return Criteria(
            **{name: limits[name] for name in ("range_percent", "bearing_deg", "course_deg")},
            speed_mps=limits["speed"] * SPEEDS_MPS[unit],
        )

    @property
    def time_s(self) -> Array:
        """(scans,)."""
        return self.world.time_s

    def at(self, second: float) -> int:
        """The scan at a time, or the last."""
        return min(round(second / self.world.dt_s), self.world.scans - 1)

    @property
    def converge_s(self) -> float:
        """When the paper's run converged."""
        return float(self.table["tables"]["PR-T1"]["converge_s"])

    @property
    def shown_s(self) -> list[float]:
        """Times at which errors are shown: before the turn, the paper's, and the assumed ones."""
        return [self.before, self.converge_s, *self.assumed["times_s"]]

    @property
    def before(self) -> float:
        """The last bearing before own ship's first turn tells anything, s."""
        turns = self.assumed["turn_times_s"]
        return float(min(turns) - 1) if turns else float(self.time_s[-1])

    @property
    def true_cell(self) -> int:
        """The cell in which the paper's target is."""
        names = ("nearest_m", "farthest_m", "cells")
        middles, _ = range_cells(*(self.assumed[name] for name in names))
        return int(np.argmin(np.abs(np.log(middles / self.table["printed"]["range_m"]))))

    @cached_property
    def simulated(self) -> tuple[Truth, Plots]:
        """The paper's target, heard many times."""
        return simulate(self.world, runs=self.runs, seed=self.seed)

    @cached_property
    def tracked(self) -> dict[str, Tracked]:
        """Every filter on the same bearings."""
        truth, plots = self.simulated
        near = (self.assumed["near_start_m"], self.assumed["near_start_sd_m"])
        starts = (plots, with_range(plots, self.world, *near))
        return {
            label: self.track(label, self.world, truth, starts[is_near])
            for label, (_, is_near) in _FILTERS.items()
        }

    def track(self, label: str, world: Scenario, truth: Truth, plots: Plots) -> Tracked:
        """What one of the filters makes of plots; banks tell their weights too."""
        name = _FILTERS[label][0].format(member=self.assumed["member"])
        is_bank = name.startswith("rp-")
        own = _SETTINGS["bank" if is_bank else name]
        found = filtered(
            name,
            world.motion,
            world.sensor,
            plots,
            settings={setting: self.assumed[setting] for setting in own},
            outputs=("mean", "cov", *(("kept_log_weights",) if is_bank else ())),
        )
        return Tracked(truth, own_ship(world), found, self.criteria)

    @cached_property
    def bound(self) -> Array:
        """(scans, 4, 4): Cramér-Rao bound along the paper's target."""
        truth, plots = self.simulated
        one = truth._replace(states=truth.states[:1], start=truth.start[:1])
        return bounds(self.world, one, plots._replace(z=plots.z[:1]))[0]

    @property
    def bound_m(self) -> Array:
        """(scans,): of the position."""
        return np.sqrt(self.bound[:, 0, 0] + self.bound[:, 1, 1])

    @cached_property
    def bound_sd(self) -> Array:
        """(scans, 4): of range (m), bearing (°), course (°), speed (m/s)."""
        truth, _ = self.simulated
        sd = polar_sd(self.bound, truth.states[0], own_ship(self.world))
        return sd * np.array([1.0, 180.0 / np.pi, 180.0 / np.pi, 1.0])

    @cached_property
    def straight(self) -> Tracked:
        """The bank without a manoeuvre of own ship."""
        world = self.worlds["pradeep-straight"]
        return self.track("RP", world, *simulate(world, runs=self.runs, seed=self.seed))

    @cached_property
    def by_speed_sd(self) -> dict[float, Array]:
        """Mean weights (scans, cells) of the bank by the spread of velocity that it starts with."""
        truth, plots = self.simulated
        found = {}
        for sd in self.assumed["speed_sds_mps"]:
            cov = np.array(plots.prior.cov)
            cov[:, 2:, 2:] = sd**2 * np.eye(2)
            start = plots._replace(prior=Gaussian(plots.prior.mean, cov))
            found[sd] = self.track("RP", self.world, truth, start).weights.mean(axis=0)
        return found

    @cached_property
    def truths(self) -> dict[str, Truths]:
        """Targets anywhere, by filter, at the times that are shown."""
        number = self.asked or int(self.assumed["truths"])
        world, at = self.worlds["pradeep-anywhere"], [self.at(second) for second in self.shown_s]
        return truths(world, self.track, at, number, self.seed)

    @cached_property
    def references(self) -> dict[str, Array]:
        """Squared position errors, m², (runs, times) at `reference_s`, by estimator."""
        truth, plots = self.simulated
        at = [self.at(second) for second in self.reference_s]
        cloud = particle_squares(self.world, truth, plots, self.assumed, at, self.seed)
        found = {f"{self.assumed['particles']} particles": cloud}
        if self.assumed["accel_mps2"]:  # the batch estimate is of a track without noise
            return found
        starts = [self.tracked[label].estimate.mean for label in ("RP", "MGEKF")]
        batch = batch_squares(self.world, truth, plots, np.stack(starts, axis=2), at)
        return {"batch": batch} | found

    @property
    def reference_s(self) -> list[float]:
        """Times at which there are references: once own ship has turned."""
        return self.shown_s[1:]
