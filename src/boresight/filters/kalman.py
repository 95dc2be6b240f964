"""Linear Kalman filter: the prediction that all filters share, and the joint linear update.

[kalman1960] R. E. Kalman, "A New Approach to Linear Filtering and Prediction Problems".
Paper: kashyap (6) to (8).
Differs from it: the prediction takes any motion, whose Jacobian is found by dual numbers (for a
linear motion that is the transition matrix itself); the update is in Joseph's form.
"""

from typing import Any

import numpy as np

from boresight.maths import Gaussian, jacobian, joseph, mirror, missing, select, solve
from boresight.models.motion import Motion

Array = Any


def predict(prior: Gaussian, motion: Motion, dt: Any) -> Gaussian:
    """State after dt seconds.

    Args:
        prior: mean (n,), cov (n, n).
        motion: how the target moves.
        dt: s; 0 leaves the state as it is.

    Returns:
        kashyap (7), with the Jacobian of the motion for F.
    """
    moved, F = jacobian(lambda state: motion.move(state, dt), prior.mean)
    return Gaussian(moved, mirror(F @ prior.cov @ F.T + motion.noise(dt)))


def update(prior: Gaussian, z: Array, H: Array, R: Array) -> Gaussian:
    """Condition on a linear measurement z = H x + noise.

    Args:
        prior: mean (n,), cov (n, n).
        z: (k,), NaN where missing.
        H: (k, n).
        R: (k, k) covariance of the noise.

    Returns:
        kashyap (8), in Joseph's form; missing rows change nothing.
    """
    k = len(z)
    gone = np.array([missing(component) for component in z])
    rows = np.array([[select(g, h * 0.0, h) for h in row] for g, row in zip(gone, H, strict=True)])
    eye = np.eye(k)
    noise = np.array(
        [[select(gone[i] | gone[j], eye[i, j], R[i, j]) for j in range(k)] for i in range(k)]
    )
    residual = select(gone, 0.0, z) - rows @ prior.mean
    S = rows @ prior.cov @ rows.T + noise
    K = solve(mirror(S), rows @ prior.cov).T
    return Gaussian(prior.mean + K @ residual, joseph(prior.cov, K, rows, noise))
