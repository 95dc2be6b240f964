"""Inputs that are wrong, poor or unusual: one error that names the fault, or a remark that does."""

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from importlib.resources import as_file, files
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

import boresight as bs
from boresight.calibration.pairing import pair
from boresight.calibration.references import from_table
from boresight.errors import DataError, UsageError
from boresight.formats.recording import read_recording
from boresight.interfaces import cli
from boresight.maths.frames import Site

PLACE = (47.8125, 1.40625, 180.0)
SITE = Site(latitude_deg=PLACE[0], longitude_deg=PLACE[1], height_m=PLACE[2])
IDENTITY = ["address", "mode_a", "aircraft_id", "radar_track"]
DAY_S = 86_400.0


def boresight(*arguments):
    """What a command line gives, in this process: exit code, output, errors."""
    out, error = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(error):
        code = cli.run([str(each) for each in arguments])
    assert "Traceback" not in error.getvalue()
    return SimpleNamespace(code=code, out=out.getvalue(), error=error.getvalue())


@pytest.fixture(scope="module")
def demo():
    """The recording in the package: plots and ADS-B as frames, and its path."""
    with as_file(files("boresight") / "demo" / "recording.ast") as path:
        read = read_recording(path)
        yield SimpleNamespace(plots=read.plots, reports=read.reference, path=path)


@pytest.fixture(scope="module")
def folder(demo, tmp_path_factory):
    """A calibration of it, written by the command."""
    folder = tmp_path_factory.mktemp("calibrated")
    done = boresight("calibrate", demo.path, "--reference", "adsb", "-o", folder, "--quiet")
    assert done.code == 0, done.error
    return folder


def paired(plots, reports, **options):
    return pair(plots, from_table(reports), SITE, **options)


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("range_m", "-5.0", "range_m is -5.0"),
        ("azimuth_deg", "200.0", "more than half a turn"),
        ("target_range_m", "-3.0", "target_range_m is -3.0"),
        ("outlier_share", "7.0", "outlier_share is 7.0"),
        ("sd", "-2.0", "negative"),
        ("sd", "nan", "not a number"),
        ("sd", '"much"', "terms.range_bias_m.sd"),
        ("latitude_deg", "95.0", "not a place on Earth"),
        ("pairs", "-4", "pairs"),
        ("atmosphere", '"vacuum"', "vacuum"),
        ("version", '"1"', "'1', not 1"),
    ],
)
def test_a_number_that_cannot_be_is_named_with_the_file(folder, tmp_path, key, value, why):
    lines = (folder / "calibration.toml").read_text().splitlines()
    place = next(i for i, line in enumerate(lines) if line.startswith(f"{key} = "))
    lines[place] = f"{key} = {value}"
    wrong = tmp_path / "edited.toml"
    wrong.write_text("\n".join(lines))
    with pytest.raises(DataError, match=r"edited\.toml is not a calibration") as caught:
        bs.read_calibration(wrong)
    assert why in caught.value.why


def edited(folder, tmp_path, change):
    import tomllib

    import tomli_w

    document = tomllib.loads((folder / "calibration.toml").read_text())
    change(document)
    path = tmp_path / "edited.toml"
    path.write_text(tomli_w.dumps(document))
    return path


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["covariance"]["rows"][5].__setitem__(5, -1e-12),
        lambda d: d["covariance"]["rows"][5].__setitem__(4, 1.0),
        lambda d: d["covariance"].update(terms=[], rows=[]),
        lambda d: d["covariance"].update(terms=["range_bias_m"], rows=[[4.0]]),
        lambda d: d["covariance"]["terms"].__setitem__(1, "range_bias_m"),
        lambda d: d["terms"].update(other=dict(d["terms"]["range_bias_m"])),
    ],
)
def test_a_covariance_that_is_none_of_these_terms_is_refused(folder, tmp_path, change):
    path = edited(folder, tmp_path, change)
    with pytest.raises(DataError, match="not a calibration"):
        bs.read_calibration(path)


def test_a_file_that_is_not_text_is_no_calibration(demo):
    done = boresight("track", demo.path, "--calibration", demo.path)
    assert done.code == 65
    assert "it is not text" in done.error


def test_a_calibration_read_from_its_file_can_be_tracked_with_and_reported_on(demo, folder):
    path = folder / "calibration.toml"
    found = bs.read_calibration(path)
    assert "Residuals before and after" not in bs.report(found).html
    some = demo.plots.filter(pl.col("address") == demo.reports["address"][0])
    by_path = bs.track(some, calibration=path, site=PLACE)
    assert by_path.tracks.equals(bs.track(some, calibration=found, site=PLACE).tracks)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"reference": 5}, "the reference is a int"),
        ({"reference": "adsb", "site": (1, 2)}, "is not three numbers"),
        ({"reference": "adsb", "gate_m": "wide"}, "gate_m"),
        ({"reference": "adsb", "sensor": "3/3"}, "no plot is from sensor '3/3'"),
        ({"reference": "adsb", "atmosphere": "vacuum"}, "vacuum"),
        ({"plots": 5, "reference": "adsb"}, "the plots are a int"),
    ],
)
def test_a_wrong_call_is_one_error(demo, wrong, said):
    with pytest.raises(UsageError, match=said):
        bs.calibrate(**({"plots": demo.path} | wrong))
    with pytest.raises(UsageError, match="a dict"):
        bs.track(demo.plots, calibration={})
    with pytest.raises(UsageError, match="a dict"):
        bs.report({})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda plots: plots.drop("range_m"), "no column 'range_m'"),
        (lambda plots: plots.with_columns(pl.col("range_m").cast(str)), "'range_m' holds String"),
        (lambda plots: plots.head(0), "there are no plots"),
    ],
)
def test_a_frame_that_holds_no_plots_is_one_error(demo, change, said):
    with pytest.raises(DataError, match=said):
        bs.calibrate(change(demo.plots), reference=demo.reports, site=PLACE)


def test_terms_and_air_may_be_given_as_text(demo):
    found = bs.calibrate(
        demo.path, reference="adsb", terms="range,azimuth", atmosphere="exponential"
    )
    assert set(found.terms) == {"range_bias_m", "azimuth_bias_deg"}
    assert found.atmosphere == "exponential"


@pytest.mark.parametrize("plots", [1, 2, 5])
def test_fewer_pairs_than_terms_are_refused_with_the_reasons(demo, plots):
    one = demo.plots.filter(pl.col("address") == "F00028")[10 : 10 + plots]
    with pytest.raises(DataError, match="too few") as caught:
        bs.calibrate(one, reference=demo.reports, site=PLACE)
    assert caught.value.exit_code == 65


def test_one_target_has_no_interval_and_no_standard_deviation_to_be_taken_for_one(demo, tmp_path):
    one = demo.plots.filter(pl.col("address") == "F00028")
    one.write_parquet(tmp_path / "one.parquet")
    demo.reports.write_parquet(tmp_path / "adsb.parquet")
    ask = ("calibrate", tmp_path / "one.parquet", "--reference", tmp_path / "adsb.parquet")
    ask += ("--site", ",".join(map(str, PLACE)))
    done = boresight(*ask, "-o", tmp_path)
    assert done.code == 0, done.error
    assert "of 1 target\n" in done.out
    assert "too few targets" in done.out
    assert "inf" not in done.out
    terms = json.loads(boresight(*ask, "--json").out)["terms"]
    assert {tuple(each["ci95"]) for each in terms.values()} == {(None, None)}
    kept = bs.read_calibration(tmp_path / "calibration.toml").terms
    assert all(np.isinf(each.ci95).all() for each in kept.values())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"azimuth_deg": -pl.col("azimuth_deg") % 360.0}, "counted against the clock"),
        ({"azimuth_deg": (90.0 - pl.col("azimuth_deg")) % 360.0}, "from east, against the clock"),
        ({"azimuth_deg": (pl.col("azimuth_deg") - 90.0) % 360.0}, "from east, not from north"),
        ({"azimuth_deg": (pl.col("azimuth_deg") + 180.0) % 360.0}, "from south"),
        ({"time_s": pl.col("time_s") - 5.5 * 3600.0}, "19800 s ahead"),
        ({"time_s": pl.col("time_s") - 120.0}, "plots are anywhere near"),
    ],
)
def test_a_wrong_sense_or_clock_of_the_plots_is_named(demo, change, said):
    with pytest.raises(DataError, match=said):
        paired(demo.plots.with_columns(**change), demo.reports)


@pytest.mark.parametrize(
    ("latitude", "longitude", "said"),
    [
        (PLACE[0], -PLACE[1], "longitude of the site has the wrong sign"),
        (-PLACE[0], PLACE[1], "latitude of the site has the wrong sign"),
        (PLACE[1], PLACE[0], "latitude and longitude of the site are exchanged"),
    ],
)
def test_a_wrong_site_is_named(demo, latitude, longitude, said):
    site = Site(latitude_deg=latitude, longitude_deg=longitude, height_m=180.0)
    with pytest.raises(DataError, match=said):
        pair(demo.plots, from_table(demo.reports), site)


def test_a_reference_in_radians_is_named(demo):
    places = demo.reports.with_columns(pl.col("latitude_deg", "longitude_deg").radians())
    with pytest.raises(DataError, match="of the reference are in radians"):
        paired(demo.plots, places)


@pytest.mark.parametrize("order", ["as recorded", "by target", "by time of day"])
@pytest.mark.parametrize("first_s", [43_201.0, 43_649.0, 44_099.0])
def test_midnight_inside_a_reference_loses_no_pair(demo, order, first_s):
    # Some aircraft are heard only after midnight: nothing of theirs steps back.
    shift = DAY_S - first_s
    reports = demo.reports.with_columns((pl.col("time_s") + shift) % DAY_S)
    if order != "as recorded":
        by = "address" if order == "by target" else "time_s"
        reports = reports.sort(by, maintain_order=True)
    found = paired(demo.plots.with_columns(pl.col("time_s") + shift), reports)
    plain = paired(demo.plots, demo.reports)
    assert np.array_equal(found.pairs.row, plain.pairs.row)
    assert np.array_equal(found.pairs.position, plain.pairs.position)
    assert any("start again at midnight" in remark for remark in found.remarks) or any(
        "start again at midnight" in remark for remark in from_table(reports).remarks
    )


def test_a_gate_that_cuts_plots_off_is_said(demo):
    nameless = demo.plots.drop(IDENTITY)
    narrow = paired(nameless, demo.reports, gate_m=60.0).remarks
    wide = paired(nameless, demo.reports, gate_m=1_000.0).remarks
    assert any("cuts off plots that err more" in remark for remark in narrow)
    assert not any("cuts off" in remark for remark in wide)


def test_a_gate_that_nobody_needs_is_said(demo):
    found = bs.calibrate(demo.path, reference="adsb", gate_m=300.0)
    assert any("The gate was not used" in remark for remark in found.remarks)


def test_plots_that_are_there_twice_are_counted_and_said(demo):
    twice = pl.concat([demo.plots, demo.plots]).sort("time_s", maintain_order=True)
    found, plain = paired(twice, demo.reports), paired(demo.plots, demo.reports)
    assert len(found.pairs) == len(plain.pairs)
    coasted = plain.dropped["coasted"]
    assert found.dropped["repeated"] == demo.plots.height - coasted
    assert any(
        remark.startswith(f"{found.dropped['repeated']:,} plots") for remark in found.remarks
    )


def test_damage_of_plots_and_of_a_reference_is_said(demo, tmp_path):
    whole = demo.path.read_bytes()
    cut = tmp_path / "cut.ast"
    cut.write_bytes(whole[: len(whole) // 2] + b"\xff" * 300)
    for plots, reference in ((cut, demo.path), (demo.path, cut)):
        done = boresight("calibrate", plots, "--reference", reference, "--json")
        assert done.code == 0, done.error
        remarks = json.loads(done.out)["remarks"]
        assert any("of cut.ast were skipped as damaged" in remark for remark in remarks)


def test_measured_elevation_gives_its_bias(demo):
    found = paired(demo.plots, demo.reports).pairs
    true = np.degrees(np.arcsin(found.position[:, 2] / np.linalg.norm(found.position, axis=1)))
    noise = np.random.default_rng(3).normal(0.0, 0.1, len(true))
    measured = np.full(demo.plots.height, np.nan)
    measured[found.row] = true + 0.3 + noise
    plots = demo.plots.with_columns(elevation_deg=measured)
    said = bs.calibrate(plots, reference=demo.reports, site=PLACE)
    term = said.terms["elevation_bias_deg"]
    assert term.observable
    assert abs(term.estimate - 0.3) < 4.0 * 0.1 / np.sqrt(len(true))  # four sd: 1 in 16,000
    assert said.noise.elevation_deg == pytest.approx(0.1, rel=0.1)


def test_the_page_of_one_target_draws_nothing_from_what_was_believed_before(demo):
    one = demo.plots.filter(pl.col("address") == "F00028")
    found = bs.calibrate(one, reference=demo.reports, site=PLACE)
    page = bs.report(found).html
    assert "times narrower" not in page
    assert "within the 95 % interval" not in page
    assert "Correlation of the estimates" not in page
    assert "no interval: too few targets" in page


def test_a_reference_in_anothers_names_is_read_by_a_map_of_its_columns(demo, tmp_path):
    theirs = {"time_s": "t", "latitude_deg": "lat", "longitude_deg": "lon"}
    demo.reports.rename(theirs).write_parquet(tmp_path / "gps.parquet")
    ask = ("calibrate", demo.path, "--reference", tmp_path / "gps.parquet", "--json")
    missing = boresight(*ask)
    assert missing.code == 65
    assert "has no column time_s" in missing.error
    asked = ",".join(f"{ours}={their}" for ours, their in theirs.items())
    named = boresight(*ask, "--reference-columns", asked)
    assert named.code == 0, named.error
    assert json.loads(named.out)["pairs"] == len(paired(demo.plots, demo.reports).pairs)
    wrong = boresight(*ask, "--reference-columns", "t")
    assert wrong.code == 2
    assert "--reference-columns 't'" in wrong.error


def test_noise_against_downlink_is_not_that_of_plots_and_is_not_tracked_with(demo, folder):
    found = bs.read_calibration(folder / "calibration.toml")
    by_downlink = replace(found, reference="downlink")
    some = demo.plots.filter(pl.col("address").is_in(demo.reports["address"].unique().implode()))
    plain = bs.track(some, calibration=found, site=PLACE)
    other = bs.track(some, calibration=by_downlink, site=PLACE)
    assert plain.settings["noise"]["range_m"] == found.noise.range_m
    assert other.settings["noise"]["range_m"] != found.noise.range_m
    assert any("only what changes from plot to plot" in remark for remark in other.remarks)
