"""The R that ECMKF and CMKF-D use on the same plots: kashyap's Figure 6."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.experiments.papers.kashyap_methods import cmkf_d, ecmkf
from boresight.experiments.papers.kashyap_runs import chunks
from boresight.experiments.scenario import Scenario
from boresight.models.error_model import ErrorModel

Array = Any


@dataclass(frozen=True)
class Noises:
    """Variances of the Cartesian channels, by method.

    Attributes:
        mean: averaged over the scans of each run after the window has filled, (runs, d), m².
        first: of the first run, (scans, d), m².
        swing: 5 and 95 % quantiles, over runs and scans, of ECMKF's over CMKF-D-T's.
    """

    mean: dict[str, Array]
    first: dict[str, Array]
    swing: tuple[float, float]


def noises(world: Scenario, model: ErrorModel, runs: int, seed: int) -> Noises:
    """Run the preparations of plots, no filters."""
    methods = {"ecmkf": ecmkf(model)}
    methods |= {"cmkf-d-t": cmkf_d("cmkf-d-t"), "cmkf-d-m": cmkf_d("cmkf-d-m")}
    filled = slice(model.window or 0, None)
    mean: dict[str, list[Array]] = {name: [] for name in methods}
    first: dict[str, Array] = {}
    shares = []
    for truth, plots in chunks(world, runs, seed):
        found = {}
        for name, method in methods.items():
            sensor: Any = method(world, truth, plots).sensor
            found[name] = np.diagonal(sensor.cov, axis1=-2, axis2=-1)
            mean[name].append(np.mean(found[name][:, filled], axis=1))
            first.setdefault(name, found[name][0])
        shares.append((found["ecmkf"] / found["cmkf-d-t"])[:, filled].ravel())
    low, high = np.quantile(np.concatenate(shares), (0.05, 0.95))
    joined = {name: np.concatenate(each) for name, each in mean.items()}
    return Noises(joined, first, (float(low), float(high)))
