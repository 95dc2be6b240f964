"""Whether conversions know their errors, and where estimates are biased, seen from the sensor.

Errors are estimate (or converted plot) minus truth, and positions are those of the truth, both in
the sensor's frame. As in `metrics`, no run is dropped: what is not a number is infinite.

Paper: bordonaro, figures 4 and 7 (NES), 5, 6, 10 and 11 (bias), 13 (significance, erratum B8).
"""

from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UsageError
from boresight.experiments.metrics import Consistency, chi_square_bounds

Array = Any
FALSE_ALARM = 0.01  # the paper's 0.99 probability bounds


class Nes(NamedTuple):
    """Normalised errors squared per degree of freedom, each with its chi-square band.

    Attributes:
        total: of all coordinates together.
        per_component: of each coordinate by itself.
        along: of the line of sight by itself.
        across: of what is perpendicular to it (in three dimensions both directions together).
    """

    total: Consistency
    per_component: tuple[Consistency, ...]
    along: Consistency
    across: Consistency


class Bias(NamedTuple):
    """Average error over the runs.

    Attributes:
        value: the average.
        standard_error: of the average.
        sd: of the error of one run.
    """

    value: Array
    standard_error: Array
    sd: Array

    @property
    def significance(self) -> Array:
        """Bias over the standard deviation (erratum B8): above 1 the bias is most of the error."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = self.value / self.sd
        return np.where(np.isnan(share), np.where(self.value == 0.0, 0.0, np.inf), share)[()]


class ByDirection(NamedTuple):
    """Bias in the frame of the line of sight.

    Attributes:
        along: positive away from the sensor.
        across: positive towards growing azimuth; in three dimensions a last axis holds that, and
            the direction of growing elevation.
    """

    along: Bias
    across: Bias


def line_of_sight_axes(positions: Array) -> Array:
    """Unit vectors (..., d, d), one a row: along the line of sight, growing azimuth, elevation.

    Args:
        positions: (..., d), d 2 or 3, relative to the sensor; straight above it azimuth is 0.
    """
    positions = np.asarray(positions, dtype=float)
    d = positions.shape[-1] if positions.ndim else 0
    if d not in (2, 3):
        raise UsageError(f"positions of shape {positions.shape} have no line of sight in 2 or 3-D")
    azimuth = np.arctan2(positions[..., 1], positions[..., 0])
    c, s, zero = np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)
    if d == 2:
        rows = [[c, s], [-s, c]]
    else:
        elevation = np.arctan2(positions[..., 2], np.hypot(positions[..., 0], positions[..., 1]))
        ce, se = np.cos(elevation), np.sin(elevation)
        rows = [[ce * c, ce * s, se], [-s, c, zero], [-se * c, -se * s, ce]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def normalised_squares(errors: Array, covs: Array) -> Array:
    """Quadratic forms e' P^-1 e (...) of errors (..., d) and covariances (..., d, d).

    Infinite where the error is not a number or the covariance is not positive definite.
    """
    sound = np.isfinite(errors).all(axis=-1) & np.isfinite(covs).all(axis=(-2, -1))
    values, vectors = np.linalg.eigh(np.where(sound[..., None, None], covs, -1.0))
    sound &= values[..., 0] > 0.0  # the smallest
    white = np.einsum("...ji,...j->...i", vectors, np.where(sound[..., None], errors, 0.0))
    return np.where(sound, np.sum(white**2 / np.where(values > 0.0, values, 1.0), axis=-1), np.inf)


def conversion_nes(
    errors: Array, covs: Array, positions: Array, *, false_alarm: float = FALSE_ALARM
) -> Nes:
    """Whether covariances match errors: in all, by coordinate, along and across the line of sight.

    Args:
        errors: (runs, d), d 2 or 3.
        covs: (runs, d, d), or (d, d) if all runs have the same.
        positions: (runs, d) or (d,), where the target is relative to the sensor.
        false_alarm: probability with which what is consistent and Gaussian leaves its band.
    """
    errors = np.asarray(errors, dtype=float)
    if errors.ndim != 2:
        raise UsageError(f"errors have shape {errors.shape}; (runs, 2 or 3) is needed")
    covs = _spread("covs", covs, (*errors.shape, errors.shape[1]))
    turn = line_of_sight_axes(_spread("positions", positions, errors.shape))
    turned = _in_axes(turn, errors), turn @ covs @ np.swapaxes(turn, -1, -2)

    def part(of: tuple[Array, Array], which: slice) -> Consistency:
        error, cov = of[0][:, which], of[1][:, which, which]
        return _average(normalised_squares(error, cov), error.shape[1], false_alarm)

    own, d = (errors, covs), errors.shape[1]
    return Nes(
        total=part(own, slice(d)),
        per_component=tuple(part(own, slice(i, i + 1)) for i in range(d)),
        along=part(turned, slice(1)),
        across=part(turned, slice(1, d)),
    )


def _average(squares: Array, dof: int, false_alarm: float) -> Consistency:
    """Of normalised squares (runs,) with `dof` degrees of freedom each."""
    bounds = chi_square_bounds(len(squares) * dof, false_alarm)
    mean = bias(squares / dof)
    return Consistency(float(mean.value), *bounds, float(mean.standard_error))


def bias(errors: Array) -> Bias:
    """Average over the runs, the first axis of errors (runs, ...), and how certain it is."""
    errors = np.asarray(errors, dtype=float)
    runs = len(errors)
    if runs < 2:
        raise UsageError(f"{runs} run(s) show no bias", why="its standard error needs two or more")
    lost = ~np.isfinite(errors).all(axis=0)
    sound = np.where(lost, 0.0, errors)
    sd = np.std(sound, axis=0, ddof=1)
    figures = (np.mean(sound, axis=0), sd / np.sqrt(runs), sd)
    return Bias(*(np.where(lost, np.inf, figure)[()] for figure in figures))


def nearer(one: Bias, others: list[Bias], goal: float) -> tuple[Array, Array]:
    """How much farther from a goal an average is than others, (others, ...), and how certain."""
    value = [np.abs(one.value - goal) - np.abs(other.value - goal) for other in others]
    error = [np.hypot(one.standard_error, other.standard_error) for other in others]
    return np.array(value), np.array(error)


def line_of_sight_bias(errors: Array, positions: Array) -> ByDirection:
    """Estimation bias along and across the line of sight at every scan.

    Args:
        errors: (runs, scans, d), d 2 or 3: of positions, or of velocities.
        positions: true ones relative to the sensor, (runs, scans, d), (scans, d) or (d,).

    Returns:
        Each figure is (scans,); across in three dimensions (scans, 2).
    """
    errors = np.asarray(errors, dtype=float)
    turned = _in_axes(line_of_sight_axes(_spread("positions", positions, errors.shape)), errors)
    across = turned[..., 1] if errors.shape[-1] == 2 else turned[..., 1:]
    return ByDirection(bias(turned[..., 0]), bias(across))


def _in_axes(axes: Array, errors: Array) -> Array:
    """Errors (..., d) in axes (..., d, d); infinite in all of them where one is not a number."""
    sound = np.isfinite(errors).all(axis=-1, keepdims=True)
    turned = np.einsum("...ij,...j->...i", axes, np.where(sound, errors, 0.0))
    return np.where(sound, turned, np.inf)


def _spread(name: str, array: Array, shape: tuple[int, ...]) -> Array:
    try:
        return np.broadcast_to(np.asarray(array, dtype=float), shape)
    except ValueError:
        raise UsageError(
            f"{name} of shape {np.shape(array)} do not fit the errors", why=f"{shape} is needed"
        ) from None
