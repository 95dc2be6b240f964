"""The verb `calibrate`: a recording and a reference, whatever these are, make one calibration."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from boresight.errors import DataError, UsageError
from boresight.interfaces import door, reading
from boresight.maths.frames import Site
from boresight.models.atmosphere import Atmosphere
from boresight.models.checks import as_number

if TYPE_CHECKING:
    import polars as pl

    from boresight.calibration.references import Reference
    from boresight.calibration.result import Calibration
    from boresight.formats.recording import Recording

DOWNLINK = "downlink"
# What may be said instead of a file, and which reference of the recording it is.
IN_THE_RECORDING = {"adsb": "adsb", "system-tracks": "system tracks"}


def calibrate(
    plots: "pl.DataFrame | str | PathLike[str]",
    *,
    reference: "str | PathLike[str] | pl.DataFrame",
    site: Site | tuple[float, float, float] | None = None,
    sensor: str | None = None,
    terms: Sequence[str] | str | None = None,
    atmosphere: Atmosphere | str | None = None,
    gate_m: float | None = None,
) -> "Calibration":
    """Find what is wrong with a radar, and how sure that is.

    Args:
        plots: what `read` gives, or the recording's path.
        reference: "adsb" or "system-tracks" of the recording itself; "downlink", what aircraft told
            a Mode S radar of their motion; a file (ASTERIX with CAT021 or CAT062, CSV, Parquet); or
            a frame with time_s, latitude_deg, longitude_deg, and address, mode_a or target.
        site: of the radar: latitude and longitude in degrees, height above the ellipsoid in m.
            Left out: what the recording says of it, if `plots` is a recording that does.
        sensor: "SAC/SIC", if the plots are of several.
        terms: what may be wrong: full names such as "range_bias_m", or "range", "gain", "azimuth",
            "eccentricity", "time", "elevation", "site"; in a list, or in a text, parted by commas.
            Left out: all but the site.
        atmosphere: the air whose delay is taken out of the ranges before, such as "exponential";
            None for none.
        gate_m: how far from its plot a target may be where the radar tells no identity.

    Returns:
        Estimates with intervals and joint covariance, noise, what cannot be told apart; see
        `boresight.calibration.result.Calibration`. `track(..., calibration=...)` takes it.

    Raises:
        UsageError: no site is known, or "adsb" of a frame that is not as `read` gave it.
        DataError: the reference has nothing in common with the plots, or a column is missing.
    """
    read = reading.recording(plots)
    _check_frame(read.plots)
    _check_reference(reference, known=bool(read.summary))
    if sensor is not None and "sensor" in read.plots.columns:
        sensor = door.sensor(sensor, read.plots["sensor"].drop_nulls().unique().sort().to_list())
    if gate_m is not None:
        as_number("gate_m", gate_m)
    return calibrated(
        read,
        Path(reference) if isinstance(reference, PathLike) else reference,
        site=door.place(site) or reading.own_site(read, sensor),
        sensor=sensor,
        terms=None if terms is None else _terms(terms),
        atmosphere=door.atmosphere(atmosphere),
        gate_m=gate_m,
    )


def _terms(given: Sequence[str] | str) -> tuple[str, ...]:
    return door.terms(given if isinstance(given, str) else ",".join(given))


def _check_reference(reference: Any, *, known: bool) -> None:
    """UsageError where a reference is of no kind, or asked of a recording that is not known."""
    import polars as pl

    if not isinstance(reference, str | PathLike | pl.DataFrame):
        raise UsageError(
            f"the reference is a {type(reference).__name__}",
            next_step='give "adsb", "system-tracks" or "downlink", a file, or a Polars frame',
        )
    if isinstance(reference, str) and reference in IN_THE_RECORDING and not known:
        raise UsageError(
            f"a frame of plots holds no reference {reference!r}",
            why="only the frame that read gave, as it gave it, knows the recording it came from",
            next_step="give the recording's path instead of the frame, or the reference's own",
        )


def _check_frame(plots: "pl.DataFrame") -> None:
    """UsageError or DataError where plots are no frame, or lack a column or numbers in it."""
    import polars as pl

    from boresight.formats.schema import OUR_NAMES, PLOTS

    if not isinstance(plots, pl.DataFrame):
        raise UsageError(
            f"the plots are a {type(plots).__name__}", next_step="give what read returns, or a path"
        )
    lacking = [name for name in PLOTS.required if name not in plots.columns]
    wrong = [
        name
        for name, dtype in plots.schema.items()
        if name in OUR_NAMES.values() and not (dtype.is_numeric() or dtype in (pl.Null, pl.Boolean))
    ]
    if plots.is_empty():
        raise DataError("there are no plots", next_step="boresight inspect FILE says what it holds")
    if lacking or wrong:
        raise DataError(
            f"the plots have no column {lacking[0]!r}"
            if lacking
            else f"the plots' column {wrong[0]!r} holds {plots[wrong[0]].dtype}, not numbers",
            why=f"their columns are {', '.join(plots.columns)}",
            next_step="see boresight.read; cast text to numbers with cast(pl.Float64)",
        )


def calibrated(
    read: "Recording",
    reference: "str | Path | pl.DataFrame",
    *,
    site: Site | None,
    sensor: str | None,
    terms: tuple[str, ...] | None,
    atmosphere: Atmosphere | None,
    gate_m: float | None,
    columns: Mapping[str, str] | None = None,
) -> "Calibration":
    """The calibration of one radar of a recording; arguments as `calibrate` has read them.

    `columns` are those of the reference, if it is the file of a table: our name to the file's.
    """
    from boresight.calibration.calibrate import calibrate as by_reference
    from boresight.calibration.calibrate import calibrate_by_downlink

    if site is None:
        raise UsageError(
            "where the radar stands is not known",
            why="the recording does not say (CAT034, item 120)",
            next_step="give the site: --site LAT,LON,H, or site=(latitude_deg, longitude_deg, "
            "height_m)",
        )
    if isinstance(reference, str) and reference == DOWNLINK:
        _refuse(terms, "terms", "it finds the azimuth bias")
        _refuse(gate_m, "a gate", "nothing is paired")
        return calibrate_by_downlink(read.plots, site, sensor=sensor, atmosphere=atmosphere)
    return by_reference(
        read.plots,
        _reference(read, reference, columns),
        site,
        sensor=sensor,
        terms=terms,
        atmosphere=atmosphere,
        gate_m=gate_m,
    )


def _refuse(value: Any, what: str, why: str) -> None:
    if value is not None:
        raise UsageError(
            f"{what} and the reference {DOWNLINK!r} do not go together",
            why=why,
            next_step=f"leave {what} out, or give another reference",
        )


def _reference(
    read: "Recording", given: "str | Path | pl.DataFrame", columns: Mapping[str, str] | None
) -> "Reference":
    from boresight.calibration import references

    if not isinstance(given, str | Path):
        return references.from_table(given)
    name = str(given)
    if name in IN_THE_RECORDING:
        return references.from_recording(read, IN_THE_RECORDING[name])
    return references.from_file(name, columns=columns)


def read_calibration(path: str | PathLike[str]) -> "Calibration":
    """A calibration from its `calibration.toml`.

    Raises:
        MissingInputError: the file is not there or cannot be read.
        DataError: it is no calibration.
    """
    from boresight.calibration.file import read_calibration as read_file

    return read_file(Path(path))


def write_calibration(calibration: "Calibration", path: str | PathLike[str]) -> Path:
    """Write a calibration as TOML and return the path.

    Raises:
        OutputError: the file cannot be written.
    """
    from boresight.calibration.file import write_calibration as write_file

    return write_file(calibration, Path(path))
