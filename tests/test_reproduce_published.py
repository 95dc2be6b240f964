"""Numbers that a paper prints stand in its table and nowhere else: all literals are looked through.

A number counts from three significant digits on in the package, and from four on in tests and
benches, where rounder ones meet by chance. Numbers in texts and comments count as literals do.
What is assumed is ours and does not count.
"""

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from boresight.experiments.reproduce import paper_keys
from boresight.experiments.scenario import paper

ROOT = Path(__file__).parents[1]
SPEED = paper("pradeep")["printed"]["target_speed"]
OURS = ("paper", "assumed", "why")
# By file: the number, and why it may stand there.
MET_BY_CHANCE = {
    "src/boresight/interfaces/report/beside.py": ({1.15}, "room at the end of an axis"),
    "src/boresight/interfaces/report/verdict.py": ({1.15}, "scatter that is called too large"),
    "src/boresight/models/error_model.py": ({1.15}, "what quantisation does to a variance"),
    "tests/oracles/pradeep.py": (
        {SPEED},
        "an oracle is written from the paper, not from our table",
    ),
    "tests/tma/test_bearing_residuals.py": ({SPEED}, "a target's speed, as good as any other"),
}


def digits(number: float) -> int:
    """Significant ones, without zeros at the end: 4000 has one, 4321.5 five."""
    return len(f"{abs(number):.12g}".split("e")[0].replace(".", "").strip("0"))


def numbers(value: Any) -> Iterator[float]:
    """All numbers in a table's values, those in words too."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for each in value:
            yield from numbers(each)
    elif isinstance(value, str):
        yield from map(float, re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\w)", value))
    elif not isinstance(value, bool):
        yield float(value)


def published() -> set[float]:
    tables = [{k: v for k, v in paper(key).items() if k not in OURS} for key in paper_keys()]
    return {number for number in numbers(tables) if digits(number) >= 3}


def literals(source: str) -> Iterator[float]:
    """Every number of a source file: literals, and those in its texts and comments."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NUMBER:
            plain = token.string.replace("_", "").rstrip("jJ")
            yield float(int(plain, 0)) if re.match(r"0[xXoObB]", plain) else float(plain)
        elif token.type in (tokenize.STRING, tokenize.COMMENT):
            yield from numbers(token.string)


def repeated(folder: str, fewest: int) -> dict[str, set[float]]:
    """By file of a folder, published numbers of so many digits in it."""
    known = {number for number in published() if digits(number) >= fewest}
    files = sorted((ROOT / folder).rglob("*.py"))
    assert len(files) >= 10
    texts = {str(path.relative_to(ROOT)): path.read_text("utf-8") for path in files}
    found = {name: known & set(literals(text)) for name, text in texts.items()}
    return {name: each for name, each in found.items() if each}


@pytest.mark.parametrize(("folder", "fewest"), [("src/boresight", 3), ("tests", 4), ("bench", 4)])
def test_published_numbers_stand_in_the_papers_tables_only(folder, fewest):
    found = repeated(folder, fewest)
    unexpected = {
        name: each - MET_BY_CHANCE.get(name, (set(), ""))[0] for name, each in found.items()
    }
    assert {name: each for name, each in unexpected.items() if each} == {}


def test_no_exception_is_kept_that_is_not_needed():
    found = repeated("src/boresight", 3) | repeated("tests", 4)
    for name, (expected, why) in MET_BY_CHANCE.items():
        assert found[name] >= expected, (name, why)


def test_other_tables_of_the_package_hold_none():
    """Its data files too: the built-in recording's truth, the items of ASTERIX, ..."""
    known = {number for number in published() if digits(number) >= 4}
    files = [p for p in (ROOT / "src/boresight").rglob("*") if p.suffix in {".toml", ".json"}]
    others = [p for p in files if p.stem not in paper_keys()]
    assert others
    for path in others:
        assert not known & set(numbers(path.read_text("utf-8"))), path.name


def test_published_numbers_are_found_in_the_tables():
    """Of each paper one that is known to stand there; and none that is assumed."""
    known = published()
    assert len(known) >= 80
    tables = [paper(key) for key in paper_keys()]
    assert {
        table["tables"]["PR-T1"]["true_range_m"] for table in tables if "printed" in table
    } <= known
    assert all({table["time"]["seconds"]} <= known for table in tables if "time" in table)
    assert {float(n) for n in paper("kashyap")["tables"]["KA-T6"]["ecmkf"].values()} <= known


@pytest.mark.parametrize("form", ["x = {}", "x = -{}", "# it is {} m", "f('{} m')", "x = [{}, 2]"])
def test_a_planted_number_is_seen(form):
    number = paper("pradeep")["tables"]["PR-T1"]["range_m"]
    assert digits(number) >= 4
    assert published() & set(literals(form.format(number) + "\n")) == {number}
