"""Rules of a reference that hold within one target and not from one target to the next."""

import polars as pl
import pytest
from flown import Aircraft, reference

from boresight.calibration.references import from_recording
from boresight.calibration.screening import longest_gap
from boresight.formats.recording import Recording


def test_the_longest_gap_follows_the_steps_of_single_targets():
    seen_twice = [(4.0 * step, target) for target in range(10) for step in (0, 1)]
    seen_once = [(0.0, target) for target in range(10, 40)]
    time, target = zip(*seen_twice, *seen_once, strict=True)
    assert longest_gap(pl.DataFrame({"time_s": time, "target": target})) == pytest.approx(9.0)


def test_one_target_may_begin_when_another_ends(tmp_path):
    first = Aircraft(1)
    last = first.reports()["time_s"][-1]
    second = Aircraft(2, start_s=last)
    known = reference(tmp_path, first.reports(), second.reports())
    assert known.refused == {}
    assert known.table.height == first.reports().height + second.reports().height


def heard(**columns):
    """One aircraft's reports as a recording tells them."""
    own = {"sensor": "1/1", "mode_a": None, "pressure_altitude_m": None, "on_ground": False}
    own |= {"simulated": False, "test": False, "age_s": 0.1}
    table = Aircraft(1).reports(**own).with_columns(pl.col("mode_a").cast(pl.String), **columns)
    empty = pl.DataFrame()
    return Recording(plots=empty, reference=table, system_tracks=empty, sectors=empty, summary={})


FIRST = pl.int_range(pl.len()) < 4


@pytest.mark.parametrize("age_s", [-3.0, 3.0])
def test_a_position_from_the_future_is_as_doubtful_as_an_old_one(age_s):
    table = heard(age_s=pl.when(FIRST).then(age_s).otherwise(0.1))
    assert from_recording(table, "adsb").refused == {"too old": 4}


def test_the_old_scale_of_quality_is_good_from_six_on():
    quality = pl.when(FIRST).then(5).otherwise(6)
    table = heard(quality_kind=pl.lit("pa"), quality=quality)
    assert from_recording(table, "adsb").refused == {"poor accuracy": 4}
