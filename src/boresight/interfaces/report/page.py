"""One HTML file that holds everything: sentences, tables, charts, and the library that draws."""

import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.errors import OutputError
from boresight.interfaces.answers import plain
from boresight.interfaces.report import (
    beside,
    charts,
    consistency,
    plan,
    residuals,
    sections,
    target,
)

if TYPE_CHECKING:
    from boresight.tracking.result import Comparison, TrackingResult

# The library compiles its drawing commands, hence unsafe-eval; nothing may be fetched at all.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'"
)
VERSIONED = ("boresight", "numpy", "scipy", "llvmlite", "polars", "pyproj", "plotly")


@dataclass(frozen=True)
class Report:
    """A finished page.

    Attributes:
        html: the whole page, self-contained.
    """

    html: str

    def save(self, path: str | Path) -> Path:
        """Write the page to `path` and return it.

        Raises:
            OutputError: the file cannot be written.
        """
        try:
            Path(path).write_text(self.html, encoding="utf-8")
        except OSError as error:
            raise OutputError(
                f"the report cannot be written to {path}",
                why=error.strerror or str(error),
                next_step="choose a folder you may write to, with -o DIR",
            ) from error
        return Path(path)

    def _repr_html_(self) -> str:
        """Show the page in a notebook, in a frame of its own."""
        style = "width:100%;height:80vh;border:1px solid #ccc"
        page = escape(self.html)
        return f'<iframe title="boresight report" style="{style}" srcdoc="{page}"></iframe>'


def report(
    result: "TrackingResult",
    comparisons: "Sequence[Comparison]" = (),
    inspection: dict[str, Any] | None = None,
    command: str = "",
    *,
    as_seen: "Sequence[Comparison]" = (),
) -> Report:
    """Make the report of a tracked recording.

    Args:
        result: what the tracker found.
        comparisons: filters against known truth, where there is one.
        inspection: what `inspect` says of the file; `file` and `sha256` are shown if present.
        command: the command line that made it, for the reader who wants to repeat it.
        as_seen: the same filters against the truth as the sensor, with its known systematic
            errors, would see it without noise.
    """
    inspection = inspection or {}
    drawn = [
        *residuals.panels(result.residuals),
        *consistency.panels(result.residuals, result.targets),
        *beside.panels(result),
    ]
    view, series = plan.plan(result), target.series(result)
    parts = sections.Parts(
        result=result,
        comparisons=comparisons,
        as_seen=as_seen,
        inspection=inspection,
        provenance=_provenance(inspection, command),
        plan_caption=view.caption,
        panels=drawn,
        series=series,
    )
    shown = {"plan-chart": view.chart} | {panel.name: panel.chart for panel in drawn}
    return Report(_page(parts, {"charts": shown, "series": series.content}))


def _provenance(inspection: dict[str, Any], command: str) -> dict[str, Any]:
    found = {name: inspection[name] for name in ("file", "sha256") if inspection.get(name)}
    if command:
        found["command"] = command
    found |= {name: _version(name) for name in VERSIONED}
    machine = f"{platform.system()} {platform.machine()}"
    return found | {"python": f"{platform.python_version()}, {machine}"}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _page(parts: sections.Parts, drawing: dict[str, Any]) -> str:
    here = files("boresight.interfaces.report")
    style, script = ((here / name).read_text("utf-8") for name in ("page.css", "page.js"))
    title = escape(str(parts.inspection.get("file", "tracking report")))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{title} · boresight</title>\n<link rel="icon" href="data:,">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n{sections.body(parts)}\n"
        f'<script type="application/json" id="boresight-report">{_facts(parts)}</script>\n'
        f'<script type="application/octet-stream" id="library">{charts.packed(charts.library())}'
        "</script>\n"
        f'<script type="application/octet-stream" id="drawing">{charts.packed_json(drawing)}'
        f"</script>\n<script>\n{script}</script>\n</body>\n</html>\n"
    )


def _facts(parts: sections.Parts) -> str:
    """The machine-readable part: what the page says, as JSON; `<` cannot end the element."""
    from dataclasses import asdict

    result = parts.result
    facts = {
        "plots": result.plots,
        "used": result.used,
        "rejected": result.rejected,
        "filter": result.filter,
        "nis": result.nis,
        "filters": [asdict(each) for each in result.filters],
        "settings": result.settings,
        "remarks": result.remarks,
        "targets": result.targets.to_dicts(),
        "skipped": result.skipped.to_dicts(),
        "comparisons": [asdict(each) for each in parts.comparisons],
        "as_seen": [asdict(each) for each in parts.as_seen],
        "recording": parts.inspection,
        "provenance": parts.provenance,
    }
    return json.dumps(plain(facts), allow_nan=False).replace("<", "\\u003c")
