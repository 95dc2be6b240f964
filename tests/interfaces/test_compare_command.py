"""`boresight compare` and `simulate`, `bs.compare`, the study's page, frames and notebook."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from html_page import Page, embedded, needs_chromium, running_browser
from rich.console import Console
from shell import boresight

import boresight as bs
from boresight.errors import UsageError
from boresight.interfaces.comparing import compare
from boresight.interfaces.report import study_words
from boresight.interfaces.screens_study import studied
from boresight.interfaces.terminal import Manner

STUDIES = Path(__file__).parents[2] / "examples" / "studies"
PAPER = STUDIES / "paper.toml"
TWO_LINES = {"scenario": "kashyap-set-2", "filter": ["ekf"]}
CONTRACT = {
    *("filter", "settings", "runs", "position_rmse_m", "velocity_rmse_mps", "anees"),
    *("anees_bounds", "pcrlb_m", "ratio_to_bound", "diverged", "ns_per_step"),
}
SWEPT = """
name = "angles"
runs = 60
seed = 3
scenario = "kashyap-set-2"
[sensor]
range.sigma = "30 m"
azimuth.sigma = "1.5 deg"
elevation.sigma = "1.5 deg"
[[filter]]
name = "ekf"
[[filter]]
name = "ekf"
label = "believes too much"
noise_scale = 0.5
[sweep]
"sensor.azimuth.sigma" = ["0.5 deg", "5 deg"]
"""


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A study of two settings and two filters, with all that the command writes."""
    folder = tmp_path_factory.mktemp("compare")
    (folder / "study.toml").write_text(SWEPT, encoding="utf-8")
    done = boresight("compare", folder / "study.toml", "-o", folder / "out", "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_the_answer_has_what_its_contract_says(swept):
    _, told = swept
    assert told["seed"] == 3
    assert len(told["cells"]) == 4
    assert all(set(cell) >= CONTRACT for cell in told["cells"])
    assert [cell["label"] for cell in told["cells"]] == ["ekf", "believes too much"] * 2
    assert {cell["settings"]["sensor.azimuth.sigma"] for cell in told["cells"]} == {
        "0.5 deg",
        "5 deg",
    }


def test_a_filter_that_believes_half_the_noise_is_found_out(swept):
    """Its ANEES is near 2: 30 bands away, so chance has no say."""
    _, told = swept
    doubted = [cell for cell in told["cells"] if cell["label"] == "believes too much"]
    assert all(cell["anees"] > cell["anees_bounds"][1] for cell in doubted)


def test_python_gives_the_numbers_of_the_command(swept):
    folder, told = swept
    result = bs.compare(folder / "study.toml")
    assert result.digest == told["sha256"]
    assert bs.compare(folder / "study.toml", seed=4).digest != told["sha256"]


def test_the_tables_hold_every_cell_run_and_scan(swept):
    folder, told = swept
    cells, runs, scans = (
        pl.read_parquet(folder / "out" / f"{n}.parquet") for n in ("cells", "runs", "scans")
    )
    assert (cells.height, runs.height) == (4, 4 * 60)
    for i, (label, setting) in enumerate(
        zip(cells["label"], cells["sensor.azimuth.sigma"], strict=True)
    ):
        mine = (pl.col("label") == label) & (pl.col("sensor.azimuth.sigma") == setting)
        of_runs = runs.filter(mine)["position_rmse_m"].to_numpy()
        of_scans = scans.filter(mine)["position_rmse_m"].to_numpy()
        whole = told["cells"][i]["position_rmse_m"]
        assert np.sqrt(np.mean(of_runs**2)) == pytest.approx(whole, rel=1e-12)
        assert np.sqrt(np.mean(of_scans**2)) == pytest.approx(whole, rel=1e-12)
    assert {"error_x_m", "bound_m", "claimed_m", "nees"} <= set(scans.columns)


def test_the_page_is_sound_and_says_what_the_command_says(swept):
    folder, told = swept
    html = (folder / "out" / "report.html").read_text("utf-8")
    page = Page(html)
    assert not page.faults
    assert len(page.ids) == len(set(page.ids))
    facts = json.loads(embedded(html, "boresight-report"))
    assert facts["digest"] == told["sha256"]
    words = " ".join(page.text)
    assert "believes too much" in words
    assert "too sure" in words
    places = re.findall(r'<td class="n">(\d+)</td><td>(ekf|believes too much)</td>', html)
    losses = [each["other"] for each in told["comparisons"] if each["win"]]
    assert len(places) == len(told["cells"])
    assert sum(int(place) for place, _ in places) == len(places) + len(losses)
    assert all(f"s{i}-{name}" in page.ids for i in (0, 1) for name in ("rmse", "nees", "nis"))
    assert {"sweep-rmse", "sweep-anees", "cost"} <= set(page.ids)


@pytest.fixture(scope="module")
def browser():
    yield from running_browser()


@needs_chromium
def test_every_chart_of_the_page_is_drawn(swept, browser):
    folder, _ = swept
    page = browser.new_page()
    faults = []
    page.on("pageerror", lambda fault: faults.append(str(fault)))
    page.goto((folder / "out" / "report.html").as_uri())
    page.wait_for_selector("html[data-drawn]", state="attached", timeout=60_000)
    page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
    page.wait_for_function(
        "() => [...document.querySelectorAll('.chart')].every(e => e.querySelector('.main-svg'))",
        timeout=30_000,
    )
    assert not faults


def test_the_screen_fits_80_columns_and_names_the_verdict(swept, monkeypatch):
    folder, _ = swept
    monkeypatch.setenv("COLUMNS", "80")
    done = boresight("compare", folder / "study.toml")
    assert done.returncode == 0, done.stderr
    assert "…" not in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "too sure" in done.stdout


@pytest.mark.parametrize("ns", [9.6, 94.7, 1042.3, 9999.6, 87654.3])
def test_the_screen_fits_whatever_a_step_costs(swept, ns):
    folder, _ = swept
    result = bs.compare(folder / "study.toml")
    cells = tuple(replace(cell, ns_per_step=ns) for cell in result.cells)
    console = Console(width=80, file=io.StringIO())
    for part in studied(replace(result, cells=cells), (), 80):
        console.print(part, crop=False)
    assert max(map(len, console.file.getvalue().splitlines())) <= 80


@pytest.mark.parametrize("width", [60, 80, 120])
def test_every_filter_has_its_name_on_screens_of_any_width(swept, monkeypatch, width):
    """However long its figures are."""
    folder, _ = swept
    monkeypatch.setenv("COLUMNS", str(width))
    text = SWEPT.replace('range.sigma = "30 m"', 'range.sigma = "1e9 m"')
    (folder / "vast.toml").write_text(text, encoding="utf-8")
    done = boresight("compare", folder / "vast.toml", "--runs", 10)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= width
    assert "…" not in done.stdout
    assert sum(line.split()[:1] == ["ekf"] for line in lines if "m " in line) >= 2


def test_one_run_of_one_filter_is_not_told_in_the_plural(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('scenario = "kashyap-set-2"\nfilter = "ekf"\nruns = 1\n', encoding="utf-8")
    done = boresight("compare", path)
    assert "1 cell of 1 run," in done.stdout
    assert "1 run is too few" in done.stderr
    assert "1 run of 1 setting," in boresight("simulate", path, "-o", tmp_path).stdout


@pytest.mark.parametrize(
    ("value", "words"), [(0.0, "0"), (1.0, "100 %"), (0.995, "100 %"), (0.0012, "0.12 %")]
)
def test_shares_are_told_in_digits(value, words):
    assert study_words.share(value) == words


def test_a_notebook_shows_the_ranking_and_a_picture(swept):
    folder, _ = swept
    html = bs.compare(folder / "study.toml", runs=8)._repr_html_()
    page = Page(html)
    assert not page.faults
    assert html.count("<svg") == 2
    assert re.search(r"believes too much", " ".join(page.text))


def test_filters_of_ones_own_compete(swept):
    folder, _ = swept
    mine = bs.Filter(name="mine", formula=own_update, summary="", paper="")
    result = bs.compare(folder / "study.toml", filters=[mine, "mekf"], runs=8)
    assert {cell.label for cell in result.cells} == {"ekf", "believes too much", "mine", "mekf"}
    ekf, own = (
        next(cell for cell in result.cells if cell.label == label) for label in ("ekf", "mine")
    )
    assert own.position_rmse_m.value == pytest.approx(ekf.position_rmse_m.value, rel=1e-9)


def own_update(prior, z, components):
    """A user's filter: the catalogue's EKF by another name."""
    from boresight.filters import ekf

    return ekf.update(prior, z, components)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--runs", "0"], 2, "runs"),
        (["--engine", "dask"], 2, "scheduler"),
        (["--engine", "dask", "--scheduler", "tcp://127.0.0.1:9"], 74, "tcp://127.0.0.1:9"),
        (["--resume"], 2, "-o"),
        (["--chunk", "0"], 2, "chunk"),
    ],
)
def test_what_cannot_be_done_is_said_with_the_next_step(arguments, code, words):
    done = boresight("compare", PAPER, *arguments)
    assert done.returncode == code, done.stderr
    assert done.stderr.startswith("error: ")
    assert words in done.stderr
    assert "next:" in done.stderr
    assert "Traceback" not in done.stderr


def test_an_unknown_filter_is_named_with_the_nearest(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('scenario = "kashyap-set-2"\nfilter = ["ekff"]\n', encoding="utf-8")
    done = boresight("compare", path)
    assert done.returncode == 2
    assert "ekff" in done.stderr
    assert "'ekf'" in done.stderr
    assert "line 2" in done.stderr or ":2" in done.stderr


def test_a_study_that_is_not_there(tmp_path):
    done = boresight("compare", tmp_path / "none.toml")
    assert done.returncode == 66
    assert "none.toml" in done.stderr


@pytest.mark.parametrize(
    ("study", "options"),
    [
        (TWO_LINES | {"runs": 0}, {}),
        (3, {}),
        (None, {}),
        (TWO_LINES, {"filters": [3]}),
        (TWO_LINES, {"filters": ["ekf", "ekf"]}),
        (TWO_LINES, {"runs": 2.5}),
        (TWO_LINES, {"runs": "many"}),
        (TWO_LINES, {"runs": True}),
        (TWO_LINES, {"runs": 10**13}),
        (TWO_LINES, {"seed": 1.5}),
        (TWO_LINES, {"workers": 1.5}),
        (TWO_LINES, {"chunk": 2.5}),
    ],
)
def test_a_study_of_another_kind_is_refused(study, options):
    with pytest.raises(UsageError):
        bs.compare(study, **options)


def test_one_filter_may_be_named_without_a_list():
    result = bs.compare(TWO_LINES, filters="ukf", runs=4)
    assert [cell.label for cell in result.cells] == ["ekf", "ukf"]


def test_an_interrupt_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("boresight.laboratory.run.run_study", interrupted)
    how = {"runs": 4, "seed": 0, "engine": "threads"}
    manner = Manner(command="boresight compare a.toml -o out")
    with pytest.raises(KeyboardInterrupt):
        compare(PAPER, manner, folder=tmp_path, **how)
    said = " ".join(capsys.readouterr().err.split())  # whatever the terminal's width
    assert "boresight compare a.toml -o out --resume" in said


def test_simulate_writes_truth_and_plots(tmp_path):
    done = boresight("simulate", PAPER, "--runs", 3, "-o", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["runs"], told["seed"]) == (3, 0)
    tables = [pl.read_parquet(path) for path in told["outputs"] if path.endswith(".parquet")]
    assert all(table["run"].n_unique() == 3 for table in tables if "run" in table.columns)
    truth, plots = bs.simulate("kashyap-set-2", runs=3, seed=0)
    seen = next(table for table in tables if "range_m" in table.columns)
    assert seen["range_m"].to_numpy() == pytest.approx(plots.z[..., 0].ravel(), rel=1e-12)
    assert truth.states.shape[0] == 3


def test_before_a_start_from_two_plots_nothing_is_told_of_a_track():
    """Errors of the first scan would be those of a track that begins one scan later."""
    result = bs.compare(TWO_LINES | {"start": {"kind": "two plots"}}, runs=20)
    scans = result.every_scan.select("position_rmse_m", "nees", "bound_m").to_numpy()
    assert np.isnan(scans[0]).all()
    assert np.isfinite(scans[1:]).all()
    assert scans[1, 0] < 3 * scans[2, 0]
    assert "boresight-report" in bs.report(result).html
    assert result._repr_html_().count("<polyline") == 2


def test_where_no_bound_can_be_had_the_remark_says_why(swept):
    """Of a range to a nanometre, beside a start that knows the speed to 300 m/s."""
    folder, _ = swept
    text = (STUDIES / "waypoints.toml").read_text(encoding="utf-8").partition("[sweep]")[0]
    path = folder / "exact.toml"
    path.write_text(
        text.replace('range.sigma = "50 m"', 'range.sigma = "1e-9 m"'), encoding="utf-8"
    )
    result = bs.compare(path, runs=4)
    assert np.isnan(result.cells[0].pcrlb_m)
    assert "cannot be inverted" in result.remarks[0]
