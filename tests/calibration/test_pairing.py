"""Which plot is of which target, where that target was, and what is dropped."""

import numpy as np
import polars as pl
import pytest
from flown import SCAN_S, SITE, Aircraft, reference, sky

from boresight.calibration.interpolation import Paths
from boresight.calibration.nearby import near
from boresight.calibration.pairing import pair
from boresight.errors import DataError, UsageError
from boresight.models.atmosphere import ExponentialAtmosphere

CENTIMETRE, METRE_PER_SECOND = 0.01, 1.0


def accounted(pairing, plots):
    return len(pairing.pairs) + sum(pairing.dropped.values()) == plots.height


def truth_of(fleet, pairs):
    """Positions and velocities (north, east, up) of the aircraft that the pairs name."""
    by_name = {key: each for each in fleet for key in (each.address, each.code)}
    place, speed = np.empty((len(pairs), 3)), np.empty((len(pairs), 3))
    for number, name in enumerate(pairs.names):
        mine = pairs.target == number
        t = pairs.time_s[mine]
        enu, before, after = (by_name[name].enu(t + dt) for dt in (0.0, -1e-3, 1e-3))
        place[mine] = enu[:, [1, 0, 2]]
        speed[mine] = ((after - before) / 2e-3)[:, [1, 0, 2]]
    return place, speed


def test_a_plot_stands_beside_the_place_and_velocity_its_target_truly_had(tmp_path):
    fleet, plots = sky()
    found = pair(plots, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    assert found.how == "identity"
    assert len(found.pairs) == plots.height
    place, speed = truth_of(fleet, found.pairs)
    assert np.abs(found.pairs.position - place).max() < CENTIMETRE
    assert np.abs(found.pairs.velocity - speed).max() < 0.1 * METRE_PER_SECOND
    assert np.abs(found.pairs.residuals()).max(axis=0) == pytest.approx([0, 0], abs=CENTIMETRE)
    assert np.array_equal(found.pairs.row, np.arange(plots.height))
    assert np.array_equal(found.pairs.time_s, plots["time_s"])


def test_slow_and_uneven_reports_are_joined_by_a_curve_and_not_by_straight_lines(tmp_path):
    (one,) = fleet = [Aircraft(1)]
    late = np.random.default_rng(4).uniform(0, 1.8, 300)
    known = reference(tmp_path, one.reports(every_s=2.0, offset_s=late))
    found = pair(one.plots(), known, SITE)
    paths = Paths.of(known, SITE)
    row = paths.before(np.zeros(len(found.pairs), int), found.pairs.time_s)
    straight = paths.line(row, found.pairs.time_s, found.pairs.height_m)
    place, speed = truth_of(fleet, found.pairs)
    inside = slice(2, -2)  # the outermost pieces have one neighbour less
    curved = np.abs(found.pairs.position - place)[inside].max()
    assert curved < 0.05 * np.abs(straight - place)[inside].max()
    assert np.abs(found.pairs.velocity - speed)[inside].max() < 0.05 * METRE_PER_SECOND


def test_a_report_stands_for_its_own_instant_and_its_own_target_only(tmp_path):
    early, late = Aircraft(1), Aircraft(2, start_s=1_700.0)
    paths = Paths.of(reference(tmp_path, early.reports(), late.reports()), SITE)
    last = early.reports()["time_s"][-1]
    row = paths.before(
        np.array([0, 0, 1, 1, 1]), np.array([last, last + 0.1, last, 1_700.0, 999.0])
    )
    assert row.tolist() == [598, -1, -1, 600, -1]


def test_without_addresses_the_code_and_the_time_decide(tmp_path):
    fleet, plots = sky(address=None)
    reports = [each.reports(mode_a=each.code) for each in fleet]
    found = pair(plots, reference(tmp_path, *reports), SITE)
    assert len(found.pairs) == plots.height
    place, _ = truth_of(fleet, found.pairs)
    assert np.abs(found.pairs.position - place).max() < CENTIMETRE


def test_a_plot_with_an_address_is_never_matched_by_its_code(tmp_path):
    one = Aircraft(1)
    plots = one.plots(address="ABCDEF")
    other = Aircraft(2).plots()
    both = pl.concat([plots, other])
    reports = [one.reports(mode_a=one.code), Aircraft(2).reports(mode_a=Aircraft(2).code)]
    found = pair(both, reference(tmp_path, *reports), SITE)
    assert found.dropped == {"not in the reference": plots.height}


def test_a_code_of_two_targets_at_once_is_dropped_and_counted(tmp_path):
    first, second = Aircraft(1), Aircraft(2, start_s=1_300.0)
    plots = pl.concat([first.plots(address=None), Aircraft(3).plots(address=None)])
    reports = [first.reports(mode_a=first.code), second.reports(mode_a=first.code)]
    reports.append(Aircraft(3).reports(mode_a=Aircraft(3).code))
    found = pair(plots, reference(tmp_path, *reports), SITE)
    shared = first.plots().filter(pl.col("time_s") >= 1_300.0).height
    assert found.dropped == {"two targets": shared}


def test_track_numbers_that_hand_over_a_code_are_never_joined(tmp_path):
    one = Aircraft(1)
    reports = one.reports(every_s=2.0, mode_a=one.code).drop("address")
    half = pl.col("time_s") < 1_301.0
    handed = reports.with_columns(target=pl.when(half).then(pl.lit("7")).otherwise(pl.lit("8")))
    plots = one.plots(address=None)
    found = pair(plots, reference(tmp_path, handed), SITE)
    between = plots.filter(pl.col("time_s").is_between(1_300.0, 1_302.0, closed="none")).height
    assert between == 1
    assert found.dropped == {"no report near": between}
    assert found.pairs.names == (one.code,)


def test_codes_that_are_garbled_or_of_everybody_are_no_identity(tmp_path):
    fleet, plots = sky(address=None)
    row = pl.int_range(pl.len())
    plots = plots.with_columns(
        mode_a_valid=row >= 5,
        mode_a=pl.when(row.is_between(10, 12)).then(pl.lit("7000")).otherwise("mode_a"),
    )
    reports = [each.reports(mode_a=each.code) for each in fleet]
    found = pair(plots, reference(tmp_path, *reports), SITE)
    assert found.dropped == {"garbled code": 5, "shared code": 3}
    silent = reference(tmp_path, *(each.drop("address") for each in reports))
    named = plots.with_columns(address=pl.lit("ABCDEF"))  # which makes no garbled code valid
    assert pair(named, silent, SITE).dropped == {"not in the reference": 5, "shared code": 3}


def test_two_plots_of_one_identity_in_a_scan_are_both_dropped(tmp_path):
    fleet, plots = sky()
    again = plots[[40]].with_columns(pl.col("time_s") + 0.5, pl.col("range_m") + 900.0)
    both = pl.concat([plots, again]).sort("time_s")
    found = pair(both, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    assert found.dropped == {"two plots": 2}


def test_nothing_is_interpolated_over_a_gap(tmp_path):
    one = Aircraft(1)
    plots, reports = one.plots(), one.reports()
    after = pl.col("time_s") <= 1_100.0
    short = reference(tmp_path, reports.filter(after | (pl.col("time_s") >= 1_105.0)))
    long = reference(tmp_path, reports.filter(after | (pl.col("time_s") >= 1_106.0)))
    assert short.longest_gap_s == long.longest_gap_s == 5.0
    assert pair(plots, short, SITE).dropped == {}
    inside = plots.filter(pl.col("time_s").is_between(1_100.0, 1_106.0)).height
    assert pair(plots, long, SITE).dropped == {"no report near": inside}


def test_what_cannot_be_a_measurement_is_counted_by_its_reason(tmp_path):
    fleet, plots = sky()
    row = pl.int_range(pl.len())
    nan = float("nan")
    plots = plots.with_columns(
        range_m=pl.when(row == 1).then(0.0).when(row == 2).then(nan).otherwise("range_m"),
        report_type=pl.when(row == 3).then(pl.lit("none")).otherwise("report_type"),
        address=pl.when(row == 4).then(None).otherwise("address"),
        mode_a=pl.when(row == 4).then(None).otherwise("mode_a"),
        time_s=pl.when(row == 5).then(None).otherwise("time_s"),
        azimuth_deg=pl.when(row == 6).then(nan).otherwise("azimuth_deg"),
    )
    plots = pl.concat([plots, plots[[20]]])
    found = pair(plots, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    assert found.dropped == {
        "no position": 2,
        "coasted": 1,
        "no identity": 1,
        "no time": 1,
        "repeated": 1,
        "zero range": 1,
    }
    assert accounted(found, plots)


def test_a_target_overhead_tells_nothing_of_azimuth(tmp_path):
    above = Aircraft(1, north_deg=-0.281, east_deg=0.6)  # over the site after 300 s
    plots = above.plots()
    found = pair(plots, reference(tmp_path, above.reports()), SITE)
    assert found.dropped["overhead"] > 0
    assert accounted(found, plots)
    ground = np.hypot(found.pairs.position[:, 0], found.pairs.position[:, 1])
    assert np.degrees(np.arctan2(found.pairs.position[:, 2], ground)).max() < 75.0


def test_the_order_of_plots_and_of_reports_does_not_matter(tmp_path):
    fleet, plots = sky()
    reports = pl.concat([each.reports() for each in fleet])
    tidy = pair(plots, reference(tmp_path, reports), SITE)
    shuffled = plots.with_row_index().sample(fraction=1, shuffle=True, seed=5)
    reports = reports.sample(fraction=1, shuffle=True, seed=6)
    mixed = pair(shuffled.drop("index"), reference(tmp_path, reports), SITE)
    back = np.argsort(shuffled["index"].to_numpy()[mixed.pairs.row])
    for name in ("z", "position", "velocity", "height_m"):
        assert np.array_equal(getattr(mixed.pairs, name)[back], getattr(tidy.pairs, name))


def test_a_height_that_the_reference_lacks_is_the_plots_and_is_said(tmp_path):
    fleet, plots = sky()
    blind = [each.reports().drop("height_m") for each in fleet]
    found = pair(plots, reference(tmp_path, *blind), SITE)
    assert np.array_equal(found.pairs.height_m, plots["pressure_altitude_m"])
    # A height that is not the pair's own would show in the range of every climbing aircraft.
    assert np.abs(found.pairs.residuals()[:, 0]).max() < CENTIMETRE
    assert f"the plot's pressure altitude ({plots.height})" in " ".join(found.remarks)
    mute = plots.with_columns(altitude_valid=pl.int_range(pl.len()) >= 7)
    assert pair(mute, reference(tmp_path, *blind), SITE).dropped == {"no height": 7}


def test_the_delay_of_the_air_is_taken_out_of_the_plots(tmp_path):
    fleet, plots = sky()
    air = ExponentialAtmosphere()
    known = reference(tmp_path, *(each.reports() for each in fleet))
    truth = plots["range_m"].to_numpy()
    delay = air.excess_range(truth, plots["pressure_altitude_m"].to_numpy(), SITE.height_m)
    late = plots.with_columns(range_m=pl.Series(truth + delay))
    vacuum = pair(late, known, SITE).pairs.residuals()[:, 0]
    assert np.median(vacuum) > 5.0
    assert (
        np.abs(pair(late, known, SITE, atmosphere=air).pairs.residuals()[:, 0]).max() < CENTIMETRE
    )


def test_midnight_between_two_clocks_changes_no_bit(tmp_path):
    fleet, plots = sky()
    reports = pl.concat([each.reports() for each in fleet])
    plain = pair(plots, reference(tmp_path, reports), SITE)
    shift = 86_400.0 - 1_200.0  # in the middle of the flights; all times are whole 1/128 s
    late = plots.with_columns(pl.col("time_s") + shift)
    # A recording of the reference that began after midnight counts from the next day.
    after = reports.filter(pl.col("time_s") > 1_250.0)
    next_day = after.with_columns(pl.col("time_s") + shift - 86_400.0)
    over = pair(late, reference(tmp_path, next_day), SITE)
    assert any("another midnight" in remark for remark in over.remarks)
    same = np.isin(plain.pairs.row, over.pairs.row)
    inner = plain.pairs.time_s[same] > 1_253.0  # the first report's neighbour was cut away
    assert inner.sum() > 300
    for name in ("z", "position", "velocity"):
        shifted, here = getattr(over.pairs, name), getattr(plain.pairs, name)[same]
        assert np.array_equal(shifted[inner], here[inner])


def test_dated_clocks_are_never_moved_by_days(tmp_path):
    fleet, plots = sky()
    dated = pl.col("time_s") + 1.7e9
    reports = pl.concat([each.reports() for each in fleet])
    found = pair(plots.with_columns(dated), reference(tmp_path, reports.with_columns(dated)), SITE)
    assert len(found.pairs) == plots.height
    assert not any("midnight" in remark for remark in found.remarks)
    later = reports.with_columns(dated + 86_400.0)
    with pytest.raises(DataError, match="do not overlap in time"):
        pair(plots.with_columns(dated), reference(tmp_path, later), SITE)


def test_scans_that_were_due_are_told_from_those_that_were_seen(tmp_path):
    fleet, plots = sky()
    row = pl.int_range(pl.len()).over("address")
    inner = (row >= 2) & (row < pl.len().over("address") - 3)
    heard = plots.filter(inner & (row % 10 != 5) & (row % 10 != 6))  # two scans in a row are missed
    found = pair(heard, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    assert found.scan_s == SCAN_S
    assert found.due.height == plots.height
    assert found.due["seen"].sum() == heard.height
    for each in fleet:
        mine = found.due.filter(pl.col("name") == each.address)
        expected = plots.filter(pl.col("address") == each.address)["time_s"].to_numpy()
        assert np.abs(mine["time_s"].to_numpy() - expected).max() < 1e-9
        enu = mine.select("east_m", "north_m", "up_m").to_numpy()
        assert np.abs(enu - each.enu(expected)).max() < 1.0


def test_a_target_that_is_never_seen_is_due_all_the_same(tmp_path):
    fleet, plots = sky()
    hidden = Aircraft(9)
    known = reference(tmp_path, *(each.reports() for each in [*fleet, hidden]))
    mine = pair(plots, known, SITE).due.filter(pl.col("name") == hidden.address)
    assert abs(mine.height - hidden.seconds / SCAN_S) <= 1
    assert not mine["seen"].any()


NAMELESS = {"address": None, "mode_a": None, "mode_a_valid": None, "report_type": "psr"}


def test_without_any_identity_position_decides_within_the_gate(tmp_path):
    fleet, plots = sky(**NAMELESS)
    clutter = plots.with_columns(pl.col("range_m") + 5_000.0, radar_track=pl.lit(None, pl.Int64))
    both = pl.concat([plots, clutter], how="vertical_relaxed").sort("time_s")
    found = pair(both, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    assert found.how == "position"
    assert found.dropped == {"no target near": clutter.height}
    place, _ = truth_of(fleet, found.pairs)
    assert np.abs(found.pairs.position - place).max() < CENTIMETRE
    assert any("within 60 m" in remark for remark in found.remarks)


def test_of_two_plots_near_a_target_the_nearer_one_is_taken(tmp_path):
    fleet, plots = sky(**NAMELESS)
    echo = plots.with_columns(pl.col("range_m") + 30.0, pl.col("time_s") + 0.01)
    both = pl.concat([plots, echo])
    found = pair(both, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    assert found.dropped == {"not nearest": echo.height}
    assert np.array_equal(found.pairs.row, np.arange(plots.height))


def test_a_plot_between_two_targets_is_nobodys(tmp_path):
    fleet, plots = sky(**NAMELESS)
    twin = fleet[0].reports(address="ABCDEF").with_columns(pl.col("height_m") + 1.0)
    known = reference(tmp_path, twin, *(each.reports() for each in fleet))
    found = pair(plots, known, SITE)
    assert found.dropped == {"two targets": plots.filter(radar_track=1).height}


def test_a_radar_track_that_changes_its_target_is_dropped(tmp_path):
    fleet, plots = sky(**NAMELESS)
    taken = pl.col("radar_track").is_in([1, 2])
    mixed = plots.with_columns(radar_track=pl.when(taken).then(1).otherwise("radar_track"))
    found = pair(mixed, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    assert found.dropped == {"inconsistent": plots.filter(taken).height}


def test_a_gate_is_a_distance(tmp_path):
    fleet, plots = sky()
    known = reference(tmp_path, *(each.reports() for each in fleet))
    with pytest.raises(UsageError, match="no distance"):
        pair(plots, known, SITE, gate_m=-1.0)


@pytest.mark.parametrize("gate", [40.0, 600.0])
def test_neighbours_are_those_that_trying_all_finds(gate):
    generator = np.random.default_rng(3)
    targets, reports, plots = 12, 60, 3_000
    step = generator.choice([0.5, 1.0, 4.0, 9.0], (targets, reports), p=[0.3, 0.5, 0.15, 0.05])
    time = np.cumsum(step, axis=1)
    speed = generator.normal(0, 150, (2, targets, 1))
    north, east = generator.uniform(-5e3, 5e3, (2, targets, 1)) + speed * time
    where = north + 1j * east
    paths = paths_of(time)
    one = generator.integers(0, targets, plots)
    when = generator.uniform(0, time.max(axis=1)[one])
    when[:50] = time[one[:50], 7]
    off = generator.normal(0, gate, (2, plots))
    place = np.array([np.interp(t, time[k], where[k]) for t, k in zip(when, one, strict=True)])
    place += off[0] + 1j * off[1]
    found = near(when, place, paths, where.ravel(), gate)
    expected = set()
    for target in range(targets):
        row = paths.before(np.full(plots, target), when)
        there = np.flatnonzero(row >= 0)
        line = np.interp(when[there], time[target], where[target])
        close = there[np.abs(place[there] - line) < gate]
        expected |= {(int(p), int(row[p])) for p in close}
    assert len(expected) > 800
    assert {(int(p), int(r)) for p, r in zip(found[0], found[1], strict=True)} == expected
    assert len(found[0]) == len(expected)


def paths_of(time):
    """Reports of which only times (targets, reports) matter."""
    nothing = np.zeros(time.size)
    names = ("ground", "upward", "height", "pressure", "accuracy", "on_ground")
    target = np.repeat(np.arange(len(time)), time.shape[1])
    columns = dict.fromkeys(names, nothing)
    return Paths(time=time.ravel(), target=target, longest_gap_s=5.0, **columns)
