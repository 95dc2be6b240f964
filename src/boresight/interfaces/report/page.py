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

from boresight.errors import OutputError, UsageError
from boresight.interfaces.answers import plain
from boresight.interfaces.report import (
    calibrated,
    charts,
    sections,
    study_page,
    tma_page,
    tracks,
)
from boresight.interfaces.report.sections import Part

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration
    from boresight.laboratory.result import StudyResult
    from boresight.target_motion.result import TmaResult
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
    result: "TrackingResult | None" = None,
    comparisons: "Sequence[Comparison]" = (),
    inspection: dict[str, Any] | None = None,
    command: str = "",
    *,
    as_seen: "Sequence[Comparison]" = (),
    calibration: "Calibration | None" = None,
    motion: "TmaResult | None" = None,
    study: "StudyResult | None" = None,
) -> Report:
    """Make the report of a tracked recording, a radar's calibration, both, contacts or a study.

    Args:
        result: what the tracker found.
        comparisons: filters against known truth, where there is one.
        inspection: what `inspect` says of the file; `file` and `sha256` are shown if present.
        command: the command line that made it, for the reader who wants to repeat it.
        as_seen: the same filters against the truth as the sensor, with its known systematic
            errors, would see it without noise.
        calibration: of the radar.
        motion: what target motion analysis says of each contact.
        study: what a comparison of filters found.

    Raises:
        UsageError: there is nothing to report.
    """
    inspection = inspection or {}
    parts = []
    if result is not None:
        parts.append(tracks.part(result, comparisons, as_seen, inspection))
    if calibration is not None:
        parts.append(calibrated.part(calibration, {} if parts else inspection))
    if motion is not None:
        parts.append(tma_page.part(motion))
    if study is not None:
        parts.append(study_page.part(study))
    if not parts:
        raise UsageError(
            "a report needs tracks, a calibration, or both", next_step="report(tracks, calibration)"
        )
    return Report(_page(parts, inspection, provenance(inspection, command)))


def provenance(inspection: dict[str, Any], command: str) -> dict[str, Any]:
    """What made a page: the file it is about, the command, and the versions of what computed."""
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


def _page(parts: Sequence[Part], inspection: dict[str, Any], provenance: dict[str, Any]) -> str:
    here = files("boresight.interfaces.report")
    style, script = ((here / name).read_text("utf-8") for name in ("page.css", "page.js"))
    title = escape(str(inspection.get("file", f"{parts[0].kind} report")))
    shown = {name: chart for part in parts for name, chart in part.charts.items()}
    drawing = {"charts": shown, "series": parts[0].series}
    facts = {name: fact for part in parts for name, fact in part.facts.items()}
    facts |= {"recording": inspection, "provenance": provenance}
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{title} · boresight</title>\n<link rel="icon" href="data:,">\n'
        f"<style>\n{style}</style>\n</head>\n"
        f"<body>\n{sections.body(parts, inspection, provenance)}\n"
        f'<script type="application/json" id="boresight-report">{embedded(facts)}</script>\n'
        f'<script type="application/octet-stream" id="library">{charts.packed(charts.library())}'
        "</script>\n"
        f'<script type="application/octet-stream" id="drawing">{charts.packed_json(drawing)}'
        f"</script>\n<script>\n{script}</script>\n</body>\n</html>\n"
    )


def embedded(facts: dict[str, Any]) -> str:
    """The machine-readable part: what the page says, as JSON; `<` cannot end the element."""
    return json.dumps(plain(facts), allow_nan=False).replace("<", "\\u003c")
