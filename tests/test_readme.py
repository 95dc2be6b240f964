"""What the README shows is what happens."""

import contextlib
import io
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
sys.path.insert(0, str(ROOT / "docs"))
from examples import blocks, call, commands, differs, furnish, run, told  # noqa: E402 - the pages' own

COMMANDS = [c for block in blocks(README, "console") for c in commands(block)]
ALL_PAPERS = "boresight reproduce all -o out"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where examples run, as a user."""
    monkeypatch.chdir(furnish(tmp_path / "here"))
    return Path.cwd()


def test_the_python_of_the_readme_prints_what_it_says():
    text = README.read_text(encoding="utf-8")
    code, shown = re.search(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, re.DOTALL).groups()
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, str(README), "exec"), {})  # noqa: S102 - our own README
    assert printed.getvalue() == shown


def test_the_commands_of_the_readme_print_what_it_says(folder):
    """All but the papers, which take minutes, and make, whose targets must be there."""
    assert folder
    targets = (ROOT / "Makefile").read_text(encoding="utf-8")
    for block in blocks(README, "console"):
        for command, said in told(block):
            if command.startswith("make "):
                assert f"\n{command.split()[1]}:" in targets
            elif command != ALL_PAPERS:
                assert differs(said, call(command)) is None, command
    assert ALL_PAPERS in COMMANDS


def test_the_demo_prints_what_the_readme_says(folder):
    assert folder
    assert "$(BIN)/boresight demo\n" in (ROOT / "Makefile").read_text(encoding="utf-8")
    said = next(text for text in blocks(README, "text") if "planted" in text)
    assert differs(said, call("boresight demo")) is None


def test_the_study_that_the_readme_shows_is_the_one_that_it_runs():
    shown, path = blocks(README, "toml")[0], "examples/studies/poor-bearings.toml"
    assert any(path in command for command in COMMANDS)
    remark, _, study = (ROOT / path).read_text(encoding="utf-8").partition("\n")
    assert remark.startswith("#")
    assert shown == study


@pytest.mark.slow
def test_the_papers_of_the_readme_are_reproduced(folder):
    assert "wrote out/report.html" in run(ALL_PAPERS, folder)


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_every_file_that_a_page_points_to_is_there(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#:]+)[^)]*\)", text):
        assert (ROOT / target).exists(), target
