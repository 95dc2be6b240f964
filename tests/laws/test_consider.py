"""Laws of a consider filter: Schmidt's in a linear world, the plain one where nothing is uncertain.

Statistical tests fix their seeds and state how often they would fail by chance.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from boresight import catalogue
from boresight.errors import UsageError
from boresight.filters.consider import Consider, consider
from boresight.filters.recursion import OUTPUTS, Recursion, run_recursion
from boresight.filters.stream import Stream
from boresight.maths import Gaussian
from boresight.models.considered import Considered
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar
from boresight.models.systematic import SystematicErrors
from laws.enrolled import FLAT, PLANE, POINT, SPACE, World
from oracles import filters as textbook
from oracles import schmidt

CARRYING = ("ekf", "ekf-sequential", "iekf", "mekf", "mekf-block", "ducm", "ukf", "ckf", "iplf")
SIX = (
    "range_bias_m",
    "range_gain_m_per_km",
    "azimuth_bias_deg",
    "azimuth_cos_deg",
    "azimuth_sin_deg",
    "time_bias_s",
)
SPREADS = np.array([30.0, 0.4, 0.1, 0.05, 0.05, 0.8])
STEADY = SIX[:3]  # terms that time does not enter
RADAR = Radar(range_m=30.0, azimuth_deg=0.1)


@dataclass(frozen=True, kw_only=True)
class LinearErrors:
    """A sensor of coordinates whose plots err linearly by constants, for the textbook."""

    radar: Any
    cov: Any = field(metadata={"trailing": 2})
    effects: Any = field(metadata={"trailing": 2})

    @property
    def names(self):
        return self.radar.names

    def displaced(self, _state, motion):
        k, n = len(self.names), motion.own
        return np.concatenate([np.array(self.effects), np.zeros((n - k, len(motion.terms)))])

    def components(self, motion):
        own = motion.own
        return tuple(
            replace(part, value=lambda s, i=i: s[i] + self.effects[i] @ s[own:])
            for i, part in enumerate(self.radar.components(motion.inner))
        )


def covariance(rng, spreads):
    """A full covariance of about these standard deviations."""
    m = len(spreads)
    root = np.tril(rng.uniform(-0.5, 0.5, (m, m)), -1) + np.diag(rng.uniform(0.5, 1.2, m))
    return (root @ root.T) * np.outer(spreads, spreads)


@dataclass(frozen=True)
class Linear:
    """Many targets in a linear world, each with its own errors: starts, plots with holes, dt."""

    world: World
    lanes: int = 60
    scans: int = 4

    def __post_init__(self):
        made = [self.target(seed) for seed in range(self.lanes)]
        for name, part in zip(
            ("mean", "cov", "shared", "C", "D", "z"), zip(*made, strict=True), strict=True
        ):
            object.__setattr__(self, name, np.array(part))
        dt = np.random.default_rng(10).uniform(0.1, 20.0, self.lanes)
        object.__setattr__(self, "dt", dt)

    def target(self, seed):
        rng = np.random.default_rng((seed, 7))
        k, (mean, cov) = len(self.world.sensor.names), self.world.prior(seed)
        D, C = rng.normal(size=(k, 3)), covariance(rng, np.array([60.0, 25.0, 100.0]))
        B = rng.normal(size=(len(mean), 3))  # the share that the errors had in the start
        z = mean[:k] + rng.normal(scale=90.0, size=(self.scans, k))
        z[rng.random(z.shape) < 0.25] = np.nan
        z[-1, 0] = mean[0]
        return mean, cov + B @ C @ B.T, -B @ C, C, D, z

    def ours(self, name):
        """What a consider filter says at every scan."""
        inner = catalogue.lookup(name).recursion(self.world.motion, self.world.sensor)
        recursion = Recursion(
            Consider(inner=inner.method),
            Considered(inner=self.world.motion, terms=STEADY),
            LinearErrors(radar=self.world.sensor, cov=self.C, effects=self.D),
        )
        mean = np.concatenate([self.mean, np.zeros((self.lanes, 3))], axis=1)
        crossed = self.shared.swapaxes(1, 2)
        start = Gaussian(mean, np.block([[self.cov, self.shared], [crossed, self.C]]))
        return run_recursion(recursion, self.z, self.dt[:, None], start)

    def textbook(self, lane):
        """Schmidt's filter, scan by scan."""
        x, Pxx, Pxb = self.mean[lane], self.cov[lane], self.shared[lane]
        motion, sensor = self.world.motion, self.world.sensor
        F, Q = textbook.discrete_velocity(self.dt[lane], motion.accel_mps2, motion.dims)
        H = np.eye(len(sensor.names), len(x))
        R = np.diag([getattr(sensor, name) ** 2 for name in sensor.names])
        for z in self.z[lane]:
            x, Pxx, Pxb = schmidt.predict(x, Pxx, Pxb, F, Q)
            x, Pxx, Pxb, nis = schmidt.update(x, Pxx, Pxb, self.C[lane], z, H, self.D[lane], R)
            yield x, Pxx, Pxb, nis


WORLDS = (Linear(World(SPACE, POINT)), Linear(World(PLANE, FLAT)))


@pytest.mark.parametrize("linear", WORLDS, ids=lambda linear: str(linear.world))
@pytest.mark.parametrize("name", ["kf", *CARRYING])
def test_in_a_linear_world_it_is_schmidts_filter_with_plots_missing(name, linear):
    ours, n = linear.ours(name), linear.mean.shape[1]
    for lane in range(linear.lanes):
        for t, (x, Pxx, Pxb, nis) in enumerate(linear.textbook(lane)):
            cov = ours.cov[lane, t]
            for said, true in ((ours.mean[lane, t, :n], x), (cov[:n, :n], Pxx), (cov[:n, n:], Pxb)):
                size = np.abs(true).max()
                np.testing.assert_allclose(said, true, rtol=1e-8, atol=1e-8 * size)
            assert ours.nis[lane, t] == pytest.approx(nis, rel=1e-7, abs=1e-7)


def test_in_a_linear_world_it_is_never_surer_than_the_filter_that_knows_the_errors():
    linear = Linear(World(SPACE, POINT))
    object.__setattr__(linear, "shared", 0.0 * linear.shared)
    plain = catalogue.lookup("ekf").recursion(SPACE, POINT)
    start = Gaussian(linear.mean, linear.cov)
    known = run_recursion(plain, linear.z, linear.dt[:, None], start).cov
    ours = linear.ours("ekf").cov[..., :6, :6]
    size = np.sqrt(np.einsum("...ii->...i", ours))
    more = (ours - known) / (size[..., None] * size[..., None, :])
    assert np.linalg.eigvalsh(more).min() > -1e-8
    assert np.linalg.eigvalsh(more).max() > 0.1


def polar(name, cov, terms=SIX, radar=RADAR, accel_mps2=0.5):
    """A filter of a radar in the plane that considers these terms."""
    motion = ConstantVelocity(accel_mps2=accel_mps2, dims=radar_dims(radar))
    errors = SystematicErrors(terms=terms, estimate=np.zeros(len(terms)), cov=cov)
    return consider(catalogue.lookup(name).recursion(motion, radar), errors)


def radar_dims(radar):
    return 3 if radar.elevation_deg is not None else 2


def flights(lanes, scans, seed, dt=4.0):
    """Straight flights (lanes, scans, 4) 40 to 100 km out, at 100 to 250 m/s."""
    rng = np.random.default_rng((seed, 8))
    away, heading = rng.uniform(0, 2 * np.pi, (2, lanes, 1))
    far, speed = rng.uniform(4e4, 1e5, (lanes, 1)), rng.uniform(100, 250, (lanes, 1))
    time = dt * np.arange(scans)
    x = far * np.cos(away) + speed * np.cos(heading) * time
    y = far * np.sin(away) + speed * np.sin(heading) * time
    velocity = (speed * np.cos(heading) + 0 * time, speed * np.sin(heading) + 0 * time)
    return np.stack([x, y, *velocity], axis=-1)


def seen(truth, b, seed, radar=RADAR):
    """Plots (lanes, scans, 2) of a radar with errors b (lanes, 6), written out term by term.

    What is stamped t was measured b[5] before.
    """
    rng = np.random.default_rng((seed, 9))
    place = truth[..., :2] - b[:, None, 5:] * truth[..., 2:]
    r, az = np.hypot(place[..., 0], place[..., 1]), np.arctan2(place[..., 1], place[..., 0])
    noise = rng.standard_normal((2, *r.shape))
    off = b[:, 2:3] + b[:, 3:4] * np.cos(az) + b[:, 4:5] * np.sin(az)
    r = r + b[:, :1] + b[:, 1:2] * r / 1e3 + radar.range_m * noise[0]
    return np.stack([r, az + np.radians(off + radar.azimuth_deg * noise[1])], axis=-1)


def begun(recursion, z):
    """A start from one plot each; speeds may be up to some 250 m/s."""
    return recursion.method.start(z, recursion.motion, recursion.sensor, speed_mps=150.0)


@pytest.mark.parametrize("name", CARRYING)
def test_with_nothing_uncertain_it_is_the_plain_filter(name):
    truth = flights(6, 12, seed=1)
    z = seen(truth, np.zeros((6, 6)), seed=1)
    z[np.random.default_rng(2).random(z.shape) < 0.1] = np.nan
    z[:, 0] = seen(truth, np.zeros((6, 6)), seed=1)[:, 0]
    recursion = polar(name, np.zeros((6, 6)))
    plain = Recursion(recursion.method.inner, recursion.motion.inner, RADAR)
    start = begun(recursion, z[:, 0])
    ours = run_recursion(recursion, z[:, 1:], 4.0, start, outputs=OUTPUTS)
    own = Gaussian(start.mean[:, :4], start.cov[:, :4, :4])
    theirs = run_recursion(plain, z[:, 1:], 4.0, own, outputs=OUTPUTS)
    np.testing.assert_allclose(ours.mean[..., :4], theirs.mean, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(ours.cov[..., :4, :4], theirs.cov, rtol=1e-8, atol=1e-8)
    for key in ("nis", "loglik", "innovation", "variance", "status", "dof"):
        np.testing.assert_allclose(ours.others[key], theirs.others[key], rtol=1e-8, atol=1e-10)


def test_a_time_bias_moves_what_is_told_along_the_flight_and_nothing_else():
    truth = flights(6, 12, seed=3)
    z = seen(truth, np.zeros((6, 6)), seed=3)
    sd = 0.7
    recursion = polar("ekf", np.array([[sd**2]]), terms=("time_bias_s",))
    plain = Recursion(recursion.method.inner, recursion.motion.inner, RADAR)
    start = begun(recursion, z[:, 0])
    ours = run_recursion(recursion, z[:, 1:], 4.0, start)
    own = Gaussian(start.mean[:, :4], start.cov[:, :4, :4])
    theirs = run_recursion(plain, z[:, 1:], 4.0, own)
    np.testing.assert_allclose(ours.mean[..., :4], theirs.mean, rtol=1e-8)
    v, spread = theirs.mean[..., 2:], theirs.cov[..., 2:, 2:]
    added = sd**2 * (np.einsum("...i,...j->...ij", v, v) + spread)
    np.testing.assert_allclose(ours.cov[..., :2, :2], theirs.cov[..., :2, :2] + added, rtol=1e-8)
    np.testing.assert_allclose(ours.cov[..., :2, 4], sd**2 * v, rtol=1e-8)
    np.testing.assert_allclose(ours.nis, theirs.nis, rtol=1e-7)


def test_what_is_told_can_be_started_from():
    recursion = polar("ekf", covariance(np.random.default_rng(9), SPREADS))
    z = seen(flights(1, 9, seed=9), np.zeros((1, 6)), seed=9)
    start = begun(recursion, z[:, 0])
    kept = recursion.begin(start.mean[0], start.cov[0])
    for plot in z[0, 1:]:
        kept, results = recursion.step(kept, {"z": plot, "dt": 4.0})
    again = recursion.begin(results["mean"], results["cov"])
    product = results["cov"][2:4, 2:4] * results["cov"][-1, -1]  # of uncertain speed and time bias
    again["cov"][:2, :2] -= product
    for key, value in kept.items():
        np.testing.assert_allclose(again[key], value, rtol=1e-6, atol=1e-6, err_msg=key)


@pytest.mark.parametrize("name", CARRYING)
def test_an_empty_plot_changes_nothing_bit_for_bit(name):
    recursion = polar(name, covariance(np.random.default_rng(4), SPREADS))
    start = begun(recursion, seen(flights(1, 1, seed=4), np.zeros((1, 6)), seed=4)[:, 0])
    state = recursion.begin(start.mean[0], start.cov[0])
    inputs = {"z": np.full(2, np.nan), "dt": 0.0}
    for key, value in recursion.step(state, inputs)[0].items():
        np.testing.assert_array_equal(value, state[key])


@pytest.mark.parametrize("name", CARRYING)
def test_a_batch_is_its_lanes_bit_for_bit_and_a_stream_is_the_batch(name):
    recursion = polar(name, covariance(np.random.default_rng(5), SPREADS))
    z = seen(flights(5, 6, seed=5), np.zeros((5, 6)), seed=5)
    start, z = begun(recursion, z[:, 0]), z[:, 1:]
    z[1, 2, 0] = np.nan
    batch = run_recursion(recursion, z, 4.0, start, outputs=OUTPUTS)
    for lane in range(5):
        one = Gaussian(start.mean[lane : lane + 1], start.cov[lane : lane + 1])
        alone = run_recursion(recursion, z[lane : lane + 1], 4.0, one, outputs=OUTPUTS)
        for output in OUTPUTS:
            np.testing.assert_array_equal(alone.others[output][0], batch.others[output][lane])
    stream = Stream(recursion)
    state = stream.start(Gaussian(start.mean[3], start.cov[3]))
    for t in range(z.shape[1]):
        state = stream(state, z[3, t], 4.0)
        # Another program, whose multiply-adds may be fused elsewhere.
        np.testing.assert_allclose(state.cov, batch.cov[3, t], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["ekf", "mekf", "ckf"])
def test_over_many_plots_the_joint_covariance_stays_one_and_the_errors_keep_theirs(name):
    C = covariance(np.random.default_rng(6), SPREADS)
    recursion = polar(name, C, accel_mps2=0.05)
    z = seen(flights(8, 400, seed=6), np.zeros((8, 6)), seed=6)
    found = run_recursion(
        recursion, z[:, 1:], 4.0, begun(recursion, z[:, 0]), outputs=("cov", "status")
    )
    scale = np.sqrt(np.einsum("...ii->...i", found.cov))
    correlation = found.cov / (scale[..., None] * scale[..., None, :])
    assert np.linalg.eigvalsh(correlation).min() > 0.0
    assert not found.status.any()
    np.testing.assert_array_equal(found.cov[..., 4:, 4:], np.broadcast_to(C, (8, 399, 6, 6)))


@pytest.mark.parametrize("name", ["ekf", "mekf", "ckf"])
def test_its_covariance_is_right_where_the_plain_filters_is_far_too_small(name):
    # 400 flights, each with errors drawn from their covariance: NEES at one scan is the mean of
    # 1,600 squares, sd sqrt(2 / 1600) = 0.035. Four scans within 4.5 sd: 3e-5 false alarms.
    rng = np.random.default_rng(7)
    C = covariance(rng, SPREADS)
    b = rng.multivariate_normal(np.zeros(6), C, size=400)
    truth = flights(400, 60, seed=7)
    z = seen(truth, b, seed=7)
    recursion = polar(name, C, accel_mps2=1e-4)
    start = begun(recursion, z[:, 0])
    ours = run_recursion(recursion, z[:, 1:], 4.0, start)
    plain = Recursion(recursion.method.inner, recursion.motion.inner, RADAR)
    alone = plain.method.start(z[:, 0], plain.motion, RADAR, speed_mps=150.0)
    theirs = run_recursion(plain, z[:, 1:], 4.0, alone)
    for t in (4, 14, 34, 58):
        error = truth[:, t + 1] - ours.mean[:, t, :4]
        assert abs(nees(error, ours.cov[:, t, :4, :4]) - 1.0) < 4.5 * 0.035
        error = truth[:, t + 1] - theirs.mean[:, t]
        assert nees(error, theirs.cov[:, t]) > 3.0


def test_a_bias_of_range_that_bends_a_passing_path_is_carried_too():
    # Flying straight past a radar that is 120 m off in range seems a turn: 5 mm/s² at 40 km.
    # 400 flights: NEES as above, four scans within 4.5 sd; that of a filter that takes seen paths
    # for straight is beyond 10 at the last.
    C = np.array([[120.0**2]])
    b = np.zeros((400, 6))
    b[:, 0] = 120.0 * np.random.default_rng(11).standard_normal(400)
    truth = flights(400, 100, seed=11)
    z = seen(truth, b, seed=11)
    recursion = polar("ekf", C, terms=SIX[:1], accel_mps2=1e-4)
    ours = run_recursion(recursion, z[:, 1:], 4.0, begun(recursion, z[:, 0]))
    for t in (4, 34, 68, 98):
        error = truth[:, t + 1] - ours.mean[:, t, :4]
        assert abs(nees(error, ours.cov[:, t, :4, :4]) - 1.0) < 4.5 * 0.035


def nees(error, cov):
    """Mean over lanes of the normalised squared error, for each state."""
    return float(
        np.einsum("li,lij,lj->l", error, np.linalg.inv(cov), error).mean() / error.shape[1]
    )


def test_its_innovations_are_as_large_as_it_says():
    # 400 flights of 59 plots; flights are independent, innovations of one nearly so. NIS is the
    # mean of 47,200 squares, sd 0.0065 were they independent; 0.05 is some 7 sd.
    rng = np.random.default_rng(8)
    C = covariance(rng, SPREADS)
    z = seen(flights(400, 60, seed=8), rng.multivariate_normal(np.zeros(6), C, size=400), seed=8)
    recursion = polar("ekf", C, accel_mps2=1e-4)
    nis = run_recursion(recursion, z[:, 1:], 4.0, begun(recursion, z[:, 0])).nis
    assert abs(nis[:, 4:].mean() / 2.0 - 1.0) < 0.05


@pytest.mark.parametrize(
    "radar", [RADAR, replace(RADAR, elevation_deg=0.2)], ids=["plane", "space"]
)
def test_a_start_errs_as_its_plot_does(radar):
    # Beside the place of a plot to which one unit of a term is added, a ten-thousandth at a time.
    dims = radar_dims(radar)
    terms = SIX[:5] + (("elevation_bias_deg",) if dims == 3 else ())
    z = np.array([[6e4, 0.7, 0.15], [9e4, -2.9, 0.05]])[:, :dims]
    recursion = polar("ekf", np.eye(len(terms)), terms=terms, radar=radar)
    start = begun(recursion, z)
    shift = -start.cov[:, :dims, 2 * dims :]  # with a unit covariance
    for j, term in enumerate(terms):
        small = np.zeros(len(terms))
        small[j] = 1e-4
        dirty = np.array(z)
        dirty[:, 0] += small[0] + small[1] * z[:, 0] / 1e3
        dirty[:, 1] += np.radians(
            small[2] + small[3] * np.cos(z[:, 1]) + small[4] * np.sin(z[:, 1])
        )
        if dims == 3:
            dirty[:, 2] += np.radians(small[5])
        found = (begun(recursion, dirty).mean - start.mean)[:, :dims] / 1e-4
        np.testing.assert_allclose(shift[:, :, j], found, rtol=1e-4, atol=1e-3, err_msg=term)


@pytest.mark.parametrize("name", ["ckf-spherical", "line-of-sight"])
def test_filters_that_keep_or_take_something_else_refuse(name):
    with pytest.raises(UsageError, match="cannot carry"):
        polar(name, np.eye(6))
