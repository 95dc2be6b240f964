"""kashyap's block diagrams: pages whose links lead to code, and arrows that are there."""

import ast
import re
from pathlib import Path

import pytest

from boresight.experiments.papers import kashyap_diagrams
from boresight.experiments.papers.kashyap_diagrams import diagrams
from boresight.experiments.papers.kashyap_methods import Ready
from boresight.experiments.papers.kashyap_study import Study
from boresight.experiments.scenario import paper

PAGE = Path(__file__).parents[1] / "docs" / "papers" / "kashyap.md"
LINK = re.compile(r"\[`(\w+)`\]\(([^)]+)\)")
BOX = re.compile(r"(?:^|-->|\.->|--) *(\w+)\b(?=[\[(]| *--| *-\.| *$)", re.MULTILINE)
TABLE = paper("kashyap")

pytestmark = pytest.mark.skipif(
    not PAGE.exists(), reason="the documentation is not beside the tests"
)


@pytest.fixture(scope="module")
def text():
    return PAGE.read_text(encoding="utf-8")


def defined(path):
    """Names that a module defines."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
        yield from (target.id for target in targets if isinstance(target, ast.Name))


def test_every_link_leads_to_what_it_names(text):
    links = LINK.findall(text)
    assert len(links) >= 15
    assert text.count("](") == len(links)
    for name, target in links:
        path = (PAGE.parent / target).resolve()
        assert path.is_file(), target
        assert name in defined(path), f"{name} in {target}"


def test_there_is_one_drawing_for_each_diagram(text):
    assert text.count("```mermaid") == len(TABLE["diagrams"]) == 4
    assert all(name in text for name in TABLE["diagrams"])


def test_every_box_of_an_arrow_is_drawn_once(text):
    """A misspelt name would make a box of its own, without a label."""
    for drawing in re.findall(r"```mermaid\n(.*?)```", text, re.DOTALL):
        used = set(BOX.findall(drawing))
        labelled = set(re.findall(r"(\w+)(?:\[|\(\()\"", drawing))
        assert used - {"flowchart", "end"} <= labelled, used - labelled


@pytest.fixture(scope="module")
def claims():
    return {claim.id: claim for claim in diagrams(Study(TABLE, 1, 1))}


def test_every_arrow_that_is_drawn_was_found_and_no_other(claims):
    for name, stated in TABLE["diagrams"].items():
        found = {arrow for arrow, there in claims[name].ours.items() if there}
        assert found == set(stated["arrows"])
        assert claims[name].verdict == "reproduces"


def test_an_arrow_that_is_not_there_is_missed(monkeypatch):
    """A method that hands plots on as they are has no arrow from the reference."""

    def nothing(world, _truth, plots):
        return Ready("ekf", world.sensor, plots, {})

    monkeypatch.setattr(kashyap_diagrams, "cmkf_d", lambda _name: nothing)
    claim = {one.id: one for one in diagrams(Study(TABLE, 1, 1))}["KA-FA"]
    assert claim.verdict == "does not reproduce"
    assert not claim.ours["T: reference -> R"]
