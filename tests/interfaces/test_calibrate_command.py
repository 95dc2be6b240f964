"""`boresight calibrate`, `track --calibration` and their verbs, on the recording in the package."""

import json
from dataclasses import replace
from importlib.resources import as_file, files

import numpy as np
import polars as pl
import pytest
from shell import boresight

import boresight as bs
from boresight.errors import DataError, MissingInputError, UsageError

SIX = {
    "range_bias_m",
    "range_gain_m_per_km",
    "azimuth_bias_deg",
    "azimuth_cos_deg",
    "azimuth_sin_deg",
    "time_bias_s",
}


@pytest.fixture(scope="module")
def demo():
    with as_file(files("boresight") / "demo" / "recording.ast") as path:
        yield path


@pytest.fixture(scope="module")
def folder(demo, tmp_path_factory):
    """What the command wrote, and the object it printed."""
    folder = tmp_path_factory.mktemp("calibrated")
    done = boresight("calibrate", demo, "--reference", "adsb", "--json", "-o", folder)
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_the_answer_has_what_its_contract_says(folder):
    where, said = folder
    assert {"pairs", "targets", "terms", "noise", "air_gain_m_per_km", "remarks"} <= set(said)
    assert set(said["terms"]) == SIX
    for term in said["terms"].values():
        assert {"estimate", "sd", "ci95", "observable"} <= set(term)
        assert term["ci95"][0] < term["estimate"] < term["ci95"][1]
    noise = {"range_m", "azimuth_deg", "target_range_m", "outlier_share"}
    assert noise <= set(said["noise"])
    names = {"report.html", "calibration.toml", "residuals.parquet"}
    assert {path.name for path in where.iterdir()} == names
    assert set(said["outputs"]) == {str(where / name) for name in names}
    assert pl.read_parquet(where / "residuals.parquet").height == said["pairs"]


def test_terms_that_were_not_asked_for_are_there_and_say_so(demo):
    done = boresight(
        "calibrate", demo, "--reference", "adsb", "--terms", "range,azimuth,time", "--json"
    )
    terms = json.loads(done.stdout)["terms"]
    nothing = {"estimate": None, "sd": None, "ci95": None, "observable": False}
    assert set(terms) == SIX
    assert terms["range_gain_m_per_km"] == nothing
    assert terms["range_bias_m"]["observable"]


def test_the_file_gives_back_what_was_found(folder):
    where, said = folder
    found = bs.read_calibration(where / "calibration.toml")
    assert set(found.errors.terms) == SIX
    for name, term in said["terms"].items():
        assert found.terms[name].estimate == term["estimate"]
        assert found.errors.value(name) == term["estimate"]
    np.testing.assert_array_equal(found.errors.cov, np.array(said["covariance"]["rows"]))
    again = bs.write_calibration(found, where.parent / "again.toml")
    assert again.read_text() == (where / "calibration.toml").read_text()


@pytest.mark.parametrize(
    ("before", "after", "why"),
    [
        ('format = "boresight calibration"', 'format = "other"', "does not say format"),
        ("version = 1", "version = 9", "version is 9"),
        ("[terms.range_bias_m]", "[terms.range_bais_m]", "range_bias_m"),
        ("estimate = ", "estimate = nan #", "estimate"),
        ("[noise]", "[noise", "line"),
        ("rows = [", "rows = [[1.0], ", "covariance"),
    ],
)
def test_a_file_that_is_no_calibration_says_why(folder, tmp_path, before, after, why):
    text = (folder[0] / "calibration.toml").read_text()
    assert before in text
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(text.replace(before, after, 1))
    with pytest.raises(DataError, match=why):
        bs.read_calibration(wrong)


def test_a_calibration_that_is_not_there_names_the_command_that_makes_one(demo, tmp_path):
    with pytest.raises(MissingInputError, match="cannot be read"):
        bs.read_calibration(tmp_path / "none.toml")
    done = boresight("track", demo, "--calibration", tmp_path / "none.toml")
    assert done.returncode == 66
    assert "boresight calibrate" in done.stderr


def test_tracking_with_it_uses_its_noise_its_terms_and_its_air(demo, folder):
    toml = folder[0] / "calibration.toml"
    done = boresight("track", demo, "--calibration", toml, "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    noise = folder[1]["noise"]
    assert said["settings"]["noise"]["range_m"] == noise["range_m"]
    assert said["settings"]["noise"]["azimuth_deg"] == noise["azimuth_deg"]
    plain = json.loads(boresight("track", demo, "--json").stdout)
    assert plain["settings"]["noise"] != said["settings"]["noise"]
    refused = boresight("track", demo, "--calibration", toml, "--atmosphere", "exponential")
    assert refused.returncode == 2
    assert "the calibration was made with the atmosphere none" in refused.stderr


def test_the_verbs_say_what_the_command_says(demo, folder):
    plots = bs.read(demo)
    found = bs.calibrate(plots, reference="adsb", site=None)
    for name, term in folder[1]["terms"].items():
        assert found.terms[name].estimate == term["estimate"]
    tracks = bs.track(plots, calibration=found)
    assert tracks.settings["noise"]["range_m"] == found.noise.range_m
    assert "Calibration" in bs.report(tracks, found).html
    assert bs.report(found).html.startswith("<!DOCTYPE html>")


def test_a_copy_of_the_frame_does_not_know_its_recording(demo):
    plots = bs.read(demo)
    with pytest.raises(UsageError, match="holds no reference 'adsb'"):
        bs.calibrate(plots.filter(pl.col("range_m") > 0), reference="adsb", site=(47.8, 1.4, 180))


def test_an_estimate_of_another_sensor_is_remarked_on(demo):
    plots = bs.read(demo)
    found = bs.calibrate(plots, reference="adsb")
    other = bs.track(plots, calibration=replace(found, sensor="1/2"))
    assert any("calibration is of sensor 1/2" in remark for remark in other.remarks)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("--reference", "system-tracks"), 65, "holds no system tracks"),
        (("--reference", "nowhere.ast"), 66, "nowhere.ast"),
        (("--reference", "downlink", "--terms", "azimuth"), 2, "downlink"),
        (("--reference", "adsb", "--terms", "azimut"), 2, "did you mean 'azimuth'"),
        (("--reference", "adsb", "--terms", "range,range_bias_m"), 2, "twice"),
        (("--reference", "adsb", "--terms", "elevation"), 65, "elevation"),
        (("--reference", "adsb", "--gate", "-5"), 2, "gate"),
        ((), 2, "--reference"),
    ],
)
def test_what_cannot_be_done_is_one_error(demo, arguments, code, words):
    done = boresight("calibrate", demo, *arguments)
    assert done.returncode == code, done.stderr
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not done.stdout
