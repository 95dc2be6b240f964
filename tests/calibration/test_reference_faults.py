"""Clocks, places and units that are wrong are named, each by a sentence; nothing is repaired."""

import numpy as np
import polars as pl
import pytest
from flown import SITE, reference, sky

from boresight.calibration.pairing import pair
from boresight.calibration.references import from_file
from boresight.errors import DataError
from boresight.maths.frames import Site

NAMELESS = {"address": None, "mode_a": None, "mode_a_valid": None, "report_type": "psr"}


def reports_of(fleet):
    return pl.concat([each.reports() for each in fleet])


def refused(plots, reports, folder, site=SITE, **options):
    with pytest.raises(DataError) as caught:
        pair(plots, reference(folder, reports), site, **options)
    assert caught.value.exit_code == 65
    assert caught.value.next_step
    return str(caught.value)


@pytest.mark.parametrize("hours", [1, -1, 2, -7])
def test_a_clock_off_by_whole_hours_is_named_with_its_offset(tmp_path, hours):
    fleet, plots = sky()
    off = reports_of(fleet).with_columns(pl.col("time_s") + 3_600.0 * hours)
    said = refused(plots, off, tmp_path)
    assert f"clock is {3_600 * abs(hours)} s {'ahead of' if hours > 0 else 'behind'}" in said


def test_an_hour_is_seen_even_where_both_recordings_still_overlap(tmp_path):
    fleet, plots = sky()
    later = [each.__class__(each.number, start_s=4_600.0) for each in fleet]
    plots = pl.concat([plots, *(each.plots() for each in later)])
    off = pl.concat([reports_of(fleet), reports_of(later)])
    off = off.with_columns(pl.col("time_s") + 3_600.0)
    assert "3600 s ahead" in refused(plots, off, tmp_path)


@pytest.mark.parametrize("identity", [{}, NAMELESS])
def test_an_hour_is_named_with_and_without_identity(tmp_path, identity):
    fleet, plots = sky(**identity)
    off = reports_of(fleet).with_columns(pl.col("time_s") - 3_600.0)
    assert "3600 s behind" in refused(plots, off, tmp_path)


def test_no_overlap_in_time_tells_both_spans(tmp_path):
    fleet, plots = sky()
    off = reports_of(fleet).with_columns(pl.col("time_s") + 20_000.0)
    said = refused(plots, off, tmp_path)
    assert "do not overlap in time" in said
    assert "21000.0" in said


@pytest.mark.parametrize("identity", [{}, NAMELESS])
def test_no_overlap_in_place_tells_the_distance(tmp_path, identity):
    fleet, plots = sky(**identity)
    far = reports_of(fleet).with_columns(pl.col("longitude_deg") + 40.0)
    plots = plots.with_columns(pl.lit(None, pl.String).alias("address"))
    assert "do not overlap in place" in refused(plots, far, tmp_path)


@pytest.mark.parametrize("identity", [{}, NAMELESS])
def test_exchanged_latitude_and_longitude_are_named(tmp_path, identity):
    fleet, plots = sky(**identity)
    names = {"latitude_deg": "longitude_deg", "longitude_deg": "latitude_deg"}
    swapped = reports_of(fleet).rename(names)
    assert "longitude of the reference are exchanged" in refused(plots, swapped, tmp_path)


def test_a_site_with_latitude_and_longitude_exchanged_is_named(tmp_path):
    fleet, plots = sky()
    site = Site(latitude_deg=8.0, longitude_deg=47.0, height_m=500.0)
    assert "longitude of the site are exchanged" in refused(
        plots, reports_of(fleet), tmp_path, site
    )


@pytest.mark.parametrize("identity", [{}, NAMELESS])
@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (1 / 0.3048, "ranges are in feet"),
        (0.3048, "taken for feet"),
        (1 / 1852.0, "nautical miles"),
        (1e-3, "kilometres"),
    ],
)
def test_ranges_in_another_unit_are_named(tmp_path, identity, factor, said):
    fleet, plots = sky(**identity)
    other = plots.with_columns(pl.col("range_m") * factor)
    assert said in refused(other, reports_of(fleet), tmp_path)


def test_plots_that_are_nowhere_near_their_targets_are_refused_with_how_far(tmp_path):
    fleet, plots = sky()
    turned = plots.with_columns((pl.col("azimuth_deg") + 90.0) % 360.0)
    said = refused(turned, reports_of(fleet), tmp_path)
    assert "+0.0 km in range and +90.0 degrees" in said


def test_many_wrong_identities_are_remarked(tmp_path):
    fleet, plots = sky(8)
    names = [each.address for each in fleet]
    wrong = dict(zip(names[:6], [*names[1:6], names[0]], strict=True))
    mixed = plots.with_columns(pl.col("address").replace(wrong))
    found = pair(mixed, reference(tmp_path, reports_of(fleet)), SITE)
    assert any("near the target that has their identity" in remark for remark in found.remarks)


def test_azimuths_in_radians_are_named(tmp_path):
    fleet, plots = sky()
    other = plots.with_columns(pl.col("azimuth_deg").radians())
    assert "azimuths are in radians" in refused(other, reports_of(fleet), tmp_path)


def test_heights_of_the_reference_in_feet_are_named(tmp_path):
    fleet, plots = sky()
    feet = reports_of(fleet).with_columns(pl.col("height_m") / 0.3048)
    said = refused(plots, feet, tmp_path)
    assert "the reference's heights are 3.28 times the plots' pressure altitudes" in said


def test_pressure_altitudes_of_the_plots_in_feet_are_named(tmp_path):
    fleet, plots = sky()
    feet = plots.with_columns(pl.col("pressure_altitude_m") / 0.3048)
    said = refused(feet, reports_of(fleet), tmp_path)
    assert "the plots' pressure altitudes are 3.28 times the reference's heights" in said


def test_heights_in_feet_that_nothing_can_be_held_against_are_too_high(tmp_path):
    fleet, plots = sky()
    plots = plots.with_columns(pressure_altitude_m=pl.lit(None, pl.Float64))
    feet = reports_of(fleet).with_columns(pl.col("height_m") / 0.3048)
    assert "no traffic flies there" in refused(plots, feet, tmp_path)


@pytest.mark.parametrize("seed", range(20))
def test_biases_as_large_as_radars_have_are_no_fault(tmp_path, seed):
    generator = np.random.default_rng(seed)
    fleet, plots = sky()
    range_m, gain, azimuth, time = generator.normal(0, [300.0, 3e-3, 2.0, 2.0])
    biased = plots.with_columns(
        pl.col("range_m") * (1 + gain) + range_m,
        (pl.col("azimuth_deg") + azimuth) % 360,
        pl.col("time_s") + time,
    )
    found = pair(biased, reference(tmp_path, reports_of(fleet)), SITE)
    assert len(found.pairs) > 0.95 * plots.height


def test_repeated_reports_are_dropped_counted_and_said(tmp_path):
    fleet, plots = sky()
    reports = reports_of(fleet)
    doubled = reference(tmp_path, pl.concat([reports, reports[10:60]]).sort("time_s"))
    assert doubled.refused == {"duplicate": 50}
    assert any("50 reports" in remark for remark in doubled.remarks)
    plain = pair(plots, reference(tmp_path, reports), SITE).pairs
    assert np.array_equal(pair(plots, doubled, SITE).pairs.position, plain.position)


@pytest.mark.parametrize("name", ["reference.csv", "reference.parquet"])
def test_rows_out_of_order_are_sorted_and_said(tmp_path, name):
    fleet, _ = sky()
    reports = reports_of(fleet)
    mixed = reports.sample(fraction=1, shuffle=True, seed=2)
    tidy = reference(tmp_path, reports, name=name)
    found = reference(tmp_path, mixed, name=name)
    assert tidy.remarks == []
    assert any("go back in time" in remark for remark in found.remarks)
    assert found.table.drop("age_s", "accuracy_m", "pressure_altitude_m").equals(
        tidy.table.drop("age_s", "accuracy_m", "pressure_altitude_m")
    )


def test_times_of_a_table_that_start_again_at_midnight_are_counted_on(tmp_path):
    fleet, plots = sky()
    shift = 86_400.0 - 1_200.0
    reports = reports_of(fleet).with_columns((pl.col("time_s") + shift) % 86_400.0)
    known = reference(tmp_path, reports)
    assert any("start again at midnight" in remark for remark in known.remarks)
    found = pair(plots.with_columns(pl.col("time_s") + shift), known, SITE)
    plain = pair(plots, reference(tmp_path, reports_of(fleet)), SITE)
    assert np.array_equal(found.pairs.position, plain.pairs.position)


def test_a_latitude_beyond_the_pole_names_its_line(tmp_path):
    path = tmp_path / "swapped.csv"
    path.write_text("time_s,latitude_deg,longitude_deg\n1,120.5,33.0\n2,120.6,33.0\n")
    with pytest.raises(DataError, match=r"latitude_deg is 120\.5") as caught:
        from_file(path)
    assert "line 2" in caught.value.where


def test_a_table_without_positions_is_refused(tmp_path):
    path = tmp_path / "empty.csv"
    path.write_text("time_s,latitude_deg,longitude_deg\n1,,\n2,,\n")
    with pytest.raises(DataError, match="no row"):
        from_file(path)
