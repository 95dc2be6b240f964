"""Studies against what is known of them otherwise: units, lost tracks, filters that are equal."""

from dataclasses import replace

import numpy as np
import pytest
from worlds_of_study import LINEAR, MILD, contender, study_of, world

import boresight as bs
from boresight import catalogue
from boresight.experiments.scenario import lookup
from boresight.laboratory.comparing import compared
from boresight.laboratory.study import Contender, Limits
from boresight.laboratory.study_file import study_from
from boresight.laboratory.trial import told_again


def simulated(study, j=0):
    """Truth, and what a contender says of it: positions, and the variance that it claims."""
    (setting,) = study.settings
    truth, told = told_again(study, setting, setting.contenders[j], study.runs)
    d = setting.scenario.motion.dims
    claims = np.trace(told["cov"][..., :d, :d], axis1=-2, axis2=-1)
    return truth[..., :d], told["mean"][..., :d], claims


def test_a_world_in_kilometres_is_told_in_metres():
    scenario = lookup("aditya")
    assert scenario.length_unit == "km"
    own = Contender(
        label="ekf",
        filter=catalogue.lookup("ekf"),
        motion=scenario.motion,
        sensor=scenario.sensor,
    )
    metrics = ("rmse", "bias", "bound", "gospa", "convergence", "rsspe")
    limits = Limits(cutoff_m=100.0, converged_m=150.0, lost_m=130.0)
    study = study_of(scenario, own, runs=24, metrics=metrics, limits=limits)
    (cell,) = bs.compare(study).cells
    truth_km, found_km, claims_km2 = simulated(study)
    error = 1000.0 * (found_km - truth_km)
    distance = np.linalg.norm(error, axis=-1)
    assert cell.position_rmse_m.value == pytest.approx(np.sqrt(np.mean(distance**2)))
    assert cell.extra["rsspe_m"] == pytest.approx(np.mean(distance))
    shown = (1e6 * claims_km2 <= 130.0**2)[..., None]
    assert 0.05 < np.mean(shown) < 0.95
    sets = 1000.0 * truth_km[:, :, None], np.where(shown, 1000.0 * found_km, np.nan)[:, :, None]
    expected = bs.gospa(*sets, cutoff_m=100.0).distance
    assert cell.extra["gospa_m"].value == pytest.approx(np.mean(expected))
    assert cell.extra["converged"].value == pytest.approx(np.mean(distance[:, -1] < 150.0))
    mean = error.mean(axis=0)[cell.extra["bias_scan"]]
    assert cell.extra["bias_m"] == pytest.approx(np.linalg.norm(mean))
    assert 0.5 < cell.ratio_to_bound < 2.0
    np.testing.assert_allclose(
        np.sqrt(np.mean(cell.per_scan["bound_m2"])), cell.pcrlb_m, rtol=1e-12
    )
    assert cell.pcrlb_information_m == pytest.approx(cell.pcrlb_m, rel=0.1)


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
def test_of_a_lost_track_the_target_is_missed_and_nothing_is_false(order):
    limits = Limits(cutoff_m=35.0, lost_m=26.0, order=order)
    sight = world(LINEAR, scans=12, detection=0.6)
    own = contender("kf", LINEAR)
    study = study_of(sight, own, runs=32, metrics=("ospa", "gospa"), limits=limits)
    (cell,) = bs.compare(study).cells
    truth, found, claims = simulated(study)
    shown = (claims <= 26.0**2)[..., None]
    assert 0.2 < np.mean(shown) < 0.8
    sets = truth[:, :, None], np.where(shown, found, np.nan)[:, :, None]
    full = bs.gospa(*sets, cutoff_m=35.0, order=order)
    assert cell.extra["gospa_m"].value == pytest.approx(np.mean(full.distance))
    assert cell.extra["missed"] == pytest.approx(np.mean(full.missed_count))
    assert cell.extra["false"] == pytest.approx(np.mean(full.false_count))
    assert 0.0 < cell.extra["false"] < cell.extra["missed"]
    for part in ("localisation", "missed", "false"):
        power = np.mean(getattr(full, part) ** order)
        assert cell.extra[f"gospa_{part}_m"] == pytest.approx(power ** (1 / order)), part
    flat = bs.ospa(*sets, cutoff_m=35.0, order=order)
    assert cell.extra["ospa_m"].value == pytest.approx(np.mean(flat.distance))


@pytest.mark.parametrize(("by", "wins"), [(1e-13, False), (1e-10, False), (1e-6, True)])
def test_two_forms_of_one_filter_do_not_win_by_rounding(by, wins):
    """The one form's errors are larger in every run, and by no more than rounding."""
    study = study_of(world(LINEAR, scans=6), contender("kf", LINEAR), runs=20, metrics=("rmse",))
    (cell,) = bs.compare(study).cells
    position, squares = cell.position_rmse_m, cell.per_run["position_sq_m2"]
    other = replace(
        cell,
        label="other",
        position_rmse_m=position._replace(value=position.value * (1.0 + by)),
        per_run={"position_sq_m2": squares * (1.0 + by) ** 2},
    )
    (found,) = compared([other, cell], 0.01)
    assert (found.better, found.other) == ("kf", "other")
    assert found.ratio.high < 1.0
    assert found.is_win is wins


def test_filters_that_believe_alike_but_for_how_often_it_changes():
    """A number for every scan is another input of a kernel than one for all of them."""
    scans = 10
    sigmas = {"constant": 20.0, "each scan": np.full((1, scans), 20.0)}
    own = [contender("ekf", replace(MILD, range_m=x), name) for name, x in sigmas.items()]
    study = study_of(world(MILD, scans=scans), *own, runs=16, metrics=("rmse",))
    one, other = bs.compare(study).cells
    np.testing.assert_allclose(
        one.per_run["position_sq_m2"], other.per_run["position_sq_m2"], rtol=1e-9
    )


def test_a_sweep_of_one_filter_by_its_label_leaves_the_others():
    filters = [{"name": "ekf"}, {"name": "ekf", "label": "cautious"}]
    swept = {"filter.cautious.noise_scale": [1.0, 4.0]}
    study = study_from({"scenario": "kashyap-set-4", "filter": filters, "sweep": swept})
    sigmas = [[c.sensor.range_m for c in each.contenders] for each in study.settings]
    assert sigmas == [[30.0, 30.0], [30.0, 60.0]]
