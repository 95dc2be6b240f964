"""A calibration made by hand: what plots lose by it, and what a file keeps of it."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from boresight.calibration.correcting import correct
from boresight.calibration.file import read_calibration, write_calibration
from boresight.calibration.result import Calibration, Direction, Law, NoiseFound, TermFound
from boresight.errors import DataError
from boresight.maths.frames import Site
from boresight.models.systematic import SystematicErrors

ESTIMATES = {
    "time_bias_s": 0.25,
    "azimuth_bias_deg": 0.5,
    "range_bias_m": 120.0,
    "elevation_bias_deg": -0.25,
}
COV = np.array(
    [
        [0.04, 0.001, 0.5, 0.0],
        [0.001, 0.01, 0.2, 0.0],
        [0.5, 0.2, 81.0, 0.1],
        [0.0, 0.0, 0.1, 0.0025],
    ]
)


def made(**changes):
    """A calibration whose terms stand in another order than their covariance."""
    terms = {
        name: TermFound(
            estimate=value,
            sd=float(np.sqrt(COV[i, i])),
            ci95=(value - 1.0, value + 1.0),
            observable=True,
            independent_sd=0.001,
        )
        for i, (name, value) in enumerate(ESTIMATES.items())
    }
    fields = {
        "errors": SystematicErrors(
            terms=tuple(ESTIMATES), estimate=np.array([*ESTIMATES.values()]), cov=COV
        ),
        "terms": dict(sorted(terms.items())),
        "directions": (
            Direction(
                weights={"range_bias_m": 60.0},
                observable=True,
                correlation=-0.93,
                words="hardly told",
            ),
        ),
        "noise": NoiseFound(
            range_m=30.0,
            azimuth_deg=0.06,
            target_range_m=20.0,
            outlier_share=0.01,
            laws={"range_m": Law(30.0, 0.1, 90.0)},
        ),
        "pairs": 1_200,
        "targets": 14,
        "dropped": {"two plots": 3},
        "reference": "adsb",
        "sensor": "1/2",
        "site": Site(latitude_deg=47.0, longitude_deg=8.0, height_m=500.0),
        "atmosphere": "none",
        "air_gain_m_per_km": 0.25,
        "residuals": pl.DataFrame(),
        "settings": {"gate_m": 60.0},
        "remarks": ["one", "two"],
    }
    return Calibration(**fields | changes)


def test_plots_lose_the_errors_in_their_own_units_and_other_radars_keep_theirs():
    plots = pl.DataFrame(
        {
            "sensor": ["1/2", "9/9", "1/2"],
            "time_s": [10.0, 11.0, 12.0],
            "range_m": [5_120.0, 5_120.0, None],
            "azimuth_deg": [90.5, 90.5, 0.25],
            "elevation_deg": [1.75, 1.75, 2.75],
            "address": ["A", "B", "C"],
        }
    )
    clean = correct(plots, made())
    assert clean.columns == plots.columns
    assert clean["time_s"].to_list() == pytest.approx([9.75, 11.0, 11.75])
    assert clean["range_m"].to_list()[:2] == pytest.approx([5_000.0, 5_120.0])
    assert not np.isfinite(clean["range_m"].to_numpy()[2])
    assert clean["azimuth_deg"].to_list() == pytest.approx([90.0, 90.5, 359.75])
    assert clean["elevation_deg"].to_list() == pytest.approx([2.0, 1.75, 3.0])
    assert clean["address"].to_list() == ["A", "B", "C"]


def test_a_calibration_of_no_named_sensor_is_of_all_plots():
    plots = pl.DataFrame({"time_s": [10.0], "range_m": [5_120.0], "azimuth_deg": [90.5]})
    assert correct(plots, made()).row(0) == pytest.approx((9.75, 5_000.0, 90.0))
    named = plots.with_columns(sensor=pl.lit("9/9"))
    assert correct(named, made(sensor=""))["time_s"].to_list() == [9.75]


def test_a_file_gives_back_all_that_was_found(tmp_path):
    found = made()
    kept = read_calibration(write_calibration(found, tmp_path / "calibration.toml"))
    assert kept.errors.terms == found.errors.terms
    np.testing.assert_array_equal(kept.errors.estimate, found.errors.estimate)
    np.testing.assert_array_equal(kept.errors.cov, COV)
    same = ("terms", "directions", "noise", "pairs", "targets", "dropped", "reference", "sensor")
    for name in (*same, "site", "atmosphere", "air_gain_m_per_km", "settings", "remarks"):
        assert repr(getattr(kept, name)) == repr(getattr(found, name)), name  # NaN is NaN


def test_a_radar_that_tells_no_elevation_and_has_no_site_is_kept_as_such(tmp_path):
    kept = read_calibration(write_calibration(made(site=None), tmp_path / "calibration.toml"))
    assert kept.site is None
    assert kept.noise.elevation_deg is None


@pytest.mark.parametrize(
    "cov",
    [
        pytest.param(COV + np.eye(4)[:, [0]] @ np.eye(4)[[1]], id="lopsided"),
        pytest.param(COV - np.diag([0.0, 0.0, 80.9, 0.0]), id="beyond one"),
    ],
)
def test_what_is_no_covariance_is_refused(tmp_path, cov):
    errors = SystematicErrors(terms=tuple(ESTIMATES), estimate=np.zeros(4), cov=cov)
    path = write_calibration(made(errors=errors), tmp_path / "calibration.toml")
    with pytest.raises(DataError, match=r"covariance\.rows"):
        read_calibration(path)


@pytest.mark.parametrize("version", ["0", "2", '"1"'])
def test_a_file_of_another_version_is_refused(tmp_path, version):
    path = write_calibration(made(), tmp_path / "calibration.toml")
    text = path.read_text()
    assert "version = 1\n" in text
    path.write_text(text.replace("version = 1\n", f"version = {version}\n"))
    with pytest.raises(DataError, match="version"):
        read_calibration(path)


def test_an_estimate_that_is_no_number_is_refused(tmp_path):
    terms = made().terms
    wrong = terms | {"range_bias_m": replace(terms["range_bias_m"], estimate=float("nan"))}
    path = write_calibration(made(terms=wrong), tmp_path / "calibration.toml")
    with pytest.raises(DataError, match="is not a calibration") as caught:
        read_calibration(path)
    assert "range_bias_m" in caught.value.why
