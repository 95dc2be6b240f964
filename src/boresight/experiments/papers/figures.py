"""Figures as files: a picture, and beside it a table of the numbers in it."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from boresight.errors import MissingExtraError, OutputError

Array = Any
Drawing = Callable[[Any], tuple[Any, Mapping[str, Array]]]
_DOTS_PER_INCH = 150


def require() -> None:
    """Raise MissingExtraError if figures cannot be drawn."""
    try:
        import matplotlib.figure  # noqa: F401 - only whether it is there
    except ImportError as error:
        raise MissingExtraError(
            "figures need matplotlib, which is not installed",
            next_step="pip install 'boresight[figures]'",
        ) from error


@contextmanager
def writing_into(folder: Path) -> Iterator[None]:
    """Make a folder if it is not there; OutputError if it cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise OutputError(
            f"cannot write figures into {folder}", why=str(error), next_step="give another folder"
        ) from error


def sheet(
    rows: int, columns: int, title: str, size: tuple[float, float] = (4.5, 3.2)
) -> tuple[Any, Array]:
    """A figure and its axes (rows, columns), each of `size` inches."""
    from matplotlib.figure import Figure

    wide, high = max(columns * size[0], 6.5), rows * size[1] + 0.4
    figure = Figure(figsize=(wide, high), layout="constrained")
    figure.suptitle(title, fontsize="medium")
    return figure, figure.subplots(rows, columns, squeeze=False)


def ratio_axis(place: Any) -> None:
    """A logarithmic y axis whose numbers are read at a glance."""
    place.set_yscale("log")
    place.minorticks_off()
    place.set_yticks([1, 2, 3, 5, 10, 20], labels=["1", "2", "3", "5", "10", "20"])
    place.autoscale()


def draw(
    folder: Path, prefix: str, drawings: Mapping[int, Drawing] | Mapping[str, Drawing], study: Any
) -> list[str]:
    """Write every figure as PREFIX-F<number>.png, and its numbers as CSV beside it.

    Args:
        folder: made if it is not there.
        prefix: of the paper.
        drawings: by number, or by the name of what it shows instead of F<number>: what makes of
            the study a figure and its columns.
        study: what is drawn.

    Returns:
        The files' names.

    Raises:
        OutputError: the folder cannot be written.
    """
    files = []
    with writing_into(folder):
        for number, drawing in drawings.items():
            figure, columns = drawing(study)
            named = {name.replace(",", ""): values for name, values in columns.items()}  # in a CSV
            name = f"F{number}" if isinstance(number, int) else number
            files += save(figure, folder / f"{prefix}-{name}", named)
    return files


def save(figure: Any, path: Path, columns: Mapping[str, Array]) -> list[str]:
    """Write a figure as PNG and its numbers as CSV.

    Args:
        figure: of matplotlib.
        path: of both files, without suffix.
        columns: numbers by name, each as long as the others.

    Returns:
        The files' names.
    """
    figure.savefig(path.with_suffix(".png"), dpi=_DOTS_PER_INCH)
    np.savetxt(
        path.with_suffix(".csv"),
        np.stack(list(columns.values()), axis=-1),
        delimiter=",",
        header=",".join(columns),
        comments="",
        fmt="%.9g",
    )
    return [str(path.with_suffix(suffix)) for suffix in (".png", ".csv")]
