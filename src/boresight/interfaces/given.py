"""What a user gives the verbs `run` and `smooth`, made plain arrays and checked once."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from boresight.errors import UsageError
from boresight.filters.method import Filter, Outside
from boresight.filters.nearest import nearest
from boresight.filters.recursion import Recursion
from boresight.maths import Gaussian
from boresight.models.checks import as_number
from boresight.models.motion import Motion
from boresight.models.sensors import Radar, Sensor

Array = Any


def models(motion: Any, sensor: Any) -> None:
    """UsageError where a motion is none, or a sensor."""
    for value, name, role in ((motion, "motion", Motion), (sensor, "sensor", Sensor)):
        needed = [each for each in role.__dict__ if not each.startswith("_")]
        if not all(hasattr(value, each) for each in needed):
            raise UsageError(
                f"the {name} is a {type(value).__name__}",
                next_step="pass run(name, motion, sensor, plots), such as bs.ConstantVelocity(...) "
                "and bs.Radar(...)",
            )


def plots(z: Any, sensor: Sensor) -> Array:
    """Plots (runs, scans, k) as an array; NaN is a missing component, infinity a mistake."""
    array, names = np.asarray(as_number("plots", z)), sensor.names
    if array.ndim != 3 or array.shape[1] < 1 or array.shape[2] != len(names):
        raise UsageError(
            f"plots have shape {array.shape}; (runs, scans, {len(names)}) is needed",
            why=f"the sensor measures {', '.join(names)}",
        )
    if np.isinf(array).any():
        run, scan, component = np.argwhere(np.isinf(array))[0]
        raise UsageError(
            f"{names[component]} is {array[run, scan, component]}",
            where=f"run {run}, scan {scan}",
            next_step="give NaN where a component was not measured",
        )
    return array


def recording(
    given: Any, dt: Any, start: Any, gate: float | None, recursion: Recursion
) -> tuple[Array, Array | None, Array]:
    """Plots without air (runs, scans, k), candidates if there are any, and s before each scan.

    Args:
        given: what the user gave as plots.
        dt: s before each scan; None: what the plots carry.
        start: where to begin.
        gate: what chooses from candidates.
        recursion: what is to filter them.
    """
    sensor = recursion.sensor
    many = candidates(given, gate, start, sensor)
    z = plots(getattr(given, "z", given if many is None else many[:, :, 0]), sensor)
    before = steps(getattr(given, "dt", None) if dt is None else dt, *z.shape[:2])
    fit(recursion, *z.shape[:2])
    if isinstance(sensor, Radar):
        z, many = sensor.without_air(z), many if many is None else sensor.without_air(many)
    return z, many, before


def candidates(given: Any, gate: float | None, start: Any, sensor: Sensor) -> Array | None:
    """All plots of each scan (runs, scans, m, k), of which a gate takes one; None for one a scan.

    Args:
        given: what the user gave as plots.
        gate: which they must have then.
        start: which may not come from such plots.
        sensor: what measured them.
    """
    many = getattr(given, "candidates", given if getattr(given, "ndim", 0) == 4 else None)
    if many is None:
        return None
    array, k = np.asarray(as_number("plots", many)), len(sensor.names)
    plots(array.reshape(len(array), -1, array.shape[-1]), sensor)
    if gate is None:
        raise UsageError(
            f"each scan holds up to {array.shape[2]} plots, and a filter takes one",
            next_step="pass gate=16: the nearest within that squared Mahalanobis distance is taken",
        )
    if isinstance(start, str) or (start is None and getattr(given, "prior", None) is None):
        raise UsageError(
            "no start from plots of which nobody knows whose they are",
            next_step="give the start: start=Gaussian(mean, cov)",
        )
    return array.reshape(*array.shape[:3], k)


def gated(
    chosen: Filter | Outside, recursion: Recursion, gate: float, z: Array, many: Array | None
) -> tuple[Recursion, Array]:
    """The recursion with a gate, and what it chooses from: (runs, scans, m, k).

    Args:
        chosen: the filter, which must be one that predicts.
        recursion: its recursion.
        gate: largest squared Mahalanobis distance that is taken.
        z: (runs, scans, k), chosen from where there is nothing else.
        many: what `candidates` gave.
    """
    if isinstance(chosen, Outside):
        raise UsageError(
            f"{chosen.name!r} is a function over whole recordings, which cannot be given a gate",
            next_step="pass it plots (runs, scans, k), or write the filter step by step",
        )
    choices = z[:, :, None] if many is None else many
    return replace(recursion, guard=nearest(recursion.sensor, gate, choices.shape[2])), choices


def steps(dt: Any, runs: int, scans: int) -> Array:
    """Seconds before each scan: a number, or an array with an axis of runs and one of scans."""
    if dt is None:
        raise UsageError("the plots carry no dt", next_step="pass dt= in seconds")
    array = np.asarray(as_number("dt", dt))
    fits = array.ndim == 2 and array.shape[0] in {1, runs} and array.shape[1] in {1, scans}
    if array.ndim and not fits:
        raise UsageError(
            f"dt has shape {array.shape}",
            next_step=f"give a number, (1, {scans}), ({runs}, 1) or ({runs}, {scans})",
        )
    wrong = array[~((array >= 0.0) & np.isfinite(array))]
    if wrong.size:
        raise UsageError(
            f"dt={wrong.flat[0]} s: time runs forward, in finite steps",
            next_step="sort the plots by time; dt is 0 where two came at once",
        )
    return array


def start(given: Any, motion: Motion) -> Gaussian:
    """A start in the motion's own states."""
    n = len(motion.names)
    if not isinstance(given, tuple) or len(given) != 2 or np.shape(given[0])[-1:] != (n,):
        raise UsageError(
            "the start is not one of the motion",
            why=f"its states are {', '.join(motion.names)}",
            next_step=f'pass Gaussian(mean, cov) of {n} states, "one plot" or "two plots"',
        )
    return Gaussian(*(np.asarray(as_number("start", each)) for each in given))


def fit(recursion: Recursion, runs: int, scans: int) -> None:
    """UsageError where a number of the models is for other runs or scans than the plots are."""
    for name, (value, leaf) in recursion.models().items():
        shape = np.shape(value)
        lead = shape[: len(shape) - len(leaf.shape)]
        if any(have not in {1, want} for have, want in zip(lead, (runs, scans), strict=False)):
            raise UsageError(
                f"{name} has shape {shape}, and the plots are of {runs} runs and {scans} scans",
                next_step="put runs first and scans second, each 1 long where it is constant",
            )


def told(name: str, outputs: Sequence[str]) -> None:
    """UsageError where more is asked of a function over whole recordings than it tells."""
    usual = ("mean", "cov", "nis")  # the last is what nobody asked for: `run` gives it by default
    further = [each for each in outputs if each not in usual]
    if further:
        raise UsageError(
            f"{name} tells no {further[0]!r}",
            why="it is a function over whole recordings",
            next_step='leave outputs out, or ask for "mean" and "cov"',
        )
