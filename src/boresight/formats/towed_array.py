"""A towed array of two hydrophones: tracks of time differences (MATLAB), and the ship's table.

The layout is that of the published example Localization_Towed_Array (P. Gruden, 2023): a struct
array `Tracks` with `time_local` (MATLAB's day numbers) and `tdoa` (s), and `parameters` with the
spacing `d` (m) and the speed of sound `c` (m/s); beside it a CSV with places of the ship and both
hydrophones.

What the layout does not say, and how it is known:

- The sign of `tdoa`: it is the arrival at hydrophone 1 minus that at hydrophone 2, and hydrophone 1
  is the forward one (it lies 26 m further along the ship's course, in every row). What is ahead is
  heard by 1 first, so a negative difference is ahead. The data agree: animals are slower than the
  ship, so that they must fall astern, and with this sign the angle off the bow grows, from 23 to
  162 degrees in the longest track. With the axis from hydrophone 2 to 1 the angle is right
  whichever of them is forward.
- The axes: `_x_m` is East and `_y_m` North, because the ship's own latitude and longitude say so.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError

if TYPE_CHECKING:
    import polars as pl

Array = Any
_UNIX_DAY = 719_529.0  # of MATLAB's day numbers
_PLACES = tuple(f"Sensor{i}_pos_{axis}_m" for i in (1, 2) for axis in "xy")


def tracks(path: Path) -> tuple["pl.DataFrame", tuple[str, ...]]:
    """Bearings (see `formats.bearings`) of a file of time-difference tracks, as cones.

    Returns:
        The table with `tdoa_s` positive ahead, and remarks.

    Raises:
        DataError: no MATLAB 5 file, or another layout.
    """
    import polars as pl

    content = _content(path)
    about = content["parameters"]
    parts = [_track(path, i + 1, each) for i, each in enumerate(np.atleast_1d(content["Tracks"]))]
    table = pl.concat(parts).with_row_index("line", 1)
    table = table.filter(pl.col("time_s").is_finite() & pl.col("tdoa_s").is_finite())
    if table.is_empty():
        raise _layout(path, "its tracks hold no time difference")
    table = table.with_columns(
        pl.from_epoch((pl.col("time_s") * 1e6).round().cast(pl.Int64), "us").alias("time_utc"),
        conical=pl.lit(value=True),
        array_spacing_m=pl.lit(float(about.d)),
        sound_speed_mps=pl.lit(float(about.c)),
    )
    array = f"an array of two elements {about.d:g} m apart, with sound at {about.c:g} m/s"
    remarks = [f"Time differences of {array}; negative ones in the file are ahead."]
    noise = _noise(content)
    if noise is not None:
        table = table.with_columns(sigma_tdoa_s=pl.lit(noise))
        remarks.append(
            f"A row is taken to be good to {1e6 * noise:.0f} us: so much it is worth by the noise "
            "and the chance of hearing that the tracker which wrote it was set to. Errors of "
            "neighbours are alike, which no row says."
        )
    return table.sort("time_s", maintain_order=True), tuple(remarks)


def with_array(raw: "pl.DataFrame", remarks: list[str]) -> "pl.DataFrame":
    """A table of the ship in which both hydrophones have places, with ours in its stead."""
    import polars as pl

    if not set(_PLACES) <= set(raw.columns):
        return raw
    numbers = raw.with_columns(pl.col(_PLACES).cast(pl.Float64, strict=False))
    x1, y1, x2, y2 = (pl.col(name) for name in _PLACES)
    remarks.append(
        "The receiver is taken midway between Sensor1 and Sensor2, x as East and y as North, the "
        "array's axis from Sensor2 to Sensor1."
    )
    axis = pl.arctan2(x1 - x2, y1 - y2).degrees()
    return numbers.with_columns(east_m=(x1 + x2) / 2, north_m=(y1 + y2) / 2, axis_deg=axis)


def _content(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # noqa: BLE001 - in a damaged file its reader raises anything
        raise _layout(path, str(error).partition("\n")[0]) from None
    if "Tracks" not in content or not all(
        hasattr(content.get("parameters"), name) for name in ("c", "d")
    ):
        names = ", ".join(name for name in content if not name.startswith("__"))
        raise _layout(path, f"it needs Tracks and parameters with c and d, and has {names}")
    return dict(content)


def _noise(content: dict[str, Any]) -> float | None:
    """Standard deviation of a row, s, if rows shall tell no more than was measured.

    A tracker's rows are smooth, one for every step: their own scatter says nothing of their
    errors, which are alike for seconds. Taken as independent, with the variance R of what the
    tracker was fed over the share of steps p_D at which it was fed, they tell as much as that.
    """
    model: Any = content.get("model")
    if not hasattr(model, "R"):
        return None
    return float(np.sqrt(model.R / getattr(model, "p_D", 1.0)))


def _track(path: Path, number: int, each: Any) -> "pl.DataFrame":
    import polars as pl

    if not all(hasattr(each, name) for name in ("time_local", "tdoa")):
        raise _layout(path, f"track {number} has no time_local or no tdoa")
    time, tdoa = (np.atleast_1d(v).astype(float) for v in (each.time_local, each.tdoa))
    if time.shape != tdoa.shape:
        raise _layout(path, f"track {number} has {len(time)} times and {len(tdoa)} differences")
    # a day number holds 10 us: the milliseconds are those that were meant
    seconds = np.round((time - _UNIX_DAY) * 86_400.0, 3)
    return pl.DataFrame({"track": [str(number)] * len(time), "time_s": seconds, "tdoa_s": -tdoa})


def _layout(path: Path, why: str) -> DataError:
    return DataError(
        f"{path} is no file of time-difference tracks",
        why=why,
        next_step="write the bearings as CSV, with time_s and bearing_deg or tdoa_s",
    )
