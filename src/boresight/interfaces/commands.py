"""The commands: what each takes; the job that each returns does the work."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, TypeAlias

from cyclopts import App, Parameter

from boresight.interfaces import (
    analysing,
    calibrating,
    comparing,
    contacts,
    door,
    jobs,
    options,
    pages,
)
from boresight.interfaces.answers import Answer
from boresight.interfaces.terminal import Manner

EPILOGUE = "Every command also takes --json, --quiet and --debug: see boresight --help."

Job: TypeAlias = Callable[[Manner], Answer]

app = App(
    name="boresight",
    help=pages.SUMMARY,
    help_epilogue=EPILOGUE,
    version_flags=(),
    help_flags=("--help", "-h"),
)


@app.command
def inspect(
    file: options.File, /, *, strict: options.Strict = False, columns: options.Columns = None
) -> Job:
    """Say what a recording holds: format, sensors, times, damage."""
    return partial(jobs.inspect, file, strict=strict, columns=_columns(columns))


@app.command
def track(
    file: options.File,
    /,
    *,
    site: options.Site = None,
    sensor: Annotated[
        str | None, Parameter(help="Track this sensor's plots, SAC/SIC as inspect prints it.")
    ] = None,
    filter: options.Filters = None,  # noqa: A002 - the option is --filter
    calibration: Annotated[
        Path | None,
        Parameter(
            help="A calibration.toml: plots are corrected by it, its noise is used, and what it "
            "leaves uncertain is in the covariances."
        ),
    ] = None,
    atmosphere: options.Air = None,
    strict: options.Strict = False,
    columns: options.Columns = None,
    output: options.Output | None = None,
) -> Job:
    """Turn a recording into tracks, tables and a report."""
    return partial(
        jobs.track,
        file,
        site=door.site(site) if site is not None else None,
        sensor=sensor,
        names=filter or [door.FILTER],
        calibration=calibration,
        atmosphere=door.atmosphere(atmosphere) if atmosphere is not None else None,
        strict=strict,
        columns=_columns(columns),
        folder=output,
    )


@app.command
def calibrate(
    file: options.File,
    /,
    *,
    reference: Annotated[
        str,
        Parameter(
            help="Where the targets were: a file (ASTERIX with CAT021 or CAT062, CSV, Parquet); "
            "adsb or system-tracks of the recording itself; or downlink, the ground speed and "
            "track that aircraft told the radar (Mode S)."
        ),
    ],
    site: options.Site = None,
    sensor: Annotated[
        str | None, Parameter(help="Calibrate this sensor, SAC/SIC as inspect prints it.")
    ] = None,
    terms: Annotated[
        str | None,
        Parameter(
            show_default=lambda _: "range,gain,azimuth,eccentricity,time",
            help="What may be wrong, parted by commas; also elevation (estimated where it is "
            "measured) and site.",
        ),
    ] = None,
    atmosphere: options.Air = None,
    gate: Annotated[
        float | None,
        Parameter(help="How far from its plot a target may be, m, where the radar hears no names."),
    ] = None,
    strict: options.Strict = False,
    columns: options.Columns = None,
    reference_columns: Annotated[
        str | None, Parameter(help="The same for a table of reference (latitude_deg=lat,...).")
    ] = None,
    output: options.Output | None = None,
) -> Job:
    """Find what is wrong with a radar, against GPS, ADS-B or downlink."""
    return partial(
        calibrating.calibrate,
        file,
        reference=reference,
        site=door.site(site) if site is not None else None,
        sensor=sensor,
        terms=door.terms(terms) if terms is not None else None,
        atmosphere=door.atmosphere(atmosphere) if atmosphere is not None else None,
        gate_m=gate,
        strict=strict,
        columns=_columns(columns),
        reference_columns=_columns(reference_columns, "--reference-columns"),
        folder=output,
    )


@app.command
def tma(
    bearings: options.BearingsFile,
    /,
    *,
    own_ship: options.OwnShip,
    filter: options.MotionFilter = None,  # noqa: A002 - the option is --filter
    ranges: options.Ranges = None,
    cells: options.CellCount = None,
    overlap: options.Overlap = None,
    prune: options.Prune = None,
    speed: options.Speed = None,
    acceleration: options.Acceleration = 0.0,
    position_error: options.PositionError = 5.0,
    track: options.Contact = None,
    sigma: options.Sigma = None,
    degrees: options.Degrees = False,
    declination: options.Declination = None,
    own_ship_clock: options.OwnShipClock = 0.0,
    tow: options.Tow = 0.0,
    spacing: options.Spacing = None,
    sound_speed: options.SoundSpeed = None,
    limits: options.Limits = None,
    columns: options.BearingColumns = None,
    own_ship_columns: options.OwnShipColumns = None,
    output: options.Output | None = None,
) -> Job:
    """From bearings and own ship's track to range, course and speed."""
    nearest, farthest = door.ranges(ranges) if ranges is not None else (None, None)
    return partial(
        analysing.analyse,
        bearings,
        own_ship=own_ship,
        folder=output,
        filter=filter or contacts.FILTER,
        criteria=door.limits(limits) if limits is not None else None,
        cells=cells,
        nearest_m=nearest,
        farthest_m=farthest,
        overlap=overlap,
        prune=prune,
        speed_mps=speed,
        accel_mps2=acceleration,
        position_sd_m=position_error,
        track=track,
        sigma_deg=sigma,
        degrees=degrees,
        declination_deg=declination,
        own_ship_clock_s=own_ship_clock,
        tow_m=tow,
        array_spacing_m=spacing,
        sound_speed_mps=sound_speed,
        columns=_columns(columns),
        own_ship_columns=_columns(own_ship_columns, "--own-ship-columns"),
    )


@app.command
def demo(*, output: options.Output = Path("boresight-demo")) -> Job:
    """Calibrate and track the built-in recording, against known truth."""
    return partial(jobs.demo, output)


@app.command
def compare(
    study: options.StudyFile,
    /,
    *,
    runs: options.Runs = None,
    seed: options.Seed = None,
    engine: options.Engine = "threads",
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    chunk: options.Chunk = None,
    resume: options.Resume = False,
    output: options.StudyFolder = None,
) -> Job:
    """Compare filters over the runs of a study, with bounds and verdicts."""
    return partial(
        comparing.compare,
        study,
        runs=runs,
        seed=seed,
        engine=engine,
        workers=workers,
        scheduler=scheduler,
        chunk=chunk,
        resume=resume,
        folder=output,
    )


@app.command
def simulate(
    study: options.StudyFile,
    /,
    *,
    runs: options.Runs = None,
    seed: options.Seed = None,
    output: options.Simulated = Path("simulated"),
) -> Job:
    """Write the truth and the plots of a study, as tables."""
    return partial(comparing.simulate, study, runs=runs, seed=seed, folder=output)


@app.command
def reproduce(
    key: Annotated[str, Parameter(help="A paper's key, such as aditya, or all.")],
    /,
    *,
    runs: Annotated[int | None, Parameter(help="Runs instead of the paper's number.")] = None,
    seed: Annotated[int | None, Parameter(help="Seed instead of the usual one.")] = None,
    assume: Annotated[
        list[str] | None,
        Parameter(negative="", help="What the paper leaves open: dt_s=2. May be repeated."),
    ] = None,
    output: options.Figures = None,
) -> Job:
    """Repeat a paper's tables and claims, with a verdict for each."""
    assumed = door.assumptions(assume or [])
    return partial(jobs.reproduce, key, runs=runs, seed=seed, assume=assumed, folder=output)


@app.command
def cite(name: Annotated[str, Parameter(help="A filter's name, such as mekf.")], /) -> Job:
    """Print a filter's reference, and where the code differs from it."""
    return partial(jobs.cite, name)


def _columns(text: str | None, option: str = "--columns") -> dict[str, str] | None:
    return door.columns(text, option) if text is not None else None
