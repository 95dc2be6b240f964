"""No row of a paper is without a verdict: the papers' own lists, and the list of all rows."""

import re
from pathlib import Path

import pytest

from boresight.experiments.reproduce import claim_ids, paper_keys, reproduce

CHECKLIST = Path(__file__).parents[1] / ".." / "shared" / "CHECKLIST.md"
PAPERS = {"AD": "aditya", "BO": "bordonaro", "KA": "kashyap", "PR": "pradeep"}
# Methods (M) and data formats (D) are code, held to laws and oracles; a verdict needs a statement.
# One method is a statement too: BO-M11, what the bounds of section 4.2 depend on.
JUDGED = "STFXCEW"
ALSO = {"BO-M11"}
# "appendix schematic" in the list has no number of its own.
NAMED_HERE = {"KA-FA"}
FEWEST = 115


def expanded(cell):
    """IDs that a cell names: `KA-T2..T6`, `KA-F1a,b F2`, `KA-F3a-d F4a-f`, `AD-C1` (`C2` below)."""
    found, paper = [], cell[:2]
    pattern = r"(?:(?:AD|BO|KA|PR)-)?([A-Z])(\d+)([a-z]?)(?:\.\.(?:[A-Z])?(\d+)|-([a-z])|,([a-z]))?"
    for kind, number, letter, last, to, and_ in re.findall(pattern, cell):
        width = len(number)
        numbers = range(int(number), int(last or number) + 1)
        letters = [chr(c) for c in range(ord(letter), ord(to or letter) + 1)] if letter else [""]
        letters += [and_] if and_ else []
        found += [f"{paper}-{kind}{n:0{width}d}{each}" for n in numbers for each in letters]
    return found


def listed(text):
    """Every ID of the list; further ones stand in the text of a row, after a semicolon."""
    rows = re.findall(r"^\| ((?:AD|BO|KA|PR)-[^|]+) \| ([^|]+) \|", text, re.MULTILINE)
    found = []
    for cell, words in rows:
        found += expanded(cell)
        more = re.findall(r"; ((?:(?:AD|BO|KA|PR)-)?[STFXCEW]\d+)\b", words)
        found += [each for token in more for each in expanded(f"{cell[:2]}-{token[-2:].lstrip('-')}"
                  if "-" not in token else token)]  # fmt: skip
    return set(found)


def test_ids_are_read_as_they_are_written():
    assert expanded("KA-T2..T6") == [f"KA-T{i}" for i in range(2, 7)]
    assert expanded("KA-F1a,b F2, appendix schematic") == ["KA-F1a", "KA-F1b", "KA-F2"]
    assert expanded("KA-F3a-d F6") == ["KA-F3a", "KA-F3b", "KA-F3c", "KA-F3d", "KA-F6"]
    assert expanded("BO-S01..S08")[-1] == "BO-S08"
    assert expanded("BO-W1,W2") == ["BO-W1", "BO-W2"]
    row = "| AD-C1 | MEKF < EKF (no); C2 'so much' (A8); C3 velocities | house |\n"
    assert listed(row) == {"AD-C1", "AD-C2", "AD-C3"}
    assert listed("| PR-S02 | none; PR-S03 random | tma |\n") == {"PR-S02", "PR-S03"}


@pytest.mark.skipif(not CHECKLIST.exists(), reason="the list of all rows is not on this machine")
def test_every_row_of_the_list_is_in_the_papers_tables():
    wanted = {each for each in listed(CHECKLIST.read_text("utf-8")) if each[3] in JUDGED} | ALSO
    ours = {each for key in paper_keys() for each in claim_ids(key)}
    assert ours == wanted | NAMED_HERE
    assert len(ours) >= FEWEST


@pytest.fixture(scope="module")
def found():
    return reproduce("all", runs=8)


def test_every_id_has_one_verdict_in_the_papers_order(found):
    expected = [each for key in paper_keys() for each in claim_ids(key)]
    assert [claim["id"] for claim in found["claims"]] == expected
    assert len(set(expected)) == len(expected) >= FEWEST
    assert {PAPERS[each[:2]] for each in expected} == set(paper_keys())


def test_every_verdict_has_its_place_and_its_reason(found):
    assert all(claim["where"] for claim in found["claims"])
    unchecked = [c for c in found["claims"] if c["verdict"] == "cannot be checked"]
    assert unchecked
    assert all(claim["assumption"] for claim in unchecked)


def test_what_was_assumed_is_told_with_its_reason(found):
    assert list(found["assumed"]) == list(paper_keys())
    entries = [entry for names in found["assumed"].values() for entry in names.values()]
    assert all(entry["why"] for entry in entries)
    assert found["assumed"]["pradeep"]["cells"]["value"] == 6
