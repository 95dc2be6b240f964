"""The screen of a repeated paper: numbers beside each other, at any width."""

import io

import pytest
from rich.console import Console, Group

from boresight.interfaces.screens_reproduce import reproduced


def claim(name, verdict="reproduces", **given):
    return {"id": name, "where": "here", "published": "some words", "ours": {}, "band": None,
            "verdict": verdict, "assumption": ""} | given  # fmt: skip


def shown(*claims, width=100, papers=("paper",), runs=None):
    file = io.StringIO()
    found = {
        "claims": list(claims),
        "seed": 7,
        "runs": runs,
        "assumed": {key: {} for key in papers},
    }
    Console(file=file, width=width, color_system=None).print(
        Group(*reproduced("paper", found, width))
    )
    return [line.rstrip() for line in file.getvalue().splitlines()]


def line_with(lines, word):
    return next(line for line in lines if word in line).split()


def test_numbers_of_one_name_stand_in_one_row():
    one = claim("P-1", published={"range": 4000.0}, ours={"range": 4001.0, "runs": 300},
                band={"range": (3900.0, 4100.0)})  # fmt: skip
    lines = shown(one)
    assert line_with(lines, "published") == ["published", "ours", "band", "of", "ours"]
    assert line_with(lines, "range") == ["range", "4,000", "4,001", "3,900", "to", "4,100"]
    assert line_with(lines, "runs") == ["runs", "300"]


def test_numbers_by_time_are_columns_and_printed_ones_are_among_them():
    times = {"1 s": 0.5, "2 s": 0.25}
    lines = shown(
        claim("P-1", published={"1 s": 1.0, "2 s": 2.0}, ours={"RP": times, "EKF": times})
    )
    assert line_with(lines, "1 s") == ["1", "s", "2", "s"]
    assert line_with(lines, "published") == ["published", "1.00", "2.00"]
    assert line_with(lines, "EKF") == ["EKF", "0.500", "0.250"]


def test_columns_that_are_too_many_are_rows():
    values = {f"a long name, {i}": float(i) for i in range(1, 9)}
    lines = shown(claim("P-1", ours={"first": values, "second": values}))
    assert line_with(lines, "first") == ["first", "second"]
    assert line_with(lines, "a long name, 3") == ["a", "long", "name,", "3", "3.00", "3.00"]


def test_parts_are_told_where_they_are_not_alike():
    alike = [claim("P-1 good"), claim("P-1 better")]
    unlike = [claim("P-2 good"), claim("P-2 bad", "does not reproduce")]
    lines = shown(claim("P-1", parts=alike), claim("P-2", "in band", parts=unlike))
    assert not any("better" in line for line in lines)
    assert "  reproduces          good" in lines
    assert "  does not reproduce  bad" in lines


def test_verdicts_are_counted_first_and_listed_at_the_end():
    lines = shown(claim("P-1"), claim("P-2", "cannot be checked"), claim("P-3"))
    assert lines[0] == (
        "paper, 3 rows: reproduces 2, in band 0, does not reproduce 0, cannot be checked 1"
    )
    assert lines[-4].split() == ["reproduces", "2", "P-1", "P-3"]
    assert lines[-3].split() == ["cannot", "be", "checked", "1", "P-2"]
    assert lines[-1].startswith("seed 7, as many runs as each claim needs; -o DIR")


def test_of_all_papers_a_claim_is_a_line_and_a_paper_a_row_of_counts():
    long = claim("BO-F1", published="many words " * 30)
    lines = shown(
        claim("AD-T1", where="Table 1", published=1.0), long, claim("BO-C1", "does not reproduce"),
        papers=("aditya", "bordonaro"), runs=50, width=80,
    )  # fmt: skip
    assert line_with(lines, "AD-T1") == ["AD-T1", "✓", "reproduces", "Table", "1"]
    assert line_with(lines, "BO-C1")[:5] == ["BO-C1", "✗", "does", "not", "reproduce"]
    assert sum("many words" in line for line in lines) == 1
    assert line_with(lines, "aditya")[1:] == ["1", "0", "0", "0"]
    assert line_with(lines, "bordonaro")[1:] == ["1", "0", "1", "0"]
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("width", [60, 80, 100])
def test_no_line_is_too_wide(width):
    values = {f"a long name of a column, number {i}": 1e6 + i for i in range(12)}
    one = claim(
        "P-1", published="many words " * 30, ours={"x" * 50: values, "y": values, "z": True}
    )
    assert max(map(len, shown(one, width=width))) <= width


def test_what_has_no_number_is_a_dash_and_true_is_yes():
    lines = shown(claim("P-1", ours={"none": None, "true": True, "list": [1, 2, 3, 4, 5]}))
    assert line_with(lines, "none") == ["none", "–"]
    assert line_with(lines, "true") == ["true", "yes"]
    assert line_with(lines, "list") == ["list", "1,", "2,", "...", "5"]
