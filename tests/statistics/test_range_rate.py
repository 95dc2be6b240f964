"""Range-rate tracker against the bound and against the tracker without Doppler: acceptance 9.

A target passes 15 km away at 160 m/s, 60 scans of 2 s; its start is known to the plot's accuracy
across and to 100 m/s. 2,000 runs, fixed seeds: standard errors are 0.5 % of an averaged ratio and
0.006 of an averaged ANEES. Three radars: one whose range is coarse (200 m, 0.5 degrees, 1 m/s), for
which Doppler is worth most; one of 30 m and 1 degree; and a hard one of 30 m and 5 degrees, where
the EKF is lost in three runs of ten, and ours in one of a thousand.
"""

from functools import cache

import numpy as np
import pytest

from boresight.errors import UsageError
from boresight.experiments.bounds import average_in_covariance, bound_per_trajectory
from boresight.experiments.metrics import anees, anis, nees, rmse, rmse_per_run, rmse_per_scan
from boresight.experiments.montecarlo import filtered
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import simulate
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Pose, Radar

correlated = pytest.mark.parametrize("correlation", [-0.9, 0.0, 0.9])
radars = pytest.mark.parametrize(("range_m", "azimuth_deg"), [(200.0, 0.5), (30.0, 1.0)])
RUNS, EARLY = 2000, slice(1, 8)
LOST = 10.0  # NEES of a run, a state: errors three times what the filter claims


@cache
def passing(range_m, azimuth_deg, correlation, dims=2):
    """The scenario's runs: world, truth, plots."""
    across = 15e3 * np.radians(azimuth_deg)
    initial = np.array([12e3, 9e3, 2e3, -150.0, 60.0, 5.0])
    spread = np.array([across, across, across, 100.0, 100.0, 100.0])
    keep = [0, 1, 3, 4] if dims == 2 else [0, 1, 2, 3, 4, 5]
    world = Scenario(
        name=f"passing {azimuth_deg}",
        motion=ConstantVelocity(accel_mps2=1.0, dims=dims),
        sensor=Radar(
            range_m=range_m,
            azimuth_deg=azimuth_deg,
            elevation_deg=azimuth_deg if dims == 3 else None,
            range_rate_mps=1.0,
            range_rate_correlation=correlation,
        ),
        initial=initial[keep],
        prior_cov=np.diag(spread[keep] ** 2),
        dt_s=2.0,
        scans=60,
    )
    return (world, *simulate(world, runs=RUNS, seed=5))


def without_doppler(plots):
    z = plots.z.copy()
    z[..., -1] = np.nan
    return plots._replace(z=z)


def over_bound(world, truth, plots, estimate):
    bound = bound_per_trajectory(truth, plots, world.motion, world.sensor)
    return rmse(estimate, truth) / average_in_covariance(bound, truth.names)


@radars
@correlated
def test_near_the_bound_and_knows_its_errors(range_m, azimuth_deg, correlation):
    world, truth, plots = passing(range_m, azimuth_deg, correlation)
    found = filtered("range-rate", world.motion, world.sensor, plots)
    assert over_bound(world, truth, plots, found) <= 1.05
    assert 0.9 <= anees(found, truth).value <= 1.1
    assert anis(found).value == pytest.approx(1.0, abs=0.03)


@correlated
def test_in_space_too(correlation):
    world, truth, plots = passing(30.0, 1.0, correlation, dims=3)
    found = filtered("range-rate", world.motion, world.sensor, plots)
    assert over_bound(world, truth, plots, found) <= 1.10
    assert 0.9 <= anees(found, truth).value <= 1.1


@correlated
def test_early_velocity_is_far_better_than_without_doppler(correlation):
    """Scans 2 to 8, 200 m and 0.5 degrees; the very first has one velocity of two: 0.71."""
    world, truth, plots = passing(200.0, 0.5, correlation)
    models = world.motion, world.sensor
    ours = rmse_per_scan(filtered("range-rate", *models, plots), truth, of="velocity")
    plain = rmse_per_scan(filtered("ducm", *models, without_doppler(plots)), truth, of="velocity")
    assert np.all(ours[EARLY] <= 0.6 * plain[EARLY])


@correlated
def test_where_the_bound_allows_less_velocity_gains_less(correlation):
    """30 m and 1 degree: the bounds themselves are 0.52 to 0.87 apart; ours gains 0.70 to 0.88."""
    world, truth, plots = passing(30.0, 1.0, correlation)
    models = world.motion, world.sensor
    ours = rmse_per_scan(filtered("range-rate", *models, plots), truth, of="velocity")
    plain = rmse_per_scan(filtered("ducm", *models, without_doppler(plots)), truth, of="velocity")
    assert np.all(ours <= 0.92 * plain)


@correlated
def test_five_degrees_lose_one_target_in_a_thousand(correlation):
    """Where DUCM followed by an EKF's range rate has an ANEES over 20.

    In 36 draws of 2,000 runs 0 to 6 were lost, 1.9 in the mean (more than 10 once in 10^5); the
    others had an ANEES of 0.99 to 1.02 and 1.08 to 1.104 of the bound, standard error 0.007, and
    0.90 of the error without Doppler. With the lost ones the ANEES of all is 1.0 to 3.4.
    """
    world, truth, plots = passing(30.0, 5.0, correlation)
    models = world.motion, world.sensor
    ours = filtered("range-rate", *models, plots)
    bare = filtered("ducm", *models, without_doppler(plots))
    squares = np.mean(nees(ours, truth), axis=1) / 4
    kept = squares < LOST
    assert np.sum(~kept) <= 10
    assert 0.9 <= np.mean(squares[kept]) <= 1.1
    bound = average_in_covariance(
        bound_per_trajectory(truth, plots, world.motion, world.sensor), truth.names
    )
    error, without = (
        np.sqrt(np.mean(np.square(rmse_per_run(found, truth)[kept]))) for found in (ours, bare)
    )
    assert error <= 1.13 * bound
    assert error < 0.94 * without
    assert rmse(ours, truth, of="velocity") < 0.9 * rmse(bare, truth, of="velocity")
    assert anees(filtered("ducm", *models, plots), truth).value > 20.0


def test_what_is_averaged_away_loses_the_target():
    """Why `persistence` is: left at 0, the product of errors passes for noise of each plot."""
    world, truth, plots = passing(30.0, 5.0, 0.0)
    found = filtered("range-rate", world.motion, world.sensor, plots, settings={"persistence": 0.0})
    assert anees(found, truth).value > 10.0
    with pytest.raises(UsageError, match="persistence"):
        filtered("range-rate", world.motion, world.sensor, plots, settings={"persistence": -1.0})


@correlated
def test_a_moving_platform_sees_the_same(correlation):
    """A platform at 90 m/s, its own motion in the range rate: as good as one at rest."""
    world, _, plots = passing(30.0, 1.0, correlation)
    velocity = np.array([60.0, -67.0, 0.0])
    place = plots.time_s[:, None] * velocity
    pose = Pose(position_m=place[None], velocity_mps=velocity)
    fields = {f: getattr(world.sensor, f) for f in ("range_m", "azimuth_deg", "range_rate_mps")}
    sensor = Radar(**fields, range_rate_correlation=correlation, pose=pose)
    shift = np.concatenate([np.zeros(2), velocity[:2]])
    along = plots._replace(prior=plots.prior._replace(mean=plots.prior.mean + shift))
    fixed = filtered("range-rate", world.motion, world.sensor, plots)
    moving = filtered("range-rate", world.motion, sensor, along)
    path = np.concatenate([place[:, :2], np.tile(velocity[:2], (len(place), 1))], axis=1)
    size = np.abs(fixed.mean).max()
    np.testing.assert_allclose(moving.mean - path, fixed.mean, rtol=0, atol=1e-9 * size)
