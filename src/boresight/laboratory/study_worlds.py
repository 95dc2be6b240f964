"""From what a study file says of the world to a scenario."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path as File
from typing import Any

from boresight.errors import UsageError
from boresight.experiments import scenario, worlds
from boresight.experiments.scenario import Scenario
from boresight.experiments.spreads import Annulus, Uniform
from boresight.formats.recording import readable
from boresight.laboratory.mistakes import Mistake, attempt
from boresight.laboratory.study_models import (
    MotionTable,
    PaperTable,
    RandomTable,
    RecordedTable,
    SensorTable,
    StudyFile,
    WaypointsTable,
)
from boresight.laboratory.study_sensors import (
    flight,
    motion_of,
    pose_of,
    sees_up,
    sensor_of,
    sight_of,
)
from boresight.maths.frames import Site

_OWN = ("period", "position", "heading", "carrier")  # a paper's scenario has its own
_USUAL_S = 1.0  # where the period is missing, which is told: for the rest to be looked at


def world_of(file: StudyFile, folder: File, mistakes: list[Mistake]) -> Scenario | None:
    """The scenario; None where it cannot be made.

    Args:
        file: the study.
        folder: that recordings are relative to.
        mistakes: gets what is wrong.
    """
    table, start = file.scenario, _start(file)
    if table is None:
        return None
    if isinstance(table, PaperTable):
        return _paper(table, file, start, mistakes)
    if file.sensor is None:
        what = f"a scenario of kind '{table.kind}' needs a sensor"
        mistakes.append(Mistake(("scenario",), what, 'add [sensor] range.sigma = "30 m", ...'))
        return None
    made = _own(table, file, file.sensor, folder, mistakes)
    if made is None:
        return None
    return attempt(mistakes, ("start",), lambda: replace(made, **start))


def _start(file: StudyFile) -> dict[str, Any]:
    """Fields of a scenario: how tracks begin."""
    start = file.start
    found = {"begin": start.kind, "speed_mps": start.speed_sd}
    found |= {"range_m": start.range, "range_sd_m": start.range_sd}
    return {name: value for name, value in found.items() if value is not None}


def _paper(
    table: PaperTable, file: StudyFile, start: dict[str, Any], mistakes: list[Mistake]
) -> Scenario | None:
    """A paper's scenario with what the study changes of its sensor, its motion and its start."""
    found = attempt(mistakes, ("scenario", "name"), lambda: scenario.lookup(table.name))
    if found is None:
        return None
    metre = found.metre
    seen = file.sensor or SensorTable()
    for name in _OWN:
        if getattr(seen, name) is not None:
            what = f"sensor.{name} cannot be changed: scenario {table.name!r} has its own"
            mistakes.append(Mistake(("sensor", name), what, "leave it out", at_key=True))
    changed: dict[str, Any] = {"sensor": sensor_of(seen, found.sensor, mistakes, metre=metre)}
    if file.motion is not None:
        changed["motion"] = motion_of(file.motion, ("motion",), found.motion, 0, mistakes)
    if None in changed.values():
        return None
    near = {name: start[name] / metre for name in ("range_m", "range_sd_m") if name in start}
    changed |= start | near | sight_of(seen, mistakes, metre=metre)
    return attempt(mistakes, ("scenario",), lambda: replace(found, **changed))


def _own(
    table: WaypointsTable | RecordedTable | RandomTable,
    file: StudyFile,
    seen: SensorTable,
    folder: File,
    mistakes: list[Mistake],
) -> Scenario | None:
    """A scenario of the user's own."""
    if seen.period is None:
        mistakes.append(Mistake(("sensor",), "sensor lacks period", 'give period = "4 s"'))
    dt_s = seen.period or _USUAL_S
    site = attempt(mistakes, ("scenario", "site"), partial(_site, table))
    pose = attempt(mistakes, ("sensor", "carrier"), partial(pose_of, seen, dt_s, table.scans))
    radar = sensor_of(seen, None, mistakes, pose=pose, site=site)
    if radar is None:
        return None
    dims = len(table.points[0]) if isinstance(table, WaypointsTable) else 2 + sees_up(radar)
    moves = file.motion or _usual_motion(table)
    motion = motion_of(moves, ("motion",), None, dims, mistakes)
    others: dict[str, Any] = {"sensor": radar, "dt_s": dt_s, "motion": motion, "name": table.name}
    others |= {"scans": table.scans} | sight_of(seen, mistakes)
    if isinstance(table, WaypointsTable):
        return attempt(mistakes, ("scenario",), lambda: flight(table, **others))
    if isinstance(table, RandomTable):
        return attempt(mistakes, ("scenario",), lambda: _random(table, others))
    source = attempt(
        mistakes, ("scenario", "file"), lambda: _recording(folder / table.file, table.columns)
    )
    if source is None or site is None:
        return None
    target = table.target
    return attempt(
        mistakes, ("scenario",), lambda: worlds.recorded(source, site, target=target, **others)
    )


def _site(table: WaypointsTable | RecordedTable | RandomTable) -> Site | None:
    if table.site is None:
        return None
    return Site(**dict(zip(("latitude_deg", "longitude_deg", "height_m"), table.site, strict=True)))


def _usual_motion(table: WaypointsTable | RecordedTable | RandomTable) -> MotionTable:
    """How targets are believed to move where the study does not say."""
    if isinstance(table, RandomTable):
        return MotionTable.model_construct(accel=0.0)
    turn = table.lateral_accel if isinstance(table, WaypointsTable) else None
    return MotionTable.model_construct(accel=turn or worlds.TURN_MPS2)


def _random(table: RandomTable, others: dict[str, Any]) -> Scenario:
    ring, box = table.range is not None, (table.north is not None, table.east is not None)
    if ring == any(box) or any(box) != all(box):
        raise UsageError(
            "scenario does not say where targets start",
            next_step='give range = ["20 km", "80 km"], or both north and east',
        )
    if ring and not isinstance(table.range, Uniform):
        raise UsageError(
            "scenario.range is one distance", next_step='give range = ["20 km", "80 km"]'
        )
    near = table.range
    position = Annulus(near.low, near.high, table.azimuth) if ring else (table.north, table.east)
    return worlds.random_draws(
        position=position,
        speed_mps=table.speed,
        heading_deg=table.heading,
        height_m=table.height,
        climb_mps=table.climb,
        **others,
    )


def _recording(path: File, columns: Mapping[str, str]) -> Any:
    """What the file holds of its targets, read once for all settings of a sweep."""
    about = readable(path).stat()
    return _read(str(path), tuple(columns.items()), about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=1)
def _read(path: str, columns: tuple[tuple[str, str], ...], *_: int) -> Any:
    from boresight.calibration.references import from_file

    return from_file(path, columns=dict(columns))
