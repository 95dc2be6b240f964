"""A calibration put to use: what the tracker takes of it."""

from dataclasses import dataclass
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.errors import UsageError

if TYPE_CHECKING:
    import polars as pl

    from boresight.calibration.result import Calibration
    from boresight.maths.frames import Site
    from boresight.models.atmosphere import Atmosphere

DOWNLINK = "downlink"


@dataclass(frozen=True, kw_only=True)
class Applied:
    """Arguments of `tracking.tracker.track`, and what to say of them."""

    arguments: dict[str, Any]
    remarks: list[str]


def applied(
    calibration: "Calibration | str | PathLike[str] | None",
    plots: "pl.DataFrame",
    *,
    site: "Site | None",
    sensor: str | None,
    atmosphere: "Atmosphere | None",
) -> Applied:
    """Site, sensor, air, systematic errors and noise to track with.

    Args:
        calibration: or the path of its file; None for none.
        plots: to be tracked.
        site: given, or of the recording; None: that of the calibration.
        sensor: given; None: that of the calibration if the plots have it.
        atmosphere: given; None: that of the calibration.

    Raises:
        UsageError: another air than that of the calibration, or no calibration at all.
        MissingInputError: its file is not there or cannot be read.
        DataError: its file is no calibration.
    """
    if calibration is None:
        return Applied(
            arguments={"site": site, "sensor": sensor, "atmosphere": atmosphere}, remarks=[]
        )
    found = _found(calibration)
    known = plots["sensor"].unique().to_list() if "sensor" in plots.columns else []
    remarks = []
    chosen = sensor or (found.sensor if found.sensor in known else None)
    if known and chosen != found.sensor:
        remarks.append(
            f"The calibration is of sensor {found.sensor or 'without a name'}, the plots are of "
            f"{chosen or ', '.join(map(str, known))}."
        )
    noise = (found.noise.range_m, found.noise.azimuth_deg)
    is_whole = all(map(isfinite, noise)) and found.reference != DOWNLINK
    if found.reference == DOWNLINK:
        remarks.append(
            "The noise was found from the plots, not taken from the calibration: against downlink "
            "it shows only what changes from plot to plot."
        )
    delay = found.noise.target_range_m
    arguments = {
        "site": site or found.site,
        "sensor": chosen,
        "atmosphere": _air(found, atmosphere),
        "errors": found.errors,
        "sensor_noise": noise if is_whole else None,
        "delay_m": delay if isfinite(delay) else 0.0,
    }
    return Applied(arguments=arguments, remarks=remarks)


def _found(given: "Calibration | str | PathLike[str]") -> "Calibration":
    from boresight.calibration.file import read_calibration
    from boresight.calibration.result import Calibration

    if isinstance(given, str | PathLike):
        return read_calibration(Path(given))
    if not isinstance(given, Calibration):
        raise UsageError(
            f"the calibration is a {type(given).__name__}",
            next_step="give what calibrate returns, or the path of a calibration.toml",
        )
    return given


def _air(found: "Calibration", given: "Atmosphere | None") -> "Atmosphere | None":
    """The calibration's air: its range gain goes with no other."""
    from boresight.models.atmosphere import atmosphere, spelled

    if given is not None and spelled(given) != found.atmosphere:
        raise UsageError(
            f"the calibration was made with the atmosphere {found.atmosphere}, "
            f"not {spelled(given)}",
            why="the air's delay would be taken out twice, or not at all",
            next_step="leave the atmosphere out: the calibration's is used",
        )
    return atmosphere(found.atmosphere)
