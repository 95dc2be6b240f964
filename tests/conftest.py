"""Profiles and fixtures that every test shares."""

import os

import pytest
from hypothesis import HealthCheck, Phase, settings

# What a kernel's first compilation costs must not count as a slow example.
_COMMON = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("ci", max_examples=20, derandomize=True, database=None, **_COMMON)
settings.register_profile("mutants", settings.get_profile("ci"), phases=[Phase.generate])
settings.register_profile("long", max_examples=400, **_COMMON)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


@pytest.fixture
def kernel_cache(tmp_path, monkeypatch):
    """A cache folder of the test's own."""
    monkeypatch.setenv("BORESIGHT_CACHE", str(tmp_path))
    return tmp_path
