"""Why plots and reference do not agree: clocks, places and units that are wrong, by name.

Nothing is repaired here. If far more plots agree with the reference once a clock is moved or a unit
is changed, that is the fault, and the error says so.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np

from boresight.calibration.comparing import Compared, Setting, compare
from boresight.calibration.references import Reference
from boresight.calibration.same_day import overlap, span
from boresight.errors import DataError
from boresight.formats.schema import DEGREE, FOOT_M, NAUTICAL_MILE_M
from boresight.formats.usable import column
from boresight.maths import wrap

if TYPE_CHECKING:
    import polars as pl

Array = Any
_ZONE_S = 1_800.0  # clocks of some countries are half an hour off
_ZONES = 28  # steps of it that a clock's zone may be off
_TRIED = 20_000  # plots of a trial
# What biases leave: a plot further from its target than this, by identity, is not of it.
_RANGE_M, _RANGE_SHARE, _AZIMUTH_RAD = 2_000.0, 0.02, 0.3
_MOVING_MPS = 3.0  # a parked target is in its place at any hour
_FEW = {"identity": 0.5, "position": 0.1}  # share of pairs that must agree
_HOPELESS = 0.2  # share of pairs by identity that agree: chance alone makes as many
_ENOUGH, _MORE = 10, 2.0  # agreeing plots that name a fault, and how many times those without it
_RATIO = 0.1  # heights in feet are 3.28 times those in metres, within this share
_HIGH_M = 1_000.0  # above it heights and pressure altitudes differ by little of themselves
_HIGHEST_M = 20_000.0  # most traffic is below
_QUARTER = 90.0  # degrees
_FAR_M = 100_000.0  # beyond the furthest plot


def explain(
    plots: "pl.DataFrame", reference: Reference, setting: Setting, found: Compared
) -> list[str]:
    """Raise the fault that keeps plots and reference from agreeing, if there is one.

    Returns:
        A remark if many pairs disagree and nothing explains it.

    Raises:
        DataError: no plot has a partner, or most have a wrong one; it names the cause where one
            is recognised.
    """
    pairs, agree = len(found.plot), _agreeing(plots, found, setting)
    is_poor = agree < _FEW[setting.how] * pairs
    if is_poor or agree < _ENOUGH:
        _raise_recognised(plots.sort("time_s"), reference, setting)
    _check_heights(plots, found)
    if not pairs:
        raise _nothing(plots, reference, setting.how, found)
    if not is_poor or setting.how == "position":
        return []
    if agree < _HOPELESS * pairs:
        raise _far(plots, setting, found, agree)
    told = f"Only {agree} of {pairs} plots lie near the target that has their identity"
    return [f"{told}: the others have wrong references, or errors beyond any bias."]


def _raise_recognised(plots: "pl.DataFrame", reference: Reference, setting: Setting) -> None:
    """Try what may be wrong; raise what makes far more plots agree."""
    trials = [*_clocks(plots, reference, setting), *_places(plots, reference, setting)]
    scores = [_score(*trial[1:]) for trial in trials]
    best, without = int(np.argmax(scores)), _score(plots, reference, setting)
    if scores[best] >= max(_ENOUGH, _MORE * without):
        raise DataError(
            trials[best][0],
            why=f"with that put right, {scores[best]} of the plots tried agree with the reference; "
            f"as it is, {without}",
            next_step="correct the file or the setting; nothing was changed here",
        )


def _agreeing(plots: "pl.DataFrame", found: Compared, setting: Setting) -> int:
    """Number of plots that are where their target is, as far as any bias lets them be."""
    if setting.how == "position":
        return int((np.linalg.norm(found.velocity, axis=1) > _MOVING_MPS).sum())
    expected = np.linalg.norm(found.position, axis=1)
    off, turned = _off(plots, found)
    near = (np.abs(off) < _RANGE_M + _RANGE_SHARE * expected) & (np.abs(turned) < _AZIMUTH_RAD)
    return int(near.sum())


def _off(plots: "pl.DataFrame", found: Compared) -> tuple[Array, Array]:
    """(m,) range and azimuth of the plots minus those of their targets, m and rad."""
    azimuth = np.arctan2(found.position[:, 1], found.position[:, 0])
    turned = np.radians(column(plots, "azimuth_deg", np.nan)[found.plot]) - azimuth
    measured = column(plots, "range_m", np.nan)[found.plot]
    return measured - np.linalg.norm(found.position, axis=1), wrap(turned)


def _score(plots: "pl.DataFrame", reference: Reference, setting: Setting) -> int:
    """Number of plots that agree; 0 if those that do are too few of the pairs to mean anything."""
    import polars as pl

    during = pl.col("time_s").is_between(*span(reference.table))
    some = plots.filter(during).head(_TRIED)
    if not some.height:
        return 0
    found = compare(some, reference, setting)
    agree = _agreeing(some, found, setting)
    return agree if agree >= _FEW[setting.how] * len(found.plot) else 0


Trial = tuple[str, "pl.DataFrame", Reference, Setting]


def _clocks(plots: "pl.DataFrame", reference: Reference, setting: Setting) -> Iterator[Trial]:
    """The reference with its clock moved by whole and half hours."""
    import polars as pl

    for steps in (h for n in range(1, _ZONES + 1) for h in (n, -n)):
        seconds = steps * _ZONE_S
        table = reference.table.with_columns(pl.col("time_s") - seconds)
        way = "ahead of" if steps > 0 else "behind"
        said = f"the reference's clock is {abs(seconds):.0f} s {way} the plots'"
        yield said, plots, replace(reference, table=table), setting


def _places(plots: "pl.DataFrame", reference: Reference, setting: Setting) -> Iterator[Trial]:
    """Latitude and longitude exchanged, or of the other sign; other units and senses."""
    import polars as pl

    yield from _sites(plots, reference, setting)
    degrees = reference.table.with_columns(pl.col("latitude_deg", "longitude_deg") * DEGREE)
    turned = replace(reference, table=degrees.filter(pl.col("latitude_deg").abs() <= _QUARTER))
    said = "latitude and longitude of the reference are in radians, not in degrees"
    yield said, plots, turned, setting
    swapped = reference.table.rename(
        {"latitude_deg": "longitude_deg", "longitude_deg": "latitude_deg"}
    ).filter(pl.col("latitude_deg").abs() <= _QUARTER)
    known = replace(reference, table=swapped)
    yield "latitude and longitude of the reference are exchanged", plots, known, setting
    senses = [
        ("the azimuths are counted against the clock", -pl.col("azimuth_deg")),
        ("the azimuths are counted from east, against the clock", _QUARTER - pl.col("azimuth_deg")),
        ("the azimuths are counted from east, not from north", _QUARTER + pl.col("azimuth_deg")),
        ("the azimuths are counted from south, not from north", 180.0 + pl.col("azimuth_deg")),
    ]
    for said, azimuth in senses:
        yield said, plots.with_columns(azimuth_deg=azimuth % 360.0), reference, setting
    units = [
        ("range_m", FOOT_M, "the ranges are in feet, not in metres"),
        ("range_m", 1 / FOOT_M, "the ranges were taken for feet, and are metres"),
        ("range_m", NAUTICAL_MILE_M, "the ranges are in nautical miles, not in metres"),
        ("range_m", 1_000.0, "the ranges are in kilometres, not in metres"),
        ("azimuth_deg", DEGREE, "the azimuths are in radians, not in degrees"),
    ]
    for name, factor, said in units:
        yield said, plots.with_columns(pl.col(name) * factor), reference, setting


def _sites(plots: "pl.DataFrame", reference: Reference, setting: Setting) -> Iterator[Trial]:
    """The site with latitude and longitude exchanged, or one of them of the other sign."""
    site = setting.site
    north, east = site.latitude_deg, site.longitude_deg
    others = {
        "latitude and longitude of the site are exchanged": (east, north),
        "the longitude of the site has the wrong sign (east is positive)": (north, -east),
        "the latitude of the site has the wrong sign (north is positive)": (-north, east),
    }
    for said, (latitude, longitude) in others.items():
        if abs(latitude) <= _QUARTER:
            other = replace(site, latitude_deg=latitude, longitude_deg=longitude)
            yield said, plots, reference, replace(setting, site=other)


def _check_heights(plots: "pl.DataFrame", found: Compared) -> None:
    """Refuse heights of the reference that are feet for metres, or metres for feet."""
    paths, row, time = found.paths, found.row, found.time
    valid = column(plots, "altitude_valid", True).astype(bool)[found.plot]
    told = {
        "the reference's heights": paths.linear(paths.height, row, time),
        "the reference's pressure altitudes": paths.linear(paths.pressure, row, time),
        "the plots' pressure altitudes": np.where(
            valid, column(plots, "pressure_altitude_m", np.nan)[found.plot], np.nan
        ),
    }
    for upper, lower in permutations(told, 2):
        both = (told[upper] > _HIGH_M) & (told[lower] > _HIGH_M * FOOT_M)
        if both.sum() < _ENOUGH:
            continue
        ratio = float(np.median(told[upper][both] / told[lower][both]))
        if abs(ratio * FOOT_M - 1.0) < _RATIO:
            raise DataError(
                f"{upper} are {ratio:.2f} times {lower}: feet taken for metres",
                where=f"{int(both.sum())} pairs that tell both",
                why="a foot is 0.3048 m",
                next_step="name the column in its own unit, such as height_ft",
            )
    for name, heights in told.items():
        if np.isfinite(heights).sum() >= _ENOUGH and np.nanmedian(heights) > _HIGHEST_M:
            raise DataError(
                f"{name} are {np.nanmedian(heights):.0f} m in the median: no traffic flies there",
                why="feet taken for metres look like that",
                next_step="name the column in its own unit, such as height_ft",
            )


def _nothing(plots: "pl.DataFrame", reference: Reference, how: str, found: Compared) -> DataError:
    """The error for plots of which none has a partner: no time, no place, or the reasons."""
    ours, theirs = span(plots), span(reference.table)
    if overlap(ours, theirs, 0.0) <= 0:
        return DataError(
            "plots and reference do not overlap in time",
            where=f"plots {ours[0]:.1f} to {ours[1]:.1f} s, reference {theirs[0]:.1f} to "
            f"{theirs[1]:.1f} s",
            next_step="record both at the same time, or name the reference of this recording",
        )
    nearest = float(np.linalg.norm(found.paths.ground, axis=1).min())
    furthest = float(np.nanmax(column(plots, "range_m", np.nan), initial=0.0))
    if nearest > furthest + _FAR_M:
        return DataError(
            "plots and reference do not overlap in place",
            where=f"the furthest plot is {furthest / 1e3:.0f} km from the site, the nearest "
            f"report of the reference {nearest / 1e3:.0f} km",
            next_step="check the site, and that the reference is of this region",
        )
    names, counts = np.unique(found.reason.astype(str), return_counts=True)
    order = np.argsort(-counts)
    return DataError(
        f"no plot could be paired with the reference by {how}",
        why="; ".join(f"{counts[i]} plots: {names[i]}" for i in order),
        next_step="boresight inspect FILE says what both files hold",
    )


def _far(plots: "pl.DataFrame", setting: Setting, found: Compared, agree: int) -> DataError:
    """The error for plots that are somewhere else than the targets of their identity."""
    off, turned = _off(plots, found)
    return DataError(
        f"{f'only {agree} of {len(off)} plots are' if agree else 'no plot is'} anywhere near the "
        "target that has its identity",
        where=f"the median plot is {np.median(off) / 1e3:+.1f} km in range and "
        f"{np.degrees(np.median(turned)):+.1f} degrees in azimuth off",
        why="no bias of a working radar is as large",
        next_step=f"check the site ({setting.site.latitude_deg:g}, {setting.site.longitude_deg:g}),"
        " both clocks, where azimuth is counted from, and that the reference is of this recording",
    )
