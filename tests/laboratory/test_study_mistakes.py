"""A study file with mistakes: all at once, each with its line, a caret and the nearest name."""

import json
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

import boresight as bs
from boresight.errors import DataError
from boresight.interfaces.terminal import Manner, complain
from boresight.laboratory.mistakes import StudyError
from boresight.laboratory.study_file import read_study, study_from

TWELVE = """\
runs = 0
seeds = 7
metrics = ["rmse", "neees"]
[scenario]
kind = "recorded"
file = "flight.csv"
site = ["51 deg", "1 deg", "20 m"]
[sensor]
period = 4
range.sigma = "30 deg"
azimuth.sgima = "0.1 deg"
elevation.sigma = "0.5 furlong"
detection = "130 %"
[[filter]]
name = "eckf"
[[filter]]
name = "mekf"
mmu = true
[[filter]]
name = "mekf"
[sweep]
"sensor.azimut.sigma" = ["1 deg", "2 deg"]
"""
# Of each mistake: line, column, what is said of it, the hint. One for each kind.
EXPECTED = [
    (1, 8, "runs = 0 must be at least 1", ""),
    (2, 1, "seeds is not a setting", "did you mean 'seed'?"),
    (3, 20, 'metrics[1] = "neees" is unknown', "did you mean 'nees'?"),
    (6, 8, "there is no file", "list what is there"),
    (9, 10, "sensor.period = 4 has no unit", 'such as "4 s"'),
    (10, 15, 'sensor.range.sigma = "30 deg" is an angle, not a length', "m, km, ft"),
    (11, 9, "sensor.azimuth.sgima is not a setting", "did you mean 'sigma'?"),
    (12, 19, 'elevation.sigma = "0.5 furlong" has a unit that is not known', "deg, rad"),
    (13, 13, 'sensor.detection = "130 %" must be at most 1', ""),
    (15, 8, "there is no filter 'eckf'", "did you mean 'ekf'?"),
    (18, 1, "filter[1].mmu is not a setting of mekf", "did you mean 'mu'?"),
    (20, 8, "two filters are called 'mekf'", "label"),
    (22, 1, "sensor.azimut is not a setting", "did you mean 'azimuth'?"),
]


def mistakes_of(given, tmp_path=None):
    """The mistakes of a text, or of a mapping."""
    if isinstance(given, dict):
        with pytest.raises(StudyError) as found:
            study_from(given)
        return found.value
    path = tmp_path / "study.toml"
    path.write_text(given)
    with pytest.raises(StudyError) as found:
        read_study(path)
    return found.value


def test_more_than_twelve_mistakes_are_told_at_once(tmp_path):
    error = mistakes_of(TWELVE, tmp_path)
    assert error.exit_code == 2
    told = error.details["mistakes"]
    assert [(each["line"], each["column"]) for each in told] == [each[:2] for each in EXPECTED]
    for each, (_, _, what, hint) in zip(told, EXPECTED, strict=True):
        assert what in each["what"]
        assert hint in each["hint"]
    lines = str(error).splitlines()
    assert lines[0] == "study.toml has 13 mistakes"
    at = lines.index("study.toml:11:9: sensor.azimuth.sgima is not a setting")
    assert lines[at + 1 : at + 3] == [
        '  11 | azimuth.sgima = "0.1 deg"',
        "     |         ^^^^^ did you mean 'sigma'?",
    ]


def test_as_json_every_mistake_is_an_object(tmp_path, capsys):
    complain(mistakes_of(TWELVE, tmp_path), Manner(as_json=True))
    error = json.loads(capsys.readouterr().out)["error"]
    assert error["exit_code"] == 2
    assert len(error["mistakes"]) == len(EXPECTED)
    assert error["mistakes"][1] == {
        "line": 2,
        "column": 1,
        "setting": "seeds",
        "what": "seeds is not a setting",
        "hint": "did you mean 'seed'?",
    }


def test_mistakes_cross_a_process_boundary(tmp_path):
    error = mistakes_of(TWELVE, tmp_path)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)  # noqa: S301 - our own bytes


GOOD = {
    "scenario": {
        "kind": "waypoints",
        "points": [["20 km", "-30 km", "3 km"], ["20 km", "40 km", "3 km"]],
        "speed": "200 m/s",
    },
    "sensor": {
        "period": "4 s",
        "range": {"sigma": "50 m"},
        "azimuth": {"sigma": "0.1 deg"},
        "elevation": {"sigma": "0.2 deg"},
    },
    "filter": [{"name": "ekf"}],
}
RANDOM = {"kind": "random", "range": ["1 km", "9 km"], "speed": "90 m/s", "scans": 9}


@pytest.mark.parametrize(
    ("changed", "setting", "what", "hint"),
    [
        ({"scenario": "kashyap-set-22"}, "scenario.name", "no scenario", "kashyap-set-2"),
        ({"scenario": {"kind": "waypoint"}}, "scenario.kind", "no kind", "waypoints"),
        ({"scenario": {"kind": 3}}, "scenario.kind", "no kind", "waypoints"),
        ({"scenario": 3}, "scenario", "is not a table", ""),
        ({"scenario": {}}, "scenario", "lacks name", "name"),
        ({"scenario": GOOD["scenario"] | {"speed": "0 m/s"}}, "scenario.speed", "above 0", ""),
        ({"scenario": GOOD["scenario"] | {"scans": 900}}, "scenario", "scans", "fewer"),
        ({"scenario": GOOD["scenario"] | {"points": [["1 km"]]}}, "scenario.points[0]", "", "2"),
        (
            {"scenario": RANDOM | {"range": ["9 km", "1 km"]}},
            "scenario.range",
            "not a spread",
            "lower",
        ),
        ({"scenario": GOOD["scenario"] | {"site": ["1 deg"]}}, "scenario.site", "too few", ""),
        ({"scenario": GOOD["scenario"] | {"speed": []}}, "scenario.speed", "has 0 values", "1"),
        ({"metrics": []}, "metrics", "has 0 values", "1"),
        ({"scenario": RANDOM | {"range": "9 km"}}, "scenario", "one distance", "80 km"),
        ({"scenario": RANDOM | {"north": "9 km"}}, "scenario", "where targets start", "north"),
        ({"scenario": RANDOM | {"speed": {"mean": "1 m/s"}}}, "scenario.speed", "spread", "sd"),
        ({"sensor": GOOD["sensor"] | {"azimuth": 3}}, "sensor.azimuth", "is not a table", ""),
        (
            {"sensor": GOOD["sensor"] | {"cone": {"bias": "1 deg"}}},
            "sensor.cone",
            "lacks sigma",
            "",
        ),
        ({"sensor": {"period": "1 s", "range": {"sigma": "1 m"}}}, "sensor", "azimuth", "start"),
        (
            {"sensor": {k: v for k, v in GOOD["sensor"].items() if k != "period"}},
            "sensor",
            "lacks period",
            "4 s",
        ),
        ({"sensor": GOOD["sensor"] | {"period": "0 s"}}, "sensor.period", "above 0", ""),
        (
            {"sensor": GOOD["sensor"] | {"false_plots": 2, "coverage": "90 km"}},
            "filter[0].gate",
            "lacks a gate",
            "gate = 16",
        ),
        (
            {
                "sensor": GOOD["sensor"] | {"false_plots": 2},
                "filter": [{"name": "ekf", "gate": 9.0}],
            },
            "sensor.false_plots",
            "lacks coverage",
            'coverage = "',
        ),
        ({"filter": [{"name": "ekf", "label": "a\nb"}]}, "filter[0].label", "no label", "line"),
        ({"filter": [{"name": "ekf", "label": "x" * 61}]}, "filter[0].label", "no label", "60"),
        (
            {"start": {"kind": "two plots"}, "first_scan": 0},
            "first_scan",
            "before the start",
            "scan 1",
        ),
        (
            {"sensor": GOOD["sensor"] | {"range_rate": {"sigma": "1 m/s", "correlation": 1.5}}},
            "sensor.range_rate.correlation",
            "below 1",
            "",
        ),
        ({"scenario": "pradeep", "sensor": {"period": "9 s"}}, "sensor.period", "its own", ""),
        ({"motion": {"accel": "-1 m/s^2"}}, "motion.accel", "at least 0", ""),
        ({"motion": {"kind": "constant-velocty"}}, "motion.kind", "unknown", "constant-velocity"),
        ({"motion": {"jerk": "1 m/s^3"}}, "motion.jerk", "not a setting", "accel"),
        (
            {"motion": {"kind": "coordinated-turn", "accel": "1 g"}},
            "motion",
            "lacks turn_accel",
            "",
        ),
        ({"motion": {"kind": "static"}}, "scenario", "velocities", "ConstantVelocity"),
        ({"filter": ["ekf", "ekf"]}, "filter[1].name", "two filters", "label"),
        ({"filter": "kf"}, "filter[0]", "linear", ""),
        ({"filter": [{"label": "x"}]}, "filter[0]", "lacks name", "name"),
        ({"filter": [3]}, "filter[0]", "is not a table", ""),
        ({"filter": []}, "", "no filter", "ekf"),
        ({"filter": [{"name": "ekf", "gate": -1.0}]}, "filter[0].gate", "above 0", ""),
        ({"filter": [{"name": "ekf", "gate": float("nan")}]}, "filter[0].gate", "", ""),
        ({"filter": [{"name": "ekf", "noise_scale": "2"}]}, "filter[0].noise_scale", "number", ""),
        ({"filter": [{"name": "iekf", "iterations": "x"}]}, "filter[0].iterations", "", "default"),
        ({"filter": "modified-polar"}, "filter[0]", "dims=3", "dims=2"),
        ({"filter": "emekf"}, "filter[0].name", "two steps", "error_model"),
        ({"seed": -1}, "seed", "at least 0", ""),
        ({"seed": 2**64}, "seed", "at most", ""),
        ({"seed": 10**400}, "seed", "", ""),
        ({"runs": 1.5}, "runs", "whole number", ""),
        ({"runs": True}, "runs", "whole number", ""),
        ({"false_alarm": "100 %"}, "false_alarm", "below 1", ""),
        ({"first_scan": 88}, "first_scan", "last of 88 scans", "earlier"),
        ({"split": {"truth": "same"}}, "split.truth", "unknown", "each"),
        ({"limits": {"cutof": "1 km"}}, "limits.cutof", "not a setting", "cutoff"),
        ({"start": {"kind": "three plots"}}, "start.kind", "unknown", "plots"),
        ({"sweep": 3}, "sweep", "not a table", ""),
        ({"sweep": {"runs": [1, 2]}}, "sweep.runs", "cannot be swept", ""),
        ({"sweep": {"sensor.range.sigma": []}}, "sweep.sensor.range.sigma", "no values", ""),
        ({"sweep": {"sensor.range.sigma": "1 m"}}, "sweep.sensor.range.sigma", "no values", ""),
        ({"sweep": {"filter.alpha": [1.0]}}, "sweep.filter.alpha", "not a setting", "gate"),
        ({"sweep": {f"filter.{n}": [1.0] * 101 for n in ("gate", "noise_scale")}}, "sweep", "", ""),
    ],
)
def test_each_mistake_is_told_where_it_is(changed, setting, what, hint):
    told = mistakes_of(GOOD | changed).details["mistakes"]
    assert [each["setting"] for each in told] == [setting]
    assert what in told[0]["what"]
    assert hint in told[0]["hint"]


def test_a_users_filter_that_fails_is_told(monkeypatch):
    from boresight import catalogue

    def broken(prior, z, components):
        raise LookupError(f"no such {type(prior)}: {len(z)}, {len(components)}")

    known = {"theirs": bs.Filter(name="theirs", formula=broken)}
    monkeypatch.setattr(catalogue, "find", known.get)
    (told,) = mistakes_of(GOOD | {"filter": "theirs"}).details["mistakes"]
    assert told["what"].startswith("theirs fails at its first step: LookupError: no such")


def test_a_wrong_swept_value_is_told_in_the_sweep(tmp_path):
    text = 'scenario = "kashyap-set-2"\nfilter = "ekf"\n[sweep]\n'
    error = mistakes_of(f'{text}"sensor.range.sigma" = ["1 m", "2 deg", "-3 m"]\n', tmp_path)
    places = [(each.line, each.column) for each in error.told]
    assert places == [(4, 32), (4, 41)]


def test_what_a_table_lacks_is_told_at_its_head(tmp_path):
    text = 'filter = "ekf"\n\n  [scenario]\nkind = "waypoints"\nspeed = "1 m/s"\n'
    (told,) = mistakes_of(text, tmp_path).details["mistakes"]
    assert (told["line"], told["column"], told["what"]) == (3, 4, "scenario lacks points")
    assert told["hint"] == 'give points = [["20 km", "-30 km"], ["20 km", "40 km"]]'


def test_what_is_missing_altogether_has_no_line(tmp_path):
    error = mistakes_of("runs = 1\n", tmp_path)
    assert [each["line"] for each in error.details["mistakes"]] == [None, None]
    assert "study.toml: the study has no scenario" in str(error)


def test_long_lines_are_cut_around_the_mistake(tmp_path):
    text = f'scenario = "kashyap-set-2" # {"x" * 300}\nfilter = "ekf"\n'
    text += f'metrics = [{chr(34)}rmse{chr(34)},{" " * 200}"neees"]\n'
    lines = str(mistakes_of(text, tmp_path)).splitlines()
    assert max(map(len, lines)) < 140
    assert lines[-3][lines[-2].index("^") :].startswith('"neees"')


PLAIN = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
JUNK = st.recursive(
    PLAIN, lambda x: st.lists(x, max_size=3) | st.dictionaries(st.text(max_size=5), x, max_size=3)
)
NAMES = st.sampled_from(["scenario", "sensor", "motion", "filter", "sweep", "limits", "start"])


@given(st.dictionaries(NAMES, JUNK | st.dictionaries(NAMES, JUNK, max_size=2), max_size=4))
def test_whatever_is_in_a_mapping_is_a_sentence(junk):
    with pytest.raises((StudyError, DataError)):
        study_from(GOOD | {"runs": 0} | junk)
