"""`boresight tma` and `bs.tma`, on the example that the project carries and on damaged copies."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from shell import boresight

import boresight as bs
from boresight.errors import DataError, UsageError

EXAMPLE = Path(__file__).parents[2] / "examples" / "tma"
BEARINGS, OWN_SHIP, TRUTH = (EXAMPLE / f"{n}.csv" for n in ("bearings", "own-ship", "truth"))
QUANTITIES = ("range_m", "bearing_deg", "course_deg", "speed_mps")
CONTRACT = {"filter", "bearings", "converged_s", "observable", *QUANTITIES}


def answered(*arguments):
    """The object that the command printed."""
    done = boresight("tma", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def table(path):
    return pl.read_csv(path, comment_prefix="#")


def before(tmp_path, time_s):
    """The example's bearings up to a time, as a file."""
    path = tmp_path / "early.csv"
    table(BEARINGS).filter(pl.col("time_s") <= time_s).write_csv(path)
    return path


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """What the command wrote of the example, and the object it printed."""
    folder = tmp_path_factory.mktemp("tma")
    return folder, answered(BEARINGS, "--own-ship", OWN_SHIP, "-o", folder)


def test_the_answer_has_what_its_contract_says(written):
    _, told = written
    assert set(told) >= CONTRACT
    assert told["filter"] == "rp-ekf"
    assert told["observable"] is True
    assert told["bearings"] == table(BEARINGS).height
    for name in QUANTITIES:
        assert set(told[name]) >= {"estimate", "sd"}
        assert set(told[name]["regions"]) == {"50", "90", "99"}


def test_the_answer_is_the_truth_within_what_it_says(written):
    # Four quantities within four standard deviations: a false alarm in four thousand.
    _, told = written
    truth = table(TRUTH).row(-1, named=True)
    assert truth["time_s"] == told["last_s"]
    for name in QUANTITIES:
        assert abs(told[name]["estimate"] - truth[name]) < 4.0 * told[name]["sd"], name


def test_a_folder_gets_a_report_and_tables(written):
    folder, told = written
    assert {Path(each).name for each in told["outputs"]} == {
        "report.html",
        "history.parquet",
        "history.csv",
        "target.geojson",
    }
    history = pl.read_parquet(folder / "history.parquet")
    assert history.height == told["bearings"]
    unknown = history.filter(~pl.col("observable"))
    assert unknown.height > 50
    assert unknown["latitude_deg"].null_count() == unknown.height
    line = json.loads((folder / "target.geojson").read_text())["features"][0]["geometry"]
    assert line["type"] == "LineString"


def test_before_own_ship_turns_the_range_has_no_estimate(tmp_path):
    told = answered(before(tmp_path, 110.0), "--own-ship", OWN_SHIP)
    assert told["observable"] is False
    assert told["converged_s"] is None
    assert told["range_m"]["estimate"] is None
    assert told["range_m"]["regions"]["90"]
    assert told["state"] is None
    assert told["batch"] is None


def test_what_is_said_in_words_agrees_with_what_is_known(tmp_path):
    early = boresight("tma", before(tmp_path, 110.0), "--own-ship", OWN_SHIP).stdout
    assert "own ship has not manoeuvred" in early
    assert "Not converged" in early
    late = boresight("tma", BEARINGS, "--own-ship", OWN_SHIP).stdout
    assert "Converged at" in late


@pytest.mark.parametrize("name", ["rp-mgekf", "rp-ukf", "rp-ckf", "rp-modified-polar"])
def test_every_bank_comes_to_the_same_answer(written, name):
    _, usual = written
    told = answered(BEARINGS, "--own-ship", OWN_SHIP, "--filter", name)
    assert told["filter"] == name
    for quantity in QUANTITIES:
        apart = abs(told[quantity]["estimate"] - usual[quantity]["estimate"])
        assert apart < 0.5 * usual[quantity]["sd"]


def test_settings_are_what_was_asked_for(written):
    _, usual = written
    asked = ("--ranges", "500,30000", "--cells", 8, "--prune", 0, "--speed", 8)
    told = answered(BEARINGS, "--own-ship", OWN_SHIP, *asked, "--limits", "range=1,confidence=0.5")
    assert told["settings"]["nearest_m"] == 500.0
    assert told["settings"]["cells"] == 8
    assert told["settings"]["speed_mps"] == 8.0
    assert len(told["cells"]["range_m"]) == 8
    assert told["criteria"]["range_percent"] == 1.0
    assert told["converged_s"] > usual["converged_s"]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("--ranges", "5"), "two numbers"),
        (("--ranges", "9000,500"), "farthest"),
        (("--limits", "rnage=1"), "range"),
        (("--limits", "range=no"), "not a number"),
        (("--limits", "range=-1"), "range_percent"),
        (("--filter", "rp-efk"), "rp-ekf"),
        (("--filter", "mgekf", "--cells", 5), "rp-mgekf"),
        (("--filter", "kf"), "use ekf"),
        (("--speed", 0), "speed_mps"),
        (("--prune", 1.5), "prune"),
        (("--cells", 0), "cells"),
        (("--cells", 10_000), "from 1 to 200"),
        (("--speed", 1e9), "speed_mps"),
        (("--track", "nobody"), "nobody"),
    ],
)
def test_a_wrong_option_is_named_with_its_cure(asked, said):
    done = boresight("tma", BEARINGS, "--own-ship", OWN_SHIP, *asked)
    assert done.returncode in (2, 65), done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_file_that_is_not_there_and_one_that_is_something_else(tmp_path):
    assert boresight("tma", tmp_path / "no.csv", "--own-ship", OWN_SHIP).returncode == 66
    wrong = tmp_path / "wrong.csv"
    wrong.write_bytes(bytes(range(256)))
    assert boresight("tma", wrong, "--own-ship", OWN_SHIP).returncode == 65
    assert boresight("tma", OWN_SHIP, "--own-ship", BEARINGS).returncode == 65


def test_frames_and_files_give_the_same():
    files = bs.tma(BEARINGS, OWN_SHIP).main
    frames = bs.tma(table(BEARINGS), table(OWN_SHIP)).main
    assert files.range_m == frames.range_m
    assert files.convergence == frames.convergence


def test_a_report_of_what_python_found():
    page = bs.report(bs.tma(BEARINGS, OWN_SHIP))
    assert "own ship" in page.html


def test_a_cone_keeps_both_sides_until_own_ship_turns():
    """The example's bearings folded about own ship's heading, as a line array hears them."""
    own, heard = table(OWN_SHIP), table(BEARINGS)
    north, east = _plane(own)
    heading = np.degrees(np.arctan2(np.gradient(east), np.gradient(north)))
    axis = np.interp(heard["time_s"], own["time_s"], np.unwrap(heading, period=360.0))
    off = np.abs((heard["bearing_deg"].to_numpy() - axis + 180.0) % 360.0 - 180.0)
    cones = heard.select("time_s", "sigma_deg").with_columns(
        bearing_deg=pl.Series(off), conical=pl.lit(value=True)
    )
    ship = pl.DataFrame({"time_s": own["time_s"], "north_m": north, "east_m": east})
    early = bs.tma(cones.filter(pl.col("time_s") < 100.0), ship).main
    # Own ship's log is rounded to a centimetre, so the sides are not the same to the last digit.
    assert [side.probability for side in early.sides] == pytest.approx([0.5, 0.5], abs=0.02)
    assert not early.decided
    assert early.bearing_deg.estimate is None
    late = bs.tma(cones, ship).main
    assert late.decided
    usual = bs.tma(BEARINGS, OWN_SHIP).main
    assert abs(late.range_m.estimate - usual.range_m.estimate) < usual.range_m.sd


def test_single_filters_do_not_guess_a_side():
    cones = table(BEARINGS).with_columns(bearing_deg=pl.lit(60.0), conical=pl.lit(value=True))
    with pytest.raises(UsageError, match="rp-mgekf"):
        bs.tma(cones, OWN_SHIP, filter="mgekf")


def test_too_few_bearings_are_no_contact(tmp_path):
    path = before(tmp_path, table(BEARINGS)["time_s"][0])
    done = boresight("tma", path, "--own-ship", OWN_SHIP)
    assert done.returncode == 65
    assert "3 bearings" in done.stderr


def test_three_bearings_are_an_answer_without_a_range(tmp_path):
    told = answered(before(tmp_path, table(BEARINGS)["time_s"][2]), "--own-ship", OWN_SHIP)
    assert told["bearings"] == 3
    assert told["observable"] is False
    assert told["bearing_deg"]["estimate"] is not None


def test_neither_tables_nor_paths_are_refused():
    with pytest.raises(UsageError, match="bearings"):
        bs.tma([1, 2, 3], OWN_SHIP)
    with pytest.raises((DataError, UsageError)):
        bs.tma(table(OWN_SHIP), OWN_SHIP)


def _plane(own):
    """North and East, m, of a small area."""
    latitude, longitude = own["latitude_deg"].to_numpy(), own["longitude_deg"].to_numpy()
    north = np.radians(latitude - latitude[0]) * 6_367_000.0
    return north, np.radians(longitude - longitude[0]) * 6_367_000.0 * np.cos(
        np.radians(latitude[0])
    )


def test_an_answer_that_contradicts_itself_has_not_converged():
    """Ranges that cannot be: the bank comes out far from where it was told to look."""
    wrong = bs.tma(BEARINGS, OWN_SHIP, nearest_m=100.0, farthest_m=200.0).main
    assert wrong.converged_s is None
    assert any("believed possible" in each for each in wrong.remarks)
    assert bs.tma(BEARINGS, OWN_SHIP).main.converged_s is not None
