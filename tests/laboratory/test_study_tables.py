"""Truth and plots as tables: what `simulate` gives, and what the other commands make of them."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import boresight as bs
from boresight.errors import OutputError
from boresight.experiments.simulate import simulate
from boresight.laboratory import tables
from boresight.laboratory.study_file import study_from
from boresight.laboratory.tables import study_tables

SITE = (47.0, 8.0, 400.0)
RADAR = {
    "scenario": {
        "kind": "waypoints",
        "points": [["40 km", "-30 km", "3 km"], ["40 km", "40 km", "3 km"]],
        "speed": "200 m/s",
        "site": ["47 deg", "8 deg", "400 m"],
    },
    "sensor": {
        "period": "4 s",
        "range": {"sigma": "50 m"},
        "azimuth": {"sigma": "0.1 deg"},
        "elevation": {"sigma": "0.2 deg"},
        "detection": "90 %",
    },
    "seed": 3,
    "filter": "ekf",
}
SONAR = {
    "scenario": {
        "kind": "waypoints",
        "points": [["6 km", "0 km"], ["6 km", "-9 km"]],
        "speed": "8 kn",
        "scans": 180,
    },
    "sensor": {
        "period": "10 s",
        "azimuth": {"sigma": "0.5 deg"},
        "carrier": {
            "points": [["0 km", "0 km"], ["-3 km", "3 km"], ["1 km", "6 km"], ["-3 km", "10 km"]],
            "speed": "12 kn",
            "lateral_accel": "0.05 m/s^2",
        },
    },
    "start": {"kind": "on bearing", "range": "10 km", "range_sd": "4 km"},
    "seed": 5,
    "filter": "ekf",
}


def written(study, folder):
    """The tables by name and ending."""
    return {path.relative_to(folder).as_posix(): path for path in study_tables(study, folder)}


def test_tables_hold_what_simulate_gives(tmp_path):
    study = study_from(RADAR, runs=3)
    files = written(study, tmp_path)
    assert sorted(files) == ["plots.csv", "plots.parquet", "truth.csv", "truth.parquet"]
    scenario = study.settings[0].scenario
    truth, plots = simulate(scenario, runs=3, seed=3, whole=True)
    table = pl.read_parquet(files["truth.parquet"])
    assert table["x_m"].to_numpy() == pytest.approx(truth.states[..., 0].ravel())
    assert table["vy_mps"].to_numpy() == pytest.approx(truth.states[..., 4].ravel())
    seen = ~np.isnan(plots.z[..., 0])
    assert 0 < (~seen).sum() < seen.size / 2
    table = pl.read_parquet(files["plots.parquet"])
    assert table["range_m"].to_numpy() == pytest.approx(plots.z[seen][:, 0])
    assert np.radians(table["elevation_deg"].to_numpy()) == pytest.approx(plots.z[seen][:, 2])
    assert table["azimuth_deg"].is_between(0, 360).all()
    wound = np.radians(table["azimuth_deg"].to_numpy()) - plots.z[seen][:, 1]
    assert np.exp(1j * wound) == pytest.approx(np.ones(len(wound)))
    assert table["run"].to_list() == np.nonzero(seen)[0].tolist()
    assert table["time_s"].to_list() == truth.time_s[np.nonzero(seen)[1]].tolist()
    assert table.group_by("run").agg(pl.col("address").first()).sort("run")[
        "address"
    ].to_list() == [
        "000001",
        "000002",
        "000003",
    ]


def test_tables_do_not_depend_on_how_many_rows_fit(tmp_path, monkeypatch):
    study = study_from(RADAR, runs=5)
    whole = written(study, tmp_path / "whole")
    monkeypatch.setattr(tables, "_ROWS", 200)
    parts = written(study, tmp_path / "parts")
    monkeypatch.setattr(tables, "_SMALL", 0)
    streamed = written(study, tmp_path / "streamed")
    assert sorted(streamed) == ["plots.parquet", "truth.parquet"]
    for name in streamed:
        expected = pl.read_parquet(whole[name])
        assert pl.read_parquet(parts[name]).equals(expected)
        assert pl.read_parquet(streamed[name]).equals(expected)
    assert pl.read_parquet_metadata(streamed["plots.parquet"])["table"] == "plots"


def test_shared_truth_is_shared(tmp_path):
    files = written(study_from(RADAR | {"split": {"noise": "one"}}, runs=2), tmp_path)
    table = pl.read_parquet(files["plots.parquet"])
    first, second = (table.filter(pl.col("run") == run)["range_m"].to_list() for run in (0, 1))
    assert first == second


def test_false_plots_have_no_address_and_the_targets_own_has(tmp_path):
    sensor = RADAR["sensor"] | {"false_plots": 3, "coverage": "90 km"}
    study = study_from(RADAR | {"sensor": sensor, "filter": [{"name": "ekf", "gate": 16}]}, runs=4)
    table = pl.read_parquet(written(study, tmp_path)["plots.parquet"])
    scans = 4 * study.settings[0].scenario.scans
    own, false = table.drop_nulls("address"), table.filter(pl.col("address").is_null())
    # Poisson with mean 3: 4.9 standard deviations of the mean, false alarm 1e-6.
    assert false.height / scans == pytest.approx(3.0, abs=4.9 * (3.0 / scans) ** 0.5)
    assert own.height <= scans
    assert own.group_by("run", "time_s").len()["len"].max() == 1


def test_each_world_of_a_sweep_has_a_folder_and_filters_share_it(tmp_path):
    sweep = {"sensor.azimuth.sigma": ["0.1 deg", "1 deg"], "filter.gate": [9, 16]}
    files = written(study_from(RADAR | {"sweep": sweep}, runs=1), tmp_path)
    folders = {name.partition("/")[0] for name in files}
    assert folders == {"01-sensor.azimuth.sigma=0.1-deg", "02-sensor.azimuth.sigma=1-deg"}


def test_track_reads_a_radars_plots_and_finds_the_truth(tmp_path):
    files = written(study_from(RADAR, runs=1), tmp_path)
    for end in ("csv", "parquet"):
        plots = bs.read(files[f"plots.{end}"])
        tracks = bs.track(plots, site=SITE).tracks
        assert tracks["track"].n_unique() == 1
    truth = pl.read_parquet(files["truth.parquet"])
    both = tracks.join(truth, on="time_s")
    off = np.hypot(both["north_m"] - both["x_m"], both["east_m"] - both["y_m"])
    # The plane takes slant for ground range (112 m at 40 km); noise across is 70 to 90 m.
    assert np.median(off) < 250
    assert np.array(truth["height_m"])[0] > 3400.0


def test_calibrate_finds_the_bias_against_the_truth(tmp_path):
    sensor = RADAR["sensor"] | {
        "range": {"sigma": "20 m", "bias": "150 m"},
        "azimuth": {"sigma": "0.05 deg", "bias": "0.4 deg"},
    }
    points = [["40 km", "-30 km", "3 km"], ["40 km", "40 km", "3 km"], ["-30 km", "40 km", "3 km"]]
    scenario = RADAR["scenario"] | {"points": points}
    study = study_from(RADAR | {"sensor": sensor, "scenario": scenario}, runs=1)
    files = written(study, tmp_path)
    found = bs.calibrate(bs.read(files["plots.csv"]), reference=files["truth.csv"], site=SITE)
    terms = found.terms
    assert terms["azimuth_bias_deg"].estimate == pytest.approx(0.4, abs=0.05)


def test_tma_reads_bearings_and_own_ship_and_finds_the_contact(tmp_path):
    files = written(study_from(SONAR, runs=1), tmp_path)
    assert {"bearings.csv", "own-ship.csv", "truth.csv"} <= files.keys()
    (contact,) = bs.tma(files["bearings.csv"], files["own-ship.csv"]).contacts
    truth = pl.read_parquet(files["truth.parquet"]).row(-1, named=True)
    ship = pl.read_parquet(files["own-ship.parquet"]).row(-1, named=True)
    distance = np.hypot(truth["x_m"] - ship["north_m"], truth["y_m"] - ship["east_m"])
    # Four standard deviations, false alarm 6e-5 each.
    assert abs(contact.range_m.estimate - distance) < 4 * contact.range_m.sd
    assert abs(contact.course_deg.estimate - 270.0) < 4 * contact.course_deg.sd


def test_an_arrays_angles_are_conical_and_come_with_its_axis(tmp_path):
    sensor = {("cone" if k == "azimuth" else k): v for k, v in SONAR["sensor"].items()}
    files = written(study_from(SONAR | {"sensor": sensor}, runs=2), tmp_path)
    bearings = pl.read_parquet(files["bearings.parquet"])
    assert bearings["conical"].all()
    assert bearings["bearing_deg"].is_between(0, 180).all()
    assert bearings["track"].n_unique() == 2
    ship = pl.read_parquet(files["own-ship.parquet"])
    course = np.degrees(np.arctan2(np.diff(ship["east_m"])[:9], np.diff(ship["north_m"])[:9]))
    assert ship["axis_deg"].to_numpy()[:9] == pytest.approx(course % 360)


def test_ranges_of_a_scenario_in_kilometres_are_written_in_metres(tmp_path):
    study = study_from({"scenario": "aditya", "filter": "mekf-block"}, runs=1)
    study = replace(study, settings=study.settings[:1])
    files = written(study, tmp_path)
    _, plots = simulate("aditya", runs=1, seed=0, whole=True)
    table = pl.read_parquet(files["plots.parquet"])
    assert table["range_m"][0] == pytest.approx(1000.0 * plots.z[0, 0, 0])


def test_progress_ends_with_all_runs_and_a_bad_folder_is_told(tmp_path):
    told = []
    study_tables(study_from(RADAR, runs=2), tmp_path, progress=lambda *each: told.append(each))
    assert told[-1] == (2.0, 2.0)
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        study_tables(study_from(RADAR, runs=2), tmp_path / "file")


@pytest.mark.parametrize("rows", [10, 10**6])
def test_a_full_disk_is_told(tmp_path, monkeypatch, rows):
    """Polars words it as a computation that failed."""

    def full(*_, **__):
        raise pl.exceptions.ComputeError("underlying IO error: No space left (os error 28)")

    monkeypatch.setattr("boresight.laboratory.tables._SMALL", rows)
    monkeypatch.setattr(pl.DataFrame, "write_parquet", full)
    monkeypatch.setattr(pl.LazyFrame, "sink_parquet", full)
    with pytest.raises(OutputError, match="No space left"):
        study_tables(study_from(RADAR, runs=2), tmp_path)
