"""Sigma points: the textbooks' sums, two packages' filters, moments, what costs nothing, frames."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight import catalogue
from boresight.errors import UsageError
from boresight.filters import sigma
from boresight.filters.recursion import run_recursion
from boresight.lanes import Rate, Symmetric, Vector, reach, trace
from boresight.maths import Gaussian
from boresight.models.motion import ConstantVelocity, CoordinatedTurn
from boresight.models.sensors import Pose, Radar
from boresight.testing.worlds import tilted, turned
from laws.enrolled import PLANAR, PLANE, POLAR, SPACE, Entry, World
from oracles import filters as textbook
from oracles import peers

seeds = st.integers(0, 2**32)
RULES = ((1.0, 2.0, 0.0), (0.5, 2.0, 1.0), (0.1, 2.0, 0.0), (1.0, 0.0, -1.0))
WORLDS = (World(SPACE, POLAR), World(PLANE, PLANAR))
worlds = pytest.mark.parametrize("world", WORLDS, ids=str)
SIGMA = ("ukf", "ckf", "iplf", "ckf-spherical")


def named(rule):
    return dict(zip(("alpha", "beta", "kappa"), rule, strict=True))


def drawn(world, seed):
    """A prior ahead of the sensor, away from the seam, and a plot of a target near it."""
    mean, cov = world.prior(seed)
    mean[0] = abs(mean[0]) + 5e3
    spread = np.square([getattr(world.sensor, name) for name in ("range_m", "azimuth_deg")])
    spread = [*spread, world.sensor.elevation_deg**2] if world.motion.dims == 3 else spread
    R = np.diag(spread) * np.array([1.0, *[np.radians(1.0) ** 2] * (world.motion.dims - 1)])
    return mean, cov, world.plot(mean + np.linalg.cholesky(cov)[:, 0], seed), R


def close(ours, theirs, rtol=1e-9):
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=rtol * np.max(np.abs(b)))


@worlds
@pytest.mark.parametrize("rule", RULES, ids=str)
@given(seed=seeds)
def test_unscented_update_is_the_weighted_sums(world, rule, seed):
    mean, cov, z, R = drawn(world, seed)
    post = Entry("ukf", named(rule)).update(world, mean, cov, z)
    expected = peers.unscented_update(
        mean, cov, z, R, lambda x: textbook.polar(x[: world.motion.dims]), rule
    )
    close((post.mean, post.cov, post.nis, post.loglik), expected, 1e-8 if rule[0] < 0.5 else 1e-9)


@worlds
@given(seed=seeds)
def test_cubature_update_is_the_textbook(world, seed):
    mean, cov, z, R = drawn(world, seed)
    post = Entry("ckf").update(world, mean, cov, z)
    expected = peers.unscented_update(
        mean, cov, z, R, lambda x: textbook.polar(x[: world.motion.dims]), peers.CUBATURE
    )
    close((post.mean, post.cov, post.nis, post.loglik), expected)


@worlds
@pytest.mark.parametrize("iterations", [2, 3, 5])
@given(seed=seeds)
def test_posterior_linearisation_is_the_textbook(world, iterations, seed):
    mean, cov, z, R = drawn(world, seed)
    post = Entry("iplf", {"iterations": iterations}).update(world, mean, cov, z)
    expected = peers.posterior_linearisation(
        mean, cov, z, R, lambda x: textbook.polar(x[: world.motion.dims]), iterations
    )
    close((post.mean, post.cov), expected, 1e-7)  # the textbook inverts every covariance
    once = Entry("ckf").update(world, mean, cov, z)
    close((post.nis, post.loglik), (once.nis, once.loglik))  # those of the prediction


@worlds
@pytest.mark.parametrize("name", ["ukf", "ckf", "iplf"])
@given(seed=seeds)
def test_points_on_both_sides_of_180_degrees_are_neighbours(name, world, seed):
    """Half a turn of the world puts the seam of azimuths amid the points, and changes nothing."""
    mean, cov, z, _ = drawn(world, seed)
    mean[1] *= 1e-3
    z[1] = np.arctan2(mean[1], mean[0]) + 0.01
    half = np.diag([-1.0, -1.0, *[1.0] * (world.motion.dims - 2)])
    half = np.kron(np.eye(2), half)
    ahead = Entry(name).update(world, mean, cov, z)
    z[1] -= np.pi
    behind = Entry(name).update(world, half @ mean, half @ cov @ half, z)
    close((half @ behind.mean, half @ behind.cov @ half, behind.nis), (*ahead[:2], ahead.nis))


@pytest.mark.parametrize("lost", ["range_m", "azimuth_deg", "elevation_deg"])
@pytest.mark.parametrize("name", ["ukf", "ckf", "iplf"])
@given(seed=seeds)
def test_a_missing_component_is_one_that_the_sensor_does_not_have(name, lost, seed):
    """Where azimuths and ranges are correlated by curvature: known to 2 km only."""
    mean, cov, z, _ = drawn(World(SPACE, POLAR), seed)
    cov = 100.0 * cov
    i = ["range_m", "azimuth_deg", "elevation_deg"].index(lost)
    lacking = World(SPACE, replace(POLAR, **{lost: None}))
    without = Entry(name).update(lacking, mean, cov, np.delete(z, i))
    z[i] = np.nan
    close(Entry(name).update(World(SPACE, POLAR), mean, cov, z)[:5], without[:5])


@pytest.mark.parametrize("name", ["ukf", "ckf", "iplf"])
@given(seed=seeds, dt=st.floats(0.5, 8.0))
def test_a_motion_that_is_not_linear_is_predicted_by_points(name, seed, dt):
    world = World(CoordinatedTurn(accel_mps2=1.0, turn_accel_degps2=0.3), PLANAR)
    mean, cov = world.prior(seed)
    motion, rule = world.motion, (1.0, 2.0, 0.0) if name == "ukf" else peers.CUBATURE
    expected = peers.unscented_predict(
        mean, cov, lambda x: motion.move(x, dt), motion.noise(dt), rule
    )
    found = catalogue.lookup(name).method.predict(
        {"mean": mean, "cov": cov}, motion, world.sensor, dt
    )
    close((found["mean"], found["cov"]), expected)


FLIGHT = np.array([10e3, 5e3, 3e3, 100.0, 50.0, 5.0])
START = Gaussian(FLIGHT, np.diag([300.0**2] * 3 + [30.0**2] * 3))
R = np.diag(np.square([30.0, *np.radians([0.8, 0.6])]))


def thirty_plots():
    rng = np.random.default_rng(5)
    F, Q = textbook.discrete_velocity(1.0, SPACE.accel_mps2, 3)
    x, plots = FLIGHT, []
    for _ in range(30):
        x = F @ x
        plots.append(textbook.polar(x[:3]) + np.sqrt(np.diag(R)) * rng.normal(size=3))
    return F, Q, np.array(plots)


def our_means(name, plots, dt=1.0, motion=SPACE, **settings):
    recursion = catalogue.lookup(name).with_settings(**settings).recursion(motion, POLAR)
    return run_recursion(recursion, plots[None], dt, START, outputs=("mean",)).mean[0]


@pytest.mark.parametrize("rule", RULES[:3], ids=str)
def test_unscented_tracks_are_those_of_filterpy(rule):
    if not peers.available("filterpy"):
        pytest.skip("filterpy is not installed: it is in the extra `bench`")
    F, Q, plots = thirty_plots()
    theirs = peers.filterpy_unscented(*START, plots, F, Q, R, lambda x: textbook.polar(x[:3]), rule)
    close([our_means("ukf", plots, **named(rule))], [theirs])


def test_cubature_updates_are_those_of_filterpy():
    if not peers.available("filterpy"):
        pytest.skip("filterpy is not installed: it is in the extra `bench`")
    plots = np.tile(textbook.polar(FLIGHT[:3]) + np.sqrt(np.diag(R)), (10, 1))
    theirs = peers.filterpy_cubature(*START, plots, R, lambda x: textbook.polar(x[:3]))
    close([our_means("ckf", plots, dt=0.0)], [theirs])


def test_unscented_tracks_are_those_of_stone_soup_but_for_its_mean_of_angles():
    """It averages sines and cosines: third order in the angles, 3e-7 of the position here."""
    if not peers.available("stonesoup"):
        pytest.skip("Stone Soup is not installed: it is in the extra `bench`")
    F, Q, plots = thirty_plots()
    theirs = peers.stonesoup(*START, plots, F, Q, R, RULES[0])
    close([our_means("ukf", plots)], [theirs], 1e-6)


@given(seed=seeds)
def test_the_second_order_rule_has_the_moments_of_squares_and_is_positive(seed):
    """y = sum_j a_j u_j²: mean sum_j a_j, covariance 2 sum_j a_j a_j'; and positive for any s."""
    rng = np.random.default_rng(seed)
    A, spread = rng.normal(size=(2, 4)), rng.uniform(0.5, 3.0)
    for rule in (sigma.Rule(1.0, 1.0, -2.0), sigma.Rule(spread, 1.1 * spread**2, 0.0)):
        y = sigma.regress(lambda u: A @ (u * u), np.subtract, np.zeros(4), np.eye(4), rule)
        np.testing.assert_allclose(y.mean, A.sum(axis=1), atol=1e-12)
        assert np.linalg.eigvalsh(y.rest)[0] > 0.0
        if rule.kappa < 0.0:
            np.testing.assert_allclose(y.rest, 2.0 * A @ A.T, atol=1e-12)
    cubature = sigma.regress(
        lambda u: A @ (u * u), np.subtract, np.zeros(4), np.eye(4), sigma.Rule()
    )
    assert np.linalg.eigvalsh(cubature.rest)[0] > -1e-12


def test_reach_is_what_an_output_depends_on():
    assert reach(lambda x: np.array([x[0] * 2.0, x[2] + x[1], 3.0]), np.ones(5)) == [1, 3, 0]


def test_points_that_differ_in_velocity_alone_cost_nothing():
    """13 points are 7 places, and 5 of them differ seen from above: so many angles are computed."""
    components = POLAR.components(SPACE)

    def step(state, _):
        post = sigma.update(Gaussian(state["mean"], state["cov"]), np.ones(3), components)
        return {"mean": post.mean, "cov": post.cov}, {}

    state = {"mean": Vector(6), "cov": Symmetric(6)}
    program = trace(step, state=state, inputs={"unused": (Vector(1), Rate.EACH)}, outputs={})
    assert sum(op == "arctan2" for op, _ in program.nodes) == 7 + 5


@pytest.mark.parametrize("count", [None, 4])
@given(seed=seeds)
def test_regressing_again_changes_nothing_where_all_is_linear(count, seed):
    from laws.enrolled import LINEAR_WORLDS

    world = LINEAR_WORLDS[0]
    mean, cov = world.prior(seed)
    z = world.plot(mean, seed)
    once, more = (Entry("iplf", {"iterations": i}).update(world, mean, cov, z) for i in (1, count))
    close(more[:5], once[:5])


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("ukf", {"alpha": 0.0}),
        ("ukf", {"kappa": -6.0}),
        ("iplf", {"iterations": 0}),
        ("ckf", {"alpha": 1.0}),
        ("ckf-spherical", {"alpha": 1.0}),
    ],
)
def test_settings_that_mean_nothing_are_refused(name, settings):
    with pytest.raises(UsageError):
        our_means(name, thirty_plots()[2], **settings)


@pytest.mark.parametrize("name", SIGMA)
@pytest.mark.parametrize("prior_m", [1e3, 3e4])
def test_plots_a_hundred_million_times_sharper_than_the_start_leave_it_positive(name, prior_m):
    """Why there is no square-root form: none of 6,400 covariances ceases to be one."""
    sharp = Radar(range_m=1e-4, azimuth_deg=1e-7, elevation_deg=1e-7)
    still = ConstantVelocity(accel_mps2=1e-9, dims=3)
    rng = np.random.default_rng(7)
    x0 = np.array([3e4, 4e4, 5e3, 120.0, -90.0, 3.0])
    cov = np.diag([prior_m**2] * 3 + [300.0**2] * 3)
    path = x0 + np.outer(np.arange(1, 401), [*x0[3:], 0, 0, 0])
    z = np.stack([c.value(path.T) for c in sharp.components(still)], axis=-1)
    z = z + rng.normal(size=(16, 400, 3)) * [c.sigma for c in sharp.components(still)]
    start = Gaussian(x0 + 0.3 * rng.normal(size=(16, 6)) * np.sqrt(np.diag(cov)), cov)
    recursion = catalogue.lookup(name).recursion(still, sharp)
    found = run_recursion(recursion, z, 1.0, start, outputs=("mean", "cov", "status"))
    assert (found.status == 0).all()
    assert np.diagonal(found.cov[:, -1], axis1=1, axis2=2).max() < 1e-3


def flown(name, sensor, plots, start):
    """The start is where the target is at the first plot."""
    dt = np.array([[0.0, *[2.0] * (plots.shape[1] - 1)]])
    return run_recursion(catalogue.lookup(name).recursion(SPACE, sensor), plots, dt, start)


def looked_at(poses, path, seed=3):
    """Plots (1, steps, k) of a path (steps, 6) from a pose each; their noise is always the same."""
    rng = np.random.default_rng(seed)
    plots = []
    for pose, x in zip(poses, path, strict=True):
        parts = replace(POLAR, pose=pose).components(SPACE)
        plots.append([c.value(x) + c.sigma * rng.normal() for c in parts])
    return np.array([plots])


def as_one(poses):
    """Many poses as one that changes from step to step."""
    fields = ("position_m", "rotation", "velocity_mps")
    return Pose(**{f: np.stack([getattr(p, f) for p in poses])[None] for f in fields})


STEPS = np.arange(1, 21)
PATH = np.array([8e3, -6e3, 2e3, -150.0, 120.0, 10.0]) + 2.0 * STEPS[:, None] * np.array(
    [-150.0, 120.0, 10.0, 0.0, 0.0, 0.0]
)
BEFORE = Gaussian(PATH[0] + 50.0, START.cov)


@pytest.mark.parametrize("name", SIGMA)
def test_a_sensor_that_turns_where_it_stands_sees_the_same_track(name):
    """Acceptance 8: about its vertical axis, to and fro, and by half a turn in one step."""
    poses = [Pose(rotation=turned(0.3 * k if k % 4 else 0.3 * (k - 1) + np.pi)) for k in STEPS]
    still = [Pose() for _ in STEPS]
    there = flown(name, replace(POLAR, pose=as_one(poses)), looked_at(poses, PATH), BEFORE)
    fixed = flown(name, POLAR, looked_at(still, PATH), BEFORE)
    close((there.mean, there.cov, there.nis), (fixed.mean, fixed.cov, fixed.nis))


@pytest.mark.parametrize("name", SIGMA)
def test_a_platform_that_moves_with_its_world_sees_the_same_track(name):
    """Acceptance 8: all that moves moves with 200 m/s more, and the sensor is tilted in both."""
    drift = np.array([160.0, -120.0, 2.0])
    home = Pose(rotation=tilted(0.4, 0.2))
    moving = [replace(home, position_m=2.0 * k * drift, velocity_mps=drift) for k in STEPS]
    shift = np.concatenate([2.0 * STEPS[:, None] * drift, np.tile(drift, (len(STEPS), 1))], axis=1)
    start = Gaussian(BEFORE.mean + np.array([*2.0 * drift, *drift]), BEFORE.cov)
    plots = looked_at(moving, PATH + shift)
    there = flown(name, replace(POLAR, pose=as_one(moving)), plots, start)
    here = flown(name, replace(POLAR, pose=home), looked_at([home] * len(STEPS), PATH), BEFORE)
    close((there.mean - shift, there.cov, there.nis), (here.mean, here.cov, here.nis))
