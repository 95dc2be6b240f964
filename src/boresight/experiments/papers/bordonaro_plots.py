"""bordonaro's single plots: histograms, normalised errors, batches; nothing is filtered in time.

Paper: bordonaro sections 2.1 to 2.4; Figures 2 to 5 and 7. Lengths are the paper's feet: a
conversion does not mind. Plots are drawn in blocks, each a run of `maths.seeds`.
"""

from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from boresight.experiments.consistency import Bias, Nes, bias, conversion_nes
from boresight.experiments.papers.bordonaro_tracks import filtered
from boresight.experiments.scenario import FOOT_M, Scenario
from boresight.experiments.simulate import Plots
from boresight.filters.converted import Converted
from boresight.filters.least_squares import batch_least_squares
from boresight.maths import Gaussian
from boresight.maths.seeds import Stream, normals
from boresight.models.conversions import convert
from boresight.models.polar import Given, polar_moments
from boresight.models.sensors import Radar

Array = Any
_BLOCK = 1024
_BINS = 260
BATCHED = ("conventional", "ucm", "mucm", "ducm")


class Sight(NamedTuple):
    """A target and how well it is seen: feet and radians."""

    range: float
    bearing: float
    sigma: Array

    @property
    def truth(self) -> Array:
        """(2,) position."""
        return self.range * np.array([np.cos(self.bearing), np.sin(self.bearing)])

    @property
    def known(self) -> Given:
        """The truth, for a conversion that is given it."""
        return Given(np.array([[self.range], [self.bearing]]), np.zeros((2, 1)))


def sight(printed: dict[str, Any], bearing_deg: float, sigma_deg: float) -> Sight:
    """A target at a figure's range, seen with its range noise."""
    sigma = np.array([printed["sigma_range_ft"], np.radians(sigma_deg)])
    return Sight(printed["range_ft"], float(np.radians(bearing_deg)), sigma)


def draw(seen: Sight, number: int, seed: int, cell: str) -> Array:
    """Plots (2, number) of a target."""
    name = f"bordonaro {cell} {seen.range} {seen.bearing} {seen.sigma[1]}"
    runs = -(-number // _BLOCK)
    noise = normals(seed, name, Stream.NOISE, (_BLOCK, 2), runs=runs).reshape(-1, 2)[:number]
    return (np.array([seen.range, seen.bearing]) + noise * seen.sigma).T


def converted(name: str, z: Array, seen: Sight, given: Given | None = None) -> Gaussian:
    """Plots (2, number) as points (number, 2) with covariances (number, 2, 2)."""
    point, cov = convert(name, z, seen.sigma, given)
    each = np.broadcast_to(cov, (2, 2, z.shape[1]))
    return Gaussian(point.T, np.moveaxis(each, -1, 0))


class Cloud(NamedTuple):
    """What is seen of many converted plots of one target.

    Attributes:
        truth: (2,) where it is.
        mean: of the error (2,), and how certain that is.
        cov: (2, 2) of the mean error.
        counts, x, y: a histogram (nx, ny) and its edges.
    """

    truth: Array
    mean: Bias
    cov: Array
    counts: Array
    x: Array
    y: Array


def clouds(
    printed: dict[str, Any], bearings_deg: list[float], runs: int, seed: int
) -> dict[float, Cloud]:
    """Figure 3: plots converted by UCM, by bearing."""
    return {
        b: _cloud(sight(printed, b, printed["sigma_bearing_deg"][0]), runs, seed)
        for b in bearings_deg
    }


def _cloud(seen: Sight, runs: int, seed: int) -> Cloud:
    points = converted("ucm", draw(seen, runs, seed, "cloud"), seen).mean
    r = 1.3 * seen.range
    counts, x, y = np.histogram2d(points[:, 0], points[:, 1], bins=_BINS, range=[[-r, r], [-r, r]])
    error = points - seen.truth
    return Cloud(seen.truth, bias(error), np.cov(error.T) / runs, counts, x, y)


def square_errors(
    printed: dict[str, Any], sigma_deg: float, runs: int, seed: int
) -> dict[str, Array]:
    """Squared error (runs,) of the same plots converted by UCM, MUCM and with the best factor."""
    seen = sight(printed, 0.0, sigma_deg)
    z = draw(seen, runs, seed, "square error")
    points = {name: converted(name, z, seen, seen.known).mean for name in ("ucm", "mucm", "mmse")}
    return {name: np.sum((point - seen.truth) ** 2, axis=1) for name, point in points.items()}


Cells = dict[tuple[str, float, float], Nes]


def consistency(
    printed: dict[str, Any], assumed: dict[str, Any], world: Scenario, runs: int, seed: int
) -> Cells:
    """Figures 4 and 7: NES by (method, bearing noise, bearing), degrees.

    A filter sees some plots first; its prediction is what DUCM is conditioned on.
    """
    found: Cells = {}
    scans = int(assumed["nes_scans"])
    for sigma, bearing in product(printed["sigma_bearing_deg"], assumed["nes_bearings_deg"]):
        seen = sight(printed, bearing, sigma)
        z = draw(seen, runs * (scans + 1), seed, "nes").T.reshape(runs, scans + 1, 2)
        given = predicted(z[:, :-1], seen, world)
        for name in ("ucm", "mucm", "ducm"):
            point, cov = converted(name, z[:, -1].T, seen, given)
            found[name.upper(), sigma, bearing] = conversion_nes(
                point - seen.truth, cov, seen.truth, false_alarm=1.0 - printed["probability"]
            )
    return found


def predicted(z: Array, seen: Sight, world: Scenario) -> Given:
    """What a static CMKF-DUCM thinks after plots (runs, scans, 2): feet and radians, (2, runs)."""
    sigma = FOOT_M * seen.sigma[0], np.degrees(seen.sigma[1])
    place = replace(world, sensor=Radar(range_m=sigma[0], azimuth_deg=sigma[1]), scans=z.shape[1])
    plots = Plots(place.time_s, z * [FOOT_M, 1.0], place.dt, place.prior)
    told = filtered(Converted(conversion="ducm"), place.motion, place, plots)
    position, cov = told.mean[:, -1] / FOOT_M, told.cov[:, -1] / FOOT_M**2
    return polar_moments(position.T, np.moveaxis(cov, 0, -1))


def batch_bias(
    printed: dict[str, Any], range_ft: float, sigma_deg: float, seed: int
) -> dict[str, tuple[float, float]]:
    """Figure 5: a batch's error along the line of sight, and the standard deviation it claims.

    DUCM is conditioned on the truth, which is where its filter's track goes.
    """
    share = printed["sigma_range_share"]
    seen = Sight(range_ft, 0.0, np.array([share * range_ft, np.radians(sigma_deg)]))
    z = draw(seen, printed["samples"], seed, "batch")
    fits = {
        name: batch_least_squares(*converted(name, z, seen, seen.known if name == "ducm" else None))
        for name in BATCHED
    }
    return {
        name: (float(fit.mean[0] - range_ft), float(np.sqrt(fit.cov[0, 0])))
        for name, fit in fits.items()
    }
