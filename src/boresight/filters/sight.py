"""A plot beside its prediction, and its conversion as a linear measurement.

Everything is in the sensor's frame (erratum B10). In the plane a converted plot is used along x and
y; in space along the predicted line of sight, across it on the ground, and upwards. A plot without
elevation is converted at the predicted elevation p, and used along and across only. A target at
range r, elevation p + e and d beside the predicted azimuth is off that point by

    along   r cos e - r            square on average r² E e⁴ / 4
    across  -r sin p sin e sin d   square on average r² sin² p E e² E sin² d

to second order in e, which are added to the noise. The mean of the first is not taken off: an
elevation that stays unknown errs alike at every scan, and its mean would walk the track away from
its plots. (e^{2v} - 1) / 2, v the variance of d, stands for E sin² d: the same for small v, but
without bound for a target overhead, of whose position an azimuth says nothing linear.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.filters import ekf, kalman
from boresight.filters.kalman import Linear
from boresight.filters.posterior import Posterior
from boresight.maths import Gaussian, jacobian, missing, select
from boresight.models.components import Component
from boresight.models.motion import Motion
from boresight.models.polar import Given, polar_moments
from boresight.models.sensors import Sensor

Array = Any
_WIDE = 4.0  # rad²: beyond it an angle is unknown, and its exponential would overflow
_TINY = 1e-300  # keeps the logarithm of a volume finite


class Sight(NamedTuple):
    """A plot beside its prediction, both in the sensor's frame.

    Attributes:
        position: (d,) predicted.
        H: (d, n) its gradient in the state.
        given: the prediction as range and angles.
        z: (d,) measured range and angles; predicted where missing.
        sigma: (d,) standard deviations; 0 for an elevation that was not measured.
        axes: (k, d) rows are the directions in which the plot is used.
        usable: 1 if range and azimuth were measured, else 0.
        raised: 1 if the elevation was measured, else 0; 1 in the plane.
    """

    position: Array
    H: Array
    given: Given
    z: Array
    sigma: Array
    axes: Array
    usable: Any
    raised: Any


def relative_place(mean: Array, motion: Motion, sensor: Sensor) -> tuple[Array, Array]:
    """Position (d,) relative to the sensor, in its frame, and its gradient (d, n)."""
    return jacobian(lambda state: sensor.relative(state, motion.dims)[0], mean)  # type: ignore[attr-defined]


def convertible(sensor: Sensor) -> bool:
    """Whether plots of this sensor have both a range and an azimuth."""
    return {"range_m", "azimuth_rad"} <= set(sensor.names)


def sighted(
    prior: Gaussian, z: Array, parts: Sequence[Component], motion: Motion, sensor: Sensor
) -> Sight:
    """A plot beside its prediction.

    Args:
        prior: predicted mean (n,), cov (n, n).
        z: (k,) range, azimuth and, where the sensor has it, elevation; NaN where missing.
        parts: their components.
        motion: state layout.
        sensor: what sees it.
    """
    position, H = relative_place(prior.mean, motion, sensor)
    lacking = [0.0] * (len(position) - len(z))
    given = polar_moments(position, H @ prior.cov @ H.T)
    seen = [*(select(missing(value), 0.0, 1.0) for value in z), *lacking]
    filled = zip(seen, given.mean, [*z, *lacking], strict=True)
    raised = seen[2] if len(seen) == 3 else 1.0
    return Sight(
        position=position,
        H=H,
        given=given,
        z=np.array([select(s < 0.5, known, value) for s, known, value in filled]),
        sigma=[*(p.sigma for p in parts[:2]), *(p.sigma * raised for p in parts[2:]), *lacking],
        axes=_axes(given.direction)[: len(z)],
        usable=seen[0] * seen[1],
        raised=raised,
    )


def _axes(direction: Array) -> Array:
    """Along the line of sight, across it on the ground, and upwards; in the plane, x and y."""
    if len(direction) == 2:
        return np.eye(2)
    cos, sin, low, high = direction
    return np.array(
        [[low * cos, low * sin, high], [-sin, cos, 0.0], [-high * cos, -high * sin, low]]
    )


def read(sight: Sight, found: Gaussian) -> Linear:
    """A converted plot as a linear measurement along the axes of the sight."""
    B, seen = sight.axes, [sight.usable, sight.usable, sight.usable * sight.raised]
    seen = seen[: len(B)]
    nu, R = B @ (found.mean - sight.position), B @ found.cov @ B.T
    if len(sight.position) == 3:
        R = _kept(R + np.diag([*_unraised(sight), 0.0][: len(B)]), sight.raised)
    H = np.array([row * there for row, there in zip(B @ sight.H, seen, strict=True)])
    return Linear(nu * np.array(seen), H, R, np.array(seen))


def _unraised(sight: Sight) -> tuple[Any, Any]:
    """Mean squares, along and across, of what an elevation that was not measured does."""
    r, high = sight.given.mean[0], sight.given.direction[3]
    _, azimuth, elevation = (select(v > _WIDE, _WIDE, v) for v in sight.given.variances)
    e2, across = elevation * (1.0 - sight.raised), r * r * high * high * 0.5
    return 0.75 * r * r * e2 * e2, across * e2 * np.expm1(2.0 * azimuth)


def _kept(A: Array, raised: Any) -> Array:
    """The matrix (k, k), its last of three rows and columns those of the identity if not raised."""
    if len(A) < 3:
        return A
    kept = [1.0, 1.0, raised]
    rows = [[A[i, j] * kept[i] * kept[j] for j in range(3)] for i in range(3)]
    rows[2][2] = rows[2][2] + (1.0 - raised)
    return np.array(rows)


def log_volume(sight: Sight, conversion: Callable[[Array], Array]) -> Any:
    """Logarithm of the converted volume of a unit of plot: makes a density that of the plot.

    Args:
        sight: where, and which components.
        conversion: the converted point (d,), of range and angles (d,).
    """
    _, J = jacobian(conversion, sight.z)
    A = _kept(sight.axes @ J[:, : len(sight.axes)], sight.raised)
    return np.log(abs(_determinant(A)) + _TINY) * sight.usable


def _determinant(A: Array) -> Any:
    if len(A) == 2:
        return A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    others = [[1, 2], [0, 2], [0, 1]]
    terms = [A[0, j] * _determinant(A[1:][:, others[j]]) for j in range(3)]
    return terms[0] - terms[1] + terms[2]


def condition(
    prior: Gaussian, sight: Sight, plot: Linear, z: Array, parts: Sequence[Component]
) -> Posterior:
    """Use a converted plot, or its components by the block EKF where it could not be converted.

    Args:
        prior: predicted mean (n,), cov (n, n).
        sight: which of the two.
        plot: the converted plot.
        z: (k,) range and angles as measured, NaN where missing.
        parts: their components.

    Returns:
        NIS and log-likelihood of what was used; innovations and variances of the components.
    """
    nu, H, noise, seen = ekf.linearise(parts, z, prior.mean)
    pairs = zip(plot, Linear(nu, H, np.diag(noise), seen), strict=True)
    post = kalman.condition(prior, *(select(sight.usable > 0.5, a, b) for a, b in pairs))
    variance = [
        select(s < 0.5, np.nan, h @ prior.cov @ h + r)
        for s, h, r in zip(seen, H, noise, strict=True)
    ]
    return post._replace(innovation=nu, variance=np.array(variance))
