"""`calibration.toml`: what is wrong with a radar, kept for the tracker and for a reader.

The joint covariance is in the file, so a tracker can carry what the calibration does not know; the
residuals are not: they are in the report and in `residuals.parquet` beside it.
"""

import tomllib
from dataclasses import asdict
from math import isfinite, isinf, isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from boresight.calibration.result import Calibration, Direction, NoiseFound, TermFound
from boresight.errors import DataError, MissingInputError, OutputError, UsageError
from boresight.maths.frames import Site
from boresight.models.atmosphere import atmosphere
from boresight.models.systematic import TERMS, SystematicErrors

if TYPE_CHECKING:
    from pydantic import ValidationError

FORMAT, VERSION = "boresight calibration", 1
_ROUNDING = 1e-9
_WIDEST_DEG = 180.0


def write_calibration(found: Calibration, path: Path) -> Path:
    """Write a calibration and return the path.

    Raises:
        OutputError: the file cannot be written.
    """
    import tomli_w

    text = tomli_w.dumps(_without_none(as_document(found)))
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"the calibration cannot be written to {path}",
            why=error.strerror or str(error),
            next_step="name a folder you may write to, with -o DIR",
        ) from error
    return path


def as_document(found: Calibration) -> dict[str, Any]:
    """What the file holds, as plain data."""
    errors = found.errors
    return {
        "format": FORMAT,
        "version": VERSION,
        "sensor": found.sensor,
        "reference": found.reference,
        "atmosphere": found.atmosphere,
        "pairs": found.pairs,
        "targets": found.targets,
        "air_gain_m_per_km": found.air_gain_m_per_km,
        "remarks": list(found.remarks),
        "site": asdict(found.site) if found.site else None,
        "terms": {
            name: asdict(term) | {"ci95": list(term.ci95), "unit": TERMS[name].unit}
            for name, term in found.terms.items()
        },
        "covariance": {"terms": list(errors.terms), "rows": errors.cov.tolist()},
        "noise": asdict(found.noise)
        | {"laws": {name: law._asdict() for name, law in found.noise.laws.items()}},
        "directions": [asdict(each) for each in found.directions],
        "dropped": dict(found.dropped),
        "settings": found.settings,
    }


def _without_none(value: Any) -> Any:
    """TOML has no null: what is not known is left out."""
    if isinstance(value, dict):
        return {str(k): _without_none(v) for k, v in value.items() if v is not None}
    if isinstance(value, list | tuple):
        return [_without_none(each) for each in value if each is not None]
    return value.item() if hasattr(value, "item") else value


def read_calibration(path: Path) -> Calibration:
    """Read what `write_calibration` wrote; residuals and tables are not in the file.

    Raises:
        MissingInputError: there is no such file, or it cannot be read.
        DataError: it is no calibration, or one of a later version, or damaged.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise MissingInputError(
            f"the calibration {path} cannot be read",
            why=error.strerror or str(error),
            next_step="make one: boresight calibrate FILE --reference adsb -o DIR",
        ) from error
    except UnicodeDecodeError:
        raise _no_calibration(path, "it is not text") from None
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _no_calibration(path, str(error)) from None
    if document.get("format") != FORMAT:
        raise _no_calibration(path, f'it does not say format = "{FORMAT}"')
    if document.get("version") != VERSION:
        raise _no_calibration(path, f"its version is {document.get('version')!r}, not {VERSION}")
    return _from_document(path, document)


def _no_calibration(path: Path, why: str) -> DataError:
    return DataError(
        f"{path} is not a calibration",
        why=why,
        next_step="give the calibration.toml that boresight calibrate -o DIR writes",
    )


def _from_document(path: Path, document: dict[str, Any]) -> Calibration:
    from pydantic import ValidationError

    try:
        kept = _schema().model_validate(document)
        errors = _errors(kept)
        atmosphere(kept.atmosphere)
    except ValidationError as error:
        raise _no_calibration(path, _first(error)) from None
    except (UsageError, ValueError) as error:
        raise _no_calibration(path, str(getattr(error, "what", error))) from None
    import polars as pl

    return Calibration(
        errors=errors,
        terms=kept.terms,
        directions=tuple(kept.directions),
        noise=kept.noise,
        residuals=pl.DataFrame(),
        site=kept.site,
        **kept.model_dump(include=_PLAIN),
    )


def _errors(kept: Any) -> SystematicErrors:
    """Estimates with their joint covariance; ValueError where it is none."""
    import numpy as np

    terms = tuple(kept.covariance.terms)
    cov = np.array(kept.covariance.rows)
    sd = np.sqrt(np.maximum(np.diag(cov), 0.0))
    alike = cov / np.outer(*[np.where(sd > 0, sd, 1.0)] * 2)  # one scale for metres and degrees
    if np.abs(alike - alike.T).max() > _ROUNDING or np.linalg.eigvalsh(alike).min() < -_ROUNDING:
        raise ValueError("covariance.rows is not the covariance of covariance.terms")
    estimate = np.array([kept.terms[name].estimate for name in terms])
    return SystematicErrors(terms=terms, estimate=estimate, cov=cov)


_PLAIN = {
    "sensor",
    "reference",
    "atmosphere",
    "pairs",
    "targets",
    "air_gain_m_per_km",
    "remarks",
    "dropped",
    "settings",
}


def _first(error: "ValidationError") -> str:
    """The first fault of a file, with its place."""
    fault = error.errors()[0]
    said = fault["msg"].removeprefix("Value error, ")
    return ": ".join(part for part in (".".join(map(str, fault["loc"])), said) if part)


def _schema() -> Any:
    """What a file must hold; built when one is read, since pydantic takes long to import."""
    from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

    Finite = Annotated[float, Field(allow_inf_nan=False)]
    Count = Annotated[int, Field(ge=0)]

    class Covariance(BaseModel):
        terms: list[str]
        rows: list[list[Finite]]

    class Document(BaseModel):
        model_config = ConfigDict(extra="ignore")

        sensor: str
        reference: str
        atmosphere: str
        pairs: Count
        targets: Count
        air_gain_m_per_km: float
        terms: dict[str, Annotated[TermFound, AfterValidator(_possible_term)]]
        covariance: Covariance
        noise: Annotated[NoiseFound, AfterValidator(_possible_noise)]
        directions: list[Direction] = []
        dropped: dict[str, int] = {}
        settings: dict[str, Any] = {}
        remarks: list[str] = []
        site: Site | None = None

        @model_validator(mode="after")
        def _terms_are_those_of_the_covariance(self) -> "Document":
            strange = [name for name in self.terms if name not in TERMS]
            if strange:
                raise ValueError(f"terms names {strange[0]}, which is none of {', '.join(TERMS)}")
            names = self.covariance.terms
            if not names or sorted(names) != sorted(self.terms):
                raise ValueError(
                    f"covariance.terms names {', '.join(names) or 'nothing'}, and the terms are "
                    f"{', '.join(self.terms) or 'none'}"
                )
            lengths = {len(self.covariance.rows), *map(len, self.covariance.rows)}
            if lengths != {len(names)}:
                raise ValueError("covariance.rows is no square of the size of covariance.terms")
            return self

    return Document


def _possible_term(term: TermFound) -> TermFound:
    if not isfinite(term.estimate):
        raise ValueError("the estimate is not a number")
    if not (term.sd >= 0 and term.independent_sd >= 0):
        raise ValueError("a standard deviation is negative or not a number")
    return term


def _possible_noise(noise: NoiseFound) -> NoiseFound:
    """NaN is noise that is not known; none is negative, and none of a measured channel is zero."""
    for name in ("range_m", "azimuth_deg"):
        if getattr(noise, name) <= 0 or isinf(getattr(noise, name)):
            raise ValueError(f"{name} is {getattr(noise, name)}, no standard deviation")
    if noise.azimuth_deg > _WIDEST_DEG:
        raise ValueError(f"azimuth_deg is {noise.azimuth_deg}, more than half a turn")
    if noise.target_range_m < 0 or isinf(noise.target_range_m):
        raise ValueError(f"target_range_m is {noise.target_range_m}, no standard deviation")
    if not (isnan(noise.outlier_share) or 0 <= noise.outlier_share <= 1):
        raise ValueError(f"outlier_share is {noise.outlier_share}, not between 0 and 1")
    return noise
