"""Sigma-point filters as the textbooks print them, and as two packages have them.

Julier and Uhlmann (2004) with the scaled weights; Arasaratnam and Haykin (2009), table I; the
posterior linearisation of Garcia-Fernandez et al. (2015). All points at once, weighted sums and
explicit inverses: written from the papers, not from the code they judge. Angles are not wrapped:
these are for targets away from 180 degrees.

The packages are imported inside their functions; `available` says whether they are there.
"""

from datetime import datetime, timedelta
from importlib.util import find_spec

import numpy as np

from oracles import filters as textbook


def available(package):
    return find_spec(package) is not None


def scaled(n, alpha, beta, kappa):
    """Spread of the points, weights of means, weights of covariances."""
    lam = alpha**2 * (n + kappa) - n
    means = np.full(2 * n + 1, 0.5 / (n + lam))
    covs = means.copy()
    means[0] = lam / (n + lam)
    covs[0] = means[0] + 1 - alpha**2 + beta
    return np.sqrt(n + lam), means, covs


def points(mean, cov, spread):
    """(2 n + 1, n): the mean, then along the columns of Cholesky's factor, both ways."""
    steps = spread * np.linalg.cholesky(cov).T
    return np.vstack([mean, mean + steps, mean - steps])


def unscented_predict(mean, cov, f, Q, rule):
    spread, wm, wc = scaled(len(mean), *rule)
    moved = np.array([f(x) for x in points(mean, cov, spread)])
    ahead = wm @ moved
    return ahead, np.einsum("i,ij,ik->jk", wc, moved - ahead, moved - ahead) + Q


def unscented_update(mean, cov, z, R, h, rule):
    """Mean, covariance, NIS, log-likelihood."""
    spread, wm, wc = scaled(len(mean), *rule)
    x = points(mean, cov, spread)
    y = np.array([h(p) for p in x])
    seen = wm @ y
    S = np.einsum("i,ij,ik->jk", wc, y - seen, y - seen) + R
    C = np.einsum("i,ij,ik->jk", wc, x - mean, y - seen)
    K = C @ np.linalg.inv(S)
    nis = (z - seen) @ np.linalg.inv(S) @ (z - seen)
    loglik = -0.5 * (nis + np.log(np.linalg.det(2 * np.pi * S)))
    return mean + K @ (z - seen), cov - K @ S @ K.T, nis, loglik


CUBATURE = (1.0, 0.0, 0.0)  # the centre has no weight then


def posterior_linearisation(mean, cov, z, R, h, iterations):
    """Regress on cubature points of the posterior, update the prior; and again.

    A regression whose noise has a larger determinant than the one before is not used (ours).
    """
    n, at, size, best = len(mean), (mean, cov), np.inf, None
    for _ in range(iterations):
        x = points(*at, np.sqrt(n))[1:]
        y = np.array([h(p) for p in x])
        seen = y.mean(axis=0)
        C = (x - at[0]).T @ (y - seen) / len(x)
        A = C.T @ np.linalg.inv(at[1])
        noise = (y - seen).T @ (y - seen) / len(x) - A @ at[1] @ A.T + R
        if np.linalg.det(noise) < size:
            size = np.linalg.det(noise)
            best = textbook.joint_update(mean, cov, z - seen + A @ at[0], A, noise)[:2]
        at = best
    return best


def filterpy_unscented(mean, cov, plots, F, Q, R, h, rule):
    """Means (steps, n) of filterpy's UnscentedKalmanFilter."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    alpha, beta, kappa = rule
    spread = MerweScaledSigmaPoints(len(mean), alpha=alpha, beta=beta, kappa=kappa)
    ukf = UnscentedKalmanFilter(len(mean), len(R), 1.0, h, lambda x, _: F @ x, spread)
    ukf.x, ukf.P, ukf.Q, ukf.R = mean.copy(), cov.copy(), Q, R
    return np.array([_stepped(ukf, z) for z in plots])


def filterpy_cubature(mean, cov, plots, R, h):
    """Means (steps, n) of filterpy's CubatureKalmanFilter, for a target that stays where it is.

    It does not draw points anew after a prediction, as the paper does: so there must be none.
    """
    from filterpy.kalman import CubatureKalmanFilter

    ckf = CubatureKalmanFilter(len(mean), len(R), 1.0, h, lambda x, _: x)
    ckf.x, ckf.P, ckf.Q, ckf.R = mean.copy(), cov.copy(), 0.0 * cov, R
    return np.array([_stepped(ckf, z[:, None]) for z in plots])


def _stepped(package, z):
    package.predict()
    package.update(z)
    return np.ravel(package.x).copy()


def stonesoup(mean, cov, plots, F, Q, R, rule=None):
    """Means (steps, n) of Stone Soup's unscented or, without a rule, cubature updater."""
    from stonesoup.models.measurement.nonlinear import CartesianToElevationBearingRange
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.angle import Bearing, Elevation
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import CubatureKalmanUpdater, UnscentedKalmanUpdater

    model = CartesianToElevationBearingRange(
        ndim_state=len(mean), mapping=np.arange(3), noise_covar=R[::-1, ::-1]
    )
    motion = LinearGaussianTimeInvariantTransitionModel(transition_matrix=F, covariance_matrix=Q)
    predictor = KalmanPredictor(motion)
    updater = CubatureKalmanUpdater(model)
    if rule is not None:
        alpha, beta, kappa = rule
        updater = UnscentedKalmanUpdater(model, alpha=alpha, beta=beta, kappa=kappa)
    begin = datetime(2026, 1, 1)  # noqa: DTZ001 - Stone Soup's times are naive
    state, means = GaussianState(mean[:, None], cov, timestamp=begin), []
    for t, (r, az, el) in enumerate(plots):
        when = begin + timedelta(seconds=t + 1)
        z = np.array([[Elevation(el)], [Bearing(az)], [r]], dtype=object)
        seen = Detection(z, timestamp=when, measurement_model=model)
        state = updater.update(SingleHypothesis(predictor.predict(state, timestamp=when), seen))
        means.append(np.asarray(state.mean, dtype=float).ravel())
    return np.array(means)
