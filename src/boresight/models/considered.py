"""A radar's systematic errors as states of its target: what calibration left uncertain.

Plots are corrected by an estimate of the errors before they are filtered; the states here are what
the estimate is still off by, one for each term of `models.systematic`, after the target's own
states. They never change, and a filter that considers them (`filters.consider`) never corrects
them: it only knows how uncertain they are and what they do to its plots.

Heights and range rates are taken as they are: a time bias moves them by the climb or the
acceleration of the target, which is less than they err by.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.models.components import Component
from boresight.models.motion import Motion
from boresight.models.sensors import Radar
from boresight.models.systematic import TERMS, effects

Array = Any


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

    def touched(self, terms: Sequence[str]) -> tuple[int, ...]:
        """Places in a plot of the components that any of these terms can change."""
        channels = {name for term in terms for name in effects(term, np.ones(3), np.ones(3))}
        return tuple(i for i, name in enumerate(self.names) if name in channels)

    def design(self, state: Array, motion: Considered, touched: Sequence[int]) -> Array:
        """What one unit of each term adds to components of a plot.

        Args:
            state: (n,) the target's own.
            motion: its motion, with the terms.
            touched: places of the components in a plot.

        Returns:
            (touched, m), m or rad for a unit of the term.
        """
        place, speed = (_in_space(a) for a in self.radar.relative(state, motion.dims))
        added = [effects(term, place, speed) for term in motion.terms]
        rows = [[each.get(self.names[i], 0.0) for each in added] for i in touched]
        return np.array(rows).reshape(len(touched), len(added))

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """The radar's formulas, each with what the errors add to it."""
        if not isinstance(motion, Considered):
            raise UsageError("a radar whose errors are considered needs a motion that has them")
        own, parts = motion.own, list(self.radar.components(motion.inner))
        for i in self.touched(motion.terms):
            parts[i] = erring(parts[i], own, self._added(i, motion))
        return tuple(parts)

    def _added(self, i: int, motion: Considered) -> Callable[[Array], Any]:
        own = motion.own
        return lambda state: self.design(state[:own], motion, [i])[0] @ state[own:]

    def independent(self, z: Array, motion: Motion) -> tuple[Array, tuple[Component, ...]]:
        """As they are: their noises are independent."""
        return z, self.components(motion)

    def coloured(self, normals: Array) -> Array:
        """As they are."""
        return normals


def erring(part: Component, own: int, added: Callable[[Array], Any]) -> Component:
    """A component of a target's own states, with what errors add to it.

    Args:
        part: formula of the first `own` states.
        own: how many states are the target's.
        added: formula of all states.
    """

    def clean(state: Array) -> Any:
        return part.value(state[:own])

    return Component(part.name, lambda state: clean(state) + added(state), part.sigma, clean)


def _in_space(place: Array) -> Array:
    """A vector (2,) or (3,) as one in space: `effects` are those of slant range."""
    return place if len(place) == 3 else np.array([*place, place[0] * 0.0])
