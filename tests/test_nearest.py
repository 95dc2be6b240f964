"""The nearest of several plots, against a plain loop; and what a gate does to a filter."""

from dataclasses import replace

import numpy as np
import pytest

import boresight as bs
from boresight import catalogue
from boresight.errors import UsageError
from boresight.experiments.simulate import simulate
from boresight.experiments.worlds import waypoints
from boresight.filters.nearest import Nearest, nearest
from boresight.filters.recursion import run_recursion
from boresight.maths import Gaussian
from boresight.models.coordinates import PositionSensor
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar
from oracles.nearest import nearest_neighbour
from oracles.textbook import white_acceleration

RADAR = Radar(range_m=30.0, azimuth_deg=0.15, elevation_deg=0.15)
NOISE = np.diag([30.0, np.radians(0.15), np.radians(0.15)]) ** 2
POINTS = [[2e4, 0.0, 3e3], [2e4, 2e4, 3e3], [0.0, 3e4, 5e3]]


def scene(runs=20, seed=5, **changed):
    given = {"speed_mps": 200.0, "dt_s": 2.0, "sensor": RADAR} | changed
    world = waypoints(POINTS, **given)
    return world, *simulate(world, runs=runs, seed=seed)


def crowded(z, offsets, seed=1):
    """Three plots a scan: the target's own at any place, and two that lie a few sigma beside it."""
    rng = np.random.default_rng(seed)
    many = np.repeat(z[:, :, None], 3, axis=2)
    many[:, :, 1:] += offsets * np.sqrt(np.diag(NOISE)) * rng.standard_normal((*z.shape[:2], 2, 3))
    return (
        rng.permuted(many.view([("", float)] * 3)[..., 0], axis=2).view(float).reshape(many.shape)
    )


def filtered(recursion, guard, z, plots, outputs=("mean", "cov", "inside")):
    given = replace(recursion, guard=guard)
    return run_recursion(given, z, plots.dt, plots.prior, outputs=outputs)


@pytest.mark.parametrize("limit", [16.0, 4.0, np.inf])
def test_it_takes_what_a_plain_loop_takes(limit):
    world, _, plots = scene(detection=0.8)
    many = crowded(plots.z, 6.0)
    many[:, 30:40, :, 2] = np.nan  # without elevations
    many[:, 35:37, 0] = np.nan
    recursion = catalogue.lookup("ekf").recursion(world.motion, RADAR)
    found = filtered(recursion, nearest(RADAR, limit, 3), many, plots)

    def model(dt):
        return white_acceleration(3, dt, world.motion.accel_mps2**2)

    took = 0
    for run in range(6):
        start = plots.prior.mean[run], plots.prior.cov[run]
        means, covs, taken = nearest_neighbour(start, many[run], plots.dt[0], model, NOISE, limit)
        assert found.mean[run] == pytest.approx(means, rel=1e-6, abs=1e-3)
        assert found.cov[run] == pytest.approx(covs, rel=1e-4, abs=1e-3)
        assert np.array_equal(found.inside[run], taken >= 0)
        took += len(set(taken.tolist()))
    assert took >= 18  # every place is taken at times


@pytest.mark.parametrize("name", ["ekf", "mekf", "ckf-spherical", "mgekf", "cmkf-d"])
def test_alone_and_without_a_limit_it_changes_nothing(name):
    """Compiled, an addition may be fused otherwise: the same but for rounding."""
    world, _, plots = scene(detection=0.9)
    recursion = catalogue.lookup(name).recursion(world.motion, RADAR)
    plain = filtered(recursion, None, plots.z, plots, ("mean", "cov", "nis"))
    gated = filtered(
        recursion, nearest(RADAR, np.inf, 1), plots.z[:, :, None], plots, ("mean", "cov", "nis")
    )
    for output in ("mean", "cov", "nis"):
        one, other = getattr(plain, output), getattr(gated, output)
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.nanmax(np.abs(one)))


def test_alone_and_without_a_limit_the_formula_is_the_same_to_the_last_bit():
    world, _, plots = scene(runs=2, detection=0.9)
    plain = catalogue.lookup("ekf").recursion(world.motion, RADAR)
    gated = replace(plain, guard=nearest(RADAR, np.inf, 1))
    states = [{"mean": plots.prior.mean[0], "cov": plots.prior.cov[0]}] * 2
    numbers = {name: value for name, (value, _) in gated.models().items()}
    for z, dt in zip(plots.z[0], plots.dt[0], strict=True):
        inputs = numbers | {"dt": dt, "z": z}
        states[0], _ = plain.step(states[0], inputs)
        states[1], told = gated.step(states[1], inputs | {"z": z[None]})
        assert told["inside"] == float(not np.isnan(z[0]))
        assert all(np.array_equal(states[0][name], states[1][name]) for name in ("mean", "cov"))


def test_tracks_hold_among_false_plots():
    """Three false plots a scan within 60 km: about one in 6,000 lies inside a gate."""
    world, truth, plots = scene(runs=200, detection=0.9, false_plots=3.0, coverage_m=60e3)
    found = bs.run("ekf", world.motion, RADAR, plots, gate=16.0)
    error = np.linalg.norm((found.mean - truth.states)[..., :3], axis=-1)
    assert np.isfinite(error).all()
    lost = np.mean(error[:, -1] > 1000.0)
    assert lost <= 0.02
    clean = bs.run("ekf", world.motion, RADAR, plots.z, dt=plots.dt, start=plots.prior)
    best = np.linalg.norm((clean.mean - truth.states)[..., :3], axis=-1)
    assert np.sqrt(np.mean(error**2)) < 1.2 * np.sqrt(np.mean(best**2))
    wild = bs.run("ekf", world.motion, RADAR, plots, gate=np.inf)
    assert np.mean(np.linalg.norm((wild.mean - truth.states)[:, -1, :3], axis=-1) > 1000.0) > lost


def test_a_consistent_prior_loses_as_many_of_its_own_plots_as_chi_square_says():
    """20,000 plots of three components: 9.348 loses 2.5 %, and 5 standard errors are 0.55 %."""
    world, *_ = scene(runs=1)
    vague = np.diag([100.0] * 3 + [10.0] * 3) ** 2
    drawn = replace(world, path=None, scans=1, begin="random draw", prior_cov=vague)
    _, plots = simulate(drawn, runs=20_000, seed=3)
    found = bs.run("ekf", drawn.motion, RADAR, plots, gate=9.348, outputs=("inside",))
    assert 1.0 - found.inside.mean() == pytest.approx(0.025, abs=0.0055)


def test_a_chirp_s_correlation_is_in_the_gate():
    """Against the joint Gaussian: only the likelier of two plots is taken."""
    rho, motion = 0.95, ConstantVelocity(accel_mps2=1.0)
    radar = Radar(range_m=30.0, azimuth_deg=0.5, range_rate_mps=3.0, range_rate_correlation=rho)
    planar = replace(motion, dims=2)
    prior = Gaussian(np.array([2e4, 0.0, -150.0, 0.0]), np.diag([9.0, 1e4, 0.25, 1e2]))
    alike, unlike = [2e4 + 60.0, 0.0, -150.0 + 6.0], [2e4 + 40.0, 0.0, -150.0 - 4.0]
    z = np.array([unlike, alike])
    taken, _ = nearest(radar, np.inf, 2).admit(prior, z, radar.components(planar))
    assert taken == pytest.approx(alike)
    apart = replace(radar, range_rate_correlation=None)
    taken, _ = nearest(apart, np.inf, 2).admit(prior, z, apart.components(planar))
    assert taken == pytest.approx(unlike)
    H = np.array([[1.0, 0, 0, 0], [0, 1 / 2e4, 0, 0], [0, 0, 1.0, 0]])
    R = np.diag([900.0, np.radians(0.5) ** 2, 9.0])
    R[0, 2] = R[2, 0] = rho * 30.0 * 3.0
    nu = np.array([60.0, 0.0, 6.0])
    limit = nu @ np.linalg.solve(H @ prior.cov @ H.T + R, nu)
    for factor, expected in ((1.0 + 1e-9, 1.0), (1.0 - 1e-9, 0.0)):
        _, inside = nearest(radar, limit * factor, 1).admit(prior, z[1:], radar.components(planar))
        assert inside == expected


def test_a_plot_that_lacks_a_coordinate_is_judged_by_the_other():
    """Which is far from the prediction by its own variance, whatever the two share."""
    sensor = PositionSensor(x_m=3.0, y_m=4.0)
    cov = np.diag([0.0, 0.0, 1.0, 1.0])
    cov[:2, :2] = [[100.0, 90.0], [90.0, 100.0]]
    prior, parts = (
        Gaussian(np.zeros(4), cov),
        sensor.components(ConstantVelocity(accel_mps2=0.0, dims=2)),
    )
    for z, distance in (([20.0, np.nan], 400.0 / 109.0), ([np.nan, 20.0], 400.0 / 116.0)):
        for factor, expected in ((1.0 + 1e-9, 1.0), (1.0 - 1e-9, 0.0)):
            gate = nearest(sensor, distance * factor, 1)
            assert gate.admit(prior, np.array([z]), parts)[1] == expected


def test_nothing_is_taken_of_nothing():
    prior = Gaussian(np.array([2e4, 0.0, 3e3, 0.0, 0.0, 0.0]), np.eye(6))
    parts = RADAR.components(ConstantVelocity(accel_mps2=1.0))
    taken, inside = Nearest(limit=np.inf, candidates=2).admit(prior, np.full((2, 3), np.nan), parts)
    assert np.isnan(taken).all()
    assert inside == 0.0


def test_plots_that_could_be_anybody_s_need_a_gate_and_a_start():
    world, _, plots = scene(runs=2, false_plots=1.0, coverage_m=1e5)
    run = {"name": "ekf", "motion": world.motion, "sensor": RADAR}
    with pytest.raises(UsageError, match=r"holds up to 12 plots(.|\n)*gate=16"):
        bs.run(**run, plots=plots)
    with pytest.raises(UsageError, match="nobody knows whose they are"):
        bs.run(**run, plots=plots, gate=16, start="one plot")
    alone = plots.candidates
    with pytest.raises(UsageError, match="nobody knows whose they are"):
        bs.run(**run, plots=alone, dt=plots.dt, gate=16)
    one = bs.run(**run, plots=alone, dt=plots.dt, start=plots.prior, gate=16)
    other = bs.run(**run, plots=plots, gate=16)
    assert np.array_equal(one.mean, other.mean)
    wrong = alone.copy()
    wrong[0, 3, 0, 1] = np.inf
    with pytest.raises(UsageError, match="is inf"):
        bs.run(**run, plots=wrong, dt=plots.dt, start=plots.prior, gate=16)


@pytest.mark.parametrize("gate", [0.0, -1.0, np.nan, "wide"])
def test_a_gate_that_is_no_squared_distance_is_refused(gate):
    world, _, plots = scene(runs=2)
    with pytest.raises(UsageError, match="is not a squared distance"):
        bs.run("ekf", world.motion, RADAR, plots, gate=gate)
