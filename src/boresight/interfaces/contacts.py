"""The verb `tma`: bearings and own ship's track, whatever these are, make one analysis."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.errors import UsageError
from boresight.tma.result import Criteria, TmaResult

if TYPE_CHECKING:
    import polars as pl

    from boresight.filters.method import Filter

Table = "pl.DataFrame | str | PathLike[str]"
FILTER = "rp-ekf"


def tma(
    bearings: "pl.DataFrame | str | PathLike[str]",
    own_ship: "pl.DataFrame | str | PathLike[str]",
    *,
    filter: str = FILTER,  # noqa: A002 - the field's word
    criteria: Criteria | None = None,
    cells: int | None = None,
    nearest_m: float | None = None,
    farthest_m: float | None = None,
    prune: float | None = None,
    speed_mps: float | None = None,
    track: str | None = None,
    sigma_deg: float | None = None,
    degrees: bool = False,
    declination_deg: float | None = None,
    own_ship_clock_s: float = 0.0,
    tow_m: float = 0.0,
    array_spacing_m: float | None = None,
    sound_speed_mps: float = 1500.0,
    columns: Mapping[str, str] | None = None,
    own_ship_columns: Mapping[str, str] | None = None,
) -> TmaResult:
    """From bearings and own ship's track to range, course and speed, and how sure that is.

    Args:
        bearings: a file (CSV, Parquet) or frame with time_s, bearing_deg (true) and, if it has
            them, sigma_deg, conical (the bearing is the angle off the array's axis), track.
        own_ship: a file or frame with time_s and latitude_deg, longitude_deg or north_m, east_m;
            and, if it has them, course_deg, speed_mps, heading_deg.
        filter: of the catalogue: a bank (rp-ekf, rp-mgekf, rp-ukf, rp-ckf, rp-modified-polar), or
            a single filter (ekf, mgekf, modified-polar, ukf, ...).
        criteria: when the answer is good enough.
        cells: how many range cells.
        nearest_m: smallest range that is believed possible, m.
        farthest_m: greatest range that is believed possible, m.
        prune: share of the weight below which a cell goes.
        speed_mps: what is believed of the contact's velocity: standard deviation of each component.
        track: one contact of a file with several; left out, all of them.
        sigma_deg: standard deviation of a bearing, where the file does not tell; left out, it is
            estimated from the bearings' scatter.
        degrees: affirms that bearings which look like radians are degrees.
        declination_deg: makes magnetic bearings true, east positive.
        own_ship_clock_s: added to own ship's times.
        tow_m: how far astern of own ship the array is towed, along its path.
        array_spacing_m: between the two hydrophones of a table of time differences.
        sound_speed_mps: for the same.
        columns: of the bearings: our names to the file's.
        own_ship_columns: the same of own ship's.

    Returns:
        The answers, the contact with most bearings first; `report` makes a page of them.

    Raises:
        UsageError: a filter or setting that does not exist.
        DataError: what is wrong with a file, where, and what to do.
    """
    from boresight.tma.analyse import Belief, analyse
    from boresight.tma.contacts import contacts

    chosen = chosen_filter(
        filter, cells=cells, nearest_m=nearest_m, farthest_m=farthest_m, prune=prune
    )
    believed = {"nearest_m": nearest_m, "farthest_m": farthest_m, "speed_mps": speed_mps}
    belief = Belief(**{name: value for name, value in believed.items() if value is not None})
    heard, heard_remarks = _bearings(bearings, columns)
    sailed, own_remarks = _own_ship(own_ship, own_ship_columns)
    found, remarks = contacts(
        heard,
        sailed,
        name=_name(bearings),
        sigma_deg=sigma_deg,
        degrees=degrees,
        declination_deg=declination_deg,
        own_ship_clock_s=own_ship_clock_s,
        tow_m=tow_m,
        array_spacing_m=array_spacing_m,
        sound_speed_mps=sound_speed_mps,
        track=track,
    )
    limits = criteria or Criteria()
    answers = tuple(analyse(each, chosen, belief=belief, criteria=limits) for each in found)
    return TmaResult(contacts=answers, remarks=(*heard_remarks, *own_remarks, *remarks))


def chosen_filter(name: str, **settings: Any) -> "Filter":
    """A filter of the catalogue with the settings that were given; UsageError for one of no use."""
    from boresight import catalogue

    given = {key: value for key, value in settings.items() if value is not None}
    chosen = catalogue.lookup(name)
    if not name.startswith("rp-"):
        for key in ("cells", "prune"):
            if key in given:
                raise UsageError(
                    f"{name} has no setting {key}",
                    why="it is a single filter",
                    next_step=f"use rp-{name}, or leave it out",
                )
        return chosen
    return chosen.with_settings(**given)


def _bearings(
    given: "pl.DataFrame | str | PathLike[str]", columns: Mapping[str, str] | None
) -> "tuple[pl.DataFrame, tuple[str, ...]]":
    from boresight.formats.bearings import read_bearings

    if isinstance(given, str | PathLike):
        return read_bearings(Path(given), columns=columns)
    return _frame(given, "bearings"), ()


def _own_ship(
    given: "pl.DataFrame | str | PathLike[str]", columns: Mapping[str, str] | None
) -> "tuple[pl.DataFrame, tuple[str, ...]]":
    from boresight.formats.own_ship import read_own_ship

    if isinstance(given, str | PathLike):
        return read_own_ship(Path(given), columns=columns)
    return _frame(given, "own ship's track"), ()


def _frame(given: Any, what: str) -> "pl.DataFrame":
    import polars as pl

    if not isinstance(given, pl.DataFrame):
        raise UsageError(
            f"{what}: a {type(given).__name__}", next_step="give a path, or a Polars frame"
        )
    return given


def _name(given: Any) -> str:
    return Path(given).stem if isinstance(given, str | PathLike) else "contact"
