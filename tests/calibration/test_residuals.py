"""The table of residuals is the pairs and their fit in the units of the door; noise is found."""

import numpy as np
import polars as pl
import pytest
from radar_worlds import SIX, Noise, world
from turning_radar import AZIMUTH_DEG, RANGE_M, Fit, record

from boresight.calibration.bins import joined, round_edges
from boresight.calibration.pairs import Pairs
from boresight.calibration.registration import register
from boresight.calibration.residuals import noise_tables, residual_table


def fit_of(after, outlier, delay_m):
    return Fit(np.asarray(after), np.asarray(outlier), np.asarray(delay_m))


def two_pairs():
    """A target 3 km north and 4 km east, and one 10 km west, whose azimuth was not measured."""
    return Pairs(
        time_s=np.array([10.0, 14.0]),
        target=np.array([1, 0]),
        names=("A", "B"),
        channels=("range_m", "azimuth_rad"),
        z=np.array([[5_012.0, np.arctan2(4, 3) - np.radians(0.2)], [9_990.0, np.nan]]),
        position=np.array([[3e3, 4e3, 0.0], [0.0, -10e3, 0.0]]),
        velocity=np.zeros((2, 3)),
        height_m=np.array([100.0, 200.0]),
        accuracy_m=np.full(2, np.nan),
        row=np.array([7, 3]),
    )


def test_a_row_says_where_a_target_was_and_by_how_much_the_radar_erred():
    after = np.array([[2.0, np.radians(0.1)], [-20.0, np.nan]])
    table = residual_table(two_pairs(), fit_of(after, [0.01, 0.9], [-25.0, 5.0]))
    rows = table.to_dicts()
    assert [row["row"] for row in rows] == [7, 3]
    assert [row["target"] for row in rows] == ["B", "A"]
    assert [row["outlier"] for row in rows] == [0.01, 0.9]
    assert [row["delay_m"] for row in rows] == [5.0, -25.0]
    assert [row["height_m"] for row in rows] == [100.0, 200.0]
    assert rows[0]["range_m"] == pytest.approx(5_000.0)
    assert rows[0]["azimuth_deg"] == pytest.approx(53.13010235)
    assert rows[1]["azimuth_deg"] == pytest.approx(270.0)
    assert rows[0]["range_before_m"] == pytest.approx(12.0)
    assert rows[0]["azimuth_before_deg"] == pytest.approx(-0.2)
    assert rows[0]["range_after_m"] == pytest.approx(2.0)
    assert rows[0]["azimuth_after_deg"] == pytest.approx(0.1)
    assert np.isnan(rows[1]["azimuth_before_deg"])
    assert "elevation_before_deg" not in table.columns


def test_noise_that_grows_with_range_is_found_where_it_grows():
    recording = record(5, targets=60, turns=200)
    pairs, rng = recording.pairs, np.random.default_rng(1)
    range_m = np.linalg.norm(pairs.position, axis=1)
    true = np.stack([10.0 + range_m / 4e3, np.full(len(pairs), 0.001)], axis=1)
    after = true * rng.normal(size=true.shape)
    after[:, 0] += recording.delay_m[pairs.target]
    wrong = rng.random(len(pairs)) < 0.2
    after[wrong] += [2_000.0, 0.3]
    tables = noise_tables(pairs, fit_of(after, wrong.astype(float), recording.delay_m))
    table = tables["noise_by_range"]
    middle = 0.5 * (table["range_from_m"] + table["range_to_m"]).to_numpy()
    count = table["pairs"].to_numpy()
    off = table["range_sd_m"].to_numpy() / (10.0 + middle / 4e3) - 1.0
    # The deviation of a robust deviation is 1.17 / sqrt(n); the slope within an interval adds 3 %.
    assert (np.abs(off) < 4 * 1.17 / np.sqrt(count) + 0.03).all()
    assert count.sum() == (~wrong).sum()
    sectors = tables["noise_by_azimuth"]
    expected = np.degrees(0.001)
    off = sectors["azimuth_sd_deg"].to_numpy() / expected - 1.0
    assert (np.abs(off) < 4 * 1.17 / np.sqrt(sectors["pairs"].to_numpy())).all()


def test_noise_of_white_residuals_is_that_of_their_recording():
    recording = record(2)
    tables = noise_tables(recording.pairs, recording.fit())
    by_range = tables["noise_by_range"]
    weights = by_range["pairs"].to_numpy()
    assert np.average(by_range["range_sd_m"], weights=weights) == pytest.approx(RANGE_M, rel=0.05)
    found = np.average(by_range["azimuth_sd_deg"], weights=weights)
    assert found == pytest.approx(AZIMUTH_DEG, rel=0.05)


def test_nothing_but_outliers_has_no_noise():
    assert noise_tables(two_pairs(), fit_of(np.zeros((2, 2)), [1.0, 1.0], [0.0, 0.0])) == {}


@pytest.mark.parametrize(
    ("low", "high"), [(0.0, 1.0), (3.0, 3.0), (-17.0, 250_000.0), (1e5, 1.001e5), (999.9, 1000.1)]
)
def test_edges_are_round_and_hold_all_values(low, high):
    edges = round_edges(np.array([low, high]), 20)
    width = edges[1] - edges[0]
    np.testing.assert_allclose(np.diff(edges), width, rtol=1e-6)
    assert edges[0] <= low <= high < edges[-1] + 1e-9
    assert len(edges) - 1 <= 21
    digit = width / 10 ** np.floor(np.log10(width * 1.000001))
    assert min(abs(digit - np.array([1.0, 2.0, 5.0]))) < 1e-4


def test_intervals_are_joined_until_they_hold_enough():
    values = np.array([0.5, 0.6, 1.5, 3.5, 3.6, 3.7, 5.5])
    target = np.array([0, 0, 1, 0, 1, 2, 0])
    bins = joined(values, np.arange(8.0), target, rows=2, targets=2)
    assert bins.low.tolist() == [0.0, 3.0]
    assert bins.high.tolist() == [2.0, 6.0]  # the lone row at the end joins the one before
    assert bins.index.tolist() == [0, 0, 0, 1, 1, 1, 1]


def test_rows_outside_all_edges_lie_in_no_interval():
    bins = joined(
        np.array([-1.0, 0.5, 9.0, np.nan]), np.arange(3.0), np.zeros(4, int), rows=1, targets=1
    )
    assert bins.index.tolist() == [-1, 0, -1, -1]


def test_a_registration_leaves_delays_in_and_the_noise_table_takes_them_out():
    """With the real fit: delays of 60 m, noise of 15 m."""
    noise = Noise(range_m=15.0, azimuth_deg=0.05, delay_m=60.0)
    pairs, truth = world(1, pairs=6_000, targets=40, noise=noise)
    found = register(pairs, SIX)
    table = residual_table(pairs, found)
    level = table.group_by("target").agg(pl.col("range_after_m").median())["range_after_m"]
    assert 40.0 < np.std(level.to_numpy()) < 85.0  # of 60, for 40 targets
    assert np.corrcoef(table["delay_m"], truth["delay_m"][pairs.target])[0, 1] > 0.99
    by_range = noise_tables(pairs, found)["noise_by_range"]
    mean = np.average(by_range["range_sd_m"], weights=by_range["pairs"].to_numpy())
    assert mean == pytest.approx(15.0, rel=0.06)


def test_a_value_on_an_edge_is_of_the_interval_above_and_enough_is_enough():
    values = np.array([0.0, 5.0, 10.0, 10.0, 20.0])
    found = joined(values, np.array([0.0, 10.0, 20.0]), np.zeros(5, int), rows=2, targets=1)
    assert found.index.tolist() == [0, 0, 1, 1, -1]
    assert found.low.tolist() == [0.0, 10.0]
    assert found.high.tolist() == [10.0, 20.0]
