"""Polar and spherical plots as Cartesian positions with covariances, in seven ways.

[lerro1993] D. Lerro and Y. Bar-Shalom, "Tracking with debiased consistent converted measurements
versus EKF"; [mo1998] and [duan2004] for the unbiased ones.
Paper: bordonaro (1) to (30); kashyap (3) and the appendix on CMKF-D.
Differs from them: errata B2 to B5, B9 and K5; every variance is a sum of terms that are not
negative, so nothing cancels; one formula serves the plane and space.

A plot is range, azimuth and, in space, elevation; azimuth counts from x towards y, elevation above
the x-y plane; noises are independent normals. Two facts give every conversion. The plain Cartesian
point u of a plot, the target being at x, has mean D x, D = diag(k, k, l), k = e^{-(sa² + se²)/2},
l = e^{-se²/2}, and covariance N(x). And x, the plot being known, has mean D u and covariance N(u).

    name          mean             covariance                                    conditioned on
    conventional  u                J R J'                                        the plot
    cmkf-d-t      u - (D - 1) E x  E N(x)                                        the truth
    cmkf-d-m      the same, x spread about the plot as its own noise tells       the plot
    ucm           u / D            N(u) + b b', b = u / D - D u                  the plot
    mucm          D u              N(u)                                          the plot
    mmse          eta u            E (eta u - x)(eta u - x)'                     the truth
    ducm          u / D            E N(x) / D²; without a prediction, that of ucm  the prediction

E averages over x as `given` tells it: independent normal range and angles, without spread for a
truth. What is conditioned on the plot does not look at `given`; mmse without one takes the plot
for the truth.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.maths import Gaussian
from boresight.models.polar import (
    EXACT,
    Given,
    Noise,
    Place,
    angle_noise,
    mean_point,
    place,
    polar_moments,
)

__all__ = ["CONVERSIONS", "Conversion", "Given", "Plot", "convert", "polar_moments"]
Array = Any


class Sheet(NamedTuple):
    """A covariance seen from the vertical plane of the line of sight.

    Attributes:
        along: variance away from the sensor, on the ground.
        across: variance across, on the ground; correlated with nothing.
        up: variance of the height.
        tilt: covariance of along and up.
    """

    along: Any
    across: Any
    up: Any
    tilt: Any


class Plot(NamedTuple):
    """A plot and what its noise does.

    Attributes:
        z: (d,) as measured.
        variances: (d,) of its noise.
        at: the plot as a place, without spread.
        point: (d,) plain Cartesian point, u.
        azimuth: noise of the azimuth.
        elevation: noise of the elevation.
        shrink: of ground and height, the diagonal of D.
        loss: of ground and height, the diagonal of 1 - D.
    """

    z: Array
    variances: Array
    at: Place
    point: Array
    azimuth: Noise
    elevation: Noise
    shrink: tuple[Any, Any]
    loss: tuple[Any, Any]


Found = TypeVar("Found")
Conversion = Callable[[Plot, Given | None], Gaussian]


def cartesian(sheet: Sheet, where: Place) -> Array:
    """The covariance (d, d) that a sheet is, averaged over the azimuth it is turned to."""
    along, across, up, tilt = sheet
    cos, sin, cos2, sin2, product = where.azimuth
    xx, yy = along * cos2 + across * sin2, along * sin2 + across * cos2
    xy = (along - across) * product
    if where.dims == 2:
        return np.array([[xx, xy], [xy, yy]])
    xz, yz = tilt * cos, tilt * sin
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, up]])


def true_spread(plot: Plot, where: Place) -> Sheet:
    """Covariance of the unbiased point u / D given the truth, averaged over where that is.

    Bordonaro (8) to (10), and averaged (26) to (28) with errata B3 and B4; "Beyond the papers" for
    space. The printed differences e^v (E r² + sr²) E cos² - E r² E cos² are written with cosh v - 1
    and sinh v, as kashyap's appendix has them.
    """
    sr2, square, t, p = plot.variances[0], where.square, plot.azimuth, plot.elevation
    cos2, sin2 = where.elevation.cos2, where.elevation.sin2
    low = p.lift * cos2 + p.sinh * sin2  # what noise of the elevation adds to cos²
    high = p.lift * sin2 + p.sinh * cos2  # and to sin²
    wide = (1.0 + t.lift) * low + t.lift * cos2
    return Sheet(
        along=sr2 * (cos2 + wide) + square * wide,
        across=(square + sr2) * t.sinh * (cos2 + low),
        up=sr2 * (sin2 + high) + square * high,
        tilt=where.elevation.product * p.shrink * p.shrink * (sr2 - square * p.growth),
    )


def _scaled(sheet: Sheet, ground: Any, up: Any) -> Sheet:
    """Covariance of what is stretched on the ground and in height."""
    square = ground * ground
    return Sheet(
        sheet.along * square, sheet.across * square, sheet.up * up * up, sheet.tilt * ground * up
    )


def _sum(a: Sheet, b: Sheet) -> Sheet:
    return Sheet(*[x + y for x, y in zip(a, b, strict=True)])


def stretched(point: Array, ground: Any, up: Any) -> Array:
    """A point (d,), longer on the ground and in height."""
    return np.array([x * f for x, f in zip(point, (ground, ground, up), strict=False)])


def _second_moment(where: Place) -> Sheet:
    """Average of x x'."""
    elevation = where.elevation
    ground, product = where.square * elevation.cos2, where.square * elevation.product
    return Sheet(ground, where.square * 0.0, where.square * elevation.sin2, product)


def _conventional(plot: Plot, given: Given | None) -> Gaussian:
    """Bordonaro (1); kashyap (3)."""
    del given
    sr2, sa2, *rest = plot.variances
    se2 = rest[0] if rest else 0.0
    e, square = plot.at.elevation, plot.at.square
    linear = Sheet(
        along=sr2 * e.cos2 + square * se2 * e.sin2,
        across=square * sa2 * e.cos2,
        up=sr2 * e.sin2 + square * se2 * e.cos2,
        tilt=(sr2 - square * se2) * e.product,
    )
    return Gaussian(plot.point, cartesian(linear, plot.at))


def _debiased(plot: Plot, given: Given | None) -> Gaussian:
    """Kashyap's appendix, CMKF-D-T; sign by erratum K13."""
    if given is None:
        raise UsageError(
            "cmkf-d-t needs to be given the truth",
            why="its bias and covariance are those of a known range and angles",
            next_step="give a place (a prediction may stand in), or use cmkf-d-m",
        )
    where = place(given)
    bias = stretched(mean_point(where), *plot.loss)
    mean = np.array([u + b for u, b in zip(plot.point, bias, strict=True)])
    spread = _scaled(true_spread(plot, where), *plot.shrink)
    return Gaussian(mean, cartesian(spread, where))


def _debiased_by_plot(plot: Plot, given: Given | None) -> Gaussian:
    """Kashyap's appendix, CMKF-D-M, with erratum K5."""
    del given
    return _debiased(plot, Given(plot.z, plot.variances))


def _posterior(plot: Plot) -> Sheet:
    """Covariance of the target given the plot, the target being anywhere before."""
    return _scaled(true_spread(plot, plot.at), *plot.shrink)


def _modified_unbiased(plot: Plot, given: Given | None) -> Gaussian:
    """Bordonaro (14) to (18)."""
    del given
    mean = stretched(plot.point, *plot.shrink)
    return Gaussian(mean, cartesian(_posterior(plot), plot.at))


def _unstretched(plot: Plot) -> Array:
    """The unbiased point u / D: bordonaro (6), (7), (24), (25)."""
    ground, up = plot.shrink
    return stretched(plot.point, 1.0 / ground, 1.0 / up)


def bias_given_plot(plot: Plot) -> tuple[Any, Any]:
    """What 1 / D - D stretches ground and height by: the unbiased point less the average target."""
    ground, up = (
        loss * (1.0 + kept) / kept for loss, kept in zip(plot.loss, plot.shrink, strict=True)
    )
    return ground, up


def _unbiased(plot: Plot, given: Given | None) -> Gaussian:
    """Bordonaro (6), (7) and (11) to (13)."""
    del given
    squared = _scaled(_second_moment(plot.at), *bias_given_plot(plot))
    cov = cartesian(_sum(_posterior(plot), squared), plot.at)
    return Gaussian(_unstretched(plot), cov)


def _least_square(plot: Plot, given: Given | None) -> Gaussian:
    """Bordonaro (19) to (23) with erratum B2: one factor eta; the matrix includes its bias."""
    where = plot.at if given is None else place(given)
    total, elevation = where.square + plot.variances[0], where.elevation
    loss = elevation.cos2 * plot.loss[0] + elevation.sin2 * plot.loss[1]
    eta = where.square * (1.0 - loss) / total
    rest = (plot.variances[0] + where.square * loss) / total  # 1 - eta
    short = [lost + kept * rest for lost, kept in zip(plot.loss, plot.shrink, strict=True)]
    noise = _scaled(true_spread(plot, where), *[eta * kept for kept in plot.shrink])
    error = _sum(noise, _scaled(_second_moment(where), *short))
    return Gaussian(stretched(plot.point, eta, eta), cartesian(error, where))


def _decorrelated(plot: Plot, given: Given | None) -> Gaussian:
    """Bordonaro (24) to (28) with errata B3, B4; the first scan by B9."""
    if given is None:
        return _unbiased(plot, None)
    where = place(given)
    return Gaussian(_unstretched(plot), cartesian(true_spread(plot, where), where))


CONVERSIONS: dict[str, Conversion] = {
    "conventional": _conventional,
    "cmkf-d-m": _debiased_by_plot,
    "cmkf-d-t": _debiased,
    "ucm": _unbiased,
    "mucm": _modified_unbiased,
    "mmse": _least_square,
    "ducm": _decorrelated,
}


def lookup(name: str, known: Mapping[str, Found]) -> Found:
    """What is known by that name; UsageError with the nearest valid name if nothing is."""
    if name in known:
        return known[name]
    raise unknown("conversion", name, known)


def understand(z: Array, sigma: Array) -> Plot:
    """A plot (d,) with standard deviations (d,), and what its noise does."""
    variances = np.array([s * s for s in sigma])
    at = place(Given(z, [0.0] * len(z)))
    noises = [angle_noise(v) for v in variances[1:]]
    t, p = [*noises, EXACT][:2]
    loss = t.loss + p.loss * t.shrink
    point = mean_point(at)
    return Plot(z, variances, at, point, t, p, (t.shrink * p.shrink, p.shrink), (loss, p.loss))


def convert(name: str, z: Array, sigma: Array, given: Given | None = None) -> Gaussian:
    """A plot as a Cartesian position with its covariance, in the sensor's frame.

    Everything is component first and runs on floats, arrays (d, lanes) and symbols.

    Args:
        name: of `CONVERSIONS`.
        z: (d,) range m, azimuth rad and, for d = 3, elevation rad.
        sigma: (d,) standard deviations.
        given: where the target is thought to be, for those that ask.

    Returns:
        mean (d,), cov (d, d); for mmse the mean square error.

    Raises:
        UsageError: no such conversion, or one that must be given the truth is not.
    """
    return conditioned(name, understand(z, sigma), given)


def conditioned(name: str, plot: Plot, given: Given | None) -> Gaussian:
    """`convert`, of a plot that is understood already."""
    return lookup(name, CONVERSIONS)(plot, given)
