"""bordonaro's Figures 2 to 14, drawn from our runs, with the numbers beside them.

Axes, panels and units are the paper's, feet and degrees; so are the filters, but the tables beside
hold DUCM as printed too. Shaded are chi-square bounds, or three standard errors of a bias.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from boresight.experiments.consistency import Bias, Nes, bias
from boresight.experiments.metrics import chi_square_bounds
from boresight.experiments.papers.bordonaro_doppler import STANDARD
from boresight.experiments.papers.bordonaro_study import Study
from boresight.experiments.papers.bordonaro_tracks import COMPARED, OTHERS, Tracked
from boresight.experiments.papers.figures import draw, ratio_axis, sheet

Array = Any
_INK = {"UCM": "tab:blue", "MUCM": "tab:orange", "DUCM": "tab:red", STANDARD: "tab:blue"}
_PARTS = {"total": "black", "x": "tab:blue", "y": "tab:red"}
_ZOOMS = (None, (1, 5), (5, 10), (10, 100))  # scans


def write(study: Study, folder: Path) -> list[str]:
    """Write BO-F2.png to BO-F14.png, and a CSV file beside each; see `figures.draw`."""
    return draw(folder, "BO", _DRAWN, study)


def _lines(place: Any, x: Array, lines: Mapping[str, Array], **axes: Any) -> None:
    for name, y in lines.items():
        place.plot(x, y, label=name, color=_INK.get(name), linewidth=1.2)
    place.set(**axes)
    place.grid(alpha=0.3)
    place.legend(fontsize="small")


def _scans(count: int) -> Array:
    return np.arange(1, count + 1)


def _scatter(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 2."""
    points, truth = study.few, study.target.truth
    figure, axes = sheet(1, 1, _title(study, "BO-S01"), (6.5, 6.5))
    place = axes[0, 0]
    place.plot(*points.T, ".", color="tab:gray", label=f"{len(points)} converted plots, (1)")
    place.plot(*truth, "o", color="black", label="truth")
    place.plot(*points.mean(axis=0), "*", color="tab:red", markersize=12, label="their mean")
    place.plot(0.0, 0.0, "^", color="black", label="sensor")
    place.set(xlabel="x, ft", ylabel="y, ft", aspect="equal")
    place.grid(alpha=0.3)
    place.legend(fontsize="small", loc="upper left")
    return figure, {"x_ft": points[:, 0], "y_ft": points[:, 1]}


def _histogram(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 3."""
    clouds = study.clouds
    first = next(iter(clouds.values()))
    counts = np.sum([cloud.counts for cloud in clouds.values()], axis=0)
    figure, axes = sheet(1, 1, "UCM: " + _title(study, "BO-S02"), (8.0, 5.0))
    place = axes[0, 0]
    shades = place.pcolormesh(
        first.x, first.y, np.where(counts > 0, counts, np.nan).T, cmap="Blues", norm="log"
    )
    figure.colorbar(shades, ax=place, label="plots")
    truths = np.array([cloud.truth for cloud in clouds.values()])
    means = truths + [cloud.mean.value for cloud in clouds.values()]
    place.plot(*truths.T, "o", color="black", fillstyle="none", markersize=9, label="truth")
    place.plot(*means.T, "+", color="tab:red", markersize=9, label="mean of the plots")
    place.set(
        xlabel="x, ft", ylabel="y, ft", aspect="equal", ylim=(-0.6 * first.x[-1], first.x[-1])
    )
    place.legend(fontsize="small", loc="lower left")
    middle = [(edges[1:] + edges[:-1]) / 2 for edges in (first.x, first.y)]
    i, j = np.nonzero(counts)
    return figure, {"x_ft": middle[0][i], "y_ft": middle[1][j], "plots": counts[i, j]}


def _nes(study: Study, methods: tuple[str, ...]) -> tuple[Any, dict[str, Array]]:
    """Figures 4 and 7."""
    bearings, sigmas = (
        study.assumed["nes_bearings_deg"],
        study.printed("BO-S03")["sigma_bearing_deg"],
    )
    columns: dict[str, Array] = {"bearing_deg": np.array(bearings)}
    across = len(methods) == 1
    figure, axes = sheet(*((1, 3) if across else (3, 2)), "NES: " + _title(study, "BO-S03"))
    for i, sigma in enumerate(sigmas):
        for j, method in enumerate(methods):
            cells = [study.cells[method, sigma, bearing] for bearing in bearings]
            lines = _nes_lines(cells)
            place = axes[(0, i) if across else (i, j)]
            _bounds(place, cells[0])
            for name, values in lines.items():
                place.plot(bearings, values, label=name, color=_PARTS[name], linewidth=1.2)
                columns[f"{method} {sigma:g}deg {name}"] = values
            place.set(
                xlabel="bearing, °", ylabel="NES", title=f"{method}, {sigma:g}°", ylim=(0.0, 1.4)
            )
            place.grid(alpha=0.3)
            place.legend(fontsize="small")
    return figure, columns


def _nes_lines(cells: list[Nes]) -> dict[str, Array]:
    return {
        "total": np.array([nes.total.value for nes in cells]),
        "x": np.array([nes.per_component[0].value for nes in cells]),
        "y": np.array([nes.per_component[1].value for nes in cells]),
    }


def _bounds(place: Any, nes: Nes) -> None:
    """Those of a component, wider, behind those of the total."""
    for part, shade in ((nes.per_component[0], 0.15), (nes.total, 0.3)):
        place.axhspan(part.low, part.high, color="gray", alpha=shade, linewidth=0)


def _batch(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 5."""
    sigmas = study.assumed["batch_sigma_bearing_deg"]
    printed = study.printed("BO-S04")
    figure, axes = sheet(1, 1, f"Batch LLSE of {printed['samples']} plots", (7.5, 5.0))
    place, styles = axes[0, 0], ("-", "--", "-.", ":")
    columns = {"sigma_bearing_deg": np.array(sigmas, dtype=float)}
    for (r, found), style in zip(study.batches.items(), styles, strict=True):
        columns |= {f"{name} {r:g} ft": values[:, 0] for name, values in found.items()}
        for name in OTHERS:
            label = f"{name}, range {r:,.0f}"
            place.plot(sigmas, found[name.lower()][:, 0], style, color=_INK[name], label=label)
    place.set(
        xlabel="standard deviation of the bearing, °", ylabel="bias along the line of sight, ft"
    )
    place.grid(alpha=0.3)
    place.legend(fontsize="small")
    return figure, columns


def _recursive(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 6."""
    figure, axes = sheet(1, 2, "Static CMKF: " + _title(study, "BO-S05"))
    columns: dict[str, Array] = {}
    for place, (sigma, found) in zip(axes[0], study.rest.items(), strict=True):
        biases = {name: bias(found[name].along) for name in OTHERS}
        columns |= _biases(place, biases, f"{sigma:g}°")
    return figure, {"scan": _scans(len(next(iter(columns.values()))))} | columns


def _biases(place: Any, found: dict[str, Bias], title: str) -> dict[str, Array]:
    for name, one in found.items():
        scans, wide = _scans(len(one.value)), 3.0 * one.standard_error
        place.fill_between(scans, one.value - wide, one.value + wide, color=_INK[name], alpha=0.2)
    values = {name: one.value for name, one in found.items()}
    label = "bias along the line of sight, ft"
    _lines(place, scans, values, xlabel="scan", ylabel=label, title=title)
    place.axhline(0.0, color="black", linewidth=0.6)
    return {f"{name} {title.replace('°', 'deg')}": value for name, value in values.items()}


def _recursive_ducm(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 8."""
    figure, axes = sheet(
        1, 1, "Static CMKF: " + _title(study, "BO-S05", max(study.rest)), (6.5, 4.0)
    )
    found = {"DUCM": bias(study.large["DUCM"].along)}
    columns = _biases(axes[0, 0], found, f"{max(study.rest):g}°")
    return figure, {"scan": _scans(len(found["DUCM"].value))} | columns


def _squares(title: str, found: dict[str, Tracked]) -> tuple[Any, dict[str, Array]]:
    """Figures 9 and 10: all scans, and three parts of them."""
    mse = {method: np.mean(one.square, axis=0) for method, one in found.items()}
    shown, scans = {method: mse[method] for method in COMPARED}, _scans(len(mse["DUCM"]))
    figure, axes = sheet(2, 2, "CMKF: " + title)
    for place, zoom in zip(axes.flat, _ZOOMS, strict=True):
        low, high = zoom or (1, len(scans))
        part = slice(low - 1, high)
        lines = {method: values[part] for method, values in shown.items()}
        label = "position MSE, ft²"
        _lines(
            place, scans[part], lines, xlabel="scan", ylabel=label, title=f"scans {low} to {high}"
        )
        place.set_yscale("log" if zoom in (None, _ZOOMS[-1]) else "linear")
    return figure, {"scan": scans} | mse


def _velocity(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 11."""
    mse = {name: np.mean(one.velocity_square, axis=0) for name, one in study.way.items()}
    figure, axes = sheet(1, 1, "CMKF: " + _title(study, "BO-S06"), (6.5, 4.0))
    scans = _scans(len(mse["DUCM"]))
    shown = {name: mse[name] for name in COMPARED}
    _lines(axes[0, 0], scans, shown, xlabel="scan", ylabel="velocity MSE, ft²/s²", ylim=(0.0, None))
    return figure, {"scan": scans} | mse


def _anees(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 12."""
    found = {name: np.mean(one.nees, axis=0) for name, one in study.way.items()}
    figure, axes = sheet(1, 1, "CMKF: " + _title(study, "BO-S06"), (6.5, 4.0))
    scans, place = _scans(len(found["DUCM"])), axes[0, 0]
    low, high = chi_square_bounds(4 * len(study.way["DUCM"].nees), 0.01)
    place.axhspan(low, high, color="gray", alpha=0.3, linewidth=0)
    shown = {name: found[name] for name in COMPARED}
    _lines(place, scans, shown, xlabel="scan", ylabel="ANEES")
    ratio_axis(place)
    return figure, {"scan": scans} | found


def _significance(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 13."""
    sigmas = np.array(study.assumed["significance_sigma_deg"], dtype=float)
    figure, axes = sheet(
        1, 3, f"Bias significance, {study.printed('BO-S07')['transmitted_hz']:,.0f} Hz"
    )
    columns = {"sigma_bearing_deg": sigmas}
    for place, (kind, lines) in zip(axes[0], study.significances.items(), strict=True):
        label = "bias over standard deviation"
        _lines(
            place,
            sigmas,
            lines,
            xlabel="σ of the bearing, °",
            ylabel=label,
            title=kind,
            ylim=(0.0, 0.8),
        )
        columns |= {f"{kind} {name.replace('°', 'deg')}": line for name, line in lines.items()}
    return figure, columns


def _range_rate(study: Study) -> tuple[Any, dict[str, Array]]:
    """Figure 14."""
    kinds = {
        "bias, ft/s": {n: np.mean(one.error, axis=0) for n, one in study.range_rates.items()},
        "MSE, ft²/s²": {n: np.mean(one.error**2, axis=0) for n, one in study.range_rates.items()},
        "ANEES": {n: np.mean(one.nees, axis=0) for n, one in study.range_rates.items()},
    }
    figure, axes = sheet(1, 3, "Range-rate tracker: " + _title(study, "BO-S08"))
    scans = _scans(len(kinds["ANEES"]["DUCM"]))
    columns = {"scan": scans}
    for place, (kind, found) in zip(axes[0], kinds.items(), strict=True):
        shown = {name: found[name] for name in (STANDARD, *OTHERS[1:], "DUCM")}
        scale = "log" if kind.startswith("MSE") else "linear"
        _lines(place, scans, shown, xlabel="scan", ylabel=kind, yscale=scale)
        if kind == "ANEES":
            ratio_axis(place)
        columns |= {f"{name} {kind.split(',')[0]}": values for name, values in found.items()}
    return figure, columns


def _title(study: Study, name: str, *sigmas: float) -> str:
    """The settings that a caption prints; of several bearing noises, those that are shown."""
    printed = study.printed(name)
    runs, sigma = f"{study.runs(name):,} runs", sigmas or printed["sigma_bearing_deg"]
    bearing = " and ".join(f"{s:g}°" for s in sigma) if len(sigma) < 3 else ""
    seen = printed.get("sigma_range_ft")
    parts = [
        runs,
        f"σ of range {seen:g} ft" if seen else "",
        f"σ of bearing {bearing}" if bearing else "",
    ]
    return ", ".join(part for part in parts if part)


_DRAWN: dict[int, Any] = {
    2: _scatter,
    3: _histogram,
    4: lambda study: _nes(study, OTHERS),
    5: _batch,
    6: _recursive,
    7: lambda study: _nes(study, ("DUCM",)),
    8: _recursive_ducm,
    9: lambda study: _squares(_title(study, "BO-S05", max(study.rest)), study.large),
    10: lambda study: _squares(_title(study, "BO-S06"), study.way),
    11: _velocity,
    12: _anees,
    13: _significance,
    14: _range_rate,
}
