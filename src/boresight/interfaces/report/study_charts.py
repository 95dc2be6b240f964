"""The charts of a study: errors against the bound, NEES and NIS in their bands, cost, sweeps."""

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from boresight.experiments.metrics import chi_square_bounds
from boresight.interfaces.report import charts
from boresight.interfaces.report.beside import COLORS, DASHES
from boresight.interfaces.report.charts import Chart
from boresight.interfaces.report.residuals import Floats, Panel
from boresight.interfaces.report.study_words import setting_name
from boresight.laboratory.result import Cell, StudyResult

BOUND = {"color": charts.INK, "width": 1.6, "dash": "dash"}
HEAD = {"l": 8, "r": 8, "t": 34, "b": 8}  # a legend of two lines needs room
NUMBER = re.compile(r"[-+]?[0-9._]+(?:[eE][-+]?[0-9]+)?")
FLOOR = 1e-12
NARROW = 0.9  # decades: a narrower logarithmic axis has its ticks at even steps
MOST_TICKS = 7


def color(index: int) -> str:
    """A contender's colour, the same in every chart."""
    return COLORS[index % len(COLORS)]


def _style(index: int) -> Chart:
    dash = DASHES[index // len(COLORS) % len(DASHES)]
    return {"line": {"color": color(index), "width": 1.8, "dash": dash}}


def of_setting(result: StudyResult, setting: int) -> list[Panel]:
    """RMSE, NEES, NIS and bias against time, and how runs differ, of one setting's contenders."""
    cells = [cell for cell in result.cells if cell.setting == setting]
    time = result.study.settings[setting].scenario.time_s
    where = setting_name(cells[0].values)
    drawn = (
        ("rmse", "position error against time and the bound", _errors(cells, time)),
        ("nees", "NEES per state against time in its band", _squares(result, cells, time, "nees")),
        ("nis", "NIS per component against time in its band", _squares(result, cells, time, "nis")),
        ("bias", "length of the mean position error against time", _bias(result, cells, time)),
        ("claims", "claimed over actual position error against time", _claims(cells, time)),
        ("runs", "share of runs whose error is below a value", _runs(cells)),
    )
    return [
        Panel(f"s{setting}-{name}", chart, f"{alt} {where}".strip()) for name, alt, chart in drawn
    ]


def _errors(cells: Sequence[Cell], time: Floats) -> Chart:
    errors = [np.sqrt(cell.per_scan["position_sq_m2"]) for cell in cells]
    data = [
        _trace(time, y, cell.label, i)
        for i, (cell, y) in enumerate(zip(cells, errors, strict=True))
    ]
    bound = cells[0].per_scan.get("bound_m2")
    if bound is not None:
        errors.append(np.sqrt(bound))
        line = charts.line(charts.typed(time, "f8"), charts.short(errors[-1]), charts.INK)
        data.append(line | {"name": "Cramér-Rao bound", "line": BOUND})
    return {"data": data, "layout": _with_log(_layout("position RMSE, m"), errors)}


def _with_log(layout: Chart, values: Sequence[Any], axis: str = "yaxis") -> Chart:
    return layout | {axis: layout[axis] | _log(values)}


def _trace(time: Floats, y: Floats, label: str, index: int) -> Chart:
    """One contender; what is no number leaves a gap."""
    y = np.where(np.isfinite(y), y, np.nan)
    line = charts.line(charts.typed(time, "f8"), charts.short(y), color(index), name=label)
    return line | _style(index)


def _layout(title: str, x_title: str = "time, s") -> Chart:
    axes = {"xaxis": charts.axis(x_title), "yaxis": charts.axis(title)}
    return charts.layout(**axes, showlegend=True, margin=HEAD, hovermode="x")


def _log(values: Sequence[Any]) -> Chart:
    """A logarithmic axis over all positive values, with whole figures at its ticks."""
    flat = np.concatenate([np.ravel(np.asarray(each, dtype=float)) for each in values])
    flat = flat[np.isfinite(flat) & (flat > 0.0)]
    if not len(flat):
        return {"type": "log"}
    low, high = (float(np.log10(end)) for end in (flat.min(), flat.max()))
    margin = max(0.04 * (high - low), 0.01)
    low, high = low - margin, high + margin
    ticks = _even(10.0**low, 10.0**high) if high - low < NARROW else _decades(low, high)
    shown = {"tickvals": ticks, "ticktext": [f"{tick:,.6g}" for tick in ticks]}
    return {"type": "log", "range": [low, high]} | shown


def _even(low: float, high: float) -> list[float]:
    """Ticks at a round step of 1, 2 or 5."""
    rough = (high - low) / (MOST_TICKS - 1)
    decade = 10.0 ** np.floor(np.log10(rough))
    step = next(decade * digit for digit in (1, 2, 5, 10) if decade * digit >= rough)
    first, last = int(np.ceil(low / step)), int(np.floor(high / step))
    return [float(f"{k * step:.9g}") for k in range(first, last + 1)]


def _decades(low: float, high: float) -> list[float]:
    """Ticks at 1, 2, 5; at 1, 3, and at 1 alone as the axis grows."""
    span = high - low
    digits = (1, 2, 5) if span < 2.0 else (1, 3) if span < MOST_TICKS / 2.0 else (1,)
    decades = range(int(np.floor(low)), int(np.ceil(high)) + 1)
    every = [float(f"{digit * 10.0**k:.6g}") for k in decades for digit in digits]
    return [tick for tick in every if 10.0**low <= tick <= 10.0**high]


def _squares(result: StudyResult, cells: Sequence[Cell], time: Floats, name: str) -> Chart:
    """NEES per state, or NIS per component, of each scan, and where a consistent filter's lies."""
    values, dofs = [], []
    for cell in cells:
        n = np.shape(cell.per_scan["error"])[1]
        found, dof = cell.per_scan[name], np.full(len(time), float(n))
        if name == "nis":
            dof = cell.per_scan["dof"]
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.where(dof > 0.0, found / dof, np.nan)
        values.append(found)
        dofs.append(dof)
    low, high = _band(np.max(dofs, axis=0), cells[0].runs, result.study.false_alarm)
    words = f"{100 * (1 - result.study.false_alarm):g} % band of one scan"
    x = charts.typed(time, "f8")
    data = charts.band(x, charts.short(low), charts.short(high), words)
    data += [
        _trace(time, y, cell.label, i)
        for i, (cell, y) in enumerate(zip(cells, values, strict=True))
    ]
    title = "NEES per state" if name == "nees" else "NIS per component"
    return {"data": data, "layout": _with_log(_layout(title), [low, high, *values])}


def _band(dof: Floats, runs: int, false_alarm: float) -> tuple[Floats, Floats]:
    known = {d: chi_square_bounds(d * runs, false_alarm) if d else (np.nan,) * 2 for d in set(dof)}
    both = np.array([known[d] for d in dof])
    return both[:, 0], both[:, 1]


def _bias(result: StudyResult, cells: Sequence[Cell], time: Floats) -> Chart:
    """Length of the mean error, and what chance alone leaves of it in so many runs."""
    dims = result.study.settings[cells[0].setting].scenario.motion.dims
    means = [np.linalg.norm(cell.per_scan["error"][:, :dims], axis=1) for cell in cells]
    data = [
        _trace(time, y, cell.label, i) for i, (cell, y) in enumerate(zip(cells, means, strict=True))
    ]
    chance = np.sqrt(cells[0].per_scan["position_sq_m2"] / cells[0].runs)
    line = charts.line(charts.typed(time, "f8"), charts.short(chance), charts.MUTED)
    style = {"color": charts.MUTED, "width": 1.2, "dash": "dot"}
    data.append(line | {"name": "what chance leaves", "line": style})
    layout = _layout("length of the mean position error, m")
    return {"data": data, "layout": _with_log(layout, [*means, chance])}


def _claims(cells: Sequence[Cell], time: Floats) -> Chart:
    """What a filter claims over what it makes, in metres: 1 where it knows."""
    shares = []
    for cell in cells:
        with np.errstate(divide="ignore", invalid="ignore"):
            shares.append(np.sqrt(cell.per_scan["claimed_m2"] / cell.per_scan["position_sq_m2"]))
    data = [
        _trace(time, y, cell.label, i)
        for i, (cell, y) in enumerate(zip(cells, shares, strict=True))
    ]
    return {"data": data, "layout": _with_log(_layout("claimed sd over RMSE"), shares)}


def _runs(cells: Sequence[Cell]) -> Chart:
    """The law of single runs' errors; runs that diverged are at its right end, or beyond it."""
    share = np.linspace(0.0, 1.0, min(cells[0].runs, 400))
    data = []
    for i, cell in enumerate(cells):
        error = np.sort(np.sqrt(cell.per_run["position_sq_m2"]))
        found = np.quantile(error, share, method="inverted_cdf")
        found = np.where(np.isfinite(found), np.maximum(found, FLOOR), np.nan)
        line = charts.line(
            charts.short(found), charts.short(100 * share), color(i), name=cell.label
        )
        data.append(line | _style(i))
    layout = _layout("share of runs below, %", x_title="position RMSE of a run, m")
    every = [np.sqrt(cell.per_run["position_sq_m2"]) for cell in cells]
    layout = _with_log(layout, every, "xaxis") | {"hovermode": "closest"}
    return {"data": data, "layout": layout}


def cost(result: StudyResult) -> list[Panel]:
    """Error over the bound against nanoseconds a step; nothing where a study has one contender."""
    cells = [
        c for c in result.cells if np.isfinite(c.ratio_to_bound) and np.isfinite(c.ns_per_step)
    ]
    labels = list(dict.fromkeys(cell.label for cell in cells))
    if len(labels) < 2:
        return []
    data = []
    for i, name in enumerate(labels):
        mine = [cell for cell in cells if cell.label == name]
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": name,
                "x": charts.typed([cell.ns_per_step for cell in mine], "f8"),
                "y": charts.typed([cell.ratio_to_bound for cell in mine], "f8"),
                "marker": {"size": 10, "color": color(i)},
                "hovertext": [setting_name(cell.values) for cell in mine],
                "hovertemplate": "%{y:.4g} of the bound, %{x:.3g} ns a step<br>%{hovertext}",
            }
        )
    layout = _layout("RMSE over the bound", x_title="ns a step, everything included")
    layout = _with_log(layout, [[cell.ratio_to_bound for cell in cells]])
    layout = _with_log(layout, [[cell.ns_per_step for cell in cells]], "xaxis")
    layout |= {"hovermode": "closest"}
    return [Panel("cost", {"data": data, "layout": layout}, "error against processor time")]


def sweeps(result: StudyResult) -> list[Panel]:
    """RMSE and ANEES against the swept value, where one quantity is swept."""
    names = {name for each in result.study.settings for name, _ in each.values}
    if len(names) != 1 or len(result.study.settings) < 2:
        return []
    swept = next(iter(names))
    texts = [dict(each.values)[swept] for each in result.study.settings]
    numbers = [NUMBER.match(text) for text in texts]
    x = [float(n.group()) for n in numbers if n]
    places: Sequence[float | str] = x if len(x) == len(texts) else texts
    unit = texts[0][numbers[0].end() :].strip() if numbers[0] and x else ""
    title = f"{swept}, {unit}" if unit else swept
    return [
        _sweep(result, "sweep-rmse", "position RMSE, m", places, title, _rmse_of),
        _sweep(result, "sweep-anees", "ANEES", places, title, lambda cell: cell.anees.value),
    ]


def _rmse_of(cell: Cell) -> float:
    return cell.position_rmse_m.value


def _sweep(
    result: StudyResult,
    name: str,
    y_title: str,
    places: Sequence[float | str],
    x_title: str,
    value: Callable[[Cell], float],
) -> Panel:
    labels = list(dict.fromkeys(cell.label for cell in result.cells))
    data = []
    for i, label in enumerate(labels):
        mine = [cell for cell in result.cells if cell.label == label]
        y = np.array([value(cell) for cell in mine])
        line = charts.line(
            [places[cell.setting] for cell in mine],
            np.where(np.isfinite(y), y, np.nan).tolist(),
            color(i),
        )
        data.append(line | _style(i) | {"name": label, "mode": "lines+markers"})
    if name == "sweep-rmse":
        bounds = {cell.setting: cell.pcrlb_m for cell in result.cells}
        known = [(places[i], b) for i, b in bounds.items() if np.isfinite(b)]
        if known:
            line = charts.line([p for p, _ in known], [b for _, b in known], charts.INK)
            data.append(line | {"name": "Cramér-Rao bound", "line": BOUND})
    layout = _with_log(_layout(y_title, x_title=x_title), [trace["y"] for trace in data])
    if all(isinstance(p, float) and p > 0 for p in places):
        layout["xaxis"] |= {
            "type": "log",
            "tickvals": list(places),
            "ticktext": [f"{p:g}" for p in places],
        }
    for trace in data:
        trace["y"] = [
            None if isinstance(v, float) and not np.isfinite(v) else v for v in trace["y"]
        ]
    return Panel(name, {"data": data, "layout": layout}, f"{y_title} against {x_title}")
