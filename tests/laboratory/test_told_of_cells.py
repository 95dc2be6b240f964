"""What a study tells of its cells, against the same computed from every run's own numbers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from worlds_of_study import LINEAR, MILD, MOTION, contender, study_of, world

import boresight as bs
from boresight.experiments.bounds import average_in_covariance, bound_per_trajectory
from boresight.experiments.credibility import credibility
from boresight.laboratory import credible
from boresight.laboratory.comparing import ranking
from boresight.laboratory.gather import Tally
from boresight.laboratory.result import Comparison, Interval
from boresight.laboratory.study import Limits, Setting
from boresight.laboratory.summary import summarise
from boresight.laboratory.trial import run_chunk, told_again


def told(study):
    """The truth, and what the only contender says of it, by name."""
    (setting,) = study.settings
    return told_again(study, setting, setting.contenders[0], study.runs)


def only(study):
    """The only cell."""
    (cell,) = bs.compare(study, workers=1).cells
    return cell


def test_the_bias_of_a_biased_sensor():
    """At one scan, of one coordinate, the figure is that of Student's t."""
    skipped, runs = 4, 21
    sight = world(LINEAR, scans=9, bias={"x_m": 60.0})
    study = study_of(sight, contender("kf", LINEAR), runs=runs, first_scan=skipped)
    cell = only(study)
    truth, said = told(study)
    error = said["mean"] - truth
    mean, spread = error.mean(axis=0), error.var(axis=0, ddof=1)
    away = np.linalg.norm(mean[:, :2], axis=1) / np.sqrt(spread[:, :2].sum(axis=1) / runs)
    clearest = skipped + np.argmax(away[skipped:])
    assert cell.extra["bias_scan"] == clearest
    assert cell.extra["bias_standard_errors"] == pytest.approx(away[clearest])
    assert cell.extra["bias_m"] == pytest.approx(np.linalg.norm(mean[clearest, :2]))
    limit = stats.t.ppf(1 - 0.01 / (2 * 5), runs - 1)
    assert limit < away[clearest]
    assert cell.extra["bias_limit"] == pytest.approx(limit)
    for i, name in enumerate(MOTION.names):
        assert cell.extra[f"bias_{name}"] == pytest.approx(mean[skipped:, i].mean(), rel=1e-6)


def test_actual_errors_are_those_of_all_runs_and_claims_of_the_first_ones(monkeypatch):
    monkeypatch.setattr(credible, "_RUNS", 12)
    study = study_of(
        world(MILD, scans=6), contender("ekf", MILD), runs=40, metrics=("noncredibility",)
    )
    cell = only(study)
    truth, said = told(study)
    error = said["mean"] - truth
    actual = np.einsum("rsi,rsj->sij", error, error) / 40
    first, covs = error[:12], said["cov"][:12]
    claimed = np.einsum("rsi,rsi->rs", first, np.linalg.solve(covs, first[..., None])[..., 0])
    should = np.einsum("rsi,sij,rsj->rs", first, np.linalg.inv(actual), first)
    level = 10 * np.log10(claimed / should)
    assert cell.extra["noncredibility_db"] == pytest.approx(np.mean(np.abs(level)), rel=1e-6)
    assert cell.extra["inclination_db"] == pytest.approx(np.mean(level), rel=1e-5)


def test_chance_alone_has_the_index_that_the_number_of_runs_gives():
    """A linear filter's claims are alike in all runs: about 4.9 / sqrt(runs) dB."""
    study = study_of(
        world(LINEAR, scans=40), contender("kf", LINEAR), runs=400, metrics=("noncredibility",)
    )
    found = only(study).extra["noncredibility_credible_db"]
    assert found == pytest.approx(4.9 / np.sqrt(400), rel=0.2)


def test_the_bound_s_standard_error_is_that_of_its_trajectories():
    """The jackknife, which leaves out one trajectory at a time."""
    sight = world(MILD, scans=25, detection=0.6)
    study = study_of(sight, contender("ekf", MILD), runs=30, metrics=("rmse", "bound"))
    cell = only(study)
    truth, plots = bs.simulate(sight, runs=30, seed=study.seed)
    bound = bound_per_trajectory(truth, plots, MOTION, MILD)
    of_runs = np.trace(bound[..., :2, :2], axis1=-2, axis2=-1).mean(axis=1)
    assert cell.pcrlb_m == pytest.approx(np.sqrt(of_runs.mean()))
    without = np.sqrt((of_runs.sum() - of_runs) / 29)
    jackknife = np.sqrt(29 / 30 * np.sum((without - without.mean()) ** 2))
    assert cell.extra["pcrlb_standard_error_m"] == pytest.approx(jackknife, rel=0.05)


def test_missed_plots_take_their_share_of_the_information():
    """A linear world has one bound: its own recursion in information form."""
    chance = 0.35
    sight = world(LINEAR, scans=10, detection=chance)
    study = study_of(sight, contender("kf", LINEAR), runs=5, metrics=("rmse", "bound"))
    cov, traces = sight.prior_cov, []
    F = np.eye(4) + np.eye(4, k=2)
    seen = np.diag([20.0**-2, 30.0**-2, 0.0, 0.0])
    for scan in range(10):
        before = F @ cov @ F.T + MOTION.noise(1.0) if scan else cov
        cov = np.linalg.inv(np.linalg.inv(before) + chance * seen)
        traces.append(np.trace(cov[:2, :2]))
    assert only(study).pcrlb_information_m == pytest.approx(np.sqrt(np.mean(traces)))


def test_starts_that_differ_are_averaged_in_information():
    poor = bs.Radar(range_m=20.0, azimuth_deg=20.0)
    sight = world(poor, scans=1, begin="one plot")
    study = study_of(sight, contender("ekf", poor), runs=20, metrics=("rmse", "bound"))
    _, plots = bs.simulate(sight, runs=20, seed=study.seed)
    cov = np.linalg.inv(np.mean(np.linalg.inv(plots.prior.cov), axis=0))
    assert np.trace(cov) < 0.9 * np.mean(np.trace(plots.prior.cov, axis1=1, axis2=2))
    found = only(study).pcrlb_information_m
    assert found == pytest.approx(np.sqrt(np.trace(cov[:2, :2])), rel=1e-9)


def test_a_claim_about_an_error_that_is_no_number_is_not_credible():
    errors, covs = np.ones((5, 2)) * np.arange(1.0, 6.0)[:, None], np.tile(np.eye(2), (5, 1, 1))
    errors[3] = np.inf
    found = credibility(errors, covs, np.eye(2))
    assert found == (np.inf, np.inf)


def test_of_one_truth_the_bound_is_that_truth_s():
    own, metrics = contender("ekf", MILD), ("rmse", "bound")
    sight = replace(world(MILD, scans=30), initial=[300.0, 200.0, -8.0, 3.0])
    one = only(study_of(sight, own, runs=12, truth="one", metrics=metrics))
    alone = only(study_of(sight, own, runs=1, metrics=metrics))
    each = only(study_of(sight, own, runs=12, metrics=metrics))
    assert one.pcrlb_m == pytest.approx(alone.pcrlb_m, rel=1e-9)
    assert one.pcrlb_m != pytest.approx(each.pcrlb_m, rel=1e-3)
    missing = study_of(replace(sight, detection=0.7), own, runs=12, truth="one", metrics=metrics)
    scenario = missing.settings[0].scenario
    truth, plots = bs.simulate(scenario, runs=12, seed=missing.seed, truth_run=0)
    bound = bound_per_trajectory(truth, plots, MOTION, MILD)
    cell = only(missing)
    assert cell.pcrlb_m == pytest.approx(average_in_covariance(bound, MOTION.names))
    assert np.isfinite(cell.extra["pcrlb_standard_error_m"])


def test_every_setting_has_its_own_bound():
    metrics = ("rmse", "bound")
    worlds = [world(LINEAR, scans=5), world(MILD, scans=5)]
    own = [(contender("ekf", LINEAR),), (contender("ekf", MILD),)]
    alone = [
        only(study_of(w, *c, runs=4, metrics=metrics)).pcrlb_m
        for w, c in zip(worlds, own, strict=True)
    ]
    settings = tuple(Setting(scenario=w, contenders=c) for w, c in zip(worlds, own, strict=True))
    both = replace(study_of(worlds[0], *own[0], runs=4, metrics=metrics), settings=settings)
    assert [cell.pcrlb_m for cell in bs.compare(both).cells] == alone
    assert alone[0] != pytest.approx(alone[1], rel=0.01)


@pytest.mark.parametrize(("split", "said"), [("truth", "one truth"), ("noise", "one noise")])
def test_what_all_runs_share_is_remarked(split, said):
    study = study_of(world(LINEAR, scans=4), contender("kf", LINEAR), runs=12, **{split: "one"})
    assert any(said in words for words in bs.compare(study).remarks)


def test_the_cost_is_that_of_a_run_and_scan():
    study = study_of(world(LINEAR, scans=5), contender("kf", LINEAR), runs=8, metrics=("rmse",))
    (setting,), tally = study.settings, Tally(8)
    for first in (0, 4):
        scores = run_chunk(study, setting, setting.contenders[0], first, 4)
        assert (scores.first, scores.count) == (first, 4)
        tally.add(replace(scores, seconds=3.0))
    (cell,) = summarise(study, [tally.gathered()]).cells
    assert cell.ns_per_step == pytest.approx(6.0 * 1e9 / (8 * 5))


def anywhere(normals):
    """Targets of all velocities."""
    return np.array([9000.0, 1000.0, 0.0, 0.0]) + 50.0 * normals


@pytest.mark.parametrize("split", ["truth", "noise"])
def test_where_targets_start_belongs_to_the_truth(split):
    sight = world(LINEAR, scans=3, draw=anywhere)
    study = study_of(sight, contender("kf", LINEAR), runs=9, **{split: "one"})
    starts, _ = told(study)
    assert len(set(starts[:, 0, 2])) == (1 if split == "truth" else 9)


def test_a_filter_in_the_plane_begins_below_a_target_in_space():
    """Of the start it takes the states that it has, each at its own place."""
    space, plane = bs.ConstantVelocity(accel_mps2=0.5), bs.ConstantVelocity(accel_mps2=0.5, dims=2)
    sensor = bs.Radar(range_m=20.0, azimuth_deg=0.1)
    known = [9000.0, 1000.0, 50.0, -80.0, 60.0, 5.0]
    sight = bs.Scenario(
        name="below",
        motion=space,
        sensor=sensor,
        initial=known,
        prior_cov=np.diag(np.square([1e-3] * 3 + [1e-3] * 3)),
        begin="given",
        scans=1,
    )
    study = study_of(sight, contender("ekf", sensor, motion=plane), runs=2, metrics=("rmse",))
    _, said = told(study)
    np.testing.assert_allclose(said["mean"][:, 0], [[9000.0, 1000.0, -80.0, 60.0]] * 2, rtol=1e-6)


def comparison(better, other, *, wins):
    return Comparison(0, better, other, Interval(0.9, 0.8, 0.95 if wins else 1.1), wins)


def test_places_are_shared_by_those_that_cannot_be_told_apart():
    own = [contender("kf", LINEAR, name) for name in "abc"]
    result = bs.compare(study_of(world(LINEAR, scans=3), *own, runs=10, metrics=("rmse",)))
    figures = {"a": (1.0, 30.0), "b": (1.1, 50.0), "c": (1.2, 20.0)}  # error, cost
    cells = tuple(
        replace(c, position_rmse_m=Interval(error, error, error), ns_per_step=cost)
        for c, (error, cost) in zip(result.cells, figures.values(), strict=True)
    )
    pairs = (
        comparison("a", "b", wins=False),
        comparison("a", "c", wins=True),
        comparison("b", "c", wins=False),
    )
    ranks = ranking(replace(result, cells=cells, comparisons=pairs), 0)
    assert [(r.label, r.place, r.is_efficient) for r in ranks] == [
        ("a", 1, True),
        ("b", 1, False),
        ("c", 2, True),
    ]


def test_of_an_even_number_of_runs_the_earlier_middle_one_converges():
    study = study_of(
        world(LINEAR, scans=20),
        contender("kf", LINEAR),
        runs=4,
        metrics=("convergence",),
        limits=Limits(converged_m=15.0),
    )
    seen = []
    for seed in range(8):
        cell = only(replace(study, seed=seed))
        times = np.append(study.settings[0].scenario.time_s, np.inf)
        middle = np.sort(times[cell.per_run["converged_scan"].astype(int)])[1:3]
        assert cell.extra["convergence_s"] == middle[0]
        seen.append(middle[0] != middle[1])
    assert any(seen)
