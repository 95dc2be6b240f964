"""An hour of a real airport radar, held against what its aircraft say of themselves."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from boresight.catalogue import lookup
from boresight.formats.recording import read_recording
from boresight.maths.frames import Site
from boresight.tracking.tracker import track

FILE = Path(__file__).parents[3] / "shared/data/barcelona-60nm/plots-cat048.ast"
SITE = Site(latitude_deg=41.3007023, longitude_deg=2.1020582, height_m=27.26)
pytestmark = pytest.mark.skipif(
    not FILE.exists(), reason="the Barcelona recording is not beside this checkout"
)


@pytest.fixture(scope="module")
def plots():
    return read_recording(FILE).plots


@pytest.fixture(scope="module", params=["ekf", "mekf"])
def result(request, plots):
    return track(plots, filter=lookup(request.param), site=SITE)


def test_the_coasted_reports_are_not_used(result):
    assert dict(result.skipped.select("reason", "count").iter_rows())["coasted"] == 172


def test_every_plot_is_accounted_for(result):
    assert result.used + result.skipped["count"].sum() == result.plots == 44_085


def test_each_track_is_one_address(result):
    addresses = result.tracks.group_by("track").agg(pl.col("address").n_unique())
    assert addresses["address"].max() == 1


def test_ground_speed_agrees_with_the_downlinked_one_which_the_filter_never_saw(result, plots):
    # The measurement of the filter is range, azimuth and pressure altitude; BDS 5,0 is held out.
    said = plots.select("address", "time_s", "ground_speed_mps").unique(["address", "time_s"])
    late = result.tracks.filter(pl.int_range(pl.len()).over("track") >= 8)
    pairs = late.join(said, on=["address", "time_s"]).filter(
        pl.col("ground_speed_mps").is_not_null() & pl.col("ground_speed_mps").is_not_nan()
    )
    speed = np.hypot(pairs["east_mps"], pairs["north_mps"])
    difference = (speed - pairs["ground_speed_mps"]).abs()
    assert len(difference) > 9_000
    assert difference.median() <= 1.0
    assert difference.quantile(0.95) <= 4.0


def test_nis_in_straight_flight_holds_in_the_half_it_was_not_chosen_on(result):
    held_out = result.nis["straight_second_half"]
    assert held_out["scans"] > 10_000
    assert 0.8 <= held_out["mean"] <= 1.25
    assert np.isfinite(held_out["median"])


def test_the_fixed_transponder_shows_the_radars_own_noise(result):
    fixed = result.targets.filter(pl.col("address") == "344045").row(0, named=True)
    assert fixed["fixed"]
    assert fixed["range_sd_m"] == pytest.approx(0.86, rel=0.05)
    assert fixed["azimuth_sd_deg"] == pytest.approx(0.0116, rel=0.05)


def test_over_turns_the_report_says_that_the_filter_is_not_consistent(result):
    assert result.nis["all"]["mean"] > 1.25
    assert any("cannot be consistent in turns" in remark for remark in result.remarks)
