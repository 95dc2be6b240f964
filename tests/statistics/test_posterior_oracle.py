"""The exact posterior against other ways to the same integral; then, whether it is consistent."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.hermite_e import hermegauss
from scipy.optimize import least_squares

from boresight.errors import UsageError
from boresight.experiments.posterior import Flight, draw, exact_posterior
from boresight.models.sensors import Radar

FLIGHT = Flight(
    sensor=Radar(range_m=100.0, azimuth_deg=10.0), range_m=14_142.0, speed_mps=30.0, scans=100
)


def residuals(flight, z, start):
    """Of plots and of the prior velocity for starts (..., 4), in standard deviations.

    Written from the definition, in Cartesian coordinates: no polar frame, nothing integrated out.
    """
    place = start[..., None, :2] + flight.time_s[:, None] * start[..., None, 2:]
    r, azimuth = np.hypot(place[..., 0], place[..., 1]), np.arctan2(place[..., 1], place[..., 0])
    turn = z[:, 1] - azimuth
    turn = np.arctan2(np.sin(turn), np.cos(turn))
    parts = [(z[:, 0] - r) / flight.sigma[0], turn / flight.sigma[1]]
    return np.concatenate([*parts, start[..., 2:] / flight.speed_mps], axis=-1)


def log_density(flight, z, start):
    """Of starts (..., 4), but for a constant; flat in polar coordinates is 1/r in Cartesian."""
    square = np.sum(np.square(residuals(flight, z, start)), axis=-1)
    bulk = np.hypot(start[..., 0], start[..., 1]) if flight.flat == "polar" else 1.0
    return -square / 2 - np.log(bulk)


def moved(start, lapse):
    return np.concatenate([start[..., :2] + lapse * start[..., 2:], start[..., 2:]], axis=-1)


def weighted(states, log):
    """Mean and covariance of the states, and the Monte Carlo errors (standard) of both."""
    weight = np.exp(log - np.max(log))
    weight /= np.sum(weight)
    mean = weight @ states
    off = states - mean
    cov = (weight[:, None] * off).T @ off
    error = np.sqrt(np.square(weight) @ np.square(off))
    products = off[:, :, None] * off[:, None] - cov
    return mean, cov, error, np.sqrt(np.tensordot(np.square(weight), np.square(products), axes=1))


def by_quadrature(flight, z, nodes):
    """Gauss-Hermite over all four dimensions, about the mode."""
    r, azimuth = z[0]
    guess = np.array([r * np.cos(azimuth), r * np.sin(azimuth), 0.0, 0.0])
    fit = least_squares(lambda start: residuals(flight, z, start), guess, x_scale="jac")
    root = np.linalg.cholesky(np.linalg.inv(fit.jac.T @ fit.jac))
    x, w = hermegauss(nodes)
    normal = np.stack(np.meshgrid(*[x] * 4, indexing="ij"), axis=-1).reshape(-1, 4)
    weights = np.prod(np.stack(np.meshgrid(*[w] * 4, indexing="ij")), axis=0).ravel()
    start = fit.x + normal @ root.T
    log = np.array([log_density(flight, z, part) for part in np.array_split(start, 64)])
    log = np.concatenate(log) + np.log(weights) + np.sum(np.square(normal), axis=-1) / 2
    return weighted(moved(start, flight.time_s[-1]), log)


def in_deviations(difference, cov):
    return difference / np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))


def scaled(found, expected):
    """How far a covariance is off, in units of the standard deviations."""
    sd = np.sqrt(np.diag(expected))
    return np.max(np.abs(found - expected) / np.outer(sd, sd))


@pytest.mark.parametrize("flat", ["polar", "cartesian"])
def test_equals_quadrature_over_all_four_dimensions(flat):
    short = replace(
        FLIGHT, sensor=Radar(range_m=900.0, azimuth_deg=5.0), dt_s=4.0, scans=9, flat=flat
    )
    _, z = draw(short, runs=2, seed=3)
    exact = exact_posterior(short, z, at=[8], points=2**17)
    for run in range(2):
        mean, cov, *_ = by_quadrature(short, z[run], 20)
        coarse, *_ = by_quadrature(short, z[run], 16)
        assert np.max(np.abs(in_deviations(coarse - mean, cov))) < 1e-4  # it has converged
        assert np.max(np.abs(in_deviations(exact.mean[run, 0] - mean, cov))) < 3e-4
        assert scaled(exact.cov[run, 0], cov) < 6e-4


def test_agrees_with_draws_from_the_prior():
    """Another proposal, that any reader believes: the prior itself, weighted by later plots.

    Late in a run, where the two signs of the transverse velocity are still both possible.
    """
    slow = replace(FLIGHT, dt_s=8.0, scans=8)
    _, z = draw(slow, runs=2, seed=4)
    ours, again = (exact_posterior(slow, z, at=[7], seed=seed) for seed in (0, 1))
    believer = np.random.default_rng(5)
    first = replace(slow, scans=1)
    for run in range(2):
        normal = believer.standard_normal((500_000, 4))
        r, azimuth = (z[run, 0] + normal[:, :2] * slow.sigma).T
        place = np.stack([r * np.cos(azimuth), r * np.sin(azimuth)], axis=-1)
        start = np.hstack([place, slow.speed_mps * normal[:, 2:]])
        parts = np.array_split(start, 100)
        log = [log_density(slow, z[run], p) - log_density(first, z[run, :1], p) for p in parts]
        state = moved(start, slow.time_s[-1])
        mean, cov, of_mean, of_cov = weighted(state, np.concatenate(log))
        assert np.max(of_mean / np.sqrt(np.diag(cov))) < 0.04  # else the test would say nothing
        # 28 comparisons; five standard errors, as weights have heavy tails: false alarm below 1e-3.
        assert np.all(np.abs(ours.mean[run, 0] - mean) < 5 * of_mean)
        assert np.all(np.abs(ours.cov[run, 0] - cov) < 5 * of_cov)
    assert np.max(np.abs(in_deviations(ours.mean - again.mean, ours.cov))) < 0.01
    assert np.min(ours.ess) > 2000


def test_one_plot_has_the_moments_in_closed_form():
    """Range N(m, s²) (polar), or that times the range: E r = m + s²/m, E r² = m² + 3 s²."""
    wide = replace(FLIGHT, sensor=Radar(range_m=2000.0, azimuth_deg=20.0), scans=1)
    m, s, a, b = wide.range_m, *wide.sigma, np.radians(wide.azimuth_deg)
    for flat, first, second in (
        ("polar", m, m * m + s * s),
        ("cartesian", m + s * s / m, m * m + 3 * s * s),
    ):
        case = replace(wide, flat=flat)
        exact = exact_posterior(case, draw(case, runs=1, seed=1)[1], at=[0])
        mean = first * np.exp(-a * a / 2) * np.array([np.cos(b), np.sin(b), 0.0, 0.0])
        twist = np.exp(-2 * a * a) * np.array([np.cos(2 * b), np.sin(2 * b)])
        xx, yy = second * (1 + twist[0]) / 2, second * (1 - twist[0]) / 2
        cov = np.diag([xx, yy, wide.speed_mps**2, wide.speed_mps**2])
        cov[0, 1] = cov[1, 0] = second * twist[1] / 2
        cov[:2, :2] -= np.outer(mean[:2], mean[:2])
        assert np.max(np.abs(in_deviations(exact.mean[0, 0] - mean, cov))) < 3e-3
        assert scaled(exact.cov[0, 0], cov) < 6e-3


def test_is_the_linear_answer_where_all_is_nearly_linear():
    """At 100 km with 0.3 degrees: the mode and the inverse information of the whole batch."""
    far = Flight(
        sensor=Radar(range_m=50.0, azimuth_deg=0.3),
        range_m=100_000.0,
        speed_mps=150.0,
        dt_s=4.0,
        scans=20,
    )
    _, z = draw(far, runs=5, seed=6)
    exact = exact_posterior(far, z, at=[19])
    for run in range(5):
        r, azimuth = z[run, 0]
        guess = np.array([r * np.cos(azimuth), r * np.sin(azimuth), 0.0, 0.0])
        fit = least_squares(lambda s, z=z[run]: residuals(far, z, s), guess, x_scale="jac")
        F = np.eye(4) + far.time_s[-1] * np.eye(4, k=2)
        cov = F @ np.linalg.inv(fit.jac.T @ fit.jac) @ F.T
        assert np.max(np.abs(in_deviations(exact.mean[run, 0] - F @ fit.x, cov))) < 0.05
        assert scaled(exact.cov[run, 0], cov) < 0.05


def nees(exact, truth, at):
    error = (exact.mean - truth.states[:, at])[..., None]
    return np.sum(error * np.linalg.solve(exact.cov, error), axis=(-2, -1)) / 4


@pytest.mark.parametrize(("flat", "seed"), [("polar", 7), ("cartesian", 8)])
def test_knows_its_errors_when_the_truth_is_drawn_from_its_prior(flat, seed):
    """E NEES is exactly 4, whatever the shape of the posterior; its spread is not chi-square's."""
    at = [0, 99]
    flight = replace(FLIGHT, flat=flat)
    truth, z = draw(flight, runs=200, seed=seed)
    ratio = nees(exact_posterior(flight, z, at=at, points=256), truth, at)
    error = np.std(ratio, axis=0) / np.sqrt(len(ratio))
    assert np.all(error < 0.1)  # else the test would say nothing
    assert np.all(np.abs(np.mean(ratio, axis=0) - 1) < 3.5 * error)  # false alarm 1.4e-3


def test_draws_what_it_says():
    near = Flight(
        sensor=Radar(range_m=200.0, azimuth_deg=1.0),
        range_m=1000.0,
        speed_mps=3.0,
        scans=2,
        flat="cartesian",
    )
    truth, z = draw(near, runs=20_000, seed=9)
    assert np.all(z[:, 0] == z[0, 0])
    states = truth.states
    r = np.hypot(states[..., 0], states[..., 1])
    # E r = m + s²/m; its error is 200 / sqrt(20,000) = 1.4. All false alarms below 1e-3.
    assert np.mean(r[:, 0]) == pytest.approx(1000 + 200**2 / 1000, abs=5)
    assert np.std(states[:, 0, 2:], axis=0) == pytest.approx([3.0, 3.0], rel=0.02)
    assert np.allclose(states[:, 1, :2] - states[:, 0, :2], states[:, 0, 2:])
    assert np.std(z[:, 1, 0] - r[:, 1]) == pytest.approx(200.0, rel=0.02)
    bearing = np.arctan2(states[:, 1, 1], states[:, 1, 0])
    assert np.std(z[:, 1, 1] - bearing) == pytest.approx(np.radians(1.0), rel=0.02)


def test_turns_with_the_world_across_the_cut_of_the_azimuth():
    _, z = draw(replace(FLIGHT, azimuth_deg=0.0), runs=2, seed=10)
    turned = z.copy()
    turned[..., 1] = np.arctan2(-np.sin(z[..., 1]), -np.cos(z[..., 1]))  # by half a turn
    plain, other = (exact_posterior(FLIGHT, each, at=[9, 99]) for each in (z, turned))
    sd = np.sqrt(np.diagonal(plain.cov, axis1=-2, axis2=-1))
    assert np.max(np.abs(plain.mean + other.mean) / sd) < 1e-6


def test_a_run_has_the_same_answer_in_any_company_and_touches_no_input():
    _, z = draw(FLIGHT, runs=4, seed=11)
    before = z.copy()
    many, few = exact_posterior(FLIGHT, z, at=[49]), exact_posterior(FLIGHT, z[:2], at=[49])
    assert np.array_equal(z, before)
    for all_runs, some in zip(many, few, strict=True):
        assert np.array_equal(all_runs[:2], some)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"points": 1000}, "power of 2"),
        ({"points": 0}, "power of 2"),
        ({"at": [100]}, "0 to 99"),
        ({"z": np.full((1, 100, 2), np.nan)}, "missing"),
        ({"z": np.ones((1, 99, 2))}, "shape"),
    ],
)
def test_refuses_what_it_cannot_answer(change, sentence):
    given = {"z": np.ones((1, 100, 2)), "at": [0], "points": 64} | change
    with pytest.raises(UsageError, match=sentence):
        exact_posterior(FLIGHT, given.pop("z"), **given)


def test_refuses_another_sensor():
    for sensor in (Radar(azimuth_deg=1.0), Radar(range_m=1.0, azimuth_deg=1.0, elevation_deg=1.0)):
        with pytest.raises(UsageError, match="range and azimuth"):
            replace(FLIGHT, sensor=sensor)
