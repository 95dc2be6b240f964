"""What is left of each pair when the systematic errors are taken out, and how noise grows."""

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from boresight.calibration.bins import Bins, joined, round_edges
from boresight.calibration.pairs import Pairs
from boresight.models.components import FORMULAS

if TYPE_CHECKING:
    import polars as pl

Array = Any
# At the door, by channel: name before the unit, unit, and how many of it make one inside.
DOOR = {
    "range_m": ("range", "m", 1.0),
    "azimuth_rad": ("azimuth", "deg", 180.0 / np.pi),
    "elevation_rad": ("elevation", "deg", 180.0 / np.pi),
}
_RANGES = 20
_SECTOR_DEG = 10.0
_ENOUGH = 30  # pairs of a standard deviation: its own error is then 15 %, or 20 % for a robust one
MAD_TO_SD = 1.4826


class Registered(Protocol):
    """What of a registration is needed here."""

    @property
    def after(self) -> Array:
        """(m, k) residuals without the systematic errors, m and rad; delays are still in."""
        ...

    @property
    def outlier(self) -> Array:
        """(m,) probability that a pair is no measurement of its target."""
        ...

    @property
    def delay_m(self) -> Array:
        """(targets,) what each target's transponder adds to range."""
        ...


def residual_table(pairs: Pairs, registration: Registered) -> "pl.DataFrame":
    """One row for each pair: where it was, and by how much the radar erred.

    Args:
        pairs: m pairs.
        registration: of these pairs.

    Returns:
        row (of the plot), time_s, target (its name), range_m, azimuth_deg and height_m (by the
        reference), range_before_m and range_after_m (measured minus expected, before and after the
        systematic errors are taken out), the same of azimuth and elevation in degrees where
        measured, outlier (probability), delay_m (of the target, still in what is left).
    """
    import polars as pl

    range_m, azimuth_deg = place(pairs)
    columns = {
        "row": pairs.row,
        "time_s": pairs.time_s,
        "target": pl.Series(list(pairs.names), dtype=pl.String).gather(pairs.target),
        "range_m": range_m,
        "azimuth_deg": azimuth_deg,
        "height_m": pairs.height_m,
    }
    before = pairs.residuals()
    for i, channel in enumerate(pairs.channels):
        name, unit, scale = DOOR[channel]
        columns[f"{name}_before_{unit}"] = before[:, i] * scale
        columns[f"{name}_after_{unit}"] = registration.after[:, i] * scale
    columns["outlier"] = registration.outlier
    columns["delay_m"] = registration.delay_m[pairs.target]
    return pl.DataFrame(columns)


def place(pairs: Pairs) -> tuple[Array, Array]:
    """Range (m) and azimuth (degrees, 0 to 360) at which the reference has each target."""
    p = pairs.position.T
    azimuth = np.degrees(FORMULAS["azimuth_rad"](p, p)) % 360.0
    return FORMULAS["range_m"](p, p), azimuth


def noise_tables(pairs: Pairs, registration: Registered) -> "dict[str, pl.DataFrame]":
    """Noise of single plots by range and by azimuth, delays of transponders taken out.

    Returns:
        `noise_by_range` (range_from_m, range_to_m, ...) and `noise_by_azimuth` (azimuth_from_deg,
        azimuth_to_deg, ...), each with pairs, and range_sd_m, azimuth_sd_deg, elevation_sd_deg
        where measured: robust standard deviations (median absolute deviation), outliers left out.
    """
    pairs_kept = np.flatnonzero(registration.outlier < 0.5)
    if not len(pairs_kept):
        return {}
    kept = pairs.take(pairs_kept)
    left = at_door(kept, registration.after[pairs_kept], registration.delay_m)
    range_m, azimuth = place(kept)
    sectors = np.arange(0.0, 360.0 + _SECTOR_DEG, _SECTOR_DEG)
    found = {
        "range": ("m", range_m, round_edges(range_m, _RANGES)),
        "azimuth": ("deg", azimuth, sectors),
    }
    return {
        f"noise_by_{name}": _noise(
            name, unit, joined(x, edges, kept.target, rows=_ENOUGH, targets=1), left
        )
        for name, (unit, x, edges) in found.items()
    }


def at_door(pairs: Pairs, after: Array, delay_m: Array | None = None) -> dict[str, Array]:
    """Residuals by `range_m`, `azimuth_deg`, ...; without delays where these are given."""
    out = {}
    for i, channel in enumerate(pairs.channels):
        name, unit, scale = DOOR[channel]
        out[f"{name}_{unit}"] = after[:, i] * scale
    if delay_m is not None and "range_m" in out:
        out["range_m"] = out["range_m"] - delay_m[pairs.target]
    return out


def _noise(name: str, unit: str, bins: Bins, left: dict[str, Array]) -> "pl.DataFrame":
    import polars as pl

    columns = {
        f"{name}_from_{unit}": bins.low,
        f"{name}_to_{unit}": bins.high,
        "pairs": np.bincount(bins.index[bins.index >= 0], minlength=len(bins)),
    }
    for channel, y in left.items():
        what, channel_unit = channel.rsplit("_", 1)
        columns[f"{what}_sd_{channel_unit}"] = spread(y, bins.index, len(bins))
    return pl.DataFrame(columns)


def medians(y: Array, index: Array, count: int) -> Array:
    """(count,) median of the rows of each index; NaN is left out, and stands where nothing is.

    Args:
        y: (m,) values.
        index: (m,) 0 to count - 1; -1 belongs to none.
        count: of medians.
    """
    import polars as pl

    rows = pl.DataFrame({"index": index, "y": y}).drop_nans().filter(pl.col("index") >= 0)
    found = rows.group_by("index").median()
    out = np.full(count, np.nan)
    out[found["index"].to_numpy()] = found["y"].to_numpy()
    return out


def spread(y: Array, index: Array, count: int) -> Array:
    """(count,) robust standard deviation of each index: 1.4826 median absolute deviations."""
    return MAD_TO_SD * medians(np.abs(y - medians(y, index, count)[index]), index, count)
