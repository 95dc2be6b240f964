"""The verb `convert`: arrays of plots, friendly over the component-first formulas."""

from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.maths import Gaussian
from boresight.models import conversions
from boresight.models.checks import as_number
from boresight.models.polar import Given, polar_moments
from boresight.models.sensors import Pose

Array = Any


def convert(
    name: str,
    z: Any,
    sigma: Any,
    *,
    prediction: Gaussian | Given | None = None,
    pose: Pose | None = None,
) -> Gaussian:
    """Plots as Cartesian positions with covariances, for a linear filter.

    Args:
        name: "conventional", "cmkf-d-m", "cmkf-d-t", "ucm", "mucm", "mmse" or "ducm".
        z: (..., 2) or (..., 3): range in m, azimuth from x towards y and, in space, elevation,
            both in radians.
        sigma: (2,) or (3,), or one for every plot: standard deviations in the same units.
        prediction: where the target is thought to be, for "ducm", "cmkf-d-t" and "mmse"; the others
            look at the plot alone. Position or state, mean (..., >= d), with cov, in the frame of
            the result; or a `Given` in the sensor's own polar frame, such as
            `Given(z_before, sigma**2)`: the previous plot.
        pose: where the sensor stands and how it is turned; None for the frame's origin and axes.

    Returns:
        mean (..., d), cov (..., d, d); NaN where a plot is not complete.

    Raises:
        UsageError: an unknown name, shapes that do not fit, a sigma that is no standard deviation.
    """
    z, sigma = np.asarray(as_number("z", z)), np.asarray(as_number("sigma", sigma))
    d = z.shape[-1] if z.ndim else 0
    if d not in {2, 3} or sigma.shape[-1:] != (d,):
        raise UsageError(
            f"z {z.shape} and sigma {sigma.shape} are not plots and their standard deviations",
            next_step="give both with 2 numbers (range, azimuth) or 3 (and elevation) at the end",
        )
    if not np.all((sigma >= 0) & np.isfinite(sigma)) or np.any(sigma[..., 1:] > np.pi):
        raise UsageError(
            "sigma must be finite and not negative, and in an angle at most pi",
            why="it holds standard deviations in metres and radians",
        )
    given = _polar(prediction, pose, d)
    z = np.where(np.isfinite(z).all(-1, keepdims=True), z, np.nan)
    if given is None:
        z, sigma = _component_first(z, sigma)
    else:
        z, sigma, *place = _component_first(z, sigma, given.mean, given.variances)
        given = Given(*place)
    mean, cov = conversions.convert(name, z, sigma, given)
    mean, cov = np.moveaxis(mean, 0, -1), np.moveaxis(cov + 0.0 * z.sum(0), (0, 1), (-2, -1))
    if pose is None:
        return Gaussian(mean, cov)
    turn = pose.rotation[..., :d, :d]
    back = np.einsum("...ij,...i->...j", turn, mean) + pose.position_m[..., :d]
    return Gaussian(back, turn.mT @ cov @ turn)


def _component_first(*arrays: Array) -> list[Array]:
    """Arrays (..., numbers) as (numbers, ...), over the same leading axes."""
    shapes = [np.shape(each)[:-1] for each in arrays]
    try:
        lanes = np.broadcast_shapes(*shapes)
    except ValueError:
        raise UsageError(f"plots, sigma and prediction have leading axes {shapes}") from None
    return [
        np.moveaxis(np.broadcast_to(each, (*lanes, np.shape(each)[-1])), -1, 0) for each in arrays
    ]


def _polar(prediction: Gaussian | Given | None, pose: Pose | None, d: int) -> Given | None:
    """The prediction in the sensor's polar frame, leading axes lanes."""
    if prediction is None:
        return None
    if isinstance(prediction, Given):
        if {np.shape(each)[-1:] for each in prediction[:2]} != {(d,)}:
            raise UsageError(
                f"the place that is given has not {d} means and {d} variances at the end"
            )
        _not_negative(prediction.variances)
        return prediction
    if not isinstance(prediction, tuple) or len(prediction) != 2:
        raise UsageError(
            f"a prediction that is a {type(prediction).__name__}",
            next_step="give bs.Gaussian(mean, cov) or bs.Given(mean, variances)",
        )
    mean, cov = (np.asarray(as_number("prediction", each)) for each in prediction)
    if mean.shape[-1:] < (d,) or cov.shape[-2:] != 2 * mean.shape[-1:]:
        raise UsageError(
            f"mean {mean.shape} and cov {cov.shape} predict no position in {d} dimensions",
            next_step=f"give mean (..., n) and cov (..., n, n), n at least {d}, positions first",
        )
    mean, cov = mean[..., :d], cov[..., :d, :d]
    _not_negative(np.diagonal(cov, 0, -2, -1))
    if pose is not None:
        turn = pose.rotation[..., :d, :d]
        mean = np.einsum("...ij,...j->...i", turn, mean - pose.position_m[..., :d])
        cov = turn @ cov @ turn.mT
    mean, flat = _component_first(mean, cov.reshape(*cov.shape[:-2], d * d))
    found = polar_moments(mean, flat.reshape(d, d, *mean.shape[1:]))
    return Given(np.moveaxis(found.mean, 0, -1), np.moveaxis(found.variances, 0, -1))


def _not_negative(variances: Array) -> None:
    if np.any(np.asarray(variances) < 0):
        raise UsageError("the prediction has a negative variance")
