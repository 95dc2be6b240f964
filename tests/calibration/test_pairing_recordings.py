"""Pairs of real recordings: an en-route radar under system tracks, a surface radar under ADS-B."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from boresight.calibration.pairing import pair
from boresight.calibration.references import from_file
from boresight.errors import DataError
from boresight.formats.recording import read_recording
from boresight.maths.frames import Site

DATA = Path(__file__).parents[3] / "shared/data"
EN_ROUTE = DATA / "saenz-pena"
SURFACE = DATA / "barcelona-surface"
EN_ROUTE_SITE = Site(latitude_deg=-26.750555, longitude_deg=-60.481666, height_m=90.0)
SURFACE_SITE = Site(latitude_deg=41.29561833, longitude_deg=2.09511417, height_m=55.0)
pytestmark = pytest.mark.skipif(
    not DATA.exists(), reason="the shared recordings are not beside this checkout"
)


@pytest.fixture(scope="module")
def en_route():
    plots = read_recording(EN_ROUTE / "plots-cat048.pcap").plots
    return plots, from_file(EN_ROUTE / "system-tracks-cat062.pcap")


@pytest.fixture(scope="module")
def surface():
    return read_recording(SURFACE / "smr.ast").plots, from_file(SURFACE / "adsb.ast")


def test_the_en_route_radar_pairs_by_code_and_no_pair_is_of_the_wrong_aircraft(en_route):
    plots, reference = en_route
    found = pair(plots, reference, EN_ROUTE_SITE)
    assert found.how == "identity"
    assert reference.kind == "system tracks"
    assert len(found.pairs.names) == 12  # the codes that an analysis of its own found, too
    assert len(found.pairs) + sum(found.dropped.values()) == plots.height
    off = np.abs(found.pairs.residuals())
    assert off[:, 0].max() < 1_500.0
    assert np.degrees(off[:, 1].max()) < 1.5


def test_the_garbled_codes_of_the_en_route_radar_are_not_used(en_route):
    plots, reference = en_route
    found = pair(plots, reference, EN_ROUTE_SITE)
    garbled = plots.select((pl.col("mode_a_valid") == False).sum()).item()  # noqa: E712 - null too
    assert found.dropped["garbled code"] == garbled == 97


def test_no_plot_lies_between_reports_of_two_system_tracks(en_route):
    plots, reference = en_route
    found = pair(plots, reference, EN_ROUTE_SITE)
    table = reference.table
    for code in found.pairs.names:
        mine = table.filter(pl.col("mode_a") == code)
        own = [found.pairs.names.index(code)]
        for time in found.pairs.time_s[np.isin(found.pairs.target, own)][::20]:
            around = mine.filter((pl.col("time_s") - time).abs() <= reference.longest_gap_s)
            sides = around.group_by("target").agg(
                before=(pl.col("time_s") <= time).any(), after=(pl.col("time_s") >= time).any()
            )
            assert sides.filter("before", "after").height == 1


def test_midnight_changes_nothing_of_the_en_route_pairs(en_route):
    from dataclasses import replace

    plots, reference = en_route
    plain = pair(plots, reference, EN_ROUTE_SITE).pairs
    shift = 86_400.0 - 61_000.0  # before the reference begins: it counts from the next day
    late = plots.with_columns(pl.col("time_s") + shift)
    table = reference.table.with_columns(pl.col("time_s") + shift - 86_400.0)
    over = pair(late, replace(reference, table=table), EN_ROUTE_SITE).pairs
    for name in ("row", "z", "position", "velocity"):
        assert np.array_equal(getattr(over, name), getattr(plain, name))


def test_the_surface_radar_pairs_by_position(surface):
    plots, reference = surface
    found = pair(plots, reference, SURFACE_SITE)
    assert found.how == "position"
    assert len(found.pairs) + sum(found.dropped.values()) == plots.height
    place = found.pairs.z[:, 0] * np.exp(1j * found.pairs.z[:, 1])
    expected = found.pairs.expected()
    apart = np.abs(place - expected[:, 0] * np.exp(1j * expected[:, 1]))
    assert apart.max() < 65.0  # the gate, and what a curve and a height differ from a straight line
    tracks = pl.DataFrame({"track": plots["radar_track"][found.pairs.row], "t": found.pairs.target})
    assert tracks.unique()["track"].is_unique().all()


def test_an_hour_off_is_named_on_the_surface_and_en_route(en_route, surface):
    from dataclasses import replace

    for (plots, reference), site in ((en_route, EN_ROUTE_SITE), (surface, SURFACE_SITE)):
        table = reference.table.with_columns(pl.col("time_s") + 3_600.0)
        with pytest.raises(DataError, match="3600 s ahead"):
            pair(plots, replace(reference, table=table), site)
