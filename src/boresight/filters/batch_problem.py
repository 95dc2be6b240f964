"""What a batch estimate minimises, recorded once: all plots against one track without noise."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from boresight.filters.formula import Formula
from boresight.filters.posterior import innovation
from boresight.filters.reversible import later
from boresight.lanes import Leaf, Rate, Scalar, Symmetric, Vector
from boresight.maths import gradient, jacobian, mirror, missing, select
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any
_FLOOR_M = 1e-3  # as in `models.components`: a target at the sensor has no direction


class Prior(NamedTuple):
    """A Gaussian in information form: what its matrix does not weigh is not known beforehand.

    Attributes:
        mean: (n,) or (lanes, n), at the first plot.
        information: (n, n) or (lanes, n, n), positive semidefinite.
        range_m, range_sd_m: distance from the sensor at the first plot, and its spread; None for
            none. Unlike a mean it does not say in which direction.
    """

    mean: Array
    information: Array
    range_m: float | None = None
    range_sd_m: float | None = None


class Normal(NamedTuple):
    """The normal equations at tracks, in the state at the first plot.

    Attributes:
        information: (m, n, n).
        gradient: (m, n), minus that of the cost.
        cost: (m,), half the sum of squares.
    """

    information: Array
    gradient: Array
    cost: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """Plots (lanes, steps, k), models, dt (steps,) and a prior."""

    z: Array
    motion: Motion
    sensor: Sensor
    dt: Array
    prior: Prior | None

    def normal(self, first: Array, lane: Array) -> Normal:
        """At tracks (m, n), each of a lane (m,)."""
        n = first.shape[1]
        state = {"first": Vector(n), "elapsed": Scalar(), **_equations(n)}
        start = {"first": first, "elapsed": np.zeros(len(first))}
        start |= self._of_prior(first, lane)._asdict()
        last, _ = self._formula(_gather, state, {}).carry(start, self._inputs(lane), len(self.dt))
        return Normal(*(last[name] for name in Normal._fields))

    def told(self, first: Array) -> tuple[Array, Array, Array]:
        """State and information at the last plot, and residuals, of one track a lane."""
        n, lane = first.shape[1], np.arange(len(first))
        state = {"now": Vector(n), "information": Symmetric(n)}
        formula = self._formula(_carry, state, {"residual": Vector(self.z.shape[2])})
        start = {"now": first, "information": self._of_prior(first, lane).information}
        last, outputs = formula.carry(start, self._inputs(lane), len(self.dt))
        return last["now"], last["information"], outputs["residual"]

    def back(self, last: Array) -> Array:
        """Tracks (m, n) at the last plot, taken to the first."""
        formula = Formula(
            step=_move,
            motion=self.motion,
            sensor=self.sensor,
            state=(("now", Vector(last.shape[1])),),
            inputs=(("dt", Scalar(), Rate.STEP),),
            outputs=(),
        )
        found, _ = formula.carry({"now": last}, {"dt": -self.dt[::-1]}, len(self.dt))
        return found["now"]

    def _formula(
        self, step: Any, state: Mapping[str, Leaf], outputs: Mapping[str, Leaf]
    ) -> Formula:
        heard = Rate.STEP if len(self.z) == 1 else Rate.EACH
        return Formula(
            step=step,
            motion=self.motion,
            sensor=self.sensor,
            state=tuple(state.items()),
            inputs=(("dt", Scalar(), Rate.STEP), ("z", Vector(self.z.shape[2]), heard)),
            outputs=tuple(outputs.items()),
        )

    def _inputs(self, lane: Array) -> dict[str, Array]:
        return {"dt": self.dt, "z": self.z[0] if len(self.z) == 1 else self.z[lane]}

    def _of_prior(self, first: Array, lane: Array) -> Normal:
        """The prior's part of the normal equations."""
        m, n = first.shape
        if self.prior is None:
            return Normal(np.zeros((m, n, n)), np.zeros((m, n)), np.zeros(m))
        lanes = len(self.z)
        mean = np.broadcast_to(self.prior.mean, (lanes, n))[lane]
        weight = np.broadcast_to(self.prior.information, (lanes, n, n))[lane]
        off = mean - first
        pull = (weight @ off[..., None])[..., 0]
        known = Normal(weight, pull, 0.5 * np.sum(off * pull, axis=-1))
        if self.prior.range_m is None or self.prior.range_sd_m is None:
            return known
        return self._with_range(known, first, self.prior.range_m, self.prior.range_sd_m)

    def _with_range(self, known: Normal, first: Array, middle: float, sigma: float) -> Normal:
        """The distance that the prior says, as one more residual."""
        d, pose = self.motion.dims, getattr(self.sensor, "pose", None)
        origin = np.zeros(d) if pose is None else pose.position_m.reshape(-1, 3)[0, :d]
        away = first[:, :d] - origin
        length = np.maximum(np.sqrt(np.sum(away**2, axis=1)), _FLOOR_M)
        h = np.zeros_like(first)
        h[:, :d] = away / (length * sigma)[:, None]
        off = (middle - length) / sigma
        return Normal(
            known.information + h[:, :, None] * h[:, None, :],
            known.gradient + h * off[:, None],
            known.cost + 0.5 * off**2,
        )


def _equations(n: int) -> dict[str, Leaf]:
    return {"information": Symmetric(n), "gradient": Vector(n), "cost": Scalar()}


def _gather(
    motion: Motion, sensor: Sensor, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[Any, Any]:
    """Add one plot to the normal equations."""
    first, elapsed = state["first"], state["elapsed"] + inputs["dt"]
    information, pull, cost = (state[name] for name in Normal._fields)
    for component, measured in zip(sensor.components(motion), inputs["z"], strict=True):
        predicted, h = gradient(later(component, motion, elapsed), first)
        there, nu = innovation(component, measured, predicted)
        weight = there / (component.sigma * component.sigma)
        information = information + mirror(np.outer(weight * h, h))
        pull, cost = pull + h * (weight * nu), cost + 0.5 * weight * nu * nu
    kept = {"first": first, "elapsed": elapsed}
    return kept | {"information": information, "gradient": pull, "cost": cost}, {}


def _carry(
    motion: Motion, sensor: Sensor, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[Any, Any]:
    """The track and what is known of it, one plot on; what the plot leaves."""
    now = motion.move(state["now"], inputs["dt"])
    _, back = jacobian(lambda x: motion.move(x, -inputs["dt"]), now)
    information, residual = mirror(back.T @ state["information"] @ back), []
    for component, measured in zip(sensor.components(motion), inputs["z"], strict=True):
        predicted, h = gradient(component.value, now)
        there, nu = innovation(component, measured, predicted)
        information = information + mirror(
            np.outer(h * (there / (component.sigma * component.sigma)), h)
        )
        residual.append(select(missing(measured), np.nan, nu))
    return {"now": now, "information": information}, {"residual": np.array(residual)}


def _move(
    motion: Motion, sensor: Sensor, state: Mapping[str, Any], inputs: Mapping[str, Any]
) -> tuple[Any, Any]:
    """Without a plot."""
    del sensor
    return {"now": motion.move(state["now"], inputs["dt"])}, {}
