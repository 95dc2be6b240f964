"""Range-rate tracker: converted position, then the product of range and range rate.

Paper: bordonaro section 5, future work.
Differs from it: the paper stops at position. Position is that of DUCM. With c the covariance of
their noises, xi = r d - c has the inner product of position and velocity for its mean, free of
angles and quadratic in the state, so its moments are exact for a normal state ("Beyond the
papers"). What xi shares with the converted position is taken off, and it is used last, at the
point that all else has updated; in the plane and in space, from moving platforms too. Plots without
range or azimuth use range rate as the EKF does; without range rate this is DUCM.

A mean of products is off by what position and velocity err together across the line of sight. That
error outlives a scan, so plots do not average it out, and a filter that takes it for noise of each
plot grows sure of itself and loses the target at 3 degrees and more. Therefore the variance of what
is measured never falls below `persistence` times that of the product of errors: the gain is what
leaves that much. Range rate itself, to second order, was tried in its place: alike below 1 degree,
less stable beyond.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.filters.converted import RATE, Converted, joined, pick, split
from boresight.filters.posterior import Posterior, innovation, tally
from boresight.filters.sight import Sight, convertible, read, sighted
from boresight.filters.steps import State, Surprise
from boresight.maths import Gaussian, gradient, jacobian, mirror, missing, select, solve
from boresight.models.components import Component
from boresight.models.conversions_rate import convert_with_rate, rate_moments
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any
_DUCM = Converted(conversion="ducm")
_NEAREST = 1e-3  # m: no range is divided by that is shorter


class Rate(NamedTuple):
    """A range rate that shares no noise with what was used before.

    Attributes:
        nu: innovation, m/s.
        h: (n,) gradient.
        noise: variance of its noise.
        curvature: variance of what is not linear in the state.
    """

    nu: Any
    h: Array
    noise: Any
    curvature: Any


@dataclass(frozen=True, kw_only=True)
class RangeRate:
    """Range-rate tracker.

    Attributes:
        persistence: times the variance of the product of errors that range rate leaves; 0 takes
            the product for linear.
    """

    persistence: float = 5.0

    def __post_init__(self) -> None:
        """It counts a variance, so it is not negative."""
        if not self.persistence >= 0.0:
            raise UsageError(f"persistence={self.persistence!r} is negative", next_step="use 5")

    plain = True
    start = staticmethod(_DUCM.start)
    layout = staticmethod(_DUCM.layout)
    begin = staticmethod(_DUCM.begin)
    predict = staticmethod(_DUCM.predict)
    output = staticmethod(_DUCM.output)

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """By heights, by the converted plot, by range rate: those that the sensor has."""
        parts = sensor.components(motion)
        heights, polar, rates = split(parts, motion.dims)
        if not rates:
            return _DUCM.update(state, z, motion, sensor)
        surprises = []
        for places in (heights, polar):
            prior = Gaussian(state["mean"], state["cov"])
            alone = np.array([value if i in places else np.nan for i, value in enumerate(z)])
            if places:
                state, found = _DUCM.update(state, alone, motion, sensor)
                told = found._replace(
                    innovation=found.innovation[places], variance=found.variance[places]
                )
                surprises.append((places, told))
        at = Gaussian(state["mean"], state["cov"])
        rate = _alone(at, *(pair[rates[0]] for pair in sensor.independent(z, motion)))
        if convertible(sensor):
            sight, product = _product(prior, at, z, motion, sensor)
            both = zip(product, rate, strict=True)
            rate = Rate(*(select(sight.usable > 0.5, a, b) for a, b in both))
        post = self._use(at, rate, select(missing(z[rates[0]]), 0.0, 1.0))
        surprise = joined(len(parts), *surprises, (rates, post))
        return {"mean": post.mean, "cov": post.cov}, surprise

    def _use(self, prior: Gaussian, rate: Rate, there: Any) -> Posterior:
        """A scalar update that leaves the measured quantity uncertain by its curvature."""
        cross = prior.cov @ rate.h
        before = rate.h @ cross
        s = before + rate.noise + rate.curvature
        after = before * rate.noise / (before + rate.noise) + self.persistence * rate.curvature
        helps = after < before
        share = there * select(helps, (before - after) / select(helps, before * before, 1.0), 0.0)
        nu = rate.nu * there
        totals = tally([there], [nu * nu / s], [there * np.log(s)])
        return Posterior(
            prior.mean + share * nu * cross,
            mirror(prior.cov - share * np.outer(cross, cross)),
            *totals,
            np.array([nu]),
            np.array([select(there < 0.5, np.nan, s)]),
        )


def _alone(at: Gaussian, measured: Any, part: Component) -> Rate:
    """Range rate by itself, as the EKF sees it."""
    predicted, h = gradient(part.value, at.mean)
    _, nu = innovation(part, measured, predicted)
    return Rate(nu, h, part.sigma * part.sigma, 0.0)


def _relative(state: Gaussian, motion: Motion, sensor: Sensor) -> tuple[Array, Array, Array]:
    """Position and velocity (2d,) relative to the sensor, gradient (2d, n), cov (2d, 2d)."""

    def formula(x: Array) -> Array:
        return np.concatenate(sensor.relative(x, motion.dims))  # type: ignore[attr-defined]

    found, G = jacobian(formula, state.mean)
    return found, G, G @ state.cov @ G.T


def _product(
    prior: Gaussian, at: Gaussian, z: Array, motion: Motion, sensor: Sensor
) -> tuple[Sight, Rate]:
    """The product over the measured range, less what it shares with the converted position."""
    d, parts = motion.dims, sensor.components(motion)
    sight = sighted(prior, *pick(split(parts, d)[1], z, parts), motion, sensor)
    measured = z[sensor.names.index(RATE)]
    x, _, cov = _relative(prior, motion, sensor)
    given = rate_moments(x[:d], x[d:], cov)._replace(place=sight.given)
    told = select(missing(measured), given.rate, measured)
    sigma, rho = sensor.range_rate_mps, sensor.range_rate_correlation  # type: ignore[attr-defined]
    found = convert_with_rate(
        np.array([*sight.z, told]), [*sight.sigma, sigma], 0.0 if rho is None else rho, given
    )
    plot = read(sight, Gaussian(found.mean[:d], found.cov[:d, :d]))
    shared = (sight.axes @ found.cov[d, :d]) * plot.seen
    weights = solve(plot.R, shared)
    (p, v), G, (pp, pv, vv) = _parts(*_relative(at, motion, sensor))
    left = plot.nu - plot.H @ (at.mean - prior.mean)  # of the converted position
    scale = 1.0 / select(sight.z[0] < _NEAREST, _NEAREST, sight.z[0])
    return sight, Rate(
        nu=(found.mean[d] - p @ v - np.trace(pv) - weights @ left) * scale,
        h=(np.concatenate([v, p]) @ G - weights @ plot.H) * scale,
        noise=(found.cov[d, d] - weights @ shared) * scale * scale,
        curvature=(np.sum(pp * vv) + np.sum(pv * pv.T)) * scale * scale,
    )


def _parts(x: Array, G: Array, cov: Array) -> tuple[tuple[Array, Array], Array, tuple[Array, ...]]:
    """Position and velocity apart, and the blocks of their covariance."""
    d = len(x) // 2
    return (x[:d], x[d:]), G, (cov[:d, :d], cov[:d, d:], cov[d:, d:])
