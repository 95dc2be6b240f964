"""Tracks from the plots of one radar: identity, noise, filter, verdicts.

Association here is by identity (24-bit address, else Mode A with continuity). The filter is any of
the catalogue; the noise it runs with is measured from the plots, and the process noise chosen on
the first half of the recording, so that the second half can test it.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError, UsageError
from boresight.filters.method import Filter
from boresight.maths.frames import Site
from boresight.models.atmosphere import Atmosphere
from boresight.models.sensors import Radar
from boresight.tracking import tables
from boresight.tracking.choose import choose_noise, recursion_for, warmed_up
from boresight.tracking.flight import Filtered, Flights, fly
from boresight.tracking.identity import Sorted, sort_by_identity
from boresight.tracking.noise import Noise, measure, steady, straight_by_roll
from boresight.tracking.result import TrackingResult

if TYPE_CHECKING:
    import polars as pl

Array = Any
Progress = Callable[[float, float], None]
HIGHEST_M, LOWEST_M = 30_000.0, -1_500.0  # pressure altitudes outside are garbled
NOWHERE = Site(latitude_deg=45.0, longitude_deg=0.0, height_m=0.0)


def track(
    plots: "pl.DataFrame",
    *,
    filter: Filter,  # noqa: A002 - the field's word, and the keyword users type
    site: Site | None = None,
    sensor: str | None = None,
    noise: Noise | None = None,
    atmosphere: Atmosphere | None = None,
    progress: Progress | None = None,
) -> TrackingResult:
    """Track every identified target of one radar.

    Args:
        plots: table of plots, as `read` gives it.
        filter: of the catalogue.
        site: of the radar; without it tracks have no latitude and longitude, and heights are
            relative to a nominal place.
        sensor: which sensor ("SAC/SIC") if the table has several; left out: the busiest.
        noise: of the radar and its targets; left out: found from the plots.
        atmosphere: the air whose delay is taken out of the ranges; needs altitudes.
        progress: called with how much is done, of how much.

    Raises:
        UsageError: the sensor is not in the table.
        DataError: no plot can be used.
    """
    say = progress or (lambda _done, _total: None)
    remarks: list[str] = []
    plots = _one_sensor(plots, sensor, remarks)
    say(0, 4)
    found = sort_by_identity(plots)
    if not len(found.row):
        raise DataError(
            "no plot can be tracked",
            why=_why_none(plots),
            next_step="boresight inspect FILE says what the file holds",
        )
    place, how = site or NOWHERE, "given"
    case = _case(plots, found, place, atmosphere)
    if noise is None:
        say(1, 4)
        noise, how = _find_noise(case, filter, place)
    say(2, 4)
    recursion = recursion_for(filter, noise, place, case.flights.z.shape[1])
    result = fly(case.flights, recursion, place)
    say(3, 4)
    settings = _settings(case, site, noise, how) | {"atmosphere": _air(atmosphere)}
    return _result(case, result, filter.name, site, settings, remarks)


@dataclass(frozen=True, eq=False)
class _Case:
    """The plots of one radar, sorted, and which of them lie in straight flight.

    `half` is the instant that halves the recording.
    """

    plots: "pl.DataFrame"
    found: Sorted
    flights: Flights
    straight: Array
    known: Array
    half: float


def _case(plots: "pl.DataFrame", found: Sorted, site: Site, atmosphere: Atmosphere | None) -> _Case:
    flights = _flights(plots, found)
    if atmosphere is not None and flights.z.shape[1] == 3:
        radar = Radar(range_m=1, azimuth_deg=1, pressure_altitude_m=1, site=site)
        flights = replace(flights, z=replace(radar, atmosphere=atmosphere).without_air(flights.z))
    roll = tables.column(plots, "roll_deg", np.nan)[found.row]
    half = float(flights.time.min() + flights.time.max()) / 2
    return _Case(plots, found, flights, *straight_by_roll(flights, roll), half)


def _why_none(plots: "pl.DataFrame") -> str:
    if np.isfinite(tables.column(plots, "x_m", np.nan)).any():
        return (
            "positions are x and y (multilateration or surface movement); tracking by identity "
            "takes range and azimuth of a radar"
        )
    return "none has both a position and an identity (24-bit address or valid Mode A code)"


def _find_noise(case: _Case, chosen: Filter, place: Site) -> tuple[Noise, str]:
    """Noise from the plots, and a sentence that says how."""
    flights, scan = case.flights, case.found.scan_s
    heard = bool(case.known.mean() > 0.1)
    scored = case.straight if heard else steady(flights, scan)
    noise = choose_noise(flights, scored, measure(flights, scan), chosen, place, case.half)
    flight = "downlinked roll below 2 degrees" if heard else "no fitted acceleration"
    return noise, (
        "sensor noise measured as scatter about cubics through nine plots; process noise and "
        f"widening of highest likelihood in straight flight ({flight}) in the first half"
    )


def _one_sensor(plots: "pl.DataFrame", sensor: str | None, remarks: list[str]) -> "pl.DataFrame":
    import polars as pl

    if "sensor" not in plots.columns:
        return plots
    counts = plots["sensor"].value_counts(sort=True)
    names = counts["sensor"].to_list()
    if sensor is not None and sensor not in names:
        raise UsageError(
            f"there is no sensor {sensor!r} in the plots",
            next_step=f"use one of {', '.join(map(str, names))}",
        )
    if sensor is None and len(names) > 1:
        remarks.append(
            f"The file holds plots of {len(names)} sensors ({', '.join(map(str, names))}); "
            f"{names[0]}, the busiest, was tracked. Choose with --sensor."
        )
    return plots.filter(pl.col("sensor") == (sensor or names[0])) if names else plots


def _flights(plots: "pl.DataFrame", found: Sorted) -> Flights:
    columns = [
        plots["range_m"].to_numpy()[found.row],
        np.radians(plots["azimuth_deg"].to_numpy()[found.row]),
    ]
    altitude = tables.column(plots, "pressure_altitude_m", np.nan)[found.row]
    valid = tables.column(plots, "altitude_valid", default=True).astype(bool)[found.row]
    valid &= (altitude > LOWEST_M) & (altitude < HIGHEST_M)
    if valid.any():
        columns.append(np.where(valid, altitude, np.nan))
    return Flights(plots["time_s"].to_numpy()[found.row], np.stack(columns, axis=-1), found.track)


def _air(atmosphere: Atmosphere | None) -> str:
    return "none" if atmosphere is None else str(atmosphere)


def _settings(case: _Case, site: Site | None, noise: Noise, how: str) -> dict[str, Any]:
    plots = case.plots
    return {
        "sensor": str(plots["sensor"][0]) if "sensor" in plots.columns else "",
        "site": asdict(site) if site else None,
        "noise": asdict(noise),
        "noise_chosen": how,
        "association": "by identity: 24-bit address, else Mode A code with continuity",
        "scan_s": case.found.scan_s,
        "dimensions": case.flights.z.shape[1],
    }


def _result(
    case: _Case,
    result: Filtered,
    name: str,
    site: Site | None,
    settings: dict[str, Any],
    remarks: list[str],
) -> TrackingResult:
    plots, found, flights = case.plots, case.found, case.flights
    used = int(np.count_nonzero((result["inside"] > 0.5) | result.started))
    rejected = len(flights.time) - used
    nis = _nis(case, result)
    return TrackingResult(
        tracks=tables.track_table(plots, found, flights, result, site),
        residuals=tables.residual_table(
            flights, result, settings["sensor"], case.straight, case.known
        ),
        targets=tables.target_table(plots, found, flights, result),
        skipped=tables.skipped_table(found.skipped, rejected),
        plots=plots.height,
        used=used,
        rejected=rejected,
        filter=name,
        nis=nis,
        settings=settings,
        remarks=remarks + tables.remarks(flights, result, nis, site),
    )


def _nis(case: _Case, result: Filtered) -> dict[str, dict[str, float]]:
    judged = (result["dof"] > 0) & warmed_up(case.flights, result.started)
    straight, second = judged & case.straight, case.flights.time >= case.half
    return {
        "all": tables.nis_summary(result, judged),
        "straight": tables.nis_summary(result, straight),
        "straight_first_half": tables.nis_summary(result, straight & ~second),
        "straight_second_half": tables.nis_summary(result, straight & second),
    }
