"""How close to the bound the filters come, and whether they know: acceptance 4.

Fixed seeds. On Set 2 the standard error of the ratio is 0.0095 and that of the ANEES 0.007, so a
filter at 1.00 leaves the bands of 0.04 and 0.05 once in 40,000 and less than once in 10^11 draws,
but for runs beside the zenith: one EKF's run in 15,000 is lost there, so one seed in 75 would fail.
On the 10 degree set, with 1,000 runs, they are 0.008 and 0.005; MEKF lies five and twelve of these
inside. There it is lost in one run of 4,000, within four degrees of the vertical axis, and such a
run can move the ANEES of all by tenths: judged is that of the others, and how many are lost (more
than 5 of 1,000 once in 10^6 seeds). The median ratio between two orders of components has one of
0.0002.
"""

from dataclasses import replace

import numpy as np
import pytest

from boresight.experiments.bounds import average_in_covariance, bound_per_trajectory
from boresight.experiments.metrics import anees, anis, diverged, nees, percent_fit_error, rmse
from boresight.experiments.montecarlo import filtered
from boresight.experiments.scenario import lookup
from boresight.experiments.simulate import simulate

LATE = slice(20, None)
LOST = 10.0  # NEES of a run, a state: errors three times what the filter claims


class World:
    """A scenario's runs and their bound."""

    def __init__(self, name, runs, seed):
        self.world = lookup(name)
        self.truth, self.plots = simulate(self.world, runs=runs, seed=seed)
        motion, sensor = self.world.motion, self.world.sensor
        bound = bound_per_trajectory(self.truth, self.plots, motion, sensor)
        self.bound = average_in_covariance(bound, self.truth.names, scans=LATE)

    def judge(self, name, **settings):
        world = self.world
        found = filtered(name, world.motion, world.sensor, self.plots, settings=settings)
        ratio = rmse(found, self.truth, scans=LATE) / self.bound
        return ratio, anees(found, self.truth, scans=LATE).value, found

    def judge_the_rest(self, name, **settings):
        """The ratio of all runs, the share that is lost, and the ANEES of the others."""
        ratio, _, found = self.judge(name, **settings)
        each = np.mean(nees(found, self.truth)[:, LATE], axis=1) / found.mean.shape[2]
        return ratio, np.mean(each >= LOST), np.mean(each[each < LOST])


@pytest.fixture(scope="module")
def set2():
    return World("kashyap-set-2", runs=200, seed=1)


@pytest.fixture(scope="module")
def wide():
    return World("kashyap-10deg", runs=1000, seed=2)


@pytest.mark.parametrize("name", ["ekf", "ekf-sequential", "mekf", "mekf-block"])
def test_set_2_leaves_no_headroom(set2, name):
    ratio, consistency, found = set2.judge(name)
    assert 0.96 <= ratio <= 1.04
    assert 0.95 <= consistency <= 1.05
    assert diverged(found, set2.truth, scans=LATE) == 0.0
    nis = anis(found, scans=LATE)
    assert nis.value == pytest.approx(1.0, abs=0.02)


def test_at_ten_degrees_the_ekf_does_not_know_its_errors(wide):
    ratio, consistency, _ = wide.judge("ekf")
    assert consistency > 3.0
    assert ratio > 1.15


@pytest.mark.parametrize(("name", "settings"), [("mekf", {}), ("mekf-block", {})])
def test_at_ten_degrees_the_mekf_does(wide, name, settings):
    ratio, lost, consistency = wide.judge_the_rest(name, **settings)
    assert ratio <= 1.07
    assert lost <= 0.005
    assert 0.9 <= consistency <= 1.15


def test_at_ten_degrees_other_readings_of_mu_do_not(wide):
    """Why the default is `predicted`; `printed`, with K3, would pass too (erratum K4)."""
    *_, none = wide.judge_the_rest("mekf", mu="none")
    *_, second = wide.judge_the_rest("mekf", mu="second order")
    assert none < 0.9
    assert second > 1.5


def test_no_filter_beats_the_bound_by_more_than_chance(set2, wide):
    assert wide.judge("mekf", mu="none")[0] > 0.97
    assert set2.judge("ekf")[0] > 1.0 - 4 * 0.0095


def test_order_of_components_changes_nothing_worth_having():
    """kashyap Table 5: Set 2, 200 truths, started where the paper starts, (6)."""
    world = replace(lookup("kashyap-set-2"), begin="given")
    truth, plots = simulate(world, runs=200, seed=1)
    orders = (
        ("elevation_rad", "azimuth_rad", "range_m"),
        ("azimuth_rad", "range_m", "elevation_rad"),
        ("range_m", "elevation_rad", "azimuth_rad"),
    )
    first, *others = [
        percent_fit_error(
            filtered("mekf", world.motion, world.sensor, plots, settings={"order": order}), truth
        )
        for order in orders
    ]
    for other in others:
        for channel, values in first.items():
            ratio = other[channel] / values
            assert np.median(ratio) == pytest.approx(1.0, abs=0.002)
            assert np.any(ratio != 1.0)  # the orders are not the same filter
