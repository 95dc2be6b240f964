"""A study in a notebook: the ranking as a table, the errors against the bound as a small picture.

Plain HTML and SVG, with nothing to load: it shows in any notebook, and in one that is printed.
"""

from collections.abc import Sequence
from html import escape

import numpy as np

from boresight.laboratory.result import Cell, StudyResult

COLORS = ("#0072B2", "#D55E00", "#00785a", "#8a4f7d", "#b58900", "#56B4E9", "#5b6675")
WIDTH, HEIGHT, LEFT, BOTTOM = 560, 220, 52, 30
SHOWN = 6  # settings that are drawn


def html(result: StudyResult) -> str:
    """The study as HTML."""
    study = result.study
    runs = "1 run" if study.runs == 1 else f"{study.runs:,} runs"
    head = f"<b>{escape(study.name)}</b>: {runs}, seed {study.seed}"
    each = "".join(_setting(result, i) for i in range(len(study.settings))[:SHOWN])
    rest = len(study.settings) - SHOWN
    more = (
        f"<p>and {rest} more setting{'s' * (rest > 1)}: see <code>.table</code></p>"
        if rest > 0
        else ""
    )
    remarks = "".join(f"<p><small>{escape(each)}</small></p>" for each in result.remarks)
    return f"<div>{head}{each}{more}{remarks}</div>"


def _setting(result: StudyResult, setting: int) -> str:
    cells = [cell for cell in result.cells if cell.setting == setting]
    name = ", ".join(f"{key} {value}" for key, value in cells[0].values)
    rows = "".join(_row(cell, COLORS[i % len(COLORS)]) for i, cell in enumerate(cells))
    heads = (
        "",
        "filter",
        "position RMSE, m",
        "median run",
        "× bound",
        "ANEES",
        "band",
        "diverged",
        "ns/step",
    )
    head = "".join(f"<th>{each}</th>" for each in heads)
    words = "".join(f"<li>{escape(w)}</li>" for cell in cells for w in cell.verdicts)
    time = result.study.settings[setting].scenario.time_s
    return (
        f"<p>{escape(name)}</p><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
        f"{_picture(cells, time)}<details><summary>Verdicts</summary><ul>{words}</ul></details>"
    )


def _row(cell: Cell, color: str) -> str:
    low, high = cell.anees_bounds
    position = cell.position_rmse_m
    inside = low <= cell.anees.value <= high
    figures = (
        f"{position.value:.4g} ({position.low:.4g} to {position.high:.4g})",
        f"{cell.median_rmse_m:.4g}",
        f"{cell.ratio_to_bound:.3f}" if np.isfinite(cell.ratio_to_bound) else "–",
        f"{'' if inside else '<b>'}{cell.anees.value:.3g}{'' if inside else '</b>'}",
        f"{low:.3f} to {high:.3f}",
        f"{100 * cell.diverged.value:.3g} %",
        f"{cell.ns_per_step:.3g}",
    )
    mark = f'<td style="color:{color}">●</td><td style="text-align:left">{escape(cell.label)}</td>'
    return f"<tr>{mark}{''.join(f'<td>{each}</td>' for each in figures)}</tr>"


def _picture(cells: Sequence[Cell], time: np.ndarray) -> str:
    """Position RMSE against time, logarithmic, with the bound dashed."""
    lines = [(np.sqrt(cell.per_scan["position_sq_m2"]), COLORS[i % len(COLORS)], "")
             for i, cell in enumerate(cells)]  # fmt: skip
    bound = cells[0].per_scan.get("bound_m2")
    if bound is not None:
        lines.append((np.sqrt(bound), "#1c2430", 'stroke-dasharray="5 4"'))
    known = np.concatenate([y[np.isfinite(y) & (y > 0)] for y, _, _ in lines])
    if not len(known) or len(time) < 2:
        return ""
    low, high = np.log10(known.min()), np.log10(known.max())
    span = max(high - low, 0.05)
    drawn = "".join(_line(time, y, (low, span), *style) for y, *style in lines)
    label = '<text x="{x}" y="{y}" font-size="11" fill="#5b6675" text-anchor="{at}">{words}</text>'
    foot = HEIGHT - BOTTOM
    words = (
        label.format(x=LEFT - 6, y=12, at="end", words=f"{10**high:.3g} m"),
        label.format(x=LEFT - 6, y=foot, at="end", words=f"{10**low:.3g} m"),
        label.format(x=LEFT, y=HEIGHT - 8, at="start", words=f"{time[0]:.4g} s"),
        label.format(x=WIDTH, y=HEIGHT - 8, at="end", words=f"{time[-1]:.4g} s"),
    )
    frame = f'<path d="M{LEFT} 4V{foot}H{WIDTH}" fill="none" stroke="#5b6675"/>'
    return (
        f'<svg role="img" aria-label="position RMSE against time" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'width="{WIDTH}" height="{HEIGHT}">{frame}{"".join(words)}{drawn}</svg>'
    )


def _line(
    time: np.ndarray, y: np.ndarray, scale: tuple[float, float], color: str, dash: str
) -> str:
    """A polyline of at most a few hundred points; what is no number leaves it out."""
    low, span = scale
    every = np.unique(np.linspace(0, len(time) - 1, 400).astype(int))
    every = every[np.isfinite(y[every]) & (y[every] > 0)]
    x = LEFT + (WIDTH - LEFT) * (time[every] - time[0]) / (time[-1] - time[0])
    height = HEIGHT - BOTTOM - 6
    up = 6 + height * (1 - (np.log10(y[every]) - low) / span)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, up, strict=True))
    return f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.6" {dash}/>'
