"""Tracks from the plots of one radar: identity, noise, filter, verdicts.

Association here is by identity (24-bit address, else Mode A with continuity). The filter is any of
the catalogue; the noise it runs with is measured from the plots, and the process noise chosen on
the first half of the recording, so that the second half can test it. Filters that are compared
with it run on the same plots with the same noise.

Where a calibration is given, plots are corrected by it and what it is uncertain of goes into the
covariance of every track (`filters.consider`). Each track carries that alone: tracks of one radar
err alike by it, so a difference of two tracks errs by less than their covariances add up to.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters.method import Filter
from boresight.formats.usable import one_sensor
from boresight.maths.frames import Site
from boresight.models.atmosphere import Atmosphere
from boresight.models.systematic import SystematicErrors
from boresight.tracking import tables
from boresight.tracking.beside import Flown, side_by_side
from boresight.tracking.case import Case, prepare
from boresight.tracking.choose import choose_noise, recursion_for, warmed_up
from boresight.tracking.corrections import applied, cannot, carried, fly_carrying, moved, said
from boresight.tracking.flight import Filtered, fly
from boresight.tracking.noise import Noise, measure
from boresight.tracking.result import TrackingResult

if TYPE_CHECKING:
    import polars as pl

Array = Any
Progress = Callable[[float, float], None]
NOWHERE = Site(latitude_deg=45.0, longitude_deg=0.0, height_m=0.0)


def track(
    plots: "pl.DataFrame",
    *,
    filter: Filter,  # noqa: A002 - the field's word, and the keyword users type
    compare: Sequence[Filter] = (),
    leave_out: bool = False,
    site: Site | None = None,
    sensor: str | None = None,
    noise: Noise | None = None,
    atmosphere: Atmosphere | None = None,
    errors: SystematicErrors | None = None,
    sensor_noise: tuple[float, float] | None = None,
    delay_m: float = 0.0,
    progress: Progress | None = None,
) -> TrackingResult:
    """Track every identified target of one radar.

    Args:
        plots: table of plots, as `read` gives it.
        filter: of the catalogue.
        compare: filters to run beside it on the same plots with the same noise.
        leave_out: remark on those of them that cannot take these plots, instead of raising.
        site: of the radar; without it tracks have no latitude and longitude, and heights are
            relative to a nominal place.
        sensor: which sensor ("SAC/SIC") if the table has several; left out: the busiest.
        noise: of the radar and its targets; left out: found from the plots.
        atmosphere: the air whose delay is taken out of the ranges; needs altitudes.
        errors: the radar's systematic errors, as a calibration with the same atmosphere found
            them: plots, their times and the site are corrected by the estimate, and the filter
            carries its covariance.
        sensor_noise: of range, m, and azimuth, degrees, where a calibration found it; left out:
            measured. Altitude and process noise are found from the plots all the same.
        delay_m: spread of the ranges' error from target to target, as a calibration found it;
            carried like what is left of the radar's own.
        progress: called with how much is done, of how much.

    Raises:
        UsageError: the sensor is not in the table; a filter cannot take what the radar measures.
        DataError: no plot can be used.
    """
    say = progress or (lambda _done, _total: None)
    remarks: list[str] = []
    how, stages = "given", 3 + len(compare)
    left = carried(errors, delay_m)
    if errors and left:
        site = moved(site, errors) if site else None
        remarks.append(said(errors, left))
    place = site or NOWHERE
    case = prepare(one_sensor(plots, sensor, remarks), place, atmosphere, errors)
    if noise is None:
        say(1, stages)
        noise, how = _find_noise(case, filter, place, sensor_noise)
    one = partial(_fly, case, noise=noise, place=place, left=left, remarks=remarks)
    watched = _watched((filter, *compare), lambda done: say(2 + done, stages))
    flown = _in_turn(watched, one, remarks, leave_out=leave_out)
    settings = _settings(case, site, noise, how) | {"atmosphere": _air(atmosphere)}
    settings["errors"] = applied(errors, left) if errors and left else None
    result = _result(case, flown[0], site, settings, remarks)
    rows, scores = side_by_side(case, flown, place)
    return replace(result, filters=rows, scores=scores if len(flown) > 1 else None)


def _watched(filters: Sequence[Filter], say: Callable[[int], None]) -> Iterator[Filter]:
    """The filters, each announced with how many came before it."""
    for done, each in enumerate(filters):
        say(done)
        yield each


def _in_turn(
    filters: Iterable[Filter],
    one: Callable[[Filter], Flown],
    remarks: list[str],
    *,
    leave_out: bool,
) -> list[Flown]:
    """Every filter's pass; of those after the first, one that cannot take the plots is remarked."""
    flown: list[Flown] = []
    for each in filters:
        try:
            flown.append(one(each))
        except UsageError as error:
            if not (flown and leave_out):
                raise
            remarks.append(f"{each.name} is not compared: {error.what}.")
    return flown


def _fly(
    case: Case,
    chosen: Filter,
    *,
    noise: Noise,
    place: Site,
    left: SystematicErrors | None,
    remarks: list[str],
) -> Flown:
    """One filter's pass, with what is left of the radar's errors."""
    recursion = recursion_for(chosen, noise, place, case.flights.z.shape[1])
    if left is None:
        return Flown(chosen.name, recursion, fly(case.flights, recursion, place))
    recursion, result, why = fly_carrying(case.flights, recursion, place, left)
    remarks += [cannot(chosen.name, why)] if why else []
    return Flown(chosen.name, recursion, result)


def _find_noise(
    case: Case, chosen: Filter, place: Site, known: tuple[float, float] | None
) -> tuple[Noise, str]:
    """Noise from the plots, but for what is known of it, and a sentence that says how."""
    noise = measure(case.flights, case.found.scan_s)
    how, found = "sensor noise measured as scatter about cubics through nine plots", "widening"
    if known:
        noise = replace(noise, range_m=known[0], azimuth_deg=known[1])
        how, found = "noise of range and azimuth given by the calibration", "widening of altitudes"
    noise = choose_noise(
        case.flights, case.level(), noise, chosen, place, case.half, held=known is not None
    )
    flight = "downlinked roll below 2 degrees" if case.hears_roll else "no fitted acceleration"
    return noise, (
        f"{how}; process noise and {found} of highest likelihood with {chosen.name} in straight "
        f"flight ({flight}) in the first half"
    )


def _air(atmosphere: Atmosphere | None) -> str:
    return "none" if atmosphere is None else str(atmosphere)


def _settings(case: Case, site: Site | None, noise: Noise, how: str) -> dict[str, Any]:
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
    case: Case,
    flown: Flown,
    site: Site | None,
    settings: dict[str, Any],
    remarks: list[str],
) -> TrackingResult:
    plots, found, flights, result = case.plots, case.found, case.flights, flown.result
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
        filter=flown.filter,
        nis=nis,
        settings=settings,
        remarks=remarks + tables.remarks(flights, result, nis, site),
    )


def _nis(case: Case, result: Filtered) -> dict[str, dict[str, float]]:
    judged = (result["dof"] > 0) & warmed_up(case.flights, result.started)
    straight, second = judged & case.straight, case.flights.time >= case.half
    return {
        "all": tables.nis_summary(result, judged),
        "straight": tables.nis_summary(result, straight),
        "straight_first_half": tables.nis_summary(result, straight & ~second),
        "straight_second_half": tables.nis_summary(result, straight & second),
    }
