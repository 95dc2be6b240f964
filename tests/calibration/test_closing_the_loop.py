"""A calibration of the first half, taken out of the second: nothing is left that shows itself."""

from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from boresight.calibration import references
from boresight.calibration.calibrate import calibrate
from boresight.calibration.correcting import correct
from boresight.formats.recording import read_recording
from boresight.maths import frames
from boresight.maths.frames import Site
from boresight.models.atmosphere import ExponentialAtmosphere

SAENZ = Path(__file__).parents[3] / "shared" / "data" / "saenz-pena"


@pytest.fixture(scope="module")
def demo():
    """Plots, reference, site and air of the recording in the package."""
    with as_file(files("boresight") / "demo" / "recording.ast") as path:
        read = read_recording(path)
    site = Site(latitude_deg=47.8125, longitude_deg=1.40625, height_m=180.0)
    adsb = references.from_recording(read, "adsb")
    return read.plots, adsb, site, ExponentialAtmosphere()


@pytest.fixture(scope="module")
def saenz():
    if not SAENZ.is_dir():
        pytest.skip("the shared recordings are not here")
    plots = read_recording(SAENZ / "plots-cat048.pcap").plots
    tracks = references.from_file(SAENZ / "system-tracks-cat062.pcap")
    heard = plots.filter(
        pl.col("time_s").is_between(tracks.table["time_s"].min(), tracks.table["time_s"].max())
    )
    return heard, tracks, Site(latitude_deg=-26.750555, longitude_deg=-60.481666, height_m=90), None


@pytest.mark.parametrize("recording", ["demo", "saenz"])
def test_corrected_plots_of_the_other_half_have_no_errors_left(recording, request):
    """Beyond the two calibrations' intervals together lies a term once in twenty by chance."""
    plots, reference, site, air = request.getfixturevalue(recording)
    half = plots["time_s"].median()
    first = calibrate(plots.filter(pl.col("time_s") < half), reference, site, atmosphere=air)
    rest = correct(plots.filter(pl.col("time_s") >= half), first)
    again = calibrate(rest, reference, site, atmosphere=air)
    inside = [
        abs(term.estimate)
        <= np.hypot(np.diff(term.ci95)[0] / 2, np.diff(first.terms[name].ci95)[0] / 2)
        for name, term in again.terms.items()
    ]
    assert sum(inside) >= len(inside) - 1
    shown = [name for name, term in first.terms.items() if term.ci95[0] > 0 or term.ci95[1] < 0]
    assert "azimuth_bias_deg" in shown
    azimuth, before = again.terms["azimuth_bias_deg"], first.terms["azimuth_bias_deg"]
    assert abs(azimuth.estimate) < 0.2 * abs(before.estimate)


def test_corrected_plots_are_those_measured_less_the_errors(demo):
    plots, reference, site, air = demo
    found = calibrate(plots, reference, site, atmosphere=air)
    clean = correct(plots, found)
    assert clean.columns == plots.columns
    value = found.errors.value
    moved = plots.select(pl.col("time_s", "range_m", "azimuth_deg")) - clean.select(
        "time_s", "range_m", "azimuth_deg"
    )
    known = plots["range_m"].is_finite().fill_null(value=False)
    np.testing.assert_allclose(moved["time_s"], value("time_bias_s"), atol=1e-9)
    gain = value("range_gain_m_per_km") / 1000
    expected = value("range_bias_m") + gain * clean["range_m"].filter(known)
    np.testing.assert_allclose(moved["range_m"].filter(known), expected, rtol=1e-9)
    true = np.radians(clean["azimuth_deg"].filter(known).to_numpy())
    error = value("azimuth_bias_deg") + value("azimuth_cos_deg") * np.cos(true)
    error += value("azimuth_sin_deg") * np.sin(true)
    wrapped = (moved["azimuth_deg"].filter(known).to_numpy() + 180) % 360 - 180
    np.testing.assert_allclose(wrapped, error, atol=1e-9)


def test_other_sensors_stay_as_they_are(demo):
    plots, reference, site, air = demo
    found = calibrate(plots, reference, site, atmosphere=air)
    other = plots.with_columns(sensor=pl.lit("9/9"))
    both = correct(pl.concat([plots, other]), found)
    assert both.tail(other.height).equals(other)
    assert not both.head(plots.height).equals(plots)


def test_a_site_kilometres_off_is_doubted_and_found_when_it_is_asked_for(demo):
    """Whole targets then are outliers, which must not make weights of nothing."""
    plots, reference, site, air = demo
    wrong = replace(site, latitude_deg=site.latitude_deg + 0.0275)
    found = calibrate(plots, reference, wrong, atmosphere=air)
    assert any("a wrong site" in remark for remark in found.remarks)
    terms = ("range_bias_m", "azimuth_bias_deg", "time_bias_s", "site_east_m", "site_north_m")
    moved = calibrate(plots, reference, wrong, atmosphere=air, terms=terms)
    east, north, _ = frames.enu_from_geodetic(
        site.latitude_deg, site.longitude_deg, site.height_m, wrong
    )
    assert moved.terms["site_north_m"].estimate == pytest.approx(north, abs=30)
    assert moved.terms["site_east_m"].estimate == pytest.approx(east, abs=30)
    assert not any("a wrong site" in remark for remark in moved.remarks)


def test_what_shows_may_be_of_terms_that_were_left_out(demo):
    """85 m of range that nobody estimates: all targets err, and traffic changes with time."""
    plots, reference, site, air = demo
    told = "may be of errors that were not estimated: range bias"
    alone = calibrate(plots, reference, site, atmosphere=air, terms=("azimuth_bias_deg",))
    assert any("beyond chance" in remark for remark in alone.remarks)
    assert any(told in remark for remark in alone.remarks)
    assert not any(told in r for r in calibrate(plots, reference, site, atmosphere=air).remarks)
