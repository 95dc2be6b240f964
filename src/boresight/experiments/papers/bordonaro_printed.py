"""bordonaro's formulas as they are printed, for verdicts on what a misprint decides.

Paper: bordonaro (22), (26) to (30), (37), (38).
Differs from it: not at all, so errata B2 to B7 are all in here; nothing else uses it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.filters import kalman
from boresight.filters.sight import relative_place
from boresight.filters.start import SPEED_MPS, one_plot
from boresight.filters.steps import State, Surprise, gaussian_layout
from boresight.lanes import Leaf
from boresight.maths import Gaussian, missing, select
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

Array = Any


def square_error(eta: Any, r: Any, sr: Any, sa: Any) -> Any:
    """(22), erratum B2: the mean square error of the plot's point times eta."""
    return eta * eta * (r + sr * sr) - 2.0 * eta * r * r * np.exp(-sa * sa / 2.0) + r * r


def decorrelated(z: Array, sigma: Array, position: Array, cov: Array) -> Gaussian:
    """(24) to (30), errata B3 to B5.

    Args:
        z: (2,) range and bearing.
        sigma: (2,) standard deviations.
        position: (2,) predicted.
        cov: (2, 2) of it.
    """
    (rm, am), (sr, sa), (x, y) = z, sigma, position
    xx, xy, yy = cov[0, 0], cov[0, 1], cov[1, 1]
    square = x * x + y * y
    s_at2 = (xx * y * y - 2.0 * xy * y * x + yy * x * x) / (square * square)  # (29)
    s_rt2 = (xx * x * x - 2.0 * xy + yy * y * y) / square  # (30), B5
    cos2, sin2 = (x * x - y * y) / square, 2.0 * x * y / square
    kept, lost = np.exp(-2.0 * sa * sa), np.exp(-2.0 * s_at2)
    A = 0.5 * (rm * rm + sr * sr + s_rt2) * np.exp(sa * sa)  # B3
    B = 0.5 * (rm * rm + s_rt2)  # B3
    r11 = A * (1.0 + cos2 * kept * lost) - B * (1.0 + cos2 * kept)  # (26), B4
    r22 = A * (1.0 - cos2 * kept * lost) - B * (1.0 - cos2 * kept)  # (27), B4
    r12 = A * sin2 * kept * lost - B * sin2 * kept  # (28), B4
    reach = np.exp(sa * sa / 2.0) * rm
    point = np.array([reach * np.cos(am), reach * np.sin(am)])  # (24), (25)
    return Gaussian(point, np.array([[r11, r12], [r12, r22]]))


@dataclass(frozen=True, kw_only=True)
class PrintedDucm:
    """The Kalman filter with (24) to (30) as printed, in the plane; it starts by erratum B9."""

    @property
    def plain(self) -> bool:
        """It tells what it keeps."""
        return True

    def start(
        self, z: Array, motion: Motion, sensor: Sensor, *, speed_mps: float = SPEED_MPS
    ) -> Gaussian:
        """That of DUCM."""
        return one_plot(z, motion, sensor, speed_mps=speed_mps, conversion="ducm")

    def layout(self, motion: Motion, sensor: Sensor) -> dict[str, Leaf]:
        """Mean and covariance."""
        del sensor
        return gaussian_layout(motion)

    def begin(self, start: Gaussian, motion: Motion, sensor: Sensor) -> State:
        """The Gaussian itself."""
        del motion, sensor
        return start._asdict()

    def predict(self, state: State, motion: Motion, sensor: Sensor, dt: Any) -> State:
        """By the motion."""
        del sensor
        return kalman.predict(Gaussian(state["mean"], state["cov"]), motion, dt)._asdict()

    def update(
        self, state: State, z: Array, motion: Motion, sensor: Sensor
    ) -> tuple[State, Surprise]:
        """By the linear Kalman filter."""
        prior = Gaussian(state["mean"], state["cov"])
        position, H = relative_place(prior.mean, motion, sensor)
        gone = missing(z[0]) | missing(z[1])
        safe = np.array([select(gone, 1.0, value) for value in z])
        sigma = [part.sigma for part in sensor.components(motion)]
        found = decorrelated(safe, sigma, position, H @ prior.cov @ H.T)
        point = np.array([select(gone, np.nan, value) for value in found.mean])
        post = kalman.update(prior, point, H, found.cov)
        return {"mean": post.mean, "cov": post.cov}, Surprise(*post[2:])

    def output(self, state: State, motion: Motion, sensor: Sensor) -> Gaussian:
        """The Gaussian itself."""
        del motion, sensor
        return Gaussian(state["mean"], state["cov"])
