"""All that kashyap's verdicts and figures are read off, each computed when it is first asked for.

Paper: kashyap, all tables and figures; what it leaves open is in its table's `assumed`.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from boresight.experiments.papers.kashyap_leak import Ratio, over_bound
from boresight.experiments.papers.kashyap_methods import Method, cmkf_d, ecmkf, emekf, plain
from boresight.experiments.papers.kashyap_runs import (
    Noises,
    Repeated,
    Tracked,
    noises,
    repeated,
    tracked,
)
from boresight.experiments.papers.kashyap_third import seen, substitute
from boresight.experiments.scenario import Scenario, build
from boresight.experiments.simulate import Truth
from boresight.models.error_model import ErrorModel, lookup

Array = Any
RUNS = 1000
SETS = {
    "Set 1": "kashyap-set-1",
    "Set 2": "kashyap-set-2",
    "Set 4": "kashyap-set-4",
    "10 degrees": "kashyap-10deg",
}
_FEWEST_TRUTHS = 8
_NOISES_OF = 10  # runs for each noise of the one flight


@dataclass(frozen=True)
class Study:
    """The paper's runs.

    Attributes:
        table: `papers/kashyap.toml`, assumptions changed or not.
        asked: number of runs; None for as many as bands need.
        seed: of all that is random.
    """

    table: dict[str, Any]
    asked: int | None
    seed: int

    @property
    def assumed(self) -> dict[str, Any]:
        """What the paper leaves open."""
        return self.table["assumed"]  # type: ignore[no-any-return]

    @property
    def runs(self) -> int:
        """How many truths, each with its own noise."""
        return self.asked or RUNS

    @property
    def truths(self) -> int:
        """How many truths are each seen through many noises, about as many runs in all."""
        return max(_FEWEST_TRUTHS, self.runs // int(self.assumed["noises_per_truth"]))

    @cached_property
    def worlds(self) -> dict[str, Scenario]:
        """Sets 1, 2 and 4 and that of section 3.3, by their names in the paper."""
        found = build("kashyap", self.table)
        return {
            name: replace(found[key], begin=self.assumed["begin"]) for name, key in SETS.items()
        }

    @cached_property
    def reading(self) -> ErrorModel:
        """The error model that stands for the paper's."""
        return lookup(self.assumed["error_model"])

    @cached_property
    def window_only(self) -> ErrorModel:
        """The same without the correction: R from the window, plots as they are."""
        return replace(self.reading, correction="none")

    def emekf(self, model: ErrorModel, **settings: Any) -> Method:
        """The sequential EMEKF with the reading of the range correction that is assumed."""
        return emekf(model, settings={"mu": self.assumed["mu"]} | settings)

    @cached_property
    def pair(self) -> dict[str, Method]:
        """Both filters of the paper, as they reproduce its tables."""
        return {"ecmkf": ecmkf(self.reading), "emekf": self.emekf(self.reading)}

    @cached_property
    def unaided(self) -> dict[str, Method]:
        """Both with the window's R but without the correction; and the EKF told the true R."""
        return {
            "ecmkf, R only": ecmkf(self.window_only),
            "emekf, R only": self.emekf(self.window_only),
            "ekf": plain("ekf"),
        }

    @cached_property
    def first(self) -> dict[str, Tracked]:
        """Set 1: Table 2 and Figure 3."""
        full = {
            "ecmkf, full R only": ecmkf(replace(self.window_only, frame="cartesian", noise="full"))
        }
        return self._tracked("Set 1", full)

    @cached_property
    def second(self) -> dict[str, Tracked]:
        """Set 2: Table 3 and Figure 4."""
        return self._tracked("Set 2", {})

    @cached_property
    def fourth(self) -> dict[str, Tracked]:
        """Set 4: Table 6 and Figure 7."""
        return self._tracked(
            "Set 4", {"cmkf-d-t": cmkf_d("cmkf-d-t"), "cmkf-d-m": cmkf_d("cmkf-d-m")}
        )

    def _tracked(self, name: str, more: dict[str, Method]) -> dict[str, Tracked]:
        world = self.worlds[name]
        found = tracked(world, self.pair, self.runs, self.seed, bounds=True)
        return found | tracked(world, self.unaided | more, self.runs, self.seed)

    @cached_property
    def ordered(self) -> list[Tracked]:
        """Table 5: Set 2 in each order of its components."""
        methods = {
            str(i): self.emekf(self.reading, order=tuple(case["order"]))
            for i, case in enumerate(self.table["tables"]["KA-T5"]["cases"])
        }
        return list(tracked(self.worlds["Set 2"], methods, self.runs, self.seed).values())

    @cached_property
    def many(self) -> dict[str, Repeated]:
        """Table 3 in parentheses and Figures 4(e), 4(f): Set 2, many noises for each truth."""
        return self._repeated("Set 2", self.pair)

    @cached_property
    def blocks(self) -> dict[str, dict[str, Repeated]]:
        """Figure 8, by where R comes from and whether plots are corrected, then by processing."""
        by_model = {
            "corrected plots, R of raw differences": self.reading,
            "R of the window, plots as they are": self.window_only,
            "the true R, plots as they are": replace(self.window_only, window=None),
        }
        return {
            name: self._repeated(
                "10 degrees",
                {"sequential": self.emekf(model), "block": emekf(model, entry="mekf-block")},
            )
            for name, model in by_model.items()
        }

    @cached_property
    def noises(self) -> Noises:
        """Figure 6: Set 4."""
        return noises(self.worlds["Set 4"], self.reading, self.runs, self.seed)

    @cached_property
    def flight(self) -> tuple[Scenario, Truth]:
        """What stands for Set 3."""
        return substitute(self.worlds["Set 1"], self.assumed)

    @cached_property
    def third(self) -> dict[str, Tracked]:
        """Table 4 and Figure 5: one flight, many noises."""
        many = max(int(self.assumed["noises_per_truth"]), self.runs // _NOISES_OF)
        methods = self.pair | {name: self.unaided[name] for name in ("emekf, R only", "ekf")}
        return seen(*self.flight, methods, many, self.seed)

    @property
    def stand_in(self) -> str:
        """What stands for Set 3, in words."""
        world, _ = self.flight
        noises = len(self.third["emekf"].square)
        return f"in its place: {world.source}, {world.scans} scans, {noises} noises"

    @cached_property
    def leak(self) -> dict[str, dict[str, Ratio]]:
        """Errors over the radar-only bound, by set and method."""
        late = {"emekf, reference of the scan before": self.emekf(self.late)}
        methods = self.pair | self.unaided | late
        return {
            name: over_bound(self.worlds[name], methods, self.runs, self.seed)
            for name in ("Set 1", "Set 2", "Set 4")
        }

    @property
    def late(self) -> ErrorModel:
        """The reading with the correction that earlier references predict."""
        return replace(self.reading, correction="prediction")

    def _repeated(self, name: str, methods: dict[str, Method]) -> dict[str, Repeated]:
        noises = int(self.assumed["noises_per_truth"])
        return repeated(self.worlds[name], methods, self.truths, noises, self.seed)
