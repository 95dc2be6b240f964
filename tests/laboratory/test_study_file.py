"""Studies that can be run: what each setting of the file becomes, sweeps, and the examples."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from boresight.errors import DataError, MissingInputError, UsageError
from boresight.experiments.scenario import lookup
from boresight.laboratory.mistakes import StudyError
from boresight.laboratory.study_file import read_study, study_from
from boresight.models.motion import ConstantAcceleration, ConstantVelocity

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "studies").glob("*.toml"))
RADAR = {
    "period": "4 s",
    "range": {"sigma": "50 m"},
    "azimuth": {"sigma": "0.1 deg"},
    "elevation": {"sigma": "0.2 deg"},
}
LEGS = {
    "kind": "waypoints",
    "points": [["20 km", "-30 km", "3 km"], ["20 km", "40 km", "3 km"]],
    "speed": "200 m/s",
}
OWN = {"scenario": LEGS, "sensor": RADAR, "filter": ["ekf", "ukf"]}


def only(study):
    """The one setting of a study."""
    (setting,) = study.settings
    return setting


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_is_a_study(path):
    assert read_study(path).cells


def test_there_are_examples_of_every_kind_of_world():
    kinds = {line for path in EXAMPLES for line in path.read_text().splitlines()}
    assert {f'kind = "{each}"' for each in ("waypoints", "recorded", "random")} <= kinds


def test_the_smallest_study_keeps_all_that_is_the_papers(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text('scenario = "kashyap-set-2"\nfilter = ["ekf", "mekf"]\n')
    study, paper = read_study(path), lookup("kashyap-set-2")
    setting = only(study)
    assert study.name == "small"
    assert (study.runs, study.seed, study.truth, study.noise) == (1000, 0, "each", "each")
    assert setting.scenario.sensor == paper.sensor
    assert setting.scenario.motion == paper.motion
    assert [each.label for each in setting.contenders] == ["ekf", "mekf"]
    assert all(each.sensor == paper.sensor for each in setting.contenders)


def test_of_a_papers_sensor_only_what_is_given_changes():
    study = study_from(
        {
            "scenario": "kashyap-set-2",
            "sensor": {"azimuth": {"sigma": "0.5 deg", "bias": "1 deg"}, "detection": "80 %"},
            "filter": "ekf",
        }
    )
    scenario, paper = only(study).scenario, lookup("kashyap-set-2")
    assert scenario.sensor.azimuth_deg == 0.5
    assert scenario.sensor.range_m == paper.sensor.range_m
    assert scenario.bias == {"azimuth_rad": pytest.approx(np.pi / 180)}
    assert scenario.detection == 0.8


def test_lengths_of_a_scenario_in_kilometres_are_kilometres():
    given = {"scenario": "aditya", "sensor": {"range": {"sigma": "30 m"}}, "filter": "mekf-block"}
    assert only(study_from(given)).scenario.sensor.range_m == pytest.approx(0.03, rel=1e-15)


def test_a_world_of_waypoints_is_what_the_file_says():
    sensor = RADAR | {
        "range_rate": {"sigma": "2 m/s", "correlation": -0.5},
        "position": ["1 km", "2 km", "10 m"],
        "heading": "90 deg",
        "detection": 0.9,
        "false_plots": 2,
        "coverage": "100 km",
    }
    gated = {"name": "ekf", "gate": 16, "motion": {"accel": "2 m/s^2"}, "noise_scale": 4.0}
    study = study_from(OWN | {"sensor": sensor, "filter": [gated]})
    scenario, (contender,) = only(study).scenario, only(study).contenders
    assert scenario.path[0] == pytest.approx([20e3, -30e3, 3e3, 0.0, 200.0, 0.0], abs=1e-9)
    assert scenario.scans == 88  # 70 km at 200 m/s take 350 s: scans at 0, 4, ..., 348
    assert (scenario.dt_s, scenario.detection, scenario.false_plots) == (4.0, 0.9, 2.0)
    assert scenario.coverage_m == 100e3
    radar = scenario.sensor
    assert (radar.range_rate_mps, radar.range_rate_correlation) == (2.0, -0.5)
    assert radar.pose.position_m.tolist() == [1e3, 2e3, 10.0]
    east = radar.relative(np.array([1e3, 7e3, 10.0, 0, 0, 0]), 3)[0]  # a target east is ahead
    assert east == pytest.approx([5e3, 0.0, 0.0])
    assert contender.gate == 16
    assert contender.motion == ConstantVelocity(accel_mps2=2.0)
    assert contender.sensor.range_m == 100.0  # four times the variance
    assert contender.sensor.range_rate_correlation == -0.5


def test_a_filter_may_believe_another_motion():
    other = {"kind": "constant-acceleration", "jerk": "0.5 m/s^3"}
    study = study_from(OWN | {"filter": [{"name": "ekf", "motion": other}]})
    assert only(study).contenders[0].motion == ConstantAcceleration(jerk_mps3=0.5)


def test_settings_that_are_the_filters_own_reach_it():
    study = study_from(OWN | {"filter": [{"name": "iekf", "label": "three", "iterations": 3}]})
    (contender,) = only(study).contenders
    assert contender.label == "three"
    assert dict(contender.filter.settings)["iterations"] == 3


def test_the_rest_of_the_file_reaches_the_study():
    study = study_from(
        OWN
        | {
            "name": "all",
            "runs": 7,
            "seed": 2**64 - 1,
            "metrics": ["nees", "gospa", "nees"],
            "first_scan": 3,
            "false_alarm": "5 %",
            "split": {"truth": "one"},
            "limits": {"cutoff": "2 km", "order": 1, "lost": "3 NM", "converged": "500 m"},
        }
    )
    assert (study.name, study.runs, study.seed) == ("all", 7, 2**64 - 1)
    assert study.metrics == ("nees", "gospa")
    assert (study.first_scan, study.false_alarm) == (3, 0.05)
    assert (study.truth, study.noise) == ("one", "each")
    assert (study.limits.cutoff_m, study.limits.order) == (2000.0, 1.0)
    assert (study.limits.lost_m, study.limits.converged_m) == (5556.0, 500.0)


def test_a_sweep_is_all_combinations_in_the_order_of_the_file():
    sweep = {"sensor.azimuth.sigma": ["0.5 deg", "2 deg"], "filter.ukf.alpha": [0.5, 1.0, 2.0]}
    study = study_from(OWN | {"sweep": sweep})
    assert len(study.cells) == 12
    values = [dict(each.values) for each in study.settings]
    assert values[1] == {"sensor.azimuth.sigma": "0.5 deg", "filter.ukf.alpha": "1.0"}
    assert [each.scenario.sensor.azimuth_deg for each in study.settings] == [0.5] * 3 + [2.0] * 3
    ekf, ukf = study.settings[5].contenders
    assert dict(ukf.filter.settings)["alpha"] == 2.0
    assert "alpha" not in dict(ekf.filter.settings)
    assert len({each.scenario.name for each in study.settings}) == 1  # common random numbers


def test_a_sweep_of_filters_is_of_all_that_know_it():
    study = study_from(OWN | {"sweep": {"filter.motion.accel": ["1 m/s^2"], "filter.alpha": [0.3]}})
    ekf, ukf = only(study).contenders
    assert ekf.motion == ukf.motion == ConstantVelocity(accel_mps2=1.0)
    assert dict(ukf.filter.settings)["alpha"] == 0.3


def test_a_scenario_may_be_swept():
    names = ["kashyap-set-1", "kashyap-set-2"]
    study = study_from({"scenario": names[0], "filter": "ekf", "sweep": {"scenario": names}})
    assert [each.scenario.name for each in study.settings] == names


def test_a_swept_key_may_be_dotted_or_quoted(tmp_path):
    text = 'scenario = "kashyap-set-2"\nfilter = "ekf"\n[sweep]\n{} = ["1 deg", "2 deg"]\n'
    found = []
    for key in ("sensor.azimuth.sigma", '"sensor.azimuth.sigma"', 'sensor."azimuth.sigma"'):
        (tmp_path / "s.toml").write_text(text.format(key))
        found.append([each.values for each in read_study(tmp_path / "s.toml").settings])
    assert found[0] == found[1] == found[2]


def test_a_sensor_that_is_carried_goes_with_its_ship():
    sensor = {
        "period": "10 s",
        "azimuth": {"sigma": "1 deg"},
        "carrier": {"points": [["0 m", "0 m"], ["0 m", "2 km"]], "speed": "5 m/s"},
    }
    legs = {"kind": "waypoints", "points": [["6 km", "0 km"], ["6 km", "9 km"]], "speed": "8 kn"}
    start = {"kind": "on bearing", "range": "8 km", "range_sd": "2 km", "speed_sd": "6 m/s"}
    given = {"scenario": legs | {"scans": 20}, "sensor": sensor, "start": start, "filter": "ekf"}
    scenario = only(study_from(given)).scenario
    pose = scenario.sensor.pose
    assert pose.position_m.shape == (1, 20, 3)
    assert pose.position_m[0, 4] == pytest.approx([0.0, 200.0, 0.0], abs=1e-9)
    assert pose.velocity_mps[0, 4] == pytest.approx([0.0, 5.0, 0.0], abs=1e-12)
    assert (scenario.begin, scenario.range_m, scenario.range_sd_m) == ("on bearing", 8e3, 2e3)
    cone = {"cone": sensor["azimuth"], **{k: sensor[k] for k in ("period", "carrier")}}
    heard = only(study_from(given | {"sensor": cone})).scenario.sensor
    ahead = np.asarray(heard.pose.rotation)[0, 4, 0]
    assert ahead == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)  # the array lies along the course


def test_a_start_from_two_plots_is_scored_from_the_second_on():
    """At the first there is no track yet: what a filter says there is of 4 s later."""
    begun = OWN | {"start": {"kind": "two plots"}}
    study = study_from(begun)
    assert study.first_scan == 1
    assert study_from(OWN | {"start": {"kind": "one plot"}}).first_scan == 0
    assert study_from(begun | {"first_scan": 5}).first_scan == 5
    swept = OWN | {"sweep": {"start.kind": ["one plot", "two plots"]}}
    assert study_from(swept).first_scan == 1
    with pytest.raises(UsageError, match="first_scan = 1"):
        replace(study, first_scan=0)


def test_a_recorded_table_may_call_its_columns_otherwise(tmp_path):
    flight = EXAMPLES[0].parent / "flight.csv"
    named = {"time_s": "ts", "latitude_deg": "lat", "longitude_deg": "lon", "height_m": "alt"}
    head, rest = flight.read_text().split("\n", 1)
    for ours, theirs in named.items():
        head = head.replace(ours, theirs)
    (tmp_path / "flight.csv").write_text(f"{head}\n{rest}")
    world = {"kind": "recorded", "site": ["47.45 deg", "8.55 deg", "430 m"]}
    ours, theirs = (
        only(study_from(OWN | {"scenario": world | of_table})).scenario.path
        for of_table in (
            {"file": str(flight)},
            {"file": str(tmp_path / "flight.csv"), "columns": named},
        )
    )
    assert np.array_equal(ours, theirs)


def test_runs_and_seed_may_be_given_beside_the_file():
    study = study_from(OWN, runs=5, seed=9)
    assert (study.runs, study.seed) == (5, 9)
    with pytest.raises(UsageError, match="runs"):
        study_from(OWN, runs=0)
    with pytest.raises(UsageError, match="seed"):
        study_from(OWN, seed=-1)


@pytest.mark.parametrize("mark", ["\ufeff", ""], ids=["mark", "plain"])
@pytest.mark.parametrize("end", ["\n", "\r\n"], ids=["lf", "crlf"])
def test_the_marks_of_another_system_change_nothing(tmp_path, mark, end):
    lines = ["# größe", 'scenario = "kashyap-set-2"', 'filter = ["ekf"]', "runs = 0"]
    path = tmp_path / "s.toml"
    path.write_bytes((mark + end.join(lines)).encode())
    with pytest.raises(StudyError, match=r"s\.toml:4:8: runs = 0 must be at least 1"):
        read_study(path)
    path.write_bytes((mark + end.join(lines[:-1])).encode())
    assert read_study(path).cells


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "is empty"),
        (b"\x30\x00\x30\xff\xf6\x17" * 99, "no text"),
        ("a = 1\n".encode("utf-16"), "UTF-16"),
        (b'name = "gr\xf6\xdfe"\n', "not UTF-8"),
        (b"runs = \n", "not TOML"),
        (b"runs = 1\nruns = 2\n", "not TOML"),
        (b"[a]\n[a]\n", "not TOML"),
        (b"just words\n", "not TOML"),
        (b"a = " + b"[" * 100_000, "no study|not TOML"),
        (b"seed = " + b"9" * 5_000, "not TOML"),
        (b"# " + b"x" * 1_000_001, "no text"),
    ],
)
def test_what_is_no_toml_is_bad_data(tmp_path, content, what):
    path = tmp_path / "s.toml"
    path.write_bytes(content)
    with pytest.raises(DataError, match=what) as found:
        read_study(path)
    assert found.value.exit_code == 65


def test_where_toml_breaks_is_told(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text('name = "x"\nruns = ten\n')
    with pytest.raises(DataError) as found:
        read_study(path)
    assert found.value.where == "line 2, column 8: runs = ten"


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(MissingInputError):
        read_study(tmp_path / "none.toml")
