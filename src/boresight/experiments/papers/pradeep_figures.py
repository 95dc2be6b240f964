"""pradeep's Figures 1 to 6, drawn from our runs, and what its claims show, with the numbers.

Where one run is drawn it is the one that converges at the median time. Axes are ours: the paper's
curves are not in the text that we have.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from boresight.experiments.papers.figures import Drawing, draw, sheet
from boresight.experiments.papers.pradeep_study import NEAR, Study
from boresight.experiments.papers.pradeep_tracked import QUANTITIES, Tracked, own_ship
from boresight.experiments.papers.pradeep_truths import BEYOND
from boresight.experiments.papers.pradeep_words import rms

Array = Any
# Colours that are told apart without red and green (M. Okabe and K. Ito).
_INK = {"RP": "#d55e00", "MGEKF": "#0072b2", "EKF": "#009e73", NEAR: "#56b4e9"}
_KM = 1e-3
_BESIDE = ("o", "x")  # markers of what filters are held against
_EARLY_S = 300.0  # what happens when own ship turns is over


def write(study: Study, folder: Path) -> list[str]:
    """Write PR-F1.png to PR-F6.png and PR-C1, C3, C4.png, each with a CSV file; see `draw`."""
    drawings: dict[str, Drawing] = {
        "F1": partial(_tracks, label="RP"),
        "F2": partial(_tracks, label="MGEKF"),
        **{f"F{i}": partial(_error, quantity=name) for i, name in enumerate(QUANTITIES, start=3)},
        "C1": _times,
        "C3": _anywhere,
        "C4": _weights,
    }
    return draw(folder, "PR", drawings, study)


def _median_run(one: Tracked) -> int:
    """The run that converges at the median time."""
    return int(np.argsort(one.converged, kind="stable")[len(one.converged) // 2])


def _tracks(study: Study, label: str) -> tuple[Any, dict[str, Array]]:
    """Figures 1 and 2: the whole run, and the time when own ship turns, closer."""
    one = study.tracked[label]
    run = _median_run(one)
    seconds = study.time_s
    ways = {
        "own ship": own_ship(study.world),
        "target": one.truth.states[run, :, :2],
        label: one.estimate.mean[run, :, :2],
    }
    figure, axes = sheet(
        1, 2, f"{label}: the run that converges at {one.converged[run]:.0f} s", (6.0, 3.5)
    )
    early = study.at(_EARLY_S)
    for place, last in ((axes[0, 0], len(seconds) - 1), (axes[0, 1], early)):
        _ways(place, ways, label, last, study.at(one.converged[run]))
        _view(place, [ways["own ship"][: last + 1], ways["target"][: last + 1]])
        place.set_title(f"{seconds[0]:.0f} to {seconds[last]:.0f} s")
    _bearing_lines(axes[0, 1], study, run, early)
    named = [zip(*place.get_legend_handles_labels()[::-1], strict=True) for place in axes[0]]
    shown = dict(named[0]) | dict(named[1])
    axes[0, 0].legend(shown.values(), shown.keys(), fontsize="small", loc="lower left")
    _finish(axes)
    columns = {"time_s": seconds}
    for name, way in ways.items():
        columns |= {f"{name} north_m": way[:, 0], f"{name} east_m": way[:, 1]}
    return figure, columns


def _ways(place: Any, ways: Mapping[str, Array], label: str, last: int, converged: int) -> None:
    ink = {"own ship": "black", "target": "tab:gray", label: _INK[label]}
    for name, way in ways.items():
        shown = way[: last + 1]
        wide = 3.0 if name == "target" else 1.2
        place.plot(*_east_north(shown), color=ink[name], linewidth=wide, label=name)
        if name != label:
            place.plot(*_east_north(shown[:1]), "o", color=ink[name], markersize=4)
    if converged <= last:
        spot = _east_north(ways[label][converged][None])
        place.plot(*spot, "D", color=_INK[label], markersize=5, label="converged")
    place.set(xlabel="East, km", ylabel="North, km", aspect="equal")


def _east_north(way: Array) -> tuple[Array, Array]:
    """Both in km, of (points, 2) North and East."""
    return _KM * way[:, 1], _KM * way[:, 0]


def _view(place: Any, shown: list[Array]) -> None:
    """The axes hold own ship and target; an estimate may run out of them."""
    points = _KM * np.concatenate(shown)
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.12 * np.max(high - low)
    place.set(ylim=(low[0] - room, high[0] + room), xlim=(low[1] - room, high[1] + room))


def _bearing_lines(place: Any, study: Study, run: int, last: int) -> None:
    """Some of the bearings heard, from where own ship was."""
    own, z = own_ship(study.world), study.simulated[1].z[run, :, 0]
    for k in range(study.at(30.0), last + 1, max(study.at(30.0), 1)):
        far = 6_000.0 * np.array([np.cos(z[k]), np.sin(z[k])])
        label = "bearings, every 30 s" if k == study.at(30.0) else None
        line = _east_north(np.stack([own[k], own[k] + far]))
        place.plot(*line, color="tab:gray", linewidth=0.5, alpha=0.6, label=label)


def _error(study: Study, quantity: str) -> tuple[Any, dict[str, Array]]:
    """Figures 3 to 6: one run with the limit, and the root mean square with the bound."""
    i, unit = list(QUANTITIES).index(quantity), QUANTITIES[quantity]
    figure, axes = sheet(1, 2, f"Error of the {quantity}, {unit}", (5.2, 3.8))
    limit, columns, plain = _limit(study, i), {"time_s": study.time_s}, unit.replace("°", "deg")
    for label in ("RP", "MGEKF"):
        one = study.tracked[label]
        run = _median_run(one)
        lines = (one.error[run, :, i], rms(one.error[..., i]))
        for place, line in zip(axes[0], lines, strict=True):
            place.plot(study.time_s, line, color=_INK[label], linewidth=1.1, label=label)
        columns |= {f"{label} run {run} {plain}": lines[0], f"{label} RMS {plain}": lines[1]}
    for side in (limit, -limit):
        axes[0, 0].plot(study.time_s, side, "k:", linewidth=0.8)
    axes[0, 0].set(
        ylim=(-3 * limit.max(), 3 * limit.max()), ylabel=f"error of the {quantity}, {unit}"
    )
    axes[0, 0].set_title("each in the run of its median convergence; dotted: tolerated")
    bound = study.bound_sd[:, i]
    axes[0, 1].plot(
        study.time_s, bound, "k--", linewidth=1.0, label="Cramér-Rao bound, with the start's spread"
    )
    axes[0, 1].set(yscale="log", ylabel=f"root mean square error, {unit}")
    _plain_decades(axes[0, 1].yaxis)
    axes[0, 1].set_title(f"{study.runs} runs; grey: own ship turns")
    for place in axes[0]:
        _turns(place, study)
        place.set(xlabel="time, s", xlim=(study.time_s[0], study.time_s[-1]))
        place.legend(fontsize="small")
    _finish(axes)
    return figure, columns | {f"bound {plain}": bound, f"limit {plain}": limit}


def _limit(study: Study, i: int) -> Array:
    """(scans,): what an error may be."""
    c, range_m = study.criteria, study.tracked["RP"].polar[1][0, :, 0]
    fixed = (c.bearing_deg, c.course_deg, c.speed_mps)
    return c.range_percent / 100.0 * range_m if i == 0 else np.full_like(range_m, fixed[i - 1])


def _turns(place: Any, study: Study) -> None:
    """Grey while own ship turns."""
    pairs = zip(study.assumed["turn_times_s"], study.assumed["turn_lasts_s"], strict=True)
    for start, lasts in pairs:
        place.axvspan(start, start + lasts, color="tab:gray", alpha=0.15, linewidth=0)


def _times(study: Study) -> tuple[Any, dict[str, Array]]:
    """PR-C1: when runs converge, and how good estimates are then."""
    shown = {label: study.tracked[label] for label in ("RP", "MGEKF", NEAR)}
    near = f"{study.assumed['near_start_m']:g} ± {study.assumed['near_start_sd_m']:g} m"
    title = f"Convergence for good, {study.runs} runs; near: {near}; grey: own ship turns"
    figure, axes = sheet(1, 2, title, (5.2, 3.8))
    latest = max(float(np.max(one.converged)) for one in shown.values())
    for label, one in shown.items():
        share = np.mean(one.converged[:, None] <= study.time_s, axis=0)
        axes[0, 0].plot(study.time_s, share, color=_INK[label], label=label)
    axes[0, 0].set(xlim=(100.0, latest + 10.0), xlabel="time, s", ylabel="share of runs converged")
    bins = np.arange(100.0, latest + 10.0, 5.0)
    for label, one in shown.items():
        axes[0, 1].hist(one.converged, bins=bins, color=_INK[label], histtype="step", label=label)
    axes[0, 1].axvline(study.converge_s, color="black", linestyle=":", label="Table 5.1")
    axes[0, 1].set(xlim=(100.0, latest + 10.0), xlabel="time, s", ylabel="runs in 5 s")
    for place in axes[0]:
        _turns(place, study)
        place.legend(fontsize="small")
    _finish(axes)
    columns = {f"{label}, s": one.times[1] for label, one in shown.items()}
    return figure, {"run": np.arange(study.runs)} | columns


def _anywhere(study: Study) -> tuple[Any, dict[str, Array]]:
    """PR-C3: errors over the bound against how near targets come, and filters over the bound."""
    figure, axes = sheet(1, 2, "Targets anywhere, and the paper's", (5.2, 4.0))
    found = {label: np.sqrt(one.square[:, -1] / one.bound[:, -1])
             for label, one in study.truths.items()}  # fmt: skip
    near = study.truths["RP"].closest_m
    for label, ratio in reversed(found.items()):
        axes[0, 0].plot(near, ratio, ".", color=_INK[label], markersize=3, label=label, alpha=0.6)
    axes[0, 0].axhline(BEYOND, color="black", linestyle=":", linewidth=0.8)
    axes[0, 0].set(xscale="log", yscale="log", xlabel="target's nearest to own ship, m",
                   ylabel="error of the position over bound, at the end")  # fmt: skip
    axes[0, 0].set_title(f"{len(near)} random targets; dotted: {BEYOND:g} times the bound")
    for label in ("RP", "MGEKF", "EKF", NEAR):
        ratio = rms(np.sqrt(study.tracked[label].square)) / study.bound_m
        axes[0, 1].plot(study.time_s, ratio, color=_INK[label], linewidth=1.1, label=label)
    for marker, (name, square) in zip(_BESIDE, study.references.items(), strict=False):
        at = [study.at(second) for second in study.reference_s]
        beside = np.sqrt(np.mean(square, axis=0)) / study.bound_m[at]
        label = f"{name}, {len(square)} runs"
        axes[0, 1].plot(study.reference_s, beside, "k" + marker, markersize=5, label=label)
    axes[0, 1].set(xlabel="time, s", ylabel="RMSE of the position over bound", ylim=(0.0, 5.0))
    axes[0, 1].set_title(f"the paper's target, {study.runs} runs")
    axes[0, 1].set_xlim(0.0, study.time_s[-1])
    _turns(axes[0, 1], study)
    for place in axes[0]:
        place.legend(fontsize="small")
    _finish(axes)
    return figure, {"nearest_m": near} | {f"{label} over bound": r for label, r in found.items()}


def _weights(study: Study) -> tuple[Any, dict[str, Array]]:
    """PR-C4: weights of the cells with the manoeuvre, without it, and before it."""
    kinds = {
        "own ship turns": study.tracked["RP"].weights.mean(axis=0),
        "own ship never turns": study.straight.weights.mean(axis=0),
    } | {f"started with {sd:g} m/s": found for sd, found in study.by_speed_sd.items()}
    figure, axes = sheet(1, 3, f"Mean weights of the cells, {study.runs} runs", (4.6, 3.8))
    for place, kind in zip(axes[0], list(kinds)[:2], strict=False):
        _cells(place, study, kinds[kind])
        place.set(xlabel="time, s", ylabel="mean weight", ylim=(0.0, 1.0))
        place.set_title(kind)
        place.set_xlim(0.0, study.time_s[-1])
    axes[0, 0].set_xlim(0.0, _EARLY_S)
    _turns(axes[0, 0], study)
    _bars(axes[0, 2], study)
    axes[0, 1].legend(fontsize="x-small", title="cell", ncols=2, title_fontsize="x-small")
    _finish(axes)
    columns = {
        f"{kind} cell {i + 1}": weights[:, i]
        for kind, weights in kinds.items()
        for i in range(weights.shape[1])
    }
    return figure, {"time_s": study.time_s} | columns


def _plain_decades(axis: Any) -> None:
    """Ticks at 1, 2 and 5 of each decade, written out."""
    from matplotlib.ticker import LogLocator

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")


def _finish(axes: Array) -> None:
    """Letters to name the panels by, small titles, thin grids."""
    for letter, place in zip("abc", axes[0], strict=False):
        place.set_title(f"({letter}) {place.get_title()}".rstrip(), fontsize="small", loc="left")
        place.title.set_text("")
        place.grid(alpha=0.3)


def _shade(i: int, cells: int) -> str:
    """A colour for each cell; greys where colours run out."""
    return f"C{i}" if cells <= 10 else f"{i / cells:.2f}"


def _cells(place: Any, study: Study, weights: Array) -> None:
    cells = weights.shape[1]
    for i in range(cells):
        wide = 2.2 if i == study.true_cell else 1.1
        label = f"{i + 1}" + (" (target)" if i == study.true_cell else "")
        place.plot(study.time_s, weights[:, i], color=_shade(i, cells), linewidth=wide, label=label)


def _bars(place: Any, study: Study) -> None:
    """Weights just before the manoeuvre, by the spread of velocity that the bank starts with."""
    k = study.at(study.before)
    groups = list(study.by_speed_sd.items())
    cells = groups[0][1].shape[1] if groups else 0
    for i in range(cells):
        heights = [found[k, i] for _, found in groups]
        spots = np.arange(len(groups)) + (i - (cells - 1) / 2) * 0.8 / cells
        edge = "black" if i == study.true_cell else "none"
        place.bar(spots, heights, width=0.8 / cells, color=_shade(i, cells), edgecolor=edge)
    place.set_xticks(range(len(groups)), [f"{sd:g}" for sd, _ in groups])
    place.set(
        xlabel="spread of velocity at the start, m/s",
        ylabel="mean weight",
        title=f"at {study.before:g} s, by what is believed; outlined: the target's cell",
    )
