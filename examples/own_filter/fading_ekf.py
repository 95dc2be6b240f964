"""An extended Kalman filter whose memory fades; boresight runs it as one of its own."""

import numpy as np

import boresight as bs
from boresight.maths import gradient, mirror, missing, select


def update(prior, z, components, *, fading=1.0):
    """Condition on one component after the other; above 1 the past is forgotten faster."""
    mean, cov = prior.mean, prior.cov * fading
    nis, dof, loglik, innovations, variances = 0.0, 0.0, 0.0, [], []
    for measured, component in zip(z, components, strict=True):
        predicted, h = gradient(component.value, mean)
        seen = select(missing(measured), 0.0, 1.0)
        nu = component.residual(select(missing(measured), predicted, measured), predicted)
        s = h @ cov @ h + component.sigma**2
        gain = cov @ h * (seen / s)
        mean, cov = mean + gain * nu, mirror(cov - np.outer(gain, cov @ h))
        nis, dof = nis + nu * nu / s, dof + seen
        loglik = loglik - 0.5 * (nu * nu / s + seen * np.log(2 * np.pi * s))
        innovations.append(nu)
        variances.append(select(missing(measured), np.nan, s))
    return bs.Posterior(mean, cov, nis, dof, loglik, np.array(innovations), np.array(variances))


FADING_EKF = bs.Filter(name="fading-ekf", formula=update, summary="EKF whose memory fades")
