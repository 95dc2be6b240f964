"""What a world shows of a target: missed plots, biases, false plots, given paths, split seeds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from boresight.errors import UsageError
from boresight.experiments.scenario import CEILING_M, lookup
from boresight.experiments.simulate import simulate
from boresight.experiments.world import World
from boresight.experiments.worlds import waypoints
from boresight.maths.frames import Site
from boresight.models.coordinates import PositionSensor
from boresight.models.sensors import ConicalBearings, Pose, Radar

RADAR = Radar(range_m=30.0, azimuth_deg=0.5, elevation_deg=0.5)
POINTS = [[2e4, 0.0, 3e3], [2e4, 2e4, 3e3], [0.0, 3e4, 5e3]]


def world(**changed):
    given = {"points_m": POINTS, "speed_mps": 200.0, "dt_s": 2.0, "sensor": RADAR}
    return waypoints(**(given | changed))


def seen(scenario, runs=400, seed=7, **split):
    return simulate(scenario, runs=runs, seed=seed, **split)


def differences(a, b):
    """Of plots; angles within half a turn."""
    off = a - b
    off[..., 1:3] = np.angle(np.exp(1j * off[..., 1:3]))
    return off


def test_the_path_is_the_truth_of_every_run_and_nothing_moves_it():
    scenario = world()
    truth, _ = seen(scenario, runs=3)
    assert np.array_equal(truth.states, np.broadcast_to(scenario.path, truth.states.shape))
    assert np.array_equal(truth.start, truth.states[:, 0])


def test_a_target_is_missed_as_often_as_is_said_and_then_altogether():
    """36,000 scans: 5 standard errors of the share are 0.8 %; of pairs of scans, 1.2 %."""
    _, plots = seen(world(detection=0.9))
    gone = np.isnan(plots.z)
    assert np.array_equal(gone.all(axis=-1), gone.any(axis=-1))
    gone = gone[:, 1:, 0]
    tolerance = 5 * np.sqrt(0.9 * 0.1 / gone.size)
    assert np.mean(gone) == pytest.approx(0.1, abs=tolerance)
    pairs = gone[:, 1:] & gone[:, :-1]
    assert np.mean(pairs) == pytest.approx(0.01, abs=5 * np.sqrt(0.01 * 1.2 / pairs.size))
    runs = gone.sum(axis=1)
    assert np.var(runs) == pytest.approx(0.09 * gone.shape[1], rel=5 * np.sqrt(2 / len(runs)))


def test_what_makes_a_start_is_always_seen():
    for begin in ("one plot", "two plots"):
        _, plots = seen(world(detection=0.05, begin=begin), runs=200)
        assert np.isfinite(plots.prior.mean).all()


def test_a_plot_that_is_seen_is_the_one_that_would_have_been():
    _, all_of_them = seen(world())
    _, some = seen(world(detection=0.7))
    there = ~np.isnan(some.z)
    assert 0.6 < np.mean(there) < 0.8
    assert np.array_equal(some.z[there], all_of_them.z[there])


def test_a_bias_is_added_to_what_is_measured_and_to_nothing_else():
    bias = {"azimuth_rad": 3.0, "range_m": -250.0}
    truth, plain = seen(world())
    same, biased = seen(world(bias=bias))
    off = differences(biased.z, plain.z)[:, 1:]
    assert np.array_equal(same.states, truth.states)
    assert off[..., 0] == pytest.approx(-250.0, abs=1e-9)
    assert off[..., 1] == pytest.approx(3.0, abs=1e-12)
    assert np.all(off[..., 2] == 0.0)
    assert np.all(np.abs(biased.z[:, 1:, 1]) <= np.pi)


def test_a_chirp_s_range_and_range_rate_are_as_correlated_as_is_said():
    """40,000 plots: 5 standard errors of a correlation of -0.8 are 0.009, of another 0.025."""
    sensor = Radar(
        range_m=30.0,
        azimuth_deg=0.5,
        elevation_deg=0.5,
        range_rate_mps=2.0,
        range_rate_correlation=-0.8,
    )
    scenario = world(sensor=sensor)
    truth, plots = seen(scenario)
    parts = sensor.components(scenario.motion)
    exact = np.array([[c.value(x) for c in parts] for x in truth.states[0]])
    off = differences(plots.z, exact)[:, 1:].reshape(-1, 4)
    assert off.std(axis=0) == pytest.approx([c.sigma for c in parts], rel=0.02)
    found = np.corrcoef(off.T)
    expected = np.eye(4)
    expected[0, 3] = expected[3, 0] = -0.8
    assert np.abs(found - expected)[0, 3] < 0.009
    assert np.abs(found - expected).max() < 0.025


def test_split_seeds_give_one_truth_with_many_noises_and_the_reverse():
    drawn = replace(lookup("bordonaro-dynamic"), detection=0.8)
    truth, plots = seen(drawn, runs=5)
    one, many = seen(drawn, runs=5, truth_run=3)
    assert np.array_equal(one.states, np.broadcast_to(truth.states[3], truth.states.shape))
    assert np.array_equal(np.isnan(many.z), np.isnan(plots.z))
    assert np.array_equal(many.z[3], plots.z[3], equal_nan=True)
    each, same = seen(drawn, runs=5, noise_run=3)
    assert np.array_equal(each.states, truth.states)
    assert np.array_equal(np.isnan(same.z), np.broadcast_to(np.isnan(plots.z[3]), plots.z.shape))
    assert np.array_equal(same.z[3], plots.z[3], equal_nan=True)
    start = replace(lookup("kashyap-set-2"), scans=3)
    _, one = seen(start, runs=4, noise_run=2)
    assert np.ptp(one.prior.mean, axis=0).max() == 0.0
    with pytest.raises(UsageError, match="first=-1"):
        seen(drawn, truth_run=-1)


# --- false plots


CLUTTERED = {"false_plots": 3.0, "coverage_m": 60e3, "detection": 0.8}


@pytest.fixture(scope="module")
def cluttered():
    return seen(world(**CLUTTERED), runs=500)


def own_place(plots):
    """(plots,) which candidate is the target's own, of scans on which it is seen."""
    many, own = plots.candidates[:, 1:], plots.z[:, 1:, None]
    there = ~np.isnan(own[..., 0, 0])
    return np.all(many == own, axis=-1)[there], many[there]


def test_the_target_s_plot_is_once_among_the_others_and_they_stand_without_a_gap(cluttered):
    _, plots = cluttered
    is_own, _ = own_place(plots)
    assert np.all(is_own.sum(axis=-1) == 1)
    gone = np.isnan(plots.candidates)
    assert np.array_equal(gone.all(axis=-1), gone.any(axis=-1))
    assert np.all(np.diff(gone[..., 0].astype(int), axis=-1) >= 0)
    assert np.all(gone[:, 0])


def test_false_plots_are_as_many_as_a_poisson_law_makes(cluttered):
    """A chi-square test at 1e-5, and no dependence on whether the target is seen."""
    _, plots = cluttered
    count = np.sum(~np.isnan(plots.candidates[:, 1:, :, 0]), axis=-1)
    there = ~np.isnan(plots.z[:, 1:, 0])
    false = count - there
    for some in (false[there], false[~there]):
        top = 9
        found = np.bincount(np.minimum(some.ravel(), top), minlength=top + 1)
        law = [*stats.poisson.pmf(np.arange(top), 3.0), stats.poisson.sf(top - 1, 3.0)]
        assert stats.chisquare(found, np.array(law) * some.size).pvalue > 1e-5


def test_the_target_s_place_among_them_is_any(cluttered):
    """For each number of plots a chi-square test at 1e-5; eight of them: 1 in 12,000."""
    is_own, many = own_place(cluttered[1])
    count, place = np.sum(~np.isnan(many[..., 0]), axis=-1), np.argmax(is_own, axis=-1)
    for number in range(2, 8):
        found = np.bincount(place[count == number], minlength=number)
        assert len(found) == number
        assert stats.chisquare(found).pvalue > 1e-5


def false_plots_of(sensor, **changed):
    """(plots, k) false plots alone."""
    motion = {"points_m": [[2e4, 0.0], [2e4, 2e4]]} if len(sensor.names) == 1 else {}
    scenario = world(sensor=sensor, begin="given", **(CLUTTERED | changed | motion))
    _, plots = seen(scenario, runs=200)
    is_own, many = own_place(plots)
    there = ~np.isnan(many[..., 0]) & ~is_own
    return many[there]


def uniform(values, low, high):
    """A Kolmogorov-Smirnov test at 1e-5."""
    assert np.all((values >= low) & (values <= high))
    return stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > 1e-5


def test_false_plots_lie_anywhere_in_the_coverage():
    sensor = Radar(
        range_m=30.0,
        azimuth_deg=0.5,
        elevation_deg=0.5,
        height_m=10.0,
        range_rate_mps=1.0,
        site=Site(latitude_deg=47.0, longitude_deg=11.0, height_m=0.0),
    )
    found = false_plots_of(sensor, coverage_elevation_deg=(-1.0, 40.0), coverage_mps=250.0)
    limits = {"range_m": (0.0, 60e3), "azimuth_rad": (-np.pi, np.pi), "height_m": (0.0, CEILING_M)}
    limits |= {"elevation_rad": np.radians([-1.0, 40.0]), "range_rate_mps": (-250.0, 250.0)}
    assert len(found) > 20_000
    for i, name in enumerate(sensor.names):
        assert uniform(found[:, i], *limits[name]), name
    # 5 standard errors of a correlation
    assert np.abs(np.corrcoef(found.T) - np.eye(5)).max() < 5 / np.sqrt(len(found))


def test_false_plots_of_other_sensors():
    found = false_plots_of(PositionSensor(x_m=5.0, y_m=5.0, z_m=5.0))
    assert all(uniform(column, -60e3, 60e3) for column in found.T)
    found = false_plots_of(ConicalBearings(cone_deg=1.0, pose=Pose()))
    assert uniform(found[:, 0], 0.0, np.pi)


def test_run_and_numbers_of_false_plots_do_not_depend_on_the_chunk(cluttered):
    _, chunk = simulate(world(**CLUTTERED), runs=2, seed=7, first=300)
    assert np.array_equal(chunk.candidates, cluttered[1].candidates[300:302], equal_nan=True)


@pytest.mark.parametrize("expected", [0.01, 0.5, 3.0, 8.0])
def test_a_scan_has_more_plots_than_there_is_room_for_once_in_a_thousand_million(expected):
    room = World(world(false_plots=expected, coverage_m=1e4), RADAR).candidates - 1
    assert stats.poisson.sf(room, expected) < 1e-9 <= stats.poisson.sf(room - 1, expected)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"detection": 0.0}, "detection=0.0"),
        ({"detection": 1.1}, "detection=1.1"),
        ({"detection": np.nan}, "detection=nan"),
        ({"bias": {"range_m": np.inf}}, "bias"),
        ({"bias": {"rnage_m": 1.0}}, "bias of rnage_m(.|\n)*measures range_m"),
        ({"bias": {"range_rate_mps": 1.0}}, "bias of range_rate_mps"),
        ({"false_plots": -1.0}, "false_plots=-1.0"),
        ({"false_plots": 2.0}, "coverage_m=nan"),
        ({"false_plots": 2.0, "coverage_m": 0.0}, "coverage_m=0.0"),
        ({"false_plots": 9.0, "coverage_m": 1e4}, "false_plots=9(.|\n)*at most 32"),
        ({"false_plots": 1e9, "coverage_m": 1e4}, "is too many"),
        ({**CLUTTERED, "coverage_elevation_deg": (9.0, 1.0)}, "coverage_elevation_deg"),
        ({**CLUTTERED, "coverage_mps": 0.0}, "coverage_mps"),
        ({"scans": 1, "begin": "two plots"}, "at least 2 scans"),
    ],
)
def test_what_cannot_be_shown_is_refused(changed, message):
    with pytest.raises(UsageError, match=message):
        seen(world(**changed), runs=2)


@pytest.mark.parametrize(
    ("path", "message"), [(np.zeros((3, 6)), "path .* shape"), (np.full((91, 6), np.nan), "finite")]
)
def test_a_path_of_another_shape_or_of_no_numbers_is_refused(path, message):
    scenario = world(scans=91)
    with pytest.raises(UsageError, match=message):
        replace(scenario, path=path)


# --- the formula itself


@pytest.mark.parametrize("changed", [{}, CLUTTERED, {"bias": {"azimuth_rad": 0.1}}])
def test_the_formula_on_floats_is_what_the_kernel_does(changed):
    scenario = world(**changed)
    told = World(scenario, RADAR)
    truth, plots = seen(scenario, runs=3)
    values = told.values(7, np.float64(2.0), np.float64(2.0))
    rated = {name: rate.name for name, (_, rate) in told.inputs.items()}
    state = {"truth": truth.start[2]}
    for scan in range(6):
        inputs = {n: v[scan] if rated[n] == "STEP" else v for n, v in values.items()}
        state, scene = told.step(state, inputs)
        assert scene.truth == pytest.approx(truth.states[2, scan], rel=1e-12)
        if scan >= scenario.spent:
            np.testing.assert_allclose(scene.z, plots.z[2, scan], rtol=1e-9)
            if plots.candidates is not None:
                np.testing.assert_allclose(scene.candidates, plots.candidates[2, scan], rtol=1e-9)


def test_worlds_that_record_another_program_are_told_apart():
    plain = World(world(), RADAR)
    assert plain == World(world(speed_mps=150.0, scans=5), RADAR)
    drawn = replace(world(), path=None)
    worlds = [world(**CLUTTERED), world(detection=0.5), world(bias={"range_m": 1.0}), drawn]
    assert all(World(each, RADAR) != plain for each in worlds)
    printed = replace(drawn, motion=replace(drawn.motion, discretisation="printed"))
    assert World(drawn, RADAR) != World(printed, RADAR)
