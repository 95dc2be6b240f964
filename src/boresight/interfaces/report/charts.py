"""What every chart shares: typed arrays, colours, axes, and the packed bundle in the page.

Charts are plain dicts of plotly.js. The library and all charts travel deflated: the page is less
than half the size, and holds no address of any kind for a reader to stumble over.
"""

import base64
import json
import zlib
from importlib.resources import files
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Chart: TypeAlias = dict[str, Any]

# Okabe and Ito's palette: apart for every common kind of colour vision, and in grey by lightness.
INK, MUTED, GRID = "#1c2430", "#5b6675", "#e3e7ec"
BLUE, ORANGE, PURPLE, GREEN = "#0072B2", "#D55E00", "#8a4f7d", "#00785a"
BAND = "rgba(91,102,117,0.16)"
DENSITY = [[0, "#e4eef7"], [0.35, "#9cc4e2"], [0.7, "#4489bd"], [1, "#0b3f6b"]]


def typed(values: ArrayLike, dtype: str = "f4") -> dict[str, Any]:
    """Return plotly.js's typed array: the octets in base64, two axes as its `shape`."""
    array = np.ascontiguousarray(values, dtype=np.dtype(dtype).newbyteorder("<"))
    packed: dict[str, Any] = {"dtype": dtype, "bdata": base64.b64encode(array.tobytes()).decode()}
    if array.ndim == 2:
        packed["shape"] = ", ".join(map(str, array.shape))
    return packed


def short(values: ArrayLike, bits: int = 12) -> dict[str, Any]:
    """Return a typed array of floats that keep `bits` of their fraction: they pack tighter."""
    array = np.ascontiguousarray(values, dtype="<f4")
    half = np.uint32(1 << (22 - bits))
    mask = np.uint32(0xFFFFFFFF << (23 - bits) & 0xFFFFFFFF)
    rounded = ((array.view("<u4") + half) & mask).view("<f4")
    return typed(np.where(np.isfinite(array), rounded, array))


def milliseconds(time_s: ArrayLike) -> NDArray[np.float64]:
    """Return what a date axis of plotly.js counts in."""
    return np.round(np.asarray(time_s, dtype=float) * 1000)


def axis(title: str, **options: Any) -> Chart:
    """An axis in the page's style."""
    style = {"gridcolor": GRID, "zeroline": False, "linecolor": MUTED, "ticks": "outside"}
    style |= {"ticklen": 4, "tickcolor": MUTED, "automargin": True, "title": {"text": title}}
    return style | options


def layout(**options: Any) -> Chart:
    """A layout in the page's style."""
    font = {"family": "system-ui, Segoe UI, Roboto, Noto Sans, sans-serif"}
    style = {
        "font": font | {"size": 12, "color": INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "#ffffff",
        "margin": {"l": 8, "r": 8, "t": 8, "b": 8},
        "hovermode": "closest",
        "showlegend": False,
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "xanchor": "left", "yanchor": "bottom"},
    }
    return style | options


def line(x: Any, y: Any, color: str, **options: Any) -> Chart:
    """A line trace."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": x,
        "y": y,
        "line": {"color": color, "width": 1.8},
    } | options


def band(x: Any, low: Any, high: Any, name: str) -> list[Chart]:
    """Two traces that shade what lies between `low` and `high`."""
    edge = {"line": {"width": 0, "color": BAND}, "hoverinfo": "skip"}
    upper = {"fill": "tonexty", "fillcolor": BAND, "name": name}
    return [
        line(x, low, BAND, showlegend=False) | edge,
        line(x, high, BAND, showlegend=True) | edge | upper,
    ]


def library() -> bytes:
    """Return the script of plotly.js."""
    return (files("plotly") / "package_data" / "plotly.min.js").read_bytes()


def packed(content: bytes) -> str:
    """Return `content` deflated, in base64; level 4 is within 4 % of 9 in a third of its time."""
    return base64.b64encode(zlib.compress(content, 4)).decode()


def packed_json(content: Any) -> str:
    """Return `content` as packed JSON."""
    return packed(json.dumps(content, allow_nan=False, separators=(",", ":")).encode())
