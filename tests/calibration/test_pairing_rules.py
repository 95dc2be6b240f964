"""Rules of pairing that a plain sky does not show: uneven reports, faint tracks, heights, units."""

import numpy as np
import polars as pl
import pytest
from flown import SCAN_S, SITE, Aircraft, reference, sky

from boresight.calibration.interpolation import Paths
from boresight.calibration.matching import scan
from boresight.calibration.pairing import pair
from boresight.models.atmosphere import ExponentialAtmosphere

NAMELESS = {"address": None, "mode_a": None, "mode_a_valid": None, "report_type": "psr"}


def parabola(times, acceleration):
    """Paths of one target that flies north + i east on a parabola, told at these times."""
    time = np.asarray(times, dtype=float)
    where = 100.0 * time + 0.5 * acceleration * time**2
    n, nothing = len(time), np.zeros(len(time))
    ground = np.stack([where, -2.0 * where, nothing], axis=1)
    upward = np.broadcast_to([0.0, 0.0, 1.0], (n, 3))
    return Paths(
        time=time,
        target=np.zeros(n, dtype=int),
        ground=ground,
        upward=upward,
        height=np.full(n, 5e3),
        pressure=nothing,
        accuracy=nothing,
        on_ground=np.zeros(n, dtype=bool),
        longest_gap_s=10.0,
    )


@pytest.mark.parametrize("at", [0.4, 1.7, 2.5, 5.0, 8.6])
def test_a_parabola_is_met_exactly_however_uneven_its_reports(at):
    """In the outermost pieces too: where one slope is not known the path is a parabola."""
    paths = parabola([0.0, 1.0, 2.0, 4.5, 8.0, 9.0], acceleration=3.0)
    row = paths.before(np.zeros(1, dtype=int), np.array([at]))
    position, velocity = paths.at(row, np.array([at]), np.zeros(1))
    where, speed = 100.0 * at + 1.5 * at**2, 100.0 + 3.0 * at
    np.testing.assert_allclose(position, [[where, -2.0 * where, 5e3]], rtol=1e-12)
    np.testing.assert_allclose(velocity, [[speed, -2.0 * speed, 0.0]], rtol=1e-10, atol=1e-9)


def test_a_radar_track_of_few_plots_is_not_believed(tmp_path):
    fleet, plots = sky(**NAMELESS)
    few = plots.filter(radar_track=2).head(14)
    rest = plots.filter(pl.col("radar_track") != 2)
    known = reference(tmp_path, *(each.reports() for each in fleet))
    found = pair(pl.concat([rest, few]).sort("time_s"), known, SITE)
    assert found.dropped == {"inconsistent": 14}


def test_reasons_come_most_frequent_first(tmp_path):
    fleet, plots = sky()
    row = pl.int_range(pl.len())
    bad = plots.with_columns(
        range_m=pl.when(row < 3).then(0.0).otherwise("range_m"),
        address=pl.when(row.is_between(3, 9)).then(pl.lit("ABCDEF")).otherwise("address"),
        report_type=pl.when(row == 20).then(pl.lit("none")).otherwise("report_type"),
    )
    found = pair(bad, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    assert list(found.dropped.items()) == [
        ("not in the reference", 7),
        ("zero range", 3),
        ("coasted", 1),
    ]


def test_elevations_are_measured_in_degrees_and_bent_by_the_air(tmp_path):
    fleet, plots = sky()
    enu = {each.address: each for each in fleet}
    rows = plots.select("address", "time_s").rows()
    place = np.array([enu[address].enu(time) for address, time in rows])
    slant = np.linalg.norm(place, axis=1)
    true = np.arcsin(place[:, 2] / slant)
    air = ExponentialAtmosphere()
    height = np.array([enu[address].truth(time)[2] for address, time in rows])
    bent = np.degrees(true + air.bending(slant, height, SITE.height_m))
    raised = plots.with_columns(elevation_deg=pl.Series(bent))
    known = reference(tmp_path, *(each.reports() for each in fleet))
    plain, clean = (
        pair(raised, known, SITE, atmosphere=each).pairs.residuals()[:, 2] for each in (None, air)
    )
    # A ray comes in from above its target: the plot is too high by a tenth of a milliradian here.
    assert (plain > 1e-5).all()
    assert np.abs(clean).max() < 1e-3 * np.median(plain)


def test_the_references_own_height_comes_first(tmp_path):
    fleet, plots = sky()
    other = plots.with_columns(pl.col("pressure_altitude_m") + 90.0)
    known = reference(tmp_path, *(each.reports() for each in fleet))
    found = pair(other, known, SITE)
    assert np.abs(found.pairs.residuals()[:, 0]).max() < 0.01
    assert found.remarks[0].startswith("Heights of targets, with the number of pairs: the refer")


@pytest.mark.parametrize("garbled", [-4_000.0, 39_000.0])
def test_a_pressure_altitude_that_nothing_flies_at_is_no_height(tmp_path, garbled):
    fleet, plots = sky()
    row = pl.int_range(pl.len())
    bad = pl.when(row < 6).then(garbled).otherwise("pressure_altitude_m")
    blind = [each.reports().drop("height_m") for each in fleet]
    found = pair(plots.with_columns(pressure_altitude_m=bad), reference(tmp_path, *blind), SITE)
    assert found.dropped == {"no height": 6}


def test_an_antenna_that_turns_unevenly_is_due_once_a_turn(tmp_path):
    fleet, plots = sky()
    late = np.random.default_rng(8).uniform(-0.3, 0.3, plots.height)
    uneven = plots.with_columns(time_s=pl.Series(plots["time_s"].to_numpy() + late))
    inner = pl.int_range(pl.len()).over("address") % 5 != 3
    heard = uneven.filter(inner)
    found = pair(heard, reference(tmp_path, *(each.reports() for each in fleet)), SITE)
    # The jitter moves the median turn a little: a scan may be won or lost at each end.
    assert abs(found.due.height - plots.height) <= 2 * len(fleet)
    assert found.due["seen"].sum() == heard.height


def test_a_scan_with_two_plots_of_one_target_has_seen_it(tmp_path):
    fleet, plots = sky()
    again = plots[[40]].with_columns(pl.col("time_s") + 0.5, pl.col("range_m") + 900.0)
    both = pl.concat([plots, again]).sort("time_s")
    known = reference(tmp_path, *(each.reports() for each in fleet))
    found = pair(both, known, SITE)
    assert found.dropped == {"two plots": 2}
    then = (pl.col("time_s") - plots["time_s"][40]).abs() < SCAN_S / 4
    due = found.due.filter(then, name=plots["address"][40])
    assert due.height >= 1
    assert due["seen"].all()


def test_a_target_that_is_never_seen_is_due_from_half_a_scan_on(tmp_path):
    fleet, plots = sky()
    hidden = Aircraft(9)
    known = reference(tmp_path, *(each.reports() for each in [*fleet, hidden]))
    mine = pair(plots, known, SITE).due.filter(pl.col("name") == hidden.address)
    assert mine["time_s"][0] == pytest.approx(hidden.start_s + SCAN_S / 2)
    assert mine["time_s"].diff().drop_nulls().unique().round(9).to_list() == [SCAN_S]


def test_plots_of_a_target_are_kept_up_to_75_degrees(tmp_path):
    above = Aircraft(1, north_deg=-0.281, east_deg=0.6)  # over the site after 300 s
    plots = above.plots()
    found = pair(plots, reference(tmp_path, above.reports()), SITE)
    enu = above.enu(plots["time_s"].to_numpy())
    steep = np.degrees(np.arctan2(enu[:, 2], np.hypot(enu[:, 0], enu[:, 1])))
    assert found.dropped == {"overhead": int((steep > 74.93).sum())}  # where the cosine is 0.26
    assert ((steep > 45.0) & (steep < 74.0)).sum() >= 5


def test_the_turn_of_an_antenna_is_that_of_single_targets():
    pairs_of_plots = [(3.0 * i, i) for i in range(10)] + [(3.0 * i + 4.0, i) for i in range(10)]
    lone = [(100.0 + i, 50 + i) for i in range(30)]  # each seen once: nothing of a turn
    time, track = zip(*pairs_of_plots, *lone, strict=True)
    plots = pl.DataFrame({"time_s": time, "radar_track": track})
    assert scan(plots, np.full(plots.height, "", dtype=object)) == 4.0


def test_traffic_to_the_west_is_as_near_its_targets_as_to_the_east(tmp_path):
    west = [Aircraft(n, north_deg=0.05 * n, east_deg=-1.0) for n in range(1, 4)]
    plots = pl.concat([each.plots() for each in west])
    assert (plots["azimuth_deg"] > 180.0).all()
    found = pair(plots, reference(tmp_path, *(each.reports() for each in west)), SITE)
    assert len(found.pairs) == plots.height
    assert len(found.remarks) == 1  # of the heights


def test_times_of_day_sorted_over_midnight_are_put_on_the_plots_day(tmp_path):
    fleet, plots = sky()
    reports = pl.concat([each.reports() for each in fleet])
    plain = pair(plots, reference(tmp_path, reports), SITE)
    shift = 86_400.0 - 1_200.0  # in the middle of the flights; all times are whole 1/128 s
    times = (pl.col("time_s") + shift) % 86_400.0
    sorted_over = reports.with_columns(times).sort("time_s")  # so no row tells of the midnight
    late = plots.with_columns(pl.col("time_s") + shift)
    found = pair(late, reference(tmp_path, sorted_over), SITE)
    np.testing.assert_array_equal(found.pairs.position, plain.pairs.position)
    assert any("midnight" in remark for remark in found.remarks)
