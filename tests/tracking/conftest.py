"""Plots of our own making: aircraft over an invented radar, with known noise."""

from dataclasses import dataclass

import numpy as np
import polars as pl
import pytest

from boresight.maths.frames import Site, enu_from_geodetic, geodetic_from_enu, polar_from_enu

SITE = Site(latitude_deg=47.0, longitude_deg=8.0, height_m=500.0)
SCAN_S = 4.0


@dataclass(frozen=True)
class Sky:
    """Makes plots of aircraft that fly straight and level, seen with white noise."""

    range_m: float = 20.0
    azimuth_deg: float = 0.05
    seed: int = 11

    def aircraft(self, number, *, plots=100, start_s=0.0, speed=200.0, code=None, address=True):
        """One aircraft on its own heading, 40 to 80 km out, about 9,000 m high."""
        generator = np.random.default_rng([self.seed, number])
        time = start_s + SCAN_S * np.arange(plots) + generator.uniform(0, SCAN_S)
        heading = generator.uniform(0, 2 * np.pi)
        direction = np.array([np.sin(heading), np.cos(heading), 0.0])
        away = generator.uniform(0, 2 * np.pi)
        origin = generator.uniform(4e4, 6e4) * np.array([np.sin(away), np.cos(away), 0.0])
        enu = origin + direction * speed * (time - start_s)[:, None]
        place = geodetic_from_enu(enu, SITE)
        height = 9_000.0 + 100.0 * number
        there = enu_from_geodetic(place.latitude_deg, place.longitude_deg, height, SITE)
        polar = polar_from_enu(there)
        noise = generator.standard_normal((plots, 2))
        azimuth = np.degrees(polar.azimuth) + noise[:, 0] * self.azimuth_deg
        return pl.DataFrame(
            {
                "time_s": time,
                "sensor": "1/2",
                "range_m": polar.range_m + noise[:, 1] * self.range_m,
                "azimuth_deg": np.mod(azimuth, 360.0),
                "pressure_altitude_m": np.round(height / 7.62) * 7.62 + np.zeros(plots),
                "altitude_valid": True,
                "address": pl.Series(
                    [f"F000{number:02X}" if address else None] * plots, dtype=pl.String
                ),
                "mode_a": pl.Series([code] * plots, dtype=pl.String),
                "mode_a_valid": True,
                "report_type": "mode-s" if address else "ssr",
                "roll_deg": 0.0,
                "east_m": there[:, 0],
                "north_m": there[:, 1],
                "truth_speed": speed,
            }
        )


@pytest.fixture
def sky():
    return Sky()


@pytest.fixture
def site():
    return SITE
