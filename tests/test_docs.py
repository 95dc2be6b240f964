"""Every example of the pages runs: commands, code cells and plain Python alike."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import boresight

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
import mermaid  # noqa: E402 - the pages' own
from examples import blocks, call, commands, differs, furnish, run, told  # noqa: E402

PAGES = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)
CODE = [path for path in PAGES if blocks(path, "python", "{code-cell}")]
SPOKEN_OF = ("python -m pip ", "dask ")  # how a user gets that far; a cluster has a test of its own


def all_commands(path):
    for block in blocks(path, "console", "{console}"):
        yield from (c for c in commands(block) if not c.startswith(SPOKEN_OF))


COMMANDS = [path for path in PAGES if list(all_commands(path))]


def named(path):
    return str(path.relative_to(DOCS))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where examples run: as a user, with pictures drawn to nowhere."""
    monkeypatch.chdir(furnish(tmp_path / "here"))
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr(sys, "path", [*sys.path])
    for example in ("fading_ekf", "numpy_ekf"):
        monkeypatch.delitem(sys.modules, example, raising=False)
    return Path.cwd()


@pytest.mark.parametrize("path", CODE, ids=named)
def test_the_python_of_a_page_runs(path, folder):
    """As in a notebook: cell after cell, the last expression of each shown."""
    assert folder
    names = {"__name__": "page"}
    for number, block in enumerate(blocks(path, "python", "{code-cell}")):
        tree = ast.parse(block, f"{path.name}, block {number}")
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, f"{path.name}, block {number}", "exec"), names)  # noqa: S102 - our own pages
        if last is not None:
            value = eval(compile(ast.Expression(last.value), path.name, "eval"), names)  # noqa: S307
            show(value)


def show(value):
    drawn = getattr(value, "_repr_html_", None)
    assert (drawn() if drawn else repr(value)) or value is None


@pytest.mark.parametrize("path", COMMANDS, ids=named)
def test_the_commands_of_a_page_run(path, folder):
    """But those for a cluster, which must be there first."""
    assert folder
    for command in all_commands(path):
        assert "--scheduler" in command or call(command)


@pytest.mark.slow
def test_the_cluster_of_the_researchers_page_gives_the_same_numbers(folder):
    """Its three commands as they stand, on another port than a user's."""
    lines = [c for b in blocks(DOCS / "start/researcher.md", "console") for c in commands(b)]
    scheduler, worker, compare = (line.replace("8786", "18786") for line in lines)
    dask = [str(Path(sys.executable).with_name("dask"))]
    background = [
        subprocess.Popen(
            [*dask, *line.split()[1:], *more], cwd=folder, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for line, more in ((scheduler, ["--no-dashboard"]), (worker, ["--no-dashboard"]))
    ]  # fmt: skip
    try:
        far = run(compare, folder)
    finally:
        for each in background:
            each.terminate()
        for each in background:
            each.wait(timeout=60)
    here = run("boresight compare poor-bearings.toml -o here", folder)
    assert digest(far) == digest(here)


def digest(text):
    return re.search(r"SHA-256 of the numbers: (\w{64})", text)[1]


def test_what_is_shown_is_held_to_what_is_printed():
    """The comparison of other tests itself, with faults planted."""
    printed = "a  10 m\nb  20 m in 3.1 µs\n\n name  error  ns\n x      1.5  12\n y      2.5  34\n"
    assert differs(printed, printed) is None
    assert differs("a 10 m\n...\nname error ns\nx 1.5 99", printed) is None
    assert differs("b 20 m in 7.7 µs", printed) is None
    for wrong in ("a 11 m", "b 20 m\n...\na 10 m", "name error ns\nx 1.6 12", "a 10 m in 3.1 µs"):
        assert differs(wrong, printed)
    assert told("$ one --more  # why\nanswer\n$ two\n") == [("one --more", "answer"), ("two", "")]


def test_a_flow_chart_is_drawn_with_all_that_it_says():
    """Boxes do not touch, arrows lead on, and a line that is not understood is named."""
    for source in blocks(DOCS / "papers/kashyap.md", "mermaid"):
        chart = mermaid.read(source)
        mermaid.arrange(chart)
        assert len(chart.arrows) == len(re.findall(r"->", source))
        assert all(chart.places[a].column < chart.places[b].column for a, b in chart.steps)
        boxes = [place for place in chart.places.values() if place.lines]
        assert not any(touch(a, b) for i, a in enumerate(boxes) for b in boxes[:i])
        drawn = re.sub(r"<[^>]*>", " ", mermaid.draw(source))
        for text in re.findall(r'"([^"]+)"', source):
            assert all(word in drawn for word in text.split())
    with pytest.raises(ValueError, match="==> b"):
        mermaid.draw("flowchart LR\n  a ==> b")


def touch(a, b):
    beside = abs(a.x - b.x) >= (a.width + b.width) / 2
    return not beside and abs(a.y - b.y) < (a.height + b.height) / 2


def test_the_reference_has_every_public_name():
    text = (DOCS / "reference/python.md").read_text(encoding="utf-8")
    found = re.findall(r"^\.\. auto\w+:: boresight\.(\w+)$", text, re.MULTILINE)
    assert sorted(found) == sorted(boresight._NAMES)


def test_every_command_has_its_help_on_a_page():
    text = (DOCS / "reference/command-line.md").read_text(encoding="utf-8")
    from boresight.interfaces.cli import app

    offered = {name for name in app if not name.startswith("-")}
    assert set(re.findall(r"^\$ boresight (\w+) --help$", text, re.MULTILINE)) == offered


def test_every_metric_and_unit_of_a_study_is_on_its_page():
    from boresight.laboratory.quantities import KINDS, SHARE
    from boresight.laboratory.study import METRICS, USUAL

    text = (DOCS / "studies.md").read_text(encoding="utf-8")
    units, metrics = text.split("## Metrics")
    usual, table = metrics.split("| metric |")
    assert set(re.findall(r"`([a-z ]+)`", usual)) == set(USUAL)
    told = re.findall(r"^\| (`.*`) \|", table, re.MULTILINE)
    assert sorted(re.findall(r"`(.+?)`", " ".join(told))) == sorted(METRICS)
    offered = {unit for kind in KINDS if kind is not SHARE for unit in kind.units}
    rows = re.findall(r"^\| [a-z ,]+ \| (\w.*) \|$", units, re.MULTILINE)
    assert set(re.split(r"[,;] ", "; ".join(rows))) - {"units", "%", "or of 1"} == offered | set()


def build(target, *options):
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", *options]
    done = subprocess.run(
        [*command, str(DOCS), str(target)],
        capture_output=True, text=True, check=False, env=os.environ | {"PYTHONWARNINGS": ""},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_pages_hang_together(tmp_path):
    """Links, references and contents, every warning an error; no example is run for it."""
    idle = ("nb_execution_mode=off", "console_run=0", "suppress_warnings=myst-nb.lexer")
    build(tmp_path, "-b", "dummy", *(word for each in idle for word in ("-D", each)))


@pytest.mark.slow
def test_the_pages_are_built_without_a_warning(tmp_path):
    build(tmp_path, "-b", "html")
    pages = {path.relative_to(DOCS).with_suffix(".html") for path in PAGES}
    assert all((tmp_path / page).is_file() for page in pages)
    assert "flowchart" not in (tmp_path / "papers/kashyap.html").read_text(encoding="utf-8")
