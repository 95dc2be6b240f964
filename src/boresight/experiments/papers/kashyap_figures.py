"""kashyap's Figures 3 to 8, drawn from our runs, with the numbers beside them.

Figures 3 to 5 show one run, as the paper's do: errors of range and angles with two standard
deviations as each filter claims them, and the position error. Where a run is one of many, it is
the first. Axes are ours: the paper's curves are not in the text that we have.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from boresight.experiments.papers.figures import draw, sheet
from boresight.experiments.papers.kashyap_runs import Tracked
from boresight.experiments.papers.kashyap_study import Study
from boresight.experiments.papers.kashyap_tables import printed

Array = Any
_INK = {
    "ecmkf": "tab:blue",
    "emekf": "tab:red",
    "cmkf-d-t": "tab:green",
    "cmkf-d-m": "tab:olive",
    "sequential": "tab:red",
    "block": "tab:blue",
}
_DASHES = {"cmkf-d-m": (0, (4, 3)), "block": (0, (4, 3))}  # nearly on top of another line
_CHANNELS = (
    ("range", "m", 1.0),
    ("azimuth", "°", 180.0 / np.pi),
    ("elevation", "°", 180.0 / np.pi),
)


def write(study: Study, folder: Path) -> list[str]:
    """Write KA-F3.png to KA-F8.png, and a CSV file beside each; see `figures.draw`."""
    drawings = {3: _set_1, 4: _set_2, 5: _set_3, 6: _noise, 7: _chart, 8: _blocks}
    return draw(folder, "KA", drawings, study)


def _set_1(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 3."""
    return _one_run(study, study.first, "Set 1: one run")


def _set_3(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 5."""
    world, _ = study.flight
    return _one_run(study, study.third, f"In place of Set 3: {world.source}, one noise")


def _one_run(
    study: Study, found: Mapping[str, Tracked], title: str, rows: int = 2
) -> tuple[Any, dict[str, Array]]:
    """Errors with bounds, and the position error, of the first run."""
    figure, axes = sheet(rows, 2, title)
    seconds = study.worlds["Set 1"].time_s
    columns = {"time_s": seconds}
    pair = {method: found[method] for method in study.pair}
    for i, (name, unit, scale) in enumerate(_CHANNELS):
        lines = {
            m: (scale * one.off[0, :, i], scale * one.bounds[0, :, i]) for m, one in pair.items()
        }
        columns |= _errors(axes.flat[i], seconds, lines, f"{name} error, {unit}")
    place = axes.flat[3]
    for method, one in pair.items():
        error = np.sqrt(one.square[0])
        place.plot(seconds, error, color=_INK[method], linewidth=1.0, label=method.upper())
        columns[f"RSSPE {method}, m"] = error
    place.set(xlabel="time, s", ylabel="RSSPE, m", title="root sum square position error")
    _finish(place)
    return figure, columns


def _errors(
    place: Any, seconds: Array, lines: Mapping[str, tuple[Array, Array]], label: str
) -> dict[str, Array]:
    """Errors and, dotted, their bounds; the axis is that of the errors."""
    columns: dict[str, Array] = {}
    largest = 0.0
    for method, (off, bound) in lines.items():
        place.plot(seconds, off, color=_INK[method], linewidth=1.0, label=method.upper())
        for side in (bound, -bound):
            place.plot(seconds, side, color=_INK[method], linewidth=0.8, linestyle=":")
        stem = f"{label.replace('°', 'deg')} {method}"
        columns |= {stem: off, f"{stem}, bound": bound}
        largest = max(largest, float(np.max(np.abs(off))))
    limit = 1.6 * largest
    place.set(xlabel="time, s", ylabel=label, ylim=(-limit, limit))
    place.set_title(f"{label.split(maxsplit=1)[0]}, dotted: two standard deviations claimed")
    _finish(place)
    return columns


def _finish(place: Any) -> None:
    place.grid(alpha=0.3)
    place.title.set_fontsize("small")
    place.legend(fontsize="small")


def _set_2(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 4: one run, and averages over the noises of the first truth."""
    noises = study.assumed["noises_per_truth"]
    figure, columns = _one_run(study, study.second, "Set 2: one run; below, averages", 3)
    seconds = columns["time_s"]
    elevation, position = figure.axes[4:]
    for method, one in study.many.items():
        up, error = np.degrees(one.elevation[0]), one.rsspe[0]
        elevation.plot(seconds, up, color=_INK[method], linewidth=1.0, label=method.upper())
        position.plot(seconds, error, color=_INK[method], linewidth=1.0, label=method.upper())
        columns[f"elevation {method}, {noises} runs, deg RMS"] = up
        columns[f"RSSPE {method}, {noises} runs, m"] = error
    elevation.set(
        xlabel="time, s", ylabel="elevation error, ° RMS", title=f"{noises} noises of one truth"
    )
    position.set(xlabel="time, s", ylabel="RSSPE, m", title=f"{noises} noises of one truth")
    for place in (elevation, position):
        _finish(place)
    return figure, columns


def _noise(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 6."""
    figure, axes = sheet(
        1, 2, "Set 4, one run: the variance that each method gives a plot", (5.5, 3.8)
    )
    seconds = study.worlds["Set 4"].time_s
    columns = {"time_s": seconds}
    for axis, (place, label) in enumerate(zip(axes[0], "xy", strict=True)):
        for method, values in study.noises.first.items():
            line = values[:, axis]
            style = _DASHES.get(method, "-")
            place.plot(
                seconds,
                line,
                color=_INK[method],
                linewidth=1.1,
                linestyle=style,
                label=method.upper(),
            )
            columns[f"R_{label}{label} {method}, m2"] = line
        place.set(xlabel="time, s", ylabel=f"R_{label}{label}, m²", yscale="log")
        _finish(place)
    return figure, columns


def _chart(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 7: medians and 5 to 95 % of our runs, the paper's numbers on top."""
    found = {"KA-T2": study.first, "KA-T3": study.second, "KA-T6": study.fourth}
    figure, axes = sheet(
        3, 1, "Percent fit errors: bars are medians of single runs, lines 5 to 95 %", (9.0, 2.9)
    )
    columns: dict[str, Array] = {}
    for place, (name, one) in zip(axes[:, 0], found.items(), strict=True):
        table = study.table["tables"][name]
        methods = printed(table)
        for j, (method, stated) in enumerate(methods.items()):
            values = np.array([np.quantile(one[method].pfe[c], (0.05, 0.5, 0.95)) for c in stated])
            at = np.arange(len(stated)) + (j - (len(methods) - 1) / 2) * 0.8 / len(methods)
            low, middle, high = values.T
            place.bar(
                at, middle, 0.75 / len(methods), color=_INK[method], alpha=0.6, label=method.upper()
            )
            place.vlines(at, low, high, color=_INK[method], linewidth=1.5)
            label = "printed" if j == 0 else None
            place.plot(
                at, list(stated.values()), "k_", markersize=9, markeredgewidth=1.8, label=label
            )
            columns |= _bars(f"{table['where']} {method}", stated, values)
        place.set(yscale="log", ylabel="fit error, %", title=table["where"])
        place.set_ylim(top=4.0 * place.get_ylim()[1])  # room for the legend
        place.yaxis.set_major_formatter("{x:g}")
        place.yaxis.set_minor_formatter("")
        place.set_xticks(np.arange(len(stated)), labels=list(stated))
        _finish(place)
        place.legend(fontsize="x-small", ncols=5)
    return figure, columns


def _bars(name: str, stated: Mapping[str, float], values: Array) -> dict[str, Array]:
    """One row of the table: every bar has its own columns."""
    found: dict[str, Array] = {}
    for channel, (low, middle, high) in zip(stated, values, strict=True):
        found |= {
            f"{name} {channel} printed": np.array([stated[channel]]),
            f"{name} {channel} median": np.array([middle]),
            f"{name} {channel} 5%": np.array([low]),
            f"{name} {channel} 95%": np.array([high]),
        }
    return found


def _blocks(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 8: the first truth above; below, the difference, averaged over all truths."""
    noises = study.assumed["noises_per_truth"]
    title = f"10 degrees: sequential and block processing, {noises} noises of one truth"
    figure, axes = sheet(2, 3, title)
    seconds = study.worlds["10 degrees"].time_s
    columns = {"time_s": seconds}
    for (above, below), (reading, found) in zip(axes.T, study.blocks.items(), strict=True):
        for method, one in found.items():
            style = _DASHES.get(method, "-")
            above.plot(
                seconds,
                one.rsspe[0],
                color=_INK[method],
                linewidth=1.1,
                linestyle=style,
                label=method,
            )
            columns[f"RSSPE {method}, {reading}, m"] = one.rsspe[0]
        gap = np.mean(found["sequential"].rsspe - found["block"].rsspe, axis=0)
        columns[f"sequential minus block, all truths, {reading}, m"] = gap
        below.plot(
            seconds, gap, color="black", linewidth=1.0, label=f"mean of {study.truths} truths"
        )
        below.axhline(0.0, color="gray", linewidth=0.8)
        above.set(ylabel="RSSPE, m", title=reading)
        below.set(xlabel="time, s", ylabel="sequential minus block, m")
        _finish(above)
        _finish(below)
    return figure, columns
