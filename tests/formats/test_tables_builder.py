"""The committed table of layouts is what its builder makes of libasterix."""

import importlib.util
from importlib.resources import files
from pathlib import Path

import pytest

BUILDER = Path(__file__).parents[2] / "scripts" / "build_asterix_tables.py"


def test_the_committed_table_equals_a_rebuild():
    pytest.importorskip("asterix.generated", reason="libasterix (extra test) is not installed")
    spec = importlib.util.spec_from_file_location("build_asterix_tables", BUILDER)
    builder = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(builder)
    committed = files("boresight.formats").joinpath("asterix_items.json").read_text("ascii")
    assert builder.dump(builder.build()) == committed
