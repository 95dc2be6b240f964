"""Tracks and plots of the demo, held against its truth and against what its radar would see.

`facts` is what `boresight.experiments.demo.shipped` gives: site, planted errors, flights.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from boresight.experiments.truth import Motion, Truth
from boresight.maths import frames
from boresight.maths.angles import wrap
from boresight.maths.gaussian import Array
from boresight.models.atmosphere import ExponentialAtmosphere
from boresight.tracking.result import Comparison, TrackingResult

if TYPE_CHECKING:
    import polars as pl

ELSEWHERE_M = 5_000.0  # median distance from its flight beyond which a track is a false one
_SETTLED = 8  # updates of a track before it is judged, as after any start
_PLANAR = (0, 1, 3, 4)  # east, north and their rates, of the six states


class PlotError(NamedTuple):
    """Horizontal error of plots before any filter, root mean square in metres.

    Attributes:
        as_measured: against the truth at the time the radar states.
        unbiased: what is left once the planted errors and the air's delay are taken out.
        plots: how many.
    """

    as_measured: float
    unbiased: float
    plots: int

    @property
    def share_of_bias(self) -> float:
        """Share of the mean squared error that is bias."""
        return 1 - (self.unbiased / self.as_measured) ** 2


class Held(NamedTuple):
    """One filter against the truth; against what the radar would see; that in straight flight."""

    true: Comparison
    seen: Comparison
    straight: Comparison


def hold(result: TrackingResult, truth: Truth, facts: dict[str, Any], ns: float) -> Held:
    """Hold one filter's tracks against the truth, in the three ways of `DemoResult`."""
    rows = settled_rows(result, facts, false_tracks(result, truth, facts))
    when = rows["flight"].to_numpy(), rows["time_s"].to_numpy()
    true, seen = truth.at(*when), as_seen(truth, *when, facts)
    level = rows["straight"].fill_null(value=False).to_numpy()
    nis = {name: result.nis[name]["mean"] for name in ("all", "straight")}
    figures = {"filter": result.filter, "updates": result.used, "ns_per_update": ns}
    return Held(
        compare(true, rows, nis_per_dof=nis["all"], **figures),
        compare(seen, rows, nis_per_dof=nis["all"], **figures),
        compare(
            Motion(seen.position[level], seen.velocity[level]),
            rows.filter(level),
            nis_per_dof=nis["straight"],
            **figures,
        ),
    )


def as_seen(truth: Truth, flight: Array, time_s: Array, facts: dict[str, Any]) -> Motion:
    """Return flights (n,) as the radar would report them at times (n,) if it had no noise.

    Its clock is fast, its azimuth turned, its range too long.
    """
    then = truth.at(flight, time_s - facts["radar"]["time_bias_s"])
    step = 0.1 * then.velocity
    ahead, behind = (_seen_place(then.position + sign * step, facts) for sign in (1, -1))
    return Motion(_seen_place(then.position, facts), (ahead - behind) / 0.2)


def _seen_place(place: Array, facts: dict[str, Any]) -> Array:
    """Add the air's delay and the biases of range and azimuth to positions (n, 3)."""
    radar, site = facts["radar"], frames.Site(**facts["site"])
    air = ExponentialAtmosphere(
        surface_refractivity=radar["atmosphere"]["surface_refractivity"],
        scale_height_m=radar["atmosphere"]["scale_height_m"],
    )
    polar, (east, north, up) = frames.polar_from_enu(place), place.T
    height = frames.ellipsoid_height(east, north, up, site)
    excess = air.excess_range(polar.range_m, height, site.height_m) + radar["range_bias_m"]
    turn = np.radians(radar["azimuth_bias_deg"])
    return frames.enu_from_polar(polar.range_m + excess, polar.azimuth + turn, polar.elevation)


def compare(reference: Motion, rows: "pl.DataFrame", **figures: Any) -> Comparison:
    """Hold track rows (n) against where their flights were, horizontally.

    Errors of one track are alike from scan to scan, so in the band of the ANEES a track counts
    once, however many its scans. `figures` are the other fields of the comparison.
    """
    error, cov = _planar_error(reference, rows), _planar_cov(rows)
    nees = np.einsum("ni,ni->n", error, np.linalg.solve(cov, error[..., None])[..., 0])
    return Comparison(
        position_rmse_m=_rms(error[:, :2]),
        velocity_rmse_mps=_rms(error[:, 2:]),
        anees=float(np.mean(nees)) / len(_PLANAR),
        anees_bounds=_band(len(_PLANAR) * rows["track"].n_unique()),
        **figures,
    )


def plot_error(
    result: TrackingResult, truth: Truth, facts: dict[str, Any], false: list[int]
) -> PlotError:
    """Return the horizontal error of the plots that tracks used, at the true elevation."""
    import polars as pl

    identity = result.targets.select("track", "address", "mode_a")
    used = result.residuals.filter(pl.col("used") & ~pl.col("track").is_in(false))
    rows = _with_flight(used.join(identity, on="track"), facts)
    when = rows["flight"].to_numpy(), rows["time_s"].to_numpy()
    true, seen = truth.at(*when), as_seen(truth, *when, facts)
    return PlotError(_rms(_plot_errors(rows, true)), _rms(_plot_errors(rows, seen)), len(rows))


def false_tracks(result: TrackingResult, truth: Truth, facts: dict[str, Any]) -> list[int]:
    """Return the tracks that bear a flight's identity and are not where it is: reflections."""
    import polars as pl

    rows = _with_flight(result.tracks, facts)
    error = _planar_error(truth.at(rows["flight"].to_numpy(), rows["time_s"].to_numpy()), rows)
    miss = pl.Series("miss", np.hypot(error[:, 0], error[:, 1])).fill_nan(None)
    middle = rows.with_columns(miss).group_by("track").agg(pl.col("miss").median())
    return sorted(middle.filter(pl.col("miss") > ELSEWHERE_M)["track"].to_list())


def settled_rows(result: TrackingResult, facts: dict[str, Any], false: list[int]) -> "pl.DataFrame":
    """Return the track rows to judge, `flight` and `straight` beside them: updated, after eight."""
    import polars as pl

    order = pl.int_range(pl.len()).over("track")
    judged = (pl.col("status") == "updated") & ~pl.col("track").is_in(false)
    rows = result.tracks.filter(judged).filter(order >= _SETTLED)
    level = result.residuals.select("track", "time_s", "straight")
    rows = rows.join(level, on=["track", "time_s"], how="left", maintain_order="left")
    return _with_flight(rows, facts)


def _with_flight(rows: "pl.DataFrame", facts: dict[str, Any]) -> "pl.DataFrame":
    """Add `flight`, found by address or, without one, by Mode A code; drop what is no flight's."""
    import polars as pl

    flights = pl.DataFrame(facts["flights"]).with_row_index("flight")
    by_address = flights.filter(pl.col("address") != "").select("flight", "address")
    by_code = flights.filter(pl.col("address") == "").select("flight", "mode_a")
    has_address = pl.col("address").fill_null("") != ""
    named = rows.filter(has_address).join(by_address, on="address")
    coded = rows.filter(~has_address).join(by_code, on="mode_a")
    return pl.concat([named, coded], how="diagonal")


def _plot_errors(rows: "pl.DataFrame", motion: Motion) -> Array:
    """Return radial and tangential error (n, 2) in the horizontal plane, metres."""
    polar = frames.polar_from_enu(motion.position)
    azimuth = np.radians(rows["azimuth_deg"].to_numpy())
    radial = rows["range_m"].to_numpy() - polar.range_m
    tangential = polar.range_m * wrap(azimuth - polar.azimuth)
    return np.stack([radial, tangential], axis=-1) * np.cos(polar.elevation)[:, None]


def _planar_error(reference: Motion, rows: "pl.DataFrame") -> Array:
    state = rows.select("east_m", "north_m", "east_mps", "north_mps").to_numpy()
    return state - np.hstack([reference.position[:, :2], reference.velocity[:, :2]])


def _planar_cov(rows: "pl.DataFrame") -> Array:
    """Covariance (n, 4, 4) of the planar states out of the upper triangle's columns."""
    names = [f"cov_{min(i, j)}_{max(i, j)}" for i in _PLANAR for j in _PLANAR]
    columns = [rows[name].to_numpy() for name in names]
    return np.stack(columns, axis=-1).reshape(-1, len(_PLANAR), len(_PLANAR))


def _band(dof: int) -> tuple[float, float]:
    """Return the 95 % band of a chi-square variable over its degrees of freedom."""
    from scipy.special import chdtri

    return float(chdtri(dof, 0.975)) / dof, float(chdtri(dof, 0.025)) / dof


def _rms(vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(vectors), axis=-1))))
