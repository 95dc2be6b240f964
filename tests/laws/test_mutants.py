"""The laws themselves are judged: nine planted faults in ten must break one of them."""

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "mutate.py"


def test_every_planted_fault_is_still_there_to_plant(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    script = runpy.run_path(str(SCRIPT))
    assert len(script["FAULTS"]) >= 40
    for fault in script["FAULTS"]:
        text = (SCRIPT.parents[1] / "src" / "boresight" / fault.file).read_text(encoding="utf-8")
        assert fault.old in text, f"the fault list is out of date: {fault}"
        assert fault.old != fault.new


@pytest.mark.slow
def test_nine_planted_faults_in_ten_are_caught():
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--parallel", "2"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
