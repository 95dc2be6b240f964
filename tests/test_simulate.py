"""Truth and plots: repeatable run by run, and distributed as the models say."""

from dataclasses import replace

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.experiments.montecarlo import filtered, run_cell
from boresight.experiments.scenario import FOOT_M, lookup, paper, scenario_names
from boresight.experiments.simulate import simulate
from boresight.experiments.world import root_of
from boresight.filters.formula import Formula
from boresight.lanes import Scalar
from boresight.maths import random, wrap
from boresight.maths.seeds import Stream, normals
from boresight.models.coordinates import PositionSensor
from boresight.models.motion import ConstantVelocity, Static
from boresight.models.sensors import Radar

PAPERS_SCENARIOS = (
    "kashyap-set-1",
    "kashyap-set-2",
    "kashyap-set-4",
    "kashyap-10deg",
    "aditya",
    "aditya-r-as-printed",
    "bordonaro-static",
    "bordonaro-dynamic",
    "pradeep",
    "pradeep-straight",
    "pradeep-anywhere",
)


def same(a, b):
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def run(result, i):
    truth, plots = result
    return truth.states[i], plots.z[i], np.asarray(plots.prior.mean)[i]


def test_scenarios_are_those_of_the_papers():
    assert scenario_names() == PAPERS_SCENARIOS


@pytest.mark.parametrize("name", ["kashyap-set-2", "kashyap-set-4"])
def test_run_seven_of_ten_is_run_seven_of_a_thousand(name):
    few, many = (simulate(name, runs=runs, seed=3) for runs in (10, 1000))
    chunk = simulate(name, runs=2, seed=3, first=6)
    assert same(run(few, 7), run(many, 7))
    assert same(run(chunk, 1), run(many, 7))
    assert not same(run(few, 7), run(few, 6))


def test_aditya_repeats_too():
    few, many = (simulate("aditya", runs=runs, seed=3) for runs in (10, 100))
    assert np.array_equal(few[1].z[7], many[1].z[7])


def test_plots_are_made_of_the_numbers_of_their_run_scan_and_stream():
    """What is measured of the true place, and the noise that formulas draw for them."""
    world = lookup("kashyap-set-2")
    truth, plots = simulate(world, runs=3, seed=5)
    scans = np.arange(world.scans)
    drawn = random.normals(random.key(5, world.name), np.arange(3)[:, None], scans, Stream.NOISE, 3)
    for i, part in enumerate(world.sensor.components(world.motion)):
        value = np.apply_along_axis(part.value, -1, truth.states) + part.sigma * drawn[i]
        off = plots.z[..., i] - value
        np.testing.assert_allclose(wrap(off) if part.is_angle else off, 0.0, atol=1e-11)


def test_streams_cells_seeds_and_runs_are_independent():
    """Correlations of 50,000 pairs each: 5 standard deviations are 0.022."""
    sources = [normals(s, c, t, (25_000,), runs=2) for s in (1, 2) for c in "ab" for t in Stream]
    rows = np.concatenate(sources)
    correlation = np.corrcoef(rows)
    np.fill_diagonal(correlation, 0.0)
    assert np.max(np.abs(correlation)) < 5 / np.sqrt(25_000)


@pytest.mark.parametrize("bad", [{"seed": -1, "runs": 1}, {"seed": 2**64, "runs": 1}])
def test_seeds_out_of_range_are_refused(bad):
    with pytest.raises(UsageError, match="seed"):
        simulate("kashyap-set-2", **bad)


def test_no_runs_are_refused():
    with pytest.raises(UsageError, match="runs=0"):
        simulate("kashyap-set-2", runs=0, seed=1)


def test_an_unknown_scenario_is_answered_with_the_nearest():
    with pytest.raises(UsageError, match="kashyap-set-2"):
        simulate("kashyap-set2", runs=1, seed=1)


def test_truth_noise_and_start_do_not_share_their_numbers():
    """5,000 runs: 5 standard deviations of a correlation are 0.07."""
    world = lookup("kashyap-set-2")
    truth, plots = simulate(replace(world, scans=2), runs=5000, seed=6)
    offset = plots.prior.mean - world.initial
    pushes = (truth.states[:, 1] - truth.states[:, 0])[:, 3:]
    noise = plots.z[:, 0] - _polar(truth.states[:, 0])
    correlation = np.corrcoef(np.hstack([offset, pushes, noise]).T) - np.eye(12)
    assert np.max(np.abs(correlation)) < 0.07


def test_starts_are_drawn_as_the_scenario_says():
    """20,000 runs: 5 standard errors of a mean are 3.5 % of a standard deviation, of it 2.5 %."""
    truth, plots = simulate("bordonaro-dynamic", runs=20_000, seed=2)
    printed = paper("bordonaro")["settings"]["BO-S06"]
    position, velocity = truth.start[:, :2] / FOOT_M, truth.start[:, 2:] / FOOT_M
    middle, sd = printed["position_ft"], printed["position_sd_ft"]
    assert position.mean(axis=0) == pytest.approx(middle, abs=0.035 * sd)
    assert position.std(axis=0) == pytest.approx([sd, sd], rel=0.025)
    speed, sd = np.hypot(*velocity.T), printed["speed_sd_ftps"]
    assert speed.mean() == pytest.approx(printed["speed_ftps"], abs=0.035 * sd)
    assert speed.std() == pytest.approx(sd, rel=0.025)
    turned = velocity @ [1, 1j] / speed
    assert all(abs(np.mean(turned**k)) < 5 / np.sqrt(20_000) for k in (1, 2))
    assert np.array_equal(truth.states[:, 0], truth.start)
    assert plots.prior.cov[0, 2, 2] == pytest.approx((printed["start_speed_ftps"] * FOOT_M) ** 2)


def test_truth_does_not_depend_on_the_sensor_and_sensors_share_their_noise():
    sharp = Radar(range_m=3.0, azimuth_deg=0.15, elevation_deg=0.15)
    truth, plots = simulate("kashyap-set-2", runs=5, seed=1)
    other_truth, other = simulate("kashyap-set-2", sharp, runs=5, seed=1)
    assert np.array_equal(truth.states, other_truth.states)
    exact = _polar(truth.states)
    noise, tenth = plots.z[..., 0] - exact[..., 0], other.z[..., 0] - exact[..., 0]
    assert np.allclose(noise, 10 * tenth, atol=1e-9)


def _polar(states):
    x, y, z = np.moveaxis(states[..., :3], -1, 0)
    ground = np.hypot(x, y)
    return np.stack([np.hypot(ground, z), np.arctan2(y, x), np.arctan2(z, ground)], axis=-1)


def test_plots_are_truth_and_noise_of_the_stated_size():
    """300,000 numbers a channel: 5 standard errors of a standard deviation are 0.65 %."""
    truth, plots = simulate("kashyap-set-2", runs=600, seed=2)
    noise = plots.z - _polar(truth.states)
    noise[..., 1:] = np.angle(np.exp(1j * noise[..., 1:]))
    noise = noise.reshape(-1, 3) / [30.0, np.radians(1.5), np.radians(1.5)]
    assert np.allclose(noise.std(axis=0), 1.0, atol=0.0065)
    assert np.allclose(noise.mean(axis=0), 0.0, atol=5 / np.sqrt(len(noise)))
    assert np.max(np.abs(np.corrcoef(noise.T) - np.eye(3))) < 5 / np.sqrt(len(noise))
    assert np.all(np.abs(plots.z[..., 1:]) <= np.pi)


def test_truth_starts_exactly_and_moves_with_the_motions_noise():
    world = lookup("kashyap-set-2")
    truth, _ = simulate(world, runs=400, seed=3)
    x = truth.states
    assert np.array_equal(x[:, 0], np.broadcast_to(world.initial, x[:, 0].shape))
    pushes = x[:, 1:] - x[:, :-1]
    pushes[..., :3] -= x[:, :-1, 3:]
    rows = pushes.reshape(-1, 6)
    cov, count = rows.T @ rows / len(rows), len(rows)
    expected = world.motion.noise(1.0)
    assert np.allclose(cov, expected, atol=5 * 0.25 * np.sqrt(2 / count))
    # One acceleration moves position and velocity: nothing is added outside the range of G.
    assert np.max(np.abs(rows[:, :3] - 0.5 * rows[:, 3:])) < 1e-9


@pytest.mark.parametrize("discretisation", ["discrete", "continuous", "printed"])
def test_root_of_a_noise_is_exact_and_no_wider_than_its_rank(discretisation):
    noise = ConstantVelocity(accel_mps2=0.7, discretisation=discretisation).noise(0.3)
    root = root_of(noise)
    assert np.allclose(root @ root.T, noise, rtol=1e-12, atol=1e-15)
    assert root.shape[1] == np.linalg.matrix_rank(noise)


def test_a_target_without_noise_stays():
    world = replace(
        lookup("kashyap-set-2"),
        motion=Static(dims=3),
        sensor=PositionSensor(x_m=1.0, y_m=1.0, z_m=1.0),
        initial=np.array([1.0, 2.0, 3.0]),
        prior_cov=np.eye(3),
    )
    truth, plots = simulate(world, runs=3, seed=1)
    assert np.array_equal(truth.states, np.broadcast_to([1.0, 2.0, 3.0], truth.states.shape))
    assert plots.z.shape == truth.states.shape


def test_time_of_the_first_scan():
    kashyap, aditya = lookup("kashyap-set-2"), lookup("aditya")
    assert kashyap.time_s[0] == 0.0 == kashyap.dt[0, 0]
    assert kashyap.time_s[-1] == kashyap.scans - 1
    assert aditya.time_s[0] == aditya.dt_s == aditya.dt[0, 0]


def test_a_random_start_is_drawn_from_the_prior():
    """2,000 draws: 5 standard errors of a variance are 16 %."""
    world = lookup("kashyap-set-2")
    _, plots = simulate(world, runs=2000, seed=4)
    offset = plots.prior.mean - world.initial
    scaled = offset / np.sqrt(np.diag(world.prior_cov))
    assert np.allclose(np.cov(scaled.T), np.eye(6), atol=0.16)


@pytest.mark.parametrize(("begin", "used"), [("one plot", 1), ("two plots", 2)])
def test_a_start_from_plots_uses_them_once(begin, used):
    world = replace(lookup("kashyap-set-1"), begin=begin)
    truth, plots = simulate(world, runs=300, seed=5)
    assert np.all(np.isnan(plots.z[:, :used]))
    assert np.all(np.isfinite(plots.z[:, used:]))
    assert np.all(plots.dt[0, :used] == 0.0)
    assert np.all(plots.dt[0, used:] == world.dt_s)
    position = slice(0, 3)
    error = (plots.prior.mean - truth.states[:, used - 1])[:, position]
    cov = plots.prior.cov[:, position, position]
    square = np.einsum("ri,rij,rj->r", error, np.linalg.inv(cov), error) / 3
    assert np.mean(square) == pytest.approx(1.0, abs=5 * np.sqrt(2 / 900))
    found = filtered("ekf-sequential", world.motion, world.sensor, plots)
    assert np.all(np.isfinite(found.mean))


def test_a_start_on_a_bearing_has_the_range_of_the_scenario():
    world = lookup("pradeep")
    truth, plots = simulate(world, runs=300, seed=5)
    assert np.all(np.isnan(plots.z[:, 0]))
    assert np.linalg.norm(plots.prior.mean[:, :2], axis=1) == pytest.approx(world.range_m)
    angle = np.arctan2(plots.prior.mean[:, 1], plots.prior.mean[:, 0])
    off = np.degrees(angle - np.arctan2(truth.start[0, 1], truth.start[0, 0]))
    assert np.std(off) == pytest.approx(world.sensor.azimuth_deg, rel=5 / np.sqrt(600))
    assert np.all(np.isfinite(filtered("ekf", world.motion, world.sensor, plots).mean))
    with pytest.raises(UsageError, match="starts on a bearing, which range_m"):
        simulate(world, Radar(range_m=5.0), runs=2, seed=1)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"begin": "somehow"}, "begin='somehow'"),
        ({"initial": [1.0, 2.0]}, r"initial .* shape \(2,\)"),
        ({"prior_cov": np.eye(4)}, "prior_cov"),
        ({"scans": 0}, "scans=0"),
        ({"dt_s": -1.0}, "dt_s=-1.0"),
    ],
)
def test_a_scenario_that_cannot_be_is_refused(wrong, message):
    with pytest.raises(UsageError, match=message):
        replace(lookup("kashyap-set-1"), **wrong)


def test_formulas_of_the_same_shapes_are_told_apart():
    world = lookup("kashyap-set-2")
    shapes = {
        "motion": world.motion,
        "sensor": world.sensor,
        "state": (("x", Scalar()),),
        "inputs": (),
        "outputs": (("x", Scalar()),),
    }
    up, down = (
        Formula(step=lambda _m, _s, x, _i, d=d: ({"x": x["x"] + d},) * 2, **shapes)
        for d in (1.0, -1.0)
    )
    start = {"x": np.zeros(2)}
    assert up.run(start, {}, 3)["x"].tolist() == [[1.0, 2.0, 3.0]] * 2
    assert down.run(start, {}, 3)["x"].tolist() == [[-1.0, -2.0, -3.0]] * 2


def test_a_cell_is_simulated_and_filtered_and_does_not_depend_on_threads():
    one = run_cell("kashyap-set-2", "mekf", runs=20, seed=1)
    two = run_cell("kashyap-set-2", "mekf", runs=20, seed=1, threads=2)
    assert np.array_equal(one.estimate.mean, two.estimate.mean)
    assert one.ns_per_step > 0
    last = run_cell("kashyap-set-2", "mekf", runs=1, seed=1, first=19)
    assert np.array_equal(one.estimate.mean[19], last.estimate.mean[0])
