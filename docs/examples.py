"""What the pages' examples find around them, and how their commands are run.

Examples run in a folder that holds what the pages speak of: `night.ast` is the recording that comes
with boresight, `bearings.csv` and `own-ship.csv` are an example of this repository, studies are
those of its `examples/studies`, `study.toml` being one of them. The tests run the examples of every
page and of the README alike, and hold what a page shows to what is printed.
"""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).resolve().parents[1]
TERMINAL = {"COLUMNS": "88", "NO_COLOR": "1"}


def furnish(folder: Path) -> Path:
    """Put into `folder` what pages speak of."""
    folder.mkdir(parents=True, exist_ok=True)
    recording = resources.files("boresight") / "demo" / "recording.ast"
    (folder / "night.ast").write_bytes(recording.read_bytes())
    for path in [*(ROOT / "examples/tma").glob("*.csv"), *(ROOT / "examples/studies").iterdir()]:
        shutil.copy(path, folder / path.name)
    shutil.copy(ROOT / "examples/studies/poor-bearings.toml", folder / "study.toml")
    shutil.copytree(ROOT / "examples", folder / "examples", dirs_exist_ok=True)
    return folder


def blocks(path: Path, *kinds: str) -> list[str]:
    """What stands in a page's fenced blocks of these kinds, without their options."""
    fenced = re.findall(
        r"^```([^\n`]+)\n(.*?)^```", path.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    found = [text for kind, text in fenced if kind.split()[0] in kinds]
    return [re.sub(r"^:[\w-]+:.*\n", "", text, flags=re.MULTILINE) for text in found]


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
    env = os.environ | TERMINAL | {"PYTHONWARNINGS": "error"}
    done = subprocess.run(  # noqa: S603 - our own pages
        words, cwd=folder, env=env, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"$ {command}\nexit {done.returncode}\n{done.stdout}{done.stderr}")
    return "\n".join(line.rstrip() for line in done.stdout.splitlines()).strip("\n")


def call(command: str) -> str:
    """What a command of boresight shows, run in this process and folder: quicker than `run`."""
    from boresight.interfaces import cli

    _, *words = shlex.split(command)
    out, remarks = io.StringIO(), io.StringIO()
    with (
        mock.patch.dict(os.environ, TERMINAL),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(remarks),
    ):
        code = cli.run(words)
    printed = out.getvalue() + remarks.getvalue()
    if code:
        raise RuntimeError(f"$ {command}\nexit {code}\n{printed}")
    return printed


def shown(lines: list[str], begin: str = "", rows: int | None = None) -> list[str]:
    """So many rows of a long answer, from the first that begins with these words."""
    first = next(i for i, line in enumerate(lines) if line.startswith(begin))
    last = len(lines) if rows is None else first + rows
    before, after = ["..."] * (first > 0), ["..."] * (last < len(lines))
    return [*before, *lines[first:last], *after]


def told(block: str) -> list[tuple[str, str]]:
    """Each command of a block with what the page says that it prints."""
    parts = re.split(r"^(\$ .*)$", block, flags=re.MULTILINE)[1:]
    pairs = zip(parts[::2], parts[1::2], strict=True)
    return [(next(commands(line)), after.strip()) for line, after in pairs]


def differs(said: str, printed: str) -> str | None:
    """The first thing that is said and was not printed, in this order; `...` leaves things out.

    How lines are folded, and measured times (the last column where a table's is `ns`, and whatever
    is followed by ns, µs or ms) are nobody's promise.
    """
    rest = _timeless(printed)
    for piece in _timeless(said).split("..."):
        words = piece.strip()
        if words not in rest:
            return words
        rest = rest[rest.index(words) + len(words) :]
    return None


def _timeless(text: str) -> str:
    lines, in_table = [], False
    for line in text.splitlines():
        in_table = (in_table and bool(line.strip())) or line.rstrip().endswith(" ns")
        lines.append(re.sub(r"[\d.,]+\s*$", "TIME", line) if in_table else line)
    told = re.sub("─+", "─", " ".join(lines))  # a rule is as long as times are wide
    return " ".join(re.sub(r"[\d.,]+ (?:ns|µs|ms)\b", "TIME", told).split())
