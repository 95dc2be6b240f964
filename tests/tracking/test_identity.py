import numpy as np
import polars as pl

from boresight.tracking.identity import sort_by_identity


def reasons(found):
    names, counts = np.unique(found.skipped[found.skipped != ""], return_counts=True)
    return dict(zip(names.tolist(), counts.tolist(), strict=True))


def test_each_address_is_one_track_in_time_order(sky):
    plots = pl.concat([sky.aircraft(n) for n in range(5)]).sample(fraction=1, shuffle=True, seed=3)
    found = sort_by_identity(plots)
    assert np.unique(found.track).tolist() == [0, 1, 2, 3, 4]
    address = plots["address"].to_numpy()[found.row]
    time = plots["time_s"].to_numpy()[found.row]
    for track in range(5):
        mine = found.track == track
        assert len(set(address[mine])) == 1
        assert np.all(np.diff(time[mine]) > 0)


def test_tracks_are_numbered_by_first_appearance(sky):
    plots = pl.concat([sky.aircraft(1, start_s=300.0), sky.aircraft(2)])
    found = sort_by_identity(plots)
    first = plots["address"].to_numpy()[found.row[found.track == 0]][0]
    assert first == "F00002"


def test_coasted_garbled_and_nameless_plots_are_counted_and_not_used(sky):
    plots = sky.aircraft(1, plots=20, code="1234", address=False)
    row = pl.int_range(pl.len())
    plots = plots.with_columns(
        report_type=pl.when(row < 3).then(pl.lit("none")).otherwise("report_type"),
        mode_a_valid=~row.is_between(3, 6),
        mode_a=pl.when(row.is_between(7, 8)).then(None).otherwise("mode_a"),
        range_m=pl.when(row == 9).then(float("nan")).otherwise("range_m"),
    )
    found = sort_by_identity(plots)
    assert reasons(found) == {"coasted": 3, "garbled code": 4, "no identity": 2, "no position": 1}
    assert len(found.row) == 10


def test_a_garbled_code_does_not_matter_beside_an_address(sky):
    plots = sky.aircraft(1, plots=20, code="1234").with_columns(mode_a_valid=pl.lit(value=False))
    assert len(sort_by_identity(plots).row) == 20


def test_two_aircraft_with_one_code_become_two_tracks(sky):
    plots = pl.concat(
        [sky.aircraft(n, code="7000", address=False) for n in (1, 2)]
    )  # tens of kilometres apart
    found = sort_by_identity(plots)
    assert len(np.unique(found.track)) == 2
    truth = np.repeat([0, 1], 100)[found.row]
    for track in (0, 1):
        assert len(set(truth[found.track == track])) == 1


def test_a_long_silence_ends_a_track_and_a_short_one_does_not(sky):
    plots = sky.aircraft(1)
    time = pl.col("time_s") - pl.col("time_s").min()
    short = plots.filter(~time.is_between(100, 150))
    long = plots.filter(~time.is_between(100, 200))
    assert sort_by_identity(short).track.max() == 0
    assert sort_by_identity(long).track.max() == 1


def test_a_split_plot_is_a_duplicate_and_a_lone_far_one_a_jump(sky):
    plots = sky.aircraft(1, plots=30)
    again = plots[[10]].with_columns(pl.col("time_s") + 0.01, pl.col("range_m") + 50.0)
    far = plots[[20]].with_columns(pl.col("time_s") + 0.01, pl.col("range_m") + 9_000.0)
    found = sort_by_identity(pl.concat([plots, again, far]))
    assert reasons(found) == {"duplicate": 1, "jump": 1}
    assert len(np.unique(found.track)) == 1


def test_scan_is_the_median_revisit(sky):
    assert abs(sort_by_identity(sky.aircraft(1)).scan_s - 4.0) < 1e-9
