"""Laws of the particle filter: the Kalman filter's answer in a linear world, and its seeds."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import boresight as bs
from boresight.filters.particle import _Renewal

COUNT, STEPS, SEED = 20_000, 25, 3
MOTION = bs.ConstantVelocity(accel_mps2=0.3, dims=2)
STILL = bs.ConstantVelocity(accel_mps2=0.0, dims=2)
GPS = bs.PositionSensor(x_m=20.0, y_m=35.0)
START = bs.Gaussian(np.array([100.0, -50.0, 4.0, -2.0]), np.diag([900.0, 1600.0, 25.0, 9.0]))


def drawn(runs, count=COUNT, seed=SEED):
    random = np.random.default_rng(seed)
    return START.mean + random.standard_normal((runs, count, 4)) * np.sqrt(np.diag(START.cov))


def plots(runs, seed=SEED):
    random = np.random.default_rng(seed + 100)
    truth = START.mean + random.standard_normal((runs, 4)) * np.sqrt(np.diag(START.cov))
    path = truth[:, None, :2] + np.arange(STEPS)[:, None] * truth[:, None, 2:]
    z = path + random.standard_normal((runs, STEPS, 2)) * [20.0, 35.0]
    z[:, 7:11] = np.nan
    z[:, 14, 0] = np.nan
    return z


def heard(bearings_rad, **settings):
    """Bearings (runs, steps) of a target, from an own ship that turns after ten steps."""
    steps = bearings_rad.shape[1]
    k = np.arange(steps)
    own = np.stack([0.0 * k, 10.0 * k, 0.0 * k], axis=-1)
    own[10:, 0] = 10.0 * (k[10:] - 10)
    sensor = bs.Bearings(azimuth_deg=0.5, pose=bs.Pose(position_m=own[None]))
    z = bearings_rad[..., None]
    cloud = bs.bearing_particles(z[:, 0], STILL, sensor, speed_mps=10.0, count=500, seed=SEED)
    rest = z.copy()
    rest[:, 0] = np.nan
    return bs.particle_filter(rest, STILL, sensor, 1.0, cloud, seed=SEED, **settings)


def off_the_kalman_filter(count):
    """Differences of mean, spread and log-likelihood, in standard deviations of the posterior."""
    z = plots(20)
    exact = bs.run("kf", MOTION, GPS, z, dt=1.0, start=START, outputs=("mean", "cov", "loglik"))
    found = bs.particle_filter(z, MOTION, GPS, 1.0, drawn(20, count), seed=SEED)
    sd = np.sqrt(np.diagonal(exact.cov, axis1=2, axis2=3))
    spread = np.sqrt(np.diagonal(found.cov, axis1=2, axis2=3))
    return (found.mean - exact.mean) / sd, spread / sd - 1.0, found.loglik - exact.loglik


def test_in_a_linear_world_it_agrees_with_the_kalman_filter():
    """Only Monte Carlo error is left, which sixteen times the particles make four times smaller.

    An update that keeps a fifth of the particles, a few of them remembered: ten standard errors of
    as many independent draws. The ratio's own standard error is 0.2 of it over 20 runs.
    """
    few, many = off_the_kalman_filter(COUNT // 16), off_the_kalman_filter(COUNT)
    for small, large in zip(many, few, strict=True):
        rms = np.sqrt(np.mean(small**2))
        assert rms < 10.0 / np.sqrt(COUNT)
        assert 2.0 < np.sqrt(np.mean(large**2)) / rms < 6.0
    assert abs(np.mean(many[0])) < 0.02
    assert abs(np.mean(many[1])) < 0.02


def test_one_plot_weighs_particles_by_the_density_of_its_noise():
    """By SciPy: a radar whose range and range rate have correlated noise, looking across -x."""
    radar = bs.Radar(
        range_m=30.0,
        azimuth_deg=2.0,
        range_rate_mps=4.0,
        range_rate_correlation=0.6,
        pose=bs.Pose(position_m=np.array([100.0, 50.0, 0.0])),
    )
    random = np.random.default_rng(SEED)
    cloud = np.array([-900.0, 50.0, 5.0, 30.0]) + random.standard_normal((200, 4)) * [30, 40, 5, 5]
    z = np.array([995.0, np.pi - 0.01, -1.0])
    found = bs.particle_filter(z[None, None], STILL, radar, 2.0, cloud, seed=SEED, fraction=0.0)
    moved = cloud.copy()
    moved[:, :2] += 2.0 * cloud[:, 2:]
    away = moved[:, :2] - [100.0, 50.0]
    distance = np.hypot(*away.T)
    bearing = np.arctan2(away[:, 1], away[:, 0]) % (2.0 * np.pi)  # no jump where these lie
    rate = np.sum(away * moved[:, 2:], axis=1) / distance
    cov = np.diag([900.0, np.radians(2.0) ** 2, 16.0])
    cov[0, 2] = cov[2, 0] = 0.6 * 30.0 * 4.0
    off = z - np.stack([distance, bearing, rate], axis=1)
    density = multivariate_normal(np.zeros(3), cov).pdf(off)
    weights = density / density.sum()
    assert found.loglik[0, 0] == pytest.approx(np.log(density.mean()), rel=1e-9)
    assert found.mean[0, 0] == pytest.approx(weights @ moved, rel=1e-9)
    spread = np.cov(moved.T, aweights=weights, ddof=0)
    assert found.cov[0, 0] == pytest.approx(spread, rel=1e-6, abs=1e-6)
    assert found.effective[0, 0] == pytest.approx(1.0 / np.sum(weights**2), rel=1e-9)


def test_a_plot_that_is_missing_changes_nothing_but_the_prediction():
    z = plots(2)
    found = bs.particle_filter(z, STILL, GPS, 1.0, drawn(2, 300), seed=SEED, fraction=0.0)
    F = np.eye(4)
    F[0, 2] = F[1, 3] = 1.0
    for k in (7, 8, 9, 10):
        assert found.mean[:, k] == pytest.approx(found.mean[:, k - 1] @ F.T, rel=1e-12)
        assert found.cov[:, k] == pytest.approx(F @ found.cov[:, k - 1] @ F.T, rel=1e-9)
        assert np.all(found.loglik[:, k] == pytest.approx(0.0, abs=1e-12))
        assert found.effective[:, k] == pytest.approx(found.effective[:, k - 1], rel=1e-12)


def test_a_run_is_the_same_alone_and_among_others_and_another_seed_is_another_filter():
    z, cloud = plots(3), drawn(3, 400)
    together = bs.particle_filter(z, MOTION, GPS, 1.0, cloud, seed=SEED)
    fewer = bs.particle_filter(z[:2], MOTION, GPS, 1.0, cloud[:2], seed=SEED)
    other = bs.particle_filter(z, MOTION, GPS, 1.0, cloud, seed=SEED + 1)
    assert np.array_equal(together.mean[:2], fewer.mean)
    assert np.array_equal(together.cov[:2], fewer.cov)
    assert not np.array_equal(together.mean, other.mean)


def test_numbers_may_differ_from_run_to_run_and_step_to_step():
    z, cloud = plots(2), drawn(2, 400)
    sigma = np.array([20.0, 60.0])[:, None] * np.linspace(1.0, 2.0, STEPS)
    dt = np.linspace(0.5, 1.5, STEPS)[None]
    given = bs.PositionSensor(x_m=sigma, y_m=35.0)
    found = bs.particle_filter(z, MOTION, given, dt, cloud, seed=SEED)
    first = bs.PositionSensor(x_m=sigma[:1], y_m=35.0)
    alone = bs.particle_filter(z[:1], MOTION, first, dt, cloud[:1], seed=SEED)
    assert np.array_equal(found.mean[0], alone.mean[0])
    steady = bs.particle_filter(z, MOTION, GPS, dt, cloud, seed=SEED)
    assert not np.allclose(found.mean[0], steady.mean[0])


def test_bearings_a_turn_apart_are_the_same_bearings():
    bearings = np.pi - 0.02 + 0.002 * np.arange(30.0)[None]
    plain, turned = (
        heard(bearings),
        heard(np.where(bearings > np.pi, bearings - 2 * np.pi, bearings)),
    )
    assert plain.mean == pytest.approx(turned.mean, rel=1e-6, abs=1e-6)


def test_renewed_particles_keep_mean_and_covariance():
    """At 5 standard errors; ten numbers, one false alarm in 170,000."""
    random = np.random.default_rng(SEED)
    places = random.standard_normal((4, COUNT)) * np.array([[300.0], [20.0], [3.0], [0.1]])
    places[1] += 0.05 * places[0]
    weights = np.exp(-0.5 * (places[0] / 250.0 - 0.4) ** 2)
    weights /= weights.sum()
    mean = places @ weights
    cov = np.cov(places, aweights=weights, ddof=0)
    new = _Renewal(0.5, 0.9)(places, weights, random)
    sd = np.sqrt(np.diag(cov))
    assert np.max(np.abs(new.mean(1) - mean) / sd) < 5.0 / np.sqrt(COUNT)
    apart = np.abs(np.cov(new, ddof=0) - cov) / np.outer(sd, sd)
    assert np.max(apart) < 5.0 * np.sqrt(2.0 / COUNT)
    assert len(np.unique(new[0])) == COUNT


def test_renewed_particles_are_spread_as_silverman_says():
    """About each of two values, in one dimension: (4 / 3n)^(1/5); at 5 standard errors."""
    random = np.random.default_rng(SEED)
    places, weights = np.where(np.arange(COUNT) % 2, 1.0, -1.0)[None], np.full(COUNT, 1.0 / COUNT)
    new = _Renewal(0.5, 1.0)(places, weights, random)[0]
    width = (4.0 / (3.0 * COUNT)) ** 0.2
    assert np.std(np.abs(new)) == pytest.approx(width, rel=5.0 / np.sqrt(2 * COUNT))
    assert np.mean(np.abs(new)) == pytest.approx(np.sqrt(1.0 - width**2), abs=5e-3)


def test_a_plot_that_no_particle_explains_leaves_their_weights():
    z = plots(1)
    z[0, 3] = 1e160  # its square is infinite
    found = bs.particle_filter(z, MOTION, GPS, 1.0, drawn(1, 300), seed=SEED)
    assert found.loglik[0, 3] == -np.inf
    assert np.all(np.isfinite(found.mean))
    assert np.all(np.isfinite(found.cov))


def test_particles_lie_in_the_cells_alike_and_on_the_bearing():
    """Spread of the bearing at 5 standard errors; ranges are drawn in layers, so exactly alike."""
    own = np.array([500.0, -200.0, 0.0])
    sensor = bs.Bearings(azimuth_deg=2.0, pose=bs.Pose(position_m=own))
    cloud = bs.bearing_particles(
        np.array([[1.0]]), STILL, sensor, speed_mps=7.0, count=6000, seed=SEED, cells=6
    )[0]
    away = cloud[:, :2] - own[:2]
    edges = np.geomspace(1_000.0, 20_000.0, 7)
    assert np.array_equal(np.histogram(np.hypot(*away.T), edges)[0], [1000] * 6)
    off = np.arctan2(away[:, 1], away[:, 0]) - 1.0
    assert abs(off.std() / np.radians(2.0) - 1.0) < 5.0 / np.sqrt(2 * 6000)
    assert np.max(np.abs(cloud[:, 2:].std(0) / 7.0 - 1.0)) < 5.0 / np.sqrt(2 * 6000)


def test_a_cone_has_particles_on_both_sides_of_its_axis():
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # the axis points east
    sensor = bs.ConicalBearings(cone_deg=0.1, pose=bs.Pose(rotation=turn))
    cloud = bs.bearing_particles(
        np.array([[0.7]]), STILL, sensor, speed_mps=7.0, count=1000, seed=SEED
    )[0]
    off_axis = np.arctan2(cloud[:, 0], cloud[:, 1])
    assert np.allclose(np.abs(off_axis), 0.7, atol=0.02)
    assert 400 < np.sum(off_axis > 0.0) < 600  # 6 standard deviations


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"particles": np.zeros((3, 10, 4))}, "with particles of shape"),
        ({"particles": np.zeros((10, 3))}, "with particles of shape"),
        ({"z": np.zeros((2, STEPS, 1))}, "plots of shape"),
        ({"dt": np.ones((1, STEPS + 1))}, "dt has shape"),
        ({"fraction": 2.0}, "fraction=2.0"),
        ({"bandwidth": np.nan}, "bandwidth=nan"),
    ],
)
def test_what_does_not_fit_is_refused(change, says):
    given = {"z": plots(2), "dt": 1.0, "particles": drawn(2, 10), "seed": 1} | change
    with pytest.raises(bs.UsageError, match=says):
        bs.particle_filter(motion=MOTION, sensor=GPS, **given)


def test_a_start_without_a_bearing_is_refused():
    with pytest.raises(bs.UsageError, match="first plot of run 1"):
        bs.bearing_particles(
            np.array([[0.1], [np.nan]]), STILL, bs.Bearings(azimuth_deg=1.0),
            speed_mps=5.0, count=10, seed=1,
        )  # fmt: skip
