"""Fisher information against numerical differences, and what it leaves untold."""

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.experiments.bounds import bound_per_trajectory
from boresight.experiments.simulate import Plots, Truth
from boresight.filters import fisher
from boresight.filters.reversible import check_reversible
from boresight.maths import Gaussian
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Pose, Radar
from mixtures import heard
from oracles import pradeep as paper

DT = heard.every_second(801)
OWN = heard.OWN[:, ::-1]  # North, East
TARGET = np.column_stack(
    [
        paper.target(paper.TARGET)[:, ::-1],
        np.tile(paper.TARGET * paper.heading(paper.COURSE)[::-1], (801, 1)),
    ]
)
SIGMA = paper.SIGMA
STEADY = np.outer(np.arange(801.0), OWN[1] - OWN[0])  # own ship, had it never turned


def sensor_at(own):
    """Bearings heard from places (steps, 2), North and East."""
    return heard.bearings_from(own[:, ::-1])


def information(own, target=TARGET, **given):
    """(steps, 4, 4) of the paper's target."""
    ears = np.ones((1, len(own), 1), dtype=bool)
    args = target[None], heard.straight(), sensor_at(own), DT[:, : len(own)], ears
    return fisher.fisher_information(*args, **given)[0]


def by_differences(state, own, steps, sigma=SIGMA):
    """Sum of h h'/σ² about one state at the last step, h by central differences of a bearing."""
    ago = np.arange(steps) - (steps - 1.0)

    def bearings(x):
        at = x[:2] + ago[:, None] * x[2:] - own[:steps]
        return np.arctan2(at[:, 1], at[:, 0])

    columns = []
    for size, e in zip((0.1, 0.1, 1e-3, 1e-3), np.eye(4), strict=True):
        columns.append(paper.wrap(bearings(state + size * e) - bearings(state - size * e)) / size)
    H = np.stack(columns, axis=1) / 2.0
    return H.T @ H / sigma**2


def relative_difference(ours, expected):
    """Largest, each element in units of what the diagonal allows."""
    scale = np.sqrt(np.einsum("...ii->...i", expected))
    return np.max(np.abs(ours - expected) / (scale[..., :, None] * scale[..., None, :]))


@pytest.mark.parametrize("step", [3, 119, 150, 400, 800])
def test_is_the_sum_of_squared_gradients(step):
    expected = by_differences(TARGET[step], OWN, step + 1)
    assert relative_difference(information(OWN)[step], expected) < 1e-7


def test_steps_of_their_own_tracks_in_one_pass():
    along = information(OWN)[1:]
    at = np.arange(1, 801)
    args = heard.straight(), sensor_at(OWN), DT, np.ones((801, 1))
    through = fisher.information_through(TARGET[at], at, *args)
    assert relative_difference(through, along) < 1e-10
    backwards = fisher.information_through(TARGET[at[::-1]], at[::-1], *args)
    assert np.array_equal(backwards[::-1], through)


def test_with_a_prior_it_is_the_inverse_of_the_bound_in_covariance_form():
    cov = np.diag([3000.0, 2500.0, 11.0, 9.0]) ** 2
    ours = information(OWN, prior=np.linalg.inv(cov))
    times, names = np.arange(801.0), heard.straight().names
    truth = Truth(times, TARGET[None], names, TARGET[None, 0])
    plots = Plots(times, np.zeros((1, 801, 1)), DT, Gaussian(TARGET[0], cov))
    expected = bound_per_trajectory(truth, plots, heard.straight(), sensor_at(OWN))[0]
    assert relative_difference(fisher.bound(ours)[5:], expected[5:]) < 1e-6


def test_without_a_manoeuvre_everything_but_the_bearing_stays_untold():
    told = information(STEADY)
    sd = fisher.polar_bound(told, TARGET, STEADY)
    assert np.all(np.isinf(sd[:, [0, 2, 3]]))
    assert np.all(np.isfinite(sd[:, 1]))
    assert np.all(fisher.rank(told[2:]) == 3)
    assert np.all(fisher.rank(told[:2]) == [1, 2])
    assert np.all(np.isinf(np.einsum("kii->ki", fisher.bound(told))))


@pytest.mark.parametrize("away", [0.0, 1e4, 1e6])
@pytest.mark.parametrize("course", [0.0, 0.4, 2.0, 4.5])
def test_neither_place_nor_course_of_own_ship_makes_rounding_look_like_information(away, course):
    own = away + np.outer(np.arange(801.0), 10.3 * paper.heading(course)[::-1])
    target = TARGET + np.array([away, away, 0.0, 0.0])
    assert np.all(fisher.rank(information(own, target)[2:]) == 3)


def test_a_manoeuvre_tells_at_once_but_little_at_first():
    told = information(OWN)
    sd = fisher.polar_bound(told, TARGET, OWN)[:, 0]
    assert np.all(fisher.rank(told[:121]) < 4)
    assert np.all(fisher.rank(told[122:]) == 4)
    assert sd[125] > 10_000.0
    assert 500.0 > sd[150] > sd[180]


def test_own_ship_known_to_a_centimetre_tells_next_to_nothing_but_not_nothing():
    shaken = STEADY + 0.01 * np.random.default_rng(5).standard_normal(STEADY.shape)
    sd = fisher.polar_bound(information(shaken), TARGET, shaken)[-1, 0]
    assert 1e5 < sd < np.inf


def test_along_the_estimates_of_a_filter_ignorance_would_seem_to_be_knowledge():
    z = paper.measured(paper.target(paper.TARGET) - STEADY[:, ::-1], 1, seed=4)
    start = heard.earth_fixed(*heard.start_of(z), STEADY[:, ::-1])
    drifting = heard.filtered("ekf", z, STEADY[:, ::-1], start).mean[0]
    assert fisher.rank(information(STEADY, drifting)[-1]) == 4
    straight = drifting[-1] + (np.arange(801.0) - 800.0)[:, None] * np.hstack(
        [drifting[-1, 2:], 0.0, 0.0]
    )
    assert fisher.rank(information(STEADY, straight)[-1]) == 3


def test_what_is_not_heard_tells_nothing():
    ears = np.random.default_rng(2).random((801, 1)) < 0.4
    args = heard.straight(), sensor_at(OWN)
    some = fisher.fisher_information(TARGET[None], *args, DT, ears[None])[0, -1]
    kept = np.flatnonzero(ears[:, 0])
    dt = np.diff(kept, prepend=kept[0])[None].astype(float)
    fewer = heard.straight(), sensor_at(OWN[kept])
    alone = fisher.fisher_information(TARGET[None, kept], *fewer, dt, np.ones((1, len(kept), 1)))
    F = np.eye(4) + (kept[-1] - 800) * np.eye(4, k=2)
    assert relative_difference(some, F.T @ alone[0, -1] @ F) < 1e-10


def test_what_comes_before_the_first_bearing_does_not_matter():
    args = heard.straight(), sensor_at(OWN)
    late, ears = DT + 60.0 * np.eye(1, 801), np.ones((1, 801, 1))
    prior = np.diag(np.array([3000.0, 2500.0, 11.0, 9.0]) ** -2.0)
    found = fisher.fisher_information(TARGET[None], *args, late, ears, prior=prior)[0]
    assert np.array_equal(found, information(OWN, prior=prior))


def test_every_component_by_itself():
    both = Radar(range_m=30.0, azimuth_deg=0.33, pose=Pose(position_m=heard.up(heard.OWN)))
    ears = np.ones((1, 801, 2), dtype=bool)
    ears[..., 0] = False
    only = fisher.fisher_information(TARGET[None], heard.straight(), both, DT, ears)[0]
    assert np.array_equal(only, information(OWN))


def test_the_world_may_be_turned():
    c, s = np.cos(1.1), np.sin(1.1)
    turn = np.array([[c, -s], [s, c]])
    both = np.kron(np.eye(2), turn)
    there = fisher.polar_bound(
        information(OWN @ turn.T, TARGET @ both.T), TARGET @ both.T, OWN @ turn.T
    )
    here = fisher.polar_bound(information(OWN), TARGET, OWN)
    np.testing.assert_allclose(there[125:], here[125:], rtol=1e-6)


def test_the_bound_is_the_inverse_in_any_units():
    J = information(OWN)[400]
    units = np.array([1e-3, 1e5, 1e-6, 1e4])
    scaled = fisher.bound(J * np.outer(units, units)) * np.outer(units, units)
    expected = np.linalg.inv(J)
    assert relative_difference(scaled, expected) < 1e-8
    assert relative_difference(fisher.bound(J), expected) < 1e-8


def test_only_what_is_untold_is_infinite():
    cov = fisher.bound(np.diag([4.0, 0.0, 25.0]))
    np.testing.assert_array_equal(np.diag(cov), [0.25, np.inf, 0.04])
    assert np.isnan(cov[0, 1])
    assert cov[0, 2] == 0.0
    difference = np.array([[1.0, -1.0, 0.0]])
    rank_one = fisher.sd_of(np.outer([1.0, -1.0, 0.0], [1.0, -1.0, 0.0]), difference)
    assert rank_one == pytest.approx(1.0)  # a difference is told where neither term is


def test_polar_gradients_are_derivatives():
    own = np.array([120.0, -40.0])
    states = np.array([[900.0, -2000.0, 3.0, -7.0], [-800.0, 10.0, -11.0, 0.5]])

    def polar(x):
        away = x[:2] - own
        return np.array(
            [
                np.hypot(*away),
                np.arctan2(away[1], away[0]),
                np.arctan2(x[3], x[2]),
                np.hypot(*x[2:]),
            ]
        )

    for state, G in zip(states, fisher.polar_gradients(states, own), strict=True):
        for i, e in enumerate(1e-4 * np.eye(4)):
            moved = (polar(state + e) - polar(state - e)) / 2e-4
            np.testing.assert_allclose(G[:, i], moved, rtol=1e-6, atol=1e-9)


def test_polar_spreads_of_a_target_due_north():
    cov = np.diag([50.0, 20.0, 0.5, 0.2]) ** 2
    sd = fisher.polar_sd(cov, np.array([2000.0, 0.0, 10.0, 0.0]), np.zeros(2))
    np.testing.assert_allclose(sd, [50.0, 0.01, 0.02, 0.5])
    assert np.all(np.isfinite(fisher.polar_sd(cov, np.zeros(4), np.zeros(2))))


def test_refuses_what_it_cannot_do():
    args = TARGET[None], heard.straight(0.1), sensor_at(OWN), DT, np.ones((1, 801, 1))
    with pytest.raises(UsageError, match="without noise"):
        fisher.fisher_information(*args)
    by_step = ConstantVelocity(accel_mps2=np.linspace(0.0, 0.1, 801)[None], dims=2)
    with pytest.raises(UsageError, match="without noise"):
        fisher.fisher_information(args[0], by_step, *args[2:])
    with pytest.raises(UsageError, match="backwards"):
        check_reversible(OneWay(), 1.0)
    with pytest.raises(UsageError, match="without noise"):
        check_reversible(heard.straight(0.1), 0.0)  # a single plot has no step


class OneWay(ConstantVelocity):
    """A step of Euler's method: its backward step is another."""

    def __init__(self):
        super().__init__(accel_mps2=0.0, dims=2)

    def move(self, state, dt):
        return state + dt * np.array([state[2], state[3], -0.1 * state[3], 0.1 * state[2]])


def test_what_is_not_a_number_stays_that():
    J = np.stack([np.eye(4), np.full((4, 4), np.nan), np.full((4, 4), np.inf)])
    assert np.all(np.isnan(fisher.bound(J)[1:]))
    assert np.all(np.isnan(fisher.sd_of(J, np.eye(4))[1:]))
    assert np.array_equal(fisher.bound(J)[0], np.eye(4))
