"""A radar's systematic errors as states of its target: what calibration left uncertain.

Plots are corrected by an estimate of the errors before they are filtered; the states here are what
the estimate is still off by, one for each term of `models.systematic`, after the target's own
states. They never change, and a filter that considers them (`filters.consider`) never corrects
them: it only knows how uncertain they are and what they do to its plots.

Heights and range rates are taken as they are: a time bias moves them by the climb or the
acceleration of the target, which is less than they err by.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.maths import jacobian, select
from boresight.models.components import Component
from boresight.models.motion import Motion
from boresight.models.sensors import Radar
from boresight.models.systematic import TERMS, effects

Array = Any
TIME = "time_bias_s"
_FLOOR = 1e-6  # m²: no target is nearer to the vertical axis
_STEEPEST = 0.1  # cosine of elevation: overhead, a plot at a given height tells no place


@dataclass(frozen=True, kw_only=True)
class Considered:
    """Any motion, with a radar's systematic errors as its last states.

    Attributes:
        inner: how the target moves.
        terms: of `models.systematic.TERMS`.
    """

    inner: Motion
    terms: tuple[str, ...]

    def __post_init__(self) -> None:
        """Terms must be known."""
        for term in self.terms:
            if term not in TERMS:
                raise unknown("term of systematic error", term, TERMS)

    @property
    def dims(self) -> int:
        """Those of the inner motion."""
        return self.inner.dims

    @property
    def names(self) -> tuple[str, ...]:
        """States of the inner motion, then the terms."""
        return (*self.inner.names, *self.terms)

    @property
    def own(self) -> int:
        """How many states are the target's own."""
        return len(self.inner.names)

    def move(self, state: Array, dt: Any) -> Array:
        """The errors stay."""
        return np.concatenate([self.inner.move(state[: self.own], dt), state[self.own :]])

    def noise(self, dt: Any) -> Array:
        """The inner motion's; none on the errors."""
        inner, m = self.inner.noise(dt), len(self.terms)
        beside = np.zeros((self.own, m))
        return np.block([[inner, beside], [beside.T, np.zeros((m, m))]])


def own_states(motion: Motion) -> int:
    """How many states of a motion are the target's own."""
    return motion.own if isinstance(motion, Considered) else len(motion.names)


@dataclass(frozen=True, kw_only=True)
class ConsideredRadar:
    """A fixed radar whose plots err by the last states of a motion `Considered`.

    Attributes:
        radar: what it measures, and its noise.
        cov: (m, m) joint covariance of the errors, in the order of the motion's terms.
    """

    radar: Radar
    cov: Array = field(metadata={"trailing": 2})

    def __post_init__(self) -> None:
        """Only a radar at the origin, with independent noises."""
        if self.radar.pose is not None or self.radar.range_rate_correlation is not None:
            raise UsageError(
                "systematic errors are considered for a fixed radar at the origin of the frame, "
                "with independent noises",
                next_step="leave out pose and range_rate_correlation",
            )
        object.__setattr__(self, "cov", np.asarray(self.cov, dtype=float))

    @property
    def names(self) -> tuple[str, ...]:
        """Those of the radar."""
        return self.radar.names

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """The radar's formulas, each with what the errors add to it."""
        if not isinstance(motion, Considered):
            raise UsageError("a radar whose errors are considered needs a motion that has them")
        return tuple(self._erring(part, motion) for part in self.radar.components(motion.inner))

    def _erring(self, part: Component, motion: Considered) -> Component:
        own = motion.own

        def value(state: Array) -> Any:
            p, v = (_in_space(a) for a in self.radar.relative(state[:own], motion.dims))
            total = part.value(state[:own])
            for term, error in zip(motion.terms, state[own:], strict=True):
                total = total + effects(term, p, v).get(part.name, 0.0) * error
            return total

        return Component(part.name, value, part.sigma)

    def displaced(self, state: Array, motion: Considered) -> Array:
        """How far from its target a radar sees it for one unit of each term.

        Args:
            state: (n,) the target's own.
            motion: its motion, with the terms.

        Returns:
            (n, m): of positions, m, of velocities, m/s, and nothing of further states.
        """
        dims, m = motion.dims, len(motion.terms)
        p, v = self.radar.relative(state, dims)

        def seen(later: Array) -> Array:
            return np.array(self.shifts(p + v * later[0], v, motion.terms)).reshape(-1)

        there, rates = jacobian(seen, 0.0 * p[:1])
        moved = [part.reshape(dims, m) for part in (there, rates[:, 0])]
        return np.concatenate([*moved, np.zeros((motion.own - 2 * dims, m))])

    def shifts(self, p: Array, v: Array, terms: tuple[str, ...]) -> Array:
        """How far one unit of each term moves what a plot takes for the place p, (dims, m).

        A time bias moves it back along the velocity v. Where no elevation is measured the height is
        given, and the rest moves it level; the Earth's curve would take a hundredth of that at most
        in height. Runs on lanes too: (dims, lanes) to (dims, m, lanes).
        """
        place = _in_space(p)
        moves = _moves(place, raised="elevation_rad" in self.names)
        columns = []
        for term in terms:
            effect = effects(term, place, 0.0 * place)
            moved = sum(moves[channel] * effect[channel] for channel in moves if channel in effect)
            columns.append(-v if term == TIME else moved[: len(p)])
        return np.stack(columns, axis=1)

    def independent(self, z: Array, motion: Motion) -> tuple[Array, tuple[Component, ...]]:
        """As they are: their noises are independent."""
        return z, self.components(motion)

    def coloured(self, normals: Array) -> Array:
        """As they are."""
        return normals


def _moves(p: Array, *, raised: bool) -> dict[str, Array]:
    """How a place (3,) moves with range, azimuth and, where it is measured, elevation."""
    ground2 = p[0] * p[0] + p[1] * p[1]
    ground = np.sqrt(select(ground2 < _FLOOR, _FLOOR, ground2))
    r, nothing = np.sqrt(ground * ground + p[2] * p[2]), 0.0 * ground
    along = np.array([p[0] / ground, p[1] / ground, nothing])
    across = np.array([-p[1], p[0], nothing])
    if raised:
        upward = np.array([-p[2] * along[0], -p[2] * along[1], ground])
        return {"range_m": p / r, "azimuth_rad": across, "elevation_rad": upward}
    level = ground / r
    outward = along / select(level < _STEEPEST, _STEEPEST, level)
    return {"range_m": outward, "azimuth_rad": across}


def _in_space(place: Array) -> Array:
    """A vector (2,) or (3,) as one in space: `effects` are those of slant range."""
    return place if len(place) == 3 else np.array([*place, place[0] * 0.0])
