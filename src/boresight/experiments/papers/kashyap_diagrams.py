"""kashyap's block diagrams as what they claim: what depends on what.

The drawings are not in the text that we have; they are drawn again, from captions and equations,
on the documentation's page on the paper. Here each arrow is tried: what it comes from is
disturbed, and where it leads must change; where no arrow leads, nothing may.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from boresight.experiments.papers.kashyap_methods import Method, Ready, cmkf_d, run_ready
from boresight.experiments.papers.kashyap_study import Study
from boresight.experiments.papers.kashyap_words import row
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.experiments.verdicts import (
    Claim,
    said,
)
from boresight.models.motion import ConstantVelocity

Array = Any
Case = tuple[Scenario, Truth, Plots]
_FARTHER = 1.001  # times: a disturbance of a range or of a position


def diagrams(study: Study) -> list[Claim]:
    """KA-F1a, KA-F1b, KA-F2 and KA-FA."""
    space, plane = (_case(study, name) for name in ("Set 2", "Set 4"))
    ecmkf, emekf = study.pair["ecmkf"], study.pair["emekf"]
    t, m = cmkf_d("cmkf-d-t"), cmkf_d("cmkf-d-m")
    drawn = {
        "KA-F1a": _prepared(ecmkf, space),
        "KA-F1b": _prepared(ecmkf, space) | _tracked(ecmkf, space),
        "KA-F2": _prepared(emekf, space) | _tracked(emekf, space),
        "KA-FA": {f"T: {arrow}": there for arrow, there in _prepared(t, plane).items()}
        | {f"M: {arrow}": there for arrow, there in _prepared(m, plane).items()},
    }
    return [_claim(study, name, arrows) for name, arrows in drawn.items()]


def _case(study: Study, name: str) -> Case:
    world = study.worlds[name]
    return world, *simulate(world, runs=1, seed=study.seed)


def _claim(study: Study, name: str, arrows: dict[str, bool]) -> Claim:
    """A diagram holds if all its arrows are there, and no others."""
    expected = study.table["diagrams"][name]["arrows"]
    return row(
        study,
        "diagrams",
        name,
        ours=arrows,
        verdict=said({arrow for arrow, there in arrows.items() if there} == set(expected)),
        assumption="the text that we have holds captions and no drawings; it is drawn again in "
        "docs/papers/kashyap.md. Each arrow was tried on one run: its source was disturbed, and "
        "its end changed, or, where none is drawn, did not",
    )


def _prepared(method: Method, case: Case) -> dict[str, bool]:
    """What plots, reference and tracker do to the plots and the R that a filter is given."""
    world, truth, plots = case
    usual = method(*case)
    farther = plots.z * np.array([_FARTHER, *[1.0] * (plots.z.shape[-1] - 1)])
    faster = replace(world, motion=ConstantVelocity(accel_mps2=9.0, dims=world.motion.dims))
    others = {
        "plots": method(world, truth, plots._replace(z=farther)),
        "reference": method(world, truth._replace(states=truth.states * _FARTHER), plots),
        "tracker": method(faster, truth, plots),
    }
    return {
        f"{source} -> {end}": not np.array_equal(of(usual), of(other))
        for source, other in others.items()
        for end, of in (("corrected plots", _points), ("R", _noise))
    }


def _points(ready: Ready) -> Array:
    return ready.plots.z


def _noise(ready: Ready) -> Array:
    sensor: Any = ready.sensor
    return sensor.cov if hasattr(sensor, "cov") else np.asarray(sensor.range_m)


def _tracked(method: Method, case: Case) -> dict[str, bool]:
    """What the filter makes of corrected plots and R."""
    world, ready = case[0], method(*case)
    usual = run_ready(ready, world).mean
    moved = ready._replace(plots=ready.plots._replace(z=ready.plots.z * _FARTHER))
    sensor: Any = ready.sensor
    name = "cov" if hasattr(sensor, "cov") else "range_m"
    rougher = ready._replace(sensor=replace(sensor, **{name: getattr(sensor, name) * _FARTHER}))
    return {
        "corrected plots -> track": not np.array_equal(run_ready(moved, world).mean, usual),
        "R -> track": not np.array_equal(run_ready(rougher, world).mean, usual),
    }
