"""One scan of the error model for one target: the formula that is recorded.

Paper: kashyap (4), (5) and (8), one channel at a time.
Differs from it: see `filters.error_model`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters.ekf import condition
from boresight.filters.error_window import noise_of, pushed
from boresight.lanes import Leaf, Matrix, Vector
from boresight.maths import Gaussian, gradient, mirror, missing, select, wrap
from boresight.models.components import FORMULAS, Component
from boresight.models.conversions import convert
from boresight.models.error_model import ErrorModel
from boresight.models.sensors import Radar

Array = Any
POLAR, CARTESIAN = ("range_m", "azimuth_rad", "elevation_rad"), ("x_m", "y_m", "z_m")
_RADIANS = np.pi / 180.0
_CERTAIN = 30.0  # logarithm of odds beyond which evidence is not counted
_SETTLED = 6.0  # at odds of minus this there is no bias, and the search begins anew


@dataclass(frozen=True)
class Case:
    """A model, a sensor and a number of axes: what decides the formula.

    Attributes:
        model: what the error is taken to be.
        sensor: what measured the plots.
        dims: axes of the reference, 2 or 3.
    """

    model: ErrorModel
    sensor: Radar
    dims: int

    @property
    def polar(self) -> bool:
        """Whether channels are range and angles."""
        return self.model.frame == "polar"

    @property
    def measured(self) -> tuple[str, ...]:
        """Components of the sensor that the channels are made of."""
        wanted = POLAR[: self.dims]
        found = tuple(name for name in wanted if name in self.sensor.names)
        if not found or not (self.polar or found == wanted):
            raise UsageError(
                f"a sensor of {', '.join(self.sensor.names)} gives no {self.model.frame} plots "
                f"in {self.dims} dimensions",
                next_step='use frame="polar" and a sensor of range or angles',
            )
        return found

    @property
    def columns(self) -> list[int]:
        """Where in a plot they stand."""
        return [self.sensor.names.index(name) for name in self.measured]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the error's channels, with units."""
        return self.measured if self.polar else CARTESIAN[: self.dims]

    def is_angle(self, channel: int) -> bool:
        """Whether a channel is an angle."""
        return self.channels[channel].endswith("_rad")

    @property
    def sigma(self) -> list[Any]:
        """Nominal standard deviations of what is measured, m and rad."""
        fields = [getattr(self.sensor, name.replace("_rad", "_deg")) for name in self.measured]
        return [
            s * _RADIANS if name in POLAR[1:] else s
            for name, s in zip(self.measured, fields, strict=True)
        ]

    @property
    def layout(self) -> dict[str, Leaf]:
        """What travels from scan to scan."""
        c, n = len(self.channels), 1 if self.model.state == "bias" else 2
        kept = {"error": Matrix(c, n), "cov": Matrix(c, n * n)}
        kept |= {"known": Vector(c), "evidence": Vector(c)}
        if self.model.window:
            kept |= {"last": Matrix(self.model.window, c), "count": Vector(c)}
        return kept

    @property
    def told(self) -> dict[str, Leaf]:
        """What is written at every scan."""
        c = len(self.channels)
        width = len(self.sensor.names) if self.polar else c
        return {
            "z": Vector(width),
            "error": Vector(c),
            "error_cov": Matrix(c, c),
            "noise_cov": Matrix(c, c),
            "probability": Vector(c),
        }


class Beside(NamedTuple):
    """One plot beside its reference, by channel.

    Attributes:
        plot: (c,) as measured, NaN where missing.
        difference: (c,) reference minus plot, dZ (erratum K6); NaN where one is missing.
        noise: (c, c) nominal covariance of the plot.
        blur: (c,) variances of the reference.
    """

    plot: Array
    difference: Array
    noise: Array
    blur: Array


class Followed(NamedTuple):
    """One channel after a scan.

    Attributes:
        prior, post: the error (and its rate) before and after the reference was used.
        there: 1 if plot and reference were there, else 0.
        known: 1 once they were, else 0: then the prior is the widest.
        evidence: logarithm of what references have made of the odds for a bias.
        probability: of a bias, before this scan's reference was used.
    """

    prior: Gaussian
    post: Gaussian
    there: Any
    known: Any
    evidence: Any
    probability: Any


def step(
    case: Case, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """One scan of one target: new state, and what is told."""
    model, z = case.model, inputs["z"]
    beside = (_polar if case.polar else _cartesian)(case, z, inputs["reference"])
    found = [_follow(case, i, beside, state, inputs["dt"]) for i in range(len(case.channels))]
    kept, noise = _windowed(model, beside, found, state)
    applied = [_applied(model, channel) for channel in found]
    error, variance = (np.array(each) for each in zip(*applied, strict=True))
    plot = beside.plot + error
    told = {"error": error, "error_cov": np.diag(variance), "noise_cov": noise}
    told["probability"] = np.array([channel.probability for channel in found])
    told["z"] = _back(case, z, plot) if case.polar else plot
    kept["error"] = np.array([channel.post.mean for channel in found])
    kept["cov"] = np.array([channel.post.cov.ravel() for channel in found])
    kept["known"] = np.array([channel.known for channel in found])
    kept["evidence"] = np.array([channel.evidence for channel in found])
    return kept, told


def _polar(case: Case, z: Array, reference: Array) -> Beside:
    """Range and angles as measured, and those of the reference as the sensor would see it."""
    place, gone = _safe(reference)
    rows = []
    for i, name in zip(case.columns, case.measured, strict=True):
        component = Component(name, partial(_seen, case, FORMULAS[name]), 0.0)
        seen, h = gradient(component.value, place)
        rows.append((z[i], select(gone, np.nan, component.residual(seen, z[i])), h @ h))
    plot, differences, slopes = (np.array(each) for each in zip(*rows, strict=True))
    noise = np.diag(np.array([s * s for s in case.sigma]))
    return Beside(plot, differences, noise, slopes * _blur(case))


def _seen(case: Case, formula: Any, place: Array) -> Any:
    return formula(*case.sensor.relative(place, case.dims))


def _cartesian(case: Case, z: Array, reference: Array) -> Beside:
    """The plot as a point of the track frame (kashyap (3)), and J R J' for its noise."""
    d = case.dims
    polar, gone = _safe(np.array([z[i] for i in case.columns]))
    point, noise = convert("conventional", polar, case.sigma)
    if case.sensor.pose is not None:
        turn = case.sensor.pose.rotation[:d, :d]
        point = turn.T @ point + case.sensor.pose.position_m[:d]
        noise = turn.T @ noise @ turn
    if case.model.noise == "diagonal":
        noise = np.diag(np.diag(noise))
    point = np.array([select(gone, np.nan, each) for each in point])
    return Beside(point, reference - point, mirror(noise), np.ones(d) * _blur(case))


def _safe(numbers: Array) -> tuple[Array, Any]:
    """The numbers, all 1 where one of them is missing, and whether one is."""
    gone = missing(sum(numbers))
    return np.array([select(gone, 1.0, each) for each in numbers]), gone


def _blur(case: Case) -> Any:
    return case.model.reference_m * case.model.reference_m


def _follow(case: Case, i: int, beside: Beside, state: Mapping[str, Any], dt: Any) -> Followed:
    """One channel through one scan, by (4), (5) and (8)."""
    difference, known = beside.difference[i], state["known"][i]
    gone = missing(difference)
    there, off = select(gone, 0.0, 1.0), select(gone, 0.0, difference)
    prior = _predicted(case, i, state, there, dt)
    wide = _widest(case.model, beside.noise[i, i], len(prior.mean))
    prior = Gaussian(prior.mean, _chosen(known < 0.5, wide, prior.cov))
    r, nu = beside.noise[i, i] + beside.blur[i], off - prior.mean[0]
    nu = (wrap(nu) if case.is_angle(i) else nu) * there
    post, s = condition(prior, np.eye(len(prior.mean))[0], nu, r, there)
    known = select(gone, known, 1.0)
    evidence, probability = state["evidence"][i], 1.0 + 0.0 * known
    if case.model.odds is not None:
        probability = 1.0 / (1.0 + case.model.odds * np.exp(-evidence))
        evidence = evidence + there * 0.5 * (off * off / r - nu * nu / s - np.log(s / r))
        evidence = select(evidence > _CERTAIN, _CERTAIN, evidence)
        settled = evidence < -_SETTLED
        post, known, evidence = _anew(settled, post, known, evidence)
    return Followed(prior, post, there, known, evidence, probability)


def _predicted(case: Case, i: int, state: Mapping[str, Any], there: Any, dt: Any) -> Gaussian:
    """The error dt later: (4) and (7), with erratum K7 for a rate."""
    model, mean = case.model, state["error"][i]
    cov = state["cov"][i].reshape(len(mean), len(mean))
    drift = model.drift_deg * _RADIANS if case.is_angle(i) else model.drift_m
    if model.state == "bias":
        return Gaussian(mean, cov + drift * drift * dt)
    F = np.array([[1.0, dt], [0.0, 1.0]])
    G = np.array([dt * dt / 2.0, dt]) * drift
    moved = F @ mean
    if model.outage == "hold":
        moved = _chosen(there > 0.5, moved, mean)
    return Gaussian(moved, mirror(F @ cov @ F.T + np.outer(G, G)))


def _widest(model: ErrorModel, variance: Any, order: int) -> Array:
    """Covariance of an error that no reference has met."""
    spreads = (model.spread, model.rate_spread)[:order]
    return np.diag(np.array([s * s * variance for s in spreads]))


def _anew(settled: Any, post: Gaussian, known: Any, evidence: Any) -> tuple[Gaussian, Any, Any]:
    """Where it is settled that there is no bias, the search for one begins anew."""
    mean = _chosen(settled, post.mean * 0.0, post.mean)
    known, evidence = (select(settled, 0.0, each) for each in (known, evidence))
    return Gaussian(mean, post.cov), known, evidence


def _chosen(condition: Any, a: Array, b: Array) -> Array:
    """`select` for arrays of one shape."""
    pairs = zip(a.ravel(), b.ravel(), strict=True)
    return np.array([select(condition, x, y) for x, y in pairs]).reshape(a.shape)


def _applied(model: ErrorModel, channel: Followed) -> tuple[Any, Any]:
    """What is added to the plot, and the variance of the error about it.

    The error is 0, or it is normal: the mean and the variance of such a mixture.
    """
    if model.correction == "none":
        return channel.there * 0.0, channel.post.cov[0, 0]
    used = channel.post if model.correction == "same epoch" else channel.prior
    p, error, variance = channel.probability, used.mean[0], used.cov[0, 0]
    mean = p * error
    if model.outage == "zero":
        mean = mean * channel.there
    return mean, p * (variance + error * error) - 2.0 * p * error * mean + mean * mean


def _windowed(
    model: ErrorModel, beside: Beside, found: Sequence[Followed], state: Mapping[str, Any]
) -> tuple[dict[str, Any], Array]:
    """The window with this scan's entry, and the noise of the plot."""
    if not model.window:
        return {}, beside.noise
    taken_off = {
        "difference": [0.0] * len(found),
        "innovation": [channel.prior.mean[0] for channel in found],
        "residual": [channel.post.mean[0] for channel in found],
    }[model.source]
    entries = beside.difference - np.array(taken_off)
    before = state["last"], state["count"]
    after = pushed(*before, entries, together=model.noise == "full")
    # A correction by the prediction uses nothing of this scan; then its noise does not either.
    used = before if model.correction == "prediction" else after
    return dict(zip(("last", "count"), after, strict=True)), noise_of(model, *used, beside.noise)


def _back(case: Case, z: Array, plot: Array) -> Array:
    """The whole plot with its corrected channels, angles wrapped."""
    whole = [*z]
    for i, name, value in zip(case.columns, case.measured, plot, strict=True):
        whole[i] = wrap(value) if name.endswith("_rad") else value
    return np.array(whole)
