"""What is measured of kashyap's runs: percent fit errors, position errors, errors beside bounds.

Paper: kashyap, Tables 2 to 6, Figures 3 to 5 and 8; formulas are ours (errata K9, K13).
Runs are made a few hundred at a time, so their number costs time and not memory.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from boresight.experiments.consistency import line_of_sight_axes
from boresight.experiments.metrics import percent_fit_error, squared_error
from boresight.experiments.papers.kashyap_methods import Method, cmkf_d, ecmkf, polar, track
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.filters.recursion import Estimate
from boresight.maths import wrap
from boresight.maths.seeds import Stream, normals
from boresight.models.error_model import ErrorModel

Array = Any
_CHUNK = 250


def _none() -> Array:
    return np.empty((0, 0, 0), dtype=np.float32)


@dataclass(frozen=True, kw_only=True)
class Tracked:
    """What a method made of many runs.

    Attributes:
        pfe: percent fit error by channel, (runs,) each.
        square: squared position error, (runs, scans), m².
        off: estimate minus truth in range and angles, (runs, scans, d), m and rad; empty if bounds
            were not asked for.
        bounds: two standard deviations of each as the filter claims them (erratum K9).
    """

    pfe: dict[str, Array]
    square: Array
    off: Array = field(default_factory=_none)
    bounds: Array = field(default_factory=_none)

    @property
    def rsspe(self) -> Array:
        """Root sum square position error, averaged over the scans of each run, (runs,), m."""
        return np.mean(np.sqrt(self.square), axis=1)

    def joined(self, other: "Tracked") -> "Tracked":
        """These runs and others."""
        return Tracked(
            pfe={name: np.concatenate([runs, other.pfe[name]]) for name, runs in self.pfe.items()},
            square=np.concatenate([self.square, other.square]),
            off=np.concatenate([self.off, other.off]),
            bounds=np.concatenate([self.bounds, other.bounds]),
        )


def chunks(world: Scenario, runs: int, seed: int) -> Iterator[tuple[Truth, Plots]]:
    """Truth and plots of all runs, a few hundred at a time."""
    for first in range(0, runs, _CHUNK):
        yield simulate(world, runs=min(_CHUNK, runs - first), seed=seed, first=first)


def tracked(
    world: Scenario, methods: Mapping[str, Method], runs: int, seed: int, *, bounds: bool = False
) -> dict[str, Tracked]:
    """Many truths, one noise each, by every method on the same plots."""
    found: dict[str, Tracked] = {}
    for truth, plots in chunks(world, runs, seed):
        for name, method in methods.items():
            part = measured(method, world, truth, plots, bounds=bounds)
            found[name] = found[name].joined(part) if name in found else part
    return found


def measured(
    method: Method, world: Scenario, truth: Truth, plots: Plots, *, bounds: bool = False
) -> Tracked:
    """One method on plots that are there."""
    estimate = track(method, world, truth, plots, ("mean", "cov") if bounds else ("mean",))
    pfe, square = percent_fit_error(estimate, truth), squared_error(estimate, truth)
    if not bounds:
        return Tracked(pfe=pfe, square=square)
    off = off_polar(estimate.mean, truth).astype(np.float32)  # half the memory, and digits enough
    limits = claimed(estimate, off.shape[-1]).astype(np.float32)
    return Tracked(pfe=pfe, square=square, off=off, bounds=limits)


def off_polar(mean: Array, truth: Truth) -> Array:
    """Estimate minus truth in range and angles, (runs, scans, d), m and rad."""
    off = polar(truth._replace(states=mean)) - polar(truth)
    off[..., 1:] = wrap(off[..., 1:])
    return off


def claimed(estimate: Estimate, dims: int) -> Array:
    """Two standard deviations of range and angles, 2 sqrt(H P H'), at the estimate (K9)."""
    at = estimate.mean[..., :dims]
    axes = line_of_sight_axes(at)
    variance = np.sum((axes @ estimate.cov[..., :dims, :dims]) * axes, axis=-1)
    ground, r = np.hypot(at[..., 0], at[..., 1]), np.linalg.norm(at, axis=-1)
    lever = np.stack([np.ones_like(r), ground, r][:dims], axis=-1)
    return 2.0 * np.sqrt(variance) / lever


@dataclass(frozen=True, kw_only=True)
class Repeated:
    """What a method made of a few truths, each seen through many noises.

    Attributes:
        averaged: percent fit error by channel, averaged over the noises, (truths,).
        single: that of the first noise, (truths,).
        of_average: that of the run-averaged estimate, (truths,).
        spread: standard deviation of the percent fit error over noises, of the range, divided by
            its mean, (truths,).
        rsspe: root sum square position error averaged over noises, (truths, scans), m.
        elevation: root mean square elevation error over noises, (truths, scans), rad.
    """

    averaged: dict[str, Array]
    of_average: dict[str, Array]
    single: dict[str, Array]
    spread: Array
    rsspe: Array
    elevation: Array


def repeated(
    world: Scenario, methods: Mapping[str, Method], truths: int, noises: int, seed: int
) -> dict[str, Repeated]:
    """One seed of the process noise and many of the measurement noise, for several truths."""
    truth, plots = again(world, simulate(world, runs=truths, seed=seed), noises, seed)
    return {
        name: _repeated(track(method, world, truth, plots), truth, noises)
        for name, method in methods.items()
    }


def again(
    world: Scenario, simulated: tuple[Truth, Plots], noises: int, seed: int
) -> tuple[Truth, Plots]:
    """Every truth seen through as many new noises, one after the other."""
    truth, plots = simulated
    states, start = (np.repeat(each, noises, axis=0) for each in (truth.states, truth.start))
    truth = truth._replace(states=states, start=start)
    sigma = np.array([part.sigma for part in world.sensor.components(world.motion)])
    shape = (len(truth.time_s), len(sigma))
    drawn = normals(seed, f"{world.name}, many noises", Stream.NOISE, shape, runs=len(states))
    z = polar(truth) + sigma * drawn
    z[..., 1:] = wrap(z[..., 1:])
    mean = plots.prior.mean
    mean = np.repeat(mean, noises, axis=0) if np.ndim(mean) > 1 else mean
    return truth, plots._replace(z=z, prior=plots.prior._replace(mean=mean))


def _repeated(estimate: Estimate, truth: Truth, noises: int) -> Repeated:
    def grouped(values: Array) -> Array:
        return values.reshape(-1, noises, *values.shape[1:])

    pfe = {name: grouped(runs) for name, runs in percent_fit_error(estimate, truth).items()}
    first = truth._replace(states=grouped(truth.states)[:, 0], start=grouped(truth.start)[:, 0])
    average = replace(estimate, others={"mean": np.mean(grouped(estimate.mean), axis=1)})
    up = off_polar(estimate.mean, truth)[..., -1]
    return Repeated(
        averaged={name: np.mean(runs, axis=1) for name, runs in pfe.items()},
        of_average=percent_fit_error(average, first),
        single={name: runs[:, 0] for name, runs in pfe.items()},
        spread=np.std(pfe["range"], axis=1, ddof=1) / np.mean(pfe["range"], axis=1),
        rsspe=np.mean(np.sqrt(grouped(squared_error(estimate, truth))), axis=1),
        elevation=np.sqrt(np.mean(np.square(grouped(up)), axis=1)),
    )


@dataclass(frozen=True, kw_only=True)
class Noises:
    """The R that ECMKF and CMKF-D use on the same plots, by method: Figure 6.

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
    return Noises(mean=joined, first=first, swing=(float(low), float(high)))
