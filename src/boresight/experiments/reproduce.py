"""Every table, figure and claim of a paper again, each with a verdict."""

import json
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from boresight.errors import UsageError, unknown
from boresight.experiments.scenario import paper

_PAPERS = ("aditya", "bordonaro", "kashyap", "pradeep")
SEED = 1


def paper_keys() -> tuple[str, ...]:
    """Keys of the papers that can be reproduced."""
    return _PAPERS


def claim_ids(key: str) -> tuple[str, ...]:
    """Every setting, table, figure, metric and claim of a paper that gets a verdict, in order."""
    return tuple(paper(key)["paper"]["ids"])


def reproduce(
    key: str,
    *,
    runs: int | None = None,
    seed: int = SEED,
    output: str | Path | None = None,
    assume: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Run a paper again and judge every table, figure and claim of it.

    Args:
        key: of the paper, or `all`.
        runs: Monte Carlo runs; left out, as many as the paper's claims need. Fewer take less time
            and leave bands wider: more is then undecided, `in band`, and nothing else changes.
        seed: of all that is random.
        output: folder for the figures; left out, none are drawn.
        assume: what a paper leaves open, by the names in its table's `assumed`, such as
            {"dt_s": 2.0}; left out, as the table has it, with a reason for each.
        progress: is told the paper that is reproduced next.

    Returns:
        `claims`, each with `id`, `where`, `published`, `ours`, `band`, `verdict`, `assumption`
        (and `parts` where it has some); `figures`, the files written; `seed`; `runs`, as asked for
        or None; `assumed`, by paper and name each `value` and `why`.

    Raises:
        UsageError: an unknown paper or assumption, or fewer runs than one.
        MissingExtraError: figures are asked for and matplotlib is not installed.
    """
    if runs is not None and runs < 1:
        raise UsageError(
            f"runs={runs} is less than one", next_step="leave it out for the paper's own number"
        )
    keys = _PAPERS if key == "all" else (_known(key),)
    folder = None if output is None else Path(output)
    tables = {name: _assuming(name, assume or {}) for name in keys}
    claims, files = [], []
    for name, table in tables.items():
        progress(name)
        found, drawn = _paper(name)(table, runs=runs, seed=seed, output=folder)
        order = table["paper"]["ids"]
        claims += sorted(found, key=lambda claim: order.index(claim.id))
        files += drawn
    return {
        "claims": [claim.as_dict() for claim in claims],
        "figures": files,
        "seed": seed,
        "runs": runs,
        "assumed": {name: _reasons(table) for name, table in tables.items()},
    }


def _known(key: str) -> str:
    if key in _PAPERS:
        return key
    raise unknown("paper", key, (*_PAPERS, "all"))


def _reasons(table: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """What is assumed, by name: its value, and why."""
    return {
        name: {"value": value, "why": table["why"][name]}
        for name, value in table["assumed"].items()
    }


def _assuming(key: str, assume: Mapping[str, Any]) -> dict[str, Any]:
    """A paper's table with assumptions changed."""
    table = paper(key)
    for name, value in assume.items():
        usual = table["assumed"].get(name)
        if usual is None:
            raise unknown(f"assumption of {key}", name, table["assumed"])
        if _kind(value) != _kind(usual):
            raise UsageError(
                f"{name}={value!r} cannot stand for {key}'s {name}={usual!r}",
                why="it must be of the same kind: a number, a word, or a list of them",
                next_step=f"as it is: --assume {name}={json.dumps(usual)}",
            )
    asked = {name: f"asked for: {name} = {value}" for name, value in assume.items()}
    why = table["why"] | asked  # reasons are those of the usual assumptions
    return table | {"assumed": table["assumed"] | dict(assume), "why": why}


def _kind(value: Any) -> tuple[str, int]:
    """Text or numbers, and whether they are a list."""
    array = np.asarray(value)
    return "number" if array.dtype.kind in "iuf" else array.dtype.kind, array.ndim


def _paper(key: str) -> Callable[..., Any]:
    module = import_module(f"boresight.experiments.papers.{key}")
    return module.reproduce  # type: ignore[no-any-return]
