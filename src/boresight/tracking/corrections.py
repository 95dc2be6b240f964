"""What a calibration does for tracks: plots corrected by it, and its uncertainty carried along."""

from dataclasses import replace
from typing import Any

import numpy as np

from boresight.filters.consider import consider
from boresight.filters.recursion import Recursion
from boresight.filters.steps import Updating
from boresight.maths.frames import Site, geodetic_from_enu
from boresight.models.systematic import TERMS, SystematicErrors
from boresight.tracking.flight import Flights

Array = Any
_UNSEEN = ("elevation_bias_deg",)  # no elevation is tracked


def corrected(flights: Flights, errors: SystematicErrors) -> Flights:
    """Plots without a radar's systematic errors; their times are those of measurement."""
    z = np.array(flights.z)
    clean = errors.corrected({"range_m": z[:, 0], "azimuth_rad": z[:, 1]})
    z[:, 0], z[:, 1] = clean["range_m"], clean["azimuth_rad"]
    return replace(flights, time=flights.time - errors.value("time_bias_s"), z=z)


def moved(site: Site, errors: SystematicErrors) -> Site:
    """Where the antenna really is."""
    offset = [errors.value("site_east_m"), errors.value("site_north_m"), 0.0]
    if not any(offset):
        return site
    place = geodetic_from_enu(np.array(offset), site)
    return Site(
        latitude_deg=float(place.latitude_deg),
        longitude_deg=float(place.longitude_deg),
        height_m=site.height_m,
    )


def carried(errors: SystematicErrors | None) -> SystematicErrors | None:
    """The errors that plots of range, azimuth and altitude show, and that are uncertain."""
    if errors is None:
        return None
    uncertain = np.diag(errors.cov) > 0.0
    kept = [i for i, t in enumerate(errors.terms) if uncertain[i] and t not in _UNSEEN]
    if not kept:
        return None
    return SystematicErrors(
        terms=tuple(errors.terms[i] for i in kept),
        estimate=errors.estimate[kept],
        cov=errors.cov[np.ix_(kept, kept)],
    )


def carrying(
    recursion: Recursion, errors: SystematicErrors | None, name: str, remarks: list[str]
) -> Recursion:
    """The filter with the errors' uncertainty, if it can carry it; else a remark says so."""
    if errors is None:
        return recursion
    if isinstance(recursion.method, Updating):
        return consider(recursion, errors)
    remarks.append(
        f"{name} cannot carry the calibration's uncertainty: its plots are corrected, but its "
        "covariance, gate and residuals take the correction for exact. ekf and mekf carry it."
    )
    return recursion


def applied(errors: SystematicErrors) -> dict[str, Any]:
    """What was taken out of the plots, with its standard deviation and what is carried."""
    sd, kept = np.sqrt(np.diag(errors.cov)), carried(errors)
    return {
        "estimate": dict(zip(errors.terms, errors.estimate.tolist(), strict=True)),
        "sd": dict(zip(errors.terms, sd.tolist(), strict=True)),
        "carried": list(kept.terms) if kept else [],
    }


def said(errors: SystematicErrors) -> str:
    """A sentence for the reader."""
    sd, kept = np.sqrt(np.diag(errors.cov)), carried(errors)
    figures = ", ".join(
        f"{TERMS[t].words} {value:.3g} ± {spread:.2g} {TERMS[t].unit}"
        for t, value, spread in zip(errors.terms, errors.estimate, sd, strict=True)
    )
    tail = (
        "What is uncertain of them is in every track's covariance; tracks of one radar share it, "
        "so their errors are alike, which no track's covariance shows."
        if kept
        else "They are taken for exact."
    )
    return f"Plots were corrected by the calibration: {figures} (standard deviations). {tail}"
