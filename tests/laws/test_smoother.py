"""A smoother tells what all plots say: the posterior of the whole trajectory, step by step."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boresight as bs
from boresight import catalogue
from boresight.errors import UsageError
from boresight.experiments.metrics import anees, rmse, rmse_per_run
from boresight.experiments.scenario import lookup
from boresight.filters.recursion import Estimate, run_recursion
from boresight.filters.smoother import LINEARISATIONS, smooth
from boresight.maths import Gaussian
from boresight.models.motion import ConstantVelocity, Static
from boresight.testing.symmetries import matrices
from laws.enrolled import CURVED, LINEAR_WORLDS, MOTIONS, POLAR_WORLDS, Entry
from oracles import filters as textbook
from oracles import smoothers as oracle

STEPS, LANES = 6, 5
SET2 = lookup("kashyap-set-2")
EKF = Entry("ekf")
DT = np.array([[1.0, 2.0, 0.0, 0.5, 7.0, 3.0]])
seeds = st.integers(0, 2**32)
linearisations = pytest.mark.parametrize("linearisation", LINEARISATIONS)


def run(entry, world, plots, dt, prior):
    found = run_recursion(entry.recursion(world), plots, dt, prior, outputs=("mean", "cov"))
    return Gaussian(found.mean, found.cov)


def lanes_of(gaussian, *index):
    return Gaussian(*(part[index] for part in gaussian))


def same(a, b):
    for one, other in zip(a, b, strict=True):
        np.testing.assert_array_equal(one, other)


def close(a, b, share):
    """Each element to a share of its own standard deviation, covariances likewise."""
    sd = np.sqrt(np.diagonal(b.cov, axis1=-2, axis2=-1))
    assert np.max(np.abs(a.mean - b.mean) / sd) < share
    assert np.max(np.abs(a.cov - b.cov) / (sd[..., :, None] * sd[..., None, :])) < share


@cache
def filtered(world, entry=EKF):
    """What a filter says of a few lanes, a component here and there missing; nobody may write."""
    priors = [world.prior(lane) for lane in range(LANES)]
    start = Gaussian(*(np.stack(part) for part in zip(*priors, strict=True)))
    plots = np.array(
        [[world.plot(m, (lane, t)) for t in range(STEPS)] for lane, m in enumerate(start.mean)]
    )
    plots[np.random.default_rng(1).random(plots.shape) < 0.15] = np.nan
    found = run(entry, world, plots, DT, start)
    for part in found:
        part.flags.writeable = False
    return found


@pytest.mark.parametrize("world", LINEAR_WORLDS, ids=str)
@linearisations
@given(seed=seeds)
def test_equals_the_posterior_of_the_whole_trajectory(world, linearisation, seed):
    """Whole trajectory conditioned at once; the acceleration, too, changes from step to step."""
    mean, cov = world.prior(seed)
    rng = np.random.default_rng((seed, 2))
    accel, dt = rng.uniform(0.5, 3.0, (1, STEPS)), rng.uniform(0.1, 9.0, (1, STEPS))
    dt[0, seed % STEPS] = 0.0
    changing = replace(world, motion=replace(world.motion, accel_mps2=accel))
    H, R = matrices(world)
    plots = (H @ mean + rng.normal(scale=90.0, size=(STEPS, len(H))))[None]
    plots[rng.random(plots.shape) < 0.25] = np.nan
    before = run(Entry("kf", curved=False), changing, plots, dt, Gaussian(mean, cov))
    ours = smooth(before, dt, changing.motion, linearisation=linearisation)
    dims = world.motion.dims
    models = [textbook.discrete_velocity(t, a, dims) for t, a in zip(dt[0], accel[0], strict=True)]
    theirs = oracle.joint_posterior(mean, cov, *zip(*models, strict=True), plots[0], H, R)
    close(lanes_of(ours, 0), Gaussian(*theirs), 1e-6)


@pytest.mark.parametrize("world", POLAR_WORLDS, ids=str)
@linearisations
def test_a_curved_motion_enters_as_the_textbook_says(world, linearisation):
    before, moments = filtered(world), {"jacobian": oracle.tangent, "cubature": oracle.cubature}
    ours = smooth(before, DT, world.motion, linearisation=linearisation)
    for lane in range(LANES):
        theirs = oracle.smooth(*lanes_of(before, lane), DT[0], world.motion, moments[linearisation])
        close(lanes_of(ours, lane), Gaussian(*theirs), 1e-6)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda m: f"{type(m).__name__}-{m.dims}")
def test_every_motion_can_be_smoothed(motion):
    """Made-up estimates: the recursion is the textbook's whatever made them."""
    n = len(motion.names)
    rng = np.random.default_rng(3)
    root = rng.normal(size=(2, 3, n, n))
    before = Gaussian(rng.normal(size=(2, 3, n)) + 9.0, root @ root.swapaxes(-1, -2) + np.eye(n))
    ours = smooth(before, 0.1, motion)
    for lane in range(2):
        theirs = oracle.smooth(*lanes_of(before, lane), [0.1] * 3, motion, oracle.tangent)
        np.testing.assert_allclose(ours.mean[lane], theirs[0], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(ours.cov[lane], theirs[1], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("entry", CURVED, ids=str)
def test_every_filter_is_smoothed_to_a_positive_covariance_and_keeps_its_last_step(entry):
    before = filtered(POLAR_WORLDS[0], entry)
    ours = smooth(before, DT, POLAR_WORLDS[0].motion)
    same(lanes_of(ours, slice(None), -1), lanes_of(before, slice(None), -1))
    assert np.linalg.eigvalsh(ours.cov).min() > 0.0
    assert np.array_equal(ours.cov, ours.cov.swapaxes(-1, -2))


@pytest.mark.parametrize("world", [*LINEAR_WORLDS, *POLAR_WORLDS], ids=str)
def test_later_plots_never_make_an_estimate_less_certain(world):
    before = filtered(world)
    ours = smooth(before, DT, world.motion)
    sd = np.sqrt(np.diagonal(before.cov, axis1=-2, axis2=-1))
    gained = (before.cov - ours.cov) / (sd[..., :, None] * sd[..., None, :])
    assert np.linalg.eigvalsh(gained).min() > -1e-12
    assert np.linalg.eigvalsh(gained)[:, :-1].max(axis=(1, 2)).min() > 0.05  # and some gain a lot


def test_when_no_time_passes_the_smoothed_step_is_the_next_one():
    world = POLAR_WORLDS[0]
    ours = smooth(filtered(world), DT, world.motion)
    close(lanes_of(ours, slice(None), 1), lanes_of(ours, slice(None), 2), 1e-9)
    still = Static(drift_m_per_sqrt_s=0.0)
    cov = np.array([np.eye(3) * v for v in (9.0, 4.0, 1.0)])[None]
    ours = smooth(Gaussian(np.arange(9.0).reshape(1, 3, 3), cov), 5.0, still)
    np.testing.assert_allclose(ours.mean, np.broadcast_to([6.0, 7.0, 8.0], (1, 3, 3)), rtol=1e-14)
    np.testing.assert_allclose(ours.cov, np.broadcast_to(np.eye(3), (1, 3, 3, 3)), atol=1e-14)


@pytest.mark.parametrize("world", POLAR_WORLDS, ids=str)
@linearisations
def test_a_batch_is_its_lanes_bit_for_bit_and_inputs_are_left_alone(world, linearisation):
    before = filtered(world)
    copies = [part.copy() for part in before]
    batch = smooth(before, DT, world.motion, linearisation=linearisation, threads=2)
    for lane in range(LANES):
        alone = smooth(
            lanes_of(before, slice(lane, lane + 1)), DT, world.motion, linearisation=linearisation
        )
        same(lanes_of(alone, 0), lanes_of(batch, lane))
    same(before, copies)


def test_times_and_noises_may_be_shared_or_each_lane_s_own():
    world = POLAR_WORLDS[0]
    before = filtered(world)
    whole = smooth(before, DT, world.motion)
    same(smooth(before, np.repeat(DT, LANES, 0), world.motion), whole)
    loud = replace(world.motion, accel_mps2=np.full((LANES, STEPS), world.motion.accel_mps2))
    same(smooth(before, DT, loud), whole)
    each = replace(world.motion, accel_mps2=np.arange(1.0, LANES + 1)[:, None])
    periods = np.arange(2.0, LANES + 2)[:, None]
    mixed = smooth(before, periods, each)
    for lane in range(LANES):
        alone = lanes_of(before, slice(lane, lane + 1))
        own = replace(world.motion, accel_mps2=lane + 1.0)
        same(lanes_of(smooth(alone, lane + 2.0, own), 0), lanes_of(mixed, lane))


def test_a_lane_that_ends_is_smoothed_up_to_there_and_its_neighbours_do_not_notice():
    world = POLAR_WORLDS[0]
    before = filtered(world)
    whole = smooth(before, DT, world.motion)
    ended = Gaussian(*(part.copy() for part in before))
    ended.mean[2, 5] = np.nan
    ended.cov[2, 4:] = np.inf
    ours = smooth(ended, DT, world.motion)
    others = [lane for lane in range(LANES) if lane != 2]
    same(lanes_of(ours, others), lanes_of(whole, others))
    short = smooth(lanes_of(before, slice(2, 3), slice(4)), DT[:, :4], world.motion)
    same(lanes_of(ours, 2, slice(4)), lanes_of(short, 0))
    same(lanes_of(ours, 2, slice(4, None)), lanes_of(ended, 2, slice(4, None)))


def test_a_covariance_that_is_none_spoils_its_own_step_only():
    world = POLAR_WORLDS[0]
    before = filtered(world)
    spoilt = Gaussian(before.mean, before.cov.copy())
    spoilt.cov[1, 3, 0, 0] = -1.0
    ours = smooth(spoilt, DT, world.motion)
    assert np.isnan(ours.mean[1, 3]).all()
    same(
        lanes_of(ours, 1, slice(4, None)),
        lanes_of(smooth(before, DT, world.motion), 1, slice(4, None)),
    )
    assert np.linalg.eigvalsh(ours.cov[1, :3]).min() > 0.0


@given(seed=seeds)
def test_what_is_known_exactly_is_left_alone(seed):
    """A target that is somewhere on a line, at a known velocity without noise: all is the last."""
    rng = np.random.default_rng(seed)
    line, place, velocity = rng.normal(size=(3, 2))
    along = np.array([3.0, -2.0, 5.0])[:, None] * line
    mean = np.zeros((1, 3, 4))
    mean[0, :, :2] = place + along + np.arange(3.0)[:, None] * velocity
    mean[0, :, 2:] = velocity
    cov = np.zeros((1, 3, 4, 4))
    cov[0, :, :2, :2] = np.array([3.0, 1.5, 1.0])[:, None, None] * np.outer(line, line)
    ours = smooth(Gaussian(mean, cov), 1.0, ConstantVelocity(accel_mps2=0.0, dims=2))
    expected = mean.copy()
    expected[0, :, :2] = mean[0, -1, :2] + np.arange(-2.0, 1.0)[:, None] * velocity
    np.testing.assert_allclose(ours.mean, expected, atol=1e-9)
    np.testing.assert_allclose(ours.cov, np.broadcast_to(cov[:, -1:], cov.shape), atol=1e-9)


@pytest.mark.parametrize("sd_mps", [1e3, 1e4, 1e5])
@linearisations
def test_a_covariance_stays_positive_where_the_textbook_s_does_not(sd_mps, linearisation):
    """A velocity nearly unknown, then plots good to a millimetre: P - G (Pp - Ps) G' cancels."""
    world = replace(LINEAR_WORLDS[1], sensor=bs.PositionSensor(x_m=1e-3, y_m=1e-3))
    world = replace(world, motion=ConstantVelocity(accel_mps2=1e-4, dims=2))
    dt = np.array([[0.0, *[1.0] * 11]])
    prior = Gaussian(np.zeros(4), np.diag([1e6, 1e6, sd_mps**2, sd_mps**2]))
    before = run(EKF, world, np.zeros((1, 12, 2)), dt, prior)
    ours = smooth(before, dt, world.motion, linearisation=linearisation)
    sd = np.sqrt(np.diagonal(ours.cov, axis1=-2, axis2=-1))
    assert sd[..., :2].max() < 1.01e-3
    assert sd[..., 2:].max() < 2e-3
    assert np.linalg.eigvalsh(ours.cov / (sd[..., :, None] * sd[..., None, :])).min() > 0.01
    theirs = oracle.smooth(*lanes_of(before, 0), dt[0], world.motion, oracle.tangent)
    assert sd_mps < 1e5 or np.linalg.eigvalsh(theirs[1]).min() < 0.0


ANY = [  # that follows a radar's targets
    pytest.param(n, marks=[pytest.mark.slow] * (n != "ekf"))
    for n in catalogue.names()
    if n not in ("kf", "modified-polar") and not n.startswith("rp-")
]


@pytest.mark.parametrize("name", ANY)
def test_smoothed_errors_are_smaller_and_known(name):
    """kashyap's Set 2, 100 runs: paired by run; ANEES within 4 standard errors (1 in 16,000).

    The standard error is that of averages over a run; smoothed it is about 0.012. Noise that is
    taken from the plot biases each estimate the same way, which a smoother adds up: 1.03 to 1.08.
    """
    truth, plots = bs.simulate(SET2, runs=100, seed=5)
    before = bs.run(name, SET2.motion, SET2.sensor, plots)
    ours = bs.smooth(before, SET2.motion)
    for of in ("position", "velocity"):
        pairs = rmse_per_run(before, truth, of=of) - rmse_per_run(ours, truth, of=of)
        assert np.mean(pairs) > 5 * np.std(pairs) / np.sqrt(len(pairs))
        assert rmse(ours, truth, of=of) < 0.7 * rmse(before, truth, of=of)
    total = anees(ours, truth)
    beyond = 0.05 if name in ("cmkf", "cmkf-d", "ucm", "mucm", "mmse") else 0.0
    assert abs(total.value - 1.0) < beyond + 4 * total.standard_error
    assert total.low < total.value < total.high


def test_the_verb_takes_dt_from_the_estimate_the_plots_or_the_user():
    _, plots = bs.simulate(replace(SET2, scans=20), runs=2, seed=5)
    before = bs.run("ekf", SET2.motion, SET2.sensor, plots)
    carried = bs.smooth(before, SET2.motion)
    for dt in (plots, plots.dt):
        same((bs.smooth(before, SET2.motion, dt).mean,), (carried.mean,))
    other = bs.smooth(before, SET2.motion, 2.0)
    assert not np.array_equal(other.mean, carried.mean)
    two = bs.run("ekf", SET2.motion, SET2.sensor, plots.z, dt=1.0, start="two plots")
    two = bs.smooth(two, SET2.motion)  # both scans of the start show one and the same moment
    close(*(Gaussian(two.mean[:, i], two.cov[:, i]) for i in (0, 1)), 1e-9)
    assert carried.final is before.final


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"mean": None}, "'mean'"),
        ({"cov": None}, "'cov'"),
        ({"dt": None}, "'dt' cannot"),
        ({"mean": np.zeros((2, 6))}, r"\(lanes, steps, 6\)"),
        ({"cov": np.ones((2, 3, 6))}, r"\(lanes, steps, 6, 6\)"),
        ({"dt": np.ones((2, 4))}, "dt"),
        ({"linearisation": "unscented"}, "jacobian or cubature"),
    ],
)
def test_what_cannot_be_smoothed_is_refused(change, said):
    others = {"mean": np.zeros((2, 3, 6)), "cov": np.ones((2, 3, 6, 6)), "dt": 1.0} | change
    options = {"linearisation": others.pop("linearisation")} if "linearisation" in change else {}
    with pytest.raises(UsageError, match=said):
        bs.smooth(Estimate(others, None), ConstantVelocity(accel_mps2=0.5), **options)
