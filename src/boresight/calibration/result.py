"""What a calibration found, in plain data: printed, drawn in the report, kept in a file."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from boresight.maths.frames import Site
from boresight.models.systematic import SystematicErrors

if TYPE_CHECKING:
    import polars as pl

Array = Any


@dataclass(frozen=True, kw_only=True)
class TermFound:
    """One systematic error.

    Attributes:
        estimate: measured minus true, in the unit of the term's name.
        sd: standard deviation, errors of one target taken as alike (clustered).
        ci95: 95 % confidence interval.
        observable: whether the geometry tells it from the other terms and from nothing.
        independent_sd: what `sd` would be if all pairs erred independently: too small, and shown so
            that a reader sees by how much.
    """

    estimate: float
    sd: float
    ci95: tuple[float, float]
    observable: bool
    independent_sd: float


@dataclass(frozen=True, kw_only=True)
class Direction:
    """A combination of terms that the geometry does not tell, or hardly.

    Attributes:
        weights: by term, in its own unit: adding these together changes no plot, or hardly.
        observable: False if nothing of it can be told; True if it is told, but badly.
        correlation: of the two terms that share most of it; NaN if it is of one term alone.
        words: for a reader.
    """

    weights: dict[str, float]
    observable: bool
    correlation: float
    words: str


class Law(NamedTuple):
    """The law of one channel's noise: two normal laws of mean zero, one narrow and one wide.

    Attributes:
        sd: of the narrow one, in the channel's unit at the door (m, degrees).
        tail_share: of plots that belong to the wide one.
        tail_sd: of the wide one.
    """

    sd: float
    tail_share: float
    tail_sd: float


@dataclass(frozen=True, kw_only=True)
class NoiseFound:
    """What is left when the systematic errors are taken out; robust standard deviations.

    Attributes:
        range_m, azimuth_deg, elevation_deg: of single plots about the level of their target, what
            wanders along it included; None where not measured.
        target_range_m: of the delay from transponder to transponder.
        outlier_share: of pairs that are no measurement of their target.
        laws: by `range_m`, `azimuth_deg`, `elevation_deg`: the law fitted to the residuals.
        residual_range_m, residual_azimuth_deg: of all that is left, delays included, outliers
            aside; NaN if not told.
    """

    range_m: float
    azimuth_deg: float
    elevation_deg: float | None = None
    target_range_m: float
    outlier_share: float
    laws: dict[str, Law] = field(default_factory=dict)
    residual_range_m: float = float("nan")
    residual_azimuth_deg: float = float("nan")


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """What is wrong with one radar.

    Attributes:
        errors: estimate and joint covariance of all terms; what plots are corrected by.
        terms: each term on its own.
        directions: what cannot be told apart.
        noise: of the plots.
        pairs: number of pairs used.
        targets: number of targets in them.
        dropped: plots that made no pair, by reason.
        reference: what it was: "adsb", "system tracks", "table", "downlink".
        sensor: SAC/SIC, or "".
        site: of the radar.
        atmosphere: the air taken out before, "none" for none.
        air_gain_m_per_km: what the delay of a standard atmosphere would look like as a gain.
        residuals: one row for each pair, before and after; see `calibration.residuals`.
        tables: further tables by name: `noise_by_...`, `detection_by_...`, `false_by_...` (range,
            azimuth), `sectors`, `over_time`, `drift`, `steps`; see `residuals`, `detection`,
            `false_plots`, `stability`.
        settings: how it was made.
        remarks: sentences for the reader.
    """

    errors: SystematicErrors
    terms: dict[str, TermFound]
    directions: tuple[Direction, ...]
    noise: NoiseFound
    pairs: int
    targets: int
    dropped: dict[str, int]
    reference: str
    sensor: str
    site: Site | None
    atmosphere: str
    air_gain_m_per_km: float
    residuals: "pl.DataFrame"
    tables: "dict[str, pl.DataFrame]" = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
