"""Bearings of the paper's scenario, and the package's filters run on them."""

import numpy as np

from boresight.catalogue import lookup
from boresight.filters.recursion import run_recursion
from boresight.maths import Gaussian
from boresight.mixtures.range_parameterised import range_cells
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Bearings, Pose
from oracles import pradeep as paper

OWN = paper.own_ship(paper.OWN_SHIP)
RELATIVE = paper.target(paper.TARGET) - OWN
SPEED_SD = 11.0
WIDE = 10_500.0, 5_485.0  # one cell over all ranges from 1 to 20 km
CELLS = range_cells(1_000.0, 20_000.0, 6)


def up(own):
    """Positions (1, steps, 3), North, East, up, from (steps, 2), East and North."""
    return np.column_stack([own[:, 1], own[:, 0], np.zeros(len(own))])[None]


def bearings_from(own, azimuth_deg=0.33):
    """The sensor, own ship's places (steps, 2), East and North."""
    return Bearings(azimuth_deg=azimuth_deg, pose=Pose(position_m=up(own)))


def straight(accel=0.0):
    """The target's motion."""
    return ConstantVelocity(accel_mps2=accel, dims=2)


def every_second(steps):
    """(1, steps), the first bearing at the start."""
    dt = np.ones((1, steps))
    dt[0, 0] = 0.0
    return dt


def start_of(z, middle=WIDE[0], spread=WIDE[1], sigma=paper.SIGMA):
    """The paper's state and covariance on the first of the bearings (lanes, steps)."""
    return paper.start(z[:, 0], middle, spread, SPEED_SD, sigma)


def earth_fixed(X, P, own):
    """The paper's start (lanes, 4) as ours: rows and columns turned round, own ship added."""
    mean = X[..., paper.OURS] + np.array([own[0, 1], own[0, 0], 0.0, 0.0])
    return Gaussian(mean, P[..., paper.OURS, :][..., paper.OURS])


def relative(mean, own):
    """Our states (..., steps, 4) as the paper's."""
    X = mean[..., paper.OURS].copy()
    X[..., 2:] -= own
    return X


def filtered(name, z, own, start, *, accel=0.0, azimuth_deg=0.33, outputs=("mean",), **settings):
    """What a filter of the catalogue says: z (lanes, steps), a second apart."""
    recursion = (
        lookup(name)
        .with_settings(**settings)
        .recursion(straight(accel), bearings_from(own, azimuth_deg))
    )
    return run_recursion(recursion, z[..., None], every_second(z.shape[1]), start, outputs=outputs)
