"""How far a systematic error moves a plot: what makes metres, degrees and seconds comparable."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from boresight.interfaces.report.words import figure
from boresight.models.systematic import effects

if TYPE_CHECKING:
    import polars as pl

    from boresight.calibration.result import NoiseFound

SLICE_S, SHORTEST_S = 30.0, 10.0  # speeds are taken over as long: plots' noise is small beside it


class Typical(NamedTuple):
    """A target as these pairs have them: its median range and speed."""

    range_m: float
    speed_mps: float

    def words(self, *terms: str) -> str:
        """Say where it is and, if one of the terms asks for it, how fast."""
        speed = f" and {figure(self.speed_mps, 2)} m/s" if "time_bias_s" in terms else ""
        return f"{figure(self.range_m / 1000, 2)} km{speed}"

    def metres(self, term: str) -> float:
        """How far one unit of a term moves its plot, where it moves it most, m."""
        zero, ahead = 0.0, self.speed_mps
        places = ((self.range_m, zero, zero), (zero, self.range_m, zero))
        return max(self._moved(term, np.array(p), np.array((ahead, zero, zero))) for p in places)

    def _moved(self, term: str, place: np.ndarray, velocity: np.ndarray) -> float:
        found = effects(term, place, velocity)
        angles = (found.get(name, 0.0) for name in ("azimuth_rad", "elevation_rad"))
        return float(np.hypot(found.get("range_m", 0.0), self.range_m * np.hypot(*angles)))

    def noise_m(self, noise: "NoiseFound") -> float:
        """How far the noise of one plot moves it, across and along, m; NaN where not known."""
        across = self.range_m * np.deg2rad(noise.azimuth_deg)
        known = [each for each in (noise.range_m, across) if np.isfinite(each)]
        return float(np.sqrt(np.mean(np.square(known)))) if known else np.nan


def typical(residuals: "pl.DataFrame") -> Typical:
    """Return the median range of the pairs, and their targets' median speed over half a minute."""
    import polars as pl

    if residuals.is_empty():
        return Typical(np.nan, 0.0)
    angle = pl.col("azimuth_deg").radians()
    x, y = pl.col("range_m") * angle.sin(), pl.col("range_m") * angle.cos()
    legs = (
        residuals.select("target", "time_s", x=x, y=y)
        .sort("time_s")
        .group_by("target", (pl.col("time_s") / SLICE_S).floor().alias("slice"))
        .agg(pl.col("time_s", "x", "y").last() - pl.col("time_s", "x", "y").first())
        .filter(pl.col("time_s") >= SHORTEST_S)
    )
    speed = np.hypot(legs["x"].to_numpy(), legs["y"].to_numpy()) / legs["time_s"].to_numpy()
    return Typical(
        float(np.nanmedian(residuals["range_m"].to_numpy())),
        float(np.median(speed)) if len(speed) else 0.0,
    )
