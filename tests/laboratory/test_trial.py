"""One chunk of a study: its scores are those of the same runs simulated, filtered and measured."""

from dataclasses import replace

import numpy as np
import pytest

import boresight as bs
from boresight import catalogue
from boresight.errors import UsageError
from boresight.experiments import metrics
from boresight.experiments.scenario import Scenario, lookup, scenario_names
from boresight.experiments.sets import gospa, ospa
from boresight.filters.ekf import update
from boresight.filters.method import Filter, Outside
from boresight.filters.recursion import run_recursion
from boresight.laboratory import chunk
from boresight.laboratory.study import METRICS, Contender, Limits, Setting, Study
from boresight.laboratory.sums import Tree
from boresight.laboratory.trial import run_chunk, trial_of
from boresight.laboratory.trial_kernels import fused_kernel
from boresight.lanes import program, select
from boresight.maths import Gaussian
from boresight.models.motion import ConstantAcceleration, ConstantVelocity
from boresight.models.sensors import Radar

SEED, RUNS, SKIPPED = 5, 11, 3
SPACE = Scenario(
    name="space",
    motion=ConstantVelocity(accel_mps2=2.0),
    sensor=Radar(range_m=30.0, azimuth_deg=0.3, elevation_deg=0.4, range_rate_mps=1.0),
    initial=[40e3, -20e3, 8e3, -150.0, 90.0, 0.0],
    prior_cov=np.diag([1e6, 1e6, 1e6, 1e4, 1e4, 1e4]),
    scans=12,
)


def cell(scenario=SPACE, name="ekf", *, motion=None, sensor=None, gate=None, **study):
    """What `run_chunk` takes, for one contender."""
    contender = Contender(
        label="it",
        filter=catalogue.lookup(name) if isinstance(name, str) else name,
        motion=motion or scenario.motion,
        sensor=sensor or scenario.sensor,
        gate=gate,
    )
    setting = Setting(scenario=scenario, contenders=(contender,))
    given = {"metrics": METRICS, "first_scan": SKIPPED, "limits": Limits(converged_m=300.0)} | study
    return Study(name="s", settings=(setting,), runs=99, seed=SEED, **given), setting, contender


def measured(scenario, name, *, first=0, runs=RUNS, **split):
    """The same runs by the other road: estimate, truth and NEES."""
    truth, plots = bs.simulate(scenario, runs=runs, seed=SEED, first=first, **split)
    outputs = ("mean", "cov", "nis", "dof")
    estimate = bs.run(name, scenario.motion, scenario.sensor, plots, outputs=outputs)
    return estimate, truth, metrics.nees(estimate, truth) / truth.states.shape[2]


def assert_same(scores, estimate, truth, nees, rtol=1e-9, metre=1.0):
    """Every usual score is what `metrics` says of the same runs, whose lengths are `metre` m."""
    runs, sums = scores.runs, Tree(scores.nodes).total
    scored, close = slice(SKIPPED, None), {"rtol": rtol, "atol": 1e-12}
    error = metrics.errors(estimate, truth)
    position = metre**2 * metrics.squared_error(estimate, truth)
    at = metrics.elements(truth.names, "position")
    claimed = metre**2 * np.trace(estimate.cov[..., at, :][..., at], axis1=-2, axis2=-1)
    np.testing.assert_allclose(runs["position_sq_m2"], position[:, scored].mean(1), **close)
    np.testing.assert_allclose(runs["final_m"], np.sqrt(position[:, -1]), **close)
    np.testing.assert_allclose(runs["nees"], nees[:, scored].mean(1), rtol=100 * rtol)
    np.testing.assert_allclose(runs["nis"], estimate.nis[:, scored].sum(1), **close)
    np.testing.assert_array_equal(runs["dof"], estimate.dof[:, scored].sum(1))
    scale = np.abs(error).sum(0) + np.abs(truth.states).max() * 1e-6
    np.testing.assert_array_less(np.abs(sums["error"] - error.sum(0)), rtol * scale)
    np.testing.assert_allclose(sums["position_sq_m2"], position.sum(0), **close)
    np.testing.assert_allclose(sums["distance_m"], np.sqrt(position).sum(0), **close)
    np.testing.assert_allclose(sums["nees"], nees.sum(0), rtol=100 * rtol)
    np.testing.assert_allclose(sums["nis"], estimate.nis.sum(0), **close)
    np.testing.assert_array_equal(sums["dof"], estimate.dof.sum(0))
    np.testing.assert_allclose(sums["claimed_m2"], claimed.sum(0), **close)
    if any(name.startswith("vx") for name in truth.names):
        velocity = metrics.squared_error(estimate, truth, "velocity")
        np.testing.assert_allclose(runs["velocity_sq_m2ps2"], velocity[:, scored].mean(1), **close)
        np.testing.assert_allclose(sums["velocity_sq_m2ps2"], velocity.sum(0), **close)
    else:
        assert np.isnan(runs["velocity_sq_m2ps2"]).all()
        assert np.isnan(sums["velocity_sq_m2ps2"]).all()


@pytest.mark.parametrize("name", ["ekf", "mekf", "mgekf", "ckf"])
@pytest.mark.parametrize("scenario", scenario_names())
def test_scores_are_the_metrics_of_the_same_runs(scenario, name):
    world = replace(lookup(scenario), scans=20) if "kashyap" in scenario else lookup(scenario)
    scores = run_chunk(*cell(world, name), 2, RUNS)
    metre = 1000.0 if world.length_unit == "km" else 1.0
    assert_same(scores, *measured(world, name, first=2), rtol=1e-8, metre=metre)


@pytest.mark.parametrize("name", ["ekf", "ukf", "mekf"])
@pytest.mark.parametrize("begin", ["given", "random draw", "one plot", "two plots"])
def test_in_one_kernel_or_in_three_the_scores_are_the_same(monkeypatch, name, begin):
    asked = cell(replace(SPACE, begin=begin, detection=0.8, bias={"range_m": 40.0}), name)
    fused = run_chunk(*asked, 0, RUNS)
    monkeypatch.setattr(chunk.Chunk, "fused", None)
    apart = run_chunk(*asked, 0, RUNS)
    for one, other in (
        (fused.runs, apart.runs),
        (Tree(fused.nodes).total, Tree(apart.nodes).total),
    ):
        assert set(one) == set(other)
        for key in one:
            size = np.max(np.abs(other[key][np.isfinite(other[key])]), initial=0.0)
            np.testing.assert_allclose(one[key], other[key], rtol=1e-9, atol=1e-9 * size)


def test_what_is_too_large_for_one_kernel_runs_in_three(monkeypatch):
    asked = cell(SPACE)
    whole = chunk.Chunk(*asked, trial_of(*asked)).fused.program.operations
    fused_kernel.cache_clear()
    monkeypatch.setattr(program, "LARGEST", whole - 1)
    assert chunk.Chunk(*asked, trial_of(*asked)).fused is None
    assert_same(run_chunk(*asked, 0, RUNS), *measured(SPACE, "ekf"))


@pytest.mark.parametrize("apart", [False, True], ids=["fused", "apart"])
@pytest.mark.parametrize("size", [1, 7, 100])
def test_a_run_and_a_sum_are_the_same_bits_in_every_chunk(monkeypatch, size, apart):
    if apart:
        monkeypatch.setattr(chunk.Chunk, "fused", None)
    asked = cell(replace(SPACE, begin="one plot"))
    whole = run_chunk(*asked, 0, 40)
    tree = Tree()
    for first in reversed(range(0, 40, size)):
        part = run_chunk(*asked, first, min(size, 40 - first))
        tree.add(part.nodes)
        for name, values in whole.runs.items():
            assert np.array_equal(part.runs[name], values[first : first + size]), name
    assert [(n.level, n.index) for n in tree.nodes] == [(n.level, n.index) for n in whole.nodes]
    for name, values in Tree(whole.nodes).total.items():
        assert np.array_equal(tree.total[name], values), name


@pytest.mark.parametrize("apart", [False, True], ids=["fused", "apart"])
def test_batches_and_stretches_of_a_chunk_do_not_show(monkeypatch, apart):
    if apart:
        monkeypatch.setattr(chunk.Chunk, "fused", None)
    asked = cell(replace(SPACE, begin="two plots"))
    whole = run_chunk(*asked, 3, 70)
    monkeypatch.setattr(chunk.Chunk, "lanes", 16)
    monkeypatch.setattr(chunk.Chunk, "_room", 80)  # stretches of 5 scans
    cut = run_chunk(*asked, 3, 70)
    for name, values in whole.runs.items():
        assert np.array_equal(cut.runs[name], values), name
    for name, values in Tree(whole.nodes).total.items():
        assert np.array_equal(Tree(cut.nodes).total[name], values), name


@pytest.mark.parametrize(("truth", "noise"), [("one", "each"), ("each", "one"), ("one", "one")])
def test_one_truth_or_one_noise_is_that_of_run_0(truth, noise):
    split = {"truth_run": 0 if truth == "one" else None, "noise_run": 0 if noise == "one" else None}
    scores = run_chunk(*cell(SPACE, truth=truth, noise=noise), 4, RUNS)
    assert_same(scores, *measured(SPACE, "ekf", first=4, **split))
    assert (len(set(scores.runs["final_m"])) == 1) is (truth == noise == "one")


def test_further_metrics_are_those_of_the_library():
    limits = Limits(converged_m=120.0, cutoff_m=150.0, order=1.5)
    behind = replace(SPACE, initial=[-40e3, 100.0, 8e3, -15.0, 9.0, 0.0])  # azimuths of half a turn
    scores = run_chunk(*cell(behind, limits=limits), 0, 40)
    estimate, truth, _ = measured(behind, "ekf", runs=40)
    runs, sums = scores.runs, Tree(scores.nodes).total
    fits = metrics.percent_fit_error(estimate, truth, scans=slice(SKIPPED, None))
    assert len(fits) == 6
    for channel, expected in fits.items():
        np.testing.assert_allclose(runs[f"fit_error_{channel}"], expected, rtol=1e-9)
    distance = np.sqrt(metrics.squared_error(estimate, truth))
    since = [next((s for s in range(13) if (d[s:] < 120.0).all()), 12) for d in distance]
    assert 5 < np.sum(np.array(since) < 12) < 40
    np.testing.assert_array_equal(runs["converged_scan"], since)
    error = metrics.errors(estimate, truth)
    outer = np.einsum("rsi,rsj->sij", error, error)
    np.testing.assert_allclose(sums["error_outer"], outer, rtol=1e-8, atol=1e-9 * np.max(outer))
    given = {"cutoff_m": 150.0, "order": 1.5}
    sets = truth.states[..., None, :3], estimate.mean[..., None, :3]
    apart, parts = ospa(*sets, **given), gospa(*sets, **given)
    assert 0 < np.sum(parts.missed_count) < 40 * 12
    np.testing.assert_allclose(sums["ospa_m"], apart.distance.sum(0), rtol=1e-9)
    np.testing.assert_allclose(sums["gospa_m"], parts.distance.sum(0), rtol=1e-9)
    np.testing.assert_allclose(runs["gospa_m"], parts.distance[:, SKIPPED:].mean(1), rtol=1e-9)
    for name in ("localisation", "missed", "false"):
        powers = getattr(parts, name) ** 1.5
        np.testing.assert_allclose(sums[f"gospa_{name}"], powers.sum(0), rtol=1e-9)


def test_a_track_that_says_it_is_lost_is_missed_by_sets():
    found = {}
    for lost in (1e9, 1e-3):
        limits = Limits(cutoff_m=1e6, order=2.0, lost_m=lost)
        found[lost] = Tree(run_chunk(*cell(SPACE, limits=limits), 0, 8).nodes).total
    np.testing.assert_allclose(found[1e-3]["gospa_m"], 8 * 1e6 / np.sqrt(2.0))
    np.testing.assert_allclose(found[1e-3]["ospa_m"], 8 * 1e6)
    np.testing.assert_allclose(found[1e9]["ospa_m"], found[1e9]["distance_m"])


def lost_beyond(limit_m):
    """An EKF that loses its target as soon as a range is above a limit."""

    def formula(prior, z, components):
        post = update(prior, z, components)
        mean = [select(z[0] > limit_m, np.nan, x) for x in post.mean]
        return post._replace(mean=np.array(mean))

    return Filter(name="loser", formula=formula)


def test_a_run_that_diverges_is_counted_and_stays_by_itself():
    _, plots = bs.simulate(SPACE, runs=RUNS, seed=SEED)
    limit = np.sort(np.max(plots.z[..., 0], axis=1))[-2]
    is_lost = np.max(plots.z[..., 0], axis=1) > limit
    assert is_lost.sum() == 1
    scores = run_chunk(*cell(SPACE, lost_beyond(limit), first_scan=0), 0, RUNS)
    sound = run_chunk(*cell(SPACE, "ekf", first_scan=0), 0, RUNS)
    for name in ("position_sq_m2", "velocity_sq_m2ps2", "nees", "final_m", "fit_error_range"):
        assert np.array_equal(np.isinf(scores.runs[name]), is_lost), name
        np.testing.assert_allclose(scores.runs[name][~is_lost], sound.runs[name][~is_lost], 1e-9)
    for name, values in Tree(scores.nodes).total.items():
        assert not np.isnan(values).any(), name
        if name in ("error", "position_sq_m2", "distance_m", "nees"):
            assert np.isinf(values[-1]).all(), name


def test_a_covariance_that_is_not_positive_is_infinitely_sure():
    def formula(prior, z, components):
        post = update(prior, z, components)
        return post._replace(cov=post.cov - np.diag([1e9, 0.0, 0.0, 0.0, 0.0, 0.0]))

    scores = run_chunk(*cell(SPACE, Filter(name="negative", formula=formula)), 0, RUNS)
    assert np.isinf(scores.runs["nees"]).all()


def ekf_by_hand(z, dt, start, motion, sensor):
    """The catalogue's EKF, called as a user's function would be."""
    recursion = catalogue.lookup("ekf").recursion(motion, sensor)
    estimate = run_recursion(recursion, z, dt, start, outputs=("mean", "cov"))
    return estimate.mean, estimate.cov


@pytest.mark.parametrize("begin", ["given", "one plot"])
def test_a_function_competes_as_a_filter_does(begin):
    world = replace(SPACE, begin=begin, detection=0.9)
    scores = run_chunk(*cell(world, Outside(name="mine", function=ekf_by_hand)), 1, RUNS)
    sound = run_chunk(*cell(world, "ekf"), 1, RUNS)
    np.testing.assert_allclose(scores.runs["nees"], sound.runs["nees"], rtol=1e-8)
    np.testing.assert_allclose(scores.runs["position_sq_m2"], sound.runs["position_sq_m2"], 1e-9)
    assert not scores.runs["dof"].any()  # of its innovations a function tells nothing


def test_a_contender_may_believe_in_other_states_and_ignore_components():
    motion = ConstantAcceleration(jerk_mps3=0.5)
    radar = Radar(elevation_deg=0.4, range_m=30.0, azimuth_deg=0.3)
    scores = run_chunk(*cell(SPACE, motion=motion, sensor=radar), 0, RUNS)
    truth, plots = bs.simulate(SPACE, runs=RUNS, seed=SEED)
    start = Gaussian(
        np.pad(plots.prior.mean, ((0, 0), (0, 3))),
        np.diag([*np.diag(SPACE.prior_cov), *[10.0**2] * 3]),
    )
    estimate = bs.run("ekf", motion, radar, plots.z[..., :3], dt=plots.dt, start=start)
    same = estimate.mean[..., :6] - truth.states
    position = np.sum(same[..., :3] ** 2, axis=-1)
    np.testing.assert_allclose(
        scores.runs["position_sq_m2"], position[:, SKIPPED:].mean(1), rtol=1e-9
    )
    inverse = np.linalg.inv(estimate.cov[..., :6, :6])
    nees = np.einsum("rsi,rsij,rsj->rs", same, inverse, same) / 6
    np.testing.assert_allclose(scores.runs["nees"], nees[:, SKIPPED:].mean(1), rtol=1e-6)


def test_among_false_plots_the_nearest_is_taken():
    """The same targets and noises in all three, so medians differ by what association costs."""
    world = replace(SPACE, begin="two plots", detection=0.9, false_plots=2.0, coverage_m=6e4)
    clear = replace(world, false_plots=0.0)
    scores = run_chunk(*cell(world, gate=20.0), 0, 64)
    alone = run_chunk(*cell(clear, gate=20.0), 0, 64)
    plain = run_chunk(*cell(clear), 0, 64)
    median = [np.median(s.runs["position_sq_m2"]) for s in (scores, alone, plain)]
    assert median[0] < 1.2 * median[1] < 1.5 * median[2]
    assert np.sum(alone.runs["dof"]) <= np.sum(plain.runs["dof"])


def test_what_cannot_be_run_is_refused_in_a_sentence():
    cluttered = replace(SPACE, false_plots=2.0, coverage_m=6e4)
    with pytest.raises(UsageError, match="cannot tell the target's plot from false ones"):
        run_chunk(*cell(cluttered), 0, 1)
    with pytest.raises(UsageError, match="false ones"):
        run_chunk(*cell(cluttered, Outside(name="mine", function=ekf_by_hand), gate=16.0), 0, 1)
    with pytest.raises(UsageError, match="needs cone_rad"):
        run_chunk(*cell(SPACE, sensor=Radar(cone_deg=1.0)), 0, 1)
    with pytest.raises(UsageError, match="last of 12 scans"):
        run_chunk(*cell(SPACE, first_scan=12), 0, 1)
