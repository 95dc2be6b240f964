"""Every table, figure and claim of a paper again, each with a verdict."""

from collections.abc import Callable
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any

from boresight.errors import UsageError

_PAPERS = ("aditya",)
SEED = 1


def paper_keys() -> tuple[str, ...]:
    """Keys of the papers that can be reproduced."""
    return _PAPERS


def reproduce(
    key: str, *, runs: int | None = None, seed: int = SEED, output: str | Path | None = None
) -> dict[str, Any]:
    """Run a paper again and judge every table, figure and claim of it.

    Args:
        key: of the paper, or `all`.
        runs: Monte Carlo runs; left out, as many as the paper's claims need.
        seed: of all that is random.
        output: folder for the figures; left out, none are drawn.

    Returns:
        `claims`, each with `id`, `where`, `published`, `ours`, `band`, `verdict`, `assumption`
        (and `parts` where it has some); `figures`, the files written; `seed`.

    Raises:
        UsageError: an unknown paper.
        MissingExtraError: figures are asked for and matplotlib is not installed.
    """
    keys = _PAPERS if key == "all" else (_known(key),)
    folder = None if output is None else Path(output)
    results = [_paper(name)(runs=runs, seed=seed, output=folder) for name in keys]
    return {
        "claims": [claim.as_dict() for claims, _ in results for claim in claims],
        "figures": [file for _, files in results for file in files],
        "seed": seed,
    }


def _known(key: str) -> str:
    if key in _PAPERS:
        return key
    near = get_close_matches(key, _PAPERS, n=1)
    raise UsageError(
        f"no paper {key!r} can be reproduced" + (f"; did you mean {near[0]!r}?" if near else ""),
        next_step=f"use one of {', '.join(_PAPERS)}, or all",
    )


def _paper(key: str) -> Callable[..., Any]:
    module = import_module(f"boresight.experiments.papers.{key}")
    return module.reproduce  # type: ignore[no-any-return]
