"""A small study for engines and checkpoints, and a process that runs it and may be killed."""

import json
import sys
import time
from dataclasses import replace

import numpy as np

from boresight.catalogue import lookup
from boresight.experiments.scenario import lookup as world
from boresight.filters.method import Outside
from boresight.laboratory import checkpoints
from boresight.laboratory.run import run_study
from boresight.laboratory.study import Contender, Setting, Study


def hold(z, _dt, start, _motion, _sensor):
    """A filter outside, in Python: it believes its start for ever."""
    shape = (*z.shape[:2], start.mean.shape[-1])
    mean = np.broadcast_to(start.mean[:, None], shape)
    cov = start.cov if start.cov.ndim == 3 else start.cov[None]
    return mean, np.broadcast_to(cov[:, None], (*shape, shape[-1]))


def slow_hold(*arguments):
    """The same, 20 ms later: a study of many chunks takes a while."""
    time.sleep(0.02)
    return hold(*arguments)


def make(*, runs=100, scans=20, seed=5, function=hold, metrics=("rmse",)):
    """Two contenders, one in a kernel and one outside."""
    scenario = replace(world("kashyap-set-2"), scans=scans)
    models = {"motion": scenario.motion, "sensor": scenario.sensor}
    filters = (lookup("mekf"), Outside(name="hold", function=function))
    contenders = tuple(Contender(label=each.name, filter=each, **models) for each in filters)
    setting = Setting(scenario=scenario, contenders=contenders)
    return Study(name="small", settings=(setting,), runs=runs, seed=seed, metrics=metrics)


def main():
    """Run the slow study in a folder; print how much was there, and the digest."""
    given = json.loads(sys.argv[1])
    checkpoints._LEAST_S = 0.05
    told = []
    try:
        found = run_study(
            make(function=slow_hold),
            chunk=2,
            workers=2,
            progress=lambda done, _total: told.append(done) or sys.stderr.write(f"{done}\n"),
            **given,
        )
    except KeyboardInterrupt:
        sys.exit(130)
    sys.stdout.write(json.dumps({"began": told[0], "digest": found.digest}))
