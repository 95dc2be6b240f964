"""Options of `track` that change the answer: the air, and where the radar stands."""

import json
import subprocess
import sys
from importlib.resources import as_file, files

import pytest


def track(*options):
    with as_file(files("boresight") / "demo" / "recording.ast") as file:
        done = subprocess.run(
            [sys.executable, "-m", "boresight", "track", str(file), "--json", *options],
            capture_output=True,
            text=True,
            check=False,
        )
    return done.returncode, json.loads(done.stdout)


def test_a_radar_that_says_where_it_stands_needs_no_site():
    code, said = track()
    assert code == 0
    # The position of I034/120 comes in steps of 180 / 2**23 degrees.
    assert said["settings"]["site"]["latitude_deg"] == pytest.approx(47.8125, abs=3e-5)
    assert not any("--site" in remark for remark in said["remarks"])


def test_a_site_that_is_given_wins():
    _, said = track("--site", "47.0,1.0,100")
    assert said["settings"]["site"]["latitude_deg"] == 47.0


def test_the_air_is_named_in_the_settings():
    _, said = track("--atmosphere", "exponential")
    assert "ExponentialAtmosphere" in said["settings"]["atmosphere"]
    assert track()[1]["settings"]["atmosphere"] == "none"


def test_an_unknown_air_is_a_usage_error():
    assert track("--atmosphere", "thick")[0] == 2
