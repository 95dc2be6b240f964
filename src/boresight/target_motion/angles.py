"""What was heard, as angles on the plane: true bearings, and cones about an array's axis."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError, UsageError
from boresight.formats.scatter import deviations, robust_sd
from boresight.maths.angles import wrap

if TYPE_CHECKING:
    import polars as pl

    from boresight.target_motion.own_track import OwnTrack

Array = Any
_SOUND_MPS = 1500.0
_FEWEST = 8  # deviations that an estimate of their scatter needs
_FINEST_RAD = np.radians(0.01)


def angles(
    table: "pl.DataFrame",
    ship: "OwnTrack",
    remarks: list[str],
    *,
    sigma_deg: float | None,
    declination_deg: float | None,
    array_spacing_m: float | None,
    sound_speed_mps: float | None,
) -> "pl.DataFrame":
    """Add `bearing`, `cone` and `sigma` (radians, NaN where not heard) to a table of bearings.

    Args:
        table: see `boresight.formats.bearings`; every time within own ship's log.
        ship: own ship.
        remarks: gets what a reader should know.
        sigma_deg: where the table has none; None to estimate it from the bearings' own scatter.
        declination_deg: East of North, for magnetic bearings.
        array_spacing_m: of the two elements whose time differences the table has.
        sound_speed_mps: at the array.

    Raises:
        DataError: magnetic without declination, relative without heading, time differences
            without spacing, or too few bearings to tell their scatter.
    """
    import polars as pl

    if "tdoa_s" in table.columns and not _has_bearing(table):
        table = _from_differences(table, remarks, array_spacing_m, sound_speed_mps)
    else:
        table = _from_bearings(table, ship, remarks, declination_deg)
    _tell_unused(table, remarks, sigma_deg, array_spacing_m, sound_speed_mps)
    given = np.nan if sigma_deg is None else np.radians(_positive("sigma_deg", sigma_deg))
    sigma = pl.col("sigma").fill_nan(None)
    if "sigma_deg" in table.columns:
        sigma = pl.coalesce(pl.col("sigma_deg").cast(pl.Float64).radians(), sigma)
    table = table.with_columns(sigma=sigma.fill_null(given))
    return _with_scatter(table, remarks)


def _has_bearing(table: "pl.DataFrame") -> bool:
    names = ("bearing_deg", "bearing_magnetic_deg", "bearing_relative_deg")
    return any(name in table.columns for name in names)


def _from_differences(
    table: "pl.DataFrame", remarks: list[str], spacing_m: float | None, sound_mps: float | None
) -> "pl.DataFrame":
    """Cones: cos = c tdoa / spacing, and the error that one of tdoa makes.

    Near endfire the angle's slope is infinite: its error is that of the cosine under a root.
    """
    import polars as pl

    spacing = _each(table, "array_spacing_m", spacing_m)
    sound = np.nan_to_num(_each(table, "sound_speed_mps", sound_mps), nan=_SOUND_MPS)
    if not np.all(np.isfinite(spacing) & (spacing > 0)):
        raise DataError(
            "time differences need the array's spacing",
            why="angle = arccos(sound speed times tdoa over spacing)",
            next_step="give --spacing, in metres",
        )
    cosine = sound * table["tdoa_s"].to_numpy() / spacing
    noise = sound * _each(table, "sigma_tdoa_s", None) / spacing
    room = 3 * np.where(np.isfinite(noise), noise, 0.02)
    possible = np.abs(cosine) <= 1 + room
    over = int((possible & (np.abs(cosine) > 1)).sum())
    if over:
        remarks.append(f"{over} time differences are a little above the array's: taken as endfire.")
    if not possible.all():
        remarks.append(
            f"{int((~possible).sum())} time differences are longer than sound takes from end to "
            "end of the array: left out."
        )
    cosine = np.clip(cosine, -1.0, 1.0)
    sigma = noise / np.sqrt(1 - cosine**2 + noise)
    table = table.with_columns(
        bearing=pl.lit(np.nan), cone=pl.Series(np.arccos(cosine)), sigma=pl.Series(sigma)
    ).filter(pl.Series(possible))
    if table.is_empty():
        raise DataError(
            "every time difference is longer than sound takes from end to end of the array",
            why=f"spacing {spacing[0]:g} m, sound {sound[0]:g} m/s",
            next_step="correct --spacing, or the unit of tdoa_s",
        )
    return table


def _from_bearings(
    table: "pl.DataFrame", ship: "OwnTrack", remarks: list[str], declination_deg: float | None
) -> "pl.DataFrame":
    import polars as pl

    time_s = table["time_s"].to_numpy()
    conical = (
        table["conical"].to_numpy() if "conical" in table.columns else np.zeros(len(time_s), bool)
    )
    name = next(n for n in table.columns if n.startswith("bearing_"))
    for each in ("bearing_relative_deg", "bearing_magnetic_deg", "bearing_deg"):
        name = each if each in table.columns else name
    values = np.radians(table[name].to_numpy())
    turn = ship.north(time_s)
    magnetic = _magnetic(table, name) & ~conical
    if magnetic.any():
        turn = turn + np.where(magnetic, np.radians(_declination(declination_deg, table, name)), 0)
    elif declination_deg:
        remarks.append("Declination was given, but the bearings are not magnetic: not used.")
    if name == "bearing_relative_deg":
        turn = _heading(ship, time_s)
    return table.with_columns(
        bearing=pl.Series(np.where(conical, np.nan, wrap(values + turn))),
        cone=pl.Series(np.where(conical, values, np.nan)),
        sigma=pl.lit(np.nan),
    )


def _tell_unused(
    table: "pl.DataFrame",
    remarks: list[str],
    sigma_deg: float | None,
    spacing_m: float | None,
    sound_mps: float | None,
) -> None:
    """Say what was given in vain."""
    if sigma_deg is not None and "sigma_deg" in table.columns:
        told = table["sigma_deg"].is_not_null()
        if told.all():
            remarks.append("A standard deviation was given, but every row has its own: not used.")
    if _has_bearing(table):
        for name, value in (("array's spacing", spacing_m), ("speed of sound", sound_mps)):
            if value is not None:
                remarks.append(f"The {name} was given, but there are bearings: not used.")


def _magnetic(table: "pl.DataFrame", name: str) -> Array:
    if name == "bearing_magnetic_deg":
        return np.ones(table.height, bool)
    if name == "bearing_deg" and "magnetic" in table.columns:
        return table["magnetic"].to_numpy()
    return np.zeros(table.height, bool)


def _declination(declination_deg: float | None, table: "pl.DataFrame", name: str) -> float:
    if declination_deg is None:
        raise DataError(
            "the bearings are magnetic, and the declination is not known",
            where=f"column {name if 'magnetic' in name else 'magnetic'}, line {table['line'][0]}",
            why="a bearing from own ship's place is needed from true North",
            next_step="give --declination in degrees, positive where the needle points East",
        )
    if not abs(declination_deg) <= 180:
        raise UsageError(f"declination_deg={declination_deg!r} is not within 180 degrees")
    return declination_deg


def _heading(ship: "OwnTrack", time_s: Array) -> Array:
    if "heading" not in ship.angles:
        raise DataError(
            "the bearings are relative to own ship's heading, which its log does not have",
            where="column bearing_relative_deg",
            why="course is not heading: a current or wind parts them",
            next_step="give heading_deg in own ship's log",
        )
    return ship.direction("heading", time_s)


def _each(table: "pl.DataFrame", name: str, given: float | None) -> Array:
    """(n,) what was given, else the table's column, else NaN."""
    if given is not None:
        return np.full(table.height, _positive(name, given))
    if name in table.columns:
        return table[name].cast(float).fill_null(np.nan).to_numpy()
    return np.full(table.height, np.nan)


def _positive(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0):
        raise UsageError(f"{name}={value!r} is not a positive number")
    return float(value)


def _with_scatter(table: "pl.DataFrame", remarks: list[str]) -> "pl.DataFrame":
    """Hold what is stated of the errors against the bearings' own scatter; or take that."""
    import polars as pl

    left = _deviations(table)
    enough = len(left) >= _FEWEST
    scatter = robust_sd(left) if enough else np.nan
    missing = int(table["sigma"].is_nan().sum())
    if missing:
        if not enough:
            raise DataError(
                "how good the bearings are is not known",
                why="there is no sigma_deg, and too few bearings to see how they scatter",
                next_step="give --sigma in degrees",
            )
        taken = max(scatter, _FINEST_RAD)
        remarks.append(
            f"The standard deviation of {missing} bearings is taken from their own scatter: "
            f"{np.degrees(taken):.3g} degrees."
        )
        return table.with_columns(sigma=pl.col("sigma").fill_nan(taken))
    told = float(np.median(table["sigma"].to_numpy()))
    if enough and not 1 / 3 <= scatter / told <= 3:
        remarks.append(_disagree(scatter, told))
    return table


def _disagree(scatter: float, told: float) -> str:
    said = f"Bearings scatter by {np.degrees(scatter):.2g} degrees, and are said to be good to "
    rest = (
        "answers will be surer than they should be."
        if scatter > told
        else "they were smoothed, or the statement is too modest."
    )
    return f"{said}{np.degrees(told):.2g}: {rest}"


def _deviations(table: "pl.DataFrame") -> Array:
    """What is left of all contacts' angles when smooth courses are taken out."""
    one = table.unique(["track", "time_s"], keep="first", maintain_order=True)
    parts = [np.empty(0)]
    for contact in one.partition_by("track"):
        for name in ("bearing", "cone"):
            heard = contact.filter(contact[name].is_not_nan())
            if heard.height >= 4:
                values = np.unwrap(heard[name].to_numpy())
                parts.append(deviations(heard["time_s"].to_numpy(), values))
    return np.concatenate(parts)
