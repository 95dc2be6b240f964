"""Small worlds in which it is known what a study must find."""

from dataclasses import replace

import numpy as np

import boresight as bs
from boresight import catalogue
from boresight.laboratory.gather import Tally
from boresight.laboratory.study import Contender, Setting, Study
from boresight.laboratory.trial import run_chunk

MOTION = bs.ConstantVelocity(accel_mps2=0.5, dims=2)
LINEAR = bs.PositionSensor(x_m=20.0, y_m=30.0)
MILD = bs.Radar(range_m=20.0, azimuth_deg=0.1)


def world(sensor, scans=30, **others):
    """A target 9 km away that a filter's start knows to 100 m and 10 m/s."""
    return bs.Scenario(
        name="null",
        motion=MOTION,
        sensor=sensor,
        initial=[9000.0, 1000.0, -80.0, 60.0],
        prior_cov=np.diag(np.square([100.0, 100.0, 10.0, 10.0])),
        scans=scans,
        **others,
    )


def contender(name, sensor, label=None, motion=MOTION):
    return Contender(
        label=label or name, filter=catalogue.lookup(name), motion=motion, sensor=sensor
    )


def study_of(scenario, *contenders, runs=100, seed=1, **others):
    setting = Setting(scenario=scenario, contenders=contenders)
    return Study(name="test", settings=(setting,), runs=runs, seed=seed, **others)


def gathered(study):
    """All runs of every cell, each in one chunk."""
    found = []
    for i, j in study.cells:
        setting, tally = study.settings[i], Tally(study.runs)
        tally.add(run_chunk(study, setting, setting.contenders[j], 0, study.runs))
        found.append(tally.gathered())
    return found


def believing(sensor, factor):
    """The same sensor, its variances a factor too large."""
    values = {name: getattr(sensor, name) * factor**0.5 for name in _SIGMAS[type(sensor).__name__]}
    return replace(sensor, **values)


_SIGMAS = {"PositionSensor": ("x_m", "y_m"), "Radar": ("range_m", "azimuth_deg")}
