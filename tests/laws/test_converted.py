"""Laws of converted measurements: the sensor's frame, densities, plots without elevation."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.filters.converted import Converted
from boresight.filters.recursion import run_recursion
from boresight.filters.sight import read, sighted
from boresight.maths import Gaussian, gradient, wrap
from boresight.models.conversions import convert
from boresight.models.polar import polar_moments
from boresight.models.sensors import Radar
from laws.enrolled import CHIRP, FILTERS, PLANAR, PLANE, POLAR, POSE, SITE, SPACE, Entry, World
from oracles import filters as textbook

seeds = st.integers(0, 2**32)
NAMES = ("cmkf", "cmkf-d", "ucm", "mucm", "mmse", "ducm", "range-rate")
OURS = [entry for entry in FILTERS if entry.name in NAMES]
FLAT = Radar(range_m=30.0, azimuth_deg=0.8)  # in space: a radar that measures no elevation


@pytest.mark.parametrize("world", [World(PLANE, PLANAR), World(SPACE, POLAR)], ids=str)
@pytest.mark.parametrize("name", ["conventional", "cmkf-d-t", "ucm", "mmse", "ducm"])
@given(seed=seeds)
def test_the_update_is_linear_in_the_converted_plot(name, world, seed):
    """Rotated back into the track frame it is the joint Kalman update (erratum B10)."""
    d = world.motion.dims
    sensor = replace(world.sensor, pose=POSE if d == 3 else None)
    posed = World(world.motion, sensor)
    mean, cov = world.prior(seed)
    z = posed.plot(mean, seed)
    T, origin = (POSE.rotation, POSE.position_m) if d == 3 else (np.eye(2), np.zeros(2))
    place = polar_moments(T @ (mean[:d] - origin), T @ cov[:d, :d] @ T.T)
    sigma = np.array([c.sigma for c in sensor.components(world.motion)])
    point = convert(name, z, sigma, place)
    H, R = np.eye(d, len(mean)), T.T @ point.cov @ T
    expected = textbook.joint_update(mean, cov, T.T @ point.mean + origin, H, R)
    post = Entry("ducm", {"conversion": name}).update(posed, mean, cov, z)
    np.testing.assert_allclose(post.mean, expected[0], rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(post.cov, expected[1], atol=1e-9 * np.max(cov))
    assert post.nis == pytest.approx(expected[2], rel=1e-8)
    wiggle = np.diag([1e-2, 1e-6, 1e-6][:d])
    ends = [[convert(name, z + s * step, sigma, place).mean for s in (1, -1)] for step in wiggle]
    J = np.array([a - b for a, b in ends]) / (2.0 * np.diag(wiggle)[:, None])
    density = expected[3] + np.log(np.abs(np.linalg.det(J)))
    assert post.loglik == pytest.approx(density, abs=1e-6 * (1.0 + abs(expected[2])))


@pytest.mark.parametrize("entry", OURS, ids=str)
@given(seed=seeds)
def test_an_elevation_that_is_missing_is_one_that_is_never_measured(entry, seed):
    mean, cov = World(SPACE, POLAR).prior(seed)
    z = World(SPACE, POLAR).plot(mean, seed)
    z[2] = np.nan
    post = entry.update(World(SPACE, POLAR), mean, cov, z)
    flat = entry.update(World(SPACE, FLAT), mean, cov, z[:2])
    for ours, theirs in zip(post[:5], flat[:5], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * np.max(np.abs(theirs)))


@pytest.mark.parametrize("lost", [0, 1])
@pytest.mark.parametrize("entry", OURS, ids=str)
@given(seed=seeds)
def test_what_cannot_be_converted_is_used_as_the_extended_filter_does(entry, lost, seed):
    mean, cov = World(SPACE, POLAR).prior(seed)
    z = World(SPACE, POLAR).plot(mean, seed)
    z[lost] = np.nan
    post, ekf = (each.update(World(SPACE, POLAR), mean, cov, z) for each in (entry, Entry("ekf")))
    for ours, theirs in zip(post[:5], ekf[:5], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * np.max(np.abs(theirs)))


def test_the_plot_before_is_remembered_until_there_is_another():
    """Where the start is before the first, seen from the sensor; a lost plot is not remembered."""
    method, sensor = Converted(conditioning="previous measurement"), replace(POLAR, pose=POSE)
    world = World(SPACE, sensor)
    mean, cov = world.prior(3)
    begun = method.begin(Gaussian(mean, cov), SPACE, sensor)
    np.testing.assert_allclose(begun["previous"], mean[:3] - POSE.position_m)
    z = world.plot(mean, 3)
    lost, _ = method.update(begun, np.array([np.nan, *z[1:]]), SPACE, sensor)
    np.testing.assert_array_equal(lost["previous"], begun["previous"])
    seen, _ = method.update(begun, z, SPACE, sensor)
    z[1] = wrap(z[1])
    np.testing.assert_allclose(textbook.polar(POSE.rotation @ seen["previous"]), z, rtol=1e-9)


def test_what_is_told_is_shortened_by_the_variances_of_the_angles():
    """(31): e^-s² of the azimuth; in space of the elevation, too, which alone shortens heights."""
    mean, cov = np.array([6e3, 0.0, 8e3, 1, 2, 3]), np.diag([900.0, 400.0, 900.0, 9, 9, 9]) ** 2
    state = {"mean": mean, "cov": cov}
    told = Converted(scale_output=True).output(state, SPACE, POLAR)
    azimuth, elevation = 400.0**2 / 6e3**2, 900.0**2 / 1e4**2
    shorter = np.exp([-azimuth - elevation, 0.0, -elevation, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(told.mean, mean * shorter, rtol=1e-9)
    np.testing.assert_array_equal(told.cov, cov)


@pytest.mark.parametrize(
    ("name", "by"), [("ducm", "ucm"), ("cmkf-d-t", "cmkf-d-m"), ("mucm", "mucm"), ("mmse", "mmse")]
)
def test_a_first_plot_is_converted_as_if_nothing_else_were_known(name, by):
    """Erratum B9."""
    z, sigma = np.array([9e3, 2.0]), np.array([30.0, np.radians(0.8)])
    start = Converted(conversion=name).start(z[None], PLANE, PLANAR)
    point = convert(by, z, sigma)
    np.testing.assert_allclose(start.mean[0, :2], point.mean, rtol=1e-12)
    np.testing.assert_allclose(start.cov[0, :2, :2], point.cov, rtol=1e-9)


@pytest.mark.parametrize("entry", [Entry("ducm"), Entry("ucm"), Entry("range-rate")], ids=str)
def test_a_likelihood_is_a_density_of_plots(entry):
    """Its integral over all plots is 1, so it compares with that of any other filter."""
    world = World(PLANE, PLANAR if entry.name != "range-rate" else CHIRP)
    mean, cov = np.array([3e3, 4e3, 40.0, -60.0]), np.diag([300.0, 400.0, 30.0, 30.0]) ** 2
    r, a = np.linspace(2e3, 8e3, 241), np.linspace(-0.1, 1.9, 241)
    rate = np.linspace(-140.0, 80.0, 45) if entry.name == "range-rate" else [0.0]
    grid = np.stack(np.meshgrid(r[::4], a[::4], rate, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    z = grid[..., : len(world.sensor.names)]
    found = run_recursion(entry.recursion(world), z, 0.0, Gaussian(mean, cov), outputs=["loglik"])
    cell = 16 * (r[1] - r[0]) * (a[1] - a[0]) * (rate[1] - rate[0] if len(rate) > 1 else 1.0)
    # ucm and range-rate look at the plot for their noise, so theirs is one to first order only
    tolerance = 1e-6 if entry.name == "ducm" else 0.02
    assert np.exp(found.loglik).sum() * cell == pytest.approx(1.0, abs=tolerance)


@given(seed=seeds)
def test_correlated_noise_of_range_and_range_rate_is_a_full_matrix(seed):
    world = World(PLANE, CHIRP)
    mean, cov = world.prior(seed)
    z = world.plot(mean + np.linalg.cholesky(cov)[:, 0], seed)
    parts = world.sensor.components(world.motion)
    predicted, H = (
        np.array(part) for part in zip(*(gradient(c.value, mean) for c in parts), strict=True)
    )
    sd = np.array([30.0, np.radians(0.8), 2.0])
    R = np.diag(sd**2)
    R[0, 2] = R[2, 0] = -0.7 * sd[0] * sd[2]
    nu = z - predicted
    nu[1] = np.angle(np.exp(1j * nu[1]))
    expected = textbook.joint_update(mean, cov, nu + H @ mean, H, R)
    post = Entry("ekf").update(world, mean, cov, z)
    np.testing.assert_allclose(post.mean, expected[0], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(post.cov, expected[1], atol=1e-9 * np.max(cov))
    np.testing.assert_allclose([post.nis, post.loglik], expected[2:], rtol=1e-8)


@pytest.mark.parametrize("entry", OURS, ids=str)
@given(seed=seeds)
def test_on_the_horizon_a_radar_without_elevation_is_planar(entry, seed):
    """A height that is known to be 0: what is left is the plane, number for number."""
    mean, cov = World(PLANE, FLAT).prior(seed)
    z = World(PLANE, FLAT).plot(mean, seed)
    flat = entry.update(World(PLANE, FLAT), mean, cov, z)
    keep = np.array([0, 1, 3, 4])
    raised, wide = np.zeros(6), np.diag([1e-12] * 6)
    raised[keep], wide[np.ix_(keep, keep)] = mean, cov
    post = entry.update(World(SPACE, FLAT), raised, wide, z)
    np.testing.assert_allclose(post.mean[keep], flat.mean, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(post.cov[np.ix_(keep, keep)], flat.cov, atol=1e-9 * np.max(cov))
    np.testing.assert_allclose([post.nis, post.loglik], [flat.nis, flat.loglik], rtol=1e-8)


@pytest.mark.parametrize("elevation", [0.0, 0.4, 1.0, 1.4])
@given(seed=seeds)
def test_an_elevation_that_is_not_measured_costs_a_second_order_error(elevation, seed):
    """Twice the distance from the prediction, four times the error; both components, no noise."""
    sensor = Radar(range_m=1e-6, azimuth_deg=1e-9)
    rng = np.random.default_rng(seed)
    azimuth, off = rng.uniform(-3, 3), rng.normal(size=3) * 20.0
    ground, up = 2e4 * np.cos(elevation), 2e4 * np.sin(elevation)
    mean = np.array([ground * np.cos(azimuth), ground * np.sin(azimuth), up, 0, 0, 0])
    prior, parts = Gaussian(mean, 1e-12 * np.eye(6)), sensor.components(SPACE)

    def left(scale):
        target = mean + scale * np.concatenate([off, np.zeros(3)])
        z = np.array([c.value(target) for c in parts])
        sight = sighted(prior, z, parts, SPACE, sensor)
        plot = read(sight, convert("ducm", sight.z, sight.sigma, sight.given))
        return plot.nu - plot.H @ (target - mean)

    bound = 1.5 * (off @ off) / (2e4 * np.cos(elevation))
    assert np.all(np.abs(left(1.0)) <= bound)
    np.testing.assert_allclose(left(2.0), 4.0 * left(1.0), atol=0.02 * bound)


@pytest.mark.parametrize("elevation_deg", [0.0, 30.0, 60.0, 80.0, 87.0, 90.0])
@pytest.mark.parametrize("name", ["ducm", "mucm"])
def test_without_elevation_the_filter_knows_its_errors_up_to_the_zenith(name, elevation_deg):
    """One scan of range, azimuth and height from 4,000 truths of the prior; 12 km, 0.3 degrees.

    The ANEES of a consistent filter is within 0.03 of 1 in 999 cases of 1,000; the sequential EKF
    has more than 1,000 at 87 degrees.
    """
    sensor = Radar(range_m=50.0, azimuth_deg=0.3, height_m=30.0, site=SITE)
    elevation, rng = np.radians(elevation_deg), np.random.default_rng(3)
    mean = np.array([12e3 * np.cos(elevation), 0.0, 12e3 * np.sin(elevation) + 100.0, 0, 0, 0])
    cov = np.diag([400.0, 400.0, 400.0, 50.0, 50.0, 50.0]) ** 2
    truth = mean + rng.normal(size=(4000, 6)) * np.sqrt(np.diag(cov))
    parts = sensor.components(SPACE)
    z = np.stack([c.value(truth.T) + c.sigma * rng.normal(size=4000) for c in parts], axis=-1)
    recursion = Entry(name).recursion(World(SPACE, sensor))
    start = Gaussian(mean, cov)
    found = run_recursion(recursion, z[:, None], 0.0, start, outputs=("mean", "cov", "status"))
    assert not found.status.any()
    e = (found.mean[:, 0] - truth)[..., None]
    assert np.mean(e.mT @ np.linalg.solve(found.cov[:, 0], e)) / 6 == pytest.approx(1.0, abs=0.05)


def updated(entry, world, mean, root, draws, asked):
    """Truths (draws, n) of the prior, and what a filter says after one plot of each."""
    rng = np.random.default_rng(4)
    truth = mean + rng.normal(size=(draws, len(mean))) @ root.T
    parts = world.sensor.components(world.motion)
    noise = world.sensor.coloured(rng.normal(size=(len(parts), draws)))
    z = [c.value(truth.T) + c.sigma * w for c, w in zip(parts, noise, strict=True)]
    plots, prior = np.stack(z, axis=-1)[:, None], Gaussian(mean, root @ root.T)
    return truth, run_recursion(entry.recursion(world), plots, 0.0, prior, outputs=asked)


def surprise(entry, world, mean, root, draws):
    """Mean NIS per component of one plot each, of truths drawn from the prior."""
    _, found = updated(entry, world, mean, root, draws, ["nis"])
    return found.nis.mean() / len(world.sensor.names)


@pytest.mark.parametrize("elevation_deg", [0.0, 20.0, 60.0])
def test_what_an_unknown_elevation_does_to_the_range_is_expected(elevation_deg):
    """Elevation known to 0.05 rad only, at 40 km: its curve is 50 m of range, the noise 30 m.

    200,000 truths of the prior; the standard error is 0.004.
    """
    elevation = np.radians(elevation_deg)
    low, high = np.cos(elevation), np.sin(elevation)
    frame = np.array([[low, 0, -high], [0, 1, 0], [high, 0, low]])  # along, across, upwards
    mean, root = np.zeros(6), np.diag([20.0, 100.0, 2e3, 1.0, 1.0, 1.0])
    mean[:3], root[:3] = 40e3 * frame[:, 0], frame @ root[:3]
    world = World(SPACE, Radar(range_m=30.0, azimuth_deg=0.3))
    assert surprise(Entry("ducm"), world, mean, root, 200_000) == pytest.approx(1.0, abs=0.02)


def test_at_the_horizon_an_unknown_elevation_costs_the_azimuth_nothing():
    """Azimuth known to 0.1 rad beforehand and to 0.3 degrees after, elevation to 0.05 rad."""
    mean, cov = np.array([40e3, 0, 0, 0, 0, 0.0]), np.diag([400.0, 4e3, 2e3, 9, 9, 9]) ** 2
    z, sharp = np.array([40e3, 0.0]), 40e3 * np.radians(0.3)
    post = Entry("ducm").update(World(SPACE, Radar(range_m=30.0, azimuth_deg=0.3)), mean, cov, z)
    assert np.sqrt(post.cov[1, 1]) == pytest.approx(sharp, rel=0.02)


@pytest.mark.parametrize("correlation", [-0.9, 0.0, 0.9])
def test_what_position_and_velocity_err_together_is_expected_of_the_range_rate(correlation):
    """Across, 500 m and 100 m/s, correlated by 0.9: at 15 km 3 m/s of range rate on average.

    200,000 truths of the prior; the standard error is about 0.005; without that mean it is 1.06.
    """
    radar = Radar(
        range_m=30.0, azimuth_deg=2.0, range_rate_mps=1.0, range_rate_correlation=correlation
    )
    mean, root = np.array([15e3, 0.0, -120.0, 0.0]), np.diag([50.0, 500.0, 0.5, 100.0])
    root[3, 1], root[3, 3] = 90.0, 100.0 * np.sqrt(1 - 0.81)
    found = surprise(Entry("range-rate"), World(PLANE, radar), mean, root, 200_000)
    assert found == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("name", ["ducm", "range-rate"])
def test_a_reported_height_is_used_before_the_range_that_needs_it(name):
    """Height known to 2 km beforehand and 30 m after: then range is worth its own 50 m."""
    rate = 1e3 if name == "range-rate" else None
    sensor = Radar(range_m=50.0, azimuth_deg=0.3, height_m=30.0, range_rate_mps=rate, site=SITE)
    mean, cov = np.array([20e3, 0, 6e3, 0, 0, 0.0]), np.diag([400.0, 400.0, 2e3, 9, 9, 9]) ** 2
    z = np.array([c.value(mean) for c in sensor.components(SPACE)])
    post = Entry(name).update(World(SPACE, sensor), mean, cov, z)
    along = mean[:3] / np.linalg.norm(mean[:3])
    assert np.sqrt(along @ post.cov[:3, :3] @ along) < 55.0


@given(seed=seeds)
def test_without_range_rate_the_tracker_is_ducm(seed):
    world = World(PLANE, CHIRP)
    mean, cov = world.prior(seed)
    z = world.plot(mean, seed)
    z[2] = np.nan
    ours, ducm = (Entry(name).update(world, mean, cov, z) for name in ("range-rate", "ducm"))
    for mine, theirs in zip(ours[:5], ducm[:5], strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-9 * np.max(np.abs(theirs)))


def test_a_speed_that_is_unknown_makes_the_product_less_certain():
    """Known to 300 m/s; 200 m of range at 2 km: 30 m/s of the product over the range, noise 1 m/s.

    20,000 truths of the prior; the standard error of the ratio is 0.02. It is 0.9, and 16 if
    the speed is taken for known.
    """
    radar = Radar(range_m=200.0, azimuth_deg=0.5, range_rate_mps=1.0)
    mean, root = np.array([2e3, 0.0, -120.0, 0.0]), np.diag([50.0, 50.0, 300.0, 1.0])
    entry, world = Entry("range-rate", {"persistence": 1.0}), World(PLANE, radar)
    truth, found = updated(entry, world, mean, root, 20_000, ("mean", "cov"))
    error = found.mean[:, 0, 2] - truth[:, 2]
    assert np.mean(error**2 / found.cov[:, 0, 2, 2]) == pytest.approx(1.0, abs=0.2)
