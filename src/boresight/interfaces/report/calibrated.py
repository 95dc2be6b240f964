"""What a calibration puts on the page: what is wrong with the sensor, and how sure that is."""

from typing import TYPE_CHECKING, Any

from boresight.interfaces.report.sections import Part, Tile
from boresight.interfaces.report.words import figure

if TYPE_CHECKING:
    from boresight.calibration.result import Calibration


def part(calibration: "Calibration", inspection: dict[str, Any]) -> Part:  # noqa: ARG001 - soon
    """Return the calibration's part of the page."""
    return Part(
        kind="calibration",
        title=f"Radar {calibration.sensor}".rstrip(),
        subject="The sensor",
        tiles=(Tile("pairs", figure(calibration.pairs), ""),),
        sentences=(),
        remarks=calibration.remarks,
        blocks=(),
        settings=("How it was calibrated", calibration.settings),
        charts={},
        series=None,
        facts={},
    )
