"""The page of repeated papers: every row, numbers side by side, nothing loaded, nothing run."""

import json
import re
from pathlib import Path

import pytest
from html_page import Page, embedded, needs_chromium, running_browser

from boresight.experiments.reproduce import claim_ids, reproduce
from boresight.interfaces.report.reproduce_page import page
from boresight.interfaces.report.reproduce_rows import KINDS, article, value
from boresight.interfaces.report.words import figure

MEGABYTE = 1_000_000


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return reproduce("aditya", runs=10, output=tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def html(found):
    return page("aditya", found, "boresight reproduce aditya").html


def claim(**given):
    return {"id": "XX-T1", "where": "Table 1", "published": "so it is", "ours": {}, "band": None,
            "verdict": "in band", "assumption": ""} | given  # fmt: skip


def cells(html):
    """Texts of table rows, tags left out."""
    rows = re.findall(r"<tr>(.*?)</tr>", html)
    return [[re.sub("<[^>]+>", "", c) for c in re.findall(r"<t[dh].*?</t[dh]>", r)] for r in rows]


def test_every_row_has_its_anchor_and_every_link_its_place(html):
    read = Page(html)
    assert read.faults == []
    assert len(read.ids) == len(set(read.ids))
    assert set(claim_ids("aditya")) <= set(read.ids)
    links = {link.removeprefix("#") for link in read.links if link.startswith("#")}
    assert links <= set(read.ids)
    assert set(claim_ids("aditya")) <= links


def test_it_loads_nothing_and_runs_nothing(html):
    assert re.findall(r"(?:https?:)?//[a-z0-9-]+\.[a-z]", html, re.IGNORECASE) == []
    scripts = [found for tag, found in Page(html).elements if tag == "script"]
    assert [each["type"] for each in scripts] == ["application/json"]
    sources = [found["src"] for tag, found in Page(html).elements if "src" in found]
    assert len(sources) == 7
    assert all(each.startswith("data:image/webp;base64,") for each in sources)
    assert len(html) < MEGABYTE


def test_its_facts_are_what_was_found(html, found):
    told = json.loads(embedded(html, "boresight-report"))
    assert told["claims"] == json.loads(json.dumps(found["claims"]))
    assert told["seed"] == found["seed"]


def test_each_verdict_is_counted_at_the_head(html, found):
    head = html[: html.index("<nav")]
    for verdict in KINDS:
        count = sum(each["verdict"] == verdict for each in found["claims"])
        assert re.search(rf"{verdict}</dt><dd>{count}<small>of 15", head)


def test_published_ours_band_and_verdict_stand_side_by_side(html, found):
    whole = next(each for each in found["claims"] if each["id"] == "AD-T3")
    body = html[html.index('id="AD-T3"') : html.index('id="AD-F2"')]
    rows = {row[0]: row[1:] for row in cells(body)}
    for part in whole["parts"]:
        published, ours, band, _, verdict = rows[part["id"].removeprefix("AD-T3 ")]
        assert (published, ours) == (figure(part["published"]), figure(part["ours"]))
        assert band == " to ".join(map(figure, part["band"]))
        assert verdict.endswith(part["verdict"])


def test_runs_seed_versions_and_assumptions_are_told(html):
    text = " ".join(Page(html).text)
    for word in ("runs", "seed", "numpy", "boresight reproduce aditya", "number of steps: not"):
        assert word in text
    assert "[10, 30, 100, 300]" in text


def test_a_strip_shows_where_the_printed_number_lies():
    """The band from 4 to 8 in a strip from 2 (printed) to 8."""
    shown = article(claim(published={"a": 2.0}, ours={"a": 5.0}, band={"a": (4.0, 8.0)}))
    printed = float(re.search(r'd="M([\d.]+) 0', shown)[1])
    left, width = map(
        float, re.search(r'<rect x="([\d.]+)" y="4" width="([\d.]+)"', shown).groups()
    )
    dot = float(re.search(r'cx="([\d.]+)"', shown)[1])
    scale = (left + width - printed) / 6.0
    assert left == pytest.approx(printed + 2.0 * scale, abs=0.2)
    assert dot == pytest.approx(printed + 3.0 * scale, abs=0.2)
    far = article(claim(published={"a": 1.0}, ours={"a": 10.0}, band={"a": (1.0, 100.0)}))
    assert float(re.search(r'cx="([\d.]+)"', far)[1]) == pytest.approx(75.0, abs=0.2)


def test_several_values_are_columns_or_rows_and_rows_in_rows_are_rows():
    times = {"1 s": 0.5, "2 s": 0.25}
    shown = article(claim(ours={"RP": times, "EKF": times}))
    assert ["RP", "0.5000", "0.2500"] in cells(shown)
    shown = article(
        claim(ours={"all": {"1 s": {"mean": 1.0, "sd": 2.0}, "2 s": {"mean": 3.0, "sd": 4.0}}})
    )
    assert ["all, 2 s", "3.000", "4.000"] in cells(shown)
    many = {f"{i} s": float(i) for i in range(1, 9)}
    shown = article(claim(ours={"RP": many}))
    assert ["3 s", "3.000"] in cells(shown)


def test_parts_are_shown_with_their_verdicts_and_a_band_of_all_is_too():
    good = claim(id="XX-T1 good", ours=0.5, band=(0.4, 0.6), published=0.5, verdict="reproduces")
    bad = claim(
        id="XX-T1 bad", ours={"x": 1.0}, verdict="does not reproduce", assumption="so it was"
    )
    shown = article(claim(parts=[good, bad], band=(1.0, 2.0)))
    assert "<h4>bad</h4>" in shown
    assert "so it was" in shown
    rows = {row[0]: row for row in cells(shown) if row}
    assert rows["good"][-1] == "✓ reproduces"
    assert "1.000 to 2.000" in shown


def test_words_are_escaped_and_nothing_is_a_dash():
    shown = article(claim(published="a < b & c", assumption="<script>"))
    assert "a &lt; b &amp; c" in shown
    assert "<script>" not in shown
    assert (value(None), value([]), value(True), value((1.0, 2.0))) == (
        "–", "none", "yes", "1.000 to 2.000",
    )  # fmt: skip


@pytest.fixture(scope="module")
def browser():
    yield from running_browser()


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("width", [1400, 700])
def test_it_fits_and_its_boxes_choose_without_scripts(browser, html, tmp_path, width):
    file = Path(tmp_path / "page.html")
    file.write_text(html, encoding="utf-8")
    shown = browser.new_context(
        offline=True, java_script_enabled=False, viewport={"width": width, "height": 900}
    ).new_page()
    shown.goto(file.as_uri())
    assert shown.locator(".claim:visible").count() == len(claim_ids("aditya"))
    assert shown.locator("body").bounding_box()["width"] <= width
    bad = shown.locator(".claim.bad").count()
    assert bad > 0
    shown.uncheck("#show-bad")
    assert shown.locator(".claim:visible").count() == len(claim_ids("aditya")) - bad
