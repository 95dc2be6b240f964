"""The verb `tma`: bearings and own ship's track, whatever these are, make one analysis."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from boresight.errors import UsageError, unknown
from boresight.target_motion.result import Criteria, TmaResult

if TYPE_CHECKING:
    import polars as pl

    from boresight.filters.method import Filter

FILTER = "rp-ekf"
OF_THE_BANK = ("cells", "overlap", "nearest_m", "farthest_m", "prune")
# More cells than the paper's six, wide enough to leave no gaps between them: regions of the range
# then hold what they say before own ship turns.
SMOOTH = {"cells": 12, "overlap": 1.5}
OF_THE_BELIEF = ("nearest_m", "farthest_m", "speed_mps", "accel_mps2", "position_sd_m")


class Asked(TypedDict, total=False):
    """What may be said beside the tables.

    Attributes:
        criteria: when the answer is good enough.
        cells: how many range cells a bank has, 12 unless told.
        overlap: how wide a cell begins, over the spread of a uniform range in it, 1.5 unless told;
            6 cells with 1.0 are the paper's.
        nearest_m, farthest_m: between which ranges the contact is believed to be, m.
        prune: share of the weight below which a cell goes.
        speed_mps: what is believed of its velocity: standard deviation of each component.
        track: one contact of a file with several; left out, all of them.
        sigma_deg: standard deviation of a bearing, where the file does not tell; left out, it is
            estimated from the scatter.
        degrees: affirms that bearings which look like radians are degrees.
        declination_deg: makes magnetic bearings true, east positive.
        own_ship_clock_s: added to own ship's times.
        tow_m: how far astern of own ship the array is towed, along its path.
        array_spacing_m: between the hydrophones of a table of time differences (tdoa_s).
        sound_speed_mps: for the same; left out, what the file says, or 1500.
        accel_mps2: how unsteadily the contact may move: standard deviation of its acceleration; 0
            for a steady course and speed.
        position_sd_m: how well own ship's track is known: what wanders by that is no manoeuvre.
        columns, own_ship_columns: our names to the file's.
    """

    criteria: Criteria | None
    cells: int | None
    overlap: float | None
    nearest_m: float | None
    farthest_m: float | None
    prune: float | None
    speed_mps: float | None
    accel_mps2: float | None
    position_sd_m: float | None
    track: str | None
    sigma_deg: float | None
    degrees: bool
    declination_deg: float | None
    own_ship_clock_s: float
    tow_m: float
    array_spacing_m: float | None
    sound_speed_mps: float | None
    columns: Mapping[str, str] | None
    own_ship_columns: Mapping[str, str] | None


def tma(
    bearings: "pl.DataFrame | str | PathLike[str]",
    own_ship: "pl.DataFrame | str | PathLike[str]",
    *,
    filter: str = FILTER,  # noqa: A002 - the field's word
    **asked: Unpack[Asked],
) -> TmaResult:
    """From bearings and own ship's track to range, course and speed, and how sure that is.

    Args:
        bearings: a file (CSV, Parquet) or frame with time_s, bearing_deg (true) and, if it has
            them, sigma_deg, conical (the bearing is the angle off the array's axis), track.
        own_ship: a file or frame with time_s and latitude_deg, longitude_deg or north_m, east_m;
            and, if it has them, course_deg, speed_mps, heading_deg.
        filter: of the catalogue: a bank (rp-ekf, rp-mgekf, rp-ukf, rp-ckf, rp-modified-polar), or
            a single filter (ekf, mgekf, modified-polar, ukf, ...).
        asked: see `Asked`: criteria, cells, overlap, nearest_m, farthest_m, prune, speed_mps,
            accel_mps2, position_sd_m, track, sigma_deg, degrees, declination_deg,
            own_ship_clock_s, tow_m, array_spacing_m, sound_speed_mps, columns, own_ship_columns.

    Returns:
        The answers, the contact with most bearings first; `report` makes a page of them.

    Raises:
        UsageError: a filter or setting that does not exist.
        DataError: what is wrong with a file, where, and what to do.
    """
    from boresight.target_motion.analyse import Belief, analyse
    from boresight.target_motion.contacts import contacts

    given: dict[str, Any] = {key: value for key, value in asked.items() if value is not None}
    for name in given:
        if name not in Asked.__annotations__:
            raise unknown("setting", name, Asked.__annotations__)
    chosen = chosen_filter(filter, **_some(given, OF_THE_BANK))
    belief = Belief(**_some(given, OF_THE_BELIEF))
    criteria = given.pop("criteria", Criteria())
    affirmed = given.get("degrees", False)
    heard, heard_remarks = _bearings(bearings, given.pop("columns", None), degrees=affirmed)
    sailed, own_remarks = _own_ship(own_ship, given.pop("own_ship_columns", None))
    rest = {key: each for key, each in given.items() if key not in OF_THE_BANK + OF_THE_BELIEF}
    found, remarks = contacts(heard, sailed, name=_name(bearings), **rest)
    answers = tuple(analyse(each, chosen, belief=belief, criteria=criteria) for each in found)
    return TmaResult(contacts=answers, remarks=(*heard_remarks, *own_remarks, *remarks))


def _some(given: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {name: given[name] for name in names if name in given}


def chosen_filter(name: str, **settings: Any) -> "Filter":
    """A filter of the catalogue with the settings that were given; UsageError for one of no use."""
    from boresight import catalogue
    from boresight.target_motion.analyse import BANKS

    chosen = catalogue.lookup(name)
    if not name.startswith("rp-"):
        for key in ("cells", "overlap", "prune"):
            if key in settings:
                raise UsageError(
                    f"{name} has no setting {key}",
                    why="it is a single filter",
                    next_step=f"use {f'rp-{name}' if f'rp-{name}' in BANKS else FILTER}, or leave "
                    "it out",
                )
        return chosen
    return chosen.with_settings(**(SMOOTH | settings))


def _bearings(
    given: "pl.DataFrame | str | PathLike[str]",
    columns: Mapping[str, str] | None,
    *,
    degrees: bool,
) -> "tuple[pl.DataFrame, tuple[str, ...]]":
    from boresight.formats.bearings import read_bearings

    if isinstance(given, str | PathLike):
        return read_bearings(Path(given), columns=columns, degrees=degrees)
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
