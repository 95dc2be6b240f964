"""Tracks with a calibration: plots corrected by it, and what it leaves uncertain in the covariance.

Statistical tests use fixed seeds and say how often they would fail by chance.
"""

import json
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.special import stdtrit

from boresight.calibration.pairing import pair
from boresight.calibration.references import from_recording
from boresight.calibration.registration import register
from boresight.catalogue import lookup
from boresight.experiments.demo import shipped
from boresight.formats.recording import read_recording
from boresight.formats.usable import one_sensor
from boresight.maths.frames import Site, enu_from_geodetic
from boresight.models.atmosphere import ExponentialAtmosphere
from boresight.models.systematic import SystematicErrors
from boresight.tracking.beside import clustered
from boresight.tracking.corrections import carried
from boresight.tracking.noise import Noise
from boresight.tracking.tracker import track

DATA = Path(__file__).parents[3] / "shared/data/saenz-pena"
KNOWN = Noise(range_m=20.0, azimuth_deg=0.05, altitude_m=2.2, accel_mps2=0.002)
SIX = (
    "range_bias_m",
    "range_gain_m_per_km",
    "azimuth_bias_deg",
    "azimuth_cos_deg",
    "azimuth_sin_deg",
    "time_bias_s",
)
PLANTED = np.array([120.0, 0.5, 0.4, 0.1, -0.06, 0.5])
SPREADS = np.array([25.0, 0.3, 0.08, 0.04, 0.04, 0.3])


def errors(estimate=PLANTED, cov=None, terms=SIX):
    cov = np.diag(SPREADS**2) if cov is None else cov
    return SystematicErrors(terms=terms, estimate=estimate, cov=cov)


def spoilt(plots, b):
    """The plots of a radar with errors b, written out; what is stamped t was measured b[5] before.

    Places are left where they are: only the stamps are late.
    """
    r, az = pl.col("range_m"), pl.col("azimuth_deg")
    turned = az + b[2] + b[3] * az.radians().cos() + b[4] * az.radians().sin()
    return plots.with_columns(
        range_m=r * (1.0 + b[1] / 1e3) + b[0],
        azimuth_deg=turned % 360.0,
        time_s=pl.col("time_s") + b[5],
    )


@pytest.fixture(scope="module")
def traffic():
    from conftest import Sky

    return pl.concat([Sky().aircraft(n) for n in range(12)])


def places(result):
    return result.tracks.select("east_m", "north_m", "up_m", "east_mps", "north_mps").to_numpy()


@pytest.mark.parametrize("name", ["ekf", "mekf", "ducm"])
def test_plots_corrected_by_what_was_planted_make_the_tracks_of_clean_plots(traffic, site, name):
    sure = errors(cov=np.zeros((6, 6)))
    clean = track(traffic, filter=lookup(name), site=site, noise=KNOWN)
    ours = track(spoilt(traffic, PLANTED), filter=lookup(name), site=site, noise=KNOWN, errors=sure)
    np.testing.assert_allclose(places(ours), places(clean), atol=0.05)
    np.testing.assert_allclose(ours.tracks["time_s"], clean.tracks["time_s"], atol=1e-9)
    assert not ours.settings["errors"]["carried"]
    assert any("taken for exact" in remark for remark in ours.remarks)


def test_a_site_that_was_moved_is_moved_back(traffic, site):
    offset = SystematicErrors(
        terms=("site_east_m", "site_north_m"),
        estimate=np.array([300.0, -200.0]),
        cov=np.zeros((2, 2)),
    )
    moved = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN, errors=offset)
    place = [moved.settings["site"][name] for name in ("latitude_deg", "longitude_deg", "height_m")]
    np.testing.assert_allclose(enu_from_geodetic(*place, site)[:2], [300.0, -200.0], atol=0.01)
    before = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN).tracks
    columns = ["latitude_deg", "longitude_deg", "height_m"]
    there, here = (
        enu_from_geodetic(*t[columns].to_numpy().T, site) for t in (moved.tracks, before)
    )
    # East is not the same direction 130 km away: up to 1.3 degrees, 8 m of an offset of 360 m.
    np.testing.assert_allclose((there - here)[:, :2], [[300.0, -200.0]] * len(here), atol=8.0)


def test_what_was_applied_is_recorded_and_said(traffic, site):
    result = track(
        spoilt(traffic, PLANTED),
        filter=lookup("ekf"),
        site=site,
        errors=errors(),
        sensor_noise=(20.0, 0.05),
        delay_m=15.0,
    )
    applied, noise = result.settings["errors"], result.settings["noise"]
    assert applied["estimate"] == dict(zip(SIX, PLANTED, strict=True))
    assert applied["sd"] == pytest.approx(dict(zip(SIX, SPREADS, strict=True)))
    assert applied["carried"]["range_bias_m"] == pytest.approx(np.hypot(25.0, 15.0))
    assert (noise["range_m"], noise["azimuth_deg"]) == (20.0, 0.05)
    assert noise["accel_mps2"] <= 0.1  # found: it is 1 where it was not
    assert "given by the calibration" in result.settings["noise_chosen"]
    assert any("corrected by the calibration: range bias +120 ± 25 m" in r for r in result.remarks)
    assert any("err" in r and "alike" in r for r in result.remarks)


@pytest.mark.parametrize(
    ("name", "why"), [("ckf-spherical", "another state"), ("iplf", "too long for a kernel")]
)
def test_a_filter_that_cannot_carry_says_so_and_is_corrected_all_the_same(traffic, site, name, why):
    given = {"site": site, "noise": KNOWN}
    planted = spoilt(traffic, PLANTED)
    beside = track(planted, filter=lookup("ekf"), compare=[lookup(name)], errors=errors(), **given)
    assert [row.filter for row in beside.filters] == ["ekf", name]
    (said,) = [remark for remark in beside.remarks if "does not carry" in remark]
    assert said.startswith(name)
    assert why in said
    alone = track(planted, filter=lookup(name), errors=errors(), **given)
    clean = track(traffic, filter=lookup(name), **given)
    np.testing.assert_allclose(places(alone), places(clean), atol=0.05)


def test_only_what_shows_and_is_uncertain_is_carried():
    terms = ("azimuth_bias_deg", "elevation_bias_deg", "range_bias_m")
    cov = np.array([[0.01, 0.002, 0.0], [0.002, 0.04, 0.0], [0.0, 0.0, 0.0]])
    given = SystematicErrors(terms=terms, estimate=np.arange(3.0), cov=cov)
    assert carried(given).terms == ("azimuth_bias_deg",)
    delayed = carried(given, 9.0)
    assert delayed.terms == ("azimuth_bias_deg", "range_bias_m")
    np.testing.assert_array_equal(delayed.cov, np.diag([0.01, 81.0]))
    assert carried(None) is None


def test_a_poor_calibration_turns_no_plot_away(traffic, site):
    poor = errors(0 * PLANTED, np.diag((10.0 * SPREADS) ** 2))
    result = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN, errors=poor)
    assert (result.rejected, result.used) == (0, traffic.height)
    plain = track(traffic, filter=lookup("ekf"), site=site, noise=KNOWN)
    # What all plots of a track share hardly shows in its innovations: it bends the path a little.
    said, known = (r.residuals["azimuth_residual_deg"].drop_nans().std() for r in (result, plain))
    assert said == pytest.approx(known, rel=0.05)


def nees(result, clean, late):
    """Mean over tracks of the normalised squared error of the last place, for each coordinate.

    A plot stamped `late` seconds after it was measured is told at its stamp: the truth is there.
    """
    values = []
    for (address,), flight in clean.group_by("address"):
        end = result.tracks.filter(pl.col("address") == address)[-1]
        place, time = flight[["east_m", "north_m"]].to_numpy(), flight["time_s"].to_numpy()
        velocity = (place[-1] - place[-2]) / (time[-1] - time[-2])
        off = end[["east_m", "north_m"]].to_numpy()[0] - place[-1] - velocity * late
        xx, xy, yy = end.select("cov_0_0", "cov_0_1", "cov_1_1").row(0)
        values.append(off @ np.linalg.solve([[xx, xy], [xy, yy]], off) / 2.0)
    return np.mean(values)


@pytest.mark.slow
def test_covariances_hold_what_the_calibration_left(site):
    # 40 calibrations, each off by errors of its own. The mean over one's four tracks is one value,
    # whatever they share; the band is four standard errors of 40: 1 false alarm in 3,600.
    from conftest import Sky

    rng = np.random.default_rng(12)
    ours, plain = [], []
    for seed in range(40):
        clean = pl.concat([Sky(seed=seed).aircraft(n, plots=40) for n in range(4)])
        b = rng.normal(size=6) * SPREADS
        for kept, left in ((ours, errors(0.0 * PLANTED)), (plain, None)):
            result = track(
                spoilt(clean, b), filter=lookup("ekf"), site=site, noise=KNOWN, errors=left
            )
            kept.append(nees(result, clean, b[5]))
    se = np.std(ours, ddof=1) / np.sqrt(40)
    assert se < 0.15
    assert abs(np.mean(ours) - 1.0) < 4.0 * se
    assert np.mean(plain) > 10.0


@dataclass(eq=False)
class Halves:
    """A recording with its reference, halved: the first half calibrates, the second is tracked."""

    plots: pl.DataFrame
    reference: object
    site: Site
    atmosphere: object = None

    @cached_property
    def half_s(self):
        times = pair(self.plots, self.reference, self.site).pairs.time_s
        return (times.min() + times.max()) / 2

    @cached_property
    def registered(self):
        first = self.plots.filter(pl.col("time_s") < self.half_s)
        pairs = pair(first, self.reference, self.site, atmosphere=self.atmosphere).pairs
        return register(pairs, SIX)

    def tracked(self, name, *, with_calibration):
        second = self.plots.filter(pl.col("time_s") >= self.half_s)
        given = {"filter": lookup(name), "site": self.site, "atmosphere": self.atmosphere}
        if with_calibration:
            found = self.registered
            noise = found.noise
            given |= {
                "errors": found.errors,
                "sensor_noise": (noise.range_m, noise.azimuth_deg),
                "delay_m": noise.target_range_m,
            }
        return track(second, **given)

    def azimuth_residual(self, result):
        """Mean azimuth of the tracks minus the reference's, deg, and its clustered standard error.

        At every plot that updated a track, the reference interpolated to the track's own time; the
        plots of one aircraft are one cluster. A filter's own azimuth innovations cannot show a
        constant bias: the track moves with it.
        """
        rows = result.tracks.filter(pl.col("status") == "updated")
        east, north = rows["east_m"], rows["north_m"]
        seen = rows.select("time_s", "sensor", "address", "mode_a").with_columns(
            range_m=(east**2 + north**2 + rows["up_m"] ** 2).sqrt(),
            azimuth_deg=pl.Series(np.degrees(np.arctan2(east, north)) % 360.0),
            pressure_altitude_m=rows["height_m"],
            altitude_valid=True,
            mode_a_valid=True,
            report_type=pl.lit("ssr"),
        )
        pairs = pair(seen, self.reference, self.site).pairs
        found = clustered(np.degrees(pairs.residuals()[:, 1]), pairs.target)
        assert found.tracks >= 10
        assert found.plots > 500
        return found.mean, (found.ci95[1] - found.mean) / stdtrit(found.tracks - 1, 0.975)


@cache
def saenz_pena():
    place = json.loads((DATA / "site.json").read_text())["location"]
    plots = read_recording(DATA / "plots-cat048.pcap").plots
    reference = read_recording(DATA / "system-tracks-cat062.pcap")
    # The site file does not know the antenna's height; azimuth does not depend on it.
    site = Site(latitude_deg=place["latitude"], longitude_deg=place["longitude"], height_m=90.0)
    return Halves(one_sensor(plots, None, []), from_recording(reference, "system tracks"), site)


@cache
def demo():
    facts, _ = shipped()
    with as_file(files("boresight") / "demo" / "recording.ast") as path:
        recording = read_recording(path)
    reference, air = from_recording(recording, "adsb"), ExponentialAtmosphere()
    return Halves(one_sensor(recording.plots, None, []), reference, Site(**facts["site"]), air)


@pytest.mark.skipif(
    not DATA.exists(), reason="the Saenz Pena recording is not beside this checkout"
)
@pytest.mark.parametrize("name", ["ekf", "mekf"])
def test_saenz_pena_the_first_half_takes_the_azimuth_bias_out_of_the_second(name):
    halves = saenz_pena()
    before, se = halves.azimuth_residual(halves.tracked(name, with_calibration=False))
    assert abs(before) > 10.0 * se
    after, se = halves.azimuth_residual(halves.tracked(name, with_calibration=True))
    assert abs(after) < 3.0 * se


@pytest.mark.parametrize("name", ["ekf", "mekf"])
def test_demo_the_first_half_takes_the_azimuth_bias_out_of_the_second(name):
    halves = demo()
    before, se = halves.azimuth_residual(halves.tracked(name, with_calibration=False))
    assert abs(before) > 10.0 * se
    after, se = halves.azimuth_residual(halves.tracked(name, with_calibration=True))
    assert abs(after) < 3.0 * se
