"""Laws of the line-of-sight filter: its moments, its moves, its parts, and platforms that move."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from boresight import catalogue
from boresight.errors import UsageError
from boresight.filters import line_of_sight_moments as closed
from boresight.filters import line_of_sight_plane as plane
from boresight.filters import line_of_sight_space as space
from boresight.filters.line_of_sight import LineOfSight
from boresight.filters.line_of_sight_mixture import normal_as
from boresight.filters.start import one_plot
from boresight.maths import Gaussian
from boresight.models.sensors import Pose, Radar
from boresight.testing.worlds import tilted, turned
from laws.enrolled import PLANAR, PLANE, POLAR_WORLDS, POSE, SPACE, World

MEAN = np.array([800.0, 2.1, 12.0, -20.0])
HIGH = np.array([8e3, 2.1, 0.6, 12.0, -120.0, 60.0])


def some_cov(sds, seed=3):
    """A covariance with these standard deviations and strong correlations."""
    root = np.tril(np.random.default_rng(seed).normal(size=(len(sds), len(sds))))
    root *= (np.array(sds) / np.linalg.norm(root, axis=1))[:, None]
    return root @ root.T


def averaged(f, mean, cov, nodes=14):
    """Mean and covariance of f(x), x normal, by Gauss-Hermite quadrature on a product grid."""
    x, w = np.polynomial.hermite_e.hermegauss(nodes)
    n = len(mean)
    grid = np.stack(np.meshgrid(*[x] * n, indexing="ij")).reshape(n, -1)
    weight = np.prod(np.stack(np.meshgrid(*[w / w.sum()] * n, indexing="ij")).reshape(n, -1), 0)
    y = f(mean[:, None] + np.linalg.cholesky(cov) @ grid)
    first = y @ weight
    off = y - first[:, None]
    return first, (off * weight) @ off.T


def flown(x, dt):
    """Straight flight for dt, from and to the frame of the line of sight in the plane."""
    r, angle, vr, vt = x
    v = (vr + 1j * vt) * np.exp(1j * angle)
    w = r * np.exp(1j * angle) + dt * v
    along = v * np.conj(w) / abs(w)
    return np.array([abs(w), angle + np.angle(w * np.exp(-1j * angle)), along.real, along.imag])


def flown_in_space(x, dt):
    """Range and radial velocity after straight flight, (2, ...)."""
    p = x[0] ** 2 + dt**2 * (x[3] ** 2 + x[4] ** 2 + x[5] ** 2) + 2 * dt * x[0] * x[3]
    r = np.sqrt(p)
    return np.array([r, (x[0] * x[3] + dt * (x[3] ** 2 + x[4] ** 2 + x[5] ** 2)) / r])


@pytest.mark.parametrize("angle_sd", [1e-7, 1e-3, 0.1, 0.5])
@pytest.mark.parametrize("bend", [(0.0, 0.0), (0.1, -0.02)])
def test_moments_in_the_plane_are_those_of_quadrature(angle_sd, bend):
    cov = some_cov([50.0, angle_sd, 9.0, 15.0])

    def place(x):
        square = (x[3] - MEAN[3]) ** 2 - cov[3, 3]
        turn = np.exp(1j * x[1])
        w, v = (x[0] + bend[0] * square) * turn, (x[2] + bend[1] * square + 1j * x[3]) * turn
        return np.array([w.real, w.imag, v.real, v.imag])

    mean, spread = averaged(place, MEAN, cov, nodes=22 if angle_sd > 0.1 else 14)
    told = closed.plane(closed.Part(MEAN, cov, np.array(bend)))
    sd = np.sqrt(np.diag(spread))
    np.testing.assert_allclose(told.mean / sd, mean / sd, atol=1e-8)
    np.testing.assert_allclose(told.cov / np.outer(sd, sd), spread / np.outer(sd, sd), atol=1e-8)


def test_unbiased_estimates_are_the_truth_on_average():
    """Estimates of MEAN, normal about it: the average of what is told of each."""
    cov = some_cov([50.0, 0.25, 9.0, 15.0])

    def told(estimates):
        parts = (closed.Part(x, cov, np.zeros(2)) for x in estimates.T)
        return np.array([closed.plane_mean(part, -1.0) for part in parts]).T

    mean, spread = averaged(told, MEAN, cov, nodes=9)
    sd = np.sqrt(np.diag(spread))
    np.testing.assert_allclose(mean / sd, plane.leave(MEAN) / sd, atol=1e-7)


def test_moments_in_space_are_those_of_quadrature_to_the_rule_s_order():
    """Angles of 0.1 rad: what fifth order leaves is below a thousandth of a standard deviation."""
    cov = some_cov([50.0, 0.1, 0.06, 20.0, 60.0, 40.0])
    mean, spread = averaged(space.leave, HIGH, cov, nodes=6)
    told = space.tell(closed.Part(HIGH, cov, np.zeros(2)))
    sd = np.sqrt(np.diag(spread))
    np.testing.assert_allclose(told.mean / sd, mean / sd, atol=1e-3)
    np.testing.assert_allclose(told.cov / np.outer(sd, sd), spread / np.outer(sd, sd), atol=2e-3)


def off_by(scale, frame):
    """How far the predicted mean is from quadrature, in standard deviations of scale 1."""
    if frame == "plane":
        sds, dt = np.array([20.0, 0.03, 5.0, 8.0]), 3.0
        exact, _ = averaged(lambda x: flown(x, dt), MEAN, some_cov(scale * sds))
        part = closed.Part(MEAN, some_cov(scale * sds), np.zeros(2))
        return (plane.move(part, dt, np.zeros((4, 4))).mean - exact) / sds
    sds, dt = np.array([50.0, 0.05, 0.03, 20.0, 120.0, 90.0]), 6.0
    exact, _ = averaged(lambda x: flown_in_space(x, dt), HIGH, some_cov(scale * sds), nodes=6)
    part = closed.Part(HIGH, some_cov(scale * sds), np.zeros(2))
    return (space.move(part, dt, np.zeros((6, 6))).mean[[0, 3]] - exact) / sds[[0, 3]]


@pytest.mark.parametrize("frame", ["plane", "space"])
def test_prediction_is_right_to_second_order(frame):
    """Half the spread leaves a sixteenth of the error, which a first-order term would not."""
    whole, half = (np.max(np.abs(off_by(scale, frame))) for scale in (1.0, 0.5))
    assert whole < 0.01
    assert half < whole / 10


@pytest.mark.parametrize("r", [800.0, 150.0])
def test_the_bend_is_the_parabola_of_the_transverse_velocity(r):
    """Range against the transverse velocity after a step, fitted over draws of that velocity."""
    mean = np.array([r, *MEAN[1:]])
    part = closed.Part(mean, np.diag([1e-8, 1e-16, 1e-8, 4.0]), np.zeros(2))
    moved = plane.move(part, 3.0, np.zeros((4, 4)))
    vt = np.random.default_rng(2).normal(mean[3], 2.0, 100_000)
    there, _, vr, after = flown(np.array([*np.tile(mean[:3, None], (1, len(vt))), vt]), 3.0)
    for bend, y in zip(moved.bend, (there, vr), strict=True):
        fit = np.polyfit(after - after.mean(), y, 3)
        assert bend == pytest.approx(fit[1], rel=0.02)


@pytest.mark.parametrize("frame", ["plane", "space"])
def test_no_time_changes_no_bit(frame):
    mean, f = (MEAN, plane) if frame == "plane" else (HIGH, space)
    n = len(mean)
    part = closed.Part(mean, some_cov([50.0, 0.1, 0.06, 20.0, 60.0, 40.0][:n]), np.array([1e-3, 0]))
    after = f.move(part, 0.0, np.zeros((n, n)))
    for got, was in zip(after, part, strict=True):
        np.testing.assert_array_equal(got, was)


@pytest.mark.parametrize(("parts", "off"), [(3, 5e-3), (5, 3.5e-3)])
def test_a_split_is_a_standard_normal(parts, off):
    offsets, weights, width = normal_as(parts)
    assert weights.sum() == pytest.approx(1.0, abs=1e-15)
    assert weights @ offsets**2 + width**2 == pytest.approx(1.0, abs=1e-15)
    x = np.linspace(-6, 6, 2001)[:, None]
    assert np.max(np.abs(norm.cdf((x - offsets) / width) @ weights - norm.cdf(x[:, 0]))) < off
    assert distance(offsets, weights, width) < 0.0252


def distance(offsets, weights, width):
    """Root mean square difference of the densities, over that of the standard normal."""

    def overlap(a, u, b, v, variance):
        gaps = np.subtract.outer(a, b)
        return u @ norm.pdf(gaps, scale=np.sqrt(variance)) @ v

    zero, one = np.zeros(1), np.ones(1)
    square = overlap(offsets, weights, offsets, weights, 2 * width**2)
    square += overlap(zero, one, zero, one, 2.0)
    square -= 2 * overlap(offsets, weights, zero, one, 1 + width**2)
    return np.sqrt(square / overlap(zero, one, zero, one, 2.0))


@pytest.mark.parametrize(
    ("parts", "guess"), [(3, [1.1395]), (5, [0.8368, 0.2481, 1.8027])], ids=str
)
def test_no_other_split_of_this_width_is_nearer(parts, guess):
    from scipy.optimize import minimize

    width = normal_as(parts)[2]

    def of(p):
        x = np.array([0.0, *p[::2], *-np.array(p[::2])])
        inner = list(p[1::2])
        last = (1 - width**2) / 2 - sum(w * a * a for a, w in zip(p[::2], inner, strict=False))
        side = [*inner, last / p[-1] ** 2]
        return distance(x, np.array([1 - 2 * sum(side), *side, *side]), width)

    best = minimize(of, guess, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-10})
    assert distance(*normal_as(parts)) < best.fun * 1.001


@pytest.mark.parametrize("components", [1, 3, 5])
def test_a_start_from_a_plot_is_that_plot(components):
    """Range and angle with their noise, velocity alike in all directions; weights as split."""
    z = np.array([[4e4, 2.1]])
    method = LineOfSight(components=components)
    start = one_plot(z, PLANE, PLANAR)
    state = method.begin(Gaussian(start.mean[0], start.cov[0]), PLANE, PLANAR)
    weights = np.exp(state["log_weights"]) / np.sum(np.exp(state["log_weights"]))
    assert np.ptp(state["means"][:, 2]) < 1e-9  # it is the transverse velocity that is split
    mean = weights @ state["means"]
    np.testing.assert_allclose(mean, [4e4, 2.1, 0, 0], rtol=1e-12, atol=1e-9)
    variances = np.array([30.0, np.radians(0.8), 300.0, 300.0]) ** 2
    diagonal = weights @ (state["covs"][:, [0, 4, 7, 9]] + (state["means"] - mean) ** 2)
    np.testing.assert_allclose(diagonal, variances, rtol=1e-9)
    others = np.delete(state["covs"], [0, 4, 7, 9], axis=1) / 4e4
    np.testing.assert_allclose(others, 0.0, atol=1e-9)


def test_likelihood_is_that_of_the_mixture():
    """Before anything is bent: the sum of weighted normal densities of range and angle."""
    world = World(PLANE, PLANAR)
    mean, cov = world.prior(4)
    method = LineOfSight(components=5)
    state = method.begin(Gaussian(mean, cov), PLANE, PLANAR)
    z = world.plot(mean, 4)
    _, surprise = method.update(state, z, PLANE, PLANAR)
    R, total = np.diag([30.0, np.radians(0.8)]) ** 2, 0.0
    weights = np.exp(state["log_weights"]) / np.sum(np.exp(state["log_weights"]))
    for w, m, c in zip(weights, state["means"], state["covs"], strict=True):
        S = np.array([[c[0], c[1]], [c[1], c[4]]]) + R
        nu = z - m[:2]
        nu[1] = (nu[1] + np.pi) % (2 * np.pi) - np.pi
        quadratic = nu @ np.linalg.solve(S, nu)
        total += w * np.exp(-quadratic / 2) / (2 * np.pi * np.sqrt(np.linalg.det(S)))
    assert surprise.loglik == pytest.approx(np.log(total), rel=1e-9)
    assert surprise.dof == 2
    _, surprise = method.update(state, np.array([z[0], np.nan]), PLANE, PLANAR)
    sd = np.sqrt(state["covs"][:, 0] + 30.0**2)
    alone = np.log(weights @ norm.pdf(z[0], state["means"][:, 0], sd))
    assert surprise.loglik == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize("motion", [PLANE, SPACE], ids=["plane", "space"])
def test_a_platform_s_turn_and_acceleration_are_known(motion):
    """A target known to a micrometre is told where straight flight takes it."""
    d = motion.dims
    state = np.array([4e3, -9e3, 2e3])[:d], np.array([150.0, 40.0, -8.0])[:d]
    mean = np.concatenate(state)
    before = Radar(range_m=30.0, azimuth_deg=1.0, pose=POSE)
    after = Pose(
        position_m=POSE.position_m + np.array([400.0, 90.0, -20.0]),
        rotation=tilted(1.1, 0.5) if d == 3 else turned(1.1),
        velocity_mps=POSE.velocity_mps + np.array([-30.0, 60.0, 5.0]),
    )
    if d == 2:
        before = replace(before, pose=replace(POSE, rotation=turned(0.4)))
    there = replace(before, pose=after)
    method, still = LineOfSight(components=1), replace(motion, accel_mps2=0.0)
    kept = method.begin(Gaussian(mean, 1e-12 * np.eye(2 * d)), still, before)
    told = method.output(method.predict(kept, still, there, 3.0), still, there)
    np.testing.assert_allclose(told.mean, still.move(mean, 3.0), atol=1e-8)


@pytest.mark.parametrize(
    ("settings", "world", "what"),
    [
        ({"components": 2}, POLAR_WORLDS[1], "components=2"),
        ({"told": "median"}, POLAR_WORLDS[1], "median"),
        ({"components": 3}, POLAR_WORLDS[0], "three dimensions"),
        ({}, POLAR_WORLDS[3], "CoordinatedTurn"),
    ],
    ids=["number", "told", "space", "turn"],
)
def test_what_it_cannot_do_is_refused(settings, world, what):
    chosen = catalogue.lookup("line-of-sight").with_settings(**settings)
    with pytest.raises(UsageError, match=what):
        _ = chosen.recursion(world.motion, world.sensor).layout
