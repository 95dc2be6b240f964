"""The batch estimate against SciPy's least squares, numerical derivatives and its laws."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from boresight.errors import UsageError
from boresight.filters import batch, kalman
from boresight.filters.recursion import Recursion, run_recursion
from boresight.filters.steps import Updating
from boresight.maths import Gaussian
from boresight.models.coordinates import PositionSensor
from boresight.models.sensors import Bearings, ConicalBearings, Pose
from mixtures import heard
from oracles import pradeep as paper

STEPS = 301
AWAY = np.array([700.0, -2_500.0])  # own ship does not begin at the origin
OWN = AWAY + heard.OWN[:STEPS, ::-1]  # North, East
COURSE_SPEED = paper.TARGET * paper.heading(paper.COURSE)[::-1]
LAST = np.hstack([AWAY + paper.target(paper.TARGET)[STEPS - 1, ::-1], COURSE_SPEED])
DT = heard.every_second(STEPS)
SPEED = 11.0
PRIOR = batch.range_prior(heard.straight(), SPEED, 1_000.0, 20_000.0)


def bearings_of(last, own=OWN):
    """(steps,) of a straight track, by its last state."""
    ago = np.arange(len(own)) - (len(own) - 1.0)
    at = last[:2] + ago[:, None] * last[2:] - own
    return np.arctan2(at[:, 1], at[:, 0])


def noisy(lanes, seed=1, own=OWN, last=LAST):
    """(lanes, steps, 1) plots."""
    noise = np.random.default_rng(seed).standard_normal((lanes, len(own)))
    return paper.wrap(bearings_of(last, own) + paper.SIGMA * noise)[..., None]


def started(z, own=OWN, ranges=(2_000.0, 5_000.0, 12_000.0)):
    """(lanes, starts, 4): at rest at some ranges on the last bearing."""
    b = z[:, -1, :]
    along = np.stack([np.cos(b), np.sin(b)], axis=-1)
    spots = own[-1] + np.array(ranges)[:, None] * along
    return np.concatenate([spots, np.zeros_like(spots)], axis=-1)


def fit(z, own=OWN, *, prior=PRIOR, starts=None, **given):
    """The batch estimate of bearings heard from places (steps, 2)."""
    starts = started(z, own) if starts is None else starts
    sensor = heard.bearings_from(own[:, ::-1])
    dt = heard.every_second(len(own))
    return batch.batch_map(z, heard.straight(), sensor, dt, prior=prior, starts=starts, **given)


def residuals(x, z, own=OWN, *, prior=True):
    """All that is squared, each over its standard deviation; z (steps,)."""
    heard_at = np.isfinite(z)
    parts = [paper.wrap(z - bearings_of(x, own))[heard_at] / paper.SIGMA]
    if prior:
        first = x[:2] - (len(own) - 1.0) * x[2:] - own[0]
        spread = 19_000.0 / np.sqrt(12.0)
        parts += [x[2:] / SPEED, [(np.hypot(*first) - 10_500.0) / spread]]
    return np.concatenate(parts)


def in_sds(difference, cov):
    """Length (lanes,) in standard deviations."""
    return np.sqrt(np.einsum("li,lij,lj->l", difference, np.linalg.inv(cov), difference))


@pytest.mark.parametrize("prior", [True, False])
def test_equals_scipy_to_a_millionth_of_a_standard_deviation(prior):
    z = noisy(4)
    ours = fit(z, prior=PRIOR if prior else None)
    assert ours.converged.all()
    for lane in range(4):
        found = least_squares(
            lambda x: residuals(x, z[lane, :, 0], prior=prior),  # noqa: B023 - used at once
            LAST,
            x_scale=np.sqrt(np.diag(ours.cov[lane])),
            jac="3-point",
            method="lm",
            ftol=1e-15,
            xtol=1e-15,
            gtol=1e-15,
        )
        assert in_sds(ours.mean[[lane]] - found.x, ours.cov[[lane]]) < 1e-6
        assert ours.cost[lane] == pytest.approx(found.cost, rel=1e-12)


def test_the_cost_is_level_at_the_solution():
    z = noisy(3, seed=2)
    ours = fit(z)
    for lane in range(3):
        x, root = ours.mean[lane], np.linalg.cholesky(ours.cov[lane])
        for e in 1e-3 * root.T:
            there, back = (np.sum(residuals(x + s * e, z[lane, :, 0]) ** 2) / 2 for s in (1, -1))
            assert abs(there - back) / 2e-3 < 1e-6  # per standard deviation, of a cost of 150


def test_information_is_the_curvature_of_the_problem_without_noise():
    z = bearings_of(LAST)[None, :, None]
    ours = fit(z, prior=None)
    sd = np.sqrt(np.diag(ours.cov[0]))
    steps = np.diag(0.02 * sd)

    def cost(x):
        return np.sum(residuals(x, z[0, :, 0], prior=False) ** 2) / 2.0

    hessian = [
        [
            sum(s * t * cost(ours.mean[0] + s * a + t * b) for s in (1, -1) for t in (1, -1)) / 4.0
            for b in steps
        ]
        for a in steps
    ]
    expected = np.array(hessian) / np.outer(0.02 * sd, 0.02 * sd)
    scale = np.sqrt(np.diag(expected))
    assert np.max(np.abs(ours.information[0] - expected) / np.outer(scale, scale)) < 1e-4
    np.testing.assert_allclose(ours.cov[0] @ ours.information[0], np.eye(4), atol=1e-6)
    assert in_sds(ours.mean - LAST, ours.cov) < 1e-6


def test_residuals_are_what_the_track_leaves():
    z = noisy(2)
    z[0, 17:40] = np.nan
    ours = fit(z)
    for lane in range(2):
        expected = paper.wrap(z[lane, :, 0] - bearings_of(ours.mean[lane]))
        np.testing.assert_allclose(ours.residual[lane, :, 0], expected, atol=1e-12)
    back = ours.first[:, :2] + 300.0 * ours.first[:, 2:]
    np.testing.assert_allclose(back, ours.mean[:, :2], atol=1e-6)


def test_a_missing_bearing_is_one_that_was_never_there():
    z = noisy(1)
    kept = np.random.default_rng(3).random(STEPS) < 0.6
    kept[[0, -1]] = True
    some = np.where(kept[None, :, None], z, np.nan)
    times = np.flatnonzero(kept)
    sensor = heard.bearings_from(OWN[kept][:, ::-1])
    dt = np.diff(times, prepend=0)[None].astype(float)
    alone = batch.batch_map(
        z[:, kept], heard.straight(), sensor, dt, prior=PRIOR, starts=started(z)
    )
    assert in_sds(fit(some).mean - alone.mean, alone.cov) < 1e-6


def test_a_full_turn_more_changes_nothing():
    z = noisy(2)
    more = z + 2.0 * np.pi * np.random.default_rng(0).integers(-2, 3, z.shape)
    there, here = fit(more, starts=started(z)), fit(z)
    assert np.all(in_sds(there.mean - here.mean, here.cov) < 1e-6)


def test_a_turned_world_gives_a_turned_track():
    c, s = np.cos(2.3), np.sin(2.3)
    turn = np.kron(np.eye(2), [[c, -s], [s, c]])
    z = noisy(3)
    there = fit(paper.wrap(z + 2.3), OWN @ turn[:2, :2].T)
    here = fit(z)
    assert np.all(in_sds(there.mean @ turn - here.mean, here.cov) < 1e-6)
    np.testing.assert_allclose(there.cost, here.cost, rtol=1e-9)


def test_lanes_do_not_touch_each_other():
    z = noisy(11)
    z[4, 30:] = np.nan  # takes longer than the others
    together = fit(z, starts=started(noisy(11)))
    for lane in (0, 3, 10):
        alone = fit(z[[lane, 4]], starts=started(noisy(11))[[lane, 4]])
        assert np.array_equal(alone.mean[0], together.mean[lane])
        assert np.array_equal(alone.information[0], together.information[lane])


def test_the_lowest_cost_wins_whatever_the_order_of_the_starts():
    z = noisy(5, seed=4)
    starts = started(z, ranges=(300.0, 4_000.0, 60_000.0, 9_000.0))
    one, other = fit(z, starts=starts), fit(z, starts=starts[:, ::-1])
    assert np.all(one.cost <= one.costs.min(axis=1))
    assert np.all(in_sds(one.mean - other.mean, one.cov) < 1e-6)


def test_a_start_is_where_the_track_ends():
    """Without a step; what comes before the first bearing does not count."""
    z, starts = noisy(2), np.tile(LAST + np.array([40.0, -30.0, 0.5, -0.25]), (2, 1, 1))
    ours = fit(z, starts=starts, iterations=0)
    np.testing.assert_allclose(ours.mean, starts[:, 0], rtol=1e-12)
    np.testing.assert_allclose(
        ours.first[:, :2], starts[:, 0, :2] - 300.0 * starts[:, 0, 2:], rtol=1e-12
    )
    late = DT + 77.0 * np.eye(1, STEPS)
    sensor = heard.bearings_from(OWN[:, ::-1])
    again = batch.batch_map(z, heard.straight(), sensor, late, prior=PRIOR, starts=starts)
    assert np.array_equal(again.mean, fit(z, starts=starts).mean)


def test_says_when_it_has_not_settled():
    z = noisy(2)
    assert not fit(z, iterations=1).converged.any()
    starts = started(z)
    starts[0] = np.nan
    ours = fit(z, starts=starts)
    assert list(ours.converged) == [False, True]


def test_a_linear_world_is_kalmans():
    generator = np.random.default_rng(6)
    first = Gaussian(np.array([100.0, -50.0, 3.0, 1.0]), np.diag([40.0, 30.0, 5.0, 4.0]) ** 2)
    sensor = PositionSensor(x_m=20.0, y_m=35.0)
    z = np.cumsum(generator.standard_normal((2, 50, 2)) * 30.0, axis=1)
    z[0, 7, 1] = np.nan
    dt = heard.every_second(50)
    ours = batch.batch_map(
        z,
        heard.straight(),
        sensor,
        dt,
        prior=batch.gaussian_prior(first),
        starts=np.ones((2, 1, 4)),
    )
    method = Updating(formula=kalman.update_plot)
    filtered = run_recursion(Recursion(method, heard.straight(), sensor), z, dt, first)
    np.testing.assert_allclose(ours.mean, filtered.mean[:, -1], rtol=1e-9)
    np.testing.assert_allclose(ours.cov, filtered.cov[:, -1], rtol=1e-7, atol=1e-9)


def test_of_a_cone_the_side_that_fits():
    way = np.gradient(OWN, axis=0)
    axis = np.arctan2(way[:, 1], way[:, 0])
    cone = np.abs(paper.wrap(bearings_of(LAST) - axis))
    noise = paper.SIGMA * np.random.default_rng(8).standard_normal(STEPS)
    c, s, o, i = np.cos(axis), np.sin(axis), np.zeros(STEPS), np.ones(STEPS)
    turned = np.moveaxis(np.array([[c, s, o], [-s, c, o], [o, o, i]]), -1, 0)[None]
    pose = Pose(position_m=heard.up(OWN[:, ::-1]), rotation=turned)
    z = (cone + noise)[None, :, None]
    on_sides = np.concatenate([started((axis + f * cone)[None, :, None]) for f in (1, -1)], axis=1)
    ours = batch.batch_map(
        z,
        heard.straight(),
        ConicalBearings(cone_deg=0.33, pose=pose),
        DT,
        prior=PRIOR,
        starts=on_sides,
    )
    assert ours.converged.all()
    assert in_sds(ours.mean - LAST, ours.cov) < 4.0  # four degrees of freedom: 1 in 320 by chance


def test_without_a_manoeuvre_the_range_that_is_believed_keeps_it_off_own_ship():
    own = AWAY + np.outer(np.arange(120.0), OWN[1] - OWN[0])
    last = LAST - np.hstack([181.0 * COURSE_SPEED, 0.0, 0.0])
    z = noisy(20, own=own, last=last)
    ours = fit(z, own)
    away = np.hypot(*(ours.mean[:, :2] - own[-1]).T)
    assert ours.converged.all()
    assert np.all((away > 1_000.0) & (away < 20_000.0))
    bare = fit(z, own, prior=batch.velocity_prior(heard.straight(), SPEED))
    assert np.median(np.hypot(*(bare.mean[:, :2] - own[-1]).T)) < 1.0


def test_refuses_what_does_not_fit():
    z = noisy(2)
    with pytest.raises(UsageError, match="do not fit"):
        fit(z, starts=started(z)[0])
    with pytest.raises(UsageError, match="do not fit"):
        fit(np.concatenate([z, z], axis=-1), starts=started(z))
    by_lane = Bearings(azimuth_deg=np.array([[0.3], [0.4]]))
    with pytest.raises(UsageError, match="lane to lane"):
        batch.batch_map(z, heard.straight(), by_lane, DT, prior=None, starts=started(z))
    with pytest.raises(UsageError, match="without noise"):
        batch.batch_map(
            z, heard.straight(0.1), Bearings(azimuth_deg=0.3), DT, prior=None, starts=started(z)
        )
