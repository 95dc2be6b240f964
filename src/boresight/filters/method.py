"""A filter as the catalogue lists it: a formula or a method with a name, settings and a source."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from inspect import signature
from math import isfinite
from typing import Any

from boresight.errors import UsageError
from boresight.filters import kalman
from boresight.filters.recursion import Recursion
from boresight.filters.steps import Method, Predict, Update, Updating
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor


@dataclass(frozen=True, kw_only=True)
class Filter:
    """A filter: its formula, its settings and where it comes from.

    Attributes:
        name: catalogue name.
        formula: what has the settings as keyword-only arguments: an update formula (prior, z,
            components, **settings) -> Posterior, or a class of `Method` where `predict` is None.
        summary: one line for lists.
        paper: key in papers.bib.
        predict: the prediction that goes with an update formula.
        settings: those that differ from the defaults.
    """

    name: str
    formula: Update | Callable[..., Method]
    summary: str
    paper: str
    predict: Predict | None = kalman.predict
    settings: tuple[tuple[str, Any], ...] = ()

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


def _is_like(value: Any, usual: Any) -> bool:
    """Whether a setting is of the kind of its default; where that is None, a whole number."""
    if isinstance(value, bool) or isinstance(usual, bool):
        return isinstance(value, bool) and isinstance(usual, bool)
    if isinstance(usual, float):
        return isinstance(value, int | float) and isfinite(value)
    if isinstance(usual, tuple):
        return isinstance(value, list | tuple) and all(isinstance(each, str) for each in value)
    return isinstance(value, int | None if usual is None else type(usual))
