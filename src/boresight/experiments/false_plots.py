"""False plots: how many there are at a scan, where they lie, and the target's own among them."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.scenario import CEILING_M, Scenario
from boresight.lanes import Leaf, Rate, Vector
from boresight.maths import missing, select

Array = Any
MOST = 32  # plots of a scan, the target's own among them
_MORE = 1e-9  # probability that a scan would have more


def candidates(scenario: Scenario) -> int:
    """How many plots a scan can hold, the target's own among them; 0 without false plots.

    Raises:
        UsageError: more than `MOST`.
    """
    if not scenario.false_plots:
        return 0
    needed = _needed(float(scenario.false_plots))
    if needed > MOST:
        raise UsageError(
            f"false_plots={scenario.false_plots:g} of scenario {scenario.name!r} is too many",
            why=f"a scan holds at most {MOST} plots, and may have more with a probability of "
            f"{_MORE:g}",
            next_step="give 8 at most; of a wide coverage, only what lies near the target matters",
        )
    return needed


@cache
def _needed(expected: float) -> int:
    from scipy.special import pdtrc

    rare = np.append(pdtrc(np.arange(MOST), expected) < _MORE, [True])
    return int(np.argmax(rare)) + 1


def inputs(scenario: Scenario, names: tuple[str, ...]) -> dict[str, tuple[Leaf, Rate, Array]]:
    """What `among` takes: leaf, rate and value by name; nothing without false plots."""
    many = candidates(scenario)
    if not many:
        return {}
    from scipy.special import pdtr

    low, high = np.transpose([_interval(scenario, name) for name in names])
    return {
        "world.odds": (
            Vector(many - 1),
            Rate.FIXED,
            pdtr(np.arange(many - 1), scenario.false_plots),
        ),
        "world.low": (Vector(len(names)), Rate.FIXED, low),
        "world.span": (Vector(len(names)), Rate.FIXED, high - low),
    }


def _interval(scenario: Scenario, name: str) -> tuple[float, float]:
    """Between which values a component of false plots lies."""
    far, fast = scenario.coverage_m, scenario.coverage_mps
    low, high = np.radians(scenario.coverage_elevation_deg)
    around = {
        "range_m": (0.0, far),
        "azimuth_rad": (-np.pi, np.pi),
        "elevation_rad": (low, high),
        "cone_rad": (0.0, np.pi),
        "height_m": (0.0, CEILING_M),
        "pressure_altitude_m": (0.0, CEILING_M),
        "range_rate_mps": (-fast, fast),
    }
    return around.get(name, (-far, far))


def among(z: Array, drawn: Array, given: Mapping[str, Any]) -> Array:
    """All plots of a scan, in no order: nothing but where it lies tells the target's own.

    Args:
        z: (k,) the target's own, NaN if it was missed.
        drawn: (2 + m k,) uniform numbers.
        given: those of `inputs`.

    Returns:
        (m, k), NaN where there is none.
    """
    k = len(z)
    false = sum(select(drawn[0] > odds, 1.0, 0.0) for odds in given["world.odds"])
    gone = missing(z[0])
    total = false + select(gone, 0.0, 1.0)
    own = select(gone, -1.0, np.floor(drawn[1] * total))
    scattered = given["world.low"] + given["world.span"] * drawn[2:].reshape(-1, k)
    rows = [
        [
            select(abs(own - i) < 0.5, mine, select(total > i + 0.5, other, np.nan))
            for mine, other in zip(z, row, strict=True)
        ]
        for i, row in enumerate(scattered)
    ]
    return np.array(rows)
