"""A filter as the catalogue lists it: a formula or a method with a name, settings and a source.

A user's own is made of the same: an update formula or a class of `Method` in a `Filter`, which then
runs, streams, tracks and competes as ours do; or any function over arrays in an `Outside`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from inspect import Parameter, isclass, signature
from math import isfinite
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters import kalman
from boresight.filters.recursion import Recursion
from boresight.filters.steps import Method, Predict, Update, Updating
from boresight.maths import Gaussian
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any
_BY_POSITION = (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)


@dataclass(frozen=True, kw_only=True)
class Filter:
    """A filter: its formula, its settings and where it comes from.

    Attributes:
        name: what tables, files and the command line call it.
        formula: what has the settings as keyword-only arguments: an update formula
            `(prior, z, components, **settings) -> Posterior`, or a class of `Method`, for which
            (and for a function that makes one) `predict` is None.
        summary: one line for lists.
        paper: key in papers.bib; empty where there is none.
        predict: the prediction that goes with an update formula.
        settings: those that differ from the defaults.
    """

    name: str
    formula: Update | Callable[..., Method]
    summary: str = ""
    paper: str = ""
    predict: Predict | None = kalman.predict
    settings: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        """A class predicts by itself; what cannot be a filter is refused."""
        _named(self.name)
        if isclass(self.formula):
            object.__setattr__(self, "predict", None)
        elif not callable(self.formula):
            raise UsageError(
                f"the formula of filter {self.name!r} is a {type(self.formula).__name__}",
                next_step="give the function, or the class of a Method and not one made of it",
            )
        elif self.predict is not None and _taken_by_position(self.formula) != 3:
            raise UsageError(
                f"the formula of filter {self.name!r} does not take prior, z and components",
                next_step="write def update(prior, z, components, *, ...), settings after the star;"
                " a function over whole recordings is a bs.Outside",
            )

    def with_settings(self, **settings: Any) -> "Filter":
        """The same filter with settings changed; UsageError where one is unknown or of no use."""
        parameters = signature(self.formula).parameters.values()
        usual = {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}
        known = [name for name in usual if name != "correct"]
        for name, value in settings.items():
            if name not in known:
                raise UsageError(
                    f"{self.name} has no setting {name!r}",
                    next_step=f"use {', '.join(known)}" if known else "it has no settings",
                )
            if not _is_like(value, usual[name]):
                raise UsageError(
                    f"{name}={value!r} is no setting of {self.name}",
                    next_step=f"give something like {name}={usual[name]!r}, its default",
                )
        hashable = {k: tuple(v) if isinstance(v, list) else v for k, v in settings.items()}
        return replace(self, settings=tuple(sorted((dict(self.settings) | hashable).items())))

    @property
    def method(self) -> Method:
        """What predicts, updates and tells."""
        if self.predict is None:
            return self.formula(**dict(self.settings))  # type: ignore[return-value]
        return Updating(formula=self.formula, settings=self.settings, moved=self.predict)  # type: ignore[arg-type]

    def recursion(self, motion: Motion, sensor: Sensor) -> Recursion:
        """Predict and update with this filter, ready to run over lanes."""
        return Recursion(self.method, motion, sensor)


@dataclass(frozen=True, kw_only=True)
class Outside:
    """A filter that is a function over whole recordings, of which nothing can be recorded.

    Attributes:
        name: what it is called.
        function: `(z, dt, start, motion, sensor) -> (mean, cov)`: plots (runs, scans, k), NaN
            where missing, dt (1 or runs, scans) in s, a `Gaussian` (runs, n), (runs, n, n) to begin
            with, the believed models; to mean (runs, scans, n) and cov (runs, scans, n, n). What it
            is given it cannot write into.
        summary: one line for lists.
    """

    name: str
    function: Callable[..., tuple[Array, Array]]
    summary: str = ""

    def __post_init__(self) -> None:
        """What cannot be a filter is refused."""
        _named(self.name)
        if not callable(self.function):
            raise UsageError(
                f"the function of filter {self.name!r} is a {type(self.function).__name__}",
                next_step="give a function (z, dt, start, motion, sensor) -> (mean, cov)",
            )

    def __call__(
        self, z: Array, dt: Array, start: Gaussian, motion: Motion, sensor: Sensor
    ) -> Gaussian:
        """What the function says, (runs, scans, n) and (runs, scans, n, n).

        Raises:
            UsageError: it fails, or gives something else.
        """
        arrays = [_read_only(each) for each in (z, dt, *start)]
        try:
            mean, cov = self.function(*arrays[:2], Gaussian(*arrays[2:]), motion, sensor)
            said = Gaussian(np.asarray(mean, dtype=float), np.asarray(cov, dtype=float))
        except Exception as error:
            raise UsageError(
                f"the filter {self.name!r} failed: {type(error).__name__}: {error}",
                next_step="run its function by itself to see where",
            ) from error
        expected = (*np.shape(z)[:2], len(motion.names))
        if (said.mean.shape, said.cov.shape) != (expected, (*expected, expected[-1])):
            raise UsageError(
                f"the filter {self.name!r} gives mean {said.mean.shape} and cov {said.cov.shape}",
                why=f"{expected} and {(*expected, expected[-1])} are needed: runs, scans, states",
            )
        return said


FilterLike = str | Filter | Update  # a name, a filter, or an update formula by itself


def _named(name: Any) -> None:
    """A name can be written in a list on the command line."""
    if not isinstance(name, str) or not name or name != name.strip() or "," in name:
        raise UsageError(
            f"{name!r} is no name of a filter", next_step='give a word, such as name="my-ekf"'
        )


def _taken_by_position(formula: Callable[..., Any]) -> int:
    """How many arguments a formula needs by position."""
    given = signature(formula).parameters.values()
    return sum(p.kind in _BY_POSITION and p.default is p.empty for p in given)


def _read_only(array: Array) -> Array:
    view = np.asarray(array, dtype=float).view()
    view.flags.writeable = False
    return view


def _is_like(value: Any, usual: Any) -> bool:
    """Whether a setting is of the kind of its default; where that is None, a whole number."""
    if isinstance(value, bool) or isinstance(usual, bool):
        return isinstance(value, bool) and isinstance(usual, bool)
    if isinstance(usual, float):
        return isinstance(value, int | float) and isfinite(value)
    if isinstance(usual, tuple):
        return isinstance(value, list | tuple) and all(isinstance(each, str) for each in value)
    return isinstance(value, int | None if usual is None else type(usual))
