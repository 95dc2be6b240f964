"""What a calibration does for tracks: plots corrected by it, and its uncertainty carried along."""

from dataclasses import replace
from typing import Any

import numpy as np

from boresight.errors import FormulaError, UsageError
from boresight.filters.consider import consider
from boresight.filters.recursion import Recursion
from boresight.maths.digits import decimals, with_unit
from boresight.maths.frames import Site, geodetic_from_enu
from boresight.models.systematic import TERMS, SystematicErrors
from boresight.tracking.flight import Filtered, Flights, fly

Array = Any
_RANGE = "range_bias_m"
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


def carried(errors: SystematicErrors | None, delay_m: float = 0.0) -> SystematicErrors | None:
    """The errors that plots of range, azimuth and altitude show, and that are uncertain.

    Args:
        errors: of the radar.
        delay_m: spread of the targets' own delays: to one track a bias of range like the radar's.
    """
    if errors is None:
        return None
    terms = errors.terms if _RANGE in errors.terms else (*errors.terms, _RANGE)
    cov = np.zeros((len(terms), len(terms)))
    cov[: len(errors.terms), : len(errors.terms)] = errors.cov
    cov[terms.index(_RANGE), terms.index(_RANGE)] += delay_m**2
    kept = [i for i, t in enumerate(terms) if cov[i, i] > 0.0 and t not in _UNSEEN]
    return SystematicErrors(
        terms=tuple(terms[i] for i in kept),
        estimate=np.array([errors.value(terms[i]) for i in kept]),
        cov=cov[np.ix_(kept, kept)],
    )


def fly_carrying(
    flights: Flights, plain: Recursion, site: Site, errors: SystematicErrors
) -> tuple[Recursion, Filtered, str]:
    """Filter every track with the errors' uncertainty, if the filter can carry it.

    Args:
        flights: plots by track, corrected.
        plain: filter, motion and sensor, without a guard.
        site: of the radar.
        errors: that are left.

    Returns:
        The filter as it flew, what it says, and why it could not carry the errors ("" if it could).
    """
    if not errors.terms:
        return plain, fly(flights, plain, site), ""
    try:
        recursion = consider(plain, errors)
        return recursion, fly(flights, recursion, site), ""
    except UsageError as error:
        why = error.why
    except FormulaError:
        why = f"with {len(errors.terms)} terms its formula is too long for a kernel"
    return plain, fly(flights, plain, site), why


def cannot(name: str, why: str) -> str:
    """The remark on a filter that cannot carry a calibration's uncertainty."""
    return (
        f"{name} does not carry the calibration's uncertainty ({why}): its plots are corrected, "
        "but its covariance, gate and residuals take the correction for exact. ekf and mekf "
        "carry it."
    )


def applied(errors: SystematicErrors, left: SystematicErrors) -> dict[str, Any]:
    """What was taken out of the plots, its standard deviation, and what was carried on."""
    sd = np.sqrt(np.diag(errors.cov))
    return {
        "estimate": dict(zip(errors.terms, errors.estimate.tolist(), strict=True)),
        "sd": dict(zip(errors.terms, sd.tolist(), strict=True)),
        "carried": dict(zip(left.terms, np.sqrt(np.diag(left.cov)).tolist(), strict=True)),
    }


def _figure(value: float, sd: float, unit: str) -> str:
    """A number and its standard deviation: `+86.8 ± 1.9 m`."""
    places = decimals(sd)
    return f"{value:+z,.{places}f} ± " + with_unit(sd, places, unit).lstrip("+")


def said(errors: SystematicErrors, left: SystematicErrors) -> str:
    """A sentence for the reader."""
    sd = np.sqrt(np.diag(errors.cov))
    figures = ", ".join(
        f"{TERMS[t].words} {_figure(value, spread, TERMS[t].unit)}"
        for t, value, spread in zip(errors.terms, errors.estimate, sd, strict=True)
    )
    tail = (
        "What is uncertain of them is in every track's covariance. Tracks of one radar share it, "
        "so their errors are alike; no track's covariance shows that."
        if left.terms
        else "They are taken for exact."
    )
    return f"Plots were corrected by the calibration: {figures} (standard deviations). {tail}"
