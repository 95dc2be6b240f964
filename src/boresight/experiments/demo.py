"""`boresight demo`: the recording that comes with the package, tracked and held against truth.

The sky is invented and its truth known, and so are the radar's errors. They are not removed here,
so every figure is given twice: against the truth, and against the truth as this radar, with its
errors of range, azimuth and time, would see it without noise. The difference is what a calibration
is worth.
"""

import json
from dataclasses import dataclass
from importlib.resources import files
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

FILTERS = ("ekf", "mekf")
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


@dataclass(frozen=True, kw_only=True)
class DemoResult:
    """What the demo found.

    Attributes:
        facts: what was planted, and counts, as shipped.
        results: filter's name to its tracks.
        comparisons: each filter against the truth.
        as_seen: each filter against the truth as the biased radar would see it without noise.
        plot_error: the same for plots before filtering.
        remarks: sentences for the reader.
    """

    facts: dict[str, Any]
    results: dict[str, TrackingResult]
    comparisons: list[Comparison]
    as_seen: list[Comparison]
    plot_error: PlotError
    remarks: list[str]


def shipped() -> tuple[dict[str, Any], Truth]:
    """Return what was planted and the truth, as they come with the package."""
    import io

    import polars as pl

    folder = files("boresight") / "demo"
    facts = json.loads((folder / "facts.json").read_text(encoding="utf-8"))
    return facts, Truth(pl.read_parquet(io.BytesIO((folder / "truth.parquet").read_bytes())))


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


def compare(
    result: TrackingResult, reference: Motion, rows: "pl.DataFrame", ns: float
) -> Comparison:
    """Hold track rows (n) against where their flights were, horizontally.

    Errors of one track are alike from scan to scan, so in the band of the ANEES a track counts
    once, however many its scans.
    """
    error, cov = _planar_error(reference, rows), _planar_cov(rows)
    nees = np.einsum("ni,ni->n", error, np.linalg.solve(cov, error[..., None])[..., 0])
    return Comparison(
        filter=result.filter,
        position_rmse_m=_rms(error[:, :2]),
        velocity_rmse_mps=_rms(error[:, 2:]),
        anees=float(np.mean(nees)) / len(_PLANAR),
        anees_bounds=_band(len(_PLANAR) * rows["track"].n_unique()),
        nis_per_dof=result.nis["all"]["mean"],
        updates=result.used,
        ns_per_update=ns,
    )


def plot_error(result: TrackingResult, truth: Truth, facts: dict[str, Any]) -> PlotError:
    """Return the horizontal error of the plots that tracks used, at the true elevation."""
    import polars as pl

    identity = result.targets.select("track", "address", "mode_a")
    used = result.residuals.filter("used").select("track", "time_s", "range_m", "azimuth_deg")
    rows = _with_flight(used.join(identity, on="track"), facts).filter(pl.col("range_m") > 0)
    when = rows["flight"].to_numpy(), rows["time_s"].to_numpy()
    true, seen = truth.at(*when), as_seen(truth, *when, facts)
    return PlotError(_rms(_plot_errors(rows, true)), _rms(_plot_errors(rows, seen)), len(rows))


def settled_rows(result: TrackingResult, facts: dict[str, Any]) -> "pl.DataFrame":
    """Return the track rows that are judged, with the `flight` of each: updated, after eight."""
    import polars as pl

    order = pl.int_range(pl.len()).over("track")
    rows = result.tracks.filter(pl.col("status") == "updated").filter(order >= _SETTLED)
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
