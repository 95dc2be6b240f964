"""Options of `track` that change the answer: the air, and where the radar stands."""

import io
import json
import subprocess
import sys
from importlib.resources import as_file, files

import pytest
import worlds
from rich.console import Console

import boresight as bs
from boresight.catalogue import names
from boresight.errors import UsageError
from boresight.interfaces import door, screens


def track(*options):
    with as_file(files("boresight") / "demo" / "recording.ast") as file:
        done = subprocess.run(
            [sys.executable, "-m", "boresight", "track", str(file), "--json", *options],
            capture_output=True,
            text=True,
            check=False,
        )
    return done.returncode, json.loads(done.stdout)


def test_a_radar_that_says_where_it_stands_needs_no_site():
    code, said = track()
    assert code == 0
    # The position of I034/120 comes in steps of 180 / 2**23 degrees.
    assert said["settings"]["site"]["latitude_deg"] == pytest.approx(47.8125, abs=3e-5)
    assert not any("--site" in remark for remark in said["remarks"])


def test_a_site_that_is_given_wins():
    _, said = track("--site", "47.0,1.0,100")
    assert said["settings"]["site"]["latitude_deg"] == 47.0


def test_the_air_is_named_in_the_settings():
    _, said = track("--atmosphere", "exponential")
    assert "ExponentialAtmosphere" in said["settings"]["atmosphere"]
    assert track()[1]["settings"]["atmosphere"] == "none"


def test_an_unknown_air_is_a_usage_error():
    assert track("--atmosphere", "thick")[0] == 2


def test_several_filters_stand_side_by_side_in_their_order():
    code, said = track("--filter", "ekf", "--filter", "iekf, mekf")
    assert code == 0
    assert said["filter"] == "ekf"
    first, *others = said["filters"]
    assert [each["filter"] for each in (first, *others)] == ["ekf", "iekf", "mekf"]
    assert first["gain"] == {"mean": None, "ci95": [None, None], "plots": 0, "tracks": 0}
    for each in others:
        low, high = each["gain"]["ci95"]
        assert low < each["gain"]["mean"] < high
        assert each["failed_share"] == 0
        assert 0 < each["ns_per_update"] < 10_000


def test_one_filter_has_its_figures_too():
    _, said = track("--filter", "ekf")
    assert [each["filter"] for each in said["filters"]] == ["ekf"]
    assert said["filters"][0]["scored"] > 1000


@pytest.mark.parametrize(
    ("texts", "names"),
    [
        (["ekf"], ["ekf"]),
        (["mekf,ekf"], ["mekf", "ekf"]),
        (["mekf", " ekf , iekf"], ["mekf", "ekf", "iekf"]),
    ],
)
def test_names_are_read_in_their_order(texts, names):
    chosen, is_all = door.filters(texts)
    assert [each.name for each in chosen] == names
    assert not is_all


def test_all_is_the_rest_of_the_catalogue_after_what_was_named():
    for texts, first in ((["all"], "mekf"), (["ekf", "all"], "ekf"), (["all,ekf"], "ekf")):
        chosen, is_all = door.filters(texts)
        said = [each.name for each in chosen]
        assert is_all
        assert said[0] == first
        assert sorted(said) == sorted(names())


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["ekf", "ekf"], r"'ekf' is named twice\n  next: --filter ekf"),
        (["mekf,ekf", "mekf"], r"'mekf' is named twice\n  next: --filter mekf,ekf"),
        (["ekf,mefk"], "did you mean 'mekf'"),
        ([""], "no filter ''"),
    ],
)
def test_a_mistake_in_the_names_is_told_with_its_cure(texts, said):
    with pytest.raises(UsageError, match=said):
        door.filters(texts)


def test_a_filter_that_cannot_take_the_plots_is_refused_in_a_sentence():
    code, said = track("--filter", "ekf,kf")
    assert code == 2
    assert "linear Kalman filter cannot use range_m" in said["error"]["what"]


def test_the_table_of_filters_keeps_to_its_width():
    result = worlds.result(targets=5, scans=80)
    for width in (80, 120):
        console = Console(width=width, file=io.StringIO(), emoji=False)
        for part in screens.tracked(result, [], width):
            console.print(part, crop=False)
        lines = console.file.getvalue().splitlines()
        assert max(map(len, lines)) <= width
        row = next(line for line in lines if line.strip().startswith("iekf"))
        assert "-0.050 ± 0.030" in row
        assert ("3.10 m/s" in row) == (width == 120)


def test_in_python_filters_are_compared_by_name():
    plots = bs.read(str(files("boresight") / "demo" / "recording.ast"))
    result = bs.track(plots, filter="ekf", compare=("mekf",))
    assert [each.filter for each in result.filters] == ["ekf", "mekf"]
    assert set(result.scores["filter"]) == {"ekf", "mekf"}
    assert 'id="side-by-side"' in bs.report(result).html
    with pytest.raises(UsageError, match="named twice"):
        bs.track(plots, filter="ekf", compare=("ekf",))
