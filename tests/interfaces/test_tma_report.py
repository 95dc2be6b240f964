"""The report of contacts: says what is known and what is not, draws both, loads nothing."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import tma_example as made
from html_page import Page, embedded, needs_chromium, running_browser, unpack
from scipy import stats

from boresight import catalogue
from boresight.interfaces.report import report, tma_picture, tma_residuals, tma_waterfall
from boresight.interfaces.report.tma_history import allowed, marks, panels
from boresight.interfaces.report.tma_tables import contacts, failures
from boresight.interfaces.report.tma_verdict import sentences, summary
from boresight.interfaces.report.tma_view import View, stretches, thinned, unwrapped
from boresight.interfaces.report.tma_words import (
    BEARING,
    COURSE,
    RANGE,
    SPEED,
    estimate,
    hull,
    region,
)
from boresight.target_motion.analyse import analyse
from boresight.target_motion.result import Quantity, TmaResult

MEGABYTE = 1_000_000
SECTIONS = "verdict picture history quantities cells residuals settings provenance"


@pytest.fixture(scope="module")
def states():
    return made.states()


@pytest.fixture(scope="module")
def many():
    return report(motion=made.many(), command="boresight tma contacts.csv").html


def page_of(motion):
    return report(motion=TmaResult(contacts=(motion,))).html


def said(motion):
    return " ".join(each.html for each in sentences(motion))


def named(chart, name):
    return [trace for trace in chart["data"] if trace.get("name") == name]


def picture(motion):
    return tma_picture.panel(View(motion)).chart


# ---- the page ----


@pytest.mark.parametrize("state", list(made.states()))
def test_every_state_of_knowledge_makes_a_whole_page(states, state):
    html = page_of(states[state])
    page = Page(html)
    assert page.faults == []
    assert len(page.ids) == len(set(page.ids))
    inside = {link.removeprefix("#") for link in page.links if link.startswith("#")}
    assert inside <= set(page.ids)
    left_out = {"settings"} if state == "bare" else set()
    assert set(SECTIONS.split()) - left_out <= set(page.ids)
    assert len(html) < 4 * MEGABYTE
    assert re.findall(r"(?:https?:)?//[a-z0-9-]+\.[a-z]", html, re.IGNORECASE) == []


def test_of_many_contacts_all_are_in_the_table_and_the_first_are_folded(many):
    page = Page(many)
    assert page.faults == []
    assert len(page.ids) == len(set(page.ids))
    assert len(many) < 8 * MEGABYTE
    folded = [found for tag, found in page.elements if tag == "details"]
    assert len(folded) == 12
    assert ["open" in found for found in folded] == [True] + 11 * [False]
    table = re.search(r'<table id="contacts-table".*?</table>', many, re.DOTALL)[0]
    assert table.count("<tr") == 1 + 43
    inside = {link.removeprefix("#") for link in page.links if link.startswith("#")}
    assert {f"c{i}-verdict" for i in range(1, 13)} <= inside <= set(page.ids)
    assert "The first 12 can be opened below." in " ".join(page.text)


@pytest.mark.parametrize("kind", [{}, {"turns": False}, {"conical": True}])
def test_what_the_analysis_answers_makes_a_page(kind):
    heard, _ = made.contact("real", 240, **kind)
    answer = analyse(heard, catalogue.lookup("rp-ekf"))
    page = Page(report(motion=TmaResult(contacts=(answer,))).html)
    assert page.faults == []
    assert ("The range cannot be told yet:" in page.text) is not answer.observable
    assert set(SECTIONS.split()) <= set(page.ids)


def test_text_from_the_file_cannot_leave_its_element(states):
    bad = "</script><script>alert(1)</script>"
    motion = states["known"]
    test = replace(motion.residuals.tests[0], name=bad, words=bad, passed=False)
    hostile = replace(
        motion,
        contact=replace(motion.contact, name=bad, remarks=(bad,)),
        residuals=replace(motion.residuals, tests=(test,)),
        settings={bad: bad},
        remarks=(bad,),
    )
    for every in ((hostile,), (hostile, hostile)):
        html = report(motion=TmaResult(contacts=every, remarks=(bad,))).html
        assert bad not in html
        assert Page(html).faults == []


def test_machines_read_the_same(states):
    facts = json.loads(embedded(page_of(states["no turn"]), "boresight-report"))["contacts"]
    assert facts[0]["observable"] is False
    assert facts[0]["range_m"]["estimate"] is None
    assert facts[0]["observability"]["range_sd_m"] is None
    known = json.loads(embedded(page_of(states["known"]), "boresight-report"))["contacts"][0]
    assert known["converged_s"] == 170.0
    assert known["range_m"]["estimate"] == states["known"].range_m.estimate


# ---- sentences ----


def test_each_state_is_said_in_plain_words(states):
    assert "<b>Range 12.81 ± 0.20 km</b>" in said(states["known"])
    assert "Good enough since 170 s" in said(states["known"])
    assert "own ship has not manoeuvred" in said(states["no turn"])
    assert "A turn of own ship would decide it." in said(states["no turn"])
    assert "own ship has manoeuvred, but" in said(states["too little"])
    assert "own ship has not" not in said(states["too little"])
    assert "but <b>not to the end</b>" in said(states["not for good"])
    assert "Never good enough" in said(states["no turn"])
    assert "Both sides of the array are possible" in said(states["sides"])
    assert "starboard with 56.0 %" in said(states["sides"])
    assert "at the last bearing" not in said(states["sides"])
    assert "The contact is to starboard</b> (probability 99.8 %)" in said(states["side decided"])
    assert "Only 3 bearings" in said(states["three"])
    assert "did not settle" in said(states["bare"])
    assert "4.51 to 5.49 km or 6.20 to 6.50 km" in said(states["in pieces"])
    assert "Neighbouring residuals go together" in said(states["known"])


@pytest.mark.parametrize("state", ["no turn", "too little", "sides", "three"])
def test_what_is_not_known_is_no_number(states, state):
    motion = states[state]
    html = page_of(motion)
    tiles = re.search(r'<dl class="tiles">.*?</dl>', html, re.DOTALL)[0]
    assert "<dt>range</dt><dd>–" in tiles
    assert "<dt>speed</dt><dd>–" in tiles
    assert named(picture(motion), "target") == []
    assert named(picture(motion), "batch estimate") == []
    middle = [trace for trace in panels(View(motion))[0].chart["data"] if "hovertemplate" in trace]
    drawn = {trace["yaxis"]: np.isfinite(unpack(trace["y"])).any() for trace in middle}
    assert drawn == {"y": False, "y2": True, "y3": False, "y4": False}


def test_a_batch_estimate_far_off_is_a_warning(states):
    apart = {
        each.link: each.mark for each in sentences(states["in pieces"]) if "26.0 sd" in each.html
    }
    assert apart == {"quantities": "attention"}


def test_of_a_filter_that_is_surer_than_it_can_be_nothing_is_repeated(states):
    motion = states["no turn"]
    assert "With what was believed before" in said(motion)
    sure = motion.history.with_columns(range_sd_m=0.4 * motion.history["range_bound_m"])
    words = said(replace(motion, history=sure))
    assert "With what was believed before" not in words
    assert "no better known" not in words


def test_what_speaks_against_the_answer_is_said_once(states):
    motion = states["known"]
    assert motion.residuals.tests[1].words == motion.remarks[1]
    assert page_of(motion).count("<p>" + motion.remarks[1]) == 1
    places = {each.html: each.link for each in sentences(motion) if each.mark == "attention"}
    assert places[motion.remarks[1]] == "residuals"
    assert places[motion.remarks[0]] == "history"
    listed = re.search(r"<h3>Remarks.*?</ul>", page_of(motion), re.DOTALL)[0]
    assert "a made contact" in listed
    assert not any(each in listed for each in motion.remarks)


def test_an_answer_before_the_bound_permits_it_is_no_merit(states):
    motion = states["known"]
    assert "surer than can be counted on" not in said(motion)
    early = replace(motion.convergence, permitted_s=180.0)
    assert "surer than can be counted on" in said(replace(motion, convergence=early))


def test_a_test_says_whether_it_was_asked_and_from_what_it_follows(states):
    first, second = states["known"].residuals.tests
    tests = (
        replace(first, passed=False, follows="compass"),
        replace(second, passed=True, asked=False, p_value=1.0),
        replace(first, name="compass", passed=False),
    )
    residuals = replace(states["known"].residuals, tests=tests)
    motion = replace(states["known"], residuals=residuals)
    rows = re.findall(r"<tr>(.*?)</tr>", tma_residuals.words(View(motion)))[1:]
    assert [re.search("failed|not asked|passed", row)[0] for row in rows] == [
        "failed",
        "not asked",
        "failed",
    ]
    assert "failed, as compass would explain" in rows[0]
    assert rows[1].count("–") == 2
    assert failures(motion) == ["compass"]
    assert "pass all" not in said(motion)
    good = replace(residuals, tests=(first, tests[1]))
    assert "pass all 1 tests" in said(replace(motion, residuals=good))


def test_a_file_of_contacts_is_summed_up():
    marks_and_words = [(each.mark, each.html) for each in summary(made.many(9))]
    assert marks_and_words[0][0] == "attention"
    assert "3 of the 9 contacts can be told" in marks_and_words[0][1]
    assert "while it heard 6 of them" in marks_and_words[0][1]
    assert "3 contacts both sides" in marks_and_words[2][1]
    assert "The residuals of 9 contacts" in marks_and_words[3][1]
    assert "whiteness 9" in marks_and_words[3][1]


def test_columns_of_which_no_contact_has_a_value_are_left_out():
    def heads(found):
        table = contacts(found, ())
        return re.findall(r'<button type="button">(.*?)</button>', table)

    every = made.many(3).contacts
    assert {"range", "course", "speed", "side", "good since"} <= set(heads(every))
    unknown = heads(every[1:2])
    assert "range, 90 %" in unknown
    assert not {"range", "course", "speed", "side", "good since"} & set(unknown)


# ---- figures ----


def test_figures_have_the_digits_that_they_are_worth():
    ninety = {"90": ((355.0, 364.0),), "99": ((0.0, 360.0),)}
    assert estimate(RANGE, Quantity(estimate=3705.2, sd=41.0)) == "3.71 ± 0.04 km"
    assert estimate(BEARING, Quantity(estimate=7.04, sd=0.2)) == "007.04 ± 0.20°"
    assert estimate(BEARING, Quantity(estimate=359.997, sd=0.2)) == "000.00 ± 0.20°"
    assert estimate(COURSE, Quantity(estimate=120.0, sd=60.0)) == "120 ± 60°"
    assert estimate(SPEED, Quantity(estimate=None, sd=None)) == "–"
    assert region(COURSE, Quantity(estimate=None, sd=None, regions=ninety)) == "355.0 to 004.0°"
    assert region(COURSE, Quantity(estimate=None, sd=None, regions=ninety), "99") == "any course"
    assert region(RANGE, Quantity(estimate=None, sd=None)) == ""
    assert estimate(RANGE, Quantity(estimate=33.2, sd=0.12)) == "33.20 ± 0.12 m"
    touching = {"90": ((1_100.0, 7_801.0), (7_802.0, 9_600.0)), "99": ((1.0, 20.0), (500.0, 900.0))}
    pieces = Quantity(estimate=None, sd=None, regions=touching)
    assert region(RANGE, pieces) == "1.1 to 9.6 km"
    assert region(RANGE, pieces, "99") == "1 to 20 m or 500 to 900 m"
    several = {"90": ((1e3, 2e3), (3e3, 4e3), (5e3, 6e3))}
    assert hull(RANGE, Quantity(estimate=None, sd=None, regions=several)) == (
        "1.0 to 6.0 km, in 3 pieces"
    )


def test_stretches_thinning_and_angles():
    assert stretches(np.array([True, True, False, True])) == [(0, 1), (3, 3)]
    assert stretches(np.array([False])) == []
    for count in (0, 1, 899, 900, 901, 5_000):
        kept = thinned(count)
        assert len(kept) <= 901
        assert count == 0 or kept[-1] == count - 1
    turned = unwrapped(np.array([350.0, np.nan, 10.0, 350.0]))
    assert turned[[0, 2, 3]] == pytest.approx([350.0, 370.0, 350.0])


# ---- charts ----


def test_the_region_lies_along_the_last_bearing(states):
    motion = states["in pieces"]
    (ninety,) = (
        each
        for each in named(picture(motion), "where it may be now")
        if each["hovertemplate"].startswith("where it may be now: 90")
    )
    east, north = (unpack(ninety[axis]).astype(float) for axis in "xy")
    own = motion.history.row(-1, named=True)
    away = np.hypot(east - own["own_east_m"] / 1e3, north - own["own_north_m"] / 1e3)
    pieces = [end / 1e3 for piece in motion.range_m.regions["90"] for end in piece]
    assert away[np.isfinite(away)] == pytest.approx(pieces, abs=2e-3)
    bearing = np.degrees(
        np.arctan2(east[0] - own["own_east_m"] / 1e3, north[0] - own["own_north_m"] / 1e3)
    )
    assert bearing % 360 == pytest.approx(motion.bearing_deg.estimate, abs=0.05)


def test_both_sides_have_their_region_until_one_is_decided(states):
    names = {trace.get("name") for trace in picture(states["sides"])["data"]}
    assert {"starboard, 56 %", "port, 44 %"} <= names
    names = {trace.get("name") for trace in picture(states["side decided"])["data"]}
    assert not any(name and name.startswith("port") for name in names)
    assert {"target", "batch estimate", "where it may be now"} <= names


def test_tracks_that_fit_end_where_the_cells_that_are_left_have_the_target(states):
    motion = states["no turn"]
    weights = np.array([[0.005, 0.2, 0.3, 0.3, 0.1, 0.095]])  # the last has no mean
    motion = replace(motion, cells=replace(motion.cells, weights=weights))
    (tracks,) = named(picture(motion), tma_picture.FITTING)
    north, east = (unpack(tracks[axis]).astype(float).reshape(-1, 3) for axis in "yx")
    mean = motion.cells.mean[1:5]
    now = np.stack([north[:, 1], east[:, 1]], axis=-1)
    assert now == pytest.approx(mean[:, :2] / 1e3, rel=1e-4)
    moving = replace(motion.cells, mean=motion.cells.mean + np.array([0.0, 0.0, 3.0, -2.0]))
    (tracks,) = named(picture(replace(motion, cells=moving)), tma_picture.FITTING)
    north, east = (unpack(tracks[axis]).astype(float).reshape(-1, 3) for axis in "yx")
    assert north[:, 1] - north[:, 0] == pytest.approx(2.4, abs=1e-3)
    assert east[:, 1] - east[:, 0] == pytest.approx(-1.6, abs=1e-3)
    assert named(picture(states["known"]), tma_picture.FITTING) == []


def test_bearings_end_at_the_track_and_the_grid_is_square(states):
    motion = states["known"]
    chart = picture(motion)
    (heard,) = named(chart, "bearings")
    east, north = (unpack(heard[axis]).astype(float).reshape(-1, 3) for axis in "xy")
    length = np.hypot(east[:, 1] - east[:, 0], north[:, 1] - north[:, 0])
    time = motion.history["time_s"].to_numpy()
    at = thinned(len(time), tma_picture.LINES)
    back = time[-1] - time
    away = motion.mean[:2] - back[:, None] * motion.mean[2:] - motion.contact.position_m
    away = np.hypot(*away.T)[np.isfinite(motion.contact.bearing_rad)] / 1e3
    assert len(length) <= len(at) + 1
    assert length.min() == pytest.approx(1.04 * away.min(), rel=0.2)
    assert length.max() == pytest.approx(1.04 * away.max(), rel=0.2)
    steps = {chart["layout"][axis]["dtick"] for axis in ("xaxis", "yaxis")}
    assert len(steps) == 1
    assert 2.0 in steps


def test_of_a_cone_on_a_side_the_other_is_not_drawn(states):
    (both,) = named(picture(states["sides"]), "bearings")
    (one,) = named(picture(states["side decided"]), "bearings")
    assert len(unpack(both["x"])) == pytest.approx(2 * len(unpack(one["x"])), abs=6)


def test_a_cone_is_drawn_on_both_sides_of_the_axis(states):
    contact = states["sides"].contact
    right, left = tma_picture.sides_heard(View(states["sides"]))
    axis = np.degrees(contact.axis_rad)
    known = np.isfinite(right)
    assert known.sum() == states["sides"].bearings
    assert (right + left)[known] == pytest.approx(2 * axis[known])
    assert np.all((right - axis)[known] >= 0)


def test_the_ellipse_at_the_end_is_two_sd_of_the_covariance(states):
    motion = states["known"]
    (ellipses,) = named(picture(motion), "two sd")
    north = unpack(ellipses["y"]).astype(float).reshape(-1, 42)[-1, :-1]
    east = unpack(ellipses["x"]).astype(float).reshape(-1, 42)[-1, :-1]
    sd = np.sqrt(np.diag(motion.cov)[:2]) / 1e3
    assert np.ptp(north) == pytest.approx(4 * sd[0], rel=0.01)
    assert np.ptp(east) == pytest.approx(4 * sd[1], rel=0.02)


def test_what_the_criteria_allow_is_the_sd_of_a_normal_error(states):
    view = View(states["known"])
    for kind, limit in ((BEARING, 0.5), (COURSE, 5.0)):
        sd = allowed(view, kind)[0]
        assert stats.norm.cdf(limit, 0, sd) - stats.norm.cdf(-limit, 0, sd) == pytest.approx(0.9)


def test_the_time_without_knowledge_is_shaded_and_the_times_are_marked(states):
    shapes, words = marks(View(states["known"]))
    (shade,) = [each for each in shapes if each["type"] == "rect"]
    assert (shade["x0"], shade["x1"]) == (0.0, 150.0)
    assert sorted(each["x0"] for each in shapes if each["type"] == "line") == [145.0, 170.0]
    assert [each["text"] for each in words] == [
        "range not told by the bearings",
        "good enough since 170 s",
    ]


def test_the_waterfall_is_cut_where_nothing_was_heard():
    # A contact that passes North: its bearings must not be torn apart at 0 and 360 degrees.
    motion = made.motion(turns=False, start=(8_000.0, 1_500.0))
    deg = np.degrees(motion.contact.bearing_rad) % 360
    assert np.nanmax(deg) - np.nanmin(deg) > 300
    chart = tma_waterfall.panel([View(motion)]).chart
    heard = next(each for each in chart["data"] if each["mode"] == "markers")
    assert np.nanmax(unpack(heard["x"])) - np.nanmin(unpack(heard["x"])) < 200
    assert chart["layout"]["yaxis"]["autorange"] == "reversed"
    axis = chart["layout"]["xaxis"]
    assert all(0 <= float(word) < 360 for word in axis["ticktext"])
    assert float(axis["ticktext"][0]) == axis["tickvals"][0] % 360


def test_true_bearings_have_their_width_for_themselves(states):
    chart = tma_waterfall.panel([View(states["known"])]).chart
    (heading,) = named(chart, "own ship's heading")
    assert heading["xaxis"] == "x2"
    x = unpack(heading["x"])
    assert (np.nanmax(x), np.nanmin(x)) == pytest.approx((90.0, -90.0), abs=0.1)
    low, high = chart["layout"]["xaxis"]["range"]
    deg = np.degrees(states["known"].contact.bearing_rad) % 360
    assert high - low < 1.1 * np.ptp(deg[np.isfinite(deg)]) + 4
    cone = tma_waterfall.panel([View(states["sides"])]).chart
    assert "xaxis2" not in cone["layout"]


def test_quantiles_of_noise_as_stated_lie_in_the_band(states):
    def outside(factor):
        motion = states["known"]
        noise = np.random.default_rng(1).standard_normal(len(motion.residuals.deg))
        deg = factor * np.degrees(motion.contact.sigma_rad) * noise
        residuals = replace(motion.residuals, deg=deg)
        _, law = tma_residuals.panels(View(replace(motion, residuals=residuals)))
        low, high, _, drawn = law.chart["data"]
        y = unpack(drawn["y"])
        return np.mean((y < unpack(low["y"])) | (y > unpack(high["y"])))

    # Neighbouring quantiles go together: of 300 seeds, 2 % had a share above 0.4 of good noise, and
    # none one below 0.5 of noise that is 1.3 times as large.
    assert outside(1.0) < 0.4
    assert outside(1.3) > 0.5


# ---- drawn, in a browser without a network ----


@pytest.fixture(scope="module")
def browser():
    yield from running_browser()


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("state", ["known", "sides", "three", "many"])
def test_the_page_draws_itself_from_the_file_alone(browser, tmp_path, states, state):
    result = made.many(14) if state == "many" else TmaResult(contacts=(states[state],))
    path = report(motion=result).save(tmp_path / "report.html")
    context = browser.new_context(offline=True, viewport={"width": 700, "height": 900})
    page, errors = context.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-drawn]", state="attached", timeout=60_000)
    assert page.evaluate("document.documentElement.dataset.drawn") == "true"
    assert page.locator("details:not([open]) .main-svg").count() == 0
    page.evaluate("for (const each of document.querySelectorAll('details')) each.open = true")
    page.wait_for_function(
        "[...document.querySelectorAll('.chart')].every((each) => each.querySelector('.main-svg'))",
        timeout=60_000,
    )
    assert errors == []
    assert page.evaluate("document.documentElement.scrollWidth") <= 700
    context.close()
