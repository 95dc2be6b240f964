"""What the pages' examples find around them, and how their commands are run.

Examples run in a folder that holds what the pages speak of: `night.ast` is the recording that comes
with boresight, `bearings.csv` and `own-ship.csv` are an example of this repository, studies are
those of its `examples/studies`. The tests run the examples of every page and of the README alike.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = 88


def furnish(folder: Path) -> Path:
    """Put into `folder` what pages speak of."""
    folder.mkdir(parents=True, exist_ok=True)
    recording = resources.files("boresight") / "demo" / "recording.ast"
    (folder / "night.ast").write_bytes(recording.read_bytes())
    for path in [*(ROOT / "examples/tma").glob("*.csv"), *(ROOT / "examples/studies").iterdir()]:
        shutil.copy(path, folder / path.name)
    shutil.copytree(ROOT / "examples", folder / "examples", dirs_exist_ok=True)
    return folder


def commands(block: str) -> Iterator[str]:
    """The commands of a block: lines after a dollar sign, without their remarks."""
    for line in block.splitlines():
        found = re.match(r"\$ (.*?)(?:\s+#\s.*)?$", line)
        if found:
            yield found.group(1)


def run(command: str, folder: Path) -> str:
    """What a command prints; RuntimeError with its errors if it fails."""
    words = shlex.split(command)
    if words[0] == "boresight":
        words[:1] = [sys.executable, "-m", "boresight"]
    width = {"COLUMNS": str(COLUMNS), "NO_COLOR": "1", "PYTHONWARNINGS": "error"}
    done = subprocess.run(  # noqa: S603 - our own pages
        words, cwd=folder, env=os.environ | width, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"$ {command}\nexit {done.returncode}\n{done.stdout}{done.stderr}")
    return "\n".join(line.rstrip() for line in done.stdout.splitlines()).strip("\n")


def shown(lines: list[str], rows: int | None) -> list[str]:
    """The first rows of a long answer."""
    return lines if rows is None or len(lines) <= rows else [*lines[:rows], "..."]
