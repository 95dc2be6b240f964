"""Truth and plots of a study's worlds as tables, which the other commands read as recordings.

A world whose sensor measures range and azimuth gives `plots`: each run is a sensor of its own
(`run-0`, ...) that sees one target, whose `address` is the run's number plus one; false plots have
no address. One that hears bearings gives `bearings`, where each run is a `track`, and `own-ship`.
`truth` has the motion's states, and where the frame has a site, latitude, longitude and height too:
it can be a reference for `calibrate`. Rows are as sensors report them: biased, and with the plots
that made a filter's start.
"""

import re
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from boresight.experiments.scenario import Scenario
from boresight.experiments.simulate import Plots, Truth, simulate
from boresight.experiments.world import World
from boresight.formats.output import TABLE_VERSION, write_table, writing
from boresight.laboratory.study import Setting, Study
from boresight.maths.frames import geodetic_from_enu
from boresight.models.sensors import Pose

if TYPE_CHECKING:
    import polars as pl

Array = Any
Progress = Callable[[float, float], None]
_ROWS = 200_000  # in memory at once
_SMALL = 50_000  # rows that a spreadsheet can show: those are written as CSV too
_ADDRESSES = 2**24 - 1
_LABEL = 60  # characters of a folder's name
_GEODETIC = ("latitude_deg", "longitude_deg", "height_m")


class _Table(NamedTuple):
    """A table that is written: its name, and its rows made of some runs' truth and plots."""

    name: str
    rows: "Callable[[Scenario, Array, Truth, Plots], pl.DataFrame]"
    per_run: bool = True


def study_tables(
    study: Study, folder: Path, *, progress: Progress | None = None
) -> tuple[Path, ...]:
    """Write truth and plots of every world of a study.

    Args:
        study: settings that differ in their filters only share a world. Where there are several
            worlds, each has a folder named by what is swept.
        folder: where the tables go; made if it is not there.
        progress: called with how many runs are written, of how many.

    Returns:
        The files: Parquet, and CSV where there are few rows.

    Raises:
        OutputError: they cannot be written.
    """
    worlds = _worlds(study)
    total, done, paths = float(study.runs * len(worlds)), 0.0, []
    for label, scenario in worlds.items():
        place = folder / label if len(worlds) > 1 else folder
        with writing(place):
            place.mkdir(parents=True, exist_ok=True)
        for table in _tables(scenario):
            paths += _write(study, scenario, table, place)
        done += study.runs
        if progress is not None:
            progress(done, total)
    return tuple(paths)


def _worlds(study: Study) -> dict[str, Scenario]:
    """Different worlds, by what is swept of them."""
    found: dict[tuple[tuple[str, str], ...], Setting] = {}
    for setting in study.settings:
        values = tuple(each for each in setting.values if not each[0].startswith("filter."))
        found.setdefault(values, setting)
    return {_label(i, values): each.scenario for i, (values, each) in enumerate(found.items())}


def _label(number: int, values: tuple[tuple[str, str], ...]) -> str:
    words = " ".join(f"{name}={value}" for name, value in values)
    return re.sub(r"[^\w.=+-]+", "-", f"{number + 1:02d} {words}")[:_LABEL].strip("-.")


def _tables(scenario: Scenario) -> tuple[_Table, ...]:
    """What is written of a world."""
    hears = {"azimuth_rad", "cone_rad"} & set(scenario.sensor.names)
    if "range_m" in scenario.sensor.names or not hears:
        return _Table("truth", _truth), _Table("plots", _plots)
    own_ship = _Table("own-ship", _own_ship, per_run=False)
    return _Table("truth", _truth), _Table("bearings", _bearings), own_ship


def _write(study: Study, scenario: Scenario, table: _Table, folder: Path) -> list[Path]:
    """One table, as Parquet a few runs after the other, and as CSV if it is small."""
    many = scenario.scans * max(World(scenario, scenario.sensor).candidates, 1)
    runs = study.runs if table.per_run else 1
    parts = partial(_parts, study, scenario, table, runs, max(1, _ROWS // many))
    path = folder / f"{table.name}.parquet"
    if runs * many > _SMALL:
        return [_sink(parts, path, table.name)]
    import polars as pl

    frame = pl.concat(parts())
    return [write_table(frame, path.with_suffix(end), table.name) for end in (".parquet", ".csv")]


def _parts(
    study: Study, scenario: Scenario, table: _Table, runs: int, at_once: int
) -> "Iterator[pl.DataFrame]":
    """The rows of a few runs at a time."""
    shared: dict[str, Any] = {
        f"{name}_run": 0 if how == "one" else None
        for name, how in (("truth", study.truth), ("noise", study.noise))
    }
    for first in range(0, runs, at_once):
        count = min(at_once, runs - first)
        truth, plots = simulate(
            scenario, runs=count, seed=study.seed, first=first, whole=True, **shared
        )
        yield table.rows(scenario, first + np.arange(count), truth, plots)


def _sink(parts: "Callable[[], Iterator[pl.DataFrame]]", path: Path, kind: str) -> Path:
    """Write parts one after the other."""
    from polars.io.plugins import register_io_source

    about = {"boresight": version("boresight"), "table": kind, "table_version": TABLE_VERSION}
    rows = register_io_source(lambda *_: parts(), schema=next(parts()).schema)
    with writing(path):
        rows.sink_parquet(path, metadata=about)
    return path


def _truth(scenario: Scenario, runs: Array, truth: Truth, plots: Plots) -> "pl.DataFrame":
    """Every scan's true state, and where on Earth that is if the frame has a site."""
    import polars as pl

    del plots
    columns = _keys(runs, truth.time_s, 1)
    columns |= {name: truth.states[..., i].ravel() for i, name in enumerate(truth.names)}
    site = getattr(scenario.sensor, "site", None)
    if site is not None:
        north, east, *up = np.moveaxis(truth.states[..., : scenario.motion.dims], -1, 0)
        enu = np.stack([east, north, up[0] if up else 0.0 * east], axis=-1)
        place = geodetic_from_enu(enu, site)
        columns |= {name: np.ravel(each) for name, each in zip(_GEODETIC, place, strict=True)}
    return pl.DataFrame(columns)


def _plots(scenario: Scenario, runs: Array, truth: Truth, plots: Plots) -> "pl.DataFrame":
    """All plots that there are, those of the target and false ones, scan by scan."""
    import polars as pl

    z = plots.z[:, :, None] if plots.candidates is None else plots.candidates
    columns = _keys(runs, truth.time_s, z.shape[2])
    is_own = np.all(z == plots.z[:, :, None], axis=-1).ravel()
    metre = scenario.metre
    for i, name in enumerate(scenario.sensor.names):
        columns |= dict([_column(name, z[..., i].ravel(), metre)])
    table = pl.DataFrame(columns).with_columns(
        pl.format("run-{}", "run").alias("sensor"),
        pl.when(pl.Series(is_own)).then("address"),
    )
    return table.filter(~pl.Series(np.isnan(z).all(axis=-1).ravel()))


def _bearings(scenario: Scenario, runs: Array, truth: Truth, plots: Plots) -> "pl.DataFrame":
    """What is heard; of an array, angles off its axis."""
    import polars as pl

    names = scenario.sensor.names
    name = "cone_rad" if "cone_rad" in names else "azimuth_rad"
    z = plots.z[..., names.index(name)].ravel()
    sigma = getattr(scenario.sensor, name.replace("_rad", "_deg"))
    columns = _keys(runs, truth.time_s, 1) | {
        "bearing_deg": np.degrees(z) % 360.0,
        "sigma_deg": np.broadcast_to(np.mean(sigma), z.shape),
        "conical": np.full(z.shape, name == "cone_rad"),
    }
    table = pl.DataFrame(columns).drop("address").rename({"run": "track"})
    return table.filter(~pl.Series(np.isnan(z)))


def _own_ship(scenario: Scenario, runs: Array, truth: Truth, plots: Plots) -> "pl.DataFrame":
    """Where the sensor is at every scan, and where its array points if it has one."""
    import polars as pl

    del runs, plots
    scans, pose = scenario.scans, getattr(scenario.sensor, "pose", None) or Pose()
    position = np.broadcast_to(pose.position_m, (1, scans, 3))[0]
    columns = {"time_s": truth.time_s, "north_m": position[:, 0], "east_m": position[:, 1]}
    if "cone_rad" in scenario.sensor.names:
        axis = np.broadcast_to(pose.rotation, (1, scans, 3, 3))[0, :, 0]
        columns["axis_deg"] = np.degrees(np.arctan2(axis[:, 1], axis[:, 0])) % 360.0
    return pl.DataFrame(columns)


def _keys(runs: Array, time_s: Array, plots: int) -> dict[str, Array]:
    """What every row has, by runs, then scans, then the plots of a scan."""
    each = len(time_s) * plots
    addresses = np.array([f"{run % _ADDRESSES + 1:06X}" for run in runs.tolist()])
    return {
        "run": np.repeat(runs, each),
        "time_s": np.tile(np.repeat(time_s, plots), len(runs)),
        "address": np.repeat(addresses, each),
    }


def _column(name: str, values: Array, metre: float) -> tuple[str, Array]:
    """A component as tables name it: degrees, azimuths from 0 to 360."""
    if name == "azimuth_rad":
        return "azimuth_deg", np.degrees(values) % 360.0
    if name.endswith("_rad"):
        return name.replace("_rad", "_deg"), np.degrees(values)
    return name, values * (metre if name == "range_m" else 1.0)
