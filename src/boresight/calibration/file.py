"""`calibration.toml`: what is wrong with a radar, kept for the tracker and for a reader.

The joint covariance is in the file, so a tracker can carry what the calibration does not know; the
residuals are not: they are in the report and in `residuals.parquet` beside it.
"""

import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from boresight.calibration.result import Calibration, Direction, NoiseFound, TermFound
from boresight.errors import DataError, MissingInputError, OutputError
from boresight.maths.frames import Site
from boresight.models.systematic import TERMS, SystematicErrors

if TYPE_CHECKING:
    from pydantic import ValidationError

FORMAT, VERSION = "boresight calibration", 1
_ROUNDING = 1e-9


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
    except (OSError, UnicodeDecodeError) as error:
        raise MissingInputError(
            f"the calibration {path} cannot be read",
            why=str(getattr(error, "strerror", None) or error),
            next_step="make one: boresight calibrate FILE --reference adsb -o DIR",
        ) from error
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _no_calibration(path, str(error)) from None
    if document.get("format") != FORMAT:
        raise _no_calibration(path, f'it does not say format = "{FORMAT}"')
    if document.get("version") != VERSION:
        raise _no_calibration(path, f"its version is {document.get('version')}, not {VERSION}")
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
    except ValidationError as error:
        raise _no_calibration(path, _first(error)) from None
    import numpy as np
    import polars as pl

    terms = tuple(kept.covariance.terms)
    estimate = np.array([kept.terms[name].estimate for name in terms])
    if not np.isfinite(estimate).all():
        raise _no_calibration(path, "an estimate is not a number")
    cov = np.array(kept.covariance.rows)
    if (
        np.abs(cov - cov.T).max() > _ROUNDING * np.abs(cov).max()
        or np.linalg.eigvalsh(cov).min() < -_ROUNDING * np.abs(cov).max()
    ):
        raise _no_calibration(path, "covariance.rows is not the covariance of covariance.terms")
    return Calibration(
        errors=SystematicErrors(terms=terms, estimate=estimate, cov=cov),
        terms=kept.terms,
        directions=tuple(kept.directions),
        noise=kept.noise,
        residuals=pl.DataFrame(),
        site=kept.site,
        **kept.model_dump(include=_PLAIN),
    )


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
    return f"{'.'.join(str(part) for part in fault['loc'])}: {fault['msg']}"


def _schema() -> Any:
    """What a file must hold; built when one is read, since pydantic takes long to import."""
    from pydantic import BaseModel, ConfigDict, Field, model_validator

    Finite = Annotated[float, Field(allow_inf_nan=False)]

    class Covariance(BaseModel):
        terms: list[str]
        rows: list[list[Finite]]

    class Document(BaseModel):
        model_config = ConfigDict(extra="ignore")

        sensor: str
        reference: str
        atmosphere: str
        pairs: int
        targets: int
        air_gain_m_per_km: float
        terms: dict[str, TermFound]
        covariance: Covariance
        noise: NoiseFound
        directions: list[Direction] = []
        dropped: dict[str, int] = {}
        settings: dict[str, Any] = {}
        remarks: list[str] = []
        site: Site | None = None

        @model_validator(mode="after")
        def _terms_are_known(self) -> "Document":
            lost = [n for n in self.covariance.terms if n not in self.terms or n not in TERMS]
            if lost:
                raise ValueError(f"covariance.terms names {lost[0]}, which is not among the terms")
            lengths = {len(self.covariance.rows), *map(len, self.covariance.rows)}
            if lengths != {len(self.covariance.terms)}:
                raise ValueError("covariance.rows is no square of the size of covariance.terms")
            return self

    return Document
