"""An extended Kalman filter in loops over runs and scans: any function will do."""

import numpy as np

import boresight as bs
from boresight.maths import gradient


def loops(z, dt, start, motion, sensor):
    """Plots (runs, scans, k), dt (1 or runs, scans), a start; gives every mean and covariance."""
    components, (mean, cov) = sensor.components(motion), map(np.array, start)
    means, covs = np.empty((*z.shape[:2], mean.shape[1])), np.empty((*z.shape[:2], *cov.shape[1:]))
    for run, scan in np.ndindex(*z.shape[:2]):
        seconds = dt[run % len(dt), scan]
        F = np.array([motion.move(each, seconds) for each in np.eye(mean.shape[1])]).T
        x, P = F @ mean[run], F @ cov[run] @ F.T + motion.noise(seconds)
        for component, measured in zip(components, z[run, scan], strict=True):
            if not np.isnan(measured):
                predicted, h = gradient(component.value, x)
                gain = P @ h / (h @ P @ h + component.sigma**2)
                x = x + gain * component.residual(measured, predicted)
                P = P - np.outer(gain, P @ h)
                P = (P + P.T) / 2
        mean[run], cov[run] = means[run, scan], covs[run, scan] = x, P
    return means, covs


NUMPY_EKF = bs.Outside(name="numpy-ekf", function=loops)
