"""The demo's truth, and what is made of tracks that are held against it."""

import numpy as np
import polars as pl
import pytest

from boresight.experiments import against_truth, demo
from boresight.experiments.truth import Truth
from boresight.maths import frames
from boresight.maths.angles import wrap
from boresight.tracking.result import TrackingResult
from oracles.demo_facts import FACTS, FOLDER, MB, RADAR, SITE, excess


@pytest.fixture(scope="module")
def truth():
    return demo.shipped()[1]


def test_what_is_shipped_is_small_and_says_that_it_is_invented():
    sizes = [(FOLDER / name).stat().st_size for name in ("recording.ast", "truth.parquet")]
    assert sum(sizes) < 1.5 * MB
    assert "invented" in FACTS["about"]
    addresses = [flight["address"] for flight in FACTS["flights"] if flight["address"]]
    assert all(0xF00000 <= int(address, 16) < 0xF00100 for address in addresses)
    assert 40 <= len(FACTS["flights"]) <= 60


def test_truth_is_the_cubic_through_its_knots():
    """A cubic motion is given back exactly, at and between uneven knots, and nowhere else."""
    coefficients = np.array(
        [[3.0, -2.0, 5.0], [200.0, 90.0, -4.0], [1.5, -2.0, 0.1], [0.1, 0, 0.01]]
    )

    def motion(time):
        powers = (time - 10.0)[:, None] ** np.arange(4)
        rates = np.arange(4) * (time - 10.0)[:, None] ** np.maximum(np.arange(4) - 1, 0)
        return powers @ coefficients, rates @ coefficients

    knots = np.array([10.0, 12.0, 20.0, 21.0])
    names = ["east_m", "north_m", "up_m", "east_mps", "north_mps", "up_mps"]
    table = pl.DataFrame(np.hstack(motion(knots)), schema=names)
    table = table.with_columns(time_s=knots, flight=pl.lit(0))
    two = Truth(pl.concat([table, table.with_columns(pl.lit(1).alias("flight"))]))
    time = np.array([10.0, 11.0, 12.0, 17.3, 20.9])
    for flight in (0, 1):
        found = two.at(np.full(5, flight), time)
        np.testing.assert_allclose(found.position, motion(time)[0], atol=1e-6)
        np.testing.assert_allclose(found.velocity, motion(time)[1], atol=1e-6)
    outside = two.at(np.array([0, 0, 1, 1]), np.array([9.9, 21.1, 9.9, 21.1]))
    assert np.isnan(outside.position).all()


def test_no_flight_does_what_an_aircraft_cannot(truth):
    """Speeds, climbs and accelerations by differences of the truth at 1 s."""
    for flight in range(len(FACTS["flights"])):
        knots = truth.knots.filter(flight=flight)["time_s"]
        time = np.arange(np.ceil(knots[0]), knots[-1] - 1e-3)
        motion = truth.at(np.full(len(time), flight), time)
        ground_speed = np.hypot(motion.velocity[:, 0], motion.velocity[:, 1])
        acceleration = np.diff(motion.velocity, axis=0)
        differences = np.diff(motion.position, axis=0)
        halfway = (motion.velocity[1:] + motion.velocity[:-1]) / 2
        assert ground_speed.min() > 40
        assert ground_speed.max() < 270
        assert np.linalg.norm(acceleration, axis=1).max() < 9.81 * np.tan(np.radians(46))
        np.testing.assert_allclose(differences, halfway, atol=0.5)  # jerk/12 for a second
        height = frames.ellipsoid_height(*motion.position.T, SITE)
        assert height.min() > 150
        assert height.max() < 13_000


def everyone(truth, step_s=5.0):
    """Flights and times at which the truth of all is known, with room for a clock's error."""
    ends = truth.knots.group_by("flight").agg(
        first=pl.col("time_s").min(), last=pl.col("time_s").max()
    )
    parts = [(f, np.arange(a + 1, b, step_s)) for f, a, b in ends.sort("flight").iter_rows()]
    flight = np.concatenate([np.full(len(time), f) for f, time in parts])
    return flight, np.concatenate([time for _, time in parts])


def test_the_truth_as_seen_is_what_a_noiseless_radar_reports(truth):
    flight, time = everyone(truth)
    seen = against_truth.as_seen(truth, flight, time, FACTS)
    then = truth.at(flight, time - RADAR["time_bias_s"])
    polar, found = frames.polar_from_enu(then.position), frames.polar_from_enu(seen.position)
    delay = excess(polar.range_m, frames.ellipsoid_height(*then.position.T, SITE))
    expected = polar.range_m + delay + RADAR["range_bias_m"]
    near = polar.range_m < 120e3  # beyond, the ray's bow shortens the delay, which the sum omits
    np.testing.assert_allclose(found.range_m[near], expected[near], atol=0.1)
    across = wrap(found.azimuth - polar.azimuth - np.radians(RADAR["azimuth_bias_deg"]))
    np.testing.assert_allclose(across * polar.range_m, 0, atol=0.1)
    later = against_truth.as_seen(truth, flight, time + 0.1, FACTS)
    earlier = against_truth.as_seen(truth, flight, time - 0.1, FACTS)
    slope = (later.position - earlier.position) / 0.2
    np.testing.assert_allclose(seen.velocity, slope, atol=0.05)  # knots are whole millimetres


def tracks_with_errors(truth, scale):
    """A result whose errors are drawn from the covariance it states, times `scale` squared."""
    rng = np.random.Generator(np.random.Philox(key=5))
    flight, time = everyone(truth)
    motion = truth.at(flight, time)
    root = np.tril(rng.normal(size=(6, 6))) * 0.3 + np.diag([40, 50, 60, 2, 3, 4])
    errors = rng.normal(size=(len(time), 6)) @ root.T * scale
    state = np.hstack([motion.position, motion.velocity]) + errors
    names = ["east_m", "north_m", "up_m", "east_mps", "north_mps", "up_mps"]
    cov = root @ root.T
    upper = {f"cov_{i}_{j}": cov[i, j] for i in range(6) for j in range(i, 6)}
    who = pl.DataFrame(FACTS["flights"]).select("address", "mode_a")[flight]
    table = pl.DataFrame(state, schema=names).with_columns(
        who["address"].replace("", None), who["mode_a"], track=flight, time_s=time,
        status=pl.lit("updated"), **{name: pl.lit(value) for name, value in upper.items()},
    )  # fmt: skip
    residuals = table.select("track", "time_s", straight=pl.lit(True))
    nothing = pl.DataFrame()
    nis = {"all": {"mean": 1.0, "median": 0.7, "dof": 2.0, "scans": len(time)}}
    result = TrackingResult(
        tracks=table, residuals=residuals, targets=nothing, skipped=nothing, plots=len(time),
        used=len(time), rejected=0, filter="drawn", nis=nis, settings={},
    )  # fmt: skip
    return result, cov


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_errors_drawn_from_the_stated_covariance_are_called_consistent(truth, scale):
    result, cov = tracks_with_errors(truth, scale)
    rows = against_truth.settled_rows(
        result, FACTS, against_truth.false_tracks(result, truth, FACTS)
    )
    assert rows["flight"].n_unique() == len(FACTS["flights"])
    assert rows["flight"].to_list() == rows["track"].to_list()
    motion = truth.at(rows["flight"].to_numpy(), rows["time_s"].to_numpy())
    figures = {"filter": "drawn", "updates": 1, "nis_per_dof": 1.0, "ns_per_update": 1.0}
    found = against_truth.compare(motion, rows, **figures)
    share = 4 / np.sqrt(2 * len(rows))  # four standard errors
    assert found.position_rmse_m == pytest.approx(scale * np.sqrt(cov[0, 0] + cov[1, 1]), rel=share)
    expected = scale * np.sqrt(cov[3, 3] + cov[4, 4])
    assert found.velocity_rmse_mps == pytest.approx(expected, rel=share)
    assert found.anees == pytest.approx(scale**2, rel=share)
    low, high = found.anees_bounds
    assert (low < found.anees < high) == (scale == 1.0)
    # chi-square over 204 degrees of freedom, tables: 166.3 and 245.5 (Wilson and Hilferty)
    assert (low, high) == pytest.approx((0.815, 1.203), abs=0.003)


@pytest.fixture(scope="module")
def result():
    stages = []
    found = demo.run_demo(stages.append)
    assert len(stages) == 3 + len(demo.FILTERS)
    return found


def test_every_plot_is_accounted_for(result):
    counts = FACTS["counts"]
    for tracks in result.results.values():
        skipped = dict(tracks.skipped.select("reason", "count").iter_rows())
        assert tracks.plots == counts["cat048"]
        assert tracks.used + sum(skipped.values()) == tracks.plots
        assert skipped["coasted"] == counts["coasted"]
        assert skipped["no identity"] == counts["clutter"]
        real = counts["aircraft"] + counts["monitor"]
        assert 0.99 * real < tracks.used < real + counts["split"] + counts["reflection"]
        flights = set(tracks.targets["address"].drop_nulls()) - {RADAR["monitor"]["address"]}
        assert flights == {flight["address"] for flight in FACTS["flights"]} - {""}


def test_filtering_beats_plots_and_the_planted_bias_is_what_remains(result):
    """Each figure against one worked out from the planted errors and the flights' ranges alone."""
    error = result.plot_error
    used = result.results["ekf"].residuals.filter("used")
    across = used["range_m"].to_numpy() * np.radians(RADAR["azimuth_noise_deg"])
    noise = np.sqrt(RADAR["range_noise_m"] ** 2 + np.mean(across**2))
    assert error.unbiased == pytest.approx(noise, rel=0.04)  # elevations shorten it a little
    assert 0.5 < error.share_of_bias < 0.9
    *uncalibrated, calibrated = result.comparisons
    for true, seen, straight in zip(uncalibrated, result.as_seen, result.straight, strict=True):
        assert straight.position_rmse_m < 0.9 * error.unbiased
        assert seen.position_rmse_m < true.position_rmse_m
        assert straight.velocity_rmse_mps < 0.6 * seen.velocity_rmse_mps
        assert 0.8 < straight.nis_per_dof < 1.25
        assert seen.anees > 2  # turns: a constant-velocity filter cannot be consistent
        bias = np.sqrt(true.position_rmse_m**2 - seen.position_rmse_m**2)
        expected = error.as_measured * np.sqrt(error.share_of_bias)
        assert bias == pytest.approx(expected, rel=0.1)
    assert calibrated.filter == demo.CALIBRATED
    assert calibrated.position_rmse_m == pytest.approx(seen.position_rmse_m, rel=0.05)


def test_the_calibration_finds_what_was_planted(result):
    """Within four standard deviations: of six terms one misses in 2,600 recordings."""
    found = result.calibration
    for name, term in found.terms.items():
        assert abs(term.estimate - RADAR.get(name, 0.0)) < 4 * term.sd, name
        assert term.observable
    assert found.noise.range_m == pytest.approx(RADAR["range_noise_m"], rel=0.05)
    assert found.noise.azimuth_deg == pytest.approx(RADAR["azimuth_noise_deg"], rel=0.05)


def test_only_the_planted_reflection_is_a_false_track(result):
    targets = result.results["mekf"].targets
    false = targets.filter(pl.col("track").is_in(result.false_tracks))
    assert false["plots"].sum() <= FACTS["counts"]["reflection"]
    assert false["address"].n_unique() <= 1


def test_the_remarks_own_up_to_the_bias(result):
    text = " ".join(result.remarks)
    assert "+85 m in range, +0.12 degrees in azimuth and +0.08 s in time" in text
    assert "ekf and mekf track without a calibration" in text
    assert "cannot be consistent in turns" in text
