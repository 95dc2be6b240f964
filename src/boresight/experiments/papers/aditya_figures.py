"""aditya's Figures 2 to 8, drawn from one run of ours, with the numbers beside them."""

from pathlib import Path
from typing import Any

import numpy as np

from boresight.experiments.papers.aditya_study import Study
from boresight.experiments.papers.figures import save, writing_into

Array = Any
_INK = {"truth": "tab:green", "ekf": "tab:blue", "mekf": "tab:red"}  # the paper's own colours
_INCHES = (7.0, 4.0)


def write(one: Study, folder: Path) -> list[str]:
    """Write AD-F2.png to AD-F8.png, and a CSV file beside each.

    Args:
        one: its first run is drawn.
        folder: made if it is not there.

    Returns:
        The files' names.

    Raises:
        OutputError: the folder cannot be written.
    """
    states = one.truth.names
    curves = {"truth": one.truth.states[0]}
    curves |= {name: estimate.mean[0] for name, estimate in one.estimates.items()}
    files = []
    with writing_into(folder):
        for i, state in enumerate(states):
            lines = {name: values[:, i] for name, values in curves.items()}
            files += _plot(folder / f"AD-F{i + 2}", one.truth.time_s, [(state, lines)])
        files += _plot(folder / f"AD-F{len(states) + 2}", one.truth.time_s, _errors(states, curves))
    return files


def _errors(states: tuple[str, ...], curves: dict[str, Array]) -> list[tuple[str, Any]]:
    truth = curves["truth"]
    found = {name: np.abs(values - truth) for name, values in curves.items() if name != "truth"}
    return [
        (f"|error| {state}", {name: values[:, i] for name, values in found.items()})
        for i, state in enumerate(states)
    ]


def _plot(path: Path, time_s: Array, panels: list[tuple[str, dict[str, Array]]]) -> list[str]:
    from matplotlib.figure import Figure

    height = _INCHES[1] * (1 if len(panels) == 1 else 2)
    figure = Figure(figsize=(_INCHES[0], height), layout="constrained")
    columns = 1 if len(panels) == 1 else 2
    axes = figure.subplots(-(-len(panels) // columns), columns, squeeze=False)
    for place, (label, lines) in zip(axes.flat, panels, strict=True):
        for name, values in lines.items():
            place.plot(time_s, values, label=name.upper(), color=_INK[name], linewidth=1)
        place.set(xlabel="time, s", ylabel=label)
        place.legend(fontsize="small")
    columns_of = {"time_s": time_s} | {
        f"{label} {name}": values for label, lines in panels for name, values in lines.items()
    }
    return save(figure, path, columns_of)
