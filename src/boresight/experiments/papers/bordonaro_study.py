"""All that bordonaro's verdicts and figures are read off, each computed when it is first asked for.

Paper: bordonaro, all figures; what it leaves open is in its table's `assumed`.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from boresight.experiments.consistency import Bias, bias
from boresight.experiments.papers import bordonaro_doppler as doppler
from boresight.experiments.papers import bordonaro_plots as single
from boresight.experiments.papers.bordonaro_tracks import (
    METHODS,
    PRINTED,
    Tracked,
    at_rest,
    nearly_constant,
    tracked,
)
from boresight.experiments.scenario import FOOT_M, Scenario, build
from boresight.filters.range_rate import RangeRate
from boresight.models.motion import Static
from boresight.models.sensors import Radar

Array = Any


@dataclass(frozen=True)
class Study:
    """The paper's runs.

    Attributes:
        table: `papers/bordonaro.toml`, assumptions changed or not.
        asked: number of runs instead of the paper's; None for the paper's.
        seed: of all that is random.
    """

    table: dict[str, Any]
    asked: int | None
    seed: int

    @property
    def assumed(self) -> dict[str, Any]:
        """What the paper leaves open."""
        return self.table["assumed"]  # type: ignore[no-any-return]

    def printed(self, name: str) -> dict[str, Any]:
        """Settings BO-S01 to BO-S08."""
        return self.table["settings"][name]  # type: ignore[no-any-return]

    def runs(self, name: str) -> int:
        """How many: those asked for, printed, or assumed."""
        return self.asked or int(self.printed(name).get("runs", self.assumed["doppler_runs"]))

    @cached_property
    def worlds(self) -> dict[str, Scenario]:
        """Both scenarios."""
        return build("bordonaro", self.table)

    @cached_property
    def few(self) -> Array:
        """Figure 2: plain points (runs, 2) of one target."""
        return self._plain(self.runs("BO-S01"))

    @cached_property
    def many(self) -> Bias:
        """The error (2,) of as many such points as Figure 3 has."""
        return bias(self._plain(self.runs("BO-S02")) - self.target.truth)

    @cached_property
    def target(self) -> single.Sight:
        """Figure 2's target."""
        printed = self.printed("BO-S01")
        return single.sight(printed, printed["bearing_deg"], printed["sigma_bearing_deg"][0])

    def _plain(self, number: int) -> Array:
        z = single.draw(self.target, number, self.seed, "plain")
        return single.converted("conventional", z, self.target).mean

    @cached_property
    def clouds(self) -> dict[float, single.Cloud]:
        """Figure 3, by bearing in degrees."""
        bearings, runs = self.assumed["histogram_bearings_deg"], self.runs("BO-S02")
        return single.clouds(self.printed("BO-S02"), bearings, runs, self.seed)

    @cached_property
    def square_errors(self) -> dict[float, dict[str, Array]]:
        """By bearing noise in degrees and conversion, (runs,): as many runs as Figure 3."""
        printed, runs = self.printed("BO-S03"), self.runs("BO-S02")
        sigmas = printed["sigma_bearing_deg"]
        return {s: single.square_errors(printed, s, runs, self.seed) for s in sigmas}

    @cached_property
    def cells(self) -> single.Cells:
        """Figures 4 and 7."""
        world, runs = self.worlds["bordonaro-static"], self.runs("BO-S03")
        return single.consistency(self.printed("BO-S03"), self.assumed, world, runs, self.seed)

    @cached_property
    def batches(self) -> dict[float, dict[str, Array]]:
        """Figure 5: by range in feet and conversion, errors and claims (bearing noises, 2)."""
        printed, sigmas = self.printed("BO-S04"), self.assumed["batch_sigma_bearing_deg"]
        if self.asked:
            printed = printed | {"samples": self.asked}
        pairs = product(printed["ranges_ft"], sigmas)
        found = {(r, s): single.batch_bias(printed, r, s, self.seed) for r, s in pairs}
        return {
            r: {name: np.array([found[r, s][name] for s in sigmas]) for name in single.BATCHED}
            for r in printed["ranges_ft"]
        }

    @cached_property
    def rest(self) -> dict[float, dict[str, Tracked]]:
        """Figures 6, 8 and 9, by bearing noise in degrees."""
        world, runs = self.worlds["bordonaro-static"], self.runs("BO-S05")
        sigmas = self.printed("BO-S05")["sigma_bearing_deg"]
        return {s: at_rest(world, s, runs, self.seed) for s in sigmas}

    @cached_property
    def large(self) -> dict[str, Tracked]:
        """`rest` at the larger bearing noise."""
        return self.rest[max(self.rest)]

    @cached_property
    def way(self) -> dict[str, Tracked]:
        """Figures 10 to 12."""
        return self._fly(self.worlds["bordonaro-dynamic"])

    @cached_property
    def seldom(self) -> dict[str, Tracked]:
        """The same at another sampling time."""
        world = self.worlds["bordonaro-dynamic"]
        methods = {name: method for name, method in METHODS.items() if name != PRINTED}
        return self._fly(replace(world, dt_s=self.assumed["dt_tried_s"]), methods)

    def _fly(self, world: Scenario, methods: Any = METHODS) -> dict[str, Tracked]:
        motion = nearly_constant(self.assumed["accel_ftps2"])
        return tracked(world, motion, methods, self.runs("BO-S06"), self.seed)

    @cached_property
    def significances(self) -> dict[str, dict[str, Array]]:
        """Figure 13."""
        return doppler.significances(self.printed("BO-S07"), self.assumed)

    @cached_property
    def range_rates(self) -> dict[str, doppler.RangeRates]:
        """Figure 14."""
        printed = self.printed("BO-S08")
        return self._ping(printed, printed["sigma_bearing_deg"][0])

    @cached_property
    def caveat(self) -> dict[str, doppler.RangeRates]:
        """Section 4.3's last sentence: a very small bearing and a large noise of it."""
        bearing = self.assumed["caveat_bearing_deg"]
        printed = self.printed("BO-S08") | {"bearings_deg": [bearing, bearing]}
        return self._ping(printed, self.assumed["caveat_sigma_deg"])

    @cached_property
    def nullified(self) -> tuple[Bias, Bias]:
        """Errors of single plots of Figure 14: by (37) as printed, and as corrected."""
        printed = self.printed("BO-S08")
        seen = doppler.echo(printed, self.assumed, printed["sigma_bearing_deg"][0])
        heard = doppler.pings(printed, self.assumed, seen, self.runs("BO-S08"), self.seed)
        factors = (float(np.exp(sign * seen.sigma_bearing**2 / 2.0)) for sign in (-1.0, 1.0))
        found = [np.ravel(doppler.nullified(heard, seen, factor)) for factor in factors]
        one, other = (bias(plots - printed["closing_ftps"]) for plots in found)
        return one, other

    def _ping(self, printed: dict[str, Any], sigma_deg: float) -> dict[str, doppler.RangeRates]:
        seen = doppler.echo(printed, self.assumed, sigma_deg)
        return doppler.range_rates(printed, self.assumed, seen, self.runs("BO-S08"), self.seed)

    @cached_property
    def spherical(self) -> dict[str, Tracked]:
        """The static target in space."""
        world, high = self.worlds["bordonaro-static"], self.assumed["spherical_elevation_deg"]
        r, up = np.linalg.norm(world.initial), np.radians(high)
        radar: Any = world.sensor
        place = replace(
            world,
            name=f"{world.name}-in-space",
            motion=Static(dims=3),
            initial=np.array([r * np.cos(up), 0.0, r * np.sin(up)]),
            prior_cov=r**2 * np.eye(3),
            sensor=replace(radar, elevation_deg=self.assumed["spherical_sigma_elevation_deg"]),
        )
        methods = {name: method for name, method in METHODS.items() if name != PRINTED}
        return tracked(place, place.motion, methods, self.runs("BO-S05"), self.seed)

    @cached_property
    def with_range_rate(self) -> Tracked:
        """The targets under way, their range rate measured as well as Figure 14's sonar does."""
        world: Any = self.worlds["bordonaro-dynamic"]
        sigma = doppler.echo(self.printed("BO-S08"), self.assumed, 0.0).sigma
        radar: Radar = replace(world.sensor, range_rate_mps=FOOT_M * sigma)
        return self._fly(replace(world, sensor=radar), {"range-rate": RangeRate()})["range-rate"]
