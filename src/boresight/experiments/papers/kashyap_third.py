"""A flight in the place of kashyap's Set 3, whose recording is not available.

Built in is a turning aircraft of the demo's invented sky, seen from the demo's radar. A file gives
a real one: `time_s`, `latitude_deg`, `longitude_deg`, `height_m` above the ellipsoid, one aircraft,
seen from as far south of the middle of the flight as is assumed. Either way it is the part of
Set 1's length with the most turning.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from boresight.errors import DataError, MissingInputError
from boresight.experiments.demo import shipped
from boresight.experiments.papers.kashyap_methods import Method
from boresight.experiments.papers.kashyap_runs import Tracked, again, measured
from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth
from boresight.maths.frames import (
    Site,
    ecef_from_geodetic,
    enu_from_ecef,
    geodetic_from_ecef,
    geodetic_from_enu,
)
from boresight.models.motion import ConstantVelocity
from boresight.models.sensors import Radar

Array = Any
BUILT_IN = "built-in"
_MOVING_MPS = 20.0  # slower than any aircraft in flight: on the ground a course means nothing
_COLUMNS = ("time_s", "latitude_deg", "longitude_deg", "height_m")


def substitute(like: Scenario, assumed: Mapping[str, Any]) -> tuple[Scenario, Truth]:
    """The scenario that stands for Set 3, and its one truth.

    Args:
        like: Set 1: its number of scans, and their distance.
        assumed: `set_3` and what begins so.

    Raises:
        MissingInputError: there is no such file.
        DataError: the file has no flight of that length.
    """
    chosen, name = assumed["set_3"], assumed["set_3_callsign"]
    time, path = _built_in(name) if chosen == BUILT_IN else _read(Path(chosen), assumed)
    states = _most_turning(time, path, like)
    r, az, el = assumed["set_3_sigma"]
    world = replace(
        like,
        name="kashyap-set-3",
        motion=ConstantVelocity(accel_mps2=assumed["set_3_accel_mps2"], dims=3),
        sensor=Radar(range_m=r, azimuth_deg=az, elevation_deg=el),
        initial=states[0],
        begin="given",
        source=name if chosen == BUILT_IN else Path(chosen).name,
    )
    return world, Truth(world.time_s, states[None], world.motion.names, states[:1])


def seen(
    world: Scenario, truth: Truth, methods: Mapping[str, Method], noises: int, seed: int
) -> dict[str, Tracked]:
    """That flight through many noises, by every method."""
    unseen = Plots(truth.time_s, np.empty(0), world.dt, world.prior)
    many, plots = again(world, (truth, unseen), noises, seed)
    return {
        name: measured(method, world, many, plots, bounds=True) for name, method in methods.items()
    }


def _built_in(callsign: str) -> tuple[Array, Array]:
    """Seconds (n,), and north, east, up of the demo's radar (n, 3)."""
    import polars as pl

    _, truth = shipped()
    knots = truth.knots.filter(pl.col("callsign") == callsign)
    if knots.is_empty():
        known = truth.knots["callsign"].unique().sort()
        raise DataError(
            f"the demo has no aircraft {callsign!r}",
            next_step=f"use one of {known[0]} to {known[-1]}",
        )
    first, *_, last = knots["time_s"].to_numpy()
    time = np.arange(np.ceil(first), last)
    position = truth.at(np.full(len(time), knots["flight"][0]), time).position
    return time, position[:, [1, 0, 2]]


def _read(path: Path, assumed: Mapping[str, Any]) -> tuple[Array, Array]:
    """The same of a file, seen from south of its middle."""
    import polars as pl

    try:
        table = pl.read_csv(
            path, columns=list(_COLUMNS), schema_overrides=dict.fromkeys(_COLUMNS, pl.Float64)
        )
    except OSError as error:
        raise MissingInputError(
            f"cannot read {path}", why=str(error), next_step="give set_3 another file, or built-in"
        ) from error
    except pl.exceptions.PolarsError as error:
        raise DataError(
            f"{path} is not a flight",
            why=str(error),
            next_step=f"give columns {', '.join(_COLUMNS)}",
        ) from error
    table = table.drop_nulls().unique("time_s").sort("time_s")
    if table.height < 4:
        raise DataError(f"{path} has {table.height} positions", why="a curve needs four")
    time, *place = (table[name].to_numpy() for name in _COLUMNS)
    return time, _north_east_up(place, assumed["set_3_south_m"])


def _north_east_up(place: Sequence[Array], south_m: float) -> Array:
    """Positions seen from a radar that stands south of their middle, on the ellipsoid."""
    latitude, longitude, _ = geodetic_from_ecef(np.mean(ecef_from_geodetic(*place), axis=0))
    middle = Site(latitude_deg=float(latitude), longitude_deg=float(longitude), height_m=0.0)
    latitude, longitude, _ = geodetic_from_enu(np.array([0.0, -south_m, 0.0]), middle)
    site = Site(latitude_deg=float(latitude), longitude_deg=float(longitude), height_m=0.0)
    return enu_from_ecef(ecef_from_geodetic(*place), site)[:, [1, 0, 2]]


def _most_turning(time: Array, path: Array, like: Scenario) -> Array:
    """States (scans, 6) at the scans of the part in which the course changes most."""
    from scipy.interpolate import CubicSpline

    curve = CubicSpline(time, path)
    at = np.arange(time[0], time[-1], like.dt_s)
    velocity = curve(at, 1)
    if len(at) < like.scans:
        raise DataError(
            f"the flight is {len(at) * like.dt_s:.0f} s long",
            why=f"Set 3's part is as long as Set 1: {like.scans * like.dt_s:.0f} s",
            next_step="give a longer one",
        )
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) > _MOVING_MPS
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(course)) * moving[1:])])
    best = int(np.argmax(turned[like.scans - 1 :] - turned[: len(at) - like.scans + 1]))
    return np.hstack([curve(at), velocity])[best : best + like.scans]
