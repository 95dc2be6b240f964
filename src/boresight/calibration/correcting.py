"""Plots with what a calibration found taken out, as a table like the one that came in."""

from typing import TYPE_CHECKING

import numpy as np

from boresight.calibration.result import Calibration
from boresight.formats.usable import column

if TYPE_CHECKING:
    import polars as pl


def correct(plots: "pl.DataFrame", calibration: Calibration) -> "pl.DataFrame":
    """Plots without the systematic errors of range, azimuth, elevation and time.

    The air's delay stays in the ranges, as it was, and a site offset is not a plot's to correct:
    add it to the site. The tracker takes a calibration itself (`track(..., calibration=...)`), and
    its uncertainty too.

    Args:
        plots: of the calibrated radar, as `read` gives them; plots of other sensors stay as they
            are.
        calibration: of that radar.

    Returns:
        The same rows and columns, sorted as they were.
    """
    import polars as pl

    errors = calibration.errors
    mine = np.ones(plots.height, dtype=bool)
    if calibration.sensor and "sensor" in plots.columns:
        mine = column(plots, "sensor", "") == calibration.sensor
    angles = [name for name in ("azimuth_deg", "elevation_deg") if name in plots.columns]
    z = {"range_m": column(plots, "range_m", np.nan).astype(float)}
    z |= {
        f"{name[:-4]}_rad": np.radians(column(plots, name, np.nan).astype(float)) for name in angles
    }
    clean = errors.corrected(z)
    found = {"time_s": column(plots, "time_s", np.nan) - errors.value("time_bias_s")}
    found["range_m"] = clean["range_m"]
    found |= {name: np.degrees(clean[f"{name[:-4]}_rad"]) for name in angles}
    return plots.with_columns(
        pl.when(pl.Series(mine)).then(pl.Series(values)).otherwise(pl.col(name)).alias(name)
        for name, values in found.items()
    )
