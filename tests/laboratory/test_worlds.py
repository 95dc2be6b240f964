"""Scenarios from plain numbers, against geometry and laws that are worked out apart."""

import pickle
from importlib import resources
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy import stats

from boresight.errors import DataError, UsageError
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import simulate
from boresight.experiments.spreads import Annulus, Normal, Uniform
from boresight.experiments.truth import Truth
from boresight.experiments.worlds import random_draws, recorded, waypoints
from boresight.maths.frames import Site, geodetic_from_enu
from boresight.models.motion import ConstantAcceleration, ConstantVelocity, CoordinatedTurn, Static
from boresight.models.sensors import Radar

RADAR = Radar(range_m=30.0, azimuth_deg=0.1, elevation_deg=0.1)
FLAT = Radar(range_m=30.0, azimuth_deg=0.1)
SITE = Site(latitude_deg=47.0, longitude_deg=11.0, height_m=600.0)
TRAJECTORIES = Path(__file__).parents[3] / "shared/data/trajectories"
CORNERS = np.array([[-9e3, 4e3], [6e3, 4e3], [1e4, 1.6e4], [2.2e4, 9e3], [2.4e4, -8e3]])


def flown(points, **changed):
    given = {"speed_mps": 180.0, "accel_mps2": 9.0, "dt_s": 0.25, "sensor": FLAT}
    return waypoints(points, **(given | changed))


def centre_of_turn(before, corner, after, radius):
    """On the line that halves the corner's angle, so far out that both legs are `radius` away."""
    back, ahead = (each / np.linalg.norm(each) for each in (before - corner, after - corner))
    middle = (back + ahead) / np.linalg.norm(back + ahead)
    sine = abs(back[0] * middle[1] - back[1] * middle[0])
    return corner + middle * radius / sine


def distance_to_leg(points, first, last):
    along = (last - first) / np.linalg.norm(last - first)
    off = points - first
    beyond = np.clip(off @ along, 0.0, np.linalg.norm(last - first))
    return np.linalg.norm(off - beyond[:, None] * along, axis=1)


def test_a_path_lies_on_its_legs_and_on_the_circles_that_touch_them():
    world = flown(CORNERS)
    place, velocity, radius = world.path[:, :2], world.path[:, 2:], 180.0**2 / 9.0
    legs = [distance_to_leg(place, *CORNERS[i : i + 2]) < 1e-6 for i in range(len(CORNERS) - 1)]
    centres = [centre_of_turn(*CORNERS[i : i + 3], radius) for i in range(len(CORNERS) - 2)]
    turns = [np.abs(np.linalg.norm(place - c, axis=1) - radius) < 1e-6 for c in centres]
    where = np.array([*legs, *turns])
    assert where.any(axis=0).all()
    assert all(each.sum() > 10 for each in where)
    for c, turning in zip(centres, turns, strict=True):
        inside = turning & ~np.any(legs, axis=0)
        # Towards a circle's centre nothing moves, and all the acceleration of the circle points.
        assert np.abs(np.sum((place - c) * velocity, axis=1)[inside]).max() < 1e-3
    assert np.linalg.norm(velocity, axis=1) == pytest.approx(180.0, rel=1e-12)
    assert np.array_equal(place[0], CORNERS[0])


def test_the_acceleration_of_a_turn_is_as_stated_and_none_is_felt_elsewhere():
    world = flown(CORNERS, dt_s=0.01, scans=20_000)
    acceleration = np.linalg.norm(np.diff(world.path[:, 2:], axis=0), axis=1) / 0.01
    is_turn = np.abs(acceleration - 9.0) < 1e-4
    is_straight = acceleration < 1e-9
    # At most the two scans around each of the six ends of a turn are neither.
    assert np.sum(~is_turn & ~is_straight) <= 6
    assert is_turn.sum() > 1000


@pytest.mark.parametrize("speeds", [180.0, [150.0, 200.0, 180.0, 120.0, 160.0]])
@pytest.mark.parametrize("heights", [None, [3000.0, 3000.0, 5000.0, 4000.0, 4000.0]])
def test_velocities_are_the_derivatives_of_positions(speeds, heights):
    points = CORNERS if heights is None else np.column_stack([CORNERS, heights])
    world = flown(points, speed_mps=speeds, dt_s=0.01, sensor=FLAT if heights is None else RADAR)
    d = points.shape[1]
    middle = np.diff(world.path[:, :d], axis=0) / 0.01
    mean = (world.path[1:, d:] + world.path[:-1, d:]) / 2.0
    off = np.linalg.norm(middle - mean, axis=1)
    # Within a piece the trapezium errs by a²dt²/12v. Where a turn begins or ends between two scans,
    # at six instants, it errs by a dt/4, and by the whole rate of a climb that begins there.
    assert np.sum(off > 1e-4) <= 6
    assert off.max() < (9.0 * 0.01 / 4.0 if heights is None else 40.0)


def test_speeds_and_heights_change_along_straights_only():
    points = np.array([[0.0, 0.0, 1000.0], [20e3, 0.0, 3000.0], [20e3, 30e3, 3000.0]])
    world = flown(points, speed_mps=[100.0, 200.0, 150.0], sensor=RADAR)
    x, speed = world.path, np.hypot(world.path[:, 3], world.path[:, 4])
    radius = 200.0**2 / 9.0
    first = x[:, 0] < 20e3 - radius
    length = 20e3 - radius  # a right angle's tangent is as long as the radius
    assert speed[first] ** 2 == pytest.approx(1e4 + (4e4 - 1e4) * x[first, 0] / length)
    assert x[first, 2] == pytest.approx(1000.0 + 2000.0 * x[first, 0] / length)
    assert x[first, 5] == pytest.approx(2000.0 / length * speed[first])
    last = x[:, 1] > radius
    assert x[~first & ~last, 2] == pytest.approx(3000.0)
    assert speed[~first & ~last] == pytest.approx(200.0)
    length = 30e3 - radius
    done = (x[last, 1] - radius) / length
    assert speed[last] ** 2 == pytest.approx(4e4 + (150.0**2 - 4e4) * done)
    assert done[-1] <= 1.0
    assert (1.0 - done[-1]) * length <= 150.0 * 0.25


def test_a_straight_path_reaches_its_end_at_the_last_scan():
    world = flown([[0.0, 0.0], [900.0, 0.0], [1800.0, 0.0]], speed_mps=90.0, dt_s=1.0)
    assert world.scans == 21
    assert world.path[-1] == pytest.approx([1800.0, 0.0, 90.0, 0.0])
    assert flown([[0.0, 0.0], [900.0, 0.0]], dt_s=1.0, scans=3).scans == 3


@pytest.mark.parametrize(
    ("points", "changed", "message"),
    [
        ([[0.0, 0.0]], {}, r"points_m has shape \(1, 2\)"),
        ([], {}, "points_m has shape"),
        ([0.0, 1.0], {}, "points_m has shape"),
        ([[0.0, np.nan], [1.0, 1.0]], {}, "no finite number"),
        ([["a", "b"], ["c", "d"]], {}, "is not a number"),
        ([[0, 0], [5e4, 0], [5e4, 0]], {}, "waypoints 2 and 3 are at one place"),
        ([[0, 0], [5e4, 0], [0, 0]], {}, "straight back at waypoint 2"),
        ([[0, 0], [3e3, 0], [3e3, 5e4]], {}, "no room .* waypoint 1 to 2(.|\n)*3600 m"),
        ([[0, 0], [5e4, 0], [5e4, 7e3], [0, 7e3]], {}, "no room .* waypoint 2 to 3"),
        ([[0, 0], [5e4, 0]], {"speed_mps": 0.0}, "speed_mps=0.0 is not positive"),
        ([[0, 0], [5e4, 0]], {"speed_mps": [9.0, 9.0, 9.0]}, "3 speeds for 2 waypoints"),
        ([[0, 0], [5e4, 0]], {"accel_mps2": 0.0}, "accel_mps2=0.0 is not positive"),
        ([[0, 0], [5e4, 0]], {"dt_s": 0.0}, "dt_s=0.0 is not positive"),
        ([[0, 0], [900, 0]], {"scans": 99}, "lasts 5 s: 21 scans of 0.25 s"),
        ([[0, 0], [900, 0]], {"motion": Static(dims=2)}, "the motion has x_m, y_m"),
        (
            [[0, 0], [900, 0]],
            {"motion": CoordinatedTurn(accel_mps2=1, turn_accel_degps2=1)},
            "turn",
        ),
    ],
)
def test_a_path_that_cannot_be_flown_is_refused(points, changed, message):
    with pytest.raises(UsageError, match=message):
        flown(points, **changed)


def test_a_path_right_through_the_sensor_gives_finite_plots():
    """Over the sensor's head, and through it."""
    for height in (0.0, 5000.0):
        world = waypoints(
            [[-1e3, 0.0, height], [1e3, 0.0, height]], speed_mps=100.0, dt_s=1.0, sensor=RADAR
        )
        truth, plots = simulate(world, runs=20, seed=1)
        assert np.any(np.all(truth.states[0, :, :2] == 0.0, axis=1))
        assert np.isfinite(plots.z[:, 1:]).all()
        assert np.isfinite(plots.prior.mean).all()


# --- recordings


def circle(time_s, radius=20e3, speed=200.0, height=9000.0):
    """A level circle over the site's tangent plane: positions and velocities, North, East, up."""
    angle = speed / radius * time_s
    up = np.full_like(angle, height)
    place = np.stack([radius * np.cos(angle), radius * np.sin(angle), up], axis=1)
    velocity = np.stack([-speed * np.sin(angle), speed * np.cos(angle), 0.0 * up], axis=1)
    return place, velocity


def table_of(time_s, name="4B1234", height="height_m", **motion):
    place, _ = circle(time_s, **motion)
    where = geodetic_from_enu(place[:, [1, 0, 2]], SITE)
    columns = {"time_s": time_s, "latitude_deg": where[0], "longitude_deg": where[1]}
    return pl.DataFrame(columns | {height: where[2], "address": [name] * len(time_s)})


def seen_from(source, **changed):
    return recorded(source, SITE, **({"dt_s": 4.0, "sensor": RADAR} | changed))


@pytest.mark.parametrize("height", ["height_m", "pressure_altitude_m"])
def test_a_recorded_circle_is_flown_again(height):
    world = seen_from(table_of(np.arange(500.0, 801.0), height=height))
    place, velocity = circle(500.0 + 4.0 * np.arange(76))
    assert world.scans == 76
    assert np.abs(world.path[:, :3] - place).max() < 1e-3
    # A parabola through reports 1 s apart errs in velocity by v w² dt²/6.
    assert np.abs(world.path[:, 3:] - velocity).max() < 2 * 200.0 * 0.01**2 / 6


def test_between_reports_the_velocity_is_the_path_s_own_derivative():
    source = table_of(np.arange(0.0, 61.0))
    fine = seen_from(source, dt_s=0.01).path
    middle = np.diff(fine[:, :3], axis=0) / 0.01
    assert np.abs(middle - (fine[1:, 3:] + fine[:-1, 3:]) / 2.0).max() < 1e-3


def test_the_longest_stretch_without_a_gap_is_taken():
    times = np.concatenate([np.arange(0.0, 50.0), np.arange(60.0, 170.0), np.arange(176.0, 200.0)])
    world = seen_from(table_of(times))
    assert world.scans == 28
    assert world.path[0, :3] == pytest.approx(circle(np.array([60.0]))[0][0], abs=1e-3)


def test_a_target_is_chosen_by_name_else_the_longest_is():
    short, long = (
        table_of(np.arange(0.0, 40.0)),
        table_of(np.arange(0.0, 90.0), "ABCDEF", radius=3e4),
    )
    both = pl.concat([short, long])
    assert seen_from(both).scans == 23
    assert seen_from(both, target="4B1234").scans == 10
    with pytest.raises(UsageError, match="no target '4B1235'; did you mean '4B1234'"):
        seen_from(both, target="4B1235")


def test_two_kinds_of_height_are_never_joined():
    """Every third report tells a geometric height, 300 m above what the transponder says."""
    table = table_of(np.arange(0.0, 90.0), height="pressure_altitude_m")
    third = pl.when(pl.col("time_s") % 3 == 0).then(pl.col("pressure_altitude_m") + 300.0)
    world = seen_from(table.with_columns(height_m=third))
    assert np.abs(np.diff(world.path[:, 2])).max() < 1.0


def test_a_recording_without_heights_or_of_one_instant_is_refused():
    table = table_of(np.arange(0.0, 90.0))
    with pytest.raises(DataError, match="no position of the recording has a height"):
        seen_from(table.drop("height_m"))
    with pytest.raises(DataError, match="lasts 89 s: 23 scans of 4 s, not 24"):
        seen_from(table, scans=24)
    with pytest.raises(DataError, match="no column 'latitude_deg'"):
        seen_from(table.drop("latitude_deg"))


def test_an_aircraft_of_the_demonstration_flies_its_known_truth_by_its_adsb():
    """Reports of 5 to 30 m: every scan lies within 60 m of where the aircraft really was."""
    folder = resources.files("boresight.demo")
    site = Site(latitude_deg=47.8125, longitude_deg=1.40625, height_m=180.0)
    world = recorded(folder / "recording.ast", site, dt_s=4.0, sensor=RADAR, target="F00000")
    knots = pl.read_parquet(folder / "truth.parquet").filter(pl.col("address") == "F00000")
    begin, end = knots["time_s"].min(), knots["time_s"].max()
    fine = np.arange(begin, end, 0.05)
    real = Truth(knots).at(np.full(len(fine), knots["flight"][0]), fine)
    place = real.position[:, [1, 0, 2]]
    first = np.argmin(np.linalg.norm(place - world.path[0, :3], axis=1))
    same = first + 80 * np.arange(world.scans)
    assert world.scans > 100
    assert np.linalg.norm(world.path[:, :3] - place[same], axis=1).max() < 60.0


@pytest.mark.skipif(not TRAJECTORIES.exists(), reason="the shared trajectories are not here")
def test_a_real_jet_and_a_real_airliner_are_flown_again():
    jet = pl.read_csv(TRAJECTORIES / "citation-gnss-1hz.csv", infer_schema_length=None)
    columns = {"ts": "time_s", "lat": "latitude_deg", "lon": "longitude_deg"}
    jet = jet.rename(columns).with_columns(height_m=pl.col("alt_gnss") * 0.3048)
    world = recorded(jet, Site(latitude_deg=52, longitude_deg=4, height_m=0), dt_s=4, sensor=RADAR)
    speed = np.hypot(world.path[:, 3], world.path[:, 4])
    told = jet["gs"].drop_nulls().to_numpy() * 1852 / 3600
    assert world.scans > 1000
    assert speed.max() == pytest.approx(told.max(), rel=0.05)
    states = pl.read_csv(TRAJECTORIES / "opensky-states.csv", infer_schema_length=None)
    columns = {"time": "time_s", "lat": "latitude_deg", "lon": "longitude_deg"}
    columns |= {"geoaltitude": "height_m", "icao24": "address"}
    states = states.rename(columns)
    site = Site(latitude_deg=52, longitude_deg=0, height_m=0)
    world = recorded(states, site, dt_s=4, sensor=RADAR, target="407a19")
    told = states.filter(pl.col("address") == "407a19")["velocity"]
    speed = np.hypot(world.path[:, 3], world.path[:, 4])
    assert told.min() * 0.95 < speed.min() < speed.max() < told.max() * 1.05


# --- random draws


def drawn(count=40_000, **changed):
    given = {"position": Annulus(10e3, 50e3), "speed_mps": Uniform(100.0, 250.0)}
    given |= {"dt_s": 4.0, "scans": 2, "sensor": RADAR, "height_m": Uniform(1e3, 9e3)}
    world = random_draws(**(given | changed))
    normals = np.random.default_rng(4).standard_normal((count, len(world.initial)))
    return world, world.draw(normals)


def test_an_annulus_is_filled_evenly_and_headings_are_any():
    """Five Kolmogorov-Smirnov tests, each at 1e-4: a false alarm in 2,000."""
    world, x = drawn()
    off = np.hypot(x[:, 0], x[:, 1])
    azimuth, heading = np.arctan2(x[:, 1], x[:, 0]), np.arctan2(x[:, 4], x[:, 3])
    laws = {
        "area": (off**2, 10e3**2, 50e3**2),
        "azimuth": (azimuth, -np.pi, np.pi),
        "heading": (heading, -np.pi, np.pi),
        "speed": (np.hypot(x[:, 3], x[:, 4]), 100.0, 250.0),
        "height": (x[:, 2], 1e3, 9e3),
    }
    for name, (values, low, high) in laws.items():
        assert stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > 1e-4, name
    assert np.all(x[:, 5] == 0.0)
    assert isinstance(world, Scenario)


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"position": Annulus(5e3, 40e3, Uniform(20.0, 110.0)), "heading_deg": Normal(200.0, 35.0)},
        {"position": (Normal(3e4, 2e3), Uniform(-4e3, 9e3)), "heading_deg": 45.0},
        {"position": (1e4, 2e4), "speed_mps": Normal(200.0, 30.0), "climb_mps": Normal(0.0, 5.0)},
    ],
)
def test_what_a_filter_is_told_of_starts_is_their_mean_and_covariance(changed):
    """Up to 27 numbers, each within 5 standard errors: a false alarm in 60,000 a case."""
    world, x = drawn(**changed)
    error = x - x.mean(axis=0)
    spread = np.einsum("ri,rj->rij", error, error)
    se = x.std(axis=0) / np.sqrt(len(x))
    assert np.all(np.abs(x.mean(axis=0) - world.initial) <= 5 * se + 1e-9)
    se = spread.std(axis=0) / np.sqrt(len(x))
    assert np.all(np.abs(spread.mean(axis=0) - world.prior_cov) <= 5 * se + 1e-6)


def test_a_law_can_be_changed_without_changing_the_others_numbers():
    _, one = drawn(100)
    _, other = drawn(100, speed_mps=Normal(200.0, 10.0))
    assert np.array_equal(one[:, :3], other[:, :3])
    turned = [np.arctan2(x[:, 4], x[:, 3]) for x in (one, other)]
    assert turned[0] == pytest.approx(turned[1])


def test_further_states_start_at_zero_and_the_motion_moves_the_truth():
    motion = ConstantAcceleration(jerk_mps3=0.5)
    _, x = drawn(10, motion=motion)
    assert x.shape == (10, 9)
    assert np.all(x[:, 6:] == 0.0)
    flat, x = drawn(10, motion=ConstantVelocity(accel_mps2=1.0, dims=2), sensor=FLAT)
    assert x.shape == (10, 4)
    truth, plots = simulate(flat, runs=50, seed=2)
    assert np.array_equal(truth.start, truth.states[:, 0])
    assert len(np.unique(truth.states[:, 0, 0])) == 50
    assert not np.allclose(truth.states[:, 1, 2:], truth.states[:, 0, 2:])
    assert plots.prior.mean.shape == (50, 4)


def test_a_world_travels_to_another_process():
    for world in (drawn(1)[0], flown(CORNERS)):
        there = pickle.loads(pickle.dumps(world))  # noqa: S301 - made here
        one, other = (simulate(each, runs=2, seed=1)[1].z for each in (world, there))
        assert np.array_equal(one, other, equal_nan=True)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Uniform(2.0, 1.0), "no interval"),
        (lambda: Uniform(0.0, np.inf), "no interval"),
        (lambda: Normal(0.0, -1.0), "no normal law"),
        (lambda: Annulus(5.0, 5.0), "no annulus"),
        (lambda: Annulus(-1.0, 5.0), "no annulus"),
        (lambda: drawn(1, motion=Static()), "has no speed"),
        (lambda: drawn(1, dt_s=-1.0), "dt_s=-1.0"),
        (lambda: drawn(1, scans=0), "scans=0"),
    ],
)
def test_draws_that_cannot_be_are_refused(make, message):
    with pytest.raises(UsageError, match=message):
        make()
