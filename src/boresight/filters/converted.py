"""Converted-measurement Kalman filters: plots become Cartesian points, by any conversion.

[mo1998] L. Mo et al.; [duan2004] Z. Duan et al.; [lerro1993] D. Lerro and Y. Bar-Shalom.
Paper: bordonaro (24) to (31), sections 2.4 and 3; kashyap's appendix.
Differs from them: any conversion, in the plane and in space, from any pose (errata B10, B11, and
those of `models.conversions`); a filter starts from its own conversion given the plot, DUCM from
that of UCM (erratum B9); an elevation that is not measured is the predicted one; a plot without
range or azimuth updates the block EKF instead; heights come before and range rates after, as in the
sequential EKF.

What the conversions do to a filter: conventional, ucm, mucm and cmkf-d-m take the noise from the
plot, so noise and gain are correlated and the estimate is biased along the line of sight; mmse and
mucm bias the plot itself; ducm does neither, and pays with a wider start.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from boresight.errors import UsageError
from boresight.filters import ekf, kalman
from boresight.filters.posterior import Posterior
from boresight.filters.sight import (
    Sight,
    condition,
    convertible,
    log_volume,
    read,
    relative_place,
    sighted,
)
from boresight.filters.start import SPEED_MPS, one_plot
from boresight.filters.steps import State, Surprise, gaussian_layout
from boresight.lanes import Leaf, Vector
from boresight.maths import Gaussian, select
from boresight.models.components import Component
from boresight.models.conversions import CONVERSIONS, convert, lookup, stretched
from boresight.models.motion import Motion
from boresight.models.polar import Given, mean_point, place, polar_moments
from boresight.models.sensors import Sensor

Array = Any
POLAR, RATE = ("range_m", "azimuth_rad", "elevation_rad"), "range_rate_mps"
Conditioning = Literal["prediction", "previous measurement"]


def joined(size: int, *updates: tuple[Sequence[int], Posterior | Surprise]) -> Surprise:
    """Surprises one after the other as one, each with the places of its components in the plot."""
    nu, variance = [0.0] * size, [0.0] * size
    for places, found in updates:
        for i, a, b in zip(places, found.innovation, found.variance, strict=True):
            nu[i], variance[i] = a, b
    founds = [found for _, found in updates]
    return Surprise(
        nis=sum(found.nis for found in founds),
        dof=sum(found.dof for found in founds),
        loglik=sum(found.loglik for found in founds),
        innovation=np.array(nu),
        variance=np.array(variance),
    )


def split(parts: Sequence[Component], dims: int) -> tuple[list[int], list[int], list[int]]:
    """Where in a plot coordinates and heights stand, range and angles (as in `POLAR`), and rates.

    That is the order of use: a radar without elevation needs the height before it converts.
    """
    names = [part.name for part in parts]
    polar = [names.index(name) for name in POLAR[:dims] if name in names]
    rates = [i for i, name in enumerate(names) if name == RATE]
    return [i for i in range(len(names)) if i not in (*polar, *rates)], polar, rates


def pick(
    places: Sequence[int], z: Array, parts: Sequence[Component]
) -> tuple[Array, list[Component]]:
    """The plot and the components at these places."""
    return np.array([z[i] for i in places]), [parts[i] for i in places]


def by_plot(
    prior: Gaussian, sight: Sight, taken: tuple[Array, list[Component]], name: str, given: Given
) -> Posterior:
    """Condition on a converted plot.

    Args:
        prior: predicted mean (n,), cov (n, n).
        sight: the plot beside it.
        taken: range and angles as measured, and their components.
        name: of the conversion.
        given: where the target is taken to be.
    """

    def convert_at(z: Array) -> Gaussian:
        return convert(name, z, sight.sigma, given)

    post = condition(prior, sight, read(sight, convert_at(sight.z)), *taken)
    volume = log_volume(sight, lambda z: convert_at(z).mean)
    return post._replace(loglik=post.loglik + volume)


@dataclass(frozen=True, kw_only=True)
class Converted:
    """A converted-measurement Kalman filter.

    Attributes:
        conversion: one of `models.conversions.CONVERSIONS`. Where a conversion asks for the truth
            (cmkf-d-t, mmse), what `conditioning` names stands in.
        conditioning: where the target is taken to be when noise is converted: the prediction, or
            the plot before. Matters to ducm, cmkf-d-t and mmse.
        scale_output: told positions are multiplied by bordonaro's (31), in space also for the
            elevation; the state and its covariance never are (erratum B11).
    """

    conversion: str = "ducm"
    conditioning: Conditioning = "prediction"
    scale_output: bool = False

    def __post_init__(self) -> None:
        """Names must be known."""
        lookup(self.conversion, CONVERSIONS)
        if self.conditioning not in get_args(Conditioning):
            raise UsageError(
                f"conditioning={self.conditioning!r} is unknown",
                next_step=f"use one of {', '.join(get_args(Conditioning))}",
            )

    @property
    def plain(self) -> bool:
        """Unless it keeps the plot before, or tells what it does not keep."""
        return self.conditioning == "prediction" and not self.scale_output

    def _remembers(self, sensor: Sensor) -> bool:
        return self.conditioning == "previous measurement" and convertible(sensor)

    def start(
        self, z: Array, motion: Motion, sensor: Sensor, *, speed_mps: float = SPEED_MPS
    ) -> Gaussian:
        """Position by the conversion, given the plot (erratum B9); velocity unknown."""
        name = "cmkf-d-m" if self.conversion == "cmkf-d-t" else self.conversion
        return one_plot(z, motion, sensor, speed_mps=speed_mps, conversion=name)

    def layout(self, motion: Motion, sensor: Sensor) -> dict[str, Leaf]:
        """Mean and cov; the plot before as a position (d,) seen from the sensor, if need be."""
        kept = gaussian_layout(motion)
        return kept | {"previous": Vector(motion.dims)} if self._remembers(sensor) else kept

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """The Gaussian; its position stands for the plot before."""
        state = start._asdict()
        if self._remembers(sensor):
            position, H = relative_place(start.mean, motion, sensor)
            state["previous"] = (H.T @ position)[: motion.dims]
        return state

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """By the motion."""
        del sensor
        prior = Gaussian(state["mean"], state["cov"])
        return {**state, **kalman.predict(prior, motion, dt)._asdict()}

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """By heights, by the converted plot, by range rate: those that the sensor has."""
        at, kept = Gaussian(state["mean"], state["cov"]), state
        z, parts = sensor.independent(z, motion)
        heights, polar, rates = split(parts, motion.dims)
        updates = []
        for places in (heights, polar, rates):
            if places:
                taken = pick(places, z, parts)
                if places is not polar:
                    post = ekf.update_sequential(at, *taken)
                elif not convertible(sensor):
                    post = ekf.update(at, *taken)
                else:
                    sight = sighted(at, *taken, motion, sensor)
                    given = self._given(state, sight)
                    post = by_plot(at, sight, taken, self.conversion, given)
                    kept = self._remembered(state, sight)
                at = Gaussian(post.mean, post.cov)
                updates.append((places, post))
        return {**kept, **at._asdict()}, joined(len(parts), *updates)

    def _given(self, state: State, sight: Sight) -> Given:
        if "previous" not in state:
            return sight.given
        d = len(sight.position)
        before = polar_moments(sight.H[:, :d] @ state["previous"], np.zeros((d, d)))
        return before._replace(variances=[s * s for s in sight.sigma])

    def _remembered(self, state: State, sight: Sight) -> State:
        if "previous" not in state:
            return state
        d = len(sight.position)
        point = mean_point(place(Given(sight.z, [0.0] * d)))
        seen = sight.H[:, :d].T @ point
        return {"previous": select(sight.usable > 0.5, seen, state["previous"])}

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """The Gaussian; if asked, its position shortened by (31)."""
        mean, cov = state["mean"], state["cov"]
        if not (self.scale_output and convertible(sensor)):
            return Gaussian(mean, cov)
        position, H = relative_place(mean, motion, sensor)
        _, azimuth, *elevation = polar_moments(position, H @ cov @ H.T).variances
        up = np.exp(-elevation[0]) if elevation else 1.0
        shortened = stretched(position, np.exp(-azimuth) * up, up)  # (31)
        return Gaussian(mean + H.T @ (shortened - position), cov)
