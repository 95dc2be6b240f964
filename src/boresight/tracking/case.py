"""The plots of one radar made ready to track: sorted by identity, air and errors taken out."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError
from boresight.maths.frames import Site
from boresight.models.atmosphere import Atmosphere
from boresight.models.sensors import Radar
from boresight.models.systematic import SystematicErrors
from boresight.tracking import tables
from boresight.tracking.corrections import corrected
from boresight.tracking.flight import Flights
from boresight.tracking.identity import Sorted, sort_by_identity
from boresight.tracking.noise import steady, straight_by_roll

if TYPE_CHECKING:
    import polars as pl

Array = Any
HIGHEST_M, LOWEST_M = 30_000.0, -1_500.0  # pressure altitudes outside are garbled
HEARD = 0.1  # of the plots must have a roll near them, or straight flight is judged by the plots


@dataclass(frozen=True, eq=False)
class Case:
    """The plots of one radar, sorted, and which of them lie in straight flight.

    Attributes:
        plots: the table they come from; `found.row` picks those of `flights`.
        found: which plots belong together.
        flights: the plots as arrays.
        straight, known: (m,) whether the downlinked roll says so, and whether one was heard.
        half: the instant that halves the recording.
    """

    plots: "pl.DataFrame"
    found: Sorted
    flights: Flights
    straight: Array
    known: Array
    half: float

    @property
    def hears_roll(self) -> bool:
        """Whether enough aircraft tell their roll to judge straight flight by it."""
        return bool(self.known.mean() > HEARD)

    def level(self) -> Array:
        """(m,) whether a plot lies in straight flight: by roll, or by the plots if none is told."""
        return self.straight if self.hears_roll else steady(self.flights, self.found.scan_s)

    def column(self, name: str) -> Array:
        """(m,) a number of the table beside each plot, NaN where it is not told."""
        return tables.column(self.plots, name, np.nan)[self.found.row]


def prepare(
    plots: "pl.DataFrame",
    site: Site,
    atmosphere: Atmosphere | None,
    errors: SystematicErrors | None = None,
) -> Case:
    """Sort the plots of one radar by identity, and correct them.

    Args:
        plots: of one radar.
        site: where its antenna is.
        atmosphere: whose delay is taken out of the ranges, before the errors: in this order a
            calibration finds them.
        errors: of the radar, whose estimate is then taken out.

    Raises:
        DataError: no plot can be tracked.
    """
    found = sort_by_identity(plots)
    if not len(found.row):
        raise DataError(
            "no plot can be tracked",
            why=_why_none(plots),
            next_step="boresight inspect FILE says what the file holds",
        )
    flights = _flights(plots, found)
    if atmosphere is not None and flights.z.shape[1] == 3:
        radar = Radar(range_m=1, azimuth_deg=1, pressure_altitude_m=1, site=site)
        flights = replace(flights, z=replace(radar, atmosphere=atmosphere).without_air(flights.z))
    if errors is not None:
        flights = corrected(flights, errors)
    roll = tables.column(plots, "roll_deg", np.nan)[found.row]
    half = float(flights.time.min() + flights.time.max()) / 2
    return Case(plots, found, flights, *straight_by_roll(flights, roll), half)


def _why_none(plots: "pl.DataFrame") -> str:
    if np.isfinite(tables.column(plots, "x_m", np.nan)).any():
        return (
            "positions are x and y (multilateration or surface movement); tracking by identity "
            "takes range and azimuth of a radar"
        )
    return "none has both a position and an identity (24-bit address or valid Mode A code)"


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
