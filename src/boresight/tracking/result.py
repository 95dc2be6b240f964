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
            Times and covariance are those after a calibration: without the time bias, and with
            what is uncertain of the radar's errors, which neighbouring tracks share.
        residuals: one row per track and plot: `track`, `time_s`, `sensor`, `range_m`,
            `azimuth_deg`, `range_residual_m`, `range_sd_m`, `azimuth_residual_deg`,
            `azimuth_sd_deg`, `height_residual_m`, `height_sd_m`, `nis`, `dof`, `straight`
            (downlinked roll below 2 degrees around it; null where no roll is known), `used`.
            A residual is measured minus predicted; its sd is the filter's own. Plots are as they
            were filtered: without the air's delay, and corrected where a calibration was given.
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
        settings: site, sensor, atmosphere, noise and process noise with how they were chosen, and
            `errors`: what a calibration took out, {`estimate`, `sd`, `carried`} by term, or None.
        filters: one row per filter, side by side; the first is the one whose tracks these are.
        scores: one row per filter and plot it was scored on: `filter`, `track`, `time_s`, `nis`,
            `dof`, `loglik`, `gain` (its log-likelihood minus the first filter's; null where that
            was not scored), `straight`. None where filters were not compared.
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
    filters: "list[FilterRow]" = field(default_factory=list)
    scores: "pl.DataFrame | None" = None
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Gain:
    """A mean difference of log-likelihoods per plot.

    Attributes:
        mean: in nats; NaN where no plot is behind it.
        ci95: its 95 % interval, a track being one cluster; NaN with fewer than two tracks.
        plots, tracks: how many are behind it.
    """

    mean: float
    ci95: tuple[float, float]
    plots: int
    tracks: int


@dataclass(frozen=True, kw_only=True)
class FilterRow:
    """One filter on a recording without known truth, beside others on the same plots.

    What is scored is scored in the second half of the recording, which the noise was not chosen
    on, at plots inside the gate that come at least eight after their track's latest start.

    Attributes:
        filter: catalogue name.
        updates, rejected, restarts: plots it used, plots outside its gate, tracks started anew.
        failed_share: of plots after which its state was not finite or not positive definite.
        scored: number of plots scored.
        nis_per_dof, nis_median: normalised innovation squared per degree of freedom in straight
            flight, mean and median.
        loglik: mean log-likelihood of a plot given those before it, as a density over what the
            sensor measures (metres, radians).
        gain, gain_straight: its log-likelihood minus the first filter's over the plots that both
            were scored on, and over those in straight flight; positive where it predicts better.
        range_sd_m, azimuth_sd_deg: scatter of measured minus predicted, half the width of the
            middle 68 %.
        speed_error_median_mps, speed_error_95_mps: median and 95 % quantile of the difference from
            the downlinked ground speed, which no filter saw; NaN where none is told.
        speeds: number of downlinked speeds behind these.
        ns_per_update: processor time of one prediction, gate and update, compiled and alone.
        remark: a sentence where something went wrong, else empty.
    """

    filter: str
    updates: int
    rejected: int
    restarts: int
    failed_share: float
    scored: int
    nis_per_dof: float
    nis_median: float
    loglik: float
    gain: "Gain"
    gain_straight: "Gain"
    range_sd_m: float
    azimuth_sd_deg: float
    speed_error_median_mps: float
    speed_error_95_mps: float
    speeds: int
    ns_per_update: float
    remark: str = ""


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
