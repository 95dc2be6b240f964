"""The report: whole, offline, readable without scripts, true to its numbers, and drawn."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import worlds
from html_page import Page, embedded, inflated, needs_chromium, running_browser, unpack
from scipy import stats

from boresight.errors import OutputError
from boresight.interfaces.report import beside, consistency, report, residuals, verdict
from boresight.interfaces.report.charts import short, typed
from boresight.interfaces.report.words import clock, figure, gain

MEGABYTE = 1_000_000
SECTIONS = (
    "verdict plan residuals consistency side-by-side filters targets skipped recording settings "
    "provenance"
)


@pytest.fixture(scope="module")
def result():
    return worlds.result()


@pytest.fixture(scope="module")
def html(result):
    about = worlds.inspection() | {"file": "night <plots> & more.ast"}
    return report(
        result,
        worlds.comparisons(),
        about,
        "boresight track night.ast",
        as_seen=worlds.comparisons(),
    ).html


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


def test_the_page_is_balanced_html_in_a_language(page):
    assert page.faults == []
    assert page.elements[0] == ("html", {"lang": "en"})
    assert len(page.ids) == len(set(page.ids))
    headings = [tag for tag, _ in page.elements if tag in {"h1", "h2", "h3"}]
    assert headings.count("h1") == 1
    assert headings[0] == "h1"


def test_every_link_leads_to_a_place_in_the_page(page):
    inside = [link.removeprefix("#") for link in page.links if link.startswith("#")]
    assert set(SECTIONS.split()) <= set(inside) | {"verdict"}
    assert set(inside) <= set(page.ids)
    assert [link for link in page.links if not link.startswith("#")] == ["data:,"]


def test_no_address_of_any_kind_is_in_the_file(html):
    assert re.findall(r"(?:https?:)?//[a-z0-9-]+\.[a-z]", html, re.IGNORECASE) == []
    assert "default-src 'none'" in html
    assert not re.search(r"<(?:img|iframe|object|embed|link)\b(?![^>]*data:)", html)


def test_the_library_is_there_once_and_whole(html):
    import plotly

    script = Path(plotly.__file__).parent / "package_data" / "plotly.min.js"
    assert inflated(html, "library") == script.read_bytes()
    assert html.count('id="library"') == 1


def test_every_table_is_there_without_a_script(page, result):
    tables = [tag for tag, _ in page.elements if tag == "table"]
    captions = [tag for tag, _ in page.elements if tag == "caption"]
    assert len(tables) == len(captions) >= 7
    rows = [found for tag, found in page.elements if tag == "tr" and "data-track" in found]
    assert [int(row["data-track"]) for row in rows] == result.targets["track"].to_list()
    text = " ".join(page.text)
    for word in ("BOR020", "F00014", "coasted", "predicted by the radar", "CAT048", "58.7", "mekf"):
        assert word in text
    for fact in ("9f" * 32, "boresight track night.ast", "effective earth radius 4/3"):
        assert fact in text


def test_what_comes_from_the_file_is_escaped(html, page):
    assert "night <plots>" not in html
    assert "night <plots> & more.ast" in " ".join(page.text)


def test_the_machine_readable_part_is_strict_json_and_says_the_same(html, result):
    def refuse(constant):
        raise AssertionError(constant)

    found = json.loads(embedded(html, "boresight-report"), parse_constant=refuse)
    assert (found["plots"], found["used"]) == (result.plots, result.used)
    assert found["targets"][0]["track"] == result.targets["track"][0]
    assert found["comparisons"][1]["filter"] == "mekf"
    assert [each["filter"] for each in found["filters"]] == ["ekf", "mekf", "iekf"]
    assert found["filters"][0]["gain"]["mean"] is None
    assert found["filters"][1]["gain"]["ci95"] == pytest.approx([0.01, 0.03])
    assert found["recording"]["sha256"] == "9f" * 32


def test_a_hostile_identification_cannot_leave_its_element(result):
    bad = "</script><script>alert(1)</script>"
    targets = result.targets.with_columns(aircraft_id=pl.lit(bad))
    hostile = report(replace(result, targets=targets)).html
    assert bad not in hostile
    assert json.loads(embedded(hostile, "boresight-report"))["targets"][0]["aircraft_id"] == bad


def test_size_stays_under_six_megabytes_for_an_hour_of_a_busy_radar():
    big = worlds.result(targets=300, scans=220)
    page = report(big).html
    assert len(page.encode()) < 6 * MEGABYTE
    assert "One plot in 2 is drawn." in page
    assert "targets are left out for size" in page


def test_an_empty_result_still_makes_a_page(result):
    empty = replace(
        result,
        tracks=result.tracks.clear(),
        residuals=result.residuals.clear(),
        targets=result.targets.clear(),
        skipped=result.skipped.clear(),
        plots=3,
        used=0,
        rejected=0,
        nis={"all": {"mean": float("nan"), "median": float("nan"), "dof": 0, "scans": 0}},
    )
    page = Page(report(empty).html)
    assert page.faults == []
    assert "No track was formed." in " ".join(page.text)


def test_a_recording_without_heights_says_so(result):
    nulls = [pl.lit(None, pl.Float64).alias(f"height_{name}_m") for name in ("residual", "sd")]
    flat = replace(result, residuals=result.residuals.with_columns(nulls))
    html = report(flat).html
    assert "no residual of height" in html
    assert 'id="residual-height-time"' not in html


def test_save_writes_utf8_and_names_what_it_cannot_write(tmp_path, html):
    from boresight.interfaces.report import Report

    path = Report(html).save(tmp_path / "r.html")
    assert path.read_text(encoding="utf-8") == html
    with pytest.raises(OutputError, match="cannot be written"):
        Report(html).save(tmp_path / "nowhere" / "r.html")


def test_a_notebook_shows_the_page_in_a_frame_of_its_own(result):
    frame = Page(report(result)._repr_html_())
    ((tag, found),) = frame.elements
    assert tag == "iframe"
    assert found["srcdoc"].startswith("<!DOCTYPE html>")


# ---- what the charts say ----


def test_arrays_come_back_as_they_went():
    values = np.random.default_rng(3).normal(0, 1e4, (5, 7))
    assert np.array_equal(unpack(typed(values)), values.astype("f4"))
    values[0, 0] = np.nan
    assert np.allclose(unpack(short(values)), values, rtol=2**-13, equal_nan=True)


def test_the_density_counts_every_residual_inside_the_axis(result):
    used = result.residuals.filter("used")
    panel = residuals.panels(result.residuals)[0]
    z = unpack(panel.chart["data"][0]["z"])
    counts = np.where(np.isnan(z), 0.0, 10 ** (z - 0.15))
    reach = panel.chart["layout"]["yaxis"]["range"][1]
    inside = int((used["range_residual_m"].abs() <= reach).sum())
    assert counts.sum() == pytest.approx(inside, rel=5e-3)


def test_the_median_finds_a_pattern_that_was_put_in():
    rng = np.random.default_rng(11)
    count = 40_000
    azimuth = rng.uniform(0, 360, count)
    planted = 0.05 * np.sin(np.deg2rad(azimuth))
    base = worlds.result(targets=1, scans=4).residuals[:1]
    frame = pl.concat([base] * count).with_columns(
        azimuth_deg=azimuth,
        azimuth_residual_deg=planted + 0.08 * rng.standard_normal(count),
        used=True,
    )
    panel = next(p for p in residuals.panels(frame) if p.name == "residual-azimuth-azimuth")
    line = panel.chart["data"][-1]
    where, median = unpack(line["x"]), unpack(line["y"])
    error = unpack(line["error_y"]["array"])
    truth = 0.05 * np.sin(np.deg2rad(where))
    # 36 intervals of 95 %: seven or more misses happen once in 500 draws of the seed.
    assert np.sum(np.abs(median - truth) > error) <= 6
    assert np.abs(median).max() > 0.04


def test_bounds_are_those_of_the_chi_square_law():
    dof = np.array([3.0, 30.0, 3000.0])
    low, high = consistency.bounds_of_mean(dof)
    assert np.allclose(low, stats.chi2.ppf(0.025, dof) / dof)
    assert np.allclose(high, stats.chi2.ppf(0.975, dof) / dof)
    expected = stats.chi2.median(3) / 3
    assert consistency.chi_square_median({"dof": 300, "scans": 100}) == pytest.approx(expected)


def test_a_start_without_nis_does_not_spoil_the_means(result):
    spoiled = result.residuals.with_columns(
        nis=pl.when(pl.int_range(pl.len()) % 50 == 0).then(float("nan")).otherwise("nis")
    )
    panels = {p.name: p for p in consistency.panels(spoiled, result.targets)}
    assert np.isfinite(unpack(panels["nis-time"].chart["data"][2]["y"])[5:-5]).all()
    law = unpack(panels["nis-law"].chart["data"][0]["y"])
    assert law[0] == 1.0
    assert np.isnan(law[-1])  # nothing inside the gate lies above 30


def test_gains_are_drawn_with_their_intervals_and_tracks(result):
    gains, law = beside.panels(result)
    tracks, every, straight = gains.chart["data"]
    assert unpack(every["x"]) == pytest.approx([0.02, -0.05])
    assert unpack(straight["error_x"]["array"]) == pytest.approx([0.01, 0.03], rel=1e-5)
    assert len(unpack(tracks["x"])) == 2 * len(result.targets)
    assert set(np.round(unpack(tracks["x"]), 4)) == {np.float32(0.02), np.float32(-0.05)}
    assert gains.chart["layout"]["yaxis"]["ticktext"] == ["mekf", "iekf"]
    assert [each["name"] for each in law.chart["data"]] == ["ekf", "mekf", "iekf", "chi-square"]


def test_one_filter_that_fails_does_not_squeeze_the_others(result):
    far = replace(result.filters[2], gain=worlds._gain(-400.0, 100.0))
    gains, _ = beside.panels(replace(result, filters=[*result.filters[:2], result.filters[2], far]))
    assert gains.chart["layout"]["xaxis"]["range"][1] < 1.0


def test_the_section_stands_only_where_filters_were_compared(result):
    alone = replace(result, filters=result.filters[:1], scores=None)
    html = report(alone).html
    assert 'id="side-by-side"' not in html
    assert not any(each.link == "side-by-side" for each in verdict.sentences(alone))


def test_the_verdict_names_who_predicts_better_and_who_failed(result):
    said = [each for each in verdict.sentences(result) if each.link == "side-by-side"]
    assert [each.mark for each in said] == ["note", "attention"]
    assert "better than ekf: mekf; worse than ekf: iekf" in said[0].html
    assert said[1].html == "iekf: its state was not finite after 1 of 11,220 plots."
    even = [replace(each, gain=worlds._gain(0.001, 0.002)) for each in result.filters]
    said = verdict.sentences(replace(result, filters=even))
    assert "none shows itself better or worse than ekf" in sentence(said, "side-by-side").html


@pytest.mark.parametrize(
    ("mean", "half", "said"),
    [
        (0.01234, 0.0045, "+0.0123 ± 0.0045"),
        (-0.0584, 0.1013, "-0.06 ± 0.10"),
        (-0.0002, 0.028, "+0.000 ± 0.028"),
        (1e-7, 3e-7, "+0.0000 ± 0.0000"),
        (-42.5, 12.0, "-42.5 ± 12.0"),
        (float("nan"), float("nan"), "–"),
    ],
)
def test_a_gain_keeps_two_digits_of_its_interval(mean, half, said):
    assert gain(worlds._gain(mean, half)) == said


def sentence(found, link):
    return next(each for each in found if each.link == link)


def test_the_verdict_follows_the_figures(result):
    straight = result.nis["straight_second_half"]

    def judged(mean, median):
        nis = result.nis | {"straight_second_half": straight | {"mean": mean, "median": median}}
        return sentence(verdict.sentences(replace(result, nis=nis)), "consistency")

    assert judged(1.02, 0.8).mark == "good"
    assert judged(2.25, 1.8).mark == "attention"
    assert "1.50 times what the filter states, it is too confident" in judged(2.25, 1.8).html
    assert "too cautious" in judged(0.6, 0.56).html
    assert judged(0.6, 0.56).mark == "attention"
    assert "a few much larger" in judged(1.02, 0.3).html
    assert judged(1.02, 0.3).mark == "attention"


def test_the_verdict_counts_damage(result):
    hurt = worlds.inspection() | {"skipped_bytes": 1234}
    found = sentence(verdict.sentences(result, inspection=hurt), "recording")
    assert found.mark == "attention"
    assert "1,234 of 2,728,240 bytes" in found.html
    whole = sentence(verdict.sentences(result, inspection=worlds.inspection()), "recording")
    assert whole.mark == "good"


def test_figures_read_as_people_write_them():
    assert [figure(x, 3) for x in (1234567, 12.345, 0.011638, 5.0, None, float("nan"))] == [
        *("1,234,567", "12.3", "0.0116", "5.00", "–", "–"),
    ]
    assert clock(86_400 + 61.9) == "00:01:01 +1 d"


# ---- drawn, in a browser without a network ----


@pytest.fixture(scope="module")
def browser():
    yield from running_browser()


@pytest.fixture(scope="module")
def saved(tmp_path_factory, html):
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(html, encoding="utf-8")
    return path


@needs_chromium
def test_the_page_draws_itself_from_the_file_alone(browser, saved, result):
    context = browser.new_context(offline=True, viewport={"width": 1400, "height": 1000})
    page = context.new_page()
    errors, requests = [], []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
    page.on("request", lambda request: requests.append(request.url))
    page.goto(saved.as_uri())
    page.wait_for_selector("html[data-drawn]", state="attached", timeout=60_000)
    assert page.evaluate("document.documentElement.dataset.drawn") == "true"
    empty = page.evaluate(
        "[...document.querySelectorAll('.chart')].filter((each) => !each.querySelector('.main-svg')"
        ").map((each) => each.id)"
    )
    assert empty == []
    assert errors == []
    assert [url for url in requests if not url.startswith(("data:", "blob:"))] == [saved.as_uri()]
    assert len(page.query_selector_all("#target option")) == len(result.targets)
    context.close()


@needs_chromium
def test_a_target_can_be_chosen_and_the_table_sorted_by_keyboard(browser, saved):
    context = browser.new_context(offline=True, viewport={"width": 700, "height": 900})
    page = context.new_page()
    page.goto(saved.as_uri() + "#track=7")
    page.wait_for_selector("html[data-drawn=true]", state="attached", timeout=60_000)
    assert page.input_value("#target") == "7"
    assert "track 7" in page.inner_text("#target-words")
    page.focus("#target")
    page.keyboard.press("ArrowDown")
    assert page.input_value("#target") != "7"
    assert page.url.endswith(f"#track={page.input_value('#target')}")
    page.focus("#target-table th:first-child button")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    tracks = page.eval_on_selector_all(
        "#target-table tbody tr", "rows => rows.map((row) => Number(row.dataset.track))"
    )
    assert tracks == sorted(tracks)
    assert page.get_attribute("#target-table th:first-child", "aria-sort") == "ascending"
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= 700
    context.close()


@needs_chromium
def test_without_scripts_the_tables_are_all_there(browser, saved):
    context = browser.new_context(offline=True, java_script_enabled=False)
    page = context.new_page()
    page.goto(saved.as_uri())
    assert page.locator("#target-table tbody tr").count() == 51
    assert page.get_by_text("need JavaScript").is_visible()
    context.close()
