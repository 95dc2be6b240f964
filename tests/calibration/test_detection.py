"""Planted probabilities of detection are found within their intervals; false plots are told apart.

An exact interval of 95 % misses at most once in twenty; where scans of one target are alike, one
that counts scans as independent misses far more often, and is shown to.
"""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy.stats import binom

from boresight.calibration.detection import (
    detection_remarks,
    detection_tables,
    proportion_intervals,
)
from boresight.calibration.pairing import Pairing
from boresight.calibration.pairs import Pairs
from boresight.maths.frames import Site

SITE = Site(latitude_deg=41.3, longitude_deg=2.1, height_m=100.0)
SCAN_S = 4.0


def due_table(rng, targets, scans, probability, *, nearest=10e3, furthest=200e3):
    """Targets that fly outward at 10 km, each seen with a probability of its range (m) and own."""
    target = np.repeat(np.arange(targets), scans)
    angle = rng.uniform(0.0, 2.0 * np.pi, targets)[target]
    range_m = np.tile(np.linspace(nearest, furthest, scans), targets)
    up = 10e3 - range_m**2 / (2 * 6_371_000.0)
    ground = np.sqrt(range_m**2 - up**2)
    return pl.DataFrame(
        {
            "time_s": SCAN_S * np.tile(np.arange(float(scans)), targets),
            "name": [f"T{i}" for i in target],
            "north_m": ground * np.cos(angle),
            "east_m": ground * np.sin(angle),
            "up_m": up,
            "height_m": np.full(len(target), 10e3),
            "seen": rng.random(len(target)) < probability(range_m, target),
        }
    )


def pairing_of(due, plots=None, reason=()):
    """Plots beside a reference; those without a reason are 10 m from the first due rows."""
    reason = np.array(reason, dtype=object)
    paired = np.flatnonzero(reason == "")
    place = due.select("north_m", "east_m", "up_m").to_numpy()[: len(paired)]
    range_m = np.linalg.norm(place, axis=1)
    azimuth = np.arctan2(place[:, 1], place[:, 0])
    pairs = Pairs(
        time_s=due["time_s"].to_numpy()[: len(paired)],
        target=np.zeros(len(paired), dtype=int),
        names=("T0",),
        channels=("range_m", "azimuth_rad"),
        z=np.stack([range_m + 10.0, azimuth], axis=1),
        position=place,
        velocity=np.zeros((len(paired), 3)),
        height_m=due["height_m"].to_numpy()[: len(paired)],
        accuracy_m=np.full(len(paired), np.nan),
        row=paired,
    )
    none = pl.DataFrame(schema=dict.fromkeys(("time_s", "range_m", "azimuth_deg"), pl.Float64))
    made = Pairing(
        pairs=pairs,
        reason=reason,
        dropped={},
        how="identity",
        scan_s=SCAN_S,
        due=due,
        remarks=[],
    )
    return made, none if plots is None else plots


def tables_of(due, plots=None, reason=()):
    made, plots = pairing_of(due, plots, reason)
    return detection_tables(made, plots, SITE)


def falling(range_m, _target):
    return np.clip(1.3 - range_m / 200e3, 0.0, 1.0)


def test_a_probability_that_falls_with_range_is_found():
    missed = looked = 0
    for seed in range(10):
        table = tables_of(due_table(np.random.default_rng(seed), 40, 200, falling))
        by_range = table["detection_by_range"]
        middle = 0.5 * (by_range["range_from_m"] + by_range["range_to_m"]).to_numpy()
        true = falling(middle, None)
        missed += ((by_range["low"] > true) | (by_range["high"] < true)).sum()
        looked += by_range.height
        assert by_range["due"].sum() > 7_950  # of 8,000: the last turn is as far as any plot
        by_azimuth = table["detection_by_azimuth"]
        assert by_azimuth["seen"].sum() == by_range["seen"].sum()
    # The probability bends within the interval at 60 km by less than 0.003.
    assert missed <= 0.08 * looked


def test_targets_that_differ_widen_the_interval():
    """Half of the targets answer in 99 of 100 scans, the others in 60."""
    missed = naive = looked = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        own = np.where(rng.random(30) < 0.5, 0.99, 0.6)
        due = due_table(rng, 30, 100, lambda _, target, own=own: own[target])
        by_range = tables_of(due)["detection_by_range"]
        true, n, k = 0.795, by_range["due"].to_numpy(), by_range["seen"].to_numpy()
        missed += ((by_range["low"] > true) | (by_range["high"] < true)).sum()
        half = 1.96 * np.sqrt(k / n * (1 - k / n) / n)
        naive += (np.abs(k / n - true) > half).sum()
        looked += by_range.height
    assert missed <= 0.08 * looked
    assert naive >= 0.12 * looked


def test_independent_scans_have_the_exact_interval():
    """Against the binomial law itself: each end leaves 2.5 % beyond it."""
    due, hits = np.ones(50), np.repeat([1.0, 0.0], [37, 13])
    low, high = proportion_intervals(np.zeros(50, dtype=int), due, hits)
    assert binom.sf(36, 50, low[0]) == pytest.approx(0.025, rel=1e-6)
    assert binom.cdf(37, 50, high[0]) == pytest.approx(0.025, rel=1e-6)


def test_all_or_nothing_seen_still_has_an_interval():
    low, high = proportion_intervals(np.array([0, 1]), np.array([1.0, 1.0]), np.array([1.0, 0.0]))
    assert low.tolist() == pytest.approx([0.025, 0.0])
    assert high.tolist() == pytest.approx([1.0, 0.975])


def test_what_is_below_the_horizon_or_beyond_all_plots_is_not_due():
    rng = np.random.default_rng(0)
    due = due_table(rng, 10, 100, lambda r, _: r < 150e3)
    low = due_table(rng, 10, 100, lambda r, _: r < 0.0).with_columns(height_m=pl.lit(50.0))
    found = tables_of(pl.concat([due, low]))["detection_by_range"]
    # A target 50 m high is seen from 100 m to sqrt(2 * 4/3 * 6,371 km) (sqrt 50 + sqrt 100) = 70 km
    in_reach = np.linspace(10e3, 200e3, 100)
    expected = 10 * ((in_reach < 150e3).sum() + (in_reach * np.cos(0.01) < 70.3e3).sum())
    assert abs(found["due"].sum() - expected) <= 20
    assert found["range_to_m"].max() <= 160e3


def test_plots_without_a_target_are_told_apart():
    rng = np.random.default_rng(0)
    due = due_table(rng, 4, 200, lambda r, _: r > 0.0)
    first = due.head(300)
    range_m = np.sqrt(first["north_m"] ** 2 + first["east_m"] ** 2 + first["up_m"] ** 2).to_numpy()
    azimuth = np.degrees(np.arctan2(first["east_m"], first["north_m"]).to_numpy())
    time = first["time_s"].to_numpy()
    reason = np.array([""] * 300, dtype=object)
    reason[200:210] = "no identity"  # where their target is
    reason[210:250] = "garbled code"  # moved away from it, below
    reason[250:254] = "two plots"
    reason[254:260] = "not in the reference"
    reason[260:] = "coasted"  # no measurement: counted nowhere
    azimuth[210:250] += 20.0
    plots = pl.DataFrame({"time_s": time, "range_m": range_m, "azimuth_deg": azimuth % 360.0})
    tables = tables_of(due, plots, reason)
    for name in ("false_by_range", "false_by_azimuth"):
        counts = tables[name].select(pl.exclude("^.*(from|to)_.*$")).sum().row(0, named=True)
        scans = (due["time_s"].max() - due["time_s"].min()) / SCAN_S
        assert counts.pop("unidentified_per_scan") == pytest.approx(40 / scans)
        assert counts == {
            "paired": 200,
            "unidentified": 40,
            "near_target": 10,
            "repeated": 4,
            "unreferenced": 6,
        }
    said = " ".join(detection_remarks(tables))
    assert "40 plots without an identity" in said
    assert "4 plots have an identity that is twice" in said


def test_what_is_seen_while_the_reference_tells_nothing_is_not_counted():
    due = due_table(np.random.default_rng(0), 4, 100, lambda r, _: r > 0.0)
    plots = pl.DataFrame(
        {"time_s": [0.0, 4.0, 5_000.0], "range_m": [5e4] * 3, "azimuth_deg": [10.0] * 3}
    )
    tables = tables_of(due, plots, ["", "no identity", "no identity"])
    assert tables["false_by_range"]["unidentified"].sum() == 1


def test_a_reference_whose_targets_were_never_due_has_no_table():
    due = due_table(np.random.default_rng(0), 1, 5, lambda r, _: r > 0.0).clear()
    made, plots = pairing_of(due)
    assert detection_tables(made, plots, SITE) == {}
    assert detection_remarks({}) == []


def test_a_blind_sector_is_where_it_is():
    rng = np.random.default_rng(1)
    due = due_table(rng, 400, 20, lambda r, _: r > 0.0)
    azimuth = np.degrees(np.arctan2(due["east_m"], due["north_m"]).to_numpy()) % 360.0
    blind = (azimuth >= 200.0) & (azimuth < 220.0)
    due = due.with_columns(seen=pl.Series(~blind))
    sectors = tables_of(due)["detection_by_azimuth"]
    dark = sectors.filter(pl.col("seen") == 0)
    assert dark["azimuth_from_deg"].to_list() == [200.0, 210.0]
    assert dark["azimuth_to_deg"].to_list() == [210.0, 220.0]
    lit = sectors.filter(pl.col("seen") > 0)
    assert (lit["seen"] == lit["due"]).all()
    assert lit.height == 34


def test_what_targets_share_does_not_widen_where_each_has_one_scan():
    """Ten targets are seen always or never; of fifty with a single scan the law is exact."""
    group = np.repeat([0, 1], [10, 50])
    due = np.repeat([40.0, 1.0], [10, 50])
    hits = np.concatenate([np.repeat([40.0, 0.0], 5), np.repeat([1.0, 0.0], [37, 13])])
    low, high = proportion_intervals(group, due, hits)
    assert binom.sf(36, 50, low[1]) == pytest.approx(0.025, rel=1e-6)
    assert binom.cdf(37, 50, high[1]) == pytest.approx(0.025, rel=1e-6)
    assert high[0] - low[0] > 0.5  # 400 independent scans would have 0.1


def anonymous(scan, azimuth_off_deg, at):
    """A table of one outward flight: 100 plots of it, and one without identity, off in azimuth.

    Every pair is 0.2 degrees off. The other plot is where the flight is at one scan, at the time of
    another.
    """
    due = due_table(np.random.default_rng(0), 1, 100, lambda r, _: r > 0.0)
    place = due.select("north_m", "east_m", "up_m").to_numpy()
    range_m = np.linalg.norm(place, axis=1)
    azimuth = np.degrees(np.arctan2(place[:, 1], place[:, 0]))
    made, _ = pairing_of(due, reason=["", *[""] * 99, "no identity"])
    z = np.stack([range_m, np.radians(azimuth + 0.2)], axis=1)
    made = replace(made, pairs=replace(made.pairs, z=z))
    plots = pl.DataFrame(
        {
            "time_s": [*due["time_s"], due["time_s"][at]],
            "range_m": [*range_m, range_m[scan]],
            "azimuth_deg": [*(azimuth + 0.2), azimuth[scan] + azimuth_off_deg],
        }
    )
    counts = detection_tables(made, plots, SITE)["false_by_range"]
    return counts["near_target"].sum(), counts["unidentified"].sum()


def test_a_plot_is_near_a_target_within_what_pairs_are_apart_there_and_then():
    assert anonymous(scan=50, azimuth_off_deg=0.5, at=50) == (1, 0)
    assert anonymous(scan=50, azimuth_off_deg=3.0, at=50) == (0, 1)
    assert anonymous(scan=50, azimuth_off_deg=0.5, at=90) == (0, 1)
