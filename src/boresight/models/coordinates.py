"""Sensors of coordinates: multilateration, GPS, and plots that were converted beforehand."""

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.maths import cholesky, lower_solve, missing, select
from boresight.models.checks import as_number, standard_deviation
from boresight.models.components import Component
from boresight.models.motion import Motion

Array = Any
_ROUNDING = 1e-9  # of the largest covariance: how far two halves of one may differ


def _coordinate(i: int, state: Array) -> Any:
    return state[i]


@dataclass(frozen=True, kw_only=True)
class PositionSensor:
    """A sensor that measures coordinates of the track frame: multilateration, GPS.

    Attributes:
        x_m, y_m, z_m: standard deviations, m; z_m is None for a planar sensor.
    """

    x_m: Any
    y_m: Any
    z_m: Any = None

    def __post_init__(self) -> None:
        """Numbers become floats or arrays, and are checked."""
        for name in self.names:
            object.__setattr__(self, name, standard_deviation(name, getattr(self, name)))

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates that are measured."""
        return ("x_m", "y_m") if self.z_m is None else ("x_m", "y_m", "z_m")

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """Each coordinate of the state's position."""
        if motion.dims < len(self.names):
            raise UsageError(f"a sensor of {self.names} cannot see a motion in {motion.dims} dims")
        return tuple(
            Component(name, partial(_coordinate, i), getattr(self, name))
            for i, name in enumerate(self.names)
        )

    def independent(self, z: Array, motion: Motion) -> tuple[Array, tuple[Component, ...]]:
        """The plot as it is."""
        return z, self.components(motion)

    def coloured(self, normals: Array) -> Array:
        """The normals as they are."""
        return normals


@dataclass(frozen=True, kw_only=True)
class CartesianPlots:
    """Coordinates of the track frame with a full covariance: converted plots, from any conversion.

    With the filter `kf` this is the linear converted-measurement filter; a covariance for every
    plot makes the noise what the conversion says it is.

    Attributes:
        cov: (2, 2), (3, 3), or with leading axes (lanes, steps); where a plot is missing it is not
            read.
    """

    cov: Array = field(metadata={"trailing": 2})

    def __post_init__(self) -> None:
        """The covariance becomes an array, and is checked."""
        cov = np.asarray(as_number("cov", self.cov))
        if cov.ndim < 2 or cov.shape[-2:] not in ((2, 2), (3, 3)):
            raise UsageError(
                f"cov of shape {cov.shape} is not the covariance of a position",
                next_step="give (2, 2) or (3, 3), or one for every plot: (lanes, steps, 3, 3)",
            )
        known = cov[np.isfinite(cov).all((-2, -1))]
        lopsided = np.abs(known - known.mT).max(initial=0.0) > _ROUNDING * np.abs(known).max(
            initial=0.0
        )
        if lopsided or np.any(np.linalg.eigvalsh(known) <= 0):
            raise UsageError(
                "cov holds a matrix that is not a covariance",
                why="it must be symmetric and positive definite",
                next_step="give NaN where the plot is missing",
            )
        object.__setattr__(self, "cov", cov)

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates that are measured."""
        return ("x_m", "y_m", "z_m")[: np.shape(self.cov)[-1]]

    def components(self, motion: Motion) -> tuple[Component, ...]:
        """Each coordinate of the state's position."""
        if motion.dims < len(self.names):
            raise UsageError(f"a sensor of {self.names} cannot see a motion in {motion.dims} dims")
        return tuple(
            Component(name, partial(_coordinate, i), np.sqrt(self.cov[..., i, i]))
            for i, name in enumerate(self.names)
        )

    def independent(self, z: Array, motion: Motion) -> tuple[Array, tuple[Component, ...]]:
        """The plot turned by the unit triangular factor of its covariance.

        A unit triangle keeps volumes, so likelihoods are those of the plot itself.
        """
        del motion
        d = len(self.names)
        gone = [missing(value) for value in z]
        cov = [
            [select(gone[i] | gone[j], float(i == j), self.cov[i, j]) for j in range(d)]
            for i in range(d)
        ]
        L, inverse = cholesky(np.array(cov))
        W = np.diag(L)[:, None] * lower_solve(L, inverse, np.eye(d))
        plot = W @ np.array([select(g, 0.0, value) for g, value in zip(gone, z, strict=True)])
        white = tuple(
            Component(name, partial(_combination, W[i]), L[i, i])
            for i, name in enumerate(self.names)
        )
        return np.array([select(g, np.nan, v) for g, v in zip(gone, plot, strict=True)]), white

    def coloured(self, normals: Array) -> Array:
        """Independent standard normals (k,) with the correlations of the covariance."""
        L, _ = cholesky(self.cov)
        return (L @ normals) / np.sqrt(np.diag(self.cov))


def _combination(weights: Array, state: Array) -> Any:
    return weights @ state[: len(weights)]
