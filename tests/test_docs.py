"""Every example of the README and the pages runs; commands, code cells and plain Python alike."""

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
from examples import commands, furnish, run  # noqa: E402 - the pages' own

PAGES = sorted(
    path
    for path in [ROOT / "README.md", *DOCS.rglob("*.md")]
    if "_build" not in path.parts and path.parent.name not in ("decisions", "papers")
)
NOT_HERE = ("make ", "python -m pip ")  # what a user types to get that far
BLOCK = re.compile(r"^```(\{?[\w-]+\}?)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(path, *kinds):
    return [
        re.sub(r"^:[\w-]+:.*\n", "", text, flags=re.MULTILINE)
        for kind, text in BLOCK.findall(path.read_text(encoding="utf-8"))
        if kind in kinds
    ]


def with_commands(paths):
    return [path for path in paths if list(all_commands(path))]


def all_commands(path):
    for block in blocks(path, "console", "{console}"):
        yield from (c for c in commands(block) if not c.startswith(NOT_HERE))


def named(path):
    return str(path.relative_to(ROOT))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where examples run: as a user, with pictures drawn to nowhere."""
    monkeypatch.chdir(furnish(tmp_path / "here"))
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr(sys, "path", [*sys.path])
    return Path.cwd()


CODE = [path for path in PAGES if blocks(path, "python", "{code-cell}")]


@pytest.mark.parametrize("path", CODE, ids=named)
def test_the_python_of_a_page_runs(path, folder, monkeypatch):
    """As in a notebook: cell after cell, the last expression of each shown."""
    assert folder
    monkeypatch.delitem(sys.modules, "fading_ekf", raising=False)
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


@pytest.mark.slow
@pytest.mark.parametrize("path", with_commands(PAGES), ids=named)
def test_the_commands_of_a_page_run(path, folder):
    for command in all_commands(path):
        assert run(command, folder)


@pytest.mark.parametrize("path", with_commands(PAGES), ids=named)
def test_the_commands_of_a_page_are_understood(path, folder):
    """The quick half of the test above: their names and options are those that there are."""
    from boresight.interfaces.cli import app

    assert folder
    for command in all_commands(path):
        program, *words = command.split()
        assert program == "boresight"
        if "--help" not in words:
            app.parse_args(words, print_error=False, exit_on_error=False)


def test_the_reference_has_every_public_name():
    text = (DOCS / "reference/python.md").read_text(encoding="utf-8")
    told = re.findall(r"^\.\. auto\w+:: boresight\.(\w+)$", text, re.MULTILINE)
    assert sorted(told) == sorted(boresight._NAMES)


def test_every_command_has_its_help_on_a_page():
    text = (DOCS / "reference/command-line.md").read_text(encoding="utf-8")
    from boresight.interfaces.cli import app

    offered = {name for name in app if not name.startswith("-")}
    assert set(re.findall(r"^\$ boresight (\w+) --help$", text, re.MULTILINE)) == offered


@pytest.mark.slow
def test_the_pages_are_built_without_a_warning(tmp_path):
    build = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    done = subprocess.run(
        [*build, str(DOCS), str(tmp_path)],
        capture_output=True, text=True, check=False, env=os.environ | {"PYTHONWARNINGS": ""},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {str(path.relative_to(DOCS).with_suffix(".html")) for path in DOCS.rglob("*.md")}
    assert all((tmp_path / page).is_file() for page in pages if not page.startswith("_build"))
