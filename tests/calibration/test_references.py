"""What a reference is made of, and what is refused."""

import numpy as np
import polars as pl
import pytest
from flown import Aircraft

from boresight.calibration.references import Limits, from_file, from_recording
from boresight.errors import DataError, MissingInputError, UsageError
from boresight.formats.recording import Recording

ONE = Aircraft(1)


def recording(adsb=None, tracks=None):
    empty = pl.DataFrame()
    return Recording(
        plots=empty,
        reference=empty if adsb is None else adsb,
        system_tracks=empty if tracks is None else tracks,
        sectors=empty,
        summary={},
    )


def adsb(**columns):
    own = {"sensor": "1/1", "mode_a": None, "pressure_altitude_m": None, "quality": 9}
    own |= {"quality_kind": "nacp", "accuracy_m": 30.0, "age_s": 0.1, "on_ground": False}
    own |= {"simulated": False, "test": False}
    return ONE.reports(**(own | columns)).with_columns(pl.col("mode_a").cast(pl.String))


def tracks(number, code="1234", every_s=4.0, **columns):
    own = {"sensor": "1/1", "system_track": number, "mode_a": code, "age_s": 4.0}
    own |= {"coasted": False, "simulated": False, "accuracy_m": None}
    table = ONE.reports(every_s=every_s, **(own | columns))
    return table.with_columns(
        address=pl.lit(None, pl.String), mode_a=pl.col("mode_a").cast(pl.String)
    )


def where(row, bad, good):
    return pl.when(row).then(bad).otherwise(good)


def test_every_report_that_is_refused_is_counted_with_its_reason():
    row = pl.int_range(pl.len())
    table = adsb().with_columns(
        simulated=row < 2,
        test=row.is_between(2, 4),
        latitude_deg=where(row.is_between(5, 8), None, pl.col("latitude_deg")),
        address=where(row.is_between(9, 13), None, pl.col("address")),
        accuracy_m=where(row.is_between(14, 19), 926.0, pl.col("accuracy_m")),
        quality=where(row.is_between(20, 26), 0, pl.col("quality")),
        age_s=where(row.is_between(27, 34), 2.5, pl.col("age_s")),
    )
    far = pl.col("latitude_deg") + pl.lit(3.0)
    table = table.with_columns(latitude_deg=where(row == 300, far, pl.col("latitude_deg")))
    found = from_recording(recording(table), "adsb")
    assert found.refused == {
        "simulated": 5,
        "no position": 4,
        "no identity": 5,
        "poor accuracy": 13,
        "too old": 8,
        "position jump": 1,
    }
    assert found.table.height == table.height - 36
    assert len(found.remarks) == len(found.refused)


def test_reports_without_a_time_of_their_position_go_where_others_have_one():
    row = pl.int_range(pl.len())
    table = adsb().with_columns(
        time_kind=where(row < 7, pl.lit("reception"), pl.lit("applicability"))
    )
    found = from_recording(recording(table), "adsb")
    assert found.refused == {"time unknown": 7}
    none = table.with_columns(time_kind=pl.lit("report"))
    kept = from_recording(recording(none), "adsb")
    assert kept.table.height == table.height
    assert "part of the time bias" in " ".join(kept.remarks)


def test_limits_are_settings():
    table = adsb(accuracy_m=926.0, age_s=3.0)
    with pytest.raises(DataError, match="fit to be used"):
        from_recording(recording(table), "adsb")
    wide = Limits(accuracy_m=500.0, age_s=5.0, longest_gap_s=7.0)
    found = from_recording(recording(table), "adsb", limits=wide)
    assert found.table.height == table.height
    assert found.longest_gap_s == 7.0


def test_accuracy_is_a_standard_deviation_of_one_axis():
    found = from_recording(recording(adsb(accuracy_m=30.0)), "adsb")
    sd = found.table["accuracy_m"][0]
    # A circular normal law with this standard deviation holds 95 % within the stated radius.
    draws = np.random.default_rng(1).normal(0, sd, (200_000, 2))
    # Standard deviation of the share: 0.0005; six of them.
    assert abs(np.mean(np.hypot(*draws.T) < 30.0) - 0.95) < 0.003


def test_the_gap_of_slow_tracks_follows_their_updates_within_bounds():
    gaps = {
        every: from_recording(
            recording(tracks=tracks(1, every_s=every)), "system tracks"
        ).longest_gap_s
        for every in (1.0, 4.0, 8.0)
    }
    assert gaps == {1.0: 5.0, 4.0: 9.0, 8.0: 10.0}
    assert from_recording(recording(adsb()), "adsb").longest_gap_s == 5.0


def test_extrapolated_tracks_and_other_centres_are_refused():
    row = pl.int_range(pl.len())
    mine = tracks(1).with_columns(coasted=row < 3, age_s=where(row.is_between(5, 8), 20.0, 4.0))
    other = tracks(2)[:40].with_columns(sensor=pl.lit("9/9"))
    found = from_recording(recording(tracks=pl.concat([mine, other])), "system tracks")
    assert found.kind == "system tracks"
    assert found.refused == {"another centre": 40, "too old": 4, "coasted": 3}


def test_a_track_that_changes_its_code_is_two_targets_and_a_missing_code_is_the_last():
    row = pl.int_range(pl.len())
    code = pl.when(row % 7 == 3).then(None).when(row < 60).then(pl.lit("1111"))
    table = tracks(1).with_columns(mode_a=code.otherwise(pl.lit("2222")))
    found = from_recording(recording(tracks=table), "system tracks").table
    counts = found.group_by("target", "mode_a").len().sort("target")
    assert counts["mode_a"].to_list() == ["1111", "2222"]
    assert counts["target"].to_list() == [0, 1]
    assert counts["len"].to_list() == [60, table.height - 60]  # the 60th tells no code
    assert found["mode_a"].null_count() == 0


def test_a_recording_without_a_reference_says_so():
    with pytest.raises(DataError, match="holds no ADS-B"):
        from_recording(recording(), "adsb")
    with pytest.raises(DataError, match="holds no system tracks"):
        from_recording(recording(), "system tracks")
    with pytest.raises(UsageError, match="did you mean"):
        from_recording(recording(), "adbs")


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_tables_are_read_in_their_own_names_and_units(tmp_path, suffix):
    ours = ONE.reports(on_ground=True, mode_a="0123")
    theirs = ours.select(
        (pl.col("time_s") * 1e3).alias("ms"),
        (pl.col("height_m") / 0.3048).alias("height_ft"),
        *("latitude_deg", "longitude_deg", "mode_a", "on_ground", "address"),
    )
    path = tmp_path / f"gps.{suffix}"
    (theirs.write_csv if suffix == "csv" else theirs.write_parquet)(path)
    found = from_file(path, columns={"time_ms": "ms"})
    assert found.kind == "table"
    for name in ("time_s", "height_m", "latitude_deg"):
        assert np.abs(found.table[name] - ours[name]).max() < 1e-9
    assert found.table["mode_a"].unique().to_list() == ["0123"]
    assert found.table["on_ground"].all()
    assert np.isnan(found.table["pressure_altitude_m"].to_numpy()).all()


def test_a_table_of_nobody_is_of_one_target(tmp_path):
    path = tmp_path / "gps.parquet"
    ONE.reports().drop("address").write_parquet(path)
    table = from_file(path).table
    assert table["name"].unique().to_list() == ["the target"]
    assert table["target"].unique().to_list() == [0]


def test_rows_without_a_position_are_counted(tmp_path):
    path = tmp_path / "gps.csv"
    row = pl.int_range(pl.len())
    place = where(row.is_between(3, 9), None, pl.col("longitude_deg"))
    ONE.reports().with_columns(longitude_deg=place).write_csv(path)
    assert from_file(path).refused == {"no position": 7}


def test_a_file_that_is_not_there_is_missing_input(tmp_path):
    with pytest.raises(MissingInputError):
        from_file(tmp_path / "none.ast")
