"""The verbs a user types in Python: friendly over what is exact below."""

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from boresight import catalogue
from boresight.errors import UsageError
from boresight.filters.method import FilterLike, Outside
from boresight.filters.recursion import Estimate, Recursion, run_recursion, spread
from boresight.filters.smoother import smooth as smooth_lanes
from boresight.filters.start import two_plots
from boresight.filters.stream import Stream
from boresight.interfaces import door, given
from boresight.interfaces.applying import applied
from boresight.maths import Gaussian
from boresight.maths.frames import Site
from boresight.models.atmosphere import Atmosphere
from boresight.models.checks import positive
from boresight.models.motion import Motion
from boresight.models.sensors import Sensor

if TYPE_CHECKING:
    import polars as pl

    from boresight.calibration.result import Calibration
    from boresight.interfaces.report import Report
    from boresight.laboratory.result import StudyResult
    from boresight.target_motion.result import TmaResult
    from boresight.tracking.result import TrackingResult

Array = Any
_STARTS = {"one plot": 1, "two plots": 2}


def run(
    name: FilterLike | Outside,
    motion: Motion,
    sensor: Sensor,
    plots: Any,
    *,
    dt: Array | None = None,
    start: Gaussian | Literal["one plot", "two plots"] | None = None,
    speed_mps: float | None = None,
    gate: float | None = None,
    outputs: Sequence[str] = ("mean", "cov", "nis"),
    last: bool = False,
    threads: int = 1,
    **settings: Any,
) -> Estimate:
    """Filter many runs at once.

    Args:
        name: of a filter of the catalogue, such as "ekf" or "mekf"; or a filter of your own.
        motion: how the targets move.
        sensor: what measured the plots.
        plots: what `simulate` gives, or an array (runs, scans, k) in SI units and radians with
            NaN where nothing was measured; (runs, scans, m, k) where a scan holds several.
        dt: seconds before each scan: a number, (1, scans), (runs, 1) or (runs, scans); the first
            scan's dt is the time since `start`. Left out: what `plots` carries.
        start: Gaussian with mean (n,) or (runs, n); or "one plot" or "two plots": made from the
            first plots, which are then used for the start only (until then every scan shows the
            start). Left out: what `plots` carries, else "one plot".
        speed_mps: spread of each velocity of a start from one plot; left out, the filter's own: 300
            for radars' targets, 11 for a bank's contacts at sea.
        gate: squared Mahalanobis distance beyond which a plot is not taken; of several the nearest
            inside is. Left out: every plot is taken, and a scan may hold only one.
        outputs: of mean, cov, nis, dof, loglik, innovation, variance, status; `Outside` has two.
        last: give outputs after the last scan only.
        threads: threads that share the runs; the result does not depend on it.
        settings: the filter's own, such as `mu="none"` for the MEKF.

    Returns:
        The outputs as attributes: mean (runs, scans, n), cov (runs, scans, n, n), ...; and `dt`
        as the filter took it, 0 up to the scan of a start from plots.

    Raises:
        UsageError: an unknown name or setting, shapes that do not fit, an infinite plot.
    """
    given.models(motion, sensor)
    chosen = catalogue.find(name)
    step = catalogue.lookup("ekf") if isinstance(chosen, Outside) else chosen
    recursion = step.with_settings(**settings).recursion(motion, sensor)
    z, many, steps = given.recording(plots, dt, start, gate, recursion)
    prior = getattr(plots, "prior", None) if start is None else start
    if prior is None or isinstance(prior, str):
        prior, z, steps = _start_from_plots(prior or "one plot", z, steps, recursion, speed_mps)
    prior = given.start(prior, motion)
    if gate is not None:
        recursion, z = given.gated(chosen, recursion, gate, z, many)
    if isinstance(chosen, Outside):
        given.told(chosen.name, outputs)
        return _run_outside(chosen, motion, sensor, z, steps, prior, last=last)
    found = run_recursion(recursion, z, steps, prior, outputs=outputs, last=last, threads=threads)
    return replace(found, others=found.others | {"dt": steps})


def _run_outside(
    outside: Outside,
    motion: Motion,
    sensor: Sensor,
    z: Array,
    dt: Array,
    start: Gaussian,
    *,
    last: bool,
) -> Estimate:
    """What a function over whole recordings says; of the steps between it tells nothing."""
    rows = np.shape(dt)[0] if np.ndim(dt) else 1
    steps = np.broadcast_to(np.asarray(dt, dtype=float), (rows, z.shape[1]))
    said = outside(z, steps, Gaussian(*spread(start, len(z))), motion, sensor)
    mean, cov = (array[:, -1] if last else array for array in said)
    others = {"mean": mean, "cov": cov, "dt": dt}
    return Estimate(others, final=None)  # type: ignore[arg-type] # there is none to go on from


def smooth(
    estimate: Estimate,
    motion: Motion,
    dt: Any = None,
    *,
    linearisation: Literal["jacobian", "cubature"] = "jacobian",
    threads: int = 1,
) -> Estimate:
    """What all plots say of every scan, the later ones too (Rauch-Tung-Striebel).

    Args:
        estimate: of any filter, with mean and cov of every scan; NaN where there is none.
        motion: the one that the filter was given.
        dt: seconds before each scan as in `run`, or plots that carry it. Left out: that of the
            estimate, if `run` made it.
        linearisation: how a motion that is not linear is made so.
        threads: threads that share the runs; the result does not depend on it.

    Returns:
        The estimate with mean (runs, scans, n) and cov (runs, scans, n, n) smoothed; nothing else.

    Raises:
        UsageError: the estimate lacks mean, cov or dt, or shapes do not fit.
    """
    told = getattr(estimate, "others", {}) | ({} if dt is None else {"dt": getattr(dt, "dt", dt)})
    lacking = [name for name in ("mean", "cov", "dt") if told.get(name) is None]
    if lacking:
        raise UsageError(
            f"an estimate without {lacking[0]!r} cannot be smoothed",
            next_step="pass dt= in seconds" if lacking[0] == "dt" else "run with it in outputs",
        )
    filtered = Gaussian(told["mean"], told["cov"])
    steps = given.steps(told["dt"], *filtered.mean.shape[:2]) if filtered.mean.ndim == 3 else 0.0
    smoothed = smooth_lanes(filtered, steps, motion, linearisation=linearisation, threads=threads)
    return replace(estimate, others=smoothed._asdict() | {"dt": steps})


def _start_from_plots(
    how: str, z: Array, dt: Array, recursion: Recursion, speed_mps: float | None
) -> tuple[Gaussian, Array, Array]:
    """A start from the first plots, which are then not used again."""
    used = _STARTS.get(how, 0)
    if not used:
        raise UsageError(
            f"no start {how!r}", next_step=f"use a Gaussian, or {' or '.join(_STARTS)}"
        )
    if z.shape[1] < used:
        raise UsageError(
            f"no start from {how} of {z.shape[1]} scans",
            next_step="give the start: start=Gaussian(mean, cov)",
        )
    spread = {} if speed_mps is None else {"speed_mps": positive("speed_mps", speed_mps)}
    rows = np.shape(dt)[0] if np.ndim(dt) else 1
    steps = np.array(np.broadcast_to(np.asarray(dt, dtype=float), (rows, z.shape[1])))
    models = recursion.motion, recursion.sensor
    if used == 1:
        prior = recursion.method.start(z[:, 0], *models, **spread)
    elif not np.all(steps[:, 1] > 0):
        raise UsageError(
            "no velocity from two plots of one instant", next_step='start from "one plot"'
        )
    else:
        prior = two_plots(z[:, 0], z[:, 1], steps[:, 1], *models)
    rest = z.copy()
    rest[:, :used], steps[:, :used] = np.nan, 0.0
    return prior, rest, steps


def stream(
    name: FilterLike,
    motion: Motion,
    sensor: Sensor,
    *,
    targets: int | None = None,
    **settings: Any,
) -> Stream:
    """A filter fed plot by plot, live; state in, state out.

    Args:
        name: of a filter of the catalogue, or a filter of your own.
        motion: how the target moves.
        sensor: what measures it.
        targets: None for one target; a number for that many at once.
        settings: the filter's own.

    Returns:
        `step`: `state = step.start(plot)`, then `state = step(state, plot, dt=4.0)`.
    """
    return Stream(
        catalogue.lookup(name).with_settings(**settings).recursion(motion, sensor), targets
    )


def inspect(path: str | PathLike[str]) -> dict[str, Any]:
    """What a recording holds: format, framing, categories with editions, sensors, damage."""
    from boresight.formats import recording

    return recording.inspect(Path(path))


def track(
    plots: "pl.DataFrame",
    *,
    site: Site | tuple[float, float, float] | None = None,
    sensor: str | None = None,
    filter: FilterLike = door.FILTER,  # noqa: A002 - the field's word
    compare: Sequence[FilterLike] | FilterLike = (),
    calibration: "Calibration | str | PathLike[str] | None" = None,
    atmosphere: Atmosphere | str | None = None,
) -> "TrackingResult":
    """Tracks of every identified target of one radar.

    Args:
        plots: what `read` gives.
        site: of the radar: latitude and longitude in degrees, height above the ellipsoid in m.
        sensor: "SAC/SIC", if the plots are of several.
        filter: a name of the catalogue, or a filter of your own.
        compare: further filters to run on the same plots with the same noise, or "all" of ours that
            can take them; the result's `filters` and `scores`, and the report, set them side by
            side.
        calibration: what `calibrate` found, or its calibration.toml: plots are corrected by it, its
            noise is used, and what it leaves uncertain is in the covariances (Schmidt).
        atmosphere: the air whose delay is taken out of the ranges, such as
            "exponential" or `ExponentialAtmosphere()`; left out: that of the calibration, or none.
    """
    from boresight.tracking.tracker import track as track_plots

    (first, *others), is_all = door.filters(
        [filter, *(compare if isinstance(compare, list | tuple) else [compare])]
    )
    air = door.atmosphere(atmosphere)
    using = applied(calibration, plots, site=door.place(site), sensor=sensor, atmosphere=air)
    result = track_plots(plots, filter=first, compare=others, leave_out=is_all, **using.arguments)
    return replace(result, remarks=[*using.remarks, *result.remarks])


def report(
    tracks: "TrackingResult | Calibration | TmaResult | StudyResult | None" = None,
    calibration: "Calibration | None" = None,
    **about: Any,
) -> "Report":
    """A report on one page: `.html`, `.save(path)`, and shown by itself in a notebook.

    Args:
        tracks: what `track` gives; or what `calibrate`, `tma` or `compare` gives, for a page about
            that alone.
        calibration: what `calibrate` gives, for a page about both.
        about: `inspection`, what `inspect` says of the file, and `command`, as the page shows them.

    Raises:
        UsageError: nothing to report on.
    """
    from boresight.calibration.result import Calibration
    from boresight.interfaces.report import report as build
    from boresight.laboratory.result import StudyResult
    from boresight.target_motion.result import TmaResult
    from boresight.tracking.result import TrackingResult

    first = TrackingResult | Calibration | TmaResult | StudyResult
    for value, kind in ((tracks, first), (calibration, Calibration)):
        if value is not None and not isinstance(value, kind):
            raise UsageError(
                f"a {type(value).__name__} cannot be reported on",
                next_step="pass report(tracks, calibration): what track and calibrate return",
            )
    if isinstance(tracks, Calibration):
        return build(calibration=tracks, **about)
    if isinstance(tracks, TmaResult):
        return build(motion=tracks, calibration=calibration, **about)
    if isinstance(tracks, StudyResult):
        return build(study=tracks, calibration=calibration, **about)
    return build(tracks, calibration=calibration, **about)
