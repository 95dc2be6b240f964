"""A filter as the catalogue lists it: a formula with a name, settings and a source."""

from dataclasses import dataclass, replace
from inspect import signature
from typing import Any

from boresight.errors import UsageError
from boresight.filters.recursion import Recursion, Update
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor


@dataclass(frozen=True, kw_only=True)
class Filter:
    """A filter: its formula, its settings and where it comes from.

    Attributes:
        name: catalogue name.
        update: formula (prior, z, components, **settings) -> Posterior.
        summary: one line for lists.
        paper: key in papers.bib.
        settings: keyword arguments of the formula that differ from its defaults.
    """

    name: str
    update: Update
    summary: str
    paper: str
    settings: tuple[tuple[str, Any], ...] = ()

    def with_settings(self, **settings: Any) -> "Filter":
        """The same filter with settings changed; unknown ones raise UsageError."""
        parameters = signature(self.update).parameters.values()
        known = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.name != "correct"]
        for name in settings:
            if name not in known:
                raise UsageError(
                    f"{self.name} has no setting {name!r}",
                    next_step=f"use {', '.join(known)}" if known else "it has no settings",
                )
        hashable = {k: tuple(v) if isinstance(v, list) else v for k, v in settings.items()}
        return replace(self, settings=tuple(sorted((dict(self.settings) | hashable).items())))

    def recursion(self, motion: Motion, sensor: Sensor) -> Recursion:
        """Predict and update with this filter, ready to run over lanes."""
        return Recursion(self.update, self.settings, motion, sensor)
