"""Whether a reference leaks into an estimate: errors below what any filter of the radar could have.

Paper: kashyap, sections 2.1 and 4. The bound is that of the radar's plots alone along each
trajectory; a filter that is told no more than they are has a ratio of 1 at best. The paper's sets
have white noise without a bias, so nothing but the reference itself can bring a ratio below 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from boresight.experiments.bounds import bound_per_trajectory
from boresight.experiments.metrics import elements, squared_error
from boresight.experiments.papers.kashyap_methods import Method, emekf, plain, positions, track
from boresight.experiments.papers.kashyap_runs import chunks
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Truth
from boresight.filters.error_model import correct
from boresight.models.error_model import MODELS, ErrorModel

Array = Any
_SETTLED = slice(20, None)  # scans: the start is over


class Ratio(NamedTuple):
    """Root mean square position error over the radar-only bound, over all runs.

    Attributes:
        value: the ratio.
        standard_error: of it, from how much it differs between tenths of the runs.
    """

    value: float
    standard_error: float


def over_bound(
    world: Scenario, methods: Mapping[str, Method], runs: int, seed: int
) -> dict[str, Ratio]:
    """Ratio of each method; filters start at a draw from their own spread."""
    world = replace(world, begin="random draw")
    squares: dict[str, list[Array]] = {name: [] for name in methods}
    bounds = []
    for truth, plots in chunks(world, runs, seed):
        at = elements(truth.names, "position")
        cov = bound_per_trajectory(truth, plots, world.motion, world.sensor)
        bounds.append(np.mean(np.sum(cov[:, _SETTLED, at, at], axis=-1), axis=1))
        for name, method in methods.items():
            estimate = track(method, world, truth, plots)
            squares[name].append(np.mean(squared_error(estimate, truth)[:, _SETTLED], axis=1))
    bound = np.concatenate(bounds)
    return {name: _ratio(np.concatenate(each), bound) for name, each in squares.items()}


def _ratio(square: Array, bound: Array) -> Ratio:
    """Ratio of sums over runs, with the standard error of such a ratio (delta method)."""
    share = float(np.sum(square) / np.sum(bound))
    rest = square - share * bound
    error = float(np.sqrt(np.sum(rest**2)) / np.sum(bound)) if len(bound) > 1 else np.inf
    return Ratio(share**0.5, error / (2.0 * share**0.5))


def outage(
    world: Scenario, scans: tuple[int, int], model: ErrorModel, runs: int, seed: int
) -> dict[str, float]:
    """Median position error, m, in scans without a reference, by what is done there."""
    gap = slice(*scans)

    def reference(truth: Truth) -> Array:
        at = positions(truth)
        at[:, gap] = np.nan
        return at

    methods: dict[str, Method] = {
        "error model moved on without the reference": emekf(model, reference=reference),
        "last error held": emekf(replace(model, outage="hold"), reference=reference),
        "no correction meanwhile": emekf(replace(model, outage="zero"), reference=reference),
        "our default error model": emekf(MODELS["random walk"], reference=reference),
        "EKF, no reference at all": plain("ekf"),
    }
    found = _squares(world, methods, runs, seed)
    return {name: float(np.median(np.sqrt(square[:, gap]))) for name, square in found.items()}


def biased(
    world: Scenario,
    bias: Sequence[float],
    scans: tuple[int, int],
    model: ErrorModel,
    runs: int,
    seed: int,
) -> dict[str, dict[str, float]]:
    """Errors before an outage and in it, where plots have a bias (m, deg, deg)."""
    added = np.array([bias[0], *np.radians(bias[1:])])
    before, gap = slice(_SETTLED.start, scans[0]), slice(*scans)

    def reference(truth: Truth) -> Array:
        at = positions(truth)
        at[:, gap] = np.nan
        return at

    default = MODELS["random walk"]
    methods: dict[str, Method] = {
        "EMEKF": emekf(model, reference=reference),
        "our default error model": emekf(default, reference=reference),
        "EKF, no reference at all": plain("ekf"),
    }
    found = _squares(world, methods, runs, seed, added)
    found |= _squares(world, {"EKF on plots without the bias": plain("ekf")}, runs, seed)
    errors = {
        label: {name: float(np.sqrt(np.mean(each[:, part]))) for name, each in found.items()}
        for label, part in (("with a reference", before), ("in the outage", gap))
    }
    off = {
        f"{name}, {channel}": value
        for name, each in (("EMEKF", model), ("our default error model", default))
        for channel, value in _off(world, added, before, each, runs, seed).items()
    }
    return errors | {"error of the estimated bias": off}


def _off(
    world: Scenario, bias: Array, scans: slice, model: ErrorModel, runs: int, seed: int
) -> dict[str, float]:
    """Root mean square error of the estimated bias, in standard deviations of a plot."""
    truth, plots = next(chunks(world, runs, seed))
    radar: Any = world.sensor
    found = correct(plots.z + bias, positions(truth), plots.dt, radar, model=model)
    sigma = np.array([each.sigma for each in radar.components(world.motion)])
    off = np.sqrt(np.mean(np.square(found.error[:, scans] + bias), axis=(0, 1))) / sigma
    return dict(zip(("range", "azimuth", "elevation"), map(float, off), strict=True))


def slower(
    world: Scenario, every: int, model: ErrorModel, runs: int, seed: int
) -> dict[str, float]:
    """Root mean square position error, m, of a radar that is faster than its reference."""

    def reference(truth: Truth) -> Array:
        at = positions(truth)
        at[:, np.arange(at.shape[1]) % every != 0] = np.nan
        return at

    quick = replace(world, name=f"{world.name}, quick", dt_s=world.dt_s / every)
    methods: dict[str, Method] = {
        "a reference for every plot": emekf(model),
        f"one for every {every} plots": emekf(model, reference=reference),
        "our default error model": emekf(MODELS["random walk"], reference=reference),
        "EKF, no reference at all": plain("ekf"),
    }
    found = _squares(quick, methods, runs, seed)
    return {name: float(np.sqrt(np.mean(square[:, _SETTLED]))) for name, square in found.items()}


def _squares(
    world: Scenario, methods: Mapping[str, Method], runs: int, seed: int, bias: Any = 0.0
) -> dict[str, Array]:
    """Squared position errors (runs, scans) by method, a bias added to plots."""
    found: dict[str, list[Array]] = {name: [] for name in methods}
    for truth, plots in chunks(world, runs, seed):
        for name, method in methods.items():
            estimate = track(method, world, truth, plots._replace(z=plots.z + bias))
            found[name].append(squared_error(estimate, truth))
    return {name: np.concatenate(each) for name, each in found.items()}
