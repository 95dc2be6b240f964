"""Filters that users wrote: good ones, and for every law one that breaks it."""

import sys
from pathlib import Path

import numpy as np

import boresight as bs
from boresight.filters.kalman import predict
from boresight.filters.steps import Updating
from boresight.maths import gradient, mirror, missing, select

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_filter"
sys.path.insert(0, str(EXAMPLE))
from fading_ekf import FADING_EKF, update  # noqa: E402, F401 - the example is not installed
from numpy_ekf import NUMPY_EKF, loops  # noqa: E402, F401 - nor is this


def faulty(
    *, gain_by=1.0, filled=False, unwrapped=False, twice=False, later=0.0, before=None, after=None
):
    """The textbook's sequential EKF with a fault."""

    def step(prior, z, components):
        (mean, cov), nis, dof, loglik, nus, variances = before(*prior, z), 0.0, 0.0, 0.0, [], []
        for i, (measured, component) in enumerate(zip(z, components, strict=True)):
            predicted, h = gradient(component.value, mean)
            seen = 1.0 if filled else select(missing(measured), 0.0, 1.0)
            there = select(missing(measured), predicted, measured)
            nu = there - predicted if unwrapped else component.residual(there, predicted)
            s = h @ cov @ h + component.sigma**2 * (1.0 + later * i)
            gain = gain_by * cov @ h * (seen / s)
            taken = np.outer(gain, cov @ h) * (2.0 if twice else 1.0)
            mean, cov = mean + gain * nu, mirror(cov - taken)
            nis, dof = nis + nu * nu / s, dof + select(missing(measured), 0.0, 1.0)
            loglik = loglik - 0.5 * (nu * nu / s + seen * np.log(2 * np.pi * s))
            nus.append(nu)
            variances.append(select(missing(measured), np.nan, s))
        mean, cov = after(mean, cov)
        return bs.Posterior(mean, cov, nis, dof, loglik, np.array(nus), np.array(variances))

    before = before or (lambda mean, cov, _: (mean, cov))
    after = after or (lambda mean, cov: (mean, cov))
    return bs.Filter(name="faulty", formula=step)


def overwriting(mean, cov, z):
    z[0] = z[0] + 1.0
    return mean, cov


def cheating(mean, cov, _):
    """Right on floats only."""
    return (mean if isinstance(mean[0], float) else mean * 1.001), cov


def stretched(mean, cov):
    factor = np.ones(len(mean))
    factor[0] = 1.01
    return mean, cov * np.outer(factor, factor)


def north(mean, cov):
    step = np.zeros(len(mean))
    step[0] = 1.0
    return mean + step, cov


def crowd(z, dt, start, motion, sensor):
    """Every run is pulled to the average of all runs."""
    mean, cov = loops(z, dt, start, motion, sensor)
    return 0.99 * mean + 0.01 * mean.mean(axis=0), cov


def overlapping(mean, cov):
    """Positive variances, and a correlation of two."""
    cov = cov + 0.0
    cov[0, 1] = cov[1, 0] = 2.0 * np.sqrt(cov[0, 0] * cov[1, 1])
    return mean, cov


def pushing(prior, motion, dt):
    """A prediction that moves what it was given."""
    prior.mean[0] = prior.mean[0] + 1.0
    return predict(prior, motion, dt)


class Whispering:
    """A method that says it tells what it keeps, and tells something else."""

    def __init__(self):
        self._inner = Updating(formula=update)

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def output(self, state, motion, sensor):
        told = self._inner.output(state, motion, sensor)
        return told._replace(mean=told.mean * 1.001)


FURTHER = (
    ("covariance", faulty(after=overlapping)),
    ("inputs", bs.Filter(name="faulty", formula=update, predict=pushing)),
)
BROKEN = {
    "kalman": faulty(gain_by=0.5),
    "order": faulty(later=1.0),
    "missing plot": faulty(filled=True),
    "missing component": faulty(filled=True),
    "whole turn": faulty(unwrapped=True),
    "half turn": faulty(after=north),
    "rotation": faulty(after=stretched),
    "elsewhere": faulty(after=lambda mean, cov: (mean * (1.0 - 1e-6), cov)),
    "covariance": faulty(twice=True),
    "inputs": faulty(before=overwriting),
    "formula": faulty(before=cheating),
    "batch": bs.Outside(name="faulty", function=crowd),
    "stream": bs.Filter(name="faulty", formula=Whispering),
}
