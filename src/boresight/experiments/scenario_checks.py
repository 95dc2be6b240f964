"""What a scenario is checked for when it is made: can it be simulated as it is written?"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from boresight.errors import UsageError

if TYPE_CHECKING:
    from boresight.experiments.scenario import Scenario


def check_shape(scenario: "Scenario", name: str, shape: tuple[int, ...]) -> None:
    """Numbers of the motion's state, as many as are needed and finite."""
    array = getattr(scenario, name)
    if array.shape != shape:
        raise UsageError(
            f"{name} of scenario {scenario.name!r} has shape {array.shape}; {shape} is needed",
            why=f"the motion's state is {', '.join(scenario.motion.names)}",
        )
    if not np.isfinite(array).all():
        raise UsageError(f"{name} of scenario {scenario.name!r} holds what is no finite number")


def check_begin(scenario: "Scenario", ways: Iterable[str]) -> None:
    """A way to begin that is known, and scans and time enough for it."""
    if scenario.begin not in ways:
        raise UsageError(
            f"begin={scenario.begin!r} of scenario {scenario.name!r} is not a way to begin",
            next_step=f"use {', '.join(ways)}",
        )
    if scenario.scans < 1 or not 0 < scenario.dt_s < np.inf:
        raise UsageError(
            f"scenario {scenario.name!r} has scans={scenario.scans}, dt_s={scenario.dt_s}",
            why="there must be at least one scan, and time between scans",
        )
    if scenario.scans < scenario.spent:
        raise UsageError(
            f"scenario {scenario.name!r} has scans={scenario.scans}, and begins with "
            f"{scenario.begin}",
            next_step=f"give at least {scenario.spent} scans",
        )


def check_sight(scenario: "Scenario") -> None:
    """Detection, bias and false plots that can be drawn."""
    name = f"of scenario {scenario.name!r}"
    if not 0.0 < scenario.detection <= 1.0:
        raise UsageError(
            f"detection={scenario.detection} {name} is not a probability",
            why="it must be above 0 and at most 1",
        )
    for component, value in scenario.bias.items():
        if not np.isfinite(value):
            raise UsageError(f"bias[{component!r}]={value} {name} is not finite")
    if not 0.0 <= scenario.false_plots < np.inf:
        raise UsageError(f"false_plots={scenario.false_plots} {name} is not a number of plots")
    if scenario.false_plots:
        _check_coverage(scenario, name)


def _check_coverage(scenario: "Scenario", name: str) -> None:
    if not 0.0 < scenario.coverage_m < np.inf:
        raise UsageError(
            f"coverage_m={scenario.coverage_m} {name}, which has false plots",
            next_step="say how far the sensor sees: coverage_m=100_000.0",
        )
    low, high = scenario.coverage_elevation_deg
    if not -90.0 <= low < high <= 90.0:
        raise UsageError(
            f"coverage_elevation_deg={(low, high)} {name}",
            why="the lowest must be below the highest, within -90 and 90 degrees",
        )
    if not 0.0 < scenario.coverage_mps < np.inf:
        raise UsageError(f"coverage_mps={scenario.coverage_mps} {name} is not a speed")
