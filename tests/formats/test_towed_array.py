"""A towed array's own files: the sign of differences from physics, and layouts that are none."""

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat

from boresight.errors import DataError
from boresight.formats.bearings import read_bearings
from boresight.formats.own_ship import read_own_ship
from boresight.target_motion.contacts import contacts

SOUND, SPACING, DAY = 1480.0, 20.0, 736_950.0  # MATLAB's number of 2017-09-12
SHIP_MPS, STEPS = 5.0, 200
SOURCE = np.array([700.0, 300.0])  # East and North


def elements():
    """(2, steps, 2) East and North of both hydrophones of an array that runs East; 1 is ahead."""
    middle = SHIP_MPS * np.arange(STEPS)
    both = np.zeros((2, STEPS, 2))
    both[0, :, 0], both[1, :, 0] = middle + SPACING / 2, middle - SPACING / 2
    return both


def write(tmp_path, *, exchanged=False, **changes):
    """The tracks' MATLAB file and the ship's CSV; `exchanged` puts hydrophone 2 ahead."""
    places = elements()[::-1] if exchanged else elements()
    first, second = np.linalg.norm(places - SOURCE, axis=-1) / SOUND
    days = DAY + (3600.0 + np.arange(STEPS)) / 86_400.0
    tracks = np.zeros(2, dtype=[("time", "O"), ("time_local", "O"), ("tdoa", "O")])
    for i, part in enumerate((slice(None), slice(50, 80))):
        tracks[i] = (np.arange(STEPS)[part], days[part], (first - second)[part])
    content = {
        "Tracks": tracks,
        "parameters": {"c": SOUND, "d": SPACING},
        "model": {"R": 4e-8, "p_D": 0.25},
    } | changes
    savemat(tmp_path / "t.mat", {name: each for name, each in content.items() if each is not None})
    stamps = [f"12-Sep-2017 01:{s // 60:02d}:{s % 60:02d}.000" for s in range(STEPS)]
    names = [f"Sensor{i}_pos_{axis}_m" for i in (1, 2) for axis in "xy"]
    columns = dict(zip(names, np.moveaxis(places, -1, 1).reshape(4, STEPS), strict=True))
    pl.DataFrame({"Time_UTC": stamps, **columns}).write_csv(tmp_path / "ship.csv")
    return tmp_path / "t.mat", tmp_path / "ship.csv"


@pytest.mark.parametrize("exchanged", [False, True])
def test_what_two_hydrophones_hear_is_the_angle_to_the_source(tmp_path, exchanged):
    """Fronts of sound are curved by 20 m in 300: 0.1 degrees at most."""
    tracks, log = write(tmp_path, exchanged=exchanged)
    bearings, told = read_bearings(tracks)
    found, remarks = contacts(bearings, read_own_ship(log)[0])
    assert [(each.name, len(each.time_s)) for each in found] == [("1", STEPS), ("2", 30)]
    longest = found[0]
    away = SOURCE[::-1] - longest.position_m
    seen = np.arctan2(away[:, 1], away[:, 0]) - longest.axis_rad
    assert np.degrees(np.abs(np.abs(seen) - longest.cone_rad).max()) < 0.1
    assert np.degrees(longest.cone_rad[0]) == pytest.approx(156.8 if exchanged else 23.2, abs=0.1)
    assert longest.time_s[0] == pytest.approx(3600.0, abs=1e-3)
    assert "1480 m/s" in told[0]
    assert any("2017-09-12" in each for each in remarks)


def test_a_row_is_worth_what_was_measured(tmp_path):
    """Variance 4e-8 s², heard in a quarter of the steps: 400 us a row; abeam c sigma / d."""
    bearings, told = read_bearings(write(tmp_path)[0])
    assert bearings["sigma_tdoa_s"].unique().to_list() == pytest.approx([4e-4])
    assert "400 us" in told[1]
    longest = contacts(bearings, read_own_ship(tmp_path / "ship.csv")[0])[0][0]
    abeam = np.argmin(np.abs(longest.cone_rad - np.pi / 2))
    assert longest.sigma_rad[abeam] == pytest.approx(SOUND * 4e-4 / SPACING, rel=0.02)


def test_without_a_model_the_noise_is_not_told(tmp_path):
    bearings, told = read_bearings(write(tmp_path, model=None)[0])
    assert "sigma_tdoa_s" not in bearings.columns
    assert len(told) == 1


UNEVEN = np.zeros(1, dtype=[("time_local", "O"), ("tdoa", "O")])
UNEVEN[0] = (np.arange(3.0), np.arange(2.0))
SILENT = np.zeros(1, dtype=[("time_local", "O"), ("tdoa", "O")])
SILENT[0] = (np.arange(2.0), np.full(2, np.nan))
NAMELESS = np.zeros(1, dtype=[("when", "O")])
NAMELESS[0] = (np.arange(2.0),)
OTHERS = {
    "no tracks": ({"Tracks": None}, "needs Tracks"),
    "no speed of sound": ({"parameters": {"d": 1.0}}, "c and d"),
    "another struct": ({"Tracks": NAMELESS}, "no time_local"),
    "numbers for a struct": ({"Tracks": np.zeros(3)}, "no time_local"),
    "times without differences": ({"Tracks": UNEVEN}, "3 times and 2"),
    "nothing heard": ({"Tracks": SILENT}, "no time difference"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_another_layout_is_refused(tmp_path, name):
    changes, words = OTHERS[name]
    with pytest.raises(DataError, match="no file of time-difference tracks") as caught:
        read_bearings(write(tmp_path, **changes)[0])
    assert words in caught.value.why
    assert "t.mat" in caught.value.what
