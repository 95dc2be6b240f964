"""A made-up sky whose truth is written down as formulas of time, and a perfect radar."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from boresight.calibration.references import from_file
from boresight.maths.frames import Site, enu_from_geodetic, polar_from_enu

SITE = Site(latitude_deg=47.0, longitude_deg=8.0, height_m=500.0)
SCAN_S = 4.0


@dataclass(frozen=True)
class Aircraft:
    """Flies east and north at its speed, on a curve, and climbs."""

    number: int
    start_s: float = 1_000.0
    seconds: float = 600.0
    north_deg: float = 0.3
    east_deg: float = 0.2

    @property
    def address(self):
        return f"F0{self.number:04X}"

    @property
    def code(self):
        return f"{self.number + 0o1234:04o}"

    def truth(self, time):
        """Latitude, longitude, height."""
        t = np.asarray(time) - self.start_s
        latitude = SITE.latitude_deg + self.north_deg + 1e-3 * t + 0.02 * np.sin(t / 60)
        longitude = SITE.longitude_deg + self.east_deg - 1e-3 * t * (1 + self.number % 3)
        return latitude, longitude, 8_000.0 + 300.0 * self.number + 3.0 * t

    def enu(self, time):
        return enu_from_geodetic(*self.truth(time), SITE)

    def reports(self, every_s=1.0, offset_s=0.0, **columns):
        """Reports of a reference; times are whole 1/128 s, as in a recording."""
        time = self.start_s + np.arange(0, self.seconds, every_s) + offset_s
        latitude, longitude, height = self.truth(time)
        own = {
            "time_s": time,
            "address": self.address,
            "latitude_deg": latitude,
            "longitude_deg": longitude,
            "height_m": height,
        }
        return pl.DataFrame(own | columns)

    def plots(self, phase_s=0.5, **columns):
        """What a radar without errors measures of it."""
        time = self.start_s + np.arange(phase_s, self.seconds - 1, SCAN_S)
        polar = polar_from_enu(self.enu(time))
        own = {
            "time_s": time,
            "sensor": "1/2",
            "range_m": polar.range_m,
            "azimuth_deg": np.degrees(polar.azimuth),
            "pressure_altitude_m": self.truth(time)[2],
            "altitude_valid": True,
            "address": self.address,
            "mode_a": self.code,
            "mode_a_valid": True,
            "report_type": "mode-s",
            "radar_track": self.number,
        }
        table = pl.DataFrame(own | columns)
        return table.with_columns(pl.col("address", "mode_a").cast(pl.String))


def reference(folder, *tables, name="reference.parquet"):
    """A reference, by way of a file."""
    path = folder / name
    table = pl.concat(tables, how="diagonal")
    (table.write_csv if path.suffix == ".csv" else table.write_parquet)(path)
    return from_file(path)


def sky(plots=4, **columns):
    """Some aircraft, and the radar's plots of them by time."""
    fleet = [Aircraft(n, north_deg=0.3 + 0.05 * n) for n in range(1, plots + 1)]
    seen = [each.plots(phase_s=0.25 + 0.75 * i, **columns) for i, each in enumerate(fleet)]
    return fleet, pl.concat(seen).sort("time_s")
