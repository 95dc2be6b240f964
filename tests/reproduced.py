"""What the tests of every reproduced paper look at: its rows, their parts, its figures' data."""

import csv

import numpy as np

KEYS = {"id", "where", "published", "ours", "band", "verdict", "assumption"}
VERDICTS = {"reproduces", "in band", "does not reproduce", "cannot be checked"}


def parts(claim):
    """The parts of a claim by their own names."""
    return {part["id"].removeprefix(f"{claim['id']} "): part for part in claim["parts"]}


def numbers(folder, name):
    """A figure's table of numbers, by column."""
    with (folder / f"{name}.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))
