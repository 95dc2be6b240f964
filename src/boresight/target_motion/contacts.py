"""Tables of bearings and own ship into contacts: every doubt settled, refused or told.

What is settled, and how: bearings outside own ship's log are left out; so are those in a gap of
it, longer than five usual steps, in which own ship may have strayed by more than 10 m from a
straight line (by its velocities before and after). Bearings of one contact at one time are
averaged if their errors explain the difference, and refused if not: those are two contacts.
Magnetic bearings need a declination, relative ones a heading; what looks like radians in a column
of degrees is refused.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.errors import DataError, UsageError, unknown
from boresight.formats.bearings import bearings_table
from boresight.formats.own_ship import own_ship_table
from boresight.maths.angles import wrap
from boresight.target_motion.angles import angles
from boresight.target_motion.clocks import inside, one_clock
from boresight.target_motion.contact import Contact
from boresight.target_motion.own_track import OwnTrack, need_axis, own_track

if TYPE_CHECKING:
    import polars as pl

Array = Any
_FEWEST = 3  # bearings of a contact
_TWO_CONTACTS = 5.0  # standard deviations between two bearings at one time


def contacts(
    bearings: "pl.DataFrame",
    own_ship: "pl.DataFrame",
    *,
    name: str = "contact",
    sigma_deg: float | None = None,
    declination_deg: float | None = None,
    own_ship_clock_s: float = 0.0,
    tow_m: float = 0.0,
    array_spacing_m: float | None = None,
    sound_speed_mps: float | None = None,
    track: str | None = None,
    degrees: bool = False,
) -> tuple[list[Contact], tuple[str, ...]]:
    """Make contacts of a table of bearings and one of own ship.

    Args:
        bearings: from `read_bearings`, or any frame with its columns.
        own_ship: from `read_own_ship`, or any frame with its columns.
        name: of the contact, where the table does not name several.
        sigma_deg: standard deviation of bearings whose row has none; None to take their scatter.
        declination_deg: East of North, for magnetic bearings.
        own_ship_clock_s: added to own ship's times.
        tow_m: the array is towed this far astern, along own ship's path.
        array_spacing_m: between the elements whose time differences the table has.
        sound_speed_mps: at the array; None for the table's, else 1500.
        track: take this contact only.
        degrees: bearings are in degrees even where they look like radians.

    Returns:
        Contacts, the one with the most bearings first, and what a reader should know.

    Raises:
        DataError: the tables contradict themselves or each other, or leave open what they mean.
        UsageError: an argument out of bounds, or a track that is not there.
    """
    import polars as pl

    _check_numbers(own_ship_clock_s=own_ship_clock_s, tow_m=tow_m)
    heard, more = bearings_table(bearings, degrees=degrees)
    own, again = own_ship_table(own_ship)
    remarks = [*more, *again]
    heard, own = one_clock(_of_track(heard, name, track), own, remarks)
    ship = own_track(own, own_ship_clock_s, remarks)
    heard = heard.filter(pl.Series(inside(heard["time_s"].to_numpy(), ship.time_s, remarks)))
    heard = _outside_gaps(heard, ship, remarks)
    heard = angles(
        heard,
        ship,
        remarks,
        sigma_deg=sigma_deg,
        declination_deg=declination_deg,
        array_spacing_m=array_spacing_m,
        sound_speed_mps=sound_speed_mps,
    )
    groups = _enough(heard.partition_by("track", maintain_order=True), remarks)
    found = [_contact(_once(group, remarks), ship, tow_m) for group in groups]
    found.sort(key=lambda contact: -len(contact.time_s))
    _check_sense(found, remarks)
    return found, tuple(remarks)


def _check_numbers(**given: float) -> None:
    for name, value in given.items():
        if not np.isfinite(value) or (name == "tow_m" and value < 0):
            raise UsageError(f"{name}={value!r} is not a number that can be")


def _of_track(table: "pl.DataFrame", name: str, track: str | None) -> "pl.DataFrame":
    import polars as pl

    if "track" not in table.columns:
        table = table.with_columns(track=pl.lit(name))
    if track is None:
        return table
    names = table["track"].unique(maintain_order=True).to_list()
    if track not in names:
        raise unknown("contact", track, names)
    return table.filter(pl.col("track") == track)


def _outside_gaps(table: "pl.DataFrame", ship: OwnTrack, remarks: list[str]) -> "pl.DataFrame":
    import polars as pl

    unsure = ship.unsure(table["time_s"].to_numpy())
    if not unsure.any():
        return table
    remarks.append(
        f"{int(unsure.sum())} bearings fall into gaps of own ship's log in which it may have "
        "turned, and are left out."
    )
    if unsure.all():
        raise DataError(
            "every bearing falls into a gap of own ship's log",
            why="where own ship was then is not known",
            next_step="take own ship's log at a shorter step",
        )
    return table.filter(pl.Series(~unsure))


def _enough(groups: list["pl.DataFrame"], remarks: list[str]) -> list["pl.DataFrame"]:
    """Contacts of three bearings at least; says which were left out."""
    kept = [group for group in groups if group["time_s"].n_unique() >= _FEWEST]
    few = [group["track"][0] for group in groups if group["time_s"].n_unique() < _FEWEST]
    if not kept:
        raise DataError(
            f"no contact has {_FEWEST} bearings within own ship's log",
            where=f"{sum(group.height for group in groups)} bearings",
            why="a bearing alone tells a direction, two no motion",
            next_step="give bearings over a longer time",
        )
    if few:
        told = ", ".join(few[:5]) + (" and others" if len(few) > 5 else "")
        remarks.append(f"{len(few)} contacts have fewer than {_FEWEST} bearings: {told} left out.")
    return kept


def _once(table: "pl.DataFrame", remarks: list[str]) -> "pl.DataFrame":
    """Each time once: bearings that their errors part are averaged, others refused."""
    import polars as pl

    if table["time_s"].n_unique() == table.height:
        return table
    is_true = pl.col("bearing").is_not_nan()
    kept = table.filter(is_true | ~is_true.any().over("time_s"))
    time_s, sigma = kept["time_s"].to_numpy(), kept["sigma"].to_numpy()
    starts = np.flatnonzero(np.diff(time_s, prepend=-np.inf))
    counts = np.diff(starts, append=len(time_s))
    angle = kept.select(pl.when(is_true).then("bearing").otherwise("cone")).to_series().to_numpy()
    off = wrap(angle - np.repeat(angle[starts], counts))
    worst = np.maximum.reduceat(np.abs(off), starts)
    room = _TWO_CONTACTS * np.sqrt(2) * np.maximum.reduceat(sigma, starts)
    if (worst > room).any():
        which = int(np.argmax(worst > room))
        raise _two(kept[starts[which] : starts[which] + counts[which]], np.degrees(worst[which]))
    mean = pl.Series(np.add.reduceat(off, starts) / counts)
    told = np.where(worst > 0, counts, 1)  # the same row again tells nothing new
    error = pl.Series(np.add.reduceat(sigma, starts) / counts / np.sqrt(told))
    _tell(
        table,
        int((counts - told).sum()),
        int((told - 1).sum()),
        table.height - kept.height,
        remarks,
    )
    moved = (pl.col(name) + mean for name in ("bearing", "cone"))
    return kept[starts].with_columns(*moved, sigma=error)


def _tell(table: "pl.DataFrame", same: int, near: int, cones: int, remarks: list[str]) -> None:
    name = table["track"][0]
    if same:
        remarks.append(f"{same} bearings of {name} stand twice: taken once.")
    if near:
        remarks.append(
            f"{near} bearings of {name} are at the time of another, within their errors: averaged."
        )
    if cones:
        remarks.append(f"{cones} cones of {name} are at the time of a true bearing: left out.")


def _two(rows: "pl.DataFrame", apart_deg: float) -> DataError:
    lines = ", ".join(map(str, rows["line"].to_list()[:4]))
    return DataError(
        f"two bearings of {rows['track'][0]} at one time are {apart_deg:.2f} degrees apart",
        where=f"lines {lines}, time_s {rows['time_s'][0]:g}",
        why=f"their errors ({np.degrees(rows['sigma'][0]):.2g} degrees) do not explain it: they "
        "may be of two contacts",
        next_step="tell the contacts apart in a column `track`, or keep one of the lines",
    )


def _contact(table: "pl.DataFrame", ship: OwnTrack, tow_m: float) -> Contact:
    time_s = table["time_s"].to_numpy()
    place = ship.at(time_s, tow_m)
    cone = table["cone"].to_numpy()
    if np.isfinite(cone).any():
        need_axis(place)
    return Contact(
        name=table["track"][0],
        time_s=time_s,
        bearing_rad=table["bearing"].to_numpy(),
        cone_rad=cone,
        sigma_rad=table["sigma"].to_numpy(),
        position_m=place.position_m,
        velocity_mps=place.velocity_mps,
        axis_rad=place.axis_rad,
        site=ship.site,
    )


def _check_sense(found: list[Contact], remarks: list[str]) -> None:
    """Slow contacts fall astern: where most draw ahead the array may be the wrong way round."""
    conical = [each for each in found if each.is_conical]
    if len(conical) < 5:
        return
    moves = [np.sign(np.nanmean(np.diff(each.cone_rad))) for each in conical]
    ahead = int(np.sum(np.array(moves) < 0))
    if ahead > 0.7 * len(conical):
        remarks.append(
            f"{ahead} of {len(conical)} contacts draw ahead while own ship runs on. Unless they "
            "are faster, the array's ends are exchanged: look at the sign of its angles."
        )
