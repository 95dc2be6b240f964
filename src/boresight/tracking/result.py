"""What tracking a recording yields: tables, counts and sentences; nothing that still computes."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, kw_only=True)
class TrackingResult:
    """Tracks of one recording, with everything a reader needs to trust or distrust them.

    Attributes:
        tracks: one row per track and plot time: `track`, `time_s`, `latitude_deg`,
            `longitude_deg`, `height_m` (above the ellipsoid), `east_m`, `north_m`, `up_m`,
            `east_mps`, `north_mps`, `up_mps` (ENU at the site), `cov_I_J` for I <= J < 6 (upper
            triangle of the ENU state's covariance), `nis`, `dof`, `status` (`started`,
            `updated`, `rejected`, `restarted`), `address`, `mode_a`, `aircraft_id`, `sensor`.
        residuals: one row per track and plot: `track`, `time_s`, `sensor`, `range_m`,
            `azimuth_deg`, `range_residual_m`, `range_sd_m`, `azimuth_residual_deg`,
            `azimuth_sd_deg`, `height_residual_m`, `height_sd_m`, `nis`, `dof`, `straight`
            (downlinked roll below 2 degrees around it; null where no roll is known), `used`.
            A residual is measured minus predicted; its sd is the filter's own.
        targets: one row per track, worst first: `track`, `address`, `mode_a`, `aircraft_id`,
            `first_s`, `last_s`, `plots`, `used`, `rejected`, `restarts`, `nis_per_dof`,
            `nis_low`, `nis_high` (95 % chi-square band of that mean), `verdict`, `fixed`,
            `range_sd_m`, `azimuth_sd_deg` (scatter of the plots of a fixed target, else null).
        skipped: `reason`, `count`, `meaning`: every plot that was not used, and why.
        plots: number of plots in the recording.
        used: number of plots that updated a track.
        rejected: number of plots outside their track's gate.
        filter: the filter's catalogue name.
        nis: `all`, `straight`, `straight_first_half`, `straight_second_half`, from the ninth plot
            after each start: each {`mean`, `median`, `dof`, `scans`}
            of the normalised innovation squared per degree of freedom.
        settings: site, sensor, atmosphere, noise and process noise with how they were chosen.
        remarks: sentences for the reader, most important first.
    """

    tracks: "pl.DataFrame"
    residuals: "pl.DataFrame"
    targets: "pl.DataFrame"
    skipped: "pl.DataFrame"
    plots: int
    used: int
    rejected: int
    filter: str
    nis: dict[str, dict[str, float]]
    settings: dict[str, Any]
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One filter against known truth, as `boresight demo` prints it.

    Attributes:
        filter: catalogue name.
        position_rmse_m, velocity_rmse_mps: against truth, horizontal.
        anees: average normalised estimation error squared per dimension; 1 is consistent.
        anees_bounds: 95 % band of `anees` were the filter consistent.
        nis_per_dof: mean normalised innovation squared per degree of freedom.
        updates: number of filter updates behind these figures.
        ns_per_update: processor time per update.
    """

    filter: str
    position_rmse_m: float
    velocity_rmse_mps: float
    anees: float
    anees_bounds: tuple[float, float]
    nis_per_dof: float
    updates: int
    ns_per_update: float
