"""Which plots are measurements at all: what a report says of itself, before anything is compared.

Plots that cannot be used are counted with the reason, never dropped in silence.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import UsageError

if TYPE_CHECKING:
    import polars as pl

Array = Any

MEANINGS = {
    "coasted": "the radar's own prediction, not a measurement (report type none)",
    "no position": "range or azimuth is missing",
    "test": "a test target or a simulated one",
    "no identity": "neither a 24-bit address nor a Mode A code",
    "garbled code": "the Mode A code is marked garbled or not validated, and there is no address",
}
ANONYMOUS = ("no identity", "garbled code")  # measurements all the same


def column(plots: "pl.DataFrame", name: str, default: Any) -> Array:
    """A column as an array, nulls and absence filled with `default`."""
    if name not in plots.columns:
        return np.full(plots.height, default)
    return plots[name].fill_null(default).to_numpy()


def unusable(plots: "pl.DataFrame") -> Array:
    """(n,) first reason why each plot cannot be followed by identity, empty if there is none.

    Those of `ANONYMOUS` are measurements, of a target that does not say who it is.
    """
    address, code = column(plots, "address", ""), column(plots, "mode_a", "")
    finite = np.isfinite(column(plots, "range_m", np.nan).astype(float)) & np.isfinite(
        column(plots, "azimuth_deg", np.nan).astype(float)
    )
    tests = column(plots, "test", False) | column(plots, "simulated", False)
    garbled = (address == "") & ~column(plots, "mode_a_valid", True).astype(bool)
    reasons = [
        ("coasted", column(plots, "report_type", "") == "none"),
        ("no position", ~finite),
        ("test", tests.astype(bool)),
        ("no identity", (address == "") & (code == "")),
        ("garbled code", garbled),
    ]
    return np.select([holds for _, holds in reasons], [name for name, _ in reasons], default="")


def one_sensor(plots: "pl.DataFrame", sensor: str | None, remarks: list[str]) -> "pl.DataFrame":
    """The plots of one sensor: the named one, else the busiest, which is then remarked.

    Raises:
        UsageError: the sensor is not in the table.
    """
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
            f"{names[0]}, the busiest, was taken. Choose with --sensor."
        )
    return plots.filter(pl.col("sensor") == (sensor or names[0])) if names else plots
