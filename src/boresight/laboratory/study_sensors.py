"""From what a study file says of motions and sensors to the models themselves."""

from dataclasses import MISSING, fields, replace
from typing import Any, cast

import numpy as np

from boresight.errors import UsageError
from boresight.experiments import worlds
from boresight.experiments.scenario import Scenario
from boresight.laboratory.mistakes import Mistake, attempt, dotted
from boresight.laboratory.study_models import CarrierTable, MotionTable, SensorTable
from boresight.laboratory.toml_places import Path
from boresight.models.motion import (
    ConstantAcceleration,
    ConstantVelocity,
    CoordinatedTurn,
    Motion,
    Static,
)
from boresight.models.sensors import Pose, Radar, Sensor

Array = Any
# A component as the file calls it: its standard deviation in a sensor, and its name in a plot.
COMPONENTS = {
    "range": ("range_m", "range_m"),
    "azimuth": ("azimuth_deg", "azimuth_rad"),
    "elevation": ("elevation_deg", "elevation_rad"),
    "cone": ("cone_deg", "cone_rad"),
    "height": ("height_m", "height_m"),
    "pressure_altitude": ("pressure_altitude_m", "pressure_altitude_m"),
    "range_rate": ("range_rate_mps", "range_rate_mps"),
}
_LENGTHS = ("range", "height", "pressure_altitude")
_UPWARD = ("elevation_deg", "height_m", "pressure_altitude_m")
_MOTIONS: dict[str, type[Any]] = {
    "constant-velocity": ConstantVelocity,
    "constant-acceleration": ConstantAcceleration,
    "coordinated-turn": CoordinatedTurn,
    "static": Static,
}
_FIELDS = {
    "accel": "accel_mps2",
    "jerk": "jerk_mps3",
    "turn_accel": "turn_accel_degps2",
    "drift": "drift_m_per_sqrt_s",
    "dims": "dims",
    "discretisation": "discretisation",
}


def motion_of(
    table: MotionTable, path: Path, base: Motion | None, dims: int, mistakes: list[Mistake]
) -> Motion | None:
    """The motion that a table says, or the base with some numbers changed.

    Args:
        table: what the file says.
        path: of the table.
        base: what is changed where the table names no kind.
        dims: of a motion that is made anew, unless the table says.
        mistakes: gets what is wrong.
    """
    given = {name: value for name, value in table if value is not None and name != "kind"}
    is_new = table.kind is not None or base is None
    usual = _MOTIONS[table.kind or "constant-velocity"]
    kind: Any = usual if is_new else type(base)
    known = {each.name: each for each in fields(kind)}
    settings = [name for name, field in _FIELDS.items() if field in known]
    strange = [name for name in given if name not in settings]
    needed = [name for name in settings if known[_FIELDS[name]].default is MISSING]
    lacking = [name for name in needed if is_new and name not in given]
    where = dotted(path)
    for name in strange:
        what = f"{where}.{name} is not a setting of {kind.__name__}"
        mistakes.append(Mistake((*path, name), what, f"it has {', '.join(settings)}", at_key=True))
    for name in lacking:
        what = f"{where} lacks {name}, which {kind.__name__} needs"
        mistakes.append(Mistake(path, what, f"give {name}", at_key=True))
    if strange or lacking:
        return None
    values = {_FIELDS[name]: value for name, value in given.items()}
    if not is_new:
        return attempt(mistakes, path, lambda: replace(base, **values))  # type: ignore[type-var]
    size = {"dims": dims} if "dims" in known else {}
    return attempt(mistakes, path, lambda: kind(**size | values))


def sensor_of(
    table: SensorTable, base: Sensor | None, mistakes: list[Mistake], **others: Any
) -> Radar | None:
    """The sensor that a table says, or the base with some components changed.

    Args:
        table: what the file says.
        base: a paper's sensor.
        mistakes: gets what is wrong.
        others: the radar's `pose` and `site`; `metre`, the unit of its lengths, m.
    """
    metre = others.pop("metre", 1.0)
    changed = {}
    for name, (sigma, _) in COMPONENTS.items():
        part = getattr(table, name)
        if part is not None and part.sigma is not None:
            changed[sigma] = part.sigma / (metre if name in _LENGTHS else 1.0)
        elif part is not None and getattr(base, sigma, None) is None:
            what = f"sensor.{name} lacks sigma, without which it is not measured"
            mistakes.append(
                Mistake(("sensor", name), what, "give its standard deviation", at_key=True)
            )
    if table.range_rate is not None and table.range_rate.correlation is not None:
        changed["range_rate_correlation"] = table.range_rate.correlation
    if base is not None:
        return attempt(mistakes, ("sensor",), lambda: replace(cast("Radar", base), **changed))
    return attempt(mistakes, ("sensor",), lambda: Radar(**changed, **others))


def sight_of(table: SensorTable, mistakes: list[Mistake], *, metre: float = 1.0) -> dict[str, Any]:
    """Fields of a scenario: what is detected, what is biased, what is false."""
    bias = {}
    for name, (_, component) in COMPONENTS.items():
        part = getattr(table, name)
        if part is not None and part.bias is not None:
            value = part.bias / (metre if name in _LENGTHS else 1.0)
            bias[component] = np.radians(value) if component.endswith("_rad") else value
    coverage = table.coverage
    if table.false_plots and coverage is None:
        what = "sensor lacks coverage, and there are false plots"
        mistakes.append(Mistake(("sensor", "false_plots"), what, 'give coverage = "100 km"'))
        coverage = 1.0  # for the rest to be looked at
    coverage = None if coverage is None else coverage / metre
    found: dict[str, Any] = {"detection": table.detection, "false_plots": table.false_plots}
    found |= {"coverage_m": coverage, "bias": bias or None}
    return {name: value for name, value in found.items() if value is not None}


def sees_up(sensor: Radar) -> bool:
    """Whether anything that is measured tells a height."""
    return any(getattr(sensor, name) is not None for name in _UPWARD)


def pose_of(table: SensorTable, dt_s: float, scans: int | None) -> Pose | None:
    """Where the sensor is, and how it is turned; None at the origin, along the axes."""
    if table.carrier is not None:
        return _carried(table.carrier, dt_s, scans, along_course=table.cone is not None)
    if table.position is None and table.heading is None:
        return None
    position = [*(table.position or []), 0.0, 0.0, 0.0][:3]
    return Pose(position_m=position, rotation=_turned(np.radians(table.heading or 0.0)))


def _carried(table: CarrierTable, dt_s: float, scans: int | None, *, along_course: bool) -> Pose:
    """A pose for every scan; an array that hears cones lies along its carrier's course."""
    if scans is None:
        raise UsageError(
            "a sensor that is carried needs to know for how long",
            next_step="give scans in [scenario]",
        )
    anything = Radar(range_m=1.0, azimuth_deg=1.0)
    path = np.asarray(flight(table, dt_s=dt_s, scans=scans, sensor=anything).path)
    position, velocity = np.zeros((2, 1, scans, 3))
    dims = len(table.points[0])
    position[0, :, :dims], velocity[0, :, :dims] = path[:, :dims], path[:, dims:]
    course = np.arctan2(velocity[..., 1], velocity[..., 0])
    turned = {"rotation": _turned(course)} if along_course else {}
    return Pose(position_m=position, velocity_mps=velocity, **turned)


def flight(table: CarrierTable, **others: Any) -> Scenario:
    """A world of waypoints; its sensor, dt_s and further arguments are the others."""
    speed = table.speed if len(table.speed) > 1 else table.speed[0]
    turn: dict[str, Any] = (
        {} if table.lateral_accel is None else {"accel_mps2": table.lateral_accel}
    )
    return worlds.waypoints(table.points, speed_mps=speed, **turn, **others)


def _turned(heading: Array) -> Array:
    """(..., 3, 3): axes of a sensor whose x axis is so far clockwise from North, radians."""
    c, s, o = np.cos(heading), np.sin(heading), np.zeros(np.shape(heading))
    rows = [[c, s, o], [-s, c, o], [o, o, o + 1.0]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
