"""A formula written by hand, here only to hold the compiler to its stop rule.

DUCM converts a plot with a covariance taken at the prediction: few operations, `exp` and
trigonometry.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from boresight.filters.kalman import predict
from boresight.lanes import Program, Rate, Scalar, Symmetric, Vector, trace
from boresight.maths import Gaussian, cholesky, lower_solve, mirror, upper_solve
from scenario import PLANAR

Array = Any
Step = tuple[dict[str, Array], dict[str, Array]]


def _expm1(x: Any) -> Any:
    """exp(x) - 1 for small x > 0, where the difference itself would lose its digits."""
    half = np.exp(x * 0.5)
    return (half - 1.0) * (half + 1.0)


def ducm(state: Mapping[str, Array], inputs: Mapping[str, Any]) -> Step:
    """Constant velocity in the plane, plots converted at the prediction.

    Paper: bordonaro (22) to (28), errata B3 and B4, safe form.
    """
    mean, cov = predict(Gaussian(state["mean"], state["cov"]), PLANAR, inputs["dt"])
    position, H = mean[:2], np.eye(4)[:2]
    r = np.sqrt(position @ position)
    c, s = position / r
    along, across = np.array([c, s]), np.array([-s, c])
    s_rt2 = along @ cov[:2, :2] @ along
    s_at2 = across @ cov[:2, :2] @ across / (r * r)
    sr2, s2 = inputs["range_m"] ** 2, inputs["azimuth_rad"] ** 2
    B, grow, shrink = r * r + s_rt2, _expm1(s2), -_expm1(s2) * np.exp(-s2)
    fade = np.exp(-2.0 * s_at2)
    C, D = (c * c - s * s) * fade, 2.0 * c * s * fade
    R11, R22 = (
        0.5 * (sr2 * (np.exp(s2) + g * np.exp(-s2)) + B * (grow + g * shrink)) for g in (C, -C)
    )
    R12 = 0.5 * D * (sr2 * np.exp(-s2) + B * shrink)
    z = inputs["z"]
    scale = z[0] * np.exp(0.5 * s2)
    nu = np.array([scale * np.cos(z[1]), scale * np.sin(z[1])]) - position
    L, inverse = cholesky(mirror(H @ cov @ H.T + np.array([[R11, R12], [R12, R22]])))
    half = lower_solve(L, inverse, H @ cov)
    mean = mean + upper_solve(L, inverse, half).T @ nu
    return {"mean": mean, "cov": mirror(cov - half.T @ half)}, {"mean": mean}


def record(formula: Any, n: int, k: int) -> Program:
    """The formula as a program that writes the mean of every step."""
    noises = ("range_m", "azimuth_rad", "elevation_rad")[:k]
    inputs = {"z": (Vector(k), Rate.EACH), "dt": (Scalar(), Rate.FIXED)}
    inputs |= {name: (Scalar(), Rate.FIXED) for name in noises}
    return trace(
        formula,
        state={"mean": Vector(n), "cov": Symmetric(n)},
        inputs=inputs,
        outputs={"mean": (Vector(n), Rate.EACH)},
    )
